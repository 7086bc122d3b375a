"""Hypotheses as rows of prior and likelihood: one sum over all of them, and numbers that may not move."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from bayesid.diagnosis.hypotheses.probabilities import (
    Remainder,
    comparable,
    credible_set,
    of_causes,
    probabilities,
    rows,
    several_act,
    weights,
)
from bayesid.diagnosis.threshold_table import (
    OTHER_FORM_PROBABILITY,
    PRIOR_CATALOGUE,
    PRIOR_NONE,
    PRIOR_OUTSIDE,
    UNLISTED_ALIKE_SHARE,
)

WORLDS = json.loads((Path(__file__).parent / "data" / "weights.json").read_text())


def fitted(effects, log_evidence, chi2=1.0, converged=True):
    fit = SimpleNamespace(chi2=chi2, converged=converged)
    return SimpleNamespace(effects=tuple(effects), log_evidence=log_evidence, fit=fit)


def world(w):
    """Arguments of `probabilities` from plain data."""
    told = w["left"]
    rest = {tuple(k.split(",")): v for k, v in told["rest"].items()}
    left = Remainder(rest, told["shows"], told["share"], told["kept"])
    where = SimpleNamespace(base=w["base"])
    places = {n: tuple(p) for n, p in w["places"].items()}
    refits = [fitted(**r) for r in w["refits"]]
    return w["evidence"], refits, fitted((), 0.0), where, w["excess"], left, places


@pytest.mark.parametrize("w", WORLDS, ids=range(len(WORLDS)))
def test_the_weights_of_sixty_worlds_have_not_moved(w):
    """Drawn at random; numbers of the weighing that the practice and blind campaigns were scored with."""
    found = probabilities(*world(w))
    for name, value in w["shared"].items():
        assert found.shared[name] == pytest.approx(value, abs=1e-9), name
        assert found.inside[name] == pytest.approx(w["inside"][name], abs=1e-9), name
    assert sum(found.shared.values()) == pytest.approx(1.0)


def test_rows_are_every_hypothesis_once_and_the_weights_their_sum():
    evidence, refits, none, where, excess, left, places = world(WORLDS[0])
    gains = comparable(evidence, refits, none, where, excess, left)
    table = rows(gains, evidence, left, places)
    total = logsumexp([r.log_prior + r.log_likelihood for r in table])
    alone = [r.log_prior + r.log_likelihood - total for r in table if r.acts == ("none",)]
    found = weights(table, gains, evidence)
    assert found.inside["none"] == pytest.approx(np.exp(logsumexp(alone)))
    assert {r.acts for r in table} >= {("none",), ("outside",), *((n,) for n in evidence if n != "outside")}


def test_one_faint_effect_splits_its_prior_as_stated():
    """Nothing gains: what is left is the priors, with half of what lies outside like no effect."""
    evidence = {"a": 0.0, "outside": 0.0}
    gains = comparable(evidence, [], fitted((), 0.0), SimpleNamespace(base=0.0), 1.0, Remainder())
    table = rows(gains, evidence, Remainder(), {})
    priors = {r.reading: np.exp(r.log_prior) for r in table}
    assert priors["nothing"] == pytest.approx(PRIOR_NONE)
    assert priors["as the catalogue has it"] == pytest.approx(PRIOR_CATALOGUE)
    assert priors["like no effect"] == pytest.approx((1 - UNLISTED_ALIKE_SHARE) * PRIOR_OUTSIDE)
    assert priors["something like a"] == pytest.approx(UNLISTED_ALIKE_SHARE * PRIOR_OUTSIDE)
    assert sum(priors.values()) == pytest.approx(1.0) and 0 < OTHER_FORM_PROBABILITY < 1
    assert all(r.log_likelihood == 0.0 for r in table)


def test_what_a_shape_of_a_form_has_in_company_is_its_causes():
    sets = {("a",): 0.5, ("b",): 0.2, ("a", "form"): 0.2, ("b", "c", "form"): 0.06, ("form",): 0.04}
    shared = {"a": 0.6, "b": 0.22, "c": 0.02, "form": 0.16}
    found = of_causes(shared, sets, ("form",))
    assert found == pytest.approx({"a": 0.7, "b": 0.23, "c": 0.03, "form": 0.04})
    assert sum(found.values()) == pytest.approx(1.0)
    assert of_causes(shared, sets, ()) == shared
    # shares by evidence may leave a shape less than its equal part: no mass is made
    less = of_causes({"a": 0.99, "form": 0.01}, {("a", "form"): 1.0}, ("form",))
    assert less == pytest.approx({"a": 1.0, "form": 0.0})


def test_several_act_where_two_causes_do_and_a_shape_of_a_form_is_none():
    sets = {
        ("none",): 0.1,
        ("a",): 0.3,
        ("a", "form"): 0.2,
        ("a", "b"): 0.15,
        ("a", "b", "form"): 0.05,
        ("outside",): 0.2,
    }
    assert several_act(sets, ("form",)) == pytest.approx(0.2)
    assert several_act(sets, ()) == pytest.approx(0.4)
    assert several_act({("a", "b", "c"): 0.4, ("a",): 0.6}, ()) == pytest.approx(0.4)  # a triple counts once


def test_the_credible_set_is_the_smallest_that_holds_the_mass():
    p = {"none": 0.5, "a": 0.25, "b": 0.125, "c": 0.125}
    assert credible_set(p, 0.75) == ("none", "a")
    assert credible_set(p, 0.76) == ("none", "a", "b")
    assert credible_set(p, 0.5) == ("none",)
    assert credible_set({"a": 0.6, "b": 0.4}, silent=("b",)) == ("a", "none")
    assert credible_set({"a": 0.951, "b": 0.049}) == ("a",)
    assert credible_set({"a": 0.949, "b": 0.051}) == ("a", "b")
