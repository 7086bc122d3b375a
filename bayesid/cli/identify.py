"""`bayesid identify`: what a trial can tell about coefficients and what it leaves open; nothing is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.choices import Bundle, Data, Fix, Free, Pieces, Prior, Resample, Runs, Vehicle
from bayesid.cli.options import Figures, Json, Out, Quick, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.terminal import OK

FitFolder = Annotated[
    Path | None,
    typer.Option("--fit", help="Folder of a `bayesid fit`: look at its values, with its noise."),
]
Profile = Annotated[
    bool,
    typer.Option("--profile/--no-profile", help="Refit around every coefficient, simulate drawn vehicles."),
]


def identify(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    free: Free = None,
    fix: Fix = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    fit: FitFolder = None,
    prior: Prior = None,
    profile: Profile = True,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Say which coefficients and combinations a trial fixes, and which rest on the prior.

    Looks at the vehicle's own values (or those of --fit) with readings the vehicle itself would give. What is
    linear takes seconds (--no-profile); the refits around every coefficient take minutes, in six degrees of
    freedom up to hours. --out gets a report; an interrupted profile goes on where it was.
    """
    from bayesid.api.identify import identify as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        bundle, vehicle, data=data, out=out, free=free, fix=fix, runs=runs, resample=resample, pieces=pieces,
        fitted=fit, prior=prior, profile=profile, seed=seed, quick=quick, progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose, figures=formats)
    return OK
