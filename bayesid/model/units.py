"""How a number in a file becomes a number inside the program: SI, radians, rpm for propeller speed.

`scale(unit, inside, where)` gives the factor. Common units come from a table; anything else asks pint,
which is imported only then. Offsets (degree Celsius) are not a unit of any channel and are refused.
"""

from __future__ import annotations

import difflib
import math
import re
from functools import lru_cache
from typing import Any

from bayesid.errors import BayesidError


class UnitError(BayesidError):
    """A unit is unknown or measures something else than the channel."""


_FT, _NM = 0.3048, 1852.0
_RPM = 2.0 * math.pi / 60.0
_DEG = math.pi / 180.0

# inside unit -> {unit as written in files: factor to the inside unit}
_TABLE: dict[str, dict[str, float]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "m": {
        "m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": _FT, "in": 0.0254, "yd": 3 * _FT,
        "nmi": _NM, "NM": _NM,
    },
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "°": _DEG, "degrees": _DEG, "degree": _DEG,
            "gon": math.pi / 200.0},
    "m/s": {
        "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6, "kn": _NM / 3600, "kt": _NM / 3600,
        "kts": _NM / 3600, "knot": _NM / 3600, "knots": _NM / 3600, "ft/s": _FT,
    },
    "rad/s": {
        "rad/s": 1.0, "mrad/s": 1e-3, "1/s": 1.0, "deg/s": _DEG, "°/s": _DEG, "deg/min": _DEG / 60,
        "rpm": _RPM,
    },
    "rpm": {
        "rpm": 1.0, "RPM": 1.0, "1/min": 1.0, "rev/min": 1.0, "rps": 60.0, "rev/s": 60.0, "1/s": 60.0,
        "Hz": 60.0, "rad/s": 1 / _RPM, "deg/s": 1 / 6,
    },
    "-": {"-": 1.0, "1": 1.0, "%": 0.01},
    "N": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "kgf": 9.80665},
    "N*m": {
        "N*m": 1.0, "N m": 1.0, "Nm": 1.0, "N·m": 1.0, "kN*m": 1e3, "kNm": 1e3, "kN m": 1e3,
        "lbf*ft": 4.4482216152605 * _FT, "ft*lbf": 4.4482216152605 * _FT,
    },
}  # fmt: skip
_QUANTITY = {
    "s": "time",
    "m": "length",
    "rad": "angle",
    "m/s": "speed",
    "rad/s": "angular rate",
    "rpm": "rotation speed",
    "-": "share",
    "N": "force",
    "N*m": "moment",
}
# products and quotients of names with one-digit powers: what pint may be asked, so that no file can make it
# evaluate a tower of exponents
_ATOM = r"[A-Za-zµμΩ°]+(?:(?:\^|\*\*)-?[1-9])?"
_PLAIN_UNIT = re.compile(rf"(?:1\s*/\s*)?{_ATOM}(?:\s*[*/·]\s*{_ATOM}|\s+{_ATOM})*")
_HUGE_ANGLE = re.compile(r"(?:G|giga)rad\b")


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


@lru_cache(maxsize=256)
def _factor(unit: str, inside: str) -> float | str:
    """Factor, or the reason there is none."""
    table = _TABLE[inside]
    if unit in table:
        return table[unit]
    wanted = f"{_QUANTITY[inside]} such as [{inside}] is expected"
    others = [quantity for quantity in _TABLE if unit in _TABLE[quantity]]
    if others:
        return f"[{unit}] is a unit of {_QUANTITY[others[0]]}, but {wanted}"
    near = difflib.get_close_matches(unit[:20], table, n=1, cutoff=0.5)
    hint = f"; did you mean [{near[0]}]?" if near else ""
    unknown = f"unit [{unit[:40]}] is not known ({wanted}{hint})"
    if _HUGE_ANGLE.match(unit):
        return f"[{unit[:40]}] would be a billion radians; degrees, Grad in German, are written [deg]"
    if len(unit) > 40 or not _PLAIN_UNIT.fullmatch(unit):
        return unknown
    try:
        registry = _registry()
        quantity = registry.Quantity(1.0, registry.parse_units(unit.replace("·", "*")))
    except Exception:  # pint raises many types on foreign text; all of them mean "unknown"
        return unknown
    try:
        factor = float(quantity.to(inside.replace("rpm", "revolution/minute")).magnitude)
        twice = float((2.0 * quantity).to(inside.replace("rpm", "revolution/minute")).magnitude)
    except Exception:
        return f"[{unit}] has another dimension; {wanted}"
    if not (math.isfinite(factor) and factor != 0.0 and math.isclose(twice, 2 * factor, rel_tol=1e-9)):
        return f"[{unit}] is not a plain multiple of [{inside}]; {wanted}"
    return factor


def scale(unit: str, inside: str, where: str) -> float:
    """Factor that turns a number in `unit` into the inside unit.

    Parameters
    ----------
    unit : as written in a file, e.g. "deg/s", "kn", "ft"
    inside : one of s, m, rad, m/s, rad/s, rpm, N, N*m, -; "1/s" means radians per second for a body rate and
        revolutions per second for a propeller
    where : file and column for the message

    Raises
    ------
    UnitError                  unknown unit or another dimension
    """
    found = _factor(unit.strip(), inside)
    if isinstance(found, str):
        raise UnitError(f"{where}: {found}")
    return found
