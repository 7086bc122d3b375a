"""A whole diagnosis: problem, comparison, verdict, hold-out validation, next manoeuvre, and the result.

Takes a trial and a vehicle. Gives a frozen `Diagnosis` with its `Result`. Does not write or draw.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bayesid.diagnosis.attempt import attempt
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, diagnosed_model
from bayesid.diagnosis.event_description import described
from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.evidence.effect_draws import warning
from bayesid.diagnosis.evidence.effect_posterior import EffectPosterior, numbers, sample_effect
from bayesid.diagnosis.evidence.explained_model import ExplainedModel, explained_model
from bayesid.diagnosis.evidence.holdout import HoldoutValidation, validate_holdout
from bayesid.diagnosis.evidence.holdout_prediction import Made
from bayesid.diagnosis.evidence.missing_force import describe_missing_force
from bayesid.diagnosis.evidence.replay import EXPLAINED
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.failed_checks import NO_MODEL, needs_none
from bayesid.diagnosis.final_values import result_of
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.cross_validation import agreement
from bayesid.diagnosis.hypotheses.rules import nobody_needs
from bayesid.diagnosis.hypotheses.sensitivity_bank import not_asked
from bayesid.diagnosis.hypotheses.verdict import NAMING, Verdict, after_holdout, after_left_out, simplest
from bayesid.diagnosis.input.memory_needed import check_memory
from bayesid.diagnosis.next_manoeuvre import Proposal, propose
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import SimulatorMistakeFound
from bayesid.diagnosis.simulator import find_mistakes
from bayesid.diagnosis.summary import summary
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.trials import Trial
from bayesid.trials.noise_stated import with_seen_noise

Notify = Callable[[str], None]
Array = np.ndarray
HOLDOUT_DRAWS = 16


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The result of a diagnosis, and the working objects behind it for whoever goes on computing.

    Attributes
    ----------
    trial, model : what was diagnosed
    problem, candidates, verdict : see their modules
    result : final values; JSON, terminal and report derive from it alone
    posterior : draws of the named effects' parameters and of what could hide them, where asked for
    diagnosed : the model to predict from, where asked for
    """

    trial: Trial
    model: Model
    problem: DiagnosisProblem
    candidates: HypothesisComparison
    verdict: Verdict
    result: Result
    posterior: EffectPosterior | None = None
    diagnosed: DiagnosedModel | None = None

    def summary(self) -> str:
        """The result in a few lines."""
        return summary(self.result)


def diagnose(
    trial: Trial,
    model: Model,
    seed: int = 0,
    notify: Notify = lambda text: None,
    as_built: float | None = None,
    plan_next: bool = True,
    draw: bool = False,
    keep_model: bool = False,
    trust_noise: bool = False,
    first_look: bool = False,
) -> Diagnosis:
    """Diagnose the gap between a model and a trial.

    Parameters
    ----------
    as_built : relative sd of the coefficients from an earlier clean identification (as-built frame)
    notify : called with a sentence before each stage
    plan_next : also rank manoeuvres to run next
    draw : also sample the named effects' parameters by emcee; it confirms, the verdict stands before
    keep_model : also make the diagnosed model that `bayesid predict` draws from
    trust_noise : keep the noise as stated, whatever fast changes of the readings show
    first_look : as in `compare_without`

    A step after the verdict that fails becomes a sentence in `warnings`.

    Raises
    ------
    TrialError
        if there is nothing to identify from, or more memory is needed than there is
    """
    check_memory(trial, model)
    weighed = trial if trust_noise else with_seen_noise(trial, (model.scales["L"], model.scales["U"]))
    compared = compare_without(model, weighed, notify, as_built, seed, first_look)
    problem, candidates = compared.problem, compared.candidates
    verdict = verdict_of(compared)
    warnings = [*weighed.warnings, *problem.warnings, *not_asked(problem)]
    if compared.unable is not None:
        warnings.append(compared.unable)
    notify("whether the explanation predicts better with coefficients re-tuned")
    best, none = simplest(candidates), candidates.none
    explained = _explained(problem, best if best.log_evidence > none.log_evidence else none, warnings)
    alone = set(verdict.effects) == set(best.effects)  # of a part of what was left out this says nothing
    agree = agreement(best, len(problem.coefficients.names)) if alone else None
    verdict = after_left_out(verdict, explained.given_gain, explained.given_error, agree)
    # The verdict stands. What follows describes, proves and plans; none of it may cost the verdict.
    description = None
    if verdict.word in ("outside", "effect_with_remainder"):
        notify("what the missing force is made of")
        description = attempt(
            "the missing force could not be described",
            lambda: describe_missing_force(problem, candidates, verdict.word != "outside", seed),
            None,
            warnings,
        )
    notify("held-out runs: how far the gap shrinks")
    validation = _HoldoutModels(problem, trial, candidates, seed)
    holdout = attempt(
        "held-out runs could not be predicted",
        lambda: validation.with_explained(explained.fit),
        HoldoutValidation((), ()),
        warnings,
    )
    verdict = after_holdout(verdict, holdout.worse)
    judged = explained.fit
    if needs_none(verdict.word, verdict.rule, verdict.set95) and explained.effects:
        # a verdict that needs no effect is shown without one, though one may gain by chance
        explained = _explained(problem, none, warnings)
    caused = bool(explained.effects)
    explained = explained.predicting(verdict.word in NAMING)
    if caused and not explained.retuned:
        explained = explained.or_retuned(_explained(problem, none, warnings))
    if explained.fit is not judged:  # a name is judged by what it explains; what is told is what predicts
        holdout = attempt(
            "held-out runs could not be predicted with the model that is shown",
            lambda: validation.with_explained(explained.fit),
            holdout,
            warnings,
        )
    no_mistake: tuple[SimulatorMistakeFound, ...] = ()
    mistakes = attempt(
        "mistakes of the simulator could not be looked for",
        lambda: find_mistakes(weighed, compared, verdict, notify, as_built, seed),
        no_mistake,
        warnings,
    )
    proposals: tuple[Proposal, ...] | None = None
    if plan_next:
        unranked: tuple[Proposal, ...] = ()
        notify("which manoeuvre to run next")
        names = [n for n in verdict.set95 if n in candidates.bank.effects]
        proposals = attempt(
            "no next manoeuvre could be ranked",
            lambda: propose(problem, candidates.bank, names, 0.3)[:5],
            unranked,
            warnings,
        )
    posterior = _drawn(problem, candidates, verdict, seed, notify, warnings) if draw else None
    diagnosed = None
    if keep_model:
        notify("model for predictions")
        diagnosed = attempt(
            NO_MODEL,
            lambda: diagnosed_model(
                problem, candidates, verdict, trial.digest, explained.retuned, explained.refused is not None
            ),
            None,
            warnings,
        )
    events = attempt(
        "what the events look like could not be asked", lambda: described(compared), problem.events, warnings
    )
    result = result_of(
        trial,
        model,
        problem,
        candidates,
        verdict,
        explained,
        holdout,
        proposals,
        tuple(warnings),
        seed,
        description,
        posterior,
        mistakes,
    )
    told = None if nobody_needs(verdict.word, verdict.rule) else compared.dependence
    result = replace(result, events=events, dependence=told)
    return Diagnosis(trial, model, problem, candidates, verdict, result, posterior, diagnosed)


