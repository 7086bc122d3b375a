"""Stacks are used again under many environments, and latent inputs of no variance are left out."""

from dataclasses import replace

import numpy as np
from gap_trials import model_of, noise_of

from bayesid.estimation.filter_error.kalman import whiten
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.noise_model import (
    NoiseModel,
    active_inputs,
    filter_settings,
    force_unit,
    smoothed,
    whitened,
)
from bayesid.estimation.filter_error.regressor_columns import regressor_columns
from bayesid.estimation.run_data import RunData
from bayesid.simulation import plan_run, simulate, steady_start

MODEL = model_of("remus100")
FREE = MODEL.positions(["N_v", "N_r", "Y_v"])


def path_of(seed=0, samples=60):
    s, rng = MODEL.scales, np.random.default_rng(seed)
    t = 0.3 * s["L"] / s["U"] * np.arange(samples)
    rudder = 0.1 * np.sign(np.sin(0.4 * np.arange(samples)))
    commands = {"n_cmd": np.full(samples, MODEL.vehicle.rpm_ref), "delta_r_cmd": rudder}
    plan = plan_run(MODEL, t, commands)
    states = simulate(MODEL, MODEL.nominal, plan, steady_start(MODEL), full=True).states
    names = ("x", "y", "psi", "r")
    sigma = np.array([noise_of(MODEL)[c] for c in names])
    columns = [MODEL.kernel.full.states.index(c) for c in names]
    data = states[:, columns] + sigma * rng.standard_normal((samples, 4))
    valid = rng.uniform(size=data.shape) > 0.1
    data[~valid] = np.nan
    start = np.full(states.shape[1], 0.1)
    log = RunData("a", plan, names, data, sigma, states[0], MODEL.kernel.full.states, start, path=states)
    force = 1e-4 * force_unit(MODEL) * rng.standard_normal((samples - 1, 3))
    return linearise(MODEL, log, Trajectory(MODEL.nominal, states, force), FREE)


def colours_of(force=1e-4, drift=0.1):
    s = MODEL.scales
    unit = tuple(float(f) for f in force * force_unit(MODEL))
    return NoiseModel(unit, 3 * s["L"] / s["U"], drift, 25 * s["L"] / s["U"])


def test_a_stack_is_used_again_only_for_the_same_path_step_scale_and_further_columns():
    path, step, scale = path_of(), np.array([0.1, 0.0, -0.2]), np.ones(3)
    more = (np.ones((60, 4, 1)), np.ones((59, path.phi.shape[1], 1)))
    first = regressor_columns(path, step, scale)
    assert regressor_columns(path, step.copy(), scale.copy()) is first
    for other in ((path, 2 * step, scale), (path, step, 2 * scale), (path, step, scale, more)):
        found = regressor_columns(*other)
        assert found is not first
        fresh = regressor_columns(replace(path), *other[1:])
        np.testing.assert_array_equal(found.columns, fresh.columns)
        np.testing.assert_array_equal(found.drive, fresh.drive)


def test_a_path_whitened_under_many_environments_gives_what_a_fresh_path_gives():
    path, step, scale = path_of(), np.array([1e-3, 0.0, -2e-3]), np.full(3, 0.1)
    for force in (1e-5, 1e-3, 1e-4):
        w = whitened(MODEL, path, step, scale, colours_of(force))
        fresh = whitened(MODEL, replace(path), step, scale, colours_of(force))
        np.testing.assert_array_equal(w.columns, fresh.columns)
        np.testing.assert_array_equal(w.resid, fresh.resid)


def test_latent_inputs_of_no_variance_may_be_left_out():
    path, nothing = path_of(), np.zeros(3)
    stack = regressor_columns(path, nothing, np.ones(3))
    for noise_model in (colours_of(0.0, 0.0), colours_of(0.0), colours_of(drift=0.0)):
        whole = filter_settings(MODEL, path, noise_model)
        some, kept = active_inputs(whole)
        assert some.variance_f.size + some.variance_d.size == kept.sum() < kept.size
        found = []
        for f in (whole, some):
            out = np.empty((60 * 4, 4))
            logdet, used = whiten(
                stack.columns, stack.drive, stack.first, path.log.valid, path.slope, f.variance, path.phi,
                f.gamma, f.decay_f, f.variance_f, f.drift, f.decay_d, f.variance_d, f.start, out,
            )  # fmt: skip
            found.append((out, logdet, used))
        assert found[0][2] == found[1][2] == path.log.valid.sum()
        assert abs(found[0][1] - found[1][1]) < 1e-9 * abs(found[0][1])
        np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-9, atol=1e-9 * np.abs(found[0][0]).max())


def test_left_out_inputs_come_back_as_zeros_when_smoothed():
    path = path_of()
    nx = path.phi.shape[1]
    sm = smoothed(MODEL, path, np.zeros(3), colours_of(0.0))
    assert sm.mean.shape == sm.variance.shape == sm.filtered.shape == (60, nx + 3 + 2)
    assert not sm.mean[:, nx : nx + 3].any() and not sm.variance[:, nx : nx + 3].any()
    assert sm.mean[:, nx + 3 :].any() and (sm.variance[:, nx + 3 :] > 0).all()
