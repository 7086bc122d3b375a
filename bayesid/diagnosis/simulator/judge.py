"""Which mistake of the simulator closes the gap: a linear screen, then the mended simulator judged anew.

Takes a trial, the hypotheses of its gap and the verdict. Gives what was found, best first. A mistake is named
only if its mend, alone or beside the effects of the best explanation, beats every other explanation,
environments measured anew, has no coefficient further from its value than that explanation has one, and
leaves nothing that asks for a cause, or effects that are then named. One that beats every cause, and
coefficients further off than stated by less, is listed as either. Does not change the verdict or touch the
search of causes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp, softmax

from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, fit_with
from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains, pulls, weighted_hypothesis
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.sensitivity_bank import build_bank, levels_between
from bayesid.diagnosis.hypotheses.verdict import Verdict
from bayesid.diagnosis.result_parts import SimulatorMistakeFound
from bayesid.diagnosis.simulator.mending import beside, mended_model, mended_prior, numbers_of
from bayesid.diagnosis.simulator.table import MISTAKES, Change, SimulatorMistake
from bayesid.diagnosis.threshold_table import MINOR_SHARE, PRIOR_CONFLICT
from bayesid.equations.model import Model
from bayesid.errors import BayesidError, ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.noise_identification import noise_beside
from bayesid.estimation.parameters import NO_PARAMETERS, GaussianPrior, effect_prior
from bayesid.estimation.run_data import Array
from bayesid.trials import Trial

Notify = Callable[[str], None]
# Mistakes judged anew after the screen, and how far one may lie behind no mistake, and behind the best
# explanation without one [nats]: an environment measured with the wrong simulator hides what a mend is worth
# (Munk moment left out of REMUS at 2.5 Hz: 2 nats of the screen, 242 with the environment measured anew), the
# more so the larger the gap (all coefficients halved: 212 of the screen, 308 of the best cause, 920 anew).
TRIED, LEAST_GAIN, MOST_BEHIND, SHARE_BEHIND = 3, 0.0, 30.0, 0.5
# A change that the log does not feel at all.
UNFELT = 1e-6
# Lead [nats] over every other explanation from which on a mistake is named.
LEAD = 10.0
# Log evidence by which alike mistakes may lie behind the best and still be listed, and lead over coefficients
# of a wider prior from which on it is either: these hold every mistake of the rows, at a price.
ALIKE = 3.0
MOST_LISTED = 3


@dataclass(frozen=True, eq=False)
class Screened:
    """A mistake at its best size: gain of the linear screen, what its other sizes take from it [nats], and,
    once it was judged anew, the rows it leaves free as the log has them, and the conflict of `Mended`."""

    mistake: SimulatorMistake
    size: float
    change: Change
    gain: float
    share: float
    fitted: Mapping[str, float] = field(default_factory=dict)
    conflict: float = 0.0


@dataclass(frozen=True)
class Mended:
    """Log evidence of a mended simulator, what the log makes of the rows the mend leaves free [SI], and how
    far a coefficient it does not leave free then lies from its value, at most [prior sd]."""

    log_evidence: float
    fitted: Mapping[str, float]
    conflict: float = 0.0


@dataclass(frozen=True)
class Left:
    """What the best explanation of a mended simulator's gap gains [nats], and the effects it names."""

    gain: float = 0.0
    effects: tuple[str, ...] = ()


