"""What an effect is worth along one path, what runs tell of two causes and what was stated before them, and
which of an effect and a wrong coefficient stands for the other."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.evidences import effect_first, shares_of_wide
from bayesid.diagnosis.hypotheses import candidate
from bayesid.diagnosis.hypotheses.candidate import nested, repeatable_evidence, weighted_hypothesis
from bayesid.diagnosis.hypotheses.cross_validation import log_odds_over_runs
from bayesid.diagnosis.hypotheses.probabilities import FormError
from bayesid.errors import ModelError
from bayesid.estimation.filter_error import linearise
from bayesid.estimation.filter_error.evidence import posterior

DRAG = ("hull_fouling.drag_increase", 0.5)
MULTIPLIED = ("remus100", "esso_osaka_mmg")  # their drag is one coefficient


@lru_cache
def refits(name, value, vehicle="generic_sub"):
    """Problem of a planted effect with coefficients 10 % uncertain, the refit with it and the one without."""
    model = model_of(vehicle, relative_sd=0.1)
    trial = planted_trial(model, other_vehicle(model, 2) | {name: value}, 2, samples=120)
    problem = build_problem(model, trial)
    effect = name.split(".")[0]
    found = weighted_hypothesis(problem, (effect,), fit_with(problem, (model.effects[effect],)))
    return problem, found, weighted_hypothesis(problem, (), fit_with(problem, ()))


def at_its_own_parameters(problem, found):
    """The same with both hypotheses linearised at the parameters of the larger."""
    k = len(problem.coefficients.names)
    total = sum(found.fit.equations[1:], found.fit.equations[0])
    return found.fit.log_evidence - posterior(total.pick(np.arange(k))).log_evidence


@pytest.mark.thorough
@pytest.mark.parametrize("vehicle", MULTIPLIED)
def test_a_drag_that_multiplies_a_coefficient_is_worth_along_its_path_what_the_fit_without_it_tells(vehicle):
    """Coefficients 10 % uncertain and half more drag: the coefficient goes five of its deviations instead."""
    problem, found, none = refits(*DRAG, vehicle)
    assert found.fit.converged and none.fit.converged
    apart = found.log_evidence - none.log_evidence
    assert apart > 5.0
    assert nested(problem, found) == pytest.approx(apart, abs=0.1)
    assert at_its_own_parameters(problem, found) < 0.7 * apart  # the control: why it is linearised anew


def test_what_no_coefficient_takes_is_worth_the_same_at_either_parameters():
    problem, found, _ = refits("rudder_offset.offset", 8e-4)
    assert nested(problem, found) > 15.0
    assert nested(problem, found) == pytest.approx(at_its_own_parameters(problem, found), abs=1.5)


def test_keeping_every_effect_is_worth_nothing():
    problem, found, _ = refits(*DRAG, MULTIPLIED[0])
    assert nested(problem, found, found.effects) == pytest.approx(0.0, abs=0.5)
    assert np.isfinite(repeatable_evidence(problem, found.fit, found.effects))


def test_paths_without_an_effect_keep_what_stays_inside_its_range(monkeypatch):
    """A latency of the position beside more drag: the runs would have readings come before they are taken."""
    model = model_of("remus100", relative_sd=0.1)
    trial = planted_trial(model, other_vehicle(model, 3) | {DRAG[0]: DRAG[1]}, 3, samples=120)
    problem, pair = build_problem(model, trial), ("hull_fouling", "position_latency")
    fitted = fit_with(problem, tuple(model.effects[n] for n in pair))
    found, where = weighted_hypothesis(problem, pair, fitted), model.index["position_latency.delay"]
    assert fitted.posterior.mean[-1] < 0.0  # the control: the optimum lies beyond the bound
    asked, whole = [], linearise.linearise

    def seen(model, log, point, *others):
        asked.append(point.par[where])
        return whole(model, log, point, *others)

    monkeypatch.setattr(linearise, "linearise", seen)
    assert nested(problem, found, pair[1:]) == pytest.approx(6.6, abs=0.2)
    assert asked and min(asked) >= 0.0


def test_where_a_path_cannot_be_had_evidence_and_equations_are_of_the_same_one(monkeypatch):
    _, found, _ = refits(*DRAG, MULTIPLIED[0])
    k, whole, calls = len(found.fit.free.names) - 1, posterior, []
    fewer = sum(found.fit.equations[1:], found.fit.equations[0]).pick(np.arange(k))

    def diverging(equations):
        calls.append(equations)
        if len(calls) == 2:
            raise ModelError("diverges")
        return whole(equations)

    monkeypatch.setattr(candidate, "posterior", diverging)
    equations, without = candidate._relinearised(found.fit, np.arange(k), fewer)
    assert len(calls) == 2 and without.log_evidence == whole(equations).log_evidence


def refit(evidence, *effects, explains=True):
    fit = SimpleNamespace(converged=explains, chi2=1.0)
    widens = bool(effects) and effects[0].startswith("coefficient_error")
    return SimpleNamespace(effects=effects, log_evidence=evidence, fit=fit, widens=widens)


def test_an_effect_goes_before_a_coefficient_that_is_less_probable_for_all_its_evidence():
    """One of 25 coefficients, half of the prior of a wrong one: 3.9 nats less probable before the data."""
    wide = [f"c{k}" for k in range(25)]
    share = shares_of_wide(wide)
    assert sum(share.values()) == pytest.approx(0.5)
    coefficient, behind = refit(14.4, "coefficient_error:c0"), -np.log(share["c0"])
    near, far = refit(14.4 - behind + 0.1, "drag"), refit(14.4 - behind - 0.1, "drag")
    assert effect_first([coefficient, near], wide, 3.0) == [near, coefficient]
    assert effect_first([coefficient, far], wide, 3.0) == [coefficient, far]
    lost = refit(14.0, "drag", explains=False)
    assert effect_first([coefficient, lost, near], wide, 3.0) == [near, coefficient, lost]
    assert effect_first([near, coefficient], wide, 3.0) == [near, coefficient]
    pair = refit(14.3, "drag", "lag")
    assert effect_first([coefficient, pair], wide, 3.0) == [coefficient, pair]
    assert effect_first([], wide, 3.0) == []
    # one that chance may make does not lead, whatever it is set against
    assert effect_first([coefficient, near], wide, near.log_evidence + 0.1) == [coefficient, near]


def test_what_was_stated_of_coefficients_tells_causes_apart_that_no_run_does():
    """Each run given the others is as probable under both; one asks for a coefficient far from what was
    stated: 10 nats that no weighing of runs changes."""
    one, other = ("decay",), ("drag",)
    alike = FormError(0.5, by_run={one: np.zeros(4), other: np.zeros(4)})
    assert alike.behind(10.0, one, other) == pytest.approx(alike.lag(10.0)) and alike.lag(10.0) > 9.0
    runs = np.array([4.0, -1.0, 2.0, -1.0])
    split = FormError(0.5, by_run={one: -runs, other: np.zeros(4)})
    assert split.behind(10.0, one, other) == pytest.approx(log_odds_over_runs(runs) + 6.0)
    assert split.behind(4.0, one, other) == pytest.approx(log_odds_over_runs(runs))
    # beside a large error of the equations neither counts for more than that leaves
    wide = FormError(100.0, by_run=alike.by_run)
    assert wide.behind(10.0, one, other) == wide.lag(10.0) < 0.2
