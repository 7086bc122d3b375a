"""Which explanations a prediction from a diagnosis draws, and how often."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest

from bayesid.diagnosis.diagnosed_model import _chosen, _left_out, _log_weights
from bayesid.diagnosis.hypotheses.probabilities import FormError
from bayesid.diagnosis.hypotheses.rules import OTHER_DEPENDENCE, UNLISTED_OVER_FORM


def refit(log_evidence, *effects):
    widens = bool(effects) and effects[0].startswith("coefficient_error")
    return Plain(
        effects=effects, log_evidence=log_evidence, fit=Plain(log_evidence=log_evidence), widens=widens
    )


NONE, LAG, WIND = refit(0.0), refit(900.0, "lag"), refit(880.0, "wind")


def comparison(leaves):
    sets = {("none",): 0.1, ("lag",): 0.5, ("wind",): 0.4}
    return Plain(none=NONE, refits=(LAG, WIND), error=FormError(leaves), sets=sets)


def test_a_model_form_is_predicted_by_what_its_answer_shows():
    """Effects gain 900 nats beside it, and what the form leaves may be worth as much: none is drawn."""

    def chosen(word, effects=(), rule="", set95=("lag",)):
        return _chosen(comparison(2000.0), Plain(word=word, effects=effects, rule=rule, set95=set95))

    assert chosen("model_form") == [NONE]
    assert chosen("ambiguous", ("lag",)) == [NONE, LAG, WIND]
    assert chosen("effect", ("wind",)) == [WIND]
    # a force with the place that explains more is predicted by what its answer shows, too
    assert chosen("outside", rule=OTHER_DEPENDENCE, set95=("outside",)) == [NONE]
    assert chosen("outside", rule=OTHER_DEPENDENCE, set95=("outside", "lag")) == [NONE, LAG, WIND]
    assert chosen("outside", rule=UNLISTED_OVER_FORM, set95=("outside", "lag")) == [NONE]
    assert chosen("outside", rule="unlisted cause", set95=("outside",)) == [NONE, LAG, WIND]


@pytest.mark.parametrize("leaves, odds", [(60.0, 0.5 / 0.4), (0.0, np.exp(20.0))])
def test_draws_are_as_sure_of_the_cause_as_the_verdict(leaves, odds):
    """Beside a form 20 nats are worth what the verdict made of them; where the equations hold, 20 nats."""
    lag, wind = _log_weights(comparison(leaves), [LAG, WIND], [900.0, 880.0], 0.01, ("N_v", "N_r"))
    assert np.exp(lag - wind) == pytest.approx(odds)


def test_beside_a_form_refits_of_one_name_share_its_probability():
    found = comparison(60.0)
    found.sets = {("none",): 0.1, ("lag", "wind"): 0.3, ("coefficient_error",): 0.6}
    pair = refit(900.0, "wind", "lag")
    wide = [refit(700.0, "coefficient_error:N_v"), refit(702.0, "coefficient_error:N_r")]
    weights = np.exp(
        _log_weights(found, [NONE, pair, *wide], [0.0, 900.0, 700.0, 702.0], 0.01, ("N_v", "N_r"))
    )
    assert weights[:2] == pytest.approx([0.1, 0.3])
    assert weights[2:].sum() == pytest.approx(0.6)
    assert weights[3] / weights[2] == pytest.approx(np.exp(2.0))
    found.sets = {("outside",): 1.0}  # nothing of what can be drawn has any: evidence is left
    assert np.all(np.isfinite(_log_weights(found, [NONE, pair], [0.0, 900.0], 0.01, ("N_v", "N_r"))))


def test_one_coefficient_of_many_that_gains_by_chance_is_seldom_drawn_where_nothing_is_needed():
    """Of 36 coefficients the one that gains most gains 4.4 nats: it was drawn 60 times in 100 beside a
    verdict that gave wrong coefficients 0.02."""
    found = Plain(error=FormError(0.0), sets={})
    gains = [0.0, 4.4, 4.4]
    names = [f"c{k}" for k in range(35)] + ["X_vv"]
    row, every = (refit(4.4, f"coefficient_error:{n}") for n in ("X_vv", "every coefficient x3"))
    none, row, every, lag = _log_weights(found, [NONE, row, every, LAG], [*gains, 4.4], 0.01, names)
    assert np.exp(every - none) == pytest.approx(np.exp(4.4) * 0.01 * 0.25 / 0.5)  # one of two widths of all
    assert np.exp(row - none) == pytest.approx(np.exp(4.4) * 0.01 * 0.5 / 36 / 0.5)
    assert np.exp(lag - none) == pytest.approx(np.exp(4.4) * 0.01 / 0.5)  # an effect pays for itself alone


def test_what_no_draw_has_keeps_the_probability_the_verdict_gave_it():
    """Of lag 0.5, wind 0.3, outside 0.15, lag with wind 0.04 and one wrong coefficient 0.01."""
    found = comparison(0.0)
    found.sets = {
        ("outside",): 0.15, ("lag",): 0.5, ("lag", "wind"): 0.04, ("wind",): 0.3,
        ("coefficient_error",): 0.01, ("drag",): 1e-6,
    }  # fmt: skip
    left = _left_out(found, [LAG, refit(1.0, "coefficient_error:N_r")])
    assert list(left.items()) == [(("wind",), 0.3), (("outside",), 0.15), (("lag", "wind"), 0.04)]
    assert _left_out(found, [LAG, WIND, refit(9.0, "wind", "lag")]) == {
        ("outside",): 0.15, ("coefficient_error",): 0.01,
    }  # fmt: skip
