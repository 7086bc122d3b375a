"""`bayesid diagnose`: where the gap between simulator and trial lies, what causes it, how far it shrinks."""

from __future__ import annotations

from bayesid.cli.choices import Bundle, Data, Effects, Exclude, Prior, Resample, Vehicle
from bayesid.cli.options import Json, Out, Quick, Quiet, Seed, Verbose
from bayesid.cli.terminal import OK


def diagnose(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    prior: Prior = None,
    effects: Effects = None,
    exclude: Exclude = None,
    resample: Resample = None,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Diagnose the gap between a simulator and a trial.

    --out gets diagnosis.json, a report, posterior.nc where an effect is named (without --quick), and
    model.json for `bayesid predict`. Held-out runs are read only after the verdict stands.
    """
    from bayesid.api.diagnose import diagnose as run
    from bayesid.cli.output import answer
    from bayesid.progress import Progress

    found = run(
        bundle, vehicle, data=data, prior=prior, effects=effects, exclude=exclude, resample=resample,
        next_manoeuvre=not quick,
        draws=out is not None and not quick, keep_model=out is not None, seed=seed,
        progress=Progress(quiet=as_json),
    )  # fmt: skip
    answer(found, out, as_json, verbose)
    return OK
