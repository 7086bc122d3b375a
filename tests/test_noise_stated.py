"""Noise that is stated wrongly is told from the readings; motion, filters and held readings are not noise."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesid.api.diagnose import diagnose
from bayesid.api.simulate import simulate
from bayesid.diagnosis.run import diagnose as diagnose_trial
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle, with_relative_prior
from bayesid.trials import Run, Trial, trial_summary
from bayesid.trials.noise_stated import believed, seen_noise, stated_wrongly, with_seen_noise

TRUE = {"psi": 0.01, "r": 0.004}


def run(dt: float = 0.1, n: int = 800, seed: int = 0, period: float = 25.0, **noise: np.ndarray) -> Run:
    """A heading that swings with a period [s] and its rate, with white noise; other noise where given."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    w = 2 * np.pi / period
    exact = {"psi": 0.5 * np.sin(w * t + seed), "r": 0.5 * w * np.cos(w * t + seed)}
    data = {k: v + noise.get(k, TRUE[k] * rng.standard_normal(n)) for k, v in exact.items()}
    return Run(f"r{seed}", "", "identify", t, data, {})


@pytest.mark.parametrize("factor", [0.01, 0.33, 0.5, 1.0, 2.0, 3.0, 50.0])
def test_white_noise_is_found_whatever_is_stated(factor):
    stated = {k: factor * v for k, v in TRUE.items()}
    seen = seen_noise([run(seed=1), run(seed=2)], stated)
    assert {one.name for one in seen} == set(TRUE)
    for one in seen:
        assert one.seen == pytest.approx(TRUE[one.name], rel=0.1)
        assert one.wrong is (factor != 1.0)
    taken = believed(stated, seen)
    assert taken == (stated if factor == 1.0 else {one.name: one.seen for one in seen})
    assert (stated_wrongly(seen) is None) is (factor == 1.0)


def test_degrees_stated_for_radians_are_said_to_be():
    seen = seen_noise([run(seed=1), run(seed=2)], {"psi": np.degrees(TRUE["psi"])})
    assert "psi in degrees?" in stated_wrongly(seen)


def filtered(n=800, share=0.15, seed=0):
    """White noise through a first-order low-pass: small in fast changes, as large as before in slow ones."""
    white = np.random.default_rng(seed).standard_normal(n)
    out = lfilter([share], [1.0, share - 1.0], white)
    return out / out.std()


@pytest.mark.parametrize("stated", [0.5, 1.0, 3.0])
def test_a_filtered_channel_keeps_what_is_stated(stated):
    log = run(psi=0.02 * filtered())
    assert seen_noise([log], {"psi": stated * 0.02}) == ()


def test_motion_between_samples_a_held_sensor_and_few_readings_are_no_noise():
    # a swing followed at 1.3 readings per period; negative control: the same one followed well is told
    assert seen_noise([run(dt=1.0, period=1.3)], {"r": 0.001}) == ()
    assert seen_noise([run(dt=1.0, period=1.3 * 30)], {"r": 0.001})[0].wrong
    held = run()
    psi = np.repeat(held.data["psi"][::5], 5)
    assert seen_noise([replace(held, data={"psi": psi})], {"psi": 0.001}) == ()
    assert seen_noise([run(n=40)], {"psi": 0.001}) == ()


def test_random_turns_faster_than_the_log_are_no_noise():
    """White from reading to reading, and yet the vehicle's motion: too coarse in L/U, too large a share."""
    rng = np.random.default_rng(3)
    log = run(dt=2.0, r=0.2 * rng.standard_normal(800))
    assert seen_noise([log], {"r": 0.004}) == ()
    assert seen_noise([run(dt=2.0, seed=4, period=150.0)], {"psi": 0.004})[0].wrong
    assert seen_noise([run(dt=2.0, seed=4, period=150.0)], {"psi": 0.004}, (2.0, 1.5)) == ()


def remus(stated: float) -> Trial:
    noise = {"x": 0.05, "y": 0.05, "psi": 0.008, "r": 0.006, "u": 0.01, "v": 0.01}
    vehicle = with_relative_prior(load_vehicle("remus100"), 0.05)
    trial = simulate(vehicle, "zigzag:10/10", "turn:12", "prbs:seed=2", noise=noise, seed=3, dt=0.2)
    return replace(trial, noise={k: stated * v for k, v in trial.noise.items()})


@pytest.fixture(scope="module")
def model():
    return build_model(with_relative_prior(load_vehicle("remus100"), 0.05), 3)


def test_the_trial_keeps_a_right_statement_to_the_last_digit(model):
    trial = remus(1.0)
    assert with_seen_noise(trial, (model.scales["L"], model.scales["U"])) is trial


@pytest.fixture(scope="module")
def told_too_little():
    """A clean trial whose noise is stated three times too small, diagnosed as the command does it."""
    vehicle = with_relative_prior(load_vehicle("remus100"), 0.05)
    return diagnose(remus(0.33), vehicle, next_manoeuvre=False, keep_model=False)


@pytest.mark.thorough
def test_a_clean_trial_has_no_gap_although_its_noise_is_stated_too_small(told_too_little):
    assert told_too_little.verdict == "none"
    assert any("[noise]" in text for text in told_too_little.record()["warnings"])


def test_diagnose_remarks_on_it_under_input(told_too_little):
    assert len(told_too_little.record()["input"]["remarks"]) == 1


@pytest.mark.slow
def test_a_clean_trial_has_no_gap_although_its_noise_is_stated_too_large(model):
    found = diagnose_trial(remus(3.0), model, plan_next=False)
    assert found.result.verdict == "none"
    assert any("[noise]" in text for text in found.result.warnings)


class Reached(Exception):
    """The trial has been weighed; what follows is not asked for."""


@pytest.mark.parametrize(("trust", "share"), [(True, 0.33), (False, 1.0)])
def test_trusting_the_input_keeps_the_noise_as_stated(model, monkeypatch, trust, share):
    weighed = []

    def compared(_, trial, *__):
        weighed.append(trial)
        raise Reached

    monkeypatch.setattr(importlib.import_module("bayesid.diagnosis.run"), "compare_without", compared)
    with pytest.raises(Reached):
        diagnose_trial(remus(0.33), model, plan_next=False, trust_noise=trust)
    assert weighed[0].noise["x"] == pytest.approx(share * 0.05, rel=1e-9 if trust else 0.15)


@pytest.mark.slow
def test_noise_trusted_though_too_small_is_taken_for_a_gap(model):
    found = diagnose_trial(remus(0.33), model, plan_next=False, trust_noise=True)
    assert found.problem.logs[0].sigma[0] == pytest.approx(0.33 * 0.05)
    assert found.result.verdict != "none"  # what the noise is taken for without the seen one


def test_trial_check_names_it_with_its_mend():
    told = [text for text in trial_summary(remus(0.1))["warnings"] if "[noise]" in text]
    assert len(told) == 1 and "x 1/" in told[0] and "psi = 0.00" in told[0]
