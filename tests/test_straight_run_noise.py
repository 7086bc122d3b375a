"""What is not disturbance is found in straight runs and left out of the environment measured there."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesid.equations.model import build_model
from bayesid.estimation.filter_error import periodic_disturbance
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior, without
from bayesid.estimation.filter_error.linearise import Trajectory, latent_inputs, linearise, with_forces
from bayesid.estimation.filter_error.noise_identification import identify_noise
from bayesid.estimation.filter_error.noise_model import force_unit
from bayesid.estimation.filter_error.periodic_disturbance import periodic_columns, spectrum
from bayesid.estimation.filter_error.periodic_disturbance import periodic_forces as found_lines
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.filter_error.straight_run_noise import identify_straight_noise
from bayesid.estimation.parameters import coefficient_prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run

MODEL = build_model(load_vehicle("nps_auv2"), 3)
LENGTH = MODEL.scales["L"] / MODEL.scales["U"]
NOISE = {"x": 0.2, "y": 0.2, "psi": 0.003, "r": 5e-4, "u": 0.005, "v": 0.005}
SPACING, SAMPLES, QUIET = 0.5, 320, 3e-5
BEAT = 1.7 / LENGTH


def disturbance(rng, lasting):
    """(n-1, 3) forces of `QUIET` rms that last `lasting` L/U."""
    keep = np.exp(-SPACING / (lasting * LENGTH))
    drive = np.sqrt(1.0 - keep**2) * rng.standard_normal((SAMPLES - 1, 3))
    return QUIET * force_unit(MODEL) * lfilter([1.0], [1.0, -keep], drive, axis=0)


@lru_cache
def straight(kind, seed):
    rng = np.random.default_rng(seed)
    t = SPACING * np.arange(SAMPLES)
    commands = {"n_cmd": np.full(SAMPLES, MODEL.vehicle.rpm_ref), "delta_r_cmd": np.zeros(SAMPLES)}
    force = disturbance(rng, 1.0)
    middle = 0.5 * (t[1:] + t[:-1])
    if kind == "beat":
        force[:, 1] += 1e-3 * force_unit(MODEL)[1] * np.sin(BEAT * middle + rng.uniform(0, 2 * np.pi))
    if kind == "step":
        force[:, 0] -= 1e-3 * force_unit(MODEL)[0] * (middle > rng.uniform(0.35, 0.6) * t[-1])
    plan = with_forces(MODEL, plan_run(MODEL, t, commands), force)
    states = simulate(MODEL, MODEL.nominal, plan, steady_start(MODEL)).states
    data = {n: states[:, MODEL.states.index(n)] + s * rng.standard_normal(SAMPLES) for n, s in NOISE.items()}
    run = Run("a", "straight run", "identify", t, data, commands)
    return filter_error_run(MODEL, run, NOISE, tuple(NOISE))


@lru_cache
def measured(kind):
    logs = [straight(kind, k) for k in (1, 2)]
    assert all(log.straight for log in logs)
    return identify_straight_noise(MODEL, logs, coefficient_prior(MODEL))


@pytest.mark.thorough
def test_process_noise_alone_has_nothing_set_apart():
    environment, apart = measured("disturbance")
    assert not apart.any
    level = np.array(environment.noise_model.force) / force_unit(MODEL)
    assert np.all(level < 2.5 * QUIET) and np.all(level > QUIET / 4)


@pytest.mark.thorough
def test_a_periodic_force_is_found_with_its_period_and_is_not_process_noise():
    environment, apart = measured("beat")
    assert apart.frequencies == pytest.approx((BEAT,), rel=0.02)
    plain = identify_noise(MODEL, [straight("beat", k) for k in (1, 2)], coefficient_prior(MODEL))
    assert environment.noise_model.force[1] < 0.3 * plain.noise_model.force[1]
    assert environment.noise_model.force[1] < 3.0 * QUIET * force_unit(MODEL)[1]


@pytest.mark.thorough
def test_a_drag_that_steps_up_for_good_is_not_process_noise():
    environment, apart = measured("step")
    assert apart.lasting or "X" in apart.repeated
    plain = identify_noise(MODEL, [straight("step", k) for k in (1, 2)], coefficient_prior(MODEL))
    assert environment.noise_model.force[0] < 0.5 * plain.noise_model.force[0]


def test_unknowns_integrated_out_leave_the_evidence_as_it_was():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((40, 6)), rng.standard_normal(40)
    whole = NormalEquations(a.T @ a, a.T @ b, float(b @ b), 1.7, 40)
    some = without(whole, 4)
    assert some.se.shape == (4,)
    assert posterior(some).log_evidence == pytest.approx(posterior(whole).log_evidence, abs=1e-10)
    assert posterior(some).mean == pytest.approx(posterior(whole).mean[:4], abs=1e-12)


@pytest.mark.thorough
def test_white_innovations_have_no_line_and_a_faint_sine_is_one():
    log = straight("disturbance", 1)
    path = linearise(
        MODEL, log, Trajectory(MODEL.nominal, log.path, np.zeros((log.n - 1, 3))), np.zeros(0, int)
    )
    rng = np.random.default_rng(4)
    white = [rng.standard_normal(log.readings.shape) for _ in range(100)]
    false = sum(bool(found_lines(MODEL, [path], [z])[0]) for z in white)
    assert false <= 1  # 0.1 expected
    beat = 0.5 * np.sin(BEAT * log.plan.t)[:, None] * np.array([0, 1, 0, 1, 0, 1])
    seen = [found_lines(MODEL, [path], [z + beat])[0] for z in white[:20]]
    assert np.mean([len(s) > 0 and abs(s[0] / BEAT - 1) < 0.02 for s in seen]) > 0.95


@pytest.mark.thorough
def test_ordinates_of_white_noise_have_the_mean_and_spread_of_their_gamma():
    log = straight("disturbance", 1)
    path = linearise(
        MODEL, log, Trajectory(MODEL.nominal, log.path, np.zeros((log.n - 1, 3))), np.zeros(0, int)
    )
    rng = np.random.default_rng(5)
    total = [spectrum(MODEL, [path], [rng.standard_normal(log.readings.shape)]) for _ in range(20)]
    values = np.concatenate([t[1] for t in total])
    assert total[0][2] == 6
    # the local level is never taken below one, so the mean may only be lower than six
    assert 4.5 < values.mean() < 6.1 and values.std() < 2.6


@pytest.mark.thorough
def test_a_swing_moves_each_interval_as_the_force_itself_does():
    log = straight("disturbance", 1)
    names = latent_inputs(MODEL)[:3]
    still = Trajectory(MODEL.nominal, log.path, np.zeros((log.n - 1, 3)))
    bare = linearise(MODEL, log, still, np.zeros(0, int))
    size = 1e-5 * force_unit(MODEL)
    drive = periodic_columns(bare, BEAT, names, size)[1]
    middle = 0.5 * (log.plan.t[1:] + log.plan.t[:-1])
    for axis in range(3):
        force = np.zeros((log.n - 1, 3))
        force[:, axis] = size[axis] * np.sin(BEAT * middle)
        pushed = linearise(MODEL, log, Trajectory(MODEL.nominal, log.path, force), np.zeros(0, int))
        change = pushed.defect - bare.defect
        assert change == pytest.approx(drive[:, :, 2 * axis + 1], abs=2e-4 * np.abs(change).max())


@pytest.mark.parametrize("channels", [("x", "y"), ("x", "y", "psi"), ("u", "v")])
def test_a_held_rudder_is_no_straight_run_and_what_logs_no_course_is_none_either(channels):
    t = SPACING * np.arange(SAMPLES)
    noise = {c: NOISE[c] for c in channels}
    for order, straight_there in ((0.0, "x" in channels), (0.06, False)):
        commands = {
            "n_cmd": np.full(SAMPLES, MODEL.vehicle.rpm_ref),
            "delta_r_cmd": np.where(t > 5, order, 0.0),
        }
        states = simulate(MODEL, MODEL.nominal, plan_run(MODEL, t, commands), steady_start(MODEL)).states
        data = {c: states[:, MODEL.states.index(c)] for c in channels}
        log = filter_error_run(MODEL, Run("a", "run", "identify", t, data, commands), noise, channels)
        assert log.straight == straight_there


def test_frequencies_taken_a_few_at_a_time_give_the_same_spectrum(monkeypatch):
    log = straight("disturbance", 1)
    path = linearise(
        MODEL, log, Trajectory(MODEL.nominal, log.path, np.zeros((log.n - 1, 3))), np.zeros(0, int)
    )
    innovations = [np.random.default_rng(0).standard_normal(log.readings.shape)]
    whole = spectrum(MODEL, [path], innovations)[1]
    assert whole.size > 16
    monkeypatch.setattr(periodic_disturbance, "MOST_TURNS", 7 * log.n)
    np.testing.assert_allclose(spectrum(MODEL, [path], innovations)[1], whole, rtol=1e-12)
