"""Load a vehicle: the name of a built-in set, or a TOML file; every problem of the file in one message.

Takes: a name or a path. Gives a `Vehicle` in SI, rudder to port, Gertler-Hagen complete.
Does not: judge stability or plausibility; that is `check`.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.errors import VehicleError, raise_all
from bayesid.model.actuators import Fin
from bayesid.model.terms import canonical_name, term
from bayesid.model.terms.dialects import READ
from bayesid.model.vehicles.convention import CONVERSIONS, converted, munk_and_coriolis
from bayesid.model.vehicles.fields import TomlTable, hint, shown
from bayesid.model.vehicles.inertia import mass_problems
from bayesid.model.vehicles.prior import read_prior
from bayesid.model.vehicles.tables import (
    read_actuators,
    read_coefficients,
    read_confidence,
    read_control,
    read_conversions,
    read_crossflow,
    read_effects,
    read_head,
    read_propulsion,
    read_sources,
    ship_problems,
)
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.words import decimal_comma

BUILTIN_FOLDER = Path(__file__).parent / "builtin"
LARGEST_FILE = 1_000_000  # bytes
SECTIONS = (
    "vehicle",
    "control",
    "propulsion",
    "crossflow",
    "coef",
    "actuators",
    "effects",
    "prior",
    "validation",
    "confidence",
    "sources",
)


def builtin_names() -> tuple[str, ...]:
    """Names of the sets that come with the package."""
    return tuple(sorted(path.stem for path in BUILTIN_FOLDER.glob("*.toml")))


def load_vehicle(vehicle: str | os.PathLike[str]) -> Vehicle:
    """Vehicle from a built-in name such as "generic_sub" or from a TOML file.

    Parameters
    ----------
    vehicle : a built-in name wins over a file of the same name; write "./name" for the file

    Raises
    ------
    VehicleError
        one error listing all problems: unreadable file, unknown or ambiguous coefficient (with the nearest
        names), missing or impossible number, unknown key, a mass matrix that is not positive definite
    """
    names = builtin_names()
    if isinstance(vehicle, str) and vehicle in names:
        return read_vehicle(_parsed(BUILTIN_FOLDER / f"{vehicle}.toml", vehicle), vehicle, None)
    text = os.fspath(vehicle)
    path = Path(text)
    where = path.name or text
    if "\0" in text:
        raise VehicleError(f"{text!r} is not a file name")
    if not path.suffix and not os.path.lexists(path):
        near = difflib.get_close_matches(text, names, n=1, cutoff=0.5)
        also = f"; did you mean {near[0]}?" if near else ""
        raise VehicleError(
            f"{shown(text)} is neither a built-in vehicle ({', '.join(names)}) nor a file{also}"
        )
    return read_vehicle(_parsed(path, where), where, path.parent)


def _parsed(path: Path, where: str) -> dict[str, Any]:
    """The TOML tables of a file of reasonable size."""
    try:
        if path.is_dir():
            raise VehicleError(f"{where}: is a folder; give the vehicle file in it")
        if not path.is_file():
            raise VehicleError(f"{where}: no such vehicle file")
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
        if len(data) > LARGEST_FILE:
            raise VehicleError(f"{where}: larger than {LARGEST_FILE} bytes, so it is no vehicle file")
        return tomllib.loads(data.decode("utf-8-sig"))
    except OSError as error:
        raise VehicleError(f"{where}: cannot be read ({error.strerror or type(error).__name__})") from None
    except UnicodeDecodeError as error:
        raise VehicleError(f"{where}: byte {error.start} is not UTF-8; save the file as UTF-8") from None
    except ValueError as error:  # TOMLDecodeError, and an integer of thousands of digits
        raise VehicleError(f"{where}: not valid TOML: {error}{decimal_comma(data, error)}") from None
    except RecursionError:
        raise VehicleError(f"{where}: not valid TOML: nested too deeply") from None


def read_vehicle(data: Mapping[str, Any], where: str, folder: Path | None) -> Vehicle:
    """Vehicle from parsed TOML tables; `folder` is where a covariance file may lie, None for nowhere.

    Raises
    ------
    VehicleError
        as `load_vehicle`
    """
    problems: list[str] = []
    for key in data:
        if key not in (*SECTIONS, "format"):
            problems.append(f"unknown section {shown(key)}{hint(key, SECTIONS)}")
    if data.get("format", 1) != 1 or isinstance(data.get("format", 1), bool):
        problems.append(f"format = {shown(data['format'])} is not known; this version reads format 1")
    for key in ("vehicle", "propulsion", "coef"):
        if key not in data:
            problems.append(f"section [{key}] is missing")
    head = TomlTable(data.get("vehicle", {}), "vehicle", problems)
    dialect = head.text("dialect", choices=READ) or None
    coef = read_coefficients(TomlTable(data.get("coef", {}), "coef", problems), dialect)
    prior = None
    if "prior" in data:
        prior = read_prior(data["prior"], coef, lambda name: canonical_name(name, dialect), folder, problems)
    values: dict[str, Any] = read_head(head)
    if values["nondimensional"] and values["U_ref"] is None:
        odd = [name for name in coef if term(name).velocity_power != 2]
        if odd:
            head.problem(f"U_ref [m/s] is missing: {', '.join(odd)} in prime form need a reference speed")
    limits, rates = read_control(TomlTable(data.get("control", {}), "control", problems))
    effects, effects_sd = read_effects(TomlTable(data.get("effects", {}), "effects", problems))
    actuators, lags = read_actuators(TomlTable(data.get("actuators", {}), "actuators", problems))
    problems += [
        f"[effects]: {name} is stated by `lag` of [actuators] too; keep one of them"
        for name in lags
        if name in effects
    ]
    effects = {**effects, **lags}
    values |= {
        "thrusters": tuple(a for a in actuators if not isinstance(a, Fin)),
        "fins": tuple(a for a in actuators if isinstance(a, Fin)),
        "effects": effects,
        "effects_sd": effects_sd,
        "limits": limits,
        "rates": rates,
        "propulsion": read_propulsion(TomlTable(data.get("propulsion", {}), "propulsion", problems)),
        "crossflow": read_crossflow(
            TomlTable(data["crossflow"], "crossflow", problems), values["planar_only"]
        )
        if "crossflow" in data
        else None,
        "validation": dict(TomlTable(data.get("validation", {}), "validation", problems).data),
        "confidence": read_confidence(TomlTable(data.get("confidence", {}), "confidence", problems)),
        "sources": read_sources(TomlTable(data.get("sources", {}), "sources", problems), coef, dialect),
    }
    problems += ship_problems(values["propulsion"].model, values["planar_only"], coef)
    stated = dict(coef)
    conversions = read_conversions(head)
    for name in conversions:
        coef, prior = converted(CONVERSIONS[name], coef, prior)
    values["completed"] = tuple(name for name in coef if name not in stated)
    if "fossen" in conversions:
        added = munk_and_coriolis(stated)
        values["in_file"] = {name: value for name, value in stated.items() if name in added}
    if not problems:
        vehicle = Vehicle(coef=coef, prior=prior, **values)
        problems += mass_problems(vehicle)
    if problems:
        raise_all(VehicleError, where, problems)
    return vehicle
