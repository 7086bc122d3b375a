"""The hypotheses once more in the environment that the best of them leaves, where no straight run tells it.

Takes `Compared`. Gives `Compared`. Does not decide.

Without a straight run the environment is estimated from the manoeuvres under the vehicle as given, and a gap
passes for process noise: it came out up to ten times too loud. Here it has the most marginal likelihood
beside the best explanation, coefficients, effects and form integrated out. Each hypothesis with an
environment of its own would lag by up to 30 % less; the order stayed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.form_stage import Compared, compared
from bayesid.diagnosis.hypotheses.candidate import explains
from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.noise_identification import noise_beside

Notify = Callable[[str], None]


def in_its_environment(found: Compared, notify: Notify, seed: int) -> Compared:
    """The same hypotheses where the best of them asks for another environment by more than refits scatter."""
    problem, best = found.problem, simplest(found.candidates)
    if problem.environment.source != "assumed" or not explains(best):
        return found
    notify("the environment beside the best explanation")
    try:
        noise_model, gain = noise_beside(best.fit, problem.environment.noise_model)
        if gain < LINEARISATION_SCATTER:
            return found
        c = found.candidates
        ended = [r.fit for r in (c.none, *c.refits, *found.formless) if explains(r) and not r.widens]
        again = compared(problem.with_environment(noise_model, ended), notify, seed, earlier=best)
    except (BayesidError, np.linalg.LinAlgError) as error:
        unable = f"the hypotheses could not be compared in the environment beside the best ({error})"
        return replace(found, unable="; ".join(filter(None, (found.unable, unable))))
    after = simplest(again.candidates)
    # what ends lower in the environment that suits it has not arrived
    return again if explains(after) and after.log_evidence > best.log_evidence else found
