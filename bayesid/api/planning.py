"""What `bayesid.compare` and `bayesid.design` share: the case they are about.

Takes a vehicle or a trial, limits and choices. Does not judge manoeuvres.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from bayesid.analysis.design import limits, usual_logging
from bayesid.analysis.design.planning_case import PlanningSetup, known_of, trial_case, vehicle_case
from bayesid.api.earlier_fit import fit_of
from bayesid.api.inputs import Names, VehicleLike, names_of, ordered, prepared, table_of, vehicle_of
from bayesid.equations.model import Model, build_model
from bayesid.errors import ManoeuvreError, TrialError, VehicleError
from bayesid.estimation.segments import in_pieces
from bayesid.manoeuvres import Manoeuvre, Scale
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import plane_limit, rudder_limits, steers, without_rudder
from bayesid.simulation import with_shaft_speed
from bayesid.trials import Trial, load_trial
from bayesid.trials.bundle import builtin_trials


def subject_of(
    source: Trial | Vehicle | str | os.PathLike[str],
    vehicle: VehicleLike | None,
    dof: int | None,
    prior: float | None,
    data: str | os.PathLike[str] | None = None,
    resample: float | None = None,
) -> tuple[Model, Trial | None]:
    """Model, and the trial if the source is one or names one.

    Raises
    ------
    TrialError
        a folder without trial.toml, or a trial without a vehicle
    """
    if not isinstance(source, Trial | Vehicle) and is_bundle(source):
        source = load_trial(os.fspath(source), data=data)
    if isinstance(source, Trial):
        source = prepared(source, None, resample)
    if not isinstance(source, Trial):
        if not isinstance(source, Vehicle) and Path(source).is_dir():
            raise TrialError(f"{source}: a folder without trial.toml; give a trial bundle or a vehicle")
        return build_model(
            vehicle_of(vehicle if vehicle is not None else source, None, prior), dof or 3
        ), None
    trial, ship = source, vehicle_of(vehicle, source, prior)
    model = build_model(ship, dof or (3 if ship.planar_only else trial.dof))
    return model, with_shaft_speed(trial, ship)


def require_rudder(vehicle: Vehicle, done: str) -> None:
    """Refuse a vehicle that no manoeuvre of the library moves.

    Raises
    ------
    ManoeuvreError
        a vehicle without a rudder
    """
    if not steers(vehicle):
        raise ManoeuvreError(
            f"{vehicle.name} {without_rudder(vehicle)}: manoeuvres are {done} for rudder, plane and shaft; "
            f"order its actuators by tables of your own ({table_of(vehicle)}), each alone and against the "
            "others"
        )


def is_bundle(source: str | os.PathLike[str]) -> bool:
    """Whether a path names a trial rather than a vehicle."""
    path = Path(source)
    if str(path) in builtin_trials() and not path.exists():
        return True
    return (path / "trial.toml").is_file() or path.name == "trial.toml"


def case_of(
    model: Model,
    trial: Trial | None,
    *,
    executed: Iterable[str],
    fix: Names,
    noise: Mapping[str, float] | None,
    dt: float | None,
    duration: float | None,
    rudder: float | None,
    rate: float | None = None,
    rpm: tuple[float, float] | None = None,
    box: float | None = None,
    depth: float | None = None,
    plane: float | None = None,
    pieces: float | None = None,
    hold: float | None = None,
    fitted: str | os.PathLike[str] | None = None,
) -> PlanningSetup:
    """The case that the choices describe; angles in radians.

    Raises
    ------
    TrialError, FitError, VehicleError
        choices that do not go together or name what is not there
    """
    bounds = limits(
        model, duration, rudder=rudder, rate=rate, plane=plane, rpm=rpm, box=math.inf if box is None else box,
        depth=depth, hold=hold or 0.0,
    )  # fmt: skip
    knowledge = known_of(model, fixed=names_of(fix) or [])
    sigma = dict(noise or {})
    if trial is None:
        if fitted is not None:
            raise TrialError(
                "a fit goes with the trial it is of: name the trial, whose runs then count as executed"
            )
        return vehicle_case(
            model, knowledge, usual_logging(model, sigma, dt), bounds, orders(model, executed)
        )
    if list(executed):
        raise TrialError(
            "manoeuvres taken as executed go with a vehicle; of a trial its own identify runs count"
        )
    cut = trial if pieces is None else in_pieces(trial, pieces)
    earlier = None if fitted is None else fit_of(fitted)
    return trial_case(model, cut, knowledge, bounds, sigma, dt, earlier)


def orders(model: Model, texts: Iterable[str]) -> dict[str, Manoeuvre]:
    """Manoeuvres given as text, by that text."""
    return ordered(model, texts, reference_scale(model))


def reference_scale(model: Model) -> Scale:
    """Size of the vehicle at its reference speed, for manoeuvres that leave something open.

    Raises
    ------
    VehicleError
        no usual shaft speed is known
    """
    if not model.vehicle.rpm_ref:
        raise VehicleError(f"{model.vehicle.name}: names no usual shaft speed to start a manoeuvre from")
    length, speed = model.scales["L"], model.scales["U"]
    angles = rudder_limits(model.vehicle)[0], plane_limit(model.vehicle)
    rudder, plane = (min(angle, 0.61) for angle in angles)
    return Scale(length, speed, model.vehicle.rpm_ref, rudder, plane, model.dof, length / speed / 20)
