"""A search finished in a trust region ends where SLSQP does where that arrives, and never higher."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.estimation.output_error import FitOptions, fit
from bayesid.estimation.output_error.curvature import predicted_gain
from bayesid.estimation.output_error.trust_region import LOOK, finish
from bayesid.model.params import ParameterSet
from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, setting


@pytest.fixture(scope="module")
def problem():
    s, rng = setting(angles=(10.0, 20.0)), np.random.default_rng(5)
    return problem_of(s, campaign(s, Condition(), drawn_truth(s, rng), rng))


def test_it_ends_in_the_minimum_that_slsqp_finds(problem):
    by_slsqp = fit(problem, FitOptions(profile=False))
    told = []
    z, cost = finish(problem, problem.start, 1e-3, 200, lambda z, cost, step: told.append(cost))
    assert by_slsqp.converged and cost == pytest.approx(by_slsqp.cost, abs=2e-3)
    assert predicted_gain(problem, z)[0] < 1e-3
    assert told == sorted(told, reverse=True) and told[-1] == pytest.approx(cost)


def test_it_stays_within_bounds(problem):
    free = problem.params["N_r"]
    bounded = replace(
        free, low=free.start - 0.01 * free.scale, high=free.start + 0.01 * free.scale, prior=None
    )
    entries = tuple(bounded if p.name == "N_r" else p for p in problem.params.entries)
    narrow = problem.with_params(ParameterSet(entries))
    z, cost = finish(narrow, narrow.start, 1e-3, 100, lambda *told: None)
    assert np.all(z >= narrow.low) and np.all(z <= narrow.high)
    at = narrow.params.names.index("N_r")
    assert min(z[at] - bounded.low, bounded.high - z[at]) < 1e-4 * free.scale  # it ends on one
    assert narrow.cost(narrow.start) > cost == narrow.cost(z)


def test_in_the_minimum_it_takes_few_evaluations_and_moves_nothing(problem):
    found = fit(problem, FitOptions(profile=False, gain=1e-6, relative_gain=0.0))
    count = [0]

    class Counted(type(problem)):
        def compressed(self, z):
            count[0] += 1
            return super().compressed(z)

    fields = {f: getattr(problem, f) for f in ("model", "params", "runs", "base", "threads", "adjoint")}
    _, cost = finish(Counted(**fields), found.z, 1e-3, 200, lambda *told: None)
    assert cost == pytest.approx(found.cost, abs=1e-5) and count[0] <= LOOK + 2


def test_a_search_that_has_not_converged_after_its_rounds_is_finished_and_says_so(problem):
    short = FitOptions(profile=False, rounds=1, iterations=2)
    cut, finished = fit(problem, short), fit(problem, replace(short, rounds=2, finish=True))
    assert not cut.converged and finished.converged and finished.cost < cut.cost
    assert finished.message.startswith("converged") and "the last steps in a trust region" in finished.message
