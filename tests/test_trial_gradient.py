"""The gradient of a trial's posterior is that of its density, and both samplers find the same posterior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.identifiability import with_assumed_priors
from bayesid.equations.model import build_model
from bayesid.errors import SampleError
from bayesid.estimation.output_error import coefficient_set, fit, trial_problem
from bayesid.estimation.output_error.reading_gradient import reading_gradient
from bayesid.estimation.sampling import SamplerOptions, sample
from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts
from bayesid.estimation.sampling.settings import SamplingSettings
from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity
from bayesid.estimation.sampling.trial_setup import trial_density
from bayesid.manoeuvres import zigzag
from bayesid.model.params import Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01, "v": 0.05}
FREE = ("Y_v", "N_v", "N_r", "N_dr")
CHOICES = {
    "as a rule": SamplingSettings(),
    "white, starts sampled": SamplingSettings(noise="fixed", initial="sampled", memory="ignore"),
    "half-normal noise, starts fixed": SamplingSettings(noise_prior="half_normal", initial="fixed"),
    "outliers": SamplingSettings(initial="sampled", student=4.0),
}


@pytest.fixture(scope="module")
def problem():
    model = build_model(load_vehicle("generic_sub"), 3)
    orders = {n: zigzag(s * 0.35, 0.35, 90.0, 10.0, 120.0, 2.0) for n, s in (("one", 1), ("two", -1))}
    trial = virtual_trial(
        model, model.nominal, orders, title="t", vehicle_ref="generic_sub", noise=NOISE,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    params = coefficient_set(model, FREE).changed(
        ["N_r"], prior=Prior("lognormal", float(model.nominal[model.index["N_r"]]), 0.1)
    )
    whole = trial_problem(model, trial, params, channels=tuple(NOISE), threads=1)
    return with_assumed_priors(whole, 0.1)


@pytest.mark.parametrize("name", CHOICES)
def test_the_slope_is_that_of_the_density(problem, name):
    density = trial_density(problem, problem.start, CHOICES[name])
    sloped = GradientTrialDensity(density)
    rng = np.random.default_rng(1)
    q = density.laplace.points(0.5 * rng.standard_normal(density.laplace.mode.size))
    value, slope = sloped.log_prob_slope(q)
    assert value == pytest.approx(density.log_prob(q[None])[0], abs=1e-6)
    sd = np.sqrt(np.diag(density.laplace.covariance))
    ends = np.stack([q + 1e-3 * s * e * sd for e in np.eye(q.size) for s in (1, -1)])
    rough = -np.diff(density.log_prob(ends).reshape(-1, 2), axis=1)[:, 0] / 2e-3
    # central differences of 1e-3 sd: third derivatives leave about 1e-5 of the largest slope
    assert np.abs(rough - slope * sd).max() <= 1e-4 * np.abs(rough).max()


def test_readings_off_the_states_take_the_way_by_sensitivities(problem):
    base = problem.base.copy()
    base[problem.model.index["point_x"]] = 12.0  # positions are read 12 m ahead of the origin
    shifted = replace(problem, base=base)
    assert not shifted._direct
    z = problem.start * (1 + 1e-3 * np.arange(problem.start.size))
    resid, jac = shifted.jacobian(z)
    data = resid.size - shifted.prior(z)[0].size
    expected = jac[:data].T @ resid[:data]

    def slope(i, readings):
        run = shifted.runs[i]
        return run.residuals(readings.copy()) / run.sigma

    assert reading_gradient(shifted, z, slope) == pytest.approx(expected, rel=1e-9)


def test_outside_the_bounds_and_for_other_settings_there_is_no_slope(problem):
    density = trial_density(problem, problem.start)
    q = density.laplace.mode.copy()
    q[0] = problem.high[0] + 1.0
    assert GradientTrialDensity(density).log_prob_slope(q)[0] == -np.inf
    for choice in (SamplingSettings(memory="ar1"), SamplingSettings(noise="marginal", initial="sampled")):
        with pytest.raises(SampleError, match="ensembles"):
            GradientTrialDensity(trial_density(problem, problem.start, choice))


@pytest.mark.parametrize("choice", [SamplingSettings(), SamplingSettings(memory="ar1", initial="sampled")])
def test_points_in_natural_units_go_back_to_their_sampling_coordinates(problem, choice):
    density = trial_density(problem, problem.start, choice)
    sd = np.sqrt(np.diag(density.laplace.covariance))
    q = density.laplace.mode + 0.5 * sd * np.random.default_rng(5).standard_normal((3, 2, sd.size))
    assert density.coordinates(density.natural(q)) == pytest.approx(q, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_both_samplers_find_the_same_posterior(problem):
    pytest.importorskip("nutpie")
    density = trial_density(problem, fit(problem).z)
    one = sample(density, density.laplace, SamplerOptions(seed=1))
    two = sample_nuts(GradientTrialDensity(density), density.laplace, NutsOptions(seed=1))
    assert one.converged and two.converged, (one.convergence.reasons, two.convergence.reasons)
    # means apart by their Monte Carlo errors: ten differences below 4 sigma miss once in 1600 seeds
    error = one.sd * np.sqrt(1 / one.convergence.ess_bulk + 1 / two.convergence.ess_bulk)
    assert (np.abs(one.mean - two.mean) < 4 * error).all()
    # standard deviations: relative error of each about 1 / sqrt(2 ESS)
    spread = np.sqrt(0.5 / one.convergence.ess_tail + 0.5 / two.convergence.ess_tail)
    assert (np.abs(np.log(one.sd / two.sd)) < 4.5 * spread).all()
