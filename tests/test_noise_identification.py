"""The environment is measured per instrument: depth has a slow error of its own."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import stacked_equations
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.noise_identification import depth_noise, identify_noise
from bayesid.estimation.filter_error.noise_model import NoiseModel, filter_settings, force_unit
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS, coefficient_prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run

MODEL = build_model(load_vehicle("nps_auv2"), 6)
NOISE = {"x": 0.3, "y": 0.3, "z": 0.1, "psi": 0.005, "theta": 0.003, "phi": 0.003, "r": 1e-3, "q": 1e-3}
SLOW, SPACING = 30.0, 1.0


def wandering(rng, n, step=SPACING / SLOW):
    """Unit Ornstein-Uhlenbeck series; `step` between samples over the correlation time."""
    keep = np.exp(-step)
    drive = rng.standard_normal(n)
    drive[1:] *= np.sqrt(1.0 - keep**2)
    return lfilter([1.0], [1.0, -keep], drive)


@lru_cache
def straight(across, depth, seed=0, samples=250):
    """Straight run in still water, and its true states: position wanders by `across` m, depth by `depth`."""
    rng = np.random.default_rng(seed)
    t = SPACING * np.arange(samples)
    commands = {"n_cmd": np.full(samples, MODEL.vehicle.rpm_ref), "delta_r_cmd": np.zeros(samples)}
    states = simulate(MODEL, MODEL.nominal, plan_run(MODEL, t, commands), steady_start(MODEL)).states
    data = {}
    for name, sigma in NOISE.items():
        slow = {"x": across, "y": across, "z": depth}.get(name, 0.0)
        clean = states[:, MODEL.states.index(name)]
        data[name] = clean + sigma * rng.standard_normal(samples) + slow * wandering(rng, samples)
    run = Run("a", "straight run", "identify", t, data, commands)
    return filter_error_run(MODEL, run, NOISE, tuple(NOISE)), states


def path_of(across, depth, seed=0):
    """Run linearised along its true states."""
    log, states = straight(across, depth, seed)
    full = np.zeros_like(log.path)
    full[:, : states.shape[1]] = states
    return linearise(
        MODEL, log, Trajectory(MODEL.nominal, full, np.zeros((log.n - 1, 6))), NO_PARAMETERS.where
    )


@lru_cache
def found(across, depth):
    logs = [straight(across, depth, k)[0] for k in range(2)]
    return identify_noise(MODEL, logs, coefficient_prior(MODEL), rounds=1).noise_model


@pytest.mark.thorough
def test_a_drift_of_the_position_is_measured_beside_a_depth_that_has_none():
    # two runs of eight correlation times, two channels: one standard deviation is 15 %
    noise_model = found(0.6, 0.0)
    assert 0.65 < noise_model.drift / 0.6 < 1.5
    assert noise_model.depth < 0.3 * NOISE["z"]


@pytest.mark.thorough
def test_a_drift_of_the_depth_is_measured_beside_a_position_that_has_none():
    noise_model = found(0.0, 0.6)
    assert 0.6 < noise_model.depth / 0.6 < 1.6
    assert noise_model.drift < 0.3 * NOISE["x"]


@pytest.mark.thorough
def test_one_level_for_both_instruments_would_halve_the_drift_of_the_position():
    # control, and the reason for two levels
    paths = [path_of(0.6, 0.0, k) for k in range(2)]
    quiet = NoiseModel(tuple(1e-6 * force_unit(MODEL)), SLOW, 0.6, SLOW)

    def best(depth):
        levels = np.geomspace(0.1, 1.5, 15)
        tried = []
        for level in levels:
            grams = stacked_equations(MODEL, paths, NO_PARAMETERS, replace(quiet, drift=level, depth=depth))
            tried.append(posterior(sum(grams[1:], grams[0])).log_evidence)
        return levels[np.argmax(tried)], max(tried)

    own, tied = best(0.0), best(None)
    assert 0.65 < own[0] / 0.6 < 1.5
    assert tied[0] < 0.8 * own[0]
    assert own[1] > tied[1] + 20.0


@pytest.mark.thorough
def test_depth_counts_as_position_where_nothing_else_is_said():
    path = path_of(0.6, 0.0)
    tied = NoiseModel(tuple(1e-6 * force_unit(MODEL)), SLOW, 0.4, SLOW)
    np.testing.assert_array_equal(filter_settings(MODEL, path, tied).variance_d, 0.4**2 * np.ones(3))
    other = filter_settings(MODEL, path, replace(tied, depth=0.05)).variance_d
    names = [c for c in path.log.channels if c in "xyz"]
    assert dict(zip(names, other, strict=True)) == pytest.approx({"x": 0.16, "y": 0.16, "z": 0.0025})


def test_all_amplitudes_are_scaled_alike():
    tied = NoiseModel((1.0,), 1.0, 0.4, 1.0)
    assert tied.scaled(2.0).depth is None and tied.scaled(2.0).slow("z") == 0.8
    own = replace(tied, depth=0.1).scaled(2.0)
    assert (own.slow("x"), own.slow("z"), own.slow("psi")) == (0.8, 0.2, 0.0)


@pytest.mark.thorough
def test_a_planar_trial_has_no_level_of_the_depth():
    planar = build_model(load_vehicle("remus100"), 3)
    assert depth_noise(planar, []) is None
    assert depth_noise(MODEL, [straight(0.6, 0.0)[0]]) == NOISE["z"]


def test_a_position_error_keeps_its_own_time_on_a_large_vehicle():
    # L/U is 19 s here: the position wanders over 3 of them, which no vehicle's own motion would
    model = build_model(load_vehicle("generic_sub"), 3)
    t, tau = 2.5 * np.arange(250), 60.0
    commands = {"n_cmd": np.full(t.size, model.vehicle.rpm_ref), "delta_r_cmd": np.zeros(t.size)}
    states = simulate(model, model.nominal, plan_run(model, t, commands), steady_start(model)).states
    noise, logs = {"x": 1.0, "y": 1.0, "psi": 0.005, "r": 5e-4}, []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        data = {
            n: states[:, model.states.index(n)] + s * rng.standard_normal(t.size) for n, s in noise.items()
        }
        for name in ("x", "y"):
            data[name] = data[name] + 2.0 * wandering(rng, t.size, 2.5 / tau)
        run = Run("a", "straight", "identify", t, data, commands)
        logs.append(filter_error_run(model, run, noise, tuple(noise)))
    noise_model = identify_noise(model, logs, coefficient_prior(model), rounds=1).noise_model
    # two runs of ten correlation times, two channels
    assert 0.7 < noise_model.drift / 2.0 < 1.4
    assert 0.5 < noise_model.drift_tau / tau < 2.0


@pytest.mark.thorough
def test_a_depth_only_the_manoeuvres_log_is_measured_there():
    """Straight runs without depth say nothing about its error; a run with depth then adds an unknown."""
    log = straight(0.3, 0.0, samples=100)[0]
    z = log.channels.index("z")
    kept = [j for j in range(len(log.channels)) if j != z]
    blind = replace(
        log,
        channels=tuple(log.channels[j] for j in kept),
        readings=log.readings[:, kept],
        sigma=log.sigma[kept],
    )
    free = coefficient_prior(MODEL)
    first = identify_noise(MODEL, [blind], free, rounds=1, steps=3)
    assert first.noise_model.depth is None
    again = identify_noise(MODEL, [blind, log], free, rounds=1, known=first, steps=3)
    assert 0.0 < again.noise_model.depth < 1.0
