"""A vehicle's data sheet: what a brochure or a drawing says, read from TOML or from options.

Takes: a file or a dictionary of the keys of `KEYS` and a list of fins with those of `FIN_KEYS`. Gives a
`Sheet`. Does not: estimate coefficients.
"""

from __future__ import annotations

import difflib
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayesid.errors import VehicleError, raise_all
from bayesid.model.vehicles.fields import TomlTable
from bayesid.model.vehicles.new.fins import KINDS, X_TAIL, Fin
from bayesid.model.vehicles.new.hull import Hull
from bayesid.model.vehicles.new.sheet_key import Key, template_line
from bayesid.model.vehicles.new.ship_sheet import SHIP_KEY, SHIP_KEYS, ShipSheet, ship_sheet_of
from bayesid.words import first_few

FLAT = 1.5  # breadth over height from which a hull may be that of a ship
_SHIP = "of a ship state the draught instead of a height (bayesid vehicle new --template --ship)"
KEYS: dict[str, Key] = {
    "length": Key("m", "over all", required=True, high=1e3),
    "diameter": Key("m", "of the largest section; or breadth and height", high=100.0),
    "breadth": Key("m", "beam of the hull", high=100.0),
    "height": Key("m", "height of the hull", high=100.0),
    "mass": Key("kg", "with all water inside that moves along"),
    "displacement": Key("kg", "mass of the displaced water; default: the mass"),
    "speed": Key("m/s", "design speed", required=True, high=100.0),
    "rpm": Key("rpm", "of the propeller at that speed"),
    "propeller_diameter": Key("m", "of the propeller", high=50.0),
    "rho": Key("kg/m3", "density of the water", 500.0, 2000.0, 1025.0),
    "nose_length": Key("m", "of the rounded nose; default: one diameter", high=1e3),
    "tail_length": Key("m", "of the tapering tail; default: what the displacement wants", high=1e3),
    "centre_from_nose": Key("m", "centre of buoyancy; default: that of the profile", high=1e3),
    "BG": Key("m", "centre of gravity below that of buoyancy; default: 5 % of the diameter", 0.0, 10.0),
    "allowance": Key("-", "resistance over that of a smooth hull with fins", 0.5, 10.0, 1.2),
    "rudder_max_deg": Key("deg", "largest rudder angle", 0.1, 90.0, 30.0),
    "plane_max_deg": Key("deg", "largest plane angle", 0.1, 90.0, 30.0),
    "rate_deg_s": Key("deg/s", "largest rate of rudder and planes"),
}
FIN_KEYS: dict[str, Key] = {
    "area": Key("m2", "of one, outside the hull; or span and chord"),
    "span": Key("m", "of one, from hull to tip; or aspect_ratio"),
    "chord": Key("m", "mean of one"),
    "aspect_ratio": Key("-", "span squared over area of one", 0.05, 50.0),
    "from_nose": Key("m", "middle of its chord"),
    "count": Key("-", "2: a pair, left and right or top and bottom; 1: a sail; 4: an x_tail", 1.0, 4.0, 2.0),
    "movable_share": Key("-", "of the area; 1: all of it turns", 0.05, 1.0, 1.0),
}


@dataclass(frozen=True)
class Sheet:
    """Numbers of `KEYS` (None where not stated), fins, and what had to be assumed."""

    name: str
    values: Mapping[str, float | None]
    fins: tuple[Fin, ...]
    assumed: tuple[str, ...]

    def number(self, key: str) -> float:
        value = self.values[key]
        assert value is not None, key
        return value

    @property
    def hull(self) -> Hull:
        v = self.values
        return Hull(
            self.number("length"),
            self.number("breadth"),
            self.number("height"),
            self.number("displacement") / self.number("rho"),
            self.number("rho"),
            v["nose_length"],
            v["tail_length"],
            v["centre_from_nose"],
        )


