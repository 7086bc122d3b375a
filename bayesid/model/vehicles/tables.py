"""Read each table of a vehicle file but the prior into plain values.

Takes: a `TomlTable`, which collects the problems. Gives values safe to compute with, even after a problem.
Does not: open files or convert conventions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bayesid.errors import VehicleError
from bayesid.model.propulsion import MODELS, propulsion_problems, with_defaults
from bayesid.model.terms import canonical_name, term
from bayesid.model.terms.mmg import REQUIRED
from bayesid.model.vehicles.fields import TomlTable, as_number, shown
from bayesid.model.vehicles.vehicle import FINS, GRAVITY, INERTIA, Crossflow, Propulsion

DIMENSIONS = ("L_oa", "diameter", "scale", "prime_draught", "air_front", "air_side", "air_centroid")
FIN_KEYS = dict(zip(FINS, ("dr", "ds", "db"), strict=True))


def read_head(head: TomlTable) -> dict[str, Any]:
    values: dict[str, Any] = {
        "name": head.text("name", "unnamed"),
        "source": head.text("source", "not stated"),
        "nondimensional": head.flag("nondimensional", False),
        "plain_abs": head.flag("plain_abs", False),
        "planar_only": head.flag("planar_only", False),
        "U_ref": head.number("U_ref", low=1e-6, high=1e4),
    }
    if "nondimensional" not in head.data:
        head.problem("nondimensional is missing: say true for prime coefficients, false for SI")
    values["rho"] = head.number("rho", required=True, low=0.1, high=1e5)
    values["L"] = head.number("L", required=True, low=1e-3, high=1e5)
    values["mass"] = mass = head.number("mass", required=True, low=1e-6, high=1e12)
    for key in INERTIA[:3]:
        in_plane = values["planar_only"] and key != "Izz"
        values[key] = head.number(
            key, 0.0 if in_plane else None, required=not in_plane, low=0.0 if in_plane else 1e-12, high=1e18
        )
    for key in INERTIA[3:]:
        values[key] = head.number(key, 0.0, low=-1e18, high=1e18)
    values["r_G"] = head.vector("r_G", (0.0, 0.0, 0.0))
    values["r_B"] = head.vector("r_B", (0.0, 0.0, 0.0))
    weight = (mass or 0.0) * GRAVITY
    values["W"] = head.number("W", weight, low=0.0, high=1e14)
    values["B"] = head.number("B", weight, low=0.0, high=1e14)
    if head.flag("W_equals_B", "B" not in head.data):
        values["W"] = values["B"] = weight
    elif "B" not in head.data:
        head.problem("B [N] is missing; give it or say W_equals_B = true")
    values["dimensions"] = {
        key: value
        for key in DIMENSIONS
        if (value := head.number(key, low=-1.0 if key == "air_centroid" else 0.0, high=1e6)) is not None
    }
    return values


def read_coefficients(table: TomlTable, dialect: str | None) -> dict[str, float]:
    """Canonical name -> value; a coefficient spelt twice, unknown, ambiguous or not finite is a problem."""
    found: dict[str, float] = {}
    for spelling, entry in table.data.items():
        try:
            name = canonical_name(spelling, dialect)
        except VehicleError as error:
            table.problem(str(error))
            continue
        number = as_number(entry)
        if number is None or abs(number) > 1e30:
            table.problem(f"{name} must be a finite number, not {shown(entry)}")
        elif term(name).group == "propulsion":
            table.problem(f'{name} belongs into [propulsion] with model = "quadratic"')
        elif name in found:
            table.problem(f"{name} is given twice, the second time as {shown(spelling)}")
        else:
            found[name] = number
    return found


def read_control(table: TomlTable) -> tuple[dict[str, float], dict[str, float]]:
    """Limits [rad] and rates [rad/s] of the fins; rate_deg_s holds for all fins without their own."""
    limit_keys = {fin: f"{short}_max_deg" for fin, short in FIN_KEYS.items()}
    rate_keys = {fin: f"{short}_rate_deg_s" for fin, short in FIN_KEYS.items()}
    table.only((*limit_keys.values(), "rate_deg_s", *rate_keys.values()))
    common = table.number("rate_deg_s", math.inf, low=1e-6, high=1e9)
    limits, rates = {}, {}
    for fin in FINS:
        limit = table.number(limit_keys[fin], math.inf, low=0.0, high=180.0)
        rate = table.number(rate_keys[fin], common, low=1e-6, high=1e9)
        limits[fin] = math.radians(limit if limit is not None else math.inf)
        rates[fin] = math.radians(rate if rate is not None else math.inf)
    return limits, rates


def read_propulsion(table: TomlTable) -> Propulsion:
    model = table.text("model", required=bool(table.data), choices=MODELS)
    if not model:
        return Propulsion("quadratic", with_defaults("quadratic", {}))
    known = MODELS[model].parameters
    table.only(("model", *known))
    values = {key: value for key in known if (value := table.number(key)) is not None}
    for key, text in propulsion_problems(model, values).items():
        if key in values or key not in table.data:  # an unreadable number is reported already
            table.problem(text)
    return Propulsion(model, with_defaults(model, values))


def ship_problems(model: str, planar: bool, coef: Mapping[str, float]) -> list[str]:
    """What keeps rows and numbers of a ship apart from their propulsion model, or that model from them."""
    ours = [name for name in coef if term(name).group in ("mmg", "number")]
    if model != "mmg":
        return [f'[coef] {", ".join(ours)} need [propulsion] model = "mmg"'] if ours else []
    missing = [name for name in REQUIRED if name not in coef]
    found = [f"[coef] {', '.join(missing)} missing: the mmg model needs them"] if missing else []
    return (
        found
        if planar
        else [*found, "[vehicle] the mmg model holds in the horizontal plane: say planar_only"]
    )


def read_crossflow(table: TomlTable) -> Crossflow:
    keys = ("Cdy", "Cdz", "height", "width", "sections")
    table.only(keys)
    numbers = [table.number(key, required=True, low=0.0, high=1e5) for key in keys[:4]]
    sections = table.data.get("sections", 21)
    if not isinstance(sections, int) or isinstance(sections, bool) or not 3 <= sections <= 1001:
        table.problem(f"sections must be a whole number between 3 and 1001, not {shown(sections)}")
        sections = 21
    Cdy, Cdz, height, width = (number or 0.0 for number in numbers)
    return Crossflow(Cdy, Cdz, height, width, sections)


def read_confidence(table: TomlTable) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for key, names in table.data.items():
        if isinstance(names, list) and all(isinstance(name, str) for name in names):
            found[key] = list(names)
        else:
            table.problem(f"{shown(key)} must be a list of coefficient names, not {shown(names)}")
    return found


def read_sources(table: TomlTable, coef: Mapping[str, float], dialect: str | None) -> dict[str, str]:
    found: dict[str, str] = {}
    for key, text in table.data.items():
        try:
            name = canonical_name(key, dialect)
        except VehicleError as error:
            table.problem(str(error))
            continue
        if not isinstance(text, str):
            table.problem(f"{name} must be text, not {shown(text)}")
        elif name not in coef:
            table.problem(f"{name} has a source but no value in [coef]")
        else:
            found[name] = text
    return found


def read_conversions(head: TomlTable) -> list[str]:
    found = []
    if head.text("convention", "gertler-hagen", choices=("gertler-hagen", "fossen")) == "fossen":
        found.append("fossen")
    if head.text("rudder_positive", "port", choices=("port", "starboard")) == "starboard":
        found.append("starboard")
    return found
