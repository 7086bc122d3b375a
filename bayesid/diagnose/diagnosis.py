"""A whole diagnosis: problem, comparison, verdict, shrink on held-out runs, next manoeuvre, and its JSON.

Takes a trial and a vehicle. Gives a frozen `Diagnosis`; `as_json` is the contract of `schema.json` (format
1).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from bayesid.coloured.fit import ColouredFit, fit
from bayesid.coloured.levels import silent
from bayesid.diagnose.attempt import attempt
from bayesid.diagnose.candidate import COEFFICIENT_ERROR, parameter_table
from bayesid.diagnose.description import Description, describe_gap
from bayesid.diagnose.description import as_json as described
from bayesid.diagnose.events import find_events, verdict_with, with_events
from bayesid.diagnose.found import Found, diagnosed_model
from bayesid.diagnose.interval import warning
from bayesid.diagnose.next_run import Proposal, propose
from bayesid.diagnose.place import place_of
from bayesid.diagnose.problem import Problem
from bayesid.diagnose.sampled import EffectPosterior, sample_effect
from bayesid.diagnose.sampled import as_json as sampled
from bayesid.diagnose.shrink import Shrink, ladder
from bayesid.diagnose.strays import begin
from bayesid.diagnose.verdict import Verdict, judge, simplest, unseen
from bayesid.diagnose.which import Candidates, compare
from bayesid.errors import BayesidError
from bayesid.model import Model
from bayesid.trials import Trial

Say = Callable[[str], None]
Array = np.ndarray
FORMAT = 1
SHRINK_DRAWS = 16
NAMING = ("effect", "effect_with_remainder", "several")


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything a diagnosis found.

    Attributes
    ----------
    trial, model : what was diagnosed
    problem, candidates, verdict : see their modules
    shrink : ladder on the held-out runs, read after the verdict was frozen
    proposals : next manoeuvres, best first
    warnings : sentences
    seed : of the bootstrap
    description : what the missing force is made of, where an effect does not explain all of it
    posterior : draws of the named effects' parameters and of what could hide them, where asked for
    diagnosed : the model to predict from, where asked for
    """

    trial: Trial
    model: Model
    problem: Problem
    candidates: Candidates
    verdict: Verdict
    shrink: Shrink
    proposals: tuple[Proposal, ...]
    warnings: tuple[str, ...]
    seed: int
    description: Description | None = None
    posterior: EffectPosterior | None = None
    diagnosed: Found | None = None