def _drawn(
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    verdict: Verdict,
    seed: int,
    notify: Notify,
    warnings: list[str],
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
        lambda: sample_effect(problem, fitted, seed, notify=notify),
        None,
        warnings,
    )
    if found is None:
        return None
    if (caution := warning(numbers(found))) is not None:
        warnings.append(caution)
    return found


def _explained(problem: DiagnosisProblem, refit: RefittedHypothesis, warnings: list[str]) -> ExplainedModel:
    """The model of a refitted hypothesis; re-tuned where that could not be asked."""
    return attempt(
        "whether the explanation predicts better with coefficients re-tuned could not be asked",
        lambda: explained_model(problem, refit),
        ExplainedModel(refit.effects, refit.fit),
        warnings,
    )


@dataclass(frozen=True, eq=False)
class _HoldoutModels:
    """What explanations are compared with on held-out runs: as given and re-tuned, also without process
    noise. Fitted and predicted once, whatever explanations are shown."""

    problem: DiagnosisProblem
    trial: Trial
    candidates: HypothesisComparison
    seed: int
    made: Made = field(default_factory=dict)

    @cached_property
    def beside(self) -> tuple[dict[str, Array], dict[str, Array], np.random.Generator]:
        """Parameters and posterior draws of each model, and the generator after those draws."""
        problem, retuned = self.problem, self.candidates.none.fit
        models = {"nominal": problem.model.nominal, "recalibrated": retuned.par}
        rng = np.random.default_rng(self.seed)
        draws = {"recalibrated": parameter_draws(retuned, rng)}
        if any(problem.environment.noise_model.force):
            calm = no_process_noise(problem.model)
            white = fit(problem.model, problem.logs, problem.coefficients, calm, iterations=12)
            models["recalibrated, white"] = white.par
            draws["recalibrated, white"] = parameter_draws(white, rng)
        return models, draws, rng

    def with_explained(self, explained: FilterErrorFit) -> HoldoutValidation:
        """All of them beside an explanation; empty without held-out runs."""
        if not self.trial.holdout:
            return HoldoutValidation((), ())
        models, draws, rng = self.beside
        if explained is self.candidates.none.fit:
            drawn = draws["recalibrated"]
        else:
            drawn = parameter_draws(explained, deepcopy(rng))
        return validate_holdout(
            self.problem,
            self.trial,
            {**models, EXPLAINED: explained.par},
            self.problem.environment.noise_model,
            self.seed,
            {**draws, EXPLAINED: drawn},
            self.made,
        )


def parameter_draws(fitted: FilterErrorFit, rng: np.random.Generator, count: int = HOLDOUT_DRAWS) -> Array:
    """(count, n_par) parameter vectors from the Gaussian posterior of a fit, cut at its bounds."""
    root = np.linalg.cholesky(fitted.posterior.covariance)
    z = (fitted.values - fitted.free.mean) / fitted.free.sd
    out = np.repeat(fitted.par[None], count, axis=0)
    values = fitted.free.mean + fitted.free.sd * (z + rng.standard_normal((count, z.size)) @ root.T)
    out[:, fitted.free.where] = np.clip(values, fitted.free.low, fitted.free.high)
    return out
