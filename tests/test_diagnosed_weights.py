"""Which explanations a prediction from a diagnosis draws, and how often."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest

from bayesid.diagnosis.diagnosed_model import _chosen, _log_weight
from bayesid.diagnosis.hypotheses.probabilities import FormError


def refit(log_evidence, *effects):
    return Plain(effects=effects, log_evidence=log_evidence, fit=Plain(log_evidence=log_evidence))


NONE, LAG, WIND = refit(0.0), refit(900.0, "lag"), refit(880.0, "wind")


def comparison(leaves):
    sets = {("none",): 0.1, ("lag",): 0.5, ("wind",): 0.4}
    return Plain(none=NONE, refits=(LAG, WIND), error=FormError(leaves), sets=sets)


def test_a_model_form_is_predicted_by_what_its_answer_shows():
    """Effects gain 900 nats beside it, and what the form leaves may be worth as much: none is drawn."""
    assert _chosen(comparison(2000.0), Plain(word="model_form", effects=())) == [NONE]
    assert _chosen(comparison(2000.0), Plain(word="ambiguous", effects=("lag",))) == [NONE, LAG, WIND]
    assert _chosen(comparison(2000.0), Plain(word="effect", effects=("wind",))) == [WIND]


@pytest.mark.parametrize("leaves, odds", [(60.0, 0.5 / 0.4), (0.0, np.exp(20.0))])
def test_draws_are_as_sure_of_the_cause_as_the_verdict(leaves, odds):
    """Beside a form 20 nats are worth what the verdict made of them; where the equations hold, 20 nats."""
    found = comparison(leaves)
    lag, wind = (_log_weight(found, c, c.log_evidence, 0.01) for c in (LAG, WIND))
    assert np.exp(lag - wind) == pytest.approx(odds)
    if leaves:
        assert _log_weight(found, refit(5000.0, "stall"), 5000.0, 0.01) == -np.inf
