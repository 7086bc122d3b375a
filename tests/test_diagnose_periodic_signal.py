"""A force that keeps time is located where it acts, with its period."""

from functools import lru_cache

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.hypotheses.localisation import locate

PERIOD = 4.1  # L/U


@lru_cache
def located(size):
    model = model_of("generic_sub")
    s = model.scales
    unit, time = 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2, s["L"] / s["U"]

    def force(name, t):
        return {"Y": size * unit * np.sin(2 * np.pi * t / (PERIOD * time) + (name == "turn"))}

    trial = planted_trial(model, other_vehicle(model, 5), seed=1, samples=240, force=force)
    problem = build_problem(model, trial)
    return locate(problem, problem.path, problem.coefficients, masks=False), time


def test_a_periodic_side_force_is_found_with_its_period():
    where, time = located(4e-4)
    best = where.places[0]
    assert best.channel in ("Y", "Y+N", "N", "rudder")
    assert best.period == pytest.approx(PERIOD * time, rel=0.03)
    assert best.evidence > 20.0
    assert where.outside > where.base + 10.0


def test_without_one_no_place_has_a_period():
    where, _ = located(0.0)
    assert all(p.period is None for p in where.places)
