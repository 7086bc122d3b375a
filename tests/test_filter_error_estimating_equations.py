"""Slopes along the filtered path: estimating equations without bias where motion answers the environment."""

from functools import lru_cache

import numpy as np
from gap_trials import model_of, noise_of

from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Trajectory, linearise, with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, mixing, whitened
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import RunData
from bayesid.simulation import interval_maps, plan_run, readings_on, simulate, steady_start

FREE = ("N_v", "N_r", "Y_v")


@lru_cache
def rough_sea(level, count=40, samples=120):
    """Standardised scores at the truth, (count, coefficients), along the filtered and the smoothed path."""
    model, rng = model_of("remus100"), np.random.default_rng(5)
    s, nothing = model.scales, np.zeros(0, dtype=np.int64)
    t = 0.3 * s["L"] / s["U"] * np.arange(samples)
    plan = plan_run(model, t, {"n_cmd": np.full(samples, model.vehicle.rpm_ref)})
    noise_model = NoiseModel(tuple(level * force_unit(model)), 2.0 * s["L"] / s["U"], 0.0, 1.0)
    names = ("x", "y", "psi", "r")
    sigma = np.array([noise_of(model)[c] for c in names])
    picked = tuple(model.kernel.channels.index(c) for c in names)
    free = model.positions(list(FREE))
    keep = np.exp(-np.diff(t)[0] / noise_model.force_tau)
    found = []
    for _ in range(count):
        force = rng.standard_normal((samples - 1, 3))
        for i in range(1, samples - 1):
            force[i] = keep * force[i - 1] + np.sqrt(1 - keep**2) * force[i]
        force = force * np.array(noise_model.force)
        pushed = with_forces(model, plan, force)
        states = simulate(model, model.nominal, pushed, steady_start(model), full=True).states
        maps = interval_maps(model, model.nominal, pushed, states, (), nothing)
        clean = readings_on(model, model.nominal, pushed, states, maps, nothing).values[:, list(picked)]
        data = clean + sigma * rng.standard_normal(clean.shape)
        start = np.full(states.shape[1], 0.1)
        log = RunData("a", plan, names, data, sigma, states[0], model.kernel.full.states, start, path=states)
        point = fit(model, [log], NO_PARAMETERS, noise_model, iterations=6, initial_noise_scale=0.0).points[0]
        row = []
        for p in (point, Trajectory(point.par, point.states, point.force)):
            path = linearise(model, log, p, free)
            w = whitened(model, path, np.zeros(len(free)), np.ones(len(free)), noise_model)
            row.append(w.columns.T @ w.resid / np.sqrt((w.columns**2).sum(axis=0)))
        found.append(row)
    return np.array(found)


def test_the_score_of_the_truth_has_no_bias_along_the_filtered_path():
    scores = rough_sea(1e-4)[:, 0]
    # standard normal at best; three standard errors of its mean
    assert np.abs(scores.mean(axis=0)).max() < 3 / np.sqrt(len(scores))
    assert (scores.std(axis=0) < 1.4).all()


def test_along_the_smoothed_path_coefficients_would_be_pulled_from_the_truth():
    pulled = np.abs(rough_sea(1e-4)[:, 1].mean(axis=0)).max()
    assert pulled > 4 / np.sqrt(40)


def test_in_a_sea_too_rough_for_a_linear_filter_most_of_the_pull_is_gone():
    filtered, smoothed = np.abs(rough_sea(3e-4).mean(axis=0)).max(axis=1)
    assert filtered < 0.4 * smoothed


def test_arms_mix_a_side_force_into_yaw():
    model = model_of("remus100")
    noise_model = NoiseModel((1.0, 2.0, 3.0), 1.0, 0.0, 1.0, arms=(0.5,))
    latent = np.array([1.0, 4.0, 2.0])
    np.testing.assert_allclose(mixing(model, noise_model) @ latent, [1.0, 4.0, 2.0 + 0.5 * 4.0])
