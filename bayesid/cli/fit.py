"""`bayesid fit`: identify a vehicle from a trial bundle and predict the runs that were kept back."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from bayesid.cli.choices import (
    Bundle,
    Data,
    Effects,
    Fix,
    Free,
    Pieces,
    Resample,
    Runs,
    TrustInput,
    Vehicle,
    With,
)
from bayesid.cli.options import Figures, Json, Out, Quick, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.terminal import NOT_CONVERGED, OK

Estimate = Annotated[
    bool, typer.Option("--estimate-noise", help="Weights from the residuals instead of the stated noise.")
]
Residuals = Annotated[
    Literal["auto", "white"],
    typer.Option(
        "--residuals",
        help="auto: weight and intervals as memory of the residuals and differences between runs ask for; "
        "white: as if residuals were white noise.",
    ),
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Do not go on from an interrupted fit in --out.")]
Starts = Annotated[int, typer.Option("--starts", min=1, max=256, help="Number of starts.")]


def fit(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    free: Free = None,
    fix: Fix = None,
    with_effects: With = None,
    effects: Effects = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    estimate: Estimate = False,
    residuals: Residuals = "auto",
    starts: Starts = 1,
    fresh: Fresh = False,
    trust: TrustInput = False,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Identify a vehicle's coefficients from a trial and predict its held-out runs.

    --out gets every iterate as it is found, fit.json, vehicle.toml of the identified vehicle, a report and,
    without --quick, the model for `bayesid predict`. Where the search did not converge, these runs leave a
    combination open or a check failed, it ends with exit code 3. A log that does not say what its
    header says is refused (4).
    """
    from bayesid.api.fit import fit as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        bundle, vehicle, data=data, out=out, free=free, fix=fix, with_effects=with_effects, effects=effects,
        runs=runs, resample=resample, pieces=pieces,
        estimate_noise=estimate, residuals=residuals, starts=starts, resume=not fresh, seed=seed, quick=quick,
        trust_input=trust,
        progress=Progress(quiet=as_json),
    )  # fmt: skip
    files = {} if out is None else {"identified vehicle": out / "vehicle.toml"}
    answer(
        found, out, as_json, verbose, files, extra={"out": None if out is None else out.name}, figures=formats
    )
    return OK if found.success and not found.failures else NOT_CONVERGED
