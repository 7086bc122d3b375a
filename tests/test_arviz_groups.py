"""posterior.nc for ArviZ: the check's own R-hat, log likelihoods that add up, bands that cover."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import arviz
import numpy as np
import pytest

import bayesid
from bayesid.api.planning import reference_scale
from bayesid.equations.model import build_model
from bayesid.errors import SampleError
from bayesid.estimation.sampling import SamplingSettings, load_posterior, trial_density
from bayesid.estimation.sampling.arviz_groups import log_likelihood_of_runs
from bayesid.estimation.sampling.posterior import stored_name
from bayesid.estimation.sampling.predictive_noise import sensor_noise
from bayesid.manoeuvres import parse
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "r": 0.0005}
MODEL = build_model(load_vehicle("generic_sub"), 3)


@pytest.fixture(scope="module")
def trial():
    coarse = replace(reference_scale(MODEL), dt=4.0)
    runs = {t: parse(t, coarse) for t in ("turn:25,duration=200", "zigzag:20/20,duration=200")}
    return virtual_trial(
        MODEL, MODEL.nominal, runs, title="two runs", vehicle_ref="generic_sub", noise=NOISE,
        rng=np.random.default_rng(1),
    )  # fmt: skip


@pytest.fixture(scope="module")
def sampled(trial, tmp_path_factory):
    return bayesid.sample(
        trial, tmp_path_factory.mktemp("sampled"), free="N_v,N_r,N_dr", prior=0.2, memory="inflate", seed=3,
        ensembles=2,
    )  # fmt: skip


def group(data, name):
    return data[name].dataset if hasattr(data[name], "dataset") else data[name]


@pytest.mark.thorough
def test_arviz_gives_the_r_hat_and_about_the_effective_size_of_the_check(sampled):
    found = sampled.posterior
    assert found.converged
    data = sampled.to_xarray()
    by_arviz = arviz.rhat(data), arviz.ess(data)
    for i, name in enumerate(found.names):
        assert float(group_or(by_arviz[0], name)) == pytest.approx(found.convergence.rhat[i], abs=2e-3)
        ratio = float(group_or(by_arviz[1], name)) / found.convergence.ess_bulk[i]
        assert (
            0.5 < ratio < 2.0
        )  # draws taken walker by walker for one time series would be 10 times too many


def group_or(found, name):
    inner = found["posterior"] if "posterior" in getattr(found, "children", ()) else found
    return inner[name]


@pytest.mark.thorough
def test_draws_come_back_from_the_file_in_their_places(sampled):
    again = load_posterior(sampled.out / "posterior.nc")
    assert np.array_equal(again.draws, sampled.posterior.draws)
    assert np.array_equal(again.log_prob, sampled.posterior.log_prob)


def test_the_file_has_every_group_and_readings_lie_within_what_is_predicted(sampled):
    data = sampled.to_xarray()
    read, told = (group(data, n) for n in ("observed_data", "posterior_predictive"))
    before = group(data, "prior_predictive")
    inside, width, wide = [], [], []
    for name in (stored_name(f"{run.name}:{c}") for run in sampled.found.problem.runs for c in NOISE):
        values = told[name].values.reshape(200, -1)
        low, high = np.quantile(values, [0.05, 0.95], axis=0)
        inside.append(np.mean((read[name].values >= low) & (read[name].values <= high)))
        width.append(np.median(high - low))
        wide.append(np.median(np.ptp(before[name].values.reshape(200, -1), axis=0)))
    assert 0.8 < np.mean(inside) < 0.97  # 90 % bands
    assert np.mean(np.array(wide) > np.array(width)) > 0.7
    prior = group(data, "prior")
    assert float(prior["N_v"].std()) == pytest.approx(0.2 * abs(MODEL.nominal[MODEL.index["N_v"]]), rel=0.1)
    assert float(group(data, "constant_data")["estimate"][0]) == sampled.view.estimate[0]


def test_every_variable_has_its_unit(sampled):
    data = sampled.to_xarray()
    for name in ("posterior", "prior", "observed_data", "posterior_predictive", "prior_predictive",
                 "log_likelihood", "constant_data", "sample_stats"):  # fmt: skip
        found = group(data, name)
        assert all(v.attrs.get("units") for v in found.data_vars.values()), name
        assert all(found[c].attrs["units"] == "s" for c in found.coords if c.startswith("t_"))
    posterior = group(data, "posterior")
    assert posterior["N_v"].attrs["units"] == "kg"  # N m over m^2/s^2
    assert posterior["N_dr"].attrs["units"] == "kg"
    assert posterior[stored_name("sigma:x")].attrs["units"] == "m"


def noise_of(trial, sampled, settings, point):
    """(4000, n) predictive noise of psi of the first run at one value of level and correlation."""
    density = trial_density(sampled.found.problem, sampled.found.fit.z, settings, trial.noise)
    v = np.tile(density.natural(density.laplace.mode), (4000, 1))
    for i, name in enumerate(density.unknowns.names):
        v[:, i] = point.get(name, v[0, i])
    run, row = density.problem.runs[0], density.data[0]
    return sensor_noise(density, v, run, run.channels.index("psi"), row, np.random.default_rng(0))


def test_noise_that_remembers_is_predicted_with_its_memory(sampled, trial):
    """First-order autoregression: correlation phi^k at k readings, the level of every reading unchanged."""
    noise = noise_of(trial, sampled, SamplingSettings(memory="ar1"), {"phi:psi": 0.8, "sigma:psi": 0.01})
    far = np.corrcoef(noise[:, 30], noise[:, 33])[0, 1]
    assert far == pytest.approx(0.8**3, abs=4 * (1 - 0.8**6) / np.sqrt(4000))
    assert noise.std(axis=0) == pytest.approx(0.01, rel=0.06)  # sd of an sd of 4000: 1.1 %
    white = noise_of(trial, sampled, SamplingSettings(memory="ignore"), {"sigma:psi": 0.01})
    assert abs(np.corrcoef(white[:, 30], white[:, 33])[0, 1]) < 4 / np.sqrt(4000)


def test_outliers_are_predicted_where_the_noise_has_them(sampled, trial):
    """Student-t of 4 degrees of freedom exceeds 5 levels in 0.75 % of the readings, a normal never here."""
    settings = SamplingSettings(memory="ignore", student=4.0, initial="fixed")
    noise = noise_of(trial, sampled, settings, {"sigma:psi": 0.01})
    share = np.mean(np.abs(noise) > 0.05)
    assert share == pytest.approx(0.00749, rel=0.1)  # 2 (1 - F_4(5)); 200 000 readings: sd 3 %


def test_log_likelihoods_of_runs_add_up_to_that_of_all(sampled, trial):
    v = sampled.posterior.subset(20, np.random.default_rng(0))
    for initial in ("marginal", "sampled", "fixed"):
        density = trial_density(
            sampled.found.problem, sampled.found.fit.z, SamplingSettings(initial=initial), trial.noise
        )
        extra = density.z[density._initial]
        point = np.hstack([v[:, :3], np.tile(extra, (20, 1)), v[:, 3:]])
        apart = log_likelihood_of_runs(density, point)
        assert apart.shape == (20, 2)
        assert np.allclose(apart.sum(axis=1), density.log_likelihood(point), rtol=1e-10)


def test_one_run_left_out_by_importance_sampling(sampled, trial):
    found = sampled.leave_one_run_out()
    whole = group(sampled.to_xarray(), "log_likelihood")["runs"].values.sum(axis=-1).mean()
    elpd = float(getattr(found, "elpd_loo", None) or found.elpd)
    assert elpd < whole  # a run is predicted worse from the other than from both
    assert elpd > whole - 50.0


@pytest.mark.thorough
def test_no_leaving_out_where_the_likelihood_is_no_sum_over_runs(trial, tmp_path):
    short = bayesid.sample(
        trial, tmp_path, free="N_v,N_r", prior=0.2, noise="marginal", initial="fixed", memory="ignore",
        quick=True, ensembles=2, max_steps=20,
    )  # fmt: skip
    with pytest.raises(SampleError, match="no sum over runs"):
        short.leave_one_run_out()


@pytest.mark.slow
def test_both_samplers_give_one_posterior(sampled, trial, tmp_path):
    pytest.importorskip("nutpie")
    other = bayesid.sample(
        trial, tmp_path, free="N_v,N_r,N_dr", prior=0.2, memory="inflate", sampler="nuts", seed=4
    )
    assert other.posterior.converged
    assert "along slopes" in other.summary()
    assert other.save(tmp_path).exists()
    a, b = sampled.posterior, other.posterior
    error = a.sd * np.sqrt(1 / a.convergence.ess_bulk + 1 / b.convergence.ess_bulk)
    assert np.all(np.abs(a.mean - b.mean) < 4.5 * error)
    assert np.allclose(b.sd / a.sd, 1.0, atol=0.12)


def test_the_gradient_sampler_has_nothing_to_resume(trial, tmp_path):
    with pytest.raises(SampleError, match="nothing to resume"):
        bayesid.sample(trial, tmp_path, sampler="nuts", resume=True)
    assert not any(tmp_path.iterdir())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "line", ["from bayesid.estimation.sampling.arviz_import import arviz; arviz()", "import arviz"]
)
def test_a_user_is_not_told_of_the_next_version_of_arviz(tmp_path, line):
    """0.23 announces it once a day; as an error where bayesid does not take it away."""
    place = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-W", "error::FutureWarning", "-c", line], env=place, capture_output=True
    )
    announced = b"major refactor" in done.stderr
    assert announced == (line == "import arviz" and arviz.__version__.startswith("0.23"))
