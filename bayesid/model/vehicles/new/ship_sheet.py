"""A ship's data sheet: particulars of hull, propeller and rudder as a drawing or a test report states them.

Takes: a dictionary of the keys of `SHIP_KEYS`. Gives a `ShipSheet`. Does not: estimate coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bayesid.errors import VehicleError, raise_all
from bayesid.model.vehicles.fields import TomlTable
from bayesid.model.vehicles.new.sheet_key import Key, template_line

#: a sheet with this key is one of a ship
SHIP_KEY = "draught"
SHIP_KEYS: dict[str, Key] = {
    "length": Key("m", "between perpendiculars, Lpp", required=True, high=1e3),
    "breadth": Key("m", "moulded, B", required=True, high=200.0),
    "draught": Key("m", "midship, T", required=True, high=100.0),
    "mass": Key("kg", "of the displaced water; or displacement_volume, or block_coefficient"),
    "displacement_volume": Key("m3", "of the displaced water"),
    "block_coefficient": Key("-", "displaced volume over Lpp B T", 0.3, 0.98),
    "speed": Key("m/s", "approach or design speed", required=True, high=100.0),
    "x_G": Key("m", "centre of gravity before midship", -1e2, 1e2, 0.0),
    "k_zz": Key("m", "radius of gyration in yaw about the centre of gravity; default: 0.25 Lpp", high=300.0),
    "rho": Key("kg/m3", "density of the water", 500.0, 2000.0, 1025.0),
    "propeller_diameter": Key("m", "of the propeller; default: 0.65 of the draught", high=50.0),
    "pitch_ratio": Key("-", "of the propeller at 0.7 of its radius", 0.3, 2.0),
    "rpm": Key("rpm", "of the propeller at that speed"),
    "rudder_area": Key("m2", "lateral, of the movable part; default: 2 % of Lpp T", high=1e4),
    "rudder_span": Key("m", "height of the rudder; default: from an aspect ratio of 1.6", high=100.0),
    "rudder_max_deg": Key("deg", "largest rudder angle", 0.1, 90.0, 35.0),
    "rate_deg_s": Key("deg/s", "largest rate of the rudder"),
    "air_front_area": Key("m2", "above the water, seen from ahead", high=1e5),
    "air_side_area": Key("m2", "above the water, seen from abeam", high=1e5),
}
#: KVLCC2, the 7 m model of Yasukawa and Yoshimura (2015): what a filled data sheet looks like
SHIP_EXAMPLE: dict[str, float] = {
    "length": 7.0, "breadth": 1.27, "draught": 0.46, "mass": 3270.0, "speed": 1.179, "x_G": 0.25,
    "k_zz": 1.75, "rho": 1000.0, "propeller_diameter": 0.216, "pitch_ratio": 0.721, "rudder_area": 0.0539,
    "rudder_span": 0.345, "rate_deg_s": 15.7,
}  # fmt: skip


@dataclass(frozen=True)
class ShipSheet:
    """Numbers of `SHIP_KEYS`, complete but for those that may stay open, and what had to be assumed."""

    name: str
    values: Mapping[str, float | None]
    assumed: tuple[str, ...]

    def number(self, key: str) -> float:
        value = self.values[key]
        assert value is not None, key
        return value

    @property
    def block(self) -> float:
        """Block coefficient."""
        return self.number("displacement_volume") / self._box

    @property
    def _box(self) -> float:
        return self.number("length") * self.number("breadth") * self.number("draught")


def ship_sheet_of(tree: Mapping[str, Any], where: str) -> ShipSheet:
    """A ship's data sheet from parsed tables: keys of `SHIP_KEYS` and `name`.

    Raises
    ------
    VehicleError
        once, with every problem
    """
    problems: list[str] = []
    table = TomlTable(tree, "data sheet of a ship", problems)
    table.only(("name", "format", *SHIP_KEYS))
    name = table.text("name", "ship of a data sheet")
    v: dict[str, float | None] = {
        key: table.number(key, row.default, required=row.required, low=row.low, high=row.high)
        for key, row in SHIP_KEYS.items()
    }
    stated = [key for key in ("mass", "displacement_volume", "block_coefficient") if v[key] is not None]
    if not stated:
        problems.append("mass [kg] is missing; give it, displacement_volume [m3] or block_coefficient")
    if problems:
        raise_all(VehicleError, where, problems)
    box, rho = (v["length"] or 0.0) * (v["breadth"] or 0.0) * (v["draught"] or 0.0), v["rho"] or 0.0
    volumes = {
        "mass": (v["mass"] or 0.0) / rho,
        "displacement_volume": v["displacement_volume"] or 0.0,
        "block_coefficient": (v["block_coefficient"] or 0.0) * box,
    }
    _plausible(v, {key: volumes[key] for key in stated}, box, problems)
    if problems:
        raise_all(VehicleError, where, problems)
    volume = volumes[stated[0]]
    v["displacement_volume"], v["mass"] = volume, v["mass"] or rho * volume
    v["block_coefficient"] = volume / box
    return ShipSheet(name, v, tuple(_complete(v)))


def _plausible(
    v: Mapping[str, float | None], volumes: Mapping[str, float], box: float, problems: list[str]
) -> None:
    length, breadth, draught = (v[key] or 1.0 for key in ("length", "breadth", "draught"))
    for key, volume in volumes.items():
        if not 0.28 < volume / box < 0.95:
            problems.append(
                f"{key} gives a block coefficient of {volume / box:.2f}; ships have 0.45 to 0.9, boats from "
                "0.3 on: check length, breadth, draught [m] and mass [kg]"
            )
    low, high = min(volumes.values()), max(volumes.values())
    if high > 1.05 * low:
        told = ", ".join(f"{key} {volume:.4g} m3" for key, volume in volumes.items())
        problems.append(f"the displaced volume is stated twice and differs: {told}; keep one")
    if not 3.0 < length / breadth < 12.0 or not 1.5 < breadth / draught < 8.0:
        problems.append(
            f"length over breadth is {length / breadth:.3g} and breadth over draught "
            f"{breadth / draught:.3g}; the formulas hold for 3 to 12 and 1.5 to 8"
        )
    if abs(v["x_G"] or 0.0) > 0.1 * length:
        problems.append(f"x_G is {v['x_G']:g} m, counted from midship; it is within 10 % of the length")
    # those of a boat hang below the canoe body whose draught this is
    if (v["propeller_diameter"] or 0.0) > 1.3 * draught or (v["rudder_span"] or 0.0) > 1.6 * draught:
        problems.append(
            "propeller or rudder is much larger than the draught; propeller_diameter, rudder_span are in m"
        )
    if (v["rudder_area"] or 0.0) > 0.1 * length * draught:
        problems.append("rudder_area is more than 10 % of length times draught; it is in m2")


def _complete(v: dict[str, float | None]) -> list[str]:
    """Usual sizes for what no sheet says; each is told."""
    told = []
    length, draught = v["length"] or 1.0, v["draught"] or 1.0
    if v["k_zz"] is None:
        v["k_zz"] = 0.25 * length
        told.append(f"k_zz = {v['k_zz']:.4g} m (0.25 Lpp)")
    if v["propeller_diameter"] is None:
        v["propeller_diameter"] = 0.65 * draught
        told.append(f"propeller_diameter = {v['propeller_diameter']:.3g} m (0.65 of the draught)")
    if v["rudder_area"] is None:
        v["rudder_area"] = 0.02 * length * draught
        told.append(f"rudder_area = {v['rudder_area']:.3g} m2 (2 % of length times draught)")
    if v["rudder_span"] is None:
        v["rudder_span"] = math.sqrt(1.6 * (v["rudder_area"] or 0.0))
        told.append(f"rudder_span = {v['rudder_span']:.3g} m (aspect ratio 1.6)")
    if v["pitch_ratio"] is None and v["rpm"] is None:
        v["pitch_ratio"] = 0.7
        told.append("pitch_ratio = 0.7 (neither it nor rpm is stated)")
    return told


def ship_template() -> str:
    """A ship's data sheet with unit and meaning of every key, filled in for the 7 m model of the KVLCC2."""
    lines = [
        "# Data sheet of a ship, filled in for the 7 m model of the KVLCC2 tanker. Put in your numbers,",
        "# delete what you do not know, then: bayesid vehicle new my_ship.toml --sheet THIS_FILE",
        'name = "KVLCC2, 7 m model, by its data sheet"',
        *(template_line(key, row, SHIP_EXAMPLE) for key, row in SHIP_KEYS.items()),
    ]
    return "\n".join(lines) + "\n"
