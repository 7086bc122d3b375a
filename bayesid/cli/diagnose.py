"""`bayesid diagnose`: where the gap between simulator and trial lies, what causes it, how far it shrinks."""

from __future__ import annotations

from typing import Annotated

import typer

from bayesid.cli.choices import Bundle, Data, Effects, Exclude, Prior, Resample, TrustInput, Vehicle
from bayesid.cli.options import (
    ExecutorName,
    Figures,
    Json,
    Out,
    Quick,
    Quiet,
    Seed,
    Verbose,
    figure_formats,
)
from bayesid.cli.terminal import NOT_CONVERGED, OK, WRONG_LOG

Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        "--jobs",
        "-j",
        min=1,
        help="How many at a time: runs of a bundle, in threads (default: one per processor), or bundles of a "
        "folder, in worker processes (default: this process alone).",
    ),
]


def diagnose(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    prior: Prior = None,
    effects: Effects = None,
    exclude: Exclude = None,
    resample: Resample = None,
    trust: TrustInput = False,
    seed: Seed = 0,
    quick: Quick = False,
    executor: ExecutorName = None,
    workers: Workers = None,
    figures: Figures = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Diagnose the gap between a simulator and a trial.

    --out gets diagnosis.json, a report, posterior.nc where an effect is named (without --quick), and
    model.json for `bayesid predict`. Held-out runs are read only after the verdict stands. A log with a sign,
    unit, axis or clock mistaken gets the verdict `input`, the line of trial.toml that mends it, and exit
    code 4. Where a check failed, or there is not enough to say anything, it ends with exit code 3. A
    diagnosis that is stopped goes on where it was when the same line is run again. With --quick
    explanations are compared once (no actuator that sticks, nothing that acts for a short time), nothing is
    sampled and no manoeuvre planned.

    A folder of bundles gets a report for each below --out, one page over all, and a vehicle file with the
    coefficients that the bundles of a vehicle share; --executor is for it. It ends with exit
    code 3 where a bundle has no diagnosis, for a mistake of its log among other reasons: the page over all
    says which, and which checks failed in the others.
    """
    from bayesid.api.diagnose import diagnose as run
    from bayesid.api.fleet import bundles_of, diagnose_fleet
    from bayesid.cli.output import answer
    from bayesid.cli.result_folder import refuse_diagnosis
    from bayesid.executor import executor_of
    from bayesid.progress import Progress

    formats = figure_formats(figures, out)
    several = bundles_of(bundle)
    if out is not None:
        refuse_diagnosis(out, "diagnosis.json" if several else "fleet.json")
    if several:
        if out is None:
            raise typer.BadParameter("a folder of bundles needs --out", param_hint="--out")
        if data is not None:
            raise typer.BadParameter("is for one bundle", param_hint="--data")
        if formats:
            raise typer.BadParameter("is for one bundle", param_hint="--figures")
        whole = diagnose_fleet(
            bundle, out, executor=executor_of(executor, workers), progress=Progress(quiet=as_json),
            vehicle=vehicle, prior=prior, effects=effects, exclude=exclude, resample=resample,
            next_manoeuvre=not quick, draws=not quick, seed=seed, trust_input=trust, first_look=quick,
        )  # fmt: skip
        answer(whole, out, as_json, verbose)
        return NOT_CONVERGED if whole.failures else OK
    found = run(
        bundle, vehicle, data=data, prior=prior, effects=effects, exclude=exclude, resample=resample,
        next_manoeuvre=not quick,
        draws=out is not None and not quick, keep_model=out is not None, seed=seed,
        trust_input=trust, threads=workers, first_look=quick, progress=Progress(quiet=as_json), journal=out,
    )  # fmt: skip
    answer(found, out, as_json, verbose, figures=formats)
    code = NOT_CONVERGED if found.failures else OK
    return {"not_enough": NOT_CONVERGED, "input": WRONG_LOG}.get(found.verdict, code)
