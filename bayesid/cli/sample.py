"""`bayesid sample`: the posterior of a trial's coefficients, with a verdict on the chain."""

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
    Prior,
    Resample,
    Runs,
    TrustInput,
    Vehicle,
    With,
)
from bayesid.cli.options import Figures, Json, OutFolder, Quick, Quiet, Seed, Verbose, figure_formats
from bayesid.cli.terminal import NOT_CONVERGED, OK

NoiseScale = Annotated[
    Literal["sampled", "marginal", "fixed"],
    typer.Option("--noise-scale", help="Noise of every channel: unknown, integrated out, or as stated."),
]
Initial = Annotated[
    Literal["marginal", "sampled", "fixed"], typer.Option("--initial", help="Initial state of every run.")
]
Memory = Annotated[
    Literal["composite", "inflate", "ar1", "ignore"],
    typer.Option(
        "--memory",
        help="Residuals that persist and runs that differ: composite likelihood as in `bayesid fit`, fewer "
        "readings, autoregression, or as white.",
    ),
]
Student = Annotated[
    float | None,
    typer.Option(
        "--student", metavar="DOF", min=1.0, help="Student-t noise, for outliers; not with marginal states."
    ),
]
Sampler = Annotated[
    Literal["emcee", "nuts"],
    typer.Option("--sampler", help="emcee's ensembles, or nutpie along slopes (extra nuts; no --resume)."),
]
Ensembles = Annotated[
    int, typer.Option("--ensembles", min=4, max=64, help="Independent ensembles, or chains of nuts.")
]
Walkers = Annotated[
    int | None, typer.Option("--walkers", min=4, help="Per ensemble; default from the unknowns.")
]
Steps = Annotated[int, typer.Option("--max-steps", min=10, help="Per ensemble or chain at most.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the chain in --out.")]


def sample(
    bundle: Bundle,
    out: OutFolder,
    data: Data = None,
    vehicle: Vehicle = None,
    free: Free = None,
    fix: Fix = None,
    with_effects: With = None,
    effects: Effects = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    prior: Prior = None,
    noise: NoiseScale = "sampled",
    initial: Initial = "marginal",
    memory: Memory = "composite",
    student: Student = None,
    sampler: Sampler = "emcee",
    ensembles: Ensembles = 4,
    walkers: Walkers = None,
    steps: Steps = 20_000,
    resume: Resume = False,
    trust: TrustInput = False,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Sample the posterior of a trial's coefficients and say whether the chain may be believed.

    Fits first, then samples until R-hat, length and effective size pass, or --max-steps are done (exit code
    3). A log that does not say what its header says is refused (4). A run that was stopped goes on with
    --resume and gives the same chain.
    """
    from bayesid.api.sample import sample as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        bundle, out, vehicle, data=data, free=free, fix=fix, with_effects=with_effects, effects=effects,
        runs=runs, resample=resample, pieces=pieces,
        prior=prior, noise=noise, initial=initial, memory=memory, student=student, sampler=sampler,
        ensembles=ensembles, walkers=walkers, max_steps=steps, resume=resume, seed=seed, quick=quick,
        trust_input=trust,
        progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose, figures=formats)
    return OK if found.posterior.converged else NOT_CONVERGED
