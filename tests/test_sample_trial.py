"""The posterior density of a trial against dense Gaussian algebra, quadrature and scipy's distributions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import invgamma, lognorm, multivariate_normal, norm
from scipy.stats import t as student_t

from bayesid.equations.model import build_model
from bayesid.errors import SampleError
from bayesid.estimation.output_error import FitProblem
from bayesid.estimation.run_data import RunData
from bayesid.estimation.sampling import Laplace, SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.priors import NoisePrior, ParameterPrior, draw_params, prior_moments
from bayesid.model.params import JointPrior, Parameter, ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start

DEG = math.pi / 180
NAMES = ("N_v", "N_r", "N_dr")
SIGMA = {"x": 2.0, "psi": 0.5 * DEG, "r": 0.02 * DEG}
FREE = {"u": 0.3, "psi": 2 * DEG}


def parameters(model, sd=0.1):
    entries = []
    for n in NAMES:
        v = float(model.nominal[model.index[n]])
        prior = Prior("normal", v, sd * abs(v))
        entries.append(Parameter(n, v, "free", v - 0.6 * abs(v), v + 0.6 * abs(v), abs(v), prior))
    return ParameterSet(tuple(entries))


@pytest.fixture(scope="module")
def problem():
    """Two short runs with a hole in one channel, and truth as estimate."""
    model = build_model(load_vehicle("generic_sub"), 3)
    params, x0 = parameters(model), steady_start(model, 90.0)
    where = [model.states.index(s) for s in FREE]
    sd, rng = np.array(list(FREE.values())), np.random.default_rng(4)
    runs = []
    for name, side in (("port", 1.0), ("starboard", -1.0)):
        times = np.arange(0.0, 100.1, 5.0)
        inputs = {"delta_r_cmd": side * 15 * DEG * (times > 10), "n_cmd": np.full(times.size, 90.0)}
        plan = plan_run(model, times, inputs, max_step=2.5)
        start = x0.copy()
        start[where] += sd * rng.standard_normal(2)
        states = simulate(model, model.nominal, plan, start).states
        readings = states[:, [model.states.index(c) for c in SIGMA]]
        readings = readings + np.array(list(SIGMA.values())) * rng.standard_normal(readings.shape)
        readings[4:6, 1] = np.nan
        runs.append(
            RunData(name, plan, tuple(SIGMA), readings, np.array(list(SIGMA.values())), x0, tuple(FREE), sd)
        )
    return FitProblem(model, params, tuple(runs), np.array(model.nominal))


def estimate(problem):
    """Unknowns after two Gauss-Newton steps."""
    z = np.array(problem.start)
    for _ in range(2):
        resid, jac = problem.jacobian(z)
        z -= np.linalg.lstsq(jac * problem.scale, resid, rcond=None)[0] * problem.scale
    return z


def points(problem, count=5):
    """Vectors of unknowns near the start, parameters first."""
    rng = np.random.default_rng(1)
    z = np.repeat(problem.start[None], count, axis=0)
    z[:, :3] *= 1 + 0.05 * rng.standard_normal((count, 3))
    return z


def dense(problem, z_all, z, sigma, correlation=0.0):
    """Log density of all readings at parameters z, initial states integrated out, linear about z_all."""
    total = 0.0
    _, jac = problem.jacobian(z_all)
    moved = np.concatenate([z[:3], z_all[3:]])
    resid = problem.residuals(moved)
    row, column = 0, 3
    for run in problem.runs:
        n, c = run.readings.shape
        r = (resid[row : row + n * c].reshape(n, c) * run.sigma).T.ravel()
        j = (jac[row : row + n * c, column : column + 2].reshape(n, c, 2) * run.sigma[:, None]).transpose(
            1, 0, 2
        )
        j, keep = j.reshape(-1, 2), np.isfinite(run.readings).T.ravel()
        lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
        noise = np.kron(np.diag(np.asarray(sigma) ** 2), correlation**lag if correlation else np.eye(n))
        offset = problem.start[column : column + 2] - z_all[column : column + 2]
        covariance = noise + j @ np.diag(run.initial_sd**2) @ j.T
        unit = np.repeat(sigma, n)[keep]  # metres and radians apart would look singular
        scaled = covariance[np.ix_(keep, keep)] / np.outer(unit, unit)
        total += multivariate_normal.logpdf((r + j @ offset)[keep] / unit, cov=scaled) - np.log(unit).sum()
        row, column = row + n * c, column + 2
    return total


def test_initial_states_are_integrated_out_as_dense_gaussian_algebra_does(problem):
    z = np.array(problem.start)
    z[3:] += [0.1, 0.01, -0.2, 0.02]
    density = trial_density(problem, z, SamplingSettings(memory="ignore"))
    sigma = np.array([[1.5, 0.4 * DEG, 0.03 * DEG]])
    for row in points(problem):
        v = np.concatenate([row[None, :3], sigma], axis=1)
        expected = dense(problem, z, row, sigma[0])
        assert density.log_likelihood(v)[0] == pytest.approx(expected, rel=1e-9)


def test_autoregressive_noise_is_that_of_a_dense_covariance(problem):
    whole = replace(problem, runs=tuple(replace(r, readings=filled(r.readings)) for r in problem.runs))
    density = trial_density(whole, problem.start, SamplingSettings(memory="ar1"))
    sigma, phi = np.array([1.5, 0.4 * DEG, 0.03 * DEG]), 0.6
    for row in points(problem, 3):
        v = np.concatenate([row[:3], sigma, np.full(3, phi)])[None]
        assert density.log_likelihood(v)[0] == pytest.approx(
            dense(whole, problem.start, row, sigma, phi), rel=1e-9
        )


def filled(readings):
    """Holes closed: the dense form knows no restart after one."""
    out = readings.copy()
    out[4:6, 1] = np.interp([4, 5], [3, 6], [out[3, 1], out[6, 1]])
    return out


def test_fixed_noise_and_states_leave_the_cost_of_the_fit(problem):
    choice = SamplingSettings(noise="fixed", initial="fixed", memory="ignore")
    density = trial_density(problem, problem.start, choice)
    z = points(problem)
    own = density.log_prob(density.laplace.mode + (z[:, :3] - problem.start[:3]))
    cost = np.array([problem.cost(one) for one in z])
    assert own - own[0] == pytest.approx(-(cost - cost[0]), rel=1e-8, abs=1e-8)


def test_sampled_initial_states_are_the_costs_own_unknowns(problem):
    choice = SamplingSettings(noise="fixed", initial="sampled", memory="ignore")
    density = trial_density(problem, problem.start, choice)
    assert density.unknowns.names == problem.names
    z = points(problem)
    z[:, 3:] += 0.01 * np.random.default_rng(2).standard_normal((5, 4))
    own, cost = density.log_prob(z), np.array([problem.cost(one) for one in z])
    assert own - own[0] == pytest.approx(-(cost - cost[0]), rel=1e-8, abs=1e-8)


def test_marginal_noise_is_the_integral_over_sampled_noise(problem):
    runs = [replace(r, readings=r.readings[:, :1], channels=("x",), sigma=r.sigma[:1]) for r in problem.runs]
    one = replace(problem, runs=tuple(runs))
    fixed = SamplingSettings(initial="fixed", memory="ignore")
    sampled = trial_density(one, problem.start, fixed)
    marginal = trial_density(one, problem.start, replace(fixed, noise="marginal"))
    row = points(problem)[1, :3]

    def integrand(s):
        v = np.append(row, s)[None]
        return math.exp(sampled.log_likelihood(v)[0] + sampled.noise_prior.log(v[:, 3:])[0] - peak)

    peak = marginal.log_likelihood(row[None])[0]
    assert quad(integrand, 0.2, 100, points=[2.0, 5.0, 20.0], limit=400)[0] == pytest.approx(1.0, rel=1e-5)


def test_student_noise_is_scipys(problem):
    choice = SamplingSettings(noise="fixed", initial="fixed", memory="ignore", student=4.0)
    density = trial_density(problem, problem.start, choice)
    z = points(problem)[2]
    expected = 0.0
    for run, simulated in zip(problem.runs, problem.readings(z), strict=True):
        logs = student_t.logpdf(simulated - run.readings, 4.0, scale=run.sigma)
        expected += np.nansum(logs)
    assert density.log_likelihood(z[None, :3])[0] == pytest.approx(expected, rel=1e-10)


def test_persistent_residuals_count_for_fewer_readings_and_white_ones_for_all(problem):
    white = trial_density(problem, estimate(problem))
    assert {c.tau for row in white.data for c in row} == {1.0}
    drift = 3.0 * np.sin(np.linspace(0, 3, problem.runs[0].plan.t.size))
    added = SIGMA["x"] * np.stack([drift, 0 * drift, 0 * drift], axis=1)
    off = replace(problem, runs=tuple(replace(r, readings=r.readings + added) for r in problem.runs))
    density = trial_density(off, estimate(problem))
    assert all(row[0].tau > 3 for row in density.data)
    blind = trial_density(off, estimate(problem), SamplingSettings(memory="ignore"))
    assert np.all(np.diag(density.laplace.covariance)[:3] > np.diag(blind.laplace.covariance)[:3])


def test_a_turn_more_or_less_in_the_heading_changes_nothing(problem):
    turned = [np.array(r.readings) for r in problem.runs]
    for readings in turned:
        readings[:, 1] += 2 * np.pi
    runs = tuple(replace(r, readings=y) for r, y in zip(problem.runs, turned, strict=True))
    a = trial_density(problem, problem.start).log_prob
    b = trial_density(replace(problem, runs=runs), problem.start).log_prob
    q = trial_density(problem, problem.start).laplace.points(
        0.5 * np.random.default_rng(0).standard_normal((4, 6))
    )
    assert a(q) == pytest.approx(b(q), rel=1e-9)


def test_outside_the_bounds_is_impossible_and_a_diverging_vehicle_is_not_a_number(problem):
    wild = ParameterSet(tuple(replace(p, low=-1e30, high=1e30) for p in problem.params))
    density = trial_density(problem.with_params(wild), problem.start)
    inside = trial_density(problem, problem.start)
    q = np.repeat(density.laplace.mode[None], 2, axis=0)
    q[1, :3] = [1e25, 1e25, 1e25]
    values = density.log_prob(q)
    assert np.isfinite(values[0]) and np.isnan(values[1])
    assert np.isneginf(inside.log_prob(q)[1])


def test_a_tied_parameter_moves_with_the_one_it_is_tied_to(problem):
    model = problem.model
    free = problem.params["N_r"]
    tied = ParameterSet((free, Parameter("N_v", 0.5 * free.start, "tied", tie=("N_r", 0.5, 0.0))))
    density = trial_density(replace(problem, params=tied), np.concatenate([[free.start], problem.start[3:]]))
    both = ParameterSet((free, replace(problem.params["N_v"], start=0.5 * free.start, low=-1e30, high=1e30)))
    recovery = trial_density(
        replace(problem, params=both), np.concatenate([[free.start, 0.5 * free.start], problem.start[3:]])
    )
    noise = np.array([list(SIGMA.values())])
    x = 1.03 * free.start
    pair = np.concatenate([[[x, 0.5 * x]], noise], axis=1)
    assert density.log_likelihood(np.concatenate([[[x]], noise], axis=1)) == pytest.approx(
        recovery.log_likelihood(pair), rel=1e-12
    )
    assert model.nominal[model.index["N_v"]] != 0.5 * free.start


def test_priors_are_scipys_densities():
    names, rng = ("a", "b", "c", "d", "e"), np.random.default_rng(0)
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]])
    entries = (
        Parameter("a", 1.0, low=-50.0, high=50.0, prior=Prior("normal", 1.0, 3.0)),
        Parameter("b", -2.0, low=-90.0, high=-1e-9, prior=Prior("lognormal", -2.0, 0.5)),
        Parameter("c", 0.0, low=-1.0, high=4.0),
        Parameter("d", 0.0, low=-60.0, high=60.0),
        Parameter("e", 0.0, low=-60.0, high=60.0),
    )
    params = ParameterSet(entries, JointPrior(("d", "e"), np.zeros(2), covariance))
    assert params.names == names
    one, two, three = rng.normal(size=6), -rng.lognormal(size=6), rng.uniform(-1, 4, 6)
    x = np.column_stack([one, two, three, rng.normal(size=(6, 2))])
    expected = (
        norm.logpdf(x[:, 0], 1, 3) + lognorm.logpdf(-x[:, 1], 0.5, scale=2.0) - np.log(5)
        + multivariate_normal.logpdf(x[:, 3:], cov=covariance)
    )  # fmt: skip
    assert ParameterPrior(params).log(x) == pytest.approx(expected, rel=1e-10)
    assert np.isneginf(ParameterPrior(params).log(np.where(np.arange(5) == 2, 9.0, x))).all()
    draws = draw_params(params, 20_000, rng)
    mean, sd = prior_moments(params)
    assert draws.mean(axis=0) == pytest.approx(mean, abs=0.1)
    assert draws.std(axis=0) == pytest.approx(sd, rel=0.05)
    assert np.corrcoef(draws[:, 3:].T)[0, 1] == pytest.approx(1 / math.sqrt(8), abs=0.03)


@pytest.mark.parametrize("kind", ["inverse_gamma", "half_normal"])
def test_the_noise_prior_is_a_density_with_the_moments_and_the_mode_it_states(kind):
    prior = NoisePrior(kind, np.array([0.2]), weight=8.0, reach=2.0)

    def density(s):
        return math.exp(prior.log(np.array([[s]]))[0])

    assert quad(density, 0, 20, points=[0.2, 1.0], limit=200)[0] == pytest.approx(1.0, rel=1e-6)
    mean, sd = prior.moments()
    assert quad(lambda s: s * density(s), 0, 50, points=[0.2, 1.0], limit=200)[0] == pytest.approx(
        mean[0], rel=1e-5
    )
    draws = prior.draw(40_000, np.random.default_rng(0))
    assert draws.mean() == pytest.approx(mean[0], rel=0.02)
    assert draws.std() == pytest.approx(sd[0], rel=0.1)
    if kind == "inverse_gamma":
        s = 0.17
        assert density(s) == pytest.approx(2 * s * invgamma.pdf(s * s, 4.0, scale=4.0 * 0.04), rel=1e-9)
    squares, count = np.array([3.0]), np.array([40.0])
    mode = prior.mode_of(squares, count)[0]
    grid = np.linspace(0.5, 2.0, 3001) * mode
    logs = prior.log(grid[:, None]) + np.log(grid) - count * np.log(grid) - squares / (2 * grid**2)
    assert grid[np.argmax(logs)] == pytest.approx(mode, rel=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [dict(noise="marginal"), dict(student=4.0), dict(student=-1.0, initial="fixed"),
     dict(noise="marginal", initial="fixed", noise_prior="half_normal")],
)  # fmt: skip
def test_settings_that_exclude_each_other_are_refused(wrong):
    with pytest.raises(SampleError):
        SamplingSettings(**wrong)


@pytest.mark.thorough
def test_the_sampled_posterior_of_a_nearly_linear_trial_is_its_closed_form(problem):
    """Fixed noise and tight priors leave a linear-Gaussian problem, solved by normal equations."""
    tight = problem.with_params(parameters(problem.model, sd=0.003))
    z = np.array(problem.start)
    resid, jac = tight.jacobian(z)
    step = -np.linalg.lstsq(jac * tight.scale, resid, rcond=None)[0] * tight.scale
    scaled = jac * tight.scale
    covariance = np.linalg.inv(scaled.T @ scaled) * np.outer(tight.scale, tight.scale)
    density = trial_density(tight, z + step, SamplingSettings(noise="fixed", memory="ignore"))
    assert isinstance(density.laplace, Laplace)
    found = sample(density, density.laplace, SamplerOptions(first=60, max_steps=2000, seed=2))
    assert found.converged, found.convergence.reasons
    sd, ess = np.sqrt(np.diag(covariance)[:3]), found.convergence.ess_bulk
    # 0.02: the second-order change of a track over 0.3 % of a coefficient, in posterior sd
    assert np.all(np.abs(found.mean - (z + step)[:3]) < sd * (4.5 / np.sqrt(ess) + 0.02))
    assert np.all(np.abs(found.sd / sd - 1) < 4.5 / np.sqrt(ess) + 0.01)
    correlation = covariance[:3, :3] / np.outer(sd, sd)
    assert np.allclose(found.covariance / np.outer(found.sd, found.sd), correlation, atol=0.06)


def test_a_start_that_an_unstable_vehicle_magnifies_beyond_rounding_is_refused(problem):
    model, x0 = problem.model, steady_start(problem.model, 90.0)
    times = np.arange(0.0, 600.1, 5.0)
    plan = plan_run(model, times, {"delta_r_cmd": 0 * times, "n_cmd": 0 * times + 90.0}, max_step=2.5)
    states = simulate(model, model.nominal, plan, x0).states
    readings = states[:, [model.states.index(c) for c in SIGMA]]
    ahead = replace(problem.runs[0], plan=plan, readings=readings, initial_sd=np.array([0.1, 0.01]))
    ahead = replace(ahead, name="ahead", initial=("v", "r"))
    straight = replace(problem, runs=(ahead,))
    z = np.array(straight.start)
    assert trial_density(straight, z).laplace.mode.size  # as built the vehicle keeps its course
    z[:3] *= np.array([4.0, 0.3, 1.0])
    with pytest.raises(SampleError, match=r"ahead: .* grows .* times; the vehicle is unstable .* --pieces"):
        trial_density(straight, z)
    assert trial_density(straight, z, SamplingSettings(initial="fixed")).laplace.mode.size
