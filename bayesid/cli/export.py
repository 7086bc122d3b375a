"""`bayesid export`: draws of a fitted or diagnosed vehicle for other simulators."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.choices import Effects
from bayesid.cli.options import Json, OutFolder, Quiet, Seed, Verbose
from bayesid.cli.terminal import NOT_CONVERGED, OK

ModelFolder = Annotated[
    Path, typer.Argument(metavar="MODEL", help="Folder of `bayesid fit --out` or `bayesid diagnose --out`.")
]
Draws = Annotated[int, typer.Option("--draws", min=1, max=10_000, help="Vehicles drawn from the posterior.")]


def export(
    model: ModelFolder,
    out: OutFolder,
    draws: Draws = 100,
    effects: Effects = None,
    seed: Seed = 0,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Write an ensemble of vehicles with effects, disturbances, weights and seeds.

    --out gets vehicle_estimate.toml, a vehicle file per draw and ensemble.json, all in SI units. Where a
    check of the model failed, it ends with exit code 3.
    """
    from bayesid.api.export import export as run
    from bayesid.cli.output import print_json, print_text
    from bayesid.progress import Progress

    found = run(model, out, draws, effects=effects, seed=seed, progress=Progress(quiet=as_json))
    if as_json:
        print_json(found.record())
    else:
        print_text(found.summary(verbose))
        print_text(f"ensemble: {out / 'ensemble.json'}")
    return NOT_CONVERGED if found.failures else OK
