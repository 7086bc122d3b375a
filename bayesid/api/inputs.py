"""What a verb acts on: a trial, a vehicle, a model, runs chosen and thinned, lists of names.

Takes paths, names or objects, as users have them. Does not compute.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from bayesid.equations.model import Model, build_model, without_effects
from bayesid.errors import ManoeuvreError, ModelError, TrialError, VehicleError
from bayesid.files import UnreadableError, read_regular
from bayesid.manoeuvres import Manoeuvre, OpenLoop, Scale, parse, with_rows_every
from bayesid.model.channels import channel
from bayesid.model.effects import Effect
from bayesid.model.terms import TERMS, canonical_name
from bayesid.model.units import scale as unit_scale
from bayesid.model.vehicles import Vehicle, load_vehicle, self_propulsion_speed, with_relative_prior
from bayesid.model.vehicles.orders import (
    obeyed,
    plane_limit,
    rudder_limits,
    together,
    without_rudder,
)
from bayesid.trials import Run, Trial, load_trial, thin
from bayesid.trials.condensing import speed_known, thinned
from bayesid.trials.measured_wind import in_measured_wind
from bayesid.trials.noise_stated import with_seen_noise
from bayesid.words import and_list

Names: TypeAlias = "str | Iterable[str] | None"
TrialLike: TypeAlias = "Trial | str | os.PathLike[str]"
VehicleLike: TypeAlias = "Vehicle | str | os.PathLike[str]"
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
# Some coefficients have a comma in their name: "N_r,U", "Y_dr,eta". It separates none.
_ENDINGS = "|".join(sorted({re.escape(t.name.partition(",")[2]) for t in TERMS if "," in t.name}))
_SUFFIX = re.compile(rf"\s*,\s*(?=(?:{_ENDINGS})\s*$)")
_BETWEEN = re.compile(rf",(?!\s*(?:{_ENDINGS})\s*(?:,|$))")
LARGEST_EFFECTS = 2**20  # bytes of a Python file of effects
LARGEST_ANGLE = math.radians(35.0)  # largest fin angle of a manoeuvre where the vehicle states no limit


def trial_of(trial: TrialLike, data: str | os.PathLike[str] | None = None) -> Trial:
    """The trial itself, or read from a bundle."""
    return trial if isinstance(trial, Trial) else load_trial(os.fspath(trial), data=data)


def vehicle_of(
    vehicle: VehicleLike | None, trial: Trial | None = None, prior: float | None = None
) -> Vehicle:
    """The vehicle itself, or one that is read, by default that of the trial, in the wind the trial measured.

    Parameters
    ----------
    prior : relative prior sd of every coefficient instead of what the file states

    Raises
    ------
    TrialError
        nothing names a vehicle
    """
    if isinstance(vehicle, Vehicle):
        ship = vehicle if trial is None else in_measured_wind(vehicle, trial)
        return with_relative_prior(ship, prior)
    named = vehicle or (trial.vehicle_ref if trial is not None else "")
    if not named:
        where = trial.name if trial is not None else "the trial"
        raise TrialError(f"{where} names no vehicle; give one (--vehicle), or name it in trial.toml")
    ship = load_vehicle(os.fspath(named))
    return with_relative_prior(ship if trial is None else in_measured_wind(ship, trial), prior)


def model_of(
    trial: Trial,
    vehicle: VehicleLike | None = None,
    effects: Iterable[Effect] = (),
    exclude: Names = None,
) -> Model:
    """Equations of the trial's vehicle with the catalogue's effects, some added, some taken out."""
    ship = vehicle_of(vehicle, trial)
    model = build_model(ship, 3 if ship.planar_only else trial.dof, declared=tuple(effects))
    return without_effects(model, names_of(exclude) or [])


def compiling_words(model: Model) -> str:
    """That the equations of this kind of vehicle are compiled first; empty where they are."""
    if model.kernel.compiled:
        return ""
    planar = "half a minute to a minute" if model.vehicle.actuators else "10 to 30 seconds"
    time = planar if model.dof == 3 else "1 to 3 minutes"
    return (
        f"equations: compiled for this kind of vehicle, once per machine (about {time}, in the first steps)"
    )


def names_of(names: Names) -> list[str] | None:
    """`"N_v, N_r,U"` or an iterable of names as a list, here of two; None stays None."""
    if names is None:
        return None
    if isinstance(names, str):
        parts = (_SUFFIX.sub(",", part) for part in _BETWEEN.split(names))
        return [n.strip() for n in parts if n.strip()]
    return [n.strip() for n in names if n.strip()]


def prepared(
    trial: Trial, runs: Names = None, resample: float | None = None, most: int | None = None
) -> Trial:
    """The trial with the runs to fit chosen, and thinned.

    Parameters
    ----------
    runs : runs to fit, all others are held out; None keeps the roles of the trial
    resample : time between readings [s]
    most : thin runs of more samples than this, where `resample` is not given

    Raises
    ------
    TrialError
        a run the trial does not have
    """
    names = names_of(runs)
    there = [run.name for run in trial.runs]
    unknown = [name for name in names or () if name not in there]
    if unknown:
        raise TrialError(f"{trial.name}: no run {', '.join(unknown)}; there are {', '.join(there)}")
    chosen = []
    for run in trial.runs:
        if names is not None:
            run = replace(run, role="identify" if run.name in names else "holdout")
        long = most is not None and resample is None and run.n_samples > most
        chosen.append(thin(run, _every(run, most or 0)) if long else run)
    taken = replace(trial, runs=tuple(chosen))
    return thinned(taken, resample) if resample else taken


def _every(run: Run, most: int) -> float:
    """Whole number of sample steps [s] that leaves at most so many samples: a reading between two would have
    less noise than is stated."""
    step = float(np.median(np.diff(run.t)))
    return step * math.ceil(run.duration / (most * step) - 1e-9)


def with_believed_noise(trial: Trial, vehicle: Vehicle) -> Trial:
    """The trial with the noise its readings show where the stated one is not to be believed, and a warning.

    A vehicle without a usual shaft speed keeps what is stated.
    """
    speed = speed_known(vehicle)
    return with_seen_noise(trial, (vehicle.L, speed)) if speed is not None else trial


def scale_of(model: Model, rpm: float | None = None, dt: float | None = None) -> Scale:
    """Size of the vehicle for manoeuvres that leave something open.

    Raises
    ------
    VehicleError
        no usual shaft speed is known
    """
    vehicle = model.vehicle
    shaft = rpm if rpm is not None else vehicle.rpm_ref
    if shaft is None:
        raise VehicleError(f"{vehicle.name}: names no usual shaft speed; give rpm (--rpm)")
    angles = rudder_limits(vehicle)[0], plane_limit(vehicle)
    rudder, plane = (min(angle, LARGEST_ANGLE) for angle in angles)
    speed = self_propulsion_speed(vehicle, shaft)
    return Scale(vehicle.L, speed, shaft, rudder, plane, model.dof, dt or 0.0)


_LACKED = {"delta_s": "stern planes", "delta_b": "bow planes", "n": "shaft"}


def ordered(
    model: Model, texts: Iterable[str], scale: Scale, dt: float | None = None
) -> dict[str, Manoeuvre]:
    """Manoeuvres given as text, by that text; a table has rows every dt [s] too, where that is given.

    Raises
    ------
    ManoeuvreError
        what cannot be read, and one that orders what nothing of the vehicle obeys
    """
    found: dict[str, Manoeuvre] = {}
    for text in texts:
        order, table = parse(text, scale), text.partition(":")[0].strip() == "table"
        ship, commands = model.vehicle, _driven(order)
        idle = [
            name for name in ("delta_r", "delta_s", "delta_b", "n")
            if name not in obeyed(ship) and np.any(commands.get(f"{name}_cmd", 0.0))
        ]  # fmt: skip
        if idle:
            which = and_list([f"{name}_cmd" for name in idle])
            without = without_rudder(ship) if "delta_r" in idle else f"has no {_LACKED[idle[0]]}"
            why = f"nothing of {ship.name} obeys {which}" if table else f"{ship.name} {without}"
            raise ManoeuvreError(f"{text}: {why}; order its actuators by a table ({table_of(ship)})")
        found[text] = with_rows_every(order, dt) if table and dt and isinstance(order, OpenLoop) else order
    return found


def _driven(order: Manoeuvre) -> Mapping[str, Any]:
    """Orders of a manoeuvre; of one that is decided by the motion those that its law moves, as numbers."""
    if isinstance(order, OpenLoop):
        return order.commands
    return {"delta_s_cmd" if "delta_s_cmd" in order.start else "delta_r_cmd": 1.0}


def table_of(vehicle: Vehicle) -> str:
    """How a table of orders of a vehicle with actuators of its own is given, in words."""
    own = [signal for actuator in vehicle.actuators for signal in actuator.signals]
    usual = [name for name in obeyed(vehicle) if not together(vehicle).get(name)]
    orders = [channel(f"{name}_cmd") for name in (*own, *usual)]
    names = ", ".join(f"{order.name}[{order.shown[1]}]" for order in orders)
    return f"table:FILE.csv with columns t[s], {names}"


def parameter_values(model: Model, changes: Mapping[str, float | str] | None) -> dict[str, float]:
    """Parameters to change under the model's own names; other spellings of coefficients are read too.

    Parameters
    ----------
    changes : coefficient (units of the file) or effect parameter (SI, or text with a unit such as "2deg")

    Raises
    ------
    ModelError
        a name the model does not have, with the nearest ones it has; a value that is no number
    """
    import difflib
    from contextlib import suppress

    found = {}
    for given, value in (changes or {}).items():
        name = given
        with suppress(VehicleError):
            name = given if given in model.index else canonical_name(given)
        if name not in model.index:
            near = difflib.get_close_matches(given, model.index, n=3, cutoff=0.5)
            hint = f"; did you mean {', '.join(near)}?" if near else ""
            raise ModelError(f"the model has no parameter {given!r}{hint}")
        found[name] = _number(model, name, value)
    return found


def change_notes(model: Model, changes: Mapping[str, float | str] | None) -> list[str]:
    """What a change of coefficients does that its writer may not know, a sentence each.

    A spelling that is read as another name, and a row that the file of the vehicle does not have.
    """
    notes = []
    for given in changes or {}:
        (name,) = parameter_values(model, {given: 0.0})
        row = (
            any(name == term.name for term in TERMS)
            and name not in model.vehicle.coef
            and model.nominal[model.index[name]] == 0.0
        )
        read = f"{given} is read as {name}" if name != given else ""
        if row:
            read = f"{read}, which" if read else given
            read += f" is no row of {model.vehicle.name}: it is 0 there, and added to its equations here"
        if read:
            notes.append(read)
    return notes


def _number(model: Model, name: str, value: float | str) -> float:
    """A value as a number, converted to SI where it is a text with a unit."""
    if not isinstance(value, str):
        return float(value)
    found = _QUANTITY.fullmatch(value)
    unit = model.parameter_unit(name)
    if found is None or (found[2] and unit is None):
        raise ModelError(f"{name} = {value!r}: a number{'' if unit is None else f' in {unit}'} is needed")
    return float(found[1]) * (unit_scale(found[2], str(unit), name) if found[2] else 1.0)


def declared_effects(path: str | os.PathLike[str] | None) -> tuple[Effect, ...]:
    """Effects of a user's Python file, which is run.

    Raises
    ------
    ModelError
        the file cannot be run or defines no EFFECTS
    """
    if path is None:
        return ()
    import runpy

    file = Path(path)
    try:
        read_regular(file, LARGEST_EFFECTS)  # a pipe or a device would be waited for without end
        found: Any = runpy.run_path(str(file)).get("EFFECTS", ())
    except UnreadableError as exc:
        raise ModelError(f"{file.name}: {exc}; give a Python file of effects") from None
    except (Exception, SystemExit) as exc:
        raise ModelError(f"{file.name}: cannot be run as a Python file of effects: {exc}") from None
    if not found or not all(isinstance(e, Effect) for e in found):
        raise ModelError(f"{file.name}: define EFFECTS, a tuple of bayesid.model.effects.Effect")
    return tuple(found)
