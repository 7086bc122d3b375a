"""Read each table of a vehicle file but the prior into plain values.

Takes: a `TomlTable`, which collects the problems. Gives values safe to compute with, even after a problem.
Does not: open files or convert conventions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from bayesid.errors import VehicleError
from bayesid.model.actuators import KINDS, NAMES, Actuator
from bayesid.model.file_keys import FileKey
from bayesid.model.propulsion import MODELS, propulsion_problems, with_defaults
from bayesid.model.terms import canonical_name, term
from bayesid.model.terms.dialects import READ
from bayesid.model.terms.mmg import REQUIRED
from bayesid.model.vehicles.fields import LARGEST, TomlTable, as_number, hint, shown
from bayesid.model.vehicles.vehicle import FINS, GRAVITY, INERTIA, Crossflow, Propulsion

#: plain sizes of a hull and what they are
_SIZES = {
    "L_oa": "m, length over all",
    "diameter": "m, hull",
    "scale": "of the model",
    "prime_draught": "m, draught of primes over L d instead of L^2",
    "air_front": "area exposed to wind from ahead over L^2",
    "air_side": "area exposed to wind abeam over L^2",
    "air_centroid": "centroid of that area before midship over L",
    "wind_average": "s, over which the vehicle takes the mean of a measured wind; 0: every gust",
}
#: keys somebody may look for, and why there is no such number
NOT_READ = dict.fromkeys(
    ("depth_over_draught", "water_depth", "depth", "h_over_d", "h_d"),
    "is not read: there is no factor for shallow water here, for we found no source of one that we could "
    "check. Coefficients hold at the depth they were measured at: give those of this depth, or fit them to "
    "runs there",
)
DIMENSIONS = tuple(_SIZES)
UNIT = 1e-12  # departure of the length of a direction from 1 that is rounding
FIN_KEYS = dict(zip(FINS, ("dr", "ds", "db"), strict=True))
#: keys of [vehicle]; the reader and the JSON Schema (`schema`) take ranges, choices and defaults from here
HEAD: dict[str, FileKey] = {
    "name": FileKey("text", "of the vehicle", default="unnamed"),
    "source": FileKey("text", "where the numbers are from", default="not stated"),
    "nondimensional": FileKey("flag", "true: prime coefficients, false: SI", required=True),
    "plain_abs": FileKey("flag", "v|v| and w|w| instead of v sqrt(v^2 + w^2)", default=False),
    "planar_only": FileKey("flag", "surge, sway and yaw only", default=False),
    "convention": FileKey(
        "text", "fossen: Munk and Coriolis parts of the added mass are not in [coef] and are added",
        choices=("gertler-hagen", "fossen"), default="gertler-hagen",
    ),
    "rudder_positive": FileKey(
        "text", "side to which a positive rudder turns", choices=("port", "starboard"), default="port"
    ),
    "dialect": FileKey("text", "how the coefficients are spelt where spelling leaves two", choices=READ),
    "rho": FileKey("number", "kg/m3, density of the water", required=True, low=0.1, high=1e5),
    "L": FileKey("number", "m, reference length of the prime system", required=True, low=1e-3, high=1e5),
    **{
        key: FileKey("number", text, low=-1.0 if key == "air_centroid" else 0.0, high=1e6)
        for key, text in _SIZES.items()
    },
    "mass": FileKey("number", "kg, with the water inside", required=True, low=1e-6, high=1e12),
    **{
        key: FileKey("number", f"kg m2, about the origin{'; not if planar_only' * (key != 'Izz')}",
                     required=key == "Izz", low=0.0, high=1e18)
        for key in INERTIA[:3]
    },
    **{
        key: FileKey("number", "kg m2, plus integral of the product", low=-1e18, high=1e18, default=0.0)
        for key in INERTIA[3:]
    },
    "r_G": FileKey("numbers", "m, centre of gravity, body axes, z down", length=3),
    "r_B": FileKey("numbers", "m, centre of buoyancy, body axes, z down", length=3),
    "W": FileKey("number", "N, weight; default: mass times 9.81", low=0.0, high=1e14),
    "B": FileKey("number", "N, buoyancy", low=0.0, high=1e14),
    "W_equals_B": FileKey("flag", "trimmed to neutral; W and B have no effect then"),
    "U_ref": FileKey("number", "m/s, of prime rows that are not quadratic in velocity", low=1e-6, high=1e4),
}  # fmt: skip
#: keys of [control]
CONTROL: dict[str, FileKey] = {
    **{f"{short}_max_deg": FileKey("number", f"deg, largest angle of {fin}", low=0.0, high=180.0)
       for fin, short in FIN_KEYS.items()},
    "rate_deg_s": FileKey("number", "deg/s, of all fins without their own", low=1e-6, high=1e9),
    **{f"{short}_rate_deg_s": FileKey("number", f"deg/s, of {fin}", low=1e-6, high=1e9)
       for fin, short in FIN_KEYS.items()},
}  # fmt: skip
#: keys of [crossflow]
CROSSFLOW: dict[str, FileKey] = {
    "Cdy": FileKey("number", "drag coefficient of the strips, sideways", required=True, low=0.0, high=1e5),
    "Cdz": FileKey("number", "drag coefficient of the strips, up and down; not if planar_only",
                   low=0.0, high=1e5),
    "height": FileKey("number", "m, of the strips", required=True, low=0.0, high=1e5),
    "width": FileKey("number", "m, of the strips; not if planar_only", low=0.0, high=1e5),
    "sections": FileKey("whole", "stations of the integral", low=3, high=1001, default=21),
}  # fmt: skip


def _number(
    table: TomlTable, keys: Mapping[str, FileKey], key: str, default: float | None = None
) -> float | None:
    """The number of a declared key, in its range."""
    row = keys[key]
    low = -LARGEST if row.low is None else row.low
    high = LARGEST if row.high is None else row.high
    return table.number(key, default, required=row.required, low=low, high=high)


def read_head(head: TomlTable) -> dict[str, Any]:
    head.only((*HEAD, *NOT_READ))
    for key in (k for k in NOT_READ if k in head.data):
        head.problem(f"{key} {NOT_READ[key]}")
    values: dict[str, Any] = {
        "name": head.text("name", HEAD["name"].default),
        "source": head.text("source", HEAD["source"].default),
        "nondimensional": head.flag("nondimensional", False),
        "plain_abs": head.flag("plain_abs", HEAD["plain_abs"].default),
        "planar_only": head.flag("planar_only", HEAD["planar_only"].default),
        "U_ref": _number(head, HEAD, "U_ref"),
    }
    if "nondimensional" not in head.data:
        head.problem("nondimensional is missing: say true for prime coefficients, false for SI")
    for key in ("rho", "L", "mass"):
        values[key] = _number(head, HEAD, key)
    mass = values["mass"]
    for key in INERTIA[:3]:
        in_plane = values["planar_only"] and key != "Izz"
        values[key] = head.number(
            key,
            0.0 if in_plane else None,
            required=not in_plane,
            low=0.0 if in_plane else 1e-12,
            high=HEAD[key].high or math.inf,
        )
    for key in INERTIA[3:]:
        values[key] = _number(head, HEAD, key, HEAD[key].default)
    values["r_G"] = head.vector("r_G", (0.0, 0.0, 0.0))
    values["r_B"] = head.vector("r_B", (0.0, 0.0, 0.0))
    weight = (mass or 0.0) * GRAVITY
    values["W"] = _number(head, HEAD, "W", weight)
    values["B"] = _number(head, HEAD, "B", weight)
    if head.flag("W_equals_B", "B" not in head.data):
        values["W"] = values["B"] = weight
    elif "B" not in head.data:
        head.problem("B [N] is missing; give it or say W_equals_B = true")
    values["dimensions"] = {
        key: value for key in DIMENSIONS if (value := _number(head, HEAD, key)) is not None
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
    table.only(CONTROL)
    common = _number(table, CONTROL, "rate_deg_s", math.inf)
    limits, rates = {}, {}
    for fin, short in FIN_KEYS.items():
        limit = _number(table, CONTROL, f"{short}_max_deg", math.inf)
        rate = _number(table, CONTROL, f"{short}_rate_deg_s", common)
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


def read_crossflow(table: TomlTable, planar: bool) -> Crossflow:
    """Strips; `planar`: no force acts up and down, so that its two numbers may be left out."""
    table.only(CROSSFLOW)
    numbers = [
        table.number(
            key,
            required=CROSSFLOW[key].required or not planar,
            low=CROSSFLOW[key].low or 0.0,
            high=CROSSFLOW[key].high or math.inf,
        )
        for key in ("Cdy", "Cdz", "height", "width")
    ]
    sections = table.data.get("sections", CROSSFLOW["sections"].default)
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


def shaft_lag(name: str) -> str:
    """The parameter of an effect that `lag` of [actuators.NAME] is."""
    return f"thruster_{name}_lag.tau"


def read_actuators(table: TomlTable) -> tuple[tuple[Actuator, ...], dict[str, float]]:
    """Actuators of [actuators.NAME], in the order of the file, and the lags of their shafts as values of
    effects; one without `kind` is a thruster."""
    out: list[Actuator] = []
    lags: dict[str, float] = {}
    for name in table.data:
        if name not in NAMES:
            table.problem(f"{shown(name)} is no name of an actuator: {', '.join(NAMES)}{hint(name, NAMES)}")
            continue
        inside = TomlTable(table.data[name], f"actuators.{name}", table.problems)
        word = inside.text("kind", choices=KINDS) if "kind" in inside.data else "thruster"
        kind = KINDS.get(word)
        if kind is not None and (found := _actuator(name, kind, inside)) is not None:
            out.append(found[0])
            if found[1]:
                lags[shaft_lag(name)] = found[1]
    there = {a.name for a in out if f"n_{a.name}" in a.signals} | {"propeller"}
    for a in out:
        behind = getattr(a, "behind", None)
        if behind is not None and behind not in there:
            table.problem(f"{a.name} is behind {shown(behind)}, which is no thruster of this file")
    return tuple(out), lags


def _actuator(name: str, kind: type[Actuator], inside: TomlTable) -> tuple[Actuator, float] | None:
    """One actuator and the lag of its shaft [s]; None where its numbers cannot be read."""
    inside.only(("kind", *kind.keys))
    before = len(inside.problems)
    values: dict[str, Any] = {}
    for key, row in kind.keys.items():
        if row.kind == "numbers" and key not in inside.data:
            inside.problem(f"{key} is missing")
        elif row.kind == "numbers":
            values[key] = inside.vector(key, (0.0, 0.0, 0.0))
        elif row.kind == "number":
            values[key] = _number(inside, kind.keys, key, row.default)
        elif key in inside.data:
            values[key] = inside.text(key, choices=row.choices)
    if len(inside.problems) > before:
        return None
    length = math.hypot(*values["direction"])
    if length == 0.0:
        inside.problem("direction must not be zero")
        return None
    if abs(length - 1.0) > UNIT:  # a unit vector that was written is read as it was
        values["direction"] = tuple(one / length for one in values["direction"])
    own = any(field.name == "lag" for field in fields(kind))  # a fin's, which is no effect
    lag = 0.0 if own else values.pop("lag", 0.0)
    found = kind(name=name, **values)
    for text in found.problems:
        inside.problem(text)
    return found, lag


def read_effects(table: TomlTable) -> tuple[dict[str, float], dict[str, float]]:
    """Values and standard deviations [SI] by "effect.parameter"; tables `[effects.NAME]` of numbers, a number
    with its deviation as `{ value = 0.3, sd = 0.02 }`. Names are checked where the equations are known."""
    values, spread = {}, {}
    for name in table.data:
        inside = TomlTable(table.data[name], f"effects.{name}", table.problems)
        for parameter, entry in inside.data.items():
            pair = TomlTable(
                entry if isinstance(entry, dict) else {"value": entry},
                f"effects.{name}.{parameter}", table.problems,
            )  # fmt: skip
            pair.only(("value", "sd"))
            value, sd = pair.number("value", required=True), pair.number("sd", low=1e-30)
            if value is not None:
                values[f"{name}.{parameter}"] = value
            if sd is not None:
                spread[f"{name}.{parameter}"] = sd
    return values, spread


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


def _choice(head: TomlTable, key: str) -> str:
    return head.text(key, HEAD[key].default, choices=HEAD[key].choices)


def read_conversions(head: TomlTable) -> list[str]:
    found = []
    if _choice(head, "convention") == "fossen":
        found.append("fossen")
    if _choice(head, "rudder_positive") == "starboard":
        found.append("starboard")
    return found
