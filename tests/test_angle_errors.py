"""Errors of a heading count on through whole turns, and whoever prints one says so."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.evidence import holdout_prediction, replay
from bayesid.diagnosis.run_errors import ErrorRow, miss, whole_turns
from bayesid.estimation import trial_fit
from bayesid.measures.angle_errors import counted_on, turns_note
from bayesid.prediction.intervals import reading_errors
from bayesid.trials import Run

T = np.linspace(0.0, 600.0, 601)
LOG, SIMULATED = 0.03 * T, 0.02 * T  # a run that circles half as fast again as its simulation
RMS = math.sqrt(np.mean((0.01 * T) ** 2))


def one_channel(readings):
    readings = np.asarray(readings, float)[:, None]
    return SimpleNamespace(
        readings=readings, channels=("psi",), valid=np.isfinite(readings), sigma=np.array([0.01]),
        residuals=lambda simulated: (simulated - readings) / 0.01,
    )  # fmt: skip


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("turns", [-1, 0, 3])
def test_an_error_of_an_angle_is_continuous_from_the_first_reading(wrapped, turns):
    log = LOG + 2 * np.pi * turns
    if wrapped:
        log = (log + np.pi) % (2 * np.pi) - np.pi
    log = np.where((T > 200) & (T < 300), np.nan, log)
    found = counted_on((log - SIMULATED)[:, None], ["psi"])[:, 0]
    np.testing.assert_allclose(found, np.where(np.isnan(log), np.nan, 0.01 * T), atol=1e-12)


@pytest.mark.parametrize("at", [0, 1, 100, 598, 599])
@pytest.mark.parametrize("bad", [(2.3, -2.3), (2.3, -3.0), (3.1,), (2.0, 2.5, -2.5, -2.0)])
def test_bad_readings_count_no_turn_for_the_rest_of_a_run(bad, at):
    off = np.where(np.arange(T.size) < at, 0.0, 0.01 * (T - at))
    off += 0.01 * np.random.default_rng(1).standard_normal(T.size)
    wrong = off.copy()
    wrong[at : at + len(bad)] += np.array(bad)[: T.size - at]
    found = counted_on(wrong[:, None], ["psi"])[:, 0]
    kept = np.delete(np.arange(T.size), np.s_[at : at + len(bad)])
    np.testing.assert_allclose(found[kept], off[kept], atol=1e-12)


def test_a_compass_averaged_across_north_counts_no_turn():
    log = np.radians([*[359.0] * 50, 240.0, 120.0, *[1.0] * 50])
    simulated = np.radians([*[359.0] * 52, *[361.0] * 50])
    found = counted_on((log - simulated)[:, None], ["psi"])[:, 0]
    np.testing.assert_allclose(np.delete(found, [50, 51]), 0.0, atol=1e-12)


@pytest.mark.parametrize("rate", [0.3, 1.2, 3.0])
def test_an_error_that_grows_fast_goes_on_through_whole_turns(rate):
    grows = rate * np.arange(100.0)
    np.testing.assert_allclose(counted_on(grows[:, None], ["psi"])[:, 0], grows, atol=1e-9)


def test_what_is_no_angle_and_what_is_small_stay_as_they_are():
    far = np.stack([np.where(T > 300, 100.0, 0.0), 0.3 * np.sin(T)], axis=1)
    np.testing.assert_array_equal(counted_on(far, ["x", "psi"]), far)
    assert np.isnan(counted_on(np.full((3, 1), np.nan), ["psi"])).all()


def test_a_run_out_of_phase_has_the_same_error_in_diagnosis_fit_and_prediction():
    """Brought within half a turn it would be pi / sqrt(3), 104 degrees, of any simulation that circles."""
    log, simulated = one_channel(LOG), SIMULATED[:, None]
    every = np.ones(T.size, dtype=bool)
    assert replay._rms(log, simulated, every)["psi"] == pytest.approx(RMS)
    assert holdout_prediction._squares(log, simulated, every)[0] == pytest.approx((RMS / 0.01) ** 2)
    run = Run("r", "", "holdout", T, {"psi": LOG}, {})
    log.residuals = lambda s: np.remainder(s - log.readings + np.pi, 2 * np.pi) - np.pi
    outcome = trial_fit._outcome(run, log, simulated, simulated)
    assert outcome.rms_nominal[0] == pytest.approx(RMS) and outcome.rms_fitted[0] == pytest.approx(RMS)
    p = SimpleNamespace(t=T, lead=-1.0, channels=("psi",), mean=simulated)
    ((_, _, error, seen),) = reading_errors(p, run)
    assert math.sqrt(np.mean(error[seen] ** 2)) == pytest.approx(RMS)


def test_a_heading_that_counts_whole_turns_says_so():
    row = ErrorRow("heading", "degrees", (200.0, 170.0))
    assert "whole turns" in miss((row,), 0) and "whole turns" not in miss((row,), 1)
    assert "360 degrees" in whole_turns([row])
    assert not whole_turns(
        [ErrorRow("heading", "degrees", (60.0, math.nan)), ErrorRow("position", "m", (200.0,))]
    )
    assert not turns_note([math.inf, math.nan, 1.0]) and turns_note([2.0])