def find_mistakes(
    trial: Trial,
    compared: Compared,
    verdict: Verdict,
    notify: Notify = lambda text: None,
    as_built: float | None = None,
    seed: int = 0,
) -> tuple[SimulatorMistakeFound, ...]:
    """Mistakes whose mend closes the gap, best first; none where there is no gap.

    Parameters
    ----------
    trial : as it was compared
    as_built : as for the comparison
    """
    problem, comparison = compared.problem, compared.candidates
    if verdict.word == "none":
        return ()
    explanation = max([comparison.none, *comparison.refits], key=lambda c: c.log_evidence)
    best = explanation.log_evidence
    # an effect may go before a coefficient of more evidence (`effect_first`), or a push to one side
    leading = explanation if explanation is comparison.none else comparison.refits[0]
    beside = () if leading.widens else leading.effects
    cause = max(_causes(comparison), key=lambda c: c.log_evidence).log_evidence
    found = []
    for s in _worth(compared):
        notify(f"the simulator mended: {s.mistake.name}")
        mended = mended_evidence(problem, trial, s, as_built, beside)
        if mended is not None and mended.log_evidence > max(cause + LEAD, best + ALIKE):
            found.append((mended.log_evidence, replace(s, fitted=mended.fitted, conflict=mended.conflict)))
    found.sort(key=lambda row: -row[0])

    def astray(s: Screened) -> bool:
        """Whether a coefficient lies further off than without the mend: a right one takes it to its value."""
        if s.conflict <= PRIOR_CONFLICT or not explains(explanation):
            return False  # where nothing follows the log, where coefficients should be is not known
        return s.conflict > max(comparison.thresholds.conflict, conflict(problem, explanation))

    # none where the best is not it: what lies behind it would be named for want of the right one
    if not found or astray(found[0][1]):
        return ()
    found = [row for row in found if not astray(row[1])]
    notify("whether the mended simulator leaves a gap")

    def cleared(evidence: float, s: Screened) -> tuple[str, ...] | None:
        """Effects that the mended simulator needs beside it; None where it leaves a gap even so."""
        left = left_over(mended_model(problem.model, s.change.about(s.fitted)), trial, as_built, seed)
        if left is None:
            return None
        if left.gain <= max(comparison.thresholds.named, MINOR_SHARE * (evidence - best)):
            return ()
        return left.effects or None

    # nor where the best leaves a gap
    if (needed := cleared(*found[0])) is None:
        return ()
    alike = [row for row in found[1:] if row[0] > found[0][0] - ALIKE][: MOST_LISTED - 1]
    listed = [found[0], *(row for row in alike if _same(cleared(*row), needed))]
    shares = softmax([evidence for evidence, _ in listed])
    return tuple(
        _finding(problem.model, s, float(p), evidence - comparison.none.log_evidence, evidence - best, needed)
        for (evidence, s), p in zip(listed, shares, strict=True)
    )


def _same(one: tuple[str, ...] | None, other: tuple[str, ...]) -> bool:
    return one is not None and set(one) == set(other)


def _worth(compared: Compared) -> list[Screened]:
    """Mistakes to be judged anew: those not far behind the best cause. A wider prior is no cause: it holds
    every mistake of the rows, and a screen that is linear about it stays behind it."""
    none = compared.candidates.none
    gain = max(c.log_evidence for c in _causes(compared.candidates)) - none.log_evidence
    behind = max(MOST_BEHIND, SHARE_BEHIND * gain)
    least = LEAST_GAIN if compared.problem.form is not None else max(LEAST_GAIN, gain - behind)
    alone = [s for s in screened(compared) if s.gain + s.share > least]
    leading = compared.candidates.best
    if not leading.effects or leading.widens or not explains(leading) or explains(none):
        return alone[:TRIED]
    # beside a large effect a mistake is small: without it, others gain that stand for the effect
    known = {s.mistake.name for s in alone[:TRIED]}
    beside = [s for s in screened(compared, leading) if s.gain + s.share > LEAST_GAIN]
    return [*alone[:TRIED], *(s for s in beside[:TRIED] if s.mistake.name not in known)]


def _causes(comparison: HypothesisComparison) -> list[RefittedHypothesis]:
    """Explanations that are no wider prior; none among them."""
    return [comparison.none, *(c for c in comparison.refits if not c.widens)]


