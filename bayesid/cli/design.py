"""`bayesid design`: the next manoeuvre, as a command table, for what is still open."""

from __future__ import annotations

from typing import Annotated

import typer

from bayesid.cli.choices import (
    Box,
    Data,
    Depth,
    Dof,
    Duration,
    Executed,
    Fitted,
    Fix,
    Noise,
    Pieces,
    Plane,
    Prior,
    Rate,
    Resample,
    Rudder,
    ShaftRange,
    Source,
    Step,
    Vehicle,
)
from bayesid.cli.options import Figures, Json, Out, Quick, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.quantity import quantity
from bayesid.cli.terminal import OK

Gain = Annotated[bool, typer.Option("--gain", help="Goal: most about all coefficients, open or not.")]
Hold = Annotated[
    float | None,
    typer.Option(
        "--hold", metavar="TIME", parser=quantity("s", low=1e-3),
        help="Orders change only every so many seconds, as an autopilot's table does.",
    ),
]  # fmt: skip
Predict = Annotated[
    str | None, typer.Option("--predict", metavar="MANOEUVRE", help="Goal: predict this one better.")
]
Worst = Annotated[bool, typer.Option("--worst", help="With --predict: its worst reading, not the mean.")]
Tell = Annotated[
    str | None, typer.Option("--tell", metavar="A,B", help="Goal: tell these causes of a gap apart.")
]
Size = Annotated[float, typer.Option("--size", help="With --tell: size of the causes over their prior sd.")]
Count = Annotated[int, typer.Option("--count", min=1, max=20, help="Library manoeuvres chosen and ordered.")]
Tries = Annotated[int, typer.Option("--tries", min=50, max=100_000, help="Manoeuvres tried in the search.")]


def design(
    source: Source,
    vehicle: Vehicle = None,
    data: Data = None,
    resample: Resample = None,
    pieces: Pieces = None,
    dof: Dof = None,
    model: Fitted = None,
    executed: Executed = None,
    gain: Gain = False,
    predict: Predict = None,
    worst: Worst = False,
    tell: Tell = None,
    size: Size = 0.3,
    duration: Duration = None,
    rudder: Rudder = None,
    rate: Rate = None,
    rpm: ShaftRange = None,
    box: Box = None,
    depth: Depth = None,
    plane: Plane = None,
    hold: Hold = None,
    noise: Noise = None,
    dt: Step = None,
    fix: Fix = None,
    prior: Prior = None,
    count: Count = 3,
    tries: Tries = 1500,
    out: Out = None,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Design the next manoeuvre within limits: shrink what is open (default), predict, or tell causes apart.

    --out gets next_manoeuvre.csv, design.json and a report.
    """
    from bayesid.api.design import TABLE
    from bayesid.api.design import design as run
    from bayesid.cli.output import answer, print_text
    from bayesid.cli.quantity import noise_of, range_of
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    goals = [name for name, given in (("gain", gain), ("predict", predict), ("tell", tell)) if given]
    if len(goals) > 1:
        raise typer.BadParameter(
            "one goal at a time: --gain, --predict or --tell", param_hint="--" + goals[1]
        )
    found = run(
        source, vehicle, data=data, resample=resample, pieces=pieces, dof=dof, model=model,
        executed=executed or (), gain=gain, predict=predict, worst=worst, tell=tell,
        size=size, duration=duration, rudder=rudder, rate=rate, rpm=range_of(rpm, "--rpm"), box=box,
        depth=depth, plane=plane, hold=hold, noise=noise_of(noise), dt=dt, fix=fix, prior=prior, count=count,
        tries=tries, seed=seed, quick=quick, progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(
        found, out, as_json, verbose, {} if out is None else {"command table": out / TABLE}, figures=formats
    )
    if out is None and not as_json:
        print_text("\nGive --out FOLDER for the command table and the report.")
    return OK
