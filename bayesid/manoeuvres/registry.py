"""Manoeuvres by text: "zigzag:10/10", "turn:35,side=starboard", "prbs:seed=3,duration=40LU".

Takes: text in degrees, rpm, seconds or lengths travelled, and the `Scale` that sizes the rest.
Does not: hold the manoeuvres themselves (see `catalogue`).
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from typing import Any

from bayesid.errors import ManoeuvreError, raise_all
from bayesid.manoeuvres.catalogue import RAD, REGISTRY, ManoeuvreEntry, Scale
from bayesid.manoeuvres.core import Manoeuvre

FACTOR = {"deg": RAD, "s": 1.0, "rpm": 1.0, "m": 1.0, "hz": 1.0, "number": 1.0}
SIDES = {"port": 1.0, "starboard": -1.0}


def _value(kind: str, text: str, scale: Scale) -> Any:
    """SI value of one typed option; ValueError says what was expected."""
    text = text.strip()
    if kind == "text":
        return text
    if kind == "side":
        if text.lower() not in SIDES:
            raise ValueError("expected port or starboard")
        return SIDES[text.lower()]
    if kind == "int":
        try:
            whole = int(text)
        except ValueError:
            raise ValueError("expected a whole number") from None
        if not 0 <= whole < 2**63:
            raise ValueError("expected a whole number from 0 on")
        return whole
    if kind == "rpms":
        return tuple(_value("number", part, scale) for part in text.split("/"))
    lower, factor = text.lower(), FACTOR[kind]
    suffixes = {
        "deg": {"deg": RAD, "rad": 1.0},
        "s": {"lu": scale.LU, "min": 60.0, "s": 1.0},
        "rpm": {"rpm": 1.0},
        "m": {"m": 1.0, "l": scale.L},
        "hz": {"hz": 1.0},
        "number": {},
    }[kind]
    for suffix, other in suffixes.items():
        if lower.endswith(suffix):
            lower, factor = lower[: -len(suffix)], other
            break
    try:
        number = float(lower)
    except ValueError:
        number = math.nan
    if not math.isfinite(number * factor):
        units = f" ({', '.join(suffixes)})" if suffixes else ""
        raise ValueError(f"expected a number{units}")
    return number * factor


def degrees_of_freedom(texts: Iterable[str]) -> int:
    """Degrees of freedom that manoeuvres, as `parse` reads them, need: 6 where one leaves the horizontal
    plane."""
    names = (text.strip().partition(":")[0].partition(",")[0].strip().lower() for text in texts)
    return max((REGISTRY[name].dof for name in names if name in REGISTRY), default=3)


def parse(text: str, scale: Scale) -> Manoeuvre:
    """Manoeuvre from text `name[:value[/value]][,option=value]...`.

    Angles in degrees (port-positive), times in s or `LU` (lengths travelled), depth in m or `L`; `side`
    flips a rudder given without sign. `options("zigzag")` lists what a name takes.

    Raises
    ------
    ManoeuvreError    unknown name or option (with the nearest known one), a value that is no number, a
    deflection
                      beyond the limit of the scale, a 6-DOF manoeuvre for a 3-DOF vehicle; all problems at
                      once
    """
    head, _, rest = text.strip().partition(":")
    name = head.strip().lower()
    if name not in REGISTRY:
        raise ManoeuvreError(
            f"manoeuvre {text[:80]!r}: no manoeuvre {name[:40]!r}{_hint(name, REGISTRY)}; "
            f"known: {', '.join(REGISTRY)}"
        )
    entry = REGISTRY[name]
    given, problems = _split(rest, entry, scale)
    where = f"manoeuvre {text[:80]!r}"
    for option in entry.required:
        if not given.get(option):
            problems.append(f"{option} is missing; write {name}:<{option}>")
    if entry.dof > scale.dof:
        problems.append(f"{name} moves out of the horizontal plane; use a 6-DOF vehicle (dof = 6)")
    if problems:
        raise_all(ManoeuvreError, where, problems)
    return _make(where, entry, given, scale)


def _split(rest: str, entry: ManoeuvreEntry, scale: Scale) -> tuple[dict[str, Any], list[str]]:
    given: dict[str, Any] = {}
    problems: list[str] = []
    pairs: list[tuple[str, str]] = []
    for index, part in enumerate(p for p in rest.split(",") if p.strip()):
        key, equals, value = part.partition("=")
        if equals:
            pairs.append((key.strip(), value))
            continue
        one = len(entry.positional) == 1
        values = [part] if one else part.split("/")
        if index or not entry.positional:
            problems.append(f"{part.strip()[:40]!r} has no name; write option=value")
        elif len(values) > len(entry.positional):
            problems.append(
                f"{len(values)} values where {len(entry.positional)} fit ({'/'.join(entry.positional)})"
            )
        else:
            pairs += zip(entry.positional, values, strict=False)
    for key, value in pairs:
        if key not in entry.options:
            problems.append(
                f"no option {key[:40]!r}{_hint(key, entry.options)}; known: {', '.join(entry.options)}"
            )
        elif key in given:
            problems.append(f"{key} is given twice")
        else:
            try:
                given[key] = _value(entry.options[key][0], value, scale)
            except ValueError as err:
                problems.append(f"{key} is {value.strip()[:40]!r}: {err}")
    return given, problems


def _make(where: str, entry: ManoeuvreEntry, given: Mapping[str, Any], scale: Scale) -> Manoeuvre:
    """Fill the defaults, check the deflections, build."""
    values: dict[str, Any] = {}
    for option, (kind, default) in entry.options.items():
        if option in given:
            values[option] = given[option]
        elif callable(default):
            values[option] = default(scale)
        else:
            values[option] = default * RAD if kind == "deg" else default
    problems = []
    for option, limit in (
        ("rudder", scale.max_rudder),
        ("amplitude", scale.max_rudder),
        ("first", scale.max_rudder),
        ("last", scale.max_rudder),
        ("max_rudder", scale.max_rudder),
        ("plane", scale.max_plane),
    ):
        if option in values and abs(values[option]) > limit * (1 + 1e-9):
            problems.append(
                f"{option} of {values[option] / RAD:.4g} deg is beyond the limit of {limit / RAD:.4g} deg"
            )
    if problems:
        raise_all(ManoeuvreError, where, problems)
    if "side" in values:
        values["rudder"] *= values.pop("side")
    try:
        return entry.build(**values)
    except ManoeuvreError as err:
        raise ManoeuvreError(f"{where}: {err}") from None


def _hint(name: str, known: Mapping[str, Any]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]}" if near else ""


def options(name: str) -> dict[str, str]:
    """Options of a named manoeuvre with their kinds (deg, s, rpm, m, hz, ...), for help texts."""
    if name not in REGISTRY:
        raise ManoeuvreError(
            f"no manoeuvre {name[:40]!r}{_hint(name, REGISTRY)}; known: {', '.join(REGISTRY)}"
        )
    return {option: kind for option, (kind, _) in REGISTRY[name].options.items()}


PLANAR_LIBRARY = {
    "straight": "straight",
    "spiral": "spiral:end=32LU,start=1LU",
    "dieudonne": "dieudonne",
    "turn_port": "turn:side=port",
    "turn_starboard": "turn:side=starboard",
    "pullout_port": "pullout:side=port",
    "pullout_starboard": "pullout:side=starboard",
    "zigzag_10_port": "zigzag:10/10",
    "zigzag_10_starboard": "zigzag:10/10,side=starboard",
    "zigzag_20_port": "zigzag:20/20",
    "zigzag_20_starboard": "zigzag:20/20,side=starboard",
    "zigzag_modified": "zigzag:switch=5",
    "prbs": "prbs",
    "chirp": "chirp:rpm_factors=1/0.7/1.1/0.85",
    "multisine": "multisine",
    "random": "random",
    "speedsteps": "speedsteps",
    "coast": "coast",
    "meander": "meander",
}
SPATIAL_LIBRARY = {
    "depth": "depth",
    "vzigzag": "vzigzag",
    "combined": "combined",
    "combinedheld": "combinedheld",
}

LIBRARY = PLANAR_LIBRARY | SPATIAL_LIBRARY  # name in the library -> as typed


def library(
    L: float, U: float, rpm: float, max_rudder: float, dof: int = 3, max_plane: float = 0.0, dt: float = 0.0
) -> dict[str, Manoeuvre]:
    """Every standard manoeuvre, sized for a vehicle.

    Parameters
    ----------
    L, U : length [m] and speed [m/s] at `rpm`
    max_rudder, max_plane : largest deflections [rad]; planes default to the rudder's
    dof : 3 leaves the vertical-plane manoeuvres out
    dt : step [s], 0 for about L/U/80

    Returns
    -------
    dict    name -> manoeuvre; a zig-zag whose rudder exceeds the limit is left out
    """
    scale = Scale(L, U, rpm, max_rudder, max_plane, dof, dt)
    texts = PLANAR_LIBRARY | (SPATIAL_LIBRARY if dof == 6 else {})
    beyond = {
        key
        for key in texts
        for deg in (10, 20)
        if f"zigzag_{deg}_" in key and deg * RAD > max_rudder * (1 + 1e-9)
    }
    return {key: parse(text, scale) for key, text in texts.items() if key not in beyond}
