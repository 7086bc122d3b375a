"""Write a vehicle as TOML, with its sources and the covariance of what a fit found.

Takes: a `Vehicle`. Gives a file that `load_vehicle` reads back to the same digest, in the inner convention.
Does not: keep the comments or spellings of the file the vehicle came from.
"""

from __future__ import annotations

import io
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.files import write_atomic
from bayesid.model.propulsion import propulsion_rows
from bayesid.model.terms import TERMS, term
from bayesid.model.vehicles.schema import write_schema
from bayesid.model.vehicles.tables import FIN_KEYS
from bayesid.model.vehicles.vehicle import FINS, INERTIA, CoefficientPrior, Propulsion, Vehicle, prime_scale

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def write_vehicle(
    vehicle: Vehicle,
    path: str | os.PathLike[str],
    covariance: tuple[Sequence[str], np.ndarray] | None = None,
    inside: bool = False,
    schema: bool = True,
) -> Path:
    """Write a vehicle file; a covariance goes into `<stem>.covariance.npz` beside it.

    The covariance is written first, so a reader never meets a file that names a missing one.

    Parameters
    ----------
    covariance : names (k,) of coefficients and their (k, k) covariance in the units of the file; replaces
        what the vehicle's prior says of them. `identified` takes SI values instead
    inside : write the covariance as a table of the file instead, readable as text
    schema : write vehicle.schema.json beside and name it in the first line, for editors

    Raises
    ------
    VehicleError
        if the path names no .toml file, or the folder cannot be written
    """
    target = Path(path)
    if target.suffix != ".toml":
        raise VehicleError(f"{target.name}: a vehicle file ends in .toml")
    if covariance is not None:
        vehicle = replace(vehicle, prior=with_covariance(vehicle.prior, *covariance))
    prior, beside = vehicle.prior, f"{target.stem}.covariance.npz"
    try:
        if prior is not None and prior.covariance is not None and not inside:
            buffer = io.BytesIO()
            np.savez(buffer, names=np.array(prior.names), covariance=prior.covariance)
            write_atomic(target.with_name(beside), buffer.getvalue())
        head = write_schema(target.parent) if schema else ""
        return write_atomic(target, head + vehicle_toml(vehicle, None if inside else beside))
    except OSError as error:
        raise VehicleError(f"{target}: cannot be written ({error.strerror})") from None


def vehicle_toml(
    vehicle: Vehicle, covariance_file: str | None, comments: Mapping[tuple[str, str], str] | None = None
) -> str:
    """Text of the vehicle file.

    Parameters
    ----------
    covariance_file : where a covariance is; None writes it within the text
    comments : (section, key) -> comment behind the number; with it one prior sd stands on each line
    """
    v = vehicle
    head: dict[str, Any] = {"name": v.name, "source": v.source, "nondimensional": v.nondimensional}
    head |= {"plain_abs": v.plain_abs, "planar_only": v.planar_only, "rho": v.rho, "L": v.L, **v.dimensions}
    head |= {
        "mass": v.mass,
        **{key: getattr(v, key) for key in INERTIA},
        "r_G": list(v.r_G),
        "r_B": list(v.r_B),
    }
    head |= {"W": v.W, "B": v.B, "W_equals_B": False}
    if v.U_ref is not None:
        head["U_ref"] = v.U_ref
    control = {
        f"{FIN_KEYS[fin]}_max_deg": _degrees(v.limits[fin]) for fin in FINS if math.isfinite(v.limits[fin])
    }
    control |= {
        f"{FIN_KEYS[fin]}_rate_deg_s": _degrees(v.rates[fin]) for fin in FINS if math.isfinite(v.rates[fin])
    }
    tables: dict[str, Mapping[str, Any]] = {
        "vehicle": head,
        "control": control,
        "propulsion": {"model": v.propulsion.model, **v.propulsion.values},
        "coef": v.coef,
    }
    if v.crossflow is not None:
        tables["crossflow"] = vars(v.crossflow)
    if v.prior is not None:
        prior: dict[str, Any] = {"relative_sd": v.prior.relative_sd} if v.prior.relative_sd else {}
        if v.prior.covariance is not None:
            table = {"names": list(v.prior.names), "matrix": v.prior.covariance.tolist()}
            prior["covariance"] = covariance_file or table
        tables["prior"] = prior
    for a in v.actuators:
        kind = {} if a.kind == "thruster" else {"kind": a.kind}
        keys = {key: value for key, value in vars(a).items() if key != "name" and value is not None}
        tables[f"actuators.{a.name}"] = kind | keys
    for key, value in v.effects.items():
        effect, _, parameter = key.partition(".")
        spread = {"sd": v.effects_sd[key]} if key in v.effects_sd else {}
        tables[f"effects.{effect}"] = {
            **tables.get(f"effects.{effect}", {}),
            parameter: {"value": value, **spread} if spread else value,
        }
    for name in ("sources", "confidence", "validation"):
        if content := getattr(v, name):
            tables[name] = content
    if comments is not None and "relative_sd" in tables.get("prior", {}):
        spread = tables["prior"]["relative_sd"]
        tables["prior"] = {k: v for k, v in tables["prior"].items() if k != "relative_sd"}
        tables["prior.relative_sd"] = spread
    return "format = 1\n" + "".join(
        _table(name, content, comments or {})
        for name, content in tables.items()
        if content or name != "prior"
    )


