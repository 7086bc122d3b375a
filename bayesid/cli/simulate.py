"""`bayesid simulate`: execute manoeuvres with a vehicle, measure them, and write them as a trial bundle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.choices import Dof, Noise, Shaft, Step, VehicleName
from bayesid.cli.options import Json, Out, Quiet, Seed, Verbose

if TYPE_CHECKING:
    import numpy as np

    from bayesid.model.vehicles import Vehicle
    from bayesid.trials import Run

Orders = Annotated[
    list[str],
    typer.Argument(
        metavar="MANOEUVRE...",
        help="e.g. zigzag:10/10  turn:20,side=starboard  prbs:seed=3  table:commands.csv; see `bayesid "
        "manoeuvre list`.",
        show_default=False,
    ),
]
Changed = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Change a coefficient (file units) or an effect parameter (SI, or with a unit: 2deg).",
    ),
]
HeldOut = Annotated[
    list[str] | None,
    typer.Option(
        "--holdout",
        metavar="MANOEUVRE",
        help="Keep this run for judging (role `holdout`), e.g. turn:20; may be given several times.",
    ),
]


def simulate(
    vehicle: VehicleName,
    manoeuvres: Orders,
    dof: Dof = None,
    dt: Step = None,
    rpm: Shaft = None,
    change: Changed = None,
    noise: Noise = None,
    holdout: HeldOut = None,
    out: Out = None,
    seed: Seed = 0,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Simulate manoeuvres and measure them; --out writes a trial bundle.

    --quiet prints a line per run and no measures. Orders of your own are a table, `table:FILE.csv`.
    """
    from bayesid.api.simulate import needed_dof, simulate_model
    from bayesid.cli.output import print_json, print_text
    from bayesid.cli.quantity import changes_of, noise_of
    from bayesid.cli.run_measures import print_measures
    from bayesid.equations.model import build_model
    from bayesid.model.vehicles import load_vehicle
    from bayesid.trials import write_trial
    from bayesid.trials.write import refuse_trial

    if out is not None:
        refuse_trial(out)
    found = load_vehicle(vehicle)
    dof = dof or needed_dof(found, manoeuvres)
    model = build_model(found, dof)
    trial = simulate_model(
        model, vehicle, tuple(manoeuvres), dt, rpm, changes_of(change), noise_of(noise), seed, holdout or ()
    )
    results = {run.name: _summary(run, found) for run in trial.runs}
    if out is not None:
        write_trial(trial, out)
    if as_json:
        print_json({
            "vehicle": found.name, "digest": model.digest, "dof": dof, "seed": seed, "runs": results
        })  # fmt: skip
        return
    for result in results.values():
        first, last = result["speed at the start [m/s]"], result["speed at the end [m/s]"]
        name = result["manoeuvre"] + (", held out" if result["role"] == "holdout" else "")
        print_text(f"{name}: {result['duration [s]']:.0f} s, speed {first:.3g} to {last:.3g} m/s")
        if not quiet:
            print_measures(result["measures"], found.L)
            print_text()
    if out is not None:
        print_text(f"trial bundle: {out / 'trial.toml'}")


def _summary(run: Run, vehicle: Vehicle) -> dict[str, Any]:
    from bayesid.cli.run_measures import measured_channels
    from bayesid.measures import named_measures

    channels = measured_channels(run, vehicle)
    speed = _speed(run)
    return {
        "manoeuvre": run.manoeuvre,
        "role": run.role,
        "samples": run.n_samples,
        "duration [s]": run.duration,
        "speed at the start [m/s]": float(speed[0]),
        "speed at the end [m/s]": float(speed[-1]),
        "measures": named_measures(run.manoeuvre, run.t, channels),
    }


def _speed(run: Run) -> np.ndarray:
    import numpy as np

    return np.sqrt(sum(run.data[name] ** 2 for name in ("u", "v", "w") if name in run.data))
