"""`bayesid fit`: identify a vehicle from a trial bundle and predict the runs that were kept back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.guard import NOT_CONVERGED, OK
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose
from bayesid.cli.trial import Bundle, Data

if TYPE_CHECKING:
    from bayesid.fit import TrialFit
    from bayesid.trials import Trial

Other = Annotated[
    str | None, typer.Option("--vehicle", help="Built-in name or vehicle file instead of the trial's.")
]
Free = Annotated[
    str | None,
    typer.Option(
        "--free", metavar="NAMES", help="Free these only, e.g. N_v,N_r,N_dr. Default: all of the file."
    ),
]
Fixed = Annotated[
    str | None, typer.Option("--fix", metavar="NAMES", help="Keep these as the vehicle has them.")
]
Runs = Annotated[
    str | None,
    typer.Option(
        "--runs", metavar="NAMES", help="Fit these runs and predict the others, whatever trial.toml says."
    ),
]
Resample = Annotated[
    float | None, typer.Option("--resample", metavar="DT", min=1e-4, help="Read every so many seconds only.")
]
Pieces = Annotated[
    float | None,
    typer.Option(
        "--pieces",
        metavar="SECONDS",
        min=1e-3,
        help="Fit runs in pieces of this length, for unstable vehicles.",
    ),
]
Estimate = Annotated[
    bool, typer.Option("--estimate-noise", help="Weights from the residuals instead of the stated noise.")
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Do not go on from an interrupted fit in --out.")]
MISFIT = 3.0  # residuals of so many times the noise are not noise
QUICK_SAMPLES, QUICK_ROUNDS = 300, 6


def fit(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Other = None,
    free: Free = None,
    fixed: Fixed = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    estimate: Estimate = False,
    starts: Annotated[int, typer.Option(min=1, max=256, help="Number of starts.")] = 1,
    fresh: Fresh = False,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Identify a vehicle's coefficients from a trial and predict its held-out runs.

    --out gets every iterate as it is found, fit.json, vehicle.toml of the identified vehicle and a report.
    """
    from bayesid.errors import FitError
    from bayesid.fit import Options
    from bayesid.fit.pieces import fit_in_pieces
    from bayesid.progress import Progress
    from bayesid.trials import load_trial
    from bayesid.vehicles import load_vehicle

    logged = load_trial(bundle, data)
    if not (vehicle or logged.vehicle_ref):
        raise FitError(f"{logged.name} names no vehicle; give --vehicle, or name one in trial.toml")
    ship = load_vehicle(vehicle or logged.vehicle_ref)
    kept = _names(fixed) or []
    unknown = [name for name in kept if name not in ship.coef]
    if unknown:
        raise FitError(
            f"{ship.name} has no coefficient {', '.join(unknown)} to keep; it has {', '.join(ship.coef)}"
        )
    trial = prepared(logged, _names(runs), resample, QUICK_SAMPLES if quick else None)
    profile = True if estimate else None  # None: where the trial leaves the noise of a channel open
    options = Options(
        seed=seed, starts=starts, profile=profile, **({"rounds": QUICK_ROUNDS} if quick else {})
    )
    with Progress(quiet=as_json).stage("fit") as stage:
        found = fit_in_pieces(
            trial, pieces, ship, out,
            free=_names(free), fixed=kept, options=options, resume=not fresh,
            watch=lambda done, cost, step: stage.step(info=f"cost {cost:.6g}, step {step:.1g}"),
        )  # fmt: skip
    _answer(found, out, as_json, verbose)
    return OK if found.fit.success else NOT_CONVERGED


