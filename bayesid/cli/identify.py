"""`bayesid identify`: what a trial can tell about coefficients and what it leaves open; nothing is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.fit import Fixed, Free, Other, Pieces, Resample, Runs
from bayesid.cli.guard import OK
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose
from bayesid.cli.trial import Bundle, Data

if TYPE_CHECKING:
    from bayesid.identifiability import Derived, Identifiability

FitFolder = Annotated[
    Path | None,
    typer.Option("--fit", help="Folder of a `bayesid fit`: look at its values, with its noise."),
]
Assumed = Annotated[
    float,
    typer.Option("--prior", metavar="SD", min=1e-6, help="Relative prior sd where the vehicle states none."),
]
QUICK_SAMPLES = 300
MOST_LEFT = 12  # open directions on the screen; a 6-DOF vehicle may have seventy
DRAWS, ZIGZAGS = 200, 40  # of prior and posterior, for what the vehicle does


def identify(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Other = None,
    free: Free = None,
    fixed: Fixed = None,
    runs: Runs = None,
    resample: Resample = None,
    pieces: Pieces = None,
    fit: FitFolder = None,
    prior: Assumed = 0.5,
    profile: Annotated[
        bool,
        typer.Option("--profile/--no-profile", help="Refit around every coefficient, fly drawn vehicles."),
    ] = True,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Say which coefficients and combinations a trial fixes, and which rest on the prior.

    Looks at the vehicle's own values (or those of --fit) with readings the vehicle itself would give: no
    fit, seconds. --out gets a report; an interrupted profile goes on where it was.
    """
    from bayesid.cli.fit import _names, prepared
    from bayesid.errors import FitError
    from bayesid.fit import load_fit
    from bayesid.fit.pieces import in_pieces
    from bayesid.identifiability import identify as look
    from bayesid.likelihood import coefficient_set, trial_problem
    from bayesid.model import build_model
    from bayesid.progress import Progress
    from bayesid.trials import load_trial
    from bayesid.vehicles import load_vehicle

    logged = load_trial(bundle, data)
    if not (vehicle or logged.vehicle_ref):
        raise FitError(f"{logged.name} names no vehicle; give --vehicle, or name one in trial.toml")
    ship = load_vehicle(vehicle or logged.vehicle_ref)
    trial = prepared(logged, _names(runs), resample, QUICK_SAMPLES if quick else None)
    trial = in_pieces(trial, pieces) if pieces else trial
    model = build_model(ship, 3 if ship.planar_only else trial.dof)
    earlier = load_fit(fit / "fit.json" if fit.is_dir() else fit) if fit is not None else None
    wanted = _names(free) or (earlier.names[: earlier.n_params] if earlier else model.coefficients)
    kept = set(_names(fixed) or ())
    params = coefficient_set(model, tuple(n for n in wanted if n not in kept))
    point, remarks = "the values of the vehicle file", []
    bound: tuple[str, ...] = ()
    if earlier is not None:
        values = {n: earlier.values.get(n, params[n].start) for n in params.names}
        params = params.started_at([values[n] for n in params.names])
        point, bound = "the values of an earlier fit", earlier.at_bound
    problem = trial_problem(model, trial, params, sigma=dict(earlier.sigma) if earlier else None)
    seen = {c for run in problem.runs for c in run.channels}
    guessed = sorted(seen - set(trial.noise) - set(earlier.sigma if earlier else ()))
    if guessed:
        remarks.append(f"no noise is stated for {', '.join(guessed)}; taken from the readings themselves")
    progress = Progress(quiet=as_json)
    with progress.stage("identify", 4 * len(params.names) if profile else None) as stage:
        found = look(
            problem, level=prior, profile=profile, at_bound=[n for n in bound if n in params.names],
            log=out / "profile.jsonl" if out is not None and profile else None, step=stage.step,
        )  # fmt: skip
    facts = {
        "trial": trial.name, "trial_digest": trial.digest, "vehicle": ship.name,
        "vehicle_digest": ship.digest, "digest": problem.digest, "point": point, "remarks": remarks,
        "assumed_prior": prior,
    }  # fmt: skip
    behaviour = None
    if profile and not quick:
        with progress.stage("turning circles and zig-zags", 2 * ZIGZAGS) as stage:
            behaviour = _behaviour(problem, found, seed, stage.step)
    _answer(found, facts, behaviour, out, as_json, verbose)
    return OK


def _behaviour(problem: Any, found: Identifiability, seed: int, step: Any) -> tuple[Derived, Derived]:
    """Derived quantities of draws of the prior and of the posterior."""
    import numpy as np

    from bayesid.identifiability import derived, full_vectors

    rng = np.random.default_rng(seed)
    draws = [found.information.draws(DRAWS, rng, prior) for prior in (True, False)]
    prior, posterior = (
        derived(problem.model, full_vectors(problem, d), zigzags=ZIGZAGS, step=step) for d in draws
    )
    return prior, posterior


def _answer(
    found: Identifiability,
    facts: dict[str, Any],
    behaviour: tuple[Derived, Derived] | None,
    out: Path | None,
    as_json: bool,
    verbose: bool,
) -> None:
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.sections import identify as words

    page = words.write_identify_report(found, facts, out, behaviour) if out is not None else None
    if as_json:
        extra = {"derived": words.derived_numbers(*behaviour)} if behaviour else {}
        say_json({**facts, **words.numbers(found), **extra})
        return
    size = f"{found.n_readings} readings, {len(found.names)} coefficients of {facts['vehicle']}"
    say(f"{facts['trial']}: {size}")
    say(words.sentence(found))
    for remark in facts["remarks"]:
        say(f"note: {remark}")
    say()
    rows = words.ledger_rows(found)
    chosen = range(len(words.LEDGER_COLUMNS)) if verbose else (0, 2, 3, 4, 6)
    say_table([words.LEDGER_COLUMNS[i] for i in chosen], [[row[i] for i in chosen] for row in rows], digits=3)
    if found.directions:
        say("\nLeft open:")
        shown = found.directions if verbose else found.directions[:MOST_LEFT]
        for d, (name, what, sd, _) in zip(shown, words.direction_rows(shown), strict=True):
            say(f"  {name}  (sd from the data: {sd})" + (f"\n    {what}" if what else ""))
            if verbose:
                say("    |cos| " + ", ".join(f"{k} {v:.4f}" for k, v in d.agreement.items()))
        if more := len(found.directions) - len(shown):
            say(
                f"  and {more} more that the data know better: -v shows them"
                + (", the report too" if page else "")
            )
    if behaviour is not None:
        say("\nWhat matters anyway:")
        say_table(words.DERIVED_COLUMNS, words.derived_rows(*behaviour))
    if page is not None:
        say(f"\nreport: {page}")
