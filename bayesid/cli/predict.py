"""`bayesid predict`: what the diagnosed model says a run or a manoeuvre will do, with a 95 % band."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.choices import Bundle, Data, Effects, Shaft, Step, Vehicle
from bayesid.cli.options import Figures, Json, Out, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.quantity import quantity
from bayesid.cli.terminal import NOT_CONVERGED, OK

What = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="RUN|MANOEUVRE...",
        help="Names of runs of the bundle, or manoeuvres such as turn:20 or table:commands.csv; all runs if "
        "left out.",
        show_default=False,
    ),
]
ModelFolder = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="Folder that `bayesid fit --out` or `bayesid diagnose --out` wrote; without it, diagnose first.",
    ),
]
Draws = Annotated[int, typer.Option("--draws", min=20, help="Vehicles drawn from the posterior.")]
Approach = Annotated[
    float | None,
    typer.Option(
        "--speed",
        metavar="SPEED",
        parser=quantity("m/s", low=0.0),
        help="Approach speed of a manoeuvre [m/s].",
    ),
]
Lead = Annotated[
    float | None,
    typer.Option(
        "--lead",
        metavar="TIME",
        parser=quantity("s", low=1e-3),
        help="First seconds of a run that may be read, to begin on its track.",
    ),
]
Noisy = Annotated[bool, typer.Option("--sensor-noise", help="Widen the bands by the sensors' white noise.")]


def predict(
    bundle: Bundle,
    what: What = None,
    model: ModelFolder = None,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    effects: Effects = None,
    draws: Draws = 300,
    speed: Approach = None,
    rpm: Shaft = None,
    dt: Step = None,
    lead: Lead = None,
    sensor_noise: Noisy = False,
    seed: Seed = 0,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Predict runs and manoeuvres with a fitted or diagnosed model.

    --out gets one CSV per prediction (every channel with its 95 % band) and a report. Of a run in the
    bundle only the orders and the first readings are used. Where a check of the model or of its prediction
    failed, it ends with exit code 3.
    """
    from bayesid.api.predict import predict as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        bundle, what, model=model, data=data, out=out, vehicle=vehicle, effects=effects, draws=draws,
        speed=speed, rpm=rpm, dt=dt, lead=lead, sensor_noise=sensor_noise, seed=seed,
        progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(
        found,
        out,
        as_json,
        verbose,
        {} if out is None else {"predictions": out / "predictions.json"},
        figures=formats,
    )
    return NOT_CONVERGED if found.failures else OK