def prepared(trial: Trial, names: list[str] | None, step: float | None, most: int | None) -> Trial:
    """The trial with the runs to fit chosen, and thinned.

    Parameters
    ----------
    names : runs to fit, all others are held out; None keeps the roles of the file
    step : time between readings [s]
    most : thin runs of more samples than this, where `step` is not given
    """
    from bayesid.errors import TrialError
    from bayesid.trials import thin

    there = [run.name for run in trial.runs]
    unknown = [name for name in names or () if name not in there]
    if unknown:
        raise TrialError(f"{trial.name}: no run {', '.join(unknown)}; there are {', '.join(there)}")
    runs = []
    for run in trial.runs:
        if names is not None:
            run = replace(run, role="identify" if run.name in names else "holdout")
        coarse = step or (run.duration / most if most and run.n_samples > most else None)
        runs.append(thin(run, coarse) if coarse else run)
    return replace(trial, runs=tuple(runs))


def _names(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _answer(found: TrialFit, out: Path | None, as_json: bool, verbose: bool) -> None:
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.sections.fit import noise_level, write_fit_report
    from bayesid.sections.prediction import PREDICTION_COLUMNS, prediction_rows

    result = found.fit
    report = write_fit_report(found, out) if out is not None else None
    if as_json:
        say_json(_plain(found, out))
        return
    size = (
        f"{len(found.problem.runs)} runs, {result.n_readings} readings, {result.n_params} unknown parameters"
    )
    say(f"{found.trial.name}: {size}, {result.seconds:.1f} s")
    say(f"{result.verdict}.")
    before, after = (noise_level(found.runs, "identify", key) for key in ("rms_nominal", "rms_fitted"))
    say(f"residuals of the fitted runs: from {before} to {after} times the noise")
    if 2 * result.cost > MISFIT**2 * result.n_readings:
        say(
            "The model misses these runs, or the stated noise is too small: the standard deviations are not "
            "to be trusted. Try --estimate-noise, or `bayesid diagnose`."
        )
    stated = found.trial.noise
    above = {c: v / stated[c] for c, v in result.sigma.items() if stated.get(c, 0) > 0}
    far = [f"{c} {ratio:.3g}" for c, ratio in above.items() if ratio > MISFIT]
    if far:
        say(
            f"Estimated noise, times the stated: {', '.join(far)}. So much is error of the model or a "
            "disturbance rather than noise; see `bayesid diagnose`."
        )
    say()
    scale = found.problem.params.vector("file_scale")
    rows = []
    for i, name in enumerate(result.names[: result.n_params]):
        bound = "on a bound" if name in result.at_bound else ""
        relative = 100 * result.sd[i] / max(abs(result.z[i]), 1e-300)
        rows.append([name, result.start[i] / scale[i], result.z[i] / scale[i], relative, bound])
    say_table(["coefficient", "start", "estimate", "sd [%]", "remark"], rows)
    if result.flat:
        say("\nNot determined by these data:")
        for d in result.flat:
            say(f"  {d.name}: held by {d.decided_by}")
    held = [run for run in found.runs if run.role == "holdout"]
    if held or verbose:
        say("\nRms errors" + (" of the held-out runs, predicted from their first readings" if held else ""))
        say_table(PREDICTION_COLUMNS, prediction_rows(held if held and not verbose else found.runs), digits=3)
    if report is not None:
        say(f"\nidentified vehicle: {report.parent / 'vehicle.toml'}\nreport: {report}")


def _plain(found: TrialFit, out: Path | None) -> dict[str, Any]:
    from bayesid.sections.prediction import prediction_numbers

    result = found.fit
    return {
        "trial": found.trial.name, "vehicle": found.vehicle.name, "digest": result.digest,
        "seed": result.seed,
        "success": result.success, "converged": result.converged, "status": result.status,
        "verdict": result.verdict, "cost": [result.cost_start, result.cost],
        "estimates_SI": {
            name: {"start": float(result.start[i]), "value": float(result.z[i]), "sd": float(result.sd[i])}
            for i, name in enumerate(result.names[: result.n_params])
        },
        "at_bound": result.at_bound,
        "flat": [{"name": d.name, "held_by": d.decided_by} for d in result.flat],
        "runs": prediction_numbers(found.runs), "out": None if out is None else out.name,
    }  # fmt: skip
