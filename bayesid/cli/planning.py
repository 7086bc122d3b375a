"""What `bayesid compare` and `bayesid design` share: options, and the case they are about."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from bayesid.design.setup import Setup
    from bayesid.manoeuvres import Manoeuvre, Scale
    from bayesid.model import Model
    from bayesid.trials import Trial

Source = Annotated[
    str, typer.Argument(metavar="VEHICLE|BUNDLE", help="Vehicle, or trial whose runs count as flown.")
]
Other = Annotated[
    str | None, typer.Option("--vehicle", help="Built-in name or vehicle file instead of the trial's.")
]
Dof = Annotated[int | None, typer.Option(help="3 (horizontal plane, default) or 6; a trial's own.")]
Flown = Annotated[
    list[str] | None, typer.Option("--flown", metavar="MANOEUVRE", help="Counts as flown already.")
]
Fixed = Annotated[
    str | None,
    typer.Option("--fix", metavar="NAMES", help="Coefficients taken as known, e.g. X_udot,Y_vdot,N_rdot."),
]
Known = Annotated[
    float, typer.Option("--known", metavar="SHARE", help="Relative sd where the vehicle file states none.")
]
Noise = Annotated[
    list[str] | None,
    typer.Option("--noise", metavar="CHANNEL=SIGMA", help="Logged channel and its noise [SI]."),
]
Step = Annotated[float | None, typer.Option("--dt", min=1e-4, help="Time between readings [s].")]
Duration = Annotated[float | None, typer.Option("--duration", help="Length of a run [s]; default 45 L/U.")]
Rudder = Annotated[float | None, typer.Option("--rudder", help="Largest rudder [deg].")]
Rate = Annotated[float | None, typer.Option("--rate", help="Rudder rate [deg/s].")]
Shaft = Annotated[str | None, typer.Option("--rpm", metavar="LOW:HIGH", help="Shaft speeds allowed [rpm].")]
Box = Annotated[float | None, typer.Option("--box", help="Longest side of the area swept [m].")]
Depth = Annotated[float | None, typer.Option("--depth", help="Largest change of depth [m]; 6-DOF.")]
Plane = Annotated[float | None, typer.Option("--plane", help="Largest stern plane [deg], 0: none; 6-DOF.")]
Draws = Annotated[int, typer.Option("--draws", min=1, max=1000, help="Vehicles drawn from what is known.")]


def is_bundle(source: str) -> bool:
    """Whether the argument names a trial rather than a vehicle."""
    path = Path(source)
    return (path / "trial.toml").is_file() or path.name == "trial.toml"


def read(source: str, vehicle: str | None, dof: int | None) -> tuple[Model, Trial | None]:
    """Model, and the trial if the argument names one."""
    from bayesid.errors import TrialError
    from bayesid.model import build_model
    from bayesid.trials import load_trial
    from bayesid.vehicles import load_vehicle

    if not is_bundle(source):
        if Path(source).is_dir():
            raise TrialError(f"{source}: a folder without trial.toml; give a trial bundle or a vehicle")
        return build_model(load_vehicle(vehicle or source), dof or 3), None
    trial = load_trial(source)
    if not (vehicle or trial.vehicle_ref):
        raise TrialError(f"{trial.name} names no vehicle; give --vehicle, or name one in trial.toml")
    ship = load_vehicle(vehicle or trial.vehicle_ref)
    return build_model(ship, dof or (3 if ship.planar_only else trial.dof)), trial


def set_up(
    model: Model,
    trial: Trial | None,
    *,
    flown: list[str] | None,
    fixed: str | None,
    known: float,
    noise: list[str] | None,
    dt: float | None,
    duration: float | None,
    rudder: float | None,
    rate: float | None = None,
    rpm: str | None = None,
    box: float | None = None,
    depth: float | None = None,
    plane: float | None = None,
) -> Setup:
    """The case the options describe."""
    from bayesid.cli.simulate import numbers
    from bayesid.design import limits, usual_logging
    from bayesid.design.setup import known_of, trial_case, vehicle_case
    from bayesid.errors import TrialError

    angles = {"rudder": rudder, "rate": rate, "plane": plane}
    radians = {k: None if v is None else math.radians(v) for k, v in angles.items()}
    bounds = limits(
        model, duration, rudder=radians["rudder"], rate=radians["rate"], plane=radians["plane"],
        rpm=_range(rpm), box=math.inf if box is None else box, depth=depth,
    )  # fmt: skip
    knowledge = known_of(model, known, [n.strip() for n in (fixed or "").split(",") if n.strip()])
    sigma = numbers(noise, "--noise")
    if trial is None:
        logging = usual_logging(model, sigma, dt)
        return vehicle_case(model, knowledge, logging, bounds, orders(model, flown))
    if flown:
        raise TrialError("--flown goes with a vehicle; of a trial its own identify runs count as flown")
    return trial_case(model, trial, knowledge, bounds, sigma, dt)


def orders(model: Model, texts: list[str] | None) -> dict[str, Manoeuvre]:
    """Manoeuvres given as text, by that text."""
    from bayesid.manoeuvres import parse

    return {text: parse(text, scale(model)) for text in texts or ()}


def scale(model: Model) -> Scale:
    """Size of the vehicle for manoeuvres that leave something open."""
    from bayesid.errors import VehicleError
    from bayesid.manoeuvres import Scale

    if not model.vehicle.rpm_ref:
        raise VehicleError(f"{model.vehicle.name}: names no usual shaft speed to start a manoeuvre from")
    length, speed = model.scales["L"], model.scales["U"]
    rudder, plane = (min(model.vehicle.limits.get(fin, 0.61), 0.61) for fin in ("delta_r", "delta_s"))
    return Scale(length, speed, model.vehicle.rpm_ref, rudder, plane, model.dof, length / speed / 20)


def _range(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, colon, high = text.partition(":")
    try:
        return float(low), float(high if colon else low)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not LOW:HIGH in rpm", param_hint="--rpm") from None


def say_notes(notes: Any) -> None:
    """Notes of a case, one per line."""
    from bayesid.cli.output import say

    for note in notes:
        say(f"note: {note}")
