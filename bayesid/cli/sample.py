"""`bayesid sample`: the posterior of a trial's coefficients, with a verdict on the chain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from bayesid.cli.fit import Fixed, Free, Other, Pieces, Resample, Runs
from bayesid.cli.guard import NOT_CONVERGED, OK
from bayesid.cli.options import Json, Quick, Seed, Verbose, claimed
from bayesid.cli.trial import Bundle, Data

if TYPE_CHECKING:
    from bayesid.fit import TrialFit
    from bayesid.progress import Stage
    from bayesid.sample import Posterior

Folder = Annotated[
    Path,
    typer.Option(
        "--out",
        "-o",
        file_okay=False,
        help="Folder for the fit, the chain, posterior.nc and a report.",
        callback=claimed,
    ),
]
QUICK_SAMPLES, QUICK_STEPS = 200, 600


def sample(
    bundle: Bundle,
    out: Folder,
    data: Data = None,
    vehicle: Other = None,
    free: Free = None,
    fixed: Fixed = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    prior: Annotated[
        float | None,
        typer.Option(
            "--prior", metavar="SD", min=1e-6, help="Relative prior sd where the vehicle states none."
        ),
    ] = None,
    noise: Annotated[
        Literal["sampled", "marginal", "fixed"], typer.Option(help="Noise of every channel.")
    ] = "sampled",
    initial: Annotated[
        Literal["marginal", "sampled", "fixed"], typer.Option(help="Initial state of every run.")
    ] = "marginal",
    memory: Annotated[
        Literal["inflate", "ar1", "ignore"],
        typer.Option(help="Residuals that persist: count for fewer readings, autoregression, or as white."),
    ] = "inflate",
    student: Annotated[
        float | None,
        typer.Option(metavar="DOF", min=1.0, help="Student-t noise, for outliers; not with marginal states."),
    ] = None,
    ensembles: Annotated[int, typer.Option(min=4, max=64, help="Independent ensembles.")] = 4,
    walkers: Annotated[
        int | None, typer.Option(min=4, help="Per ensemble; default from the unknowns.")
    ] = None,
    steps: Annotated[int, typer.Option("--max-steps", min=10, help="Per ensemble at most.")] = 20_000,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the chain in --out.")] = False,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Sample the posterior of a trial's coefficients and say whether the chain may be believed.

    Fits first, then samples until R-hat, length and effective size pass, or --max-steps are done (exit code
    3). A run that was stopped goes on with --resume and gives the same chain.
    """
    from bayesid.cli.fit import _names, prepared
    from bayesid.errors import SampleError
    from bayesid.fit.pieces import fit_in_pieces
    from bayesid.likelihood import coefficient_set
    from bayesid.model import build_model
    from bayesid.progress import Progress
    from bayesid.sample import Options, Settings, trial_density
    from bayesid.sample import sample as draw
    from bayesid.sample.priors import with_prior
    from bayesid.trials import load_trial
    from bayesid.trials.noise import raised, said_raised
    from bayesid.vehicles import load_vehicle

    choice = Settings(noise=noise, initial=initial, memory=memory, student=student)
    logged = load_trial(bundle, data)
    if not (vehicle or logged.vehicle_ref):
        raise SampleError(f"{logged.name} names no vehicle; give --vehicle, or name one in trial.toml")
    ship = load_vehicle(vehicle or logged.vehicle_ref)
    trial = prepared(logged, _names(runs), resample, QUICK_SAMPLES if quick else None)
    model = build_model(ship, 3 if ship.planar_only else trial.dof)
    kept = set(_names(fixed) or ())
    wanted = tuple(n for n in _names(free) or model.coefficients if n not in kept)
    params = coefficient_set(model, wanted)
    params = with_prior(params, prior) if prior is not None else params
    options = Options(
        ensembles=ensembles, walkers=walkers, max_steps=min(steps, QUICK_STEPS) if quick else steps,
        seed=seed, first=100 if quick else 200,
    )  # fmt: skip
    progress = Progress(quiet=as_json)
    with progress.stage("fit") as stage:
        found = fit_in_pieces(
            trial, pieces, ship, out, params=params,
            watch=lambda n, cost, step: stage.step(info=f"cost {cost:.6g}"),
        )  # fmt: skip
    if not found.fit.converged:
        progress.note(f"the fit had not converged ({found.fit.message}); sampling starts off the mode")
    density = trial_density(found.problem, found.fit.z, choice, trial.noise)
    level = dict(zip(density.channels, map(float, density.noise_prior.scale), strict=True))
    if least := raised(level, model.scales["L"], model.scales["U"]):
        progress.note(f"{said_raised(least)}; chains are slow where a channel has none")
        density = trial_density(found.problem, found.fit.z, choice, {**trial.noise, **least})
    with progress.stage("sample") as stage:
        posterior = draw(density, density.laplace, options, out, resume=resume, watch=_watch(stage))
    posterior = replace(posterior, settings={**posterior.settings, "fit": found.fit.message})
    _answer(found, posterior, out, as_json)
    return OK if posterior.converged else NOT_CONVERGED


def _watch(stage: Stage) -> Any:
    return lambda steps, note: stage.step(steps, info=note or None)


def _answer(found: TrialFit, posterior: Posterior, out: Path, as_json: bool) -> None:
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.sections.sample import COLUMNS, noise_words, rows, verdict, write_sample_report

    page = write_sample_report(found, posterior, out)
    if as_json:
        say_json({"trial": found.trial.name, "vehicle": found.vehicle.name, **posterior.summary()})
        return
    g = posterior.gate
    say(
        f"{found.trial.name}: {len(posterior.names)} unknowns, {posterior.draws.shape[0]} ensembles of "
        f"{posterior.draws.shape[2]} walkers, {posterior.steps} steps after {posterior.discarded}, "
        f"{posterior.seconds:.1f} s of CPU"
    )
    say(verdict(posterior))
    say(
        f"R-hat {g.rhat.max():.4f}, {g.n_tau:.0f} autocorrelation times of {g.tau.max():.0f} steps, "
        "effective "
        f"size {g.ess_bulk.min():.0f} (bulk) and {g.ess_tail.min():.0f} (tail), acceptance "
        f"{posterior.acceptance.min():.2f} .. {posterior.acceptance.max():.2f}"
    )
    diverged = posterior.counts["diverged"]
    if diverged:
        say(f"{diverged} of {posterior.counts['all']} simulations diverged and count as impossible.")
    if noisy := noise_words(found, posterior):
        say(noisy)
    say()
    say_table(COLUMNS, rows(posterior))
    say(f"\nposterior: {out / 'posterior.nc'}\nreport: {page}")
