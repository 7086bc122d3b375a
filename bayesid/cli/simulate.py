"""`bayesid simulate`: fly manoeuvres with a vehicle, measure them, and write them as a trial bundle."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.options import Json, Out, Seed, Verbose
from bayesid.cli.vehicle import Name

if TYPE_CHECKING:
    import numpy as np

    from bayesid.model import Model
    from bayesid.trials import Run

Orders = Annotated[
    list[str],
    typer.Argument(
        metavar="MANOEUVRE...",
        help="e.g. zigzag:10/10  turn:20,side=starboard  prbs:seed=3  table:commands.csv",
        show_default=False,
    ),
]
Dof = Annotated[int, typer.Option(help="3 (horizontal plane) or 6 degrees of freedom.")]
Step = Annotated[float | None, typer.Option("--dt", min=1e-4, help="Step of commands and log [s].")]
Shaft = Annotated[float | None, typer.Option("--rpm", help="Shaft speed [rpm] instead of the usual one.")]
Changed = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a coefficient (file units) or an effect (SI)."),
]
Noise = Annotated[
    list[str] | None, typer.Option("--noise", metavar="CHANNEL=SIGMA", help="White noise on a channel [SI].")
]
LARGEST = 0.61  # 35 deg, where a vehicle states no limit


def simulate(
    vehicle: Name,
    manoeuvres: Orders,
    dof: Dof = 3,
    dt: Step = None,
    rpm: Shaft = None,
    change: Changed = None,
    noise: Noise = None,
    out: Out = None,
    seed: Seed = 0,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Fly manoeuvres and measure them; --out writes a trial bundle."""
    import numpy as np

    from bayesid.cli.measuring import say_measures
    from bayesid.cli.output import say, say_json
    from bayesid.manoeuvres import parse
    from bayesid.model import build_model
    from bayesid.trials import write_trial
    from bayesid.vehicles import load_vehicle
    from bayesid.virtual import virtual_trial

    found = load_vehicle(vehicle)
    model = build_model(found, dof)
    par = model.with_values(_changes(model, change), units="file")
    scale = scale_of(model, rpm, dt)
    flown = {_run_name(text, k): parse(text, scale) for k, text in enumerate(manoeuvres, 1)}
    texts = dict(zip(flown, (text.replace(":", " ", 1) for text in manoeuvres), strict=True))
    trial = virtual_trial(
        model,
        par,
        flown,
        title=f"simulated {found.name}",
        vehicle_ref=vehicle,
        descriptions=texts,
        noise=numbers(noise, "--noise"),
        rng=np.random.default_rng(seed),
    )
    results = {run.name: _summary(run) for run in trial.runs}
    if out is not None:
        write_trial(trial, out)
    if as_json:
        say_json({"vehicle": found.name, "digest": model.digest, "dof": dof, "seed": seed, "runs": results})
        return
    for result in results.values():
        first, last = result["speed at the start [m/s]"], result["speed at the end [m/s]"]
        say(f"{result['manoeuvre']}: {result['duration [s]']:.0f} s, speed {first:.3g} to {last:.3g} m/s")
        say_measures(result["measures"], found.L)
        say()
    if out is not None:
        say(f"trial bundle: {out / 'trial.toml'}")


def scale_of(model: Model, rpm: float | None, dt: float | None) -> Any:
    """Size of the vehicle for manoeuvres that leave something open."""
    from bayesid.errors import VehicleError
    from bayesid.manoeuvres import Scale
    from bayesid.vehicles import self_propulsion_speed

    vehicle = model.vehicle
    shaft = rpm if rpm is not None else vehicle.rpm_ref
    if shaft is None:
        raise VehicleError(f"{vehicle.name}: names no usual shaft speed; give --rpm")
    rudder, plane = (min(vehicle.limits.get(fin, LARGEST), LARGEST) for fin in ("delta_r", "delta_s"))
    speed = self_propulsion_speed(vehicle, shaft)
    return Scale(vehicle.L, speed, shaft, rudder, plane, model.dof, dt or 0.0)


def _changes(model: Model, pairs: list[str] | None) -> dict[str, float]:
    """Parameters to change; a name the model does not have is refused with the nearest one it has."""
    import difflib
    from contextlib import suppress

    from bayesid.errors import VehicleError
    from bayesid.terms import canonical_name

    found = {}
    for given, value in numbers(pairs, "--set").items():
        name = given
        with suppress(VehicleError):
            name = given if given in model.index else canonical_name(given)
        if name not in model.index:
            near = difflib.get_close_matches(given, model.index, n=3, cutoff=0.5)
            hint = f"; did you mean {', '.join(near)}?" if near else ""
            raise typer.BadParameter(f"the model has no parameter {given!r}{hint}", param_hint="--set")
        found[name] = value
    return found


def numbers(pairs: list[str] | None, option: str) -> dict[str, float]:
    """NAME=VALUE texts as numbers."""
    found: dict[str, float] = {}
    for pair in pairs or ():
        name, _, text = pair.rpartition("=")
        try:
            found[name.strip()] = float(text)
        except ValueError:
            name = ""
        if not name.strip():
            raise typer.BadParameter(f"{pair!r} is not NAME=VALUE with a number", param_hint=option)
    return found


def _run_name(text: str, number: int) -> str:
    stem = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:40]
    return f"{number:02d}_{stem}"


def _summary(run: Run) -> dict[str, Any]:
    from bayesid.measures import named_measures as measure

    channels = {**run.data, **{name.removesuffix("_cmd"): values for name, values in run.commands.items()}}
    speed = _speed(run)
    return {
        "manoeuvre": run.manoeuvre,
        "samples": run.n_samples,
        "duration [s]": run.duration,
        "speed at the start [m/s]": float(speed[0]),
        "speed at the end [m/s]": float(speed[-1]),
        "measures": measure(run.manoeuvre, run.t, channels),
    }


def _speed(run: Run) -> np.ndarray:
    import numpy as np

    return np.sqrt(sum(run.data[name] ** 2 for name in ("u", "v", "w") if name in run.data))
