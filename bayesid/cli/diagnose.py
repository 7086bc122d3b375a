"""`bayesid diagnose`: where the gap between simulator and trial lies, what causes it, how far it shrinks."""

from __future__ import annotations

from typing import Annotated

import typer

from bayesid.cli.choices import Bundle, Data, Effects, Exclude, Prior, Resample, Vehicle
from bayesid.cli.options import Json, Out, Quick, Quiet, Seed, Verbose
from bayesid.cli.terminal import NOT_CONVERGED, OK

TrustInput = Annotated[
    bool,
    typer.Option("--trust-input", help="Take the log as it is, whatever its channels say of one another."),
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
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Diagnose the gap between a simulator and a trial.

    --out gets diagnosis.json, a report, posterior.nc where an effect is named (without --quick), and
    model.json for `bayesid predict`. Held-out runs are read only after the verdict stands. A log with a sign,
    unit, axis or clock mistaken gets the verdict `input` and the line of trial.toml that mends it.
    """
    from bayesid.api.diagnose import diagnose as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    found = run(
        bundle, vehicle, data=data, prior=prior, effects=effects, exclude=exclude, resample=resample,
        next_manoeuvre=not quick,
        draws=out is not None and not quick, keep_model=out is not None, seed=seed,
        trust_input=trust, progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose)
    return NOT_CONVERGED if found.verdict == "not_enough" else OK
