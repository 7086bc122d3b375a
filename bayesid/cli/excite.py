"""`bayesid excite`: which force terms the runs of a trial excite, and what a regression adds."""

from __future__ import annotations

from typing import Annotated

import typer

from bayesid.cli.choices import Bundle, Data, Fitted, Vehicle
from bayesid.cli.options import Figures, Json, Out, Quick, Quiet, Seed, Verbose, figure_formats

Form = Annotated[
    str, typer.Option("--form", help="weak (averages, no accelerations) or strong (smoothed accelerations).")
]
Draws = Annotated[int, typer.Option("--draws", min=10, max=10000, help="Bootstrap draws.")]


def excite(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    form: Form = "weak",
    draws: Draws = 100,
    model: Fitted = None,
    seed: Seed = 0,
    quick: Quick = False,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    """Which force terms the runs excite, by regressions that need no fit.

    PySINDy on the force table judges terms and groups of terms; beside it stand bayesid's own stepwise
    selection and the Fisher information of the tracks.

    Reads the identify runs only. --out gets excitation.json and a report.
    """
    from bayesid.api.excite import excite as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    found = run(
        bundle, vehicle, data=data, form=form, draws=draws, model=model, seed=seed, quick=quick,
        progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose, figures=formats)