def screened(compared: Compared, leading: RefittedHypothesis | None = None) -> list[Screened]:
    """Every mistake the file can hold and the log can weigh, best first, beside the coefficients within their
    prior, and the effects of an explanation where one is given."""
    problem = compared.problem
    numbers = numbers_of(problem.model)
    index = problem.model.index
    tried = [
        (m, size, change.within(index))
        for m in MISTAKES
        for size in m.sizes
        if (change := m.mend(numbers, size)) is not None and change.within(index).values
    ]
    if not tried:
        return []
    stated = problem.stated
    extra = beside(problem.model, stated, [change for *_, change in tried])
    acting = NO_PARAMETERS
    for name in () if leading is None else leading.effects:
        acting = acting + effect_prior(problem.model, problem.model.effects[name])
    totals = _equations(compared, extra + acting, leading)
    k = len(stated.names)
    free = stated + extra + acting
    without = np.r_[:k, k + len(extra.names) : len(free.names)]
    none = max(posterior(t.pick(without)).log_evidence for t in totals)
    gains: dict[str, list[tuple[float, float, Change]]] = {}
    for mistake, size, change in tried:
        mean, sd = mended_prior(stated, extra, change)
        mean, sd = np.r_[mean, acting.mean], np.r_[sd, acting.sd]
        delta, scale = (mean - free.mean) / free.sd, sd / free.sd
        best = max(_log_evidence(shifted(total, delta, scale)) for total in totals) - none
        if abs(best) < UNFELT:
            continue
        gains.setdefault(mistake.name, []).append((best, size, change))
    out = []
    for mistake in MISTAKES:
        if rows := gains.get(mistake.name):
            top = max(rows, key=lambda row: row[0])
            if not np.isfinite(top[0]):
                continue  # no size of it can be weighed: so far off that rounding takes all evidence
            every = float(logsumexp([row[0] for row in rows])) - float(np.log(len(rows)))
            out.append(Screened(mistake, top[1], top[2], top[0], every - top[0]))
    return sorted(out, key=lambda s: -(s.gain + s.share))


def _equations(
    compared: Compared, extra: GaussianPrior, leading: RefittedHypothesis | None
) -> list[NormalEquations]:
    """Equations of the stated coefficients, within the prior of the file, and of what is beside them.

    They are linear about the refit within the prior, and about those with a wider one: a simulator that is
    wrong by a factor of two in every row is no small step from the right one, a refit that may go there is.
    """
    problem, candidates = compared.problem, compared.candidates
    plain = replace(problem, coefficients=problem.stated, form=None, vehicle=None)
    about = [c.fit.points for c in (candidates.none, *candidates.refits) if explains(c)
             and (c.widens or c is candidates.none)]  # fmt: skip
    if leading is not None:
        about = [leading.fit.points]
    starts = [(list(points), levels_between(problem, 0.0)) for points in about]
    if leading is None and not explains(candidates.none):
        starts.insert(0, (list(problem.path), levels_between(problem, problem.path_level)))
    out = []
    for points, levels in starts:
        bank = build_bank(plain, points, levels, (), extra if extra.names else None)
        out += [bank.total(i) for i in range(len(levels))]
    return out


def shifted(g: NormalEquations, delta: Array, scale: Array) -> NormalEquations:
    """Equations in y with z = delta + scale y: another mean and deviation of the prior."""
    along = g.ss @ delta
    return NormalEquations(
        g.ss * np.outer(scale, scale),
        (g.se - along) * scale,
        g.ee - 2.0 * float(g.se @ delta) + float(delta @ along),
        g.logdet,
        g.used,
    )


def _log_evidence(g: NormalEquations) -> float:
    try:
        return posterior(g).log_evidence
    except ModelError:
        return -np.inf