def identified(
    vehicle: Vehicle,
    values: Mapping[str, float],
    *,
    source: str,
    name: str | None = None,
    names: Sequence[str] = (),
    covariance: np.ndarray | None = None,
    effects: Mapping[str, tuple[float, float]] | None = None,
) -> Vehicle:
    """The vehicle with the coefficients a fit found, and their covariance as its prior.

    Parameters
    ----------
    values : canonical name -> SI value; X_prop_* rows turn the propulsion into the `quadratic` model
    source : where the values come from, kept for each of them
    names, covariance : (k,) names within `values` and their (k, k) covariance, SI; rows of [coef] only
    effects : effect parameter -> value and standard deviation [SI], kept on beside those of the vehicle

    Raises
    ------
    VehicleError
        if a name is no row of the table, or a propulsion row is freed while the model is `kt`
    """
    rows = {key: term(key) for key in values}
    coef = dict(vehicle.coef)
    coef |= {
        key: float(values[key]) / prime_scale(vehicle, row)
        for key, row in rows.items()
        if row.group != "propulsion"
    }
    propulsion = vehicle.propulsion
    freed = {key: float(values[key]) for key, row in rows.items() if row.group == "propulsion"}
    if freed:
        if propulsion.model in ("kt", "mmg"):
            stated = f"the {propulsion.model} model"
            raise VehicleError(f"{vehicle.name}: {', '.join(freed)} cannot be set beside {stated}")
        fixed = propulsion_rows(propulsion.model, propulsion.values, vehicle.rho, vehicle.L)
        reference = {} if propulsion.rpm_ref is None else {"rpm_ref": propulsion.rpm_ref}
        propulsion = Propulsion("quadratic", {**fixed, **freed, **reference})
    prior = vehicle.prior
    if covariance is not None:
        kept = [i for i, key in enumerate(names) if rows[key].group != "propulsion"]
        scale = np.array([prime_scale(vehicle, rows[names[i]]) for i in kept])
        block = np.asarray(covariance, dtype=float)[np.ix_(kept, kept)] / np.outer(scale, scale)
        prior = with_covariance(prior, [names[i] for i in kept], block)
    return replace(
        vehicle,
        name=name or vehicle.name,
        coef={row.name: coef[row.name] for row in TERMS if row.name in coef},
        propulsion=propulsion,
        prior=prior,
        sources=vehicle.sources | {key: source for key in values if key in coef},
        effects=vehicle.effects | {key: value for key, (value, _) in (effects or {}).items()},
        effects_sd=vehicle.effects_sd | {key: sd for key, (_, sd) in (effects or {}).items()},
    )


def with_covariance(
    prior: CoefficientPrior | None, names: Sequence[str], covariance: np.ndarray
) -> CoefficientPrior:
    """Prior in which `names` have this (k, k) covariance; what else was known stays, uncorrelated to them."""
    prior = prior or CoefficientPrior()
    kept = [i for i, name in enumerate(prior.names) if name not in names]
    size = len(names) + len(kept)
    matrix = np.zeros((size, size))
    matrix[: len(names), : len(names)] = 0.5 * (covariance + np.transpose(covariance))
    if prior.covariance is not None:
        matrix[len(names) :, len(names) :] = prior.covariance[np.ix_(kept, kept)]
    matrix.setflags(write=False)
    relative = {name: sd for name, sd in prior.relative_sd.items() if name not in names}
    return CoefficientPrior(relative, (*names, *(prior.names[i] for i in kept)), matrix)


def _degrees(radians: float) -> float:
    """The number of degrees that reads back to exactly these radians, if a float near it does."""
    degrees = math.degrees(radians)
    near = (round(degrees, 10), degrees, math.nextafter(degrees, 0.0), math.nextafter(degrees, math.inf))
    return next((value for value in near if math.radians(value) == radians), degrees)


def _table(name: str, content: Mapping[str, Any], comments: Mapping[tuple[str, str], str]) -> str:
    head = comments.get(("prior", "relative_sd")) if name == "prior.relative_sd" else None
    lines = [f"\n[{name}]" + (f"  # {head}" if head else "")]
    for key, value in content.items():
        comment = comments.get((name, key))
        lines.append(f"{_key(key)} = {_value(value)}" + (f"  # {comment}" if comment else ""))
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    escaped = "".join(_ESCAPES.get(c, c if c.isprintable() or c == " " else _unicode_escape(c)) for c in text)
    return f'"{escaped}"'


def _unicode_escape(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04X}" if code < 0x10000 else f"\\U{code:08X}"


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(str(key))} = {_value(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return value.isoformat()  # the dates and times TOML has
