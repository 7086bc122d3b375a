"""Velocities differentiated from the track are told from those of an instrument; the lever arm then goes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from bayesid.api.inputs import prepared
from bayesid.trials import Run, Trial, load_trial
from bayesid.trials.kinematics.derived_velocity import explained_share, velocity_from_track

SHARED = Path(__file__).resolve().parents[2] / "shared"


def weave(seed: int, derived: str = "", track_noise: float = 0.01, dt: float = 0.1, n: int = 1500) -> Run:
    """A weaving track with noise; u, v of an instrument, or of the noisy track by one of three filters."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    r = 0.2 * np.sin(0.4 * t + seed)
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * dt)))
    body = 1.5 - 0.1 * np.sin(0.13 * t) ** 2 - 0.4j * r
    velocity = body * np.exp(1j * psi)
    place = np.concatenate(([0j], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * dt)))
    place = place + track_noise * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    if derived:
        slope = np.gradient(place, dt)
        if derived == "causal":
            slope = lfilter([0.1], [1.0, -0.9], slope - slope[0]) + slope[0]  # lags by 0.9 s
        elif derived == "butterworth":
            slope = lfilter(*butter(2, 0.15), slope - slope[0]) + slope[0]
        elif derived == "two seconds":
            slope = np.convolve(slope, np.full(20, 0.05), mode="same")
        body = slope * np.exp(-1j * psi)
    else:
        body = body + 0.01 * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    data = {"x": place.real, "y": place.imag, "psi": psi + 1e-3 * rng.standard_normal(n)}
    return Run(f"w{seed}", "", "identify", t, data | {"u": body.real, "v": body.imag}, {})


@pytest.mark.parametrize("derived", ["causal", "butterworth", "two seconds"])
def test_any_filter_of_the_track_is_told(derived):
    assert velocity_from_track([weave(1, derived), weave(2, derived)]) is True


def test_instruments_of_their_own_are_told_filtered_or_not():
    assert velocity_from_track([weave(1), weave(2)]) is False

    def smoothed(run: Run) -> Run:
        slow = {k: lfilter([0.2], [1.0, -0.8], run.data[k] - run.data[k][0]) for k in ("u", "v")}
        return replace(run, data={**run.data, **{k: v + run.data[k][0] for k, v in slow.items()}})

    assert velocity_from_track([smoothed(weave(1)), smoothed(weave(2))]) is False


def test_the_same_velocity_beside_another_sensors_track_is_an_instruments_own():
    """Negative control: derived from one receiver, logged beside the track of a second one."""
    run, other = weave(1, "causal"), weave(1, track_noise=0.0101)
    noise = 0.01 * np.random.default_rng(99).standard_normal((2, run.n_samples))
    clean = weave(1, track_noise=0.0).data
    beside = replace(run, data={**run.data, "x": clean["x"] + noise[0], "y": clean["y"] + noise[1]})
    assert velocity_from_track([beside]) is False
    assert velocity_from_track([other]) is False


def test_a_quiet_track_and_one_without_velocities_do_not_tell():
    assert velocity_from_track([weave(1, track_noise=1e-5)]) is None
    bare = weave(1)
    assert explained_share(replace(bare, data={k: bare.data[k] for k in ("x", "y", "psi")})) is None


@pytest.mark.skipif(not (SHARED / "data").is_dir(), reason="the logs are not part of the project")
@pytest.mark.parametrize("name", ["esso_osaka", "kvlcc2_hsva"])
def test_both_tanker_models_log_the_derivative_of_their_track(name):
    folder = Path(__file__).resolve().parents[1] / "studies" / "real_logs" / name
    trial = load_trial(folder, data=SHARED / "data")
    assert velocity_from_track(trial.identify) is True
    assert velocity_from_track(trial.holdout) is True


@pytest.mark.skipif(not (SHARED / "practice").is_dir(), reason="practice bundles are not part of the project")
def test_no_practice_campaign_is_said_to():
    for folder in sorted((SHARED / "practice").iterdir()):
        if (folder / "trial.toml").exists():
            assert velocity_from_track(load_trial(folder).identify) is not True


def test_a_lever_arm_is_not_testable_there_and_a_latency_is():
    from gap_trials import model_of, planted_trial

    from bayesid.diagnosis.data.problem import build_problem
    from bayesid.diagnosis.hypotheses.sensitivity_bank import testable

    model = model_of()
    problem = build_problem(model, planted_trial(model))
    assert not problem.velocity_from_track and testable(problem, model.effects["position_lever_arm"])
    derived = replace(problem, velocity_from_track=True)
    assert not testable(derived, model.effects["position_lever_arm"])
    assert testable(derived, model.effects["velocity_latency"])


def test_thinning_keeps_what_the_readings_told_before():
    runs = (weave(1, "causal"), weave(2, "causal"))
    trial = Trial("pond", Path("."), "remus100", 3, runs)
    thinned = prepared(trial, resample=6 * (runs[0].t[1] - runs[0].t[0]))
    assert velocity_from_track(thinned.identify) is not True  # its fast changes are gone
    assert thinned.velocity_from_track is True and trial.velocity_from_track is None
    assert thinned.digest == replace(thinned, velocity_from_track=None).digest