def read_sheet(path: str | os.PathLike[str], also: Mapping[str, Any] | None = None) -> Sheet | ShipSheet:
    """Data sheet from a TOML file, of a ship where it states a draught; `also` overrides its numbers.

    Raises
    ------
    VehicleError
        once, with every problem of the file
    """
    path = Path(path)
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise VehicleError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise VehicleError(f"{path}: not valid TOML: {error}") from None
    tree = {**tree, **(also or {})}
    if SHIP_KEY in tree:
        return ship_sheet_of(tree, path.name)
    if ship := [key for key in tree if key in SHIP_KEYS and key not in KEYS]:
        near = difflib.get_close_matches(SHIP_KEY, [k[:40] for k in tree if k not in KEYS], n=1)
        said = f"its {near[0]} is to be called {SHIP_KEY}" if near else f"give it a {SHIP_KEY} [m]"
        verb = "is" if len(ship) == 1 else "are"
        raise VehicleError(
            f"{path.name}: {first_few(ship, 4)} {verb} of the sheet of a ship, which states a {SHIP_KEY}; "
            f"{said}. The sheet of a submerged body has a diameter, or breadth and height"
        )
    return sheet_of(tree, path.name)


def sheet_of(tree: Mapping[str, Any], where: str) -> Sheet:
    """Data sheet from parsed tables: keys of `KEYS`, `name` and a list `fins`.

    Raises
    ------
    VehicleError
        once, with every problem
    """
    problems: list[str] = []
    table = TomlTable({k: v for k, v in tree.items() if k != "fins"}, "data sheet", problems)
    table.only(("name", "format", *KEYS))
    name = table.text("name", "vehicle of a data sheet")
    v: dict[str, float | None] = {
        key: table.number(key, row.default, required=row.required, low=row.low, high=row.high)
        for key, row in KEYS.items()
    }
    assumed: list[str] = []
    if v["diameter"] is None and (v["breadth"] is None or v["height"] is None):
        problems.append("diameter [m] is missing; give it, or breadth and height")
    v["breadth"], v["height"] = v["breadth"] or v["diameter"], v["height"] or v["diameter"]
    if v["mass"] is None and v["displacement"] is None:
        problems.append("mass [kg] is missing; give it or displacement [kg]")
    v["displacement"] = v["displacement"] or v["mass"]
    v["mass"] = v["mass"] or v["displacement"]
    fins = _fins(tree.get("fins", []), v, problems)
    if problems:
        raise_all(VehicleError, where, problems)
    _plausible(v, fins, problems)
    if problems:
        raise_all(VehicleError, where, problems)
    _complete(v, fins, assumed)
    return Sheet(name, v, tuple(fins), tuple(assumed))


def _fins(entries: Any, v: Mapping[str, float | None], problems: list[str]) -> list[Fin]:
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        problems.append("fins must be tables: [[fins]] with kind, area, span and from_nose")
        return []
    found = []
    for k, entry in enumerate(entries, 1):
        table = TomlTable(entry, f"fins {k}", problems)
        table.only(("kind", *FIN_KEYS))
        kind = table.text("kind", required=True, choices=KINDS)
        f = {key: table.number(key, row.default, low=row.low, high=row.high) for key, row in FIN_KEYS.items()}
        area, span, chord, ratio, at = (
            f[key] for key in ("area", "span", "chord", "aspect_ratio", "from_nose")
        )
        if span is None and area is not None and ratio is not None:
            span = math.sqrt(ratio * area)
        if area is None and span is not None:
            area = span * chord if chord is not None else span**2 / ratio if ratio is not None else None
        if area is None or span is None or at is None:
            table.problem("needs from_nose and two of area, span, chord, aspect_ratio")
        elif kind:
            count = 4 if kind == X_TAIL and "count" not in entry else int(f["count"] or 2)
            if count not in ((4,) if kind == X_TAIL else (1, 2)):
                table.problem(f"count = {count}: an x_tail has 4 fins, of any other kind there are 1 or 2")
            found.append(Fin(kind, area, span, at, count, f["movable_share"] or 1.0))
    return found