def diagnose(
    trial: Trial,
    model: Model,
    seed: int = 0,
    say: Say = lambda text: None,
    as_built: float | None = None,
    plan_next: bool = True,
    draw: bool = False,
    keep_model: bool = False,
) -> Diagnosis:
    """Diagnose the gap between a model and a trial.

    Parameters
    ----------
    as_built : relative sd of the coefficients from an earlier clean identification (as-built frame)
    say : called with a sentence before each stage
    plan_next : also rank manoeuvres to fly next
    draw : also sample the named effects' parameters by emcee; it confirms, the verdict stands before
    keep_model : also make the diagnosed model that `bayesid predict` draws from

    A step after the verdict that fails becomes a sentence in `warnings`.

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    problem, base = begin(model, trial, say, as_built)
    candidates = compare(problem, say, seed, base)
    events = find_events(problem, trial, simplest(candidates), say)
    unable: list[str] = []
    if events:
        named = ", ".join(f"{e.run} {e.start:.0f}-{e.end:.0f} s" for e in events)
        say(f"the same without {named}")
        try:
            shorter, base = begin(model, trial, say, as_built, events)
            problem, candidates = shorter, with_events(compare(shorter, say, seed, base), events)
        except BayesidError as exc:
            unable.append(
                f"the trial without {named} could not be diagnosed ({exc}); the verdict counts them"
            )
            events = ()
    verdict = verdict_with(judge(problem, candidates), events)
    warnings = [*trial.warnings, *problem.warnings, *unable]
    # The verdict stands. What follows describes, proves and plans; none of it may cost the verdict.
    description = None
    if verdict.word in ("outside", "effect_with_remainder"):
        say("what the missing force is made of")
        description = attempt(
            "the missing force could not be described",
            lambda: describe_gap(problem, candidates, verdict.word != "outside", seed),
            None,
            warnings,
        )
    say("held-out runs: how far the gap shrinks")
    shrink = attempt(
        "held-out runs could not be predicted",
        lambda: _shrink(problem, trial, candidates, seed),
        Shrink((), ()),
        warnings,
    )
    for rung in shrink.rungs:
        if verdict.word in NAMING and rung.worth and rung.interval[1] < 0:
            warnings.append(
                f"the named effect predicts the held-out runs worse over {rung.horizon}; do not rely on it"
            )
    proposals: tuple[Proposal, ...] = ()
    if plan_next:
        say("which manoeuvre to fly next")
        names = [n for n in verdict.set95 if n in candidates.bank.effects]
        proposals = attempt(
            "no next manoeuvre could be ranked",
            lambda: propose(problem, candidates.bank, names, 0.3)[:5],
            (),
            warnings,
        )
    posterior = _drawn(problem, candidates, verdict, seed, say, warnings) if draw else None
    diagnosed = None
    if keep_model:
        say("model for predictions")
        diagnosed = attempt(
            "the diagnosed model for `bayesid predict` could not be made",
            lambda: diagnosed_model(problem, candidates, verdict, trial.digest),
            None,
            warnings,
        )
    return Diagnosis(
        trial,
        model,
        problem,
        candidates,
        verdict,
        shrink,
        proposals,
        tuple(warnings),
        seed,
        description,
        posterior,
        diagnosed,
    )


def _drawn(
    problem: Problem, candidates: Candidates, verdict: Verdict, seed: int, say: Say, warnings: list[str]
) -> EffectPosterior | None:
    """Posterior of the explanation the verdict stands on; None where it names none or its refit stopped."""
    if verdict.word not in NAMING:
        return None
    of = next((c for c in candidates.refits if set(c.effects) == set(verdict.effects)), None)
    if of is None or not of.fit.converged:
        return None
    fitted = of.fit
    found = attempt(
        f"the posterior of {' + '.join(of.effects)} could not be sampled",
        lambda: sample_effect(problem, fitted, seed, say=say),
        None,
        warnings,
    )
    if found is None:
        return None
    if (told := warning(sampled(found))) is not None:
        warnings.append(told)
    return found


def _shrink(problem: Problem, trial: Trial, candidates: Candidates, seed: int) -> Shrink:
    if not trial.holdout:
        return Shrink((), ())
    models = {"nominal": problem.model.nominal, "recalibrated": candidates.none.fit.par}
    rng = np.random.default_rng(seed)
    draws = {"recalibrated": parameter_draws(candidates.none.fit, rng)}
    if any(problem.environment.colours.force):
        white = fit(problem.model, problem.logs, problem.coefficients, silent(problem.model), passes=12)
        models["recalibrated, white"] = white.par
        draws["recalibrated, white"] = parameter_draws(white, rng)
    best = simplest(candidates)
    gain = best.log_evidence - candidates.none.log_evidence
    models["with effect"] = best.fit.par if gain > 0 else candidates.none.fit.par
    draws["with effect"] = parameter_draws(best.fit, rng) if gain > 0 else draws["recalibrated"]
    return ladder(problem, trial, models, problem.environment.colours, seed, draws)


def parameter_draws(fitted: ColouredFit, rng: np.random.Generator, count: int = SHRINK_DRAWS) -> Array:
    """(count, n_par) parameter vectors from the Gaussian posterior of a fit, cut at its bounds."""
    root = np.linalg.cholesky(fitted.posterior.covariance)
    z = (fitted.values - fitted.free.mean) / fitted.free.sd
    out = np.repeat(fitted.par[None], count, axis=0)
    values = fitted.free.mean + fitted.free.sd * (z + rng.standard_normal((count, z.size)) @ root.T)
    out[:, fitted.free.where] = np.maximum(values, fitted.free.low)
    return out


def as_json(d: Diagnosis) -> dict[str, Any]:
    """Plain data of `diagnosis.json`, format 1."""
    from bayesid import __version__

    model, c, v = d.model, d.candidates, d.verdict
    catalogue = [e.name for e in model.kernel.effects]
    every = ["none", *catalogue, COEFFICIENT_ERROR, "outside"]
    best = simplest(c)
    table = parameter_table(best.fit, d.problem)
    effects = []
    named = v.effects
    if not named and v.word in ("ambiguous", "coefficients"):
        named = tuple(n for n in best.effects if n in model.effects and c.inside.get(n, 0.0) > 0.5)
    for name in named:
        effect = model.effects.get(name)
        values = {}
        if effect is not None:
            for p in effect.parameters:
                if effect.key(p.name) in table:
                    value, sd = table[effect.key(p.name)]
                    values[p.name] = {"value": value, "sd": sd, "unit": p.unit}
        effects.append(
            {
                "name": name,
                "probability": float(min(1.0, c.inside.get(name, 0.0))),
                "parameters": _contract(name, values),
            }
        )
    places = c.where.places
    rungs = d.shrink.rungs
    worth = [r for r in rungs if r.worth]
    full = worth[-1] if worth else (rungs[-1] if rungs else None)
    return {
        "format": FORMAT,
        "bayesid": __version__,
        "trial": {
            "name": d.trial.name,
            "digest": d.trial.digest,
            "dof": model.dof,
            "channels": list(d.problem.channels),
        },
        "model": model.digest,
        "seed": d.seed,
        "verdict": v.word,
        "effects": effects,
        "probabilities": {n: float(c.probabilities.get(n, 0.0)) for n in every},
        "acting": {n: float(min(c.inside.get(n, 0.0), 1.0)) for n in every},
        "set95": list(v.set95),
        "unseen": list(unseen(c)),
        "hidden_by_coefficients": list(v.hidden),
        "reasons": list(v.reasons),
        "ambiguity_groups": [list(g) for g in c.ambiguity.groups],
        "detectability": {
            n: {"noncentrality_at_one_prior_sd": float(x), "absorbed": float(a)}
            for n, x, a in zip(c.ambiguity.names, c.ambiguity.detect, c.ambiguity.absorbed, strict=True)
        },
        "where": {
            "channel": place_of(c, model),
            "evidence": {p.channel: float(p.evidence) for p in places},
            "period": places[0].period,
            "windows": [
                {"name": m.name, "evidence": float(m.evidence)} for m in c.where.masks if m.kind != "regime"
            ][:5],
            "regimes": [
                {"name": m.name, "evidence": float(m.evidence)} for m in c.where.masks if m.kind == "regime"
            ][:5],
            "after": {p.channel: float(p.evidence) for p in c.where_after.places} if c.where_after else {},
        },
        "gap": {
            "before_nominal": full.excess["nominal"] if full else None,
            "before": full.excess["recalibrated"] if full else None,
            "after": full.excess["with effect"] if full else None,
            "floor": full.floor if full else None,
            "shrink": _number(full.shrink) if full else None,
            "interval": [_number(x) for x in full.interval] if full else None,
            "horizons": [
                {
                    "horizon": r.horizon,
                    "seconds": _number(r.seconds),
                    "excess": r.excess,
                    "shrink": _number(r.shrink),
                    "interval": [_number(x) for x in r.interval],
                    "worth_shrinking": r.worth,
                    "floor": r.floor,
                    "rms": _numbers(r.rms),
                    "pieces": r.pieces,
                    "posterior_draws": r.draws,
                    "channels": _numbers(r.channels),
                }
                for r in rungs
            ],
        },
        "measures": [
            {"run": m.run, "name": m.name, "unit": m.unit, "logged": m.logged}
            | {k: _number(m.models.get(k, float("nan"))) for k in ("nominal", "recalibrated", "with effect")}
            for m in d.shrink.measures
        ],
        "events": [asdict(e) for e in d.problem.events],
        "posterior": sampled(d.posterior) if d.posterior is not None else None,
        "description": described(d.description) if d.description is not None else None,
        "environment": {
            "source": d.problem.environment.source,
            "force": list(d.problem.environment.colours.force),
            "force_tau": d.problem.environment.colours.force_tau,
            "drift": d.problem.environment.colours.drift,
            "drift_tau": d.problem.environment.colours.drift_tau,
            "depth": d.problem.environment.colours.depth,
            "arms": list(d.problem.environment.colours.arms),
        },
        "coefficients": {
            n: {"value": float(x / model.file_scale(n)), "sd": float(s / abs(model.file_scale(n)))}
            for n, x, s in zip(d.problem.coefficients.names, best.fit.values, best.fit.sd, strict=False)
        },
        "next_manoeuvre": [
            {"name": p.name, "duration": p.duration, "margin_now": p.margin_now, "margin_with": p.margin_with}
            for p in d.proposals
        ],
        "warnings": list(d.warnings),
    }


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _numbers(table: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
    """Model -> channel -> number; None for a channel no held-out run reads."""
    return {k: {c: _number(x) for c, x in row.items()} for k, row in table.items()}


def _contract(name: str, values: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Parameters under the names of the contract: wind as speed and direction."""
    if name != "wind" or "blowing_north" not in values:
        return dict(values)
    n, e = values["blowing_north"], values["blowing_east"]
    speed = float(np.hypot(n["value"], e["value"]))
    spread = float(np.hypot(n["sd"], e["sd"]) / np.sqrt(2))
    came = float((np.arctan2(e["value"], n["value"]) + np.pi) % (2 * np.pi))
    return {
        "V_wind": {"value": speed, "sd": spread, "unit": "m/s"},
        "from": {"value": came, "sd": min(spread / max(speed, 1e-9), np.pi), "unit": "rad"},
        "area_coefficients": values["area_coefficients"],
    }


def schema() -> dict[str, Any]:
    """JSON Schema of `diagnosis.json`."""
    return json.loads(files("bayesid.diagnose").joinpath("schema.json").read_text(encoding="utf-8"))
