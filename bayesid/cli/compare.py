"""`bayesid compare`: which manoeuvre reveals which coefficient, adds what, and predicts which other."""

from __future__ import annotations

from typing import Annotated

import typer

from bayesid.cli.choices import (
    Data,
    Dof,
    Duration,
    Executed,
    Fitted,
    Fix,
    Noise,
    Pieces,
    Plane,
    Prior,
    Resample,
    Rudder,
    Source,
    Step,
    Vehicle,
)
from bayesid.cli.options import Figures, Json, Out, Quick, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.quantity import quantity
from bayesid.cli.terminal import OK

Extra = Annotated[
    list[str] | None,
    typer.Option("--also", metavar="MANOEUVRE", help="Compared with the library, e.g. table:mine.csv."),
]
Draws = Annotated[int, typer.Option("--draws", min=1, max=1000, help="Vehicles drawn from what is known.")]
Refits = Annotated[
    int, typer.Option("--refits", min=0, max=200, help="True vehicles simulated and refitted; 0: none.")
]

Time = Annotated[
    float | None,
    typer.Option(
        "--time", metavar="TIME", parser=quantity("s"),
        help="Of the best run, pair and triple, all together [s]; default without limit.",
    ),
]  # fmt: skip


def compare(
    source: Source,
    vehicle: Vehicle = None,
    data: Data = None,
    resample: Resample = None,
    pieces: Pieces = None,
    dof: Dof = None,
    model: Fitted = None,
    executed: Executed = None,
    also: Extra = None,
    duration: Duration = None,
    rudder: Rudder = None,
    plane: Plane = None,
    noise: Noise = None,
    dt: Step = None,
    fix: Fix = None,
    prior: Prior = None,
    draws: Draws = 8,
    refits: Refits = 3,
    time: Time = None,
    out: Out = None,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Compare manoeuvres before anything is executed: information, contraction, cross prediction.

    --out gets comparison.json and a report.
    """
    from bayesid.api.compare import compare as run
    from bayesid.cli.output import answer
    from bayesid.cli.quantity import noise_of
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        source, vehicle, data=data, resample=resample, pieces=pieces, dof=dof, model=model,
        executed=executed or (), also=also or (), duration=duration, rudder=rudder,
        plane=plane, noise=noise_of(noise), dt=dt, fix=fix, prior=prior, draws=draws, refits=refits,
        time=time, seed=seed, quick=quick, progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose, figures=formats)
    return OK
