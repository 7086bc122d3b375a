"""`bayesid excite`: which force terms the runs of a trial excite, and what a regression adds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.diagnose import Vehicle
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose
from bayesid.cli.trial import Bundle, Data

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
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Which force terms the runs excite: a sparse regression that needs no fit.

    The regression is our own stepwise selection on the force table; PySINDy is not its engine.

    Reads the identify runs only. --out gets excitation.json and a report.
    """
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.excitation import excite as run
    from bayesid.excitation.witness import as_json as plain
    from bayesid.files import write_json
    from bayesid.model import build_model
    from bayesid.progress import Progress
    from bayesid.sections.excitation import TERM_COLUMNS, finding, term_rows, write_excitation_report
    from bayesid.trials import load_trial
    from bayesid.vehicles import load_vehicle

    trial = load_trial(bundle, data=data)
    progress = Progress(quiet=as_json)
    model = build_model(load_vehicle(vehicle or trial.vehicle_ref), trial.dof)
    drift = (trial.environment.nav_drift or 0.0) if trial.environment else 0.0
    found = run(
        model,
        trial.identify,
        trial.noise,
        form=form,
        draws=min(draws, 20) if quick else draws,
        seed=seed,
        drift=drift,
        say=progress.note,
    )
    record = plain(found)
    if out is not None:
        write_json(Path(out) / "excitation.json", record)
        progress.note(f"report: {write_excitation_report(found, trial, Path(out), record)}")
    if as_json:
        say_json(record)
        return
    say_table(TERM_COLUMNS, term_rows(found, all_of_them=verbose))
    say()
    for sentence in finding(found):
        say(sentence)
