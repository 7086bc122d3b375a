"""What the coverage study is compared with: linear theory of white noise, the truth under other equations."""

from __future__ import annotations

import json

import numpy as np
import pytest

from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, setting, with_rows
from studies.coverage.control import projected_truth, white_by_theory
from studies.coverage.report import CONTROL, CONTROL_CONDITION, judged
from studies.coverage.run import CONDITIONS, RANKS, replicate


def test_noise_without_memory_gives_what_intervals_claim():
    assert white_by_theory(setting((10.0,)), Condition(memory=1e-3)) == pytest.approx(0.9, abs=1e-6)


def test_the_control_is_certain_to_fail_and_the_other_conditions_are_not():
    """Of its 60 campaigns one standard error is 1.5 %."""
    control = CONDITIONS[CONTROL_CONDITION]
    assert white_by_theory(setting(dt=control.dt), control) < CONTROL - 5 * 0.015
    other = CONDITIONS["noise remembers 10 samples, pieces"]
    assert white_by_theory(setting(), other) > CONTROL


def test_where_the_equations_are_right_the_nearest_coefficients_are_those_of_the_vehicle():
    s = setting((10.0, 20.0))
    truth = drawn_truth(s, np.random.default_rng(0))
    fitted = problem_of(s, campaign(s, Condition(), truth, np.random.default_rng(1)))
    found = projected_truth(s, Condition(), truth, fitted, s)
    assert found == pytest.approx(truth, rel=1e-4)


def test_a_row_takes_what_a_force_it_lacks_does_in_its_place():
    """X_vv beside X_vr: a ship in a turn has drift and rate in proportion."""
    s = setting((10.0, 20.0))
    condition = Condition(rows={"X_vv": 10.0})
    truth = s.params.start
    real = with_rows(s, condition.rows)
    fitted = problem_of(s, campaign(s, condition, truth, np.random.default_rng(1), real))
    found = projected_truth(s, condition, truth, fitted, real)
    moved = np.abs(found - truth) / s.params.prior_sd
    assert s.params.names[int(np.argmax(moved))].startswith("X") and moved.max() > 0.3


@pytest.mark.thorough
def test_replicates_that_were_kept_on_disk_are_judged_as_those_that_were_not():
    """Two campaigns with a row that the fit lacks."""
    name = "other equations: three more rows"
    s = setting((10.0, 20.0))
    real = with_rows(s, CONDITIONS[name].rows)
    rows = [replicate(s, real, CONDITIONS[name], seed) for seed in (0, 1)]
    kept = json.loads(json.dumps(rows, default=lambda array: array.tolist()))
    now, then = (judged({name: some}, RANKS, {}) for some in (rows, kept))
    assert now == then
    z = np.array([row["projected_z"] for row in kept])
    case = now["cases"][name]
    assert case["projected"]["rms_z"] == pytest.approx(np.sqrt(np.mean(z**2)))
    assert case["projected"]["coverage"]["share"] == pytest.approx(np.mean(np.abs(z) < 1.645), abs=1e-9)
    assert set(case["projected"]["move"]) == set(s.params.names)
