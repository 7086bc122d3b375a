"""The hypotheses once more in the environment that the best of them leaves, unless it was stated.

Takes `Compared`. Gives `Compared`. Does not decide.

Without a straight run the environment is estimated from the manoeuvres under the vehicle as given, and a gap
passes for process noise: it came out up to ten times too large. Here it has the most marginal likelihood
beside the best explanation, coefficients, effects and form integrated out. Each hypothesis with an
environment of its own would lag by up to 30 % less; the order stayed, but between coefficients further off
than stated and a cause: a noise made by the gap suits the former, which bend towards anything. A rudder late
by 0.13 s, 105 nats behind every coefficient ten times further off, was 221 nats ahead in a noise of its own.

Straight runs tell a sea from a drift of the positions badly where no speed is logged, and hardly any moment:
of 223 sealed campaigns in a sea 33 took an axis for more than three times too large. Where manoeuvres
contradict a measured force (it is below 95 % of what was held possible), it is made quieter, never louder:
what manoeuvres have beyond the sea of straight runs is a gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.form_stage import Compared, compared
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.noise_identification import NoiseIdentification, noise_beside
from bayesid.estimation.filter_error.noise_model import NoiseModel

Notify = Callable[[str], None]


def in_its_environment(found: Compared, notify: Notify, seed: int) -> Compared:
    """The same hypotheses where the best of them asks for another environment by more than refits scatter.

    The best is that of most evidence in an environment of its own, of the best explanation and, where that is
    a wider prior or did not arrive, the best cause that did.
    """
    problem = found.problem
    if problem.environment.source == "stated":
        return found
    # what manoeuvres have beyond a sea that straight runs tell is a gap
    louder = problem.environment.source == "assumed"
    leading = _leading(found.candidates)
    if not leading:
        return found
    notify("the environment beside the best explanation")
    try:
        asked = _asked(leading, problem.environment.noise_model, louder)
        noise_model, gain, best = max(asked, key=lambda a: a[1] + a[2].log_evidence)
        if gain < LINEARISATION_SCATTER or not (louder or _contradicted(problem.environment, noise_model)):
            return found
        c = found.candidates
        ended = [r.fit for r in (c.none, *c.refits, *found.formless) if explains(r) and not r.widens]
        again = compared(problem.with_environment(noise_model, ended), notify, seed, earlier=best)
    except (BayesidError, np.linalg.LinAlgError) as error:
        unable = f"the hypotheses could not be compared in the environment beside the best ({error})"
        return replace(found, unable="; ".join(filter(None, (found.unable, unable))))
    after = simplest(again.candidates)
    # what ends lower in the environment that suits it has not arrived
    least = max(one.log_evidence for one in leading)
    return again if explains(after) and after.log_evidence > least else found


def _asked(
    leading: Sequence[RefittedHypothesis], before: NoiseModel, louder: bool
) -> list[tuple[NoiseModel, float, RefittedHypothesis]]:
    """Environment beside each explanation and what it gains; one that tells none does not silence the other.

    Raises
    ------
    BayesidError, LinAlgError
        where none tells any
    """
    asked, failed = [], None
    for one in leading:
        try:
            asked.append((*noise_beside(one.fit, before, louder=louder), one))
        except (BayesidError, np.linalg.LinAlgError) as error:
            failed = error
    if failed is not None and not asked:
        raise failed
    return asked


def _contradicted(measured: NoiseIdentification, beside: NoiseModel) -> bool:
    """Whether some force is smaller than 95 % of what a measurement holds possible."""
    before, after = np.array(measured.noise_model.force), np.array(beside.force)
    return bool((after < before * np.exp(-TWO_SIDED_95 * measured.spread)).any())


def _leading(candidates: HypothesisComparison) -> list[RefittedHypothesis]:
    """The best explanation, and the best cause where that is a wider prior or did not arrive."""
    best = simplest(candidates)
    out = [best] if explains(best) else []
    if best.widens or not out:
        causes = [c for c in candidates.refits if explains(c) and c.effects and not c.widens]
        out += sorted(causes, key=lambda c: -c.log_evidence)[:1]
    return out