def _plausible(v: Mapping[str, float | None], fins: list[Fin], problems: list[str]) -> None:
    length, breadth, height = v["length"] or 1.0, v["breadth"] or 1.0, v["height"] or 1.0
    box = math.pi / 4.0 * breadth * height * length
    volume = (v["displacement"] or 0.0) / (v["rho"] or 1025.0)
    if not 0.3 < volume / box < 1.02:
        problems.append(
            f"displacement over density is {volume / box:.2f} of a cylinder of this length and "
            "section; hulls have 0.5 to 0.95: check length and diameter [m], mass [kg]. A submerged hull is "
            f"asked for, {_SHIP}"
        )
    if not 1.5 < length / math.sqrt(breadth * height) < 30.0:
        problems.append(
            f"length over diameter is {length / math.sqrt(breadth * height):.3g}; the formulas hold "
            "for slender "
            "hulls, 3 to 20"
        )
    for k, fin in enumerate(fins, 1):
        if not 0.0 <= fin.from_nose <= 1.1 * length:
            problems.append(f"[fins {k}] from_nose is {fin.from_nose:g} m on a hull of {length:g} m")
        if fin.span > length or fin.area > length * max(breadth, height):
            problems.append(
                f"[fins {k}] is larger than the hull; area [m2] and span [m] are those of one fin"
            )


def _complete(v: dict[str, float | None], fins: list[Fin], assumed: list[str]) -> None:
    """Usual sizes for what no sheet says; each is told."""
    length, diameter = v["length"] or 1.0, math.sqrt((v["breadth"] or 1.0) * (v["height"] or 1.0))
    for kind, word in (("rudder", "rudder"), ("stern_plane", "stern planes")):
        if not any(fin.kind in (kind, X_TAIL) for fin in fins):
            fin = Fin(kind, 0.025 * length * diameter, 0.45 * diameter, 0.96 * length, 2, 1.0, True)
            fins.append(fin)
            assumed.append(
                f"no {word} stated: a pair of {fin.area:.3g} m2 and {fin.span:.3g} m span each at "
                f"{fin.from_nose:.3g} m from the nose is assumed (5 % of length times diameter)"
            )
    if (v["breadth"] or 0.0) > FLAT * (v["height"] or 1.0):
        assumed.append(f"a submerged hull, {_SHIP}")
    if v["BG"] is None:
        v["BG"] = 0.05 * diameter
        assumed.append(f"BG = {v['BG']:.3g} m (5 % of the diameter)")
    if v["rpm"] is None:
        v["rpm"] = 60.0 * 1.4 * (v["speed"] or 1.0) / (v["propeller_diameter"] or 0.7 * diameter)
        assumed.append(f"{v['rpm']:.0f} rpm at the design speed (advance ratio 0.7); commands are in rpm")


#: REMUS 100 as Prestero (2001) states it: what a filled data sheet looks like
EXAMPLE: dict[str, float] = {
    "length": 1.33, "diameter": 0.191, "mass": 30.48, "displacement": 30.51, "speed": 1.54, "rpm": 1500.0,
    "rho": 1030.0, "nose_length": 0.191, "tail_length": 0.541,
    "centre_from_nose": 0.611, "BG": 0.0196, "rudder_max_deg": 13.6, "plane_max_deg": 13.6,
}  # fmt: skip
EXAMPLE_FIN: dict[str, float] = {"area": 0.00665, "span": 0.0857, "from_nose": 1.249}


def template() -> str:
    """A data sheet with unit and meaning of every key, filled in for a REMUS 100."""

    lines = [
        "# Data sheet of a vehicle, filled in for a REMUS 100. Put in your numbers, delete what you "
        "do not know,",
        "# then: bayesid vehicle new my_vehicle.toml --sheet THIS_FILE",
        'name = "REMUS 100 by its data sheet"',
        *(template_line(key, row, EXAMPLE) for key, row in KEYS.items()),
        "",
        f"# One table per pair of fins, or single fin such as a sail. kind: {', '.join(KINDS)}",
    ]
    for kind in ("rudder", "stern_plane"):
        lines += [
            "[[fins]]",
            f'kind = "{kind}"',
            *(template_line(k, row, EXAMPLE_FIN) for k, row in FIN_KEYS.items()),
        ]
    return "\n".join(lines) + "\n"