def mended_evidence(
    asked: DiagnosisProblem, trial: Trial, s: Screened, as_built: float | None, beside: tuple[str, ...] = ()
) -> Mended | None:
    """The mended simulator, its environment measured anew; None where it does not follow the log.

    Parameters
    ----------
    asked : the problem of the explanations it is compared with: what they leave out is left out
    beside : effects it is tried with as well as without any: a mistake and a cause may come together
    """

    def problem_of(change: Change) -> DiagnosisProblem:
        mended = mended_model(asked.model, change)
        return build_problem(
            mended,
            trial,
            as_built=as_built,
            events=asked.events,
            outlying=asked.outliers,
            seek_outliers=False,
        )

    try:
        problem = problem_of(s.change)
        found = _best_of(problem, beside)
        if found is None:
            return None
        fitted = _free_rows(found, s)
        if fitted:
            # an environment measured where the free rows are not yet found is the wrong simulator's
            about = replace(problem, environment=problem_of(s.change.about(fitted)).environment)
            again = _best_of(about, beside)
            if again is not None and again.log_evidence > found.log_evidence:
                problem, found, fitted = about, again, _free_rows(again, s)
        if asked.environment.again and (asked.environment.source == "measured" or found.effects):
            # where the explanations are weighed in a sea quieter than straight runs told, so is the mend; one
            # assumed was found without the effects that act
            again = _best_of(_quieter(problem, found), beside)
            if again is not None and again.log_evidence > found.log_evidence:
                found, fitted = again, _free_rows(again, s)
    except BayesidError:
        return None
    return Mended(found.log_evidence + s.share, fitted, conflict(problem, found, s.change.sd))


def conflict(problem: DiagnosisProblem, found: RefittedHypothesis, free: Collection[str] = ()) -> float:
    """Largest move of a coefficient from its value in the simulator, in deviations of the prior it was found
    with; free ones left out."""
    names = problem.stated.names
    moves = np.abs(pulls(found.fit, problem))
    return max((float(z) for n, z in zip(names, moves, strict=True) if n not in free), default=0.0)


def _quieter(problem: DiagnosisProblem, found: RefittedHypothesis) -> DiagnosisProblem:
    """The problem in the environment beside a refit, no force louder."""
    measured = problem.environment
    noise_model, _ = noise_beside(found.fit, measured.noise_model, louder=False)
    return replace(problem, environment=replace(measured, noise_model=noise_model, again=True))


def _best_of(problem: DiagnosisProblem, beside: tuple[str, ...]) -> RefittedHypothesis | None:
    """The better of no effect and these effects; None where neither follows the log."""
    found = []
    for names in dict.fromkeys(((), beside)):
        effects = tuple(problem.model.effects[n] for n in names)
        with suppress(ModelError):  # one that cannot be followed says nothing of the other
            found.append(weighted_hypothesis(problem, names, fit_with(problem, effects)))
    return max((c for c in found if explains(c)), key=lambda c: c.log_evidence, default=None)


def _free_rows(found: RefittedHypothesis, s: Screened) -> dict[str, float]:
    values = dict(zip(found.fit.free.names, found.fit.values, strict=True))
    return {n: float(values[n]) for n in s.change.sd if n in values}


def left_over(model: Model, trial: Trial, as_built: float | None, seed: int) -> Left | None:
    """What the mended simulator leaves; None where something is missing that no effect explains, or
    coefficients leave their prior."""
    try:
        again = compare_without(model, trial, as_built=as_built, seed=seed)
    except BayesidError:
        return None
    c = again.candidates
    verdict = verdict_of(again)
    if verdict.word == "none":
        return Left()
    if verdict.word in ("outside", "coefficients", "model_form"):
        return None
    named = verdict.effects if verdict.word in ("effect", "several") else ()
    return Left(c.best.log_evidence - c.none.log_evidence, named)


def _finding(
    model: Model, s: Screened, share: float, gain: float, lead: float, beside: tuple[str, ...]
) -> SimulatorMistakeFound:
    # a mend may only say which rows are free: then the numbers are those the log gives them
    told = {**s.change.values, **s.fitted}
    changed = {n: v for n, v in told.items() if v != model.nominal[model.index[n]]}
    return SimulatorMistakeFound(
        s.mistake.name,
        s.mistake.says.format(size=s.size),
        share,
        gain,
        lead,
        s.size,
        {n: float(v) / model.file_scale(n) for n, v in changed.items()},
        {n: float(model.nominal[model.index[n]]) / model.file_scale(n) for n in changed},
        beside,
        or_coefficients=lead <= LEAD,
    )
