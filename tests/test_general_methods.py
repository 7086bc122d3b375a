"""Two general methods beside the diagnosis: their statistics against closed forms and another program."""

import json
import re

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial
from scipy.special import digamma, polygamma
from scipy.stats import chi2

from bayesid.benchmark.general_methods.distortions import (
    Bank,
    Projection,
    gains_of,
    global_test,
    probability_of_none,
    root_of,
)
from bayesid.benchmark.general_methods.quantile_process import beta_of, quantiles, risks
from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.benchmark.protocol.make_pack import commit_pack, write_answer
from bayesid.benchmark.protocol.solve_pack import SolveSettings, solve_pack
from bayesid.cli.main import run as cli
from bayesid.model.vehicles import write_vehicle
from bayesid.progress import Progress
from bayesid.trials import write_trial

QUIET = Progress(quiet=True)


def dense(rng, runs=2, samples=60, coefs=3, pulses=5):
    """Whitened columns of runs: coefficients, one cause of two parameters, pulses of this run."""
    return [rng.standard_normal((samples, coefs + 2 + pulses)) * 0.4 for _ in range(runs)]


def bank_from(columns, residuals, coefs=3):
    products, scores = [c.T @ c for c in columns], [c.T @ e for c, e in zip(columns, residuals, strict=True)]
    places = tuple(tuple(("u", i, i + 1) for i in range(c.shape[1] - coefs - 2)) for c in columns)
    cause = (("thrust_loss", np.arange(coefs, coefs + 2)),)
    return Bank(tuple(products), tuple(scores), coefs, coefs + 2, cause, places)


def null_residuals(columns, rng, coefs=3):
    z = rng.standard_normal(coefs)
    return [c[:, :coefs] @ z + rng.standard_normal(c.shape[0]) for c in columns]


def test_local_statistics_are_gains_in_likelihood_with_coefficients_integrated():
    rng = np.random.default_rng(1)
    columns = dense(rng)
    residuals = null_residuals(columns, rng)
    t = Projection(bank_from(columns, residuals)).statistics(
        [x[None] for x in bank_from(columns, residuals).scores]
    )[0]
    whole, e = np.concatenate(columns), np.concatenate(residuals)
    weight = np.linalg.inv(np.eye(e.size) + whole[:, :3] @ whole[:, :3].T)
    n = columns[0].shape[0]
    pulse = np.r_[np.zeros(n), columns[1][:, 7]]  # the third pulse of the second run
    assert t[1 + 5 + 2] == pytest.approx((pulse @ weight @ e) ** 2 / (pulse @ weight @ pulse), rel=1e-9)
    cause = whole[:, 3:5]
    b = cause.T @ weight @ e
    assert t[0] == pytest.approx(b @ np.linalg.solve(cause.T @ weight @ cause, b), rel=1e-9)


@pytest.mark.thorough
def test_global_p_values_of_data_without_a_gap_are_uniform_and_a_pulse_is_found(monkeypatch):
    monkeypatch.setattr("bayesid.benchmark.general_methods.distortions.NULL_DRAWS", 1000)
    rng = np.random.default_rng(2)
    columns = dense(rng)
    found = np.sort(
        [global_test(bank_from(columns, null_residuals(columns, rng)), k).p_global for k in range(60)]
    )
    distance = np.abs(found - (np.arange(60) + 0.5) / 60).max()
    assert distance < 0.21  # Kolmogorov at 1 %
    residuals = null_residuals(columns, rng)
    residuals[0] = residuals[0] + 3.0 * columns[0][:, 6]
    loud = global_test(bank_from(columns, residuals), 0)
    assert loud.p_global < 0.005 and int(np.argmin(loud.log_p)) == 2


def test_likelihood_ratio_of_a_cause_is_that_of_two_normal_densities():
    rng = np.random.default_rng(3)
    columns = dense(rng)
    residuals = null_residuals(columns, rng)
    gains = gains_of([bank_from(columns, residuals)])
    whole, e = np.concatenate(columns), np.concatenate(residuals)

    def log_density(k):
        cov = np.eye(e.size) + whole[:, :k] @ whole[:, :k].T
        return -0.5 * e @ np.linalg.solve(cov, e) - 0.5 * np.linalg.slogdet(cov)[1]

    assert gains["thrust_loss"] == pytest.approx(log_density(5) - log_density(3), abs=1e-8)
    assert "outside" in gains


def test_root_of_a_singular_matrix_and_what_a_p_value_leaves():
    a = np.array([[4.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(root_of(a) @ root_of(a).T, a, atol=1e-12)
    assert probability_of_none(0.7) == 0.5
    assert probability_of_none(0.01) == pytest.approx(0.1113, abs=1e-4)  # 1 / (1 + 1 / (-e p ln p))


def test_beta_variables_have_the_centre_and_metric_variance_asked_for():
    ratio, variance = np.array([1.0, 0.2, 30.0, 5.0, 1e3, 1e-3]), np.array([0.5, 3.0, 1e-3, 200.0, 1e-7, 9e3])
    a, b = beta_of(ratio, variance)
    np.testing.assert_allclose(digamma(a) - digamma(b), np.log(ratio), atol=1e-7)
    np.testing.assert_allclose(polygamma(1, a) + polygamma(1, b), variance, rtol=1e-7)


def test_risk_is_certain_without_a_discrepancy():
    losses = 0.5 * chi2.ppf((np.arange(400) + 0.5) / 400, 1)
    drawn = risks(losses, losses, 1.0, np.random.default_rng(0), 8)
    assert np.ptp(drawn) < 1e-12
    grid, q = quantiles(losses)
    assert np.all(np.diff(q) >= 0) and drawn[0] == pytest.approx(np.trapezoid(q, grid), rel=0.02)


@pytest.mark.parametrize(
    ("c", "mean", "sd"), [(0.25, 0.7162, 0.1019), (1.0, 0.7419, 0.1998), (4.0, 0.8995, 0.4427)]
)
def test_risks_are_those_of_the_program_of_the_authors(c, mean, sd):
    # emdcmp 1.1.1, 300 paths of 2^7 increments: means to 6, deviations to 4 % (one standard error)
    own = 0.5 * chi2.ppf((np.arange(400) + 0.5) / 400, 1)
    drawn = risks(1.3 * own + 0.05, own, c, np.random.default_rng(0), 4000)
    assert drawn.mean() == pytest.approx(mean, abs=3.0 * sd / np.sqrt(300))
    assert drawn.std() == pytest.approx(sd, rel=0.12)


@pytest.mark.thorough
def test_other_methods_answer_a_pack_and_are_scored_beside_each_other(tmp_path, capsys):
    model = model_of("remus100")
    trial = planted_trial(model, other_vehicle(model, 11), seed=11, holdout=("turn",))
    pack, answers = tmp_path / "pack", tmp_path / "answers"
    write_trial(trial, pack / "pond", schema=False)
    write_vehicle(model.vehicle, pack / "pond" / "vehicle.toml", schema=False)
    toml = pack / "pond" / "trial.toml"
    toml.write_text(re.sub("vehicle = .*", 'vehicle = "vehicle.toml"', toml.read_text()))
    told = {"name": "pond", "kind": "none", "effects": [], "vehicle": "remus100", "dof": 3, "sensors": "full"}
    told |= {"campaign": "rich", "prior_relative_sd": 0.05, "environment": {"sea": "still"}}
    write_answer(answers / "pond.json", told | {"coefficient_draw_relative": {}})
    commit_pack(pack, answers, ["pond"])
    for method in ("distortions", "reproducibility"):
        done = solve_pack(pack, tmp_path / method, settings=SolveSettings(method=method), progress=QUIET)
        assert done["mode"].startswith(f"method {method}, ") and not done["failures"]
        verdict = json.loads((tmp_path / method / "pond" / "diagnosis.json").read_text())
        assert verdict["verdict"] == "none" and verdict["method"]["name"] == method
        assert sum(verdict["probabilities"].values()) == pytest.approx(1.0)
    with pytest.raises(BlindError, match="no method 'guessing'; there are diagnosis, distortions"):
        solve_pack(pack, tmp_path / "x", settings=SolveSettings(method="guessing"), progress=QUIET)
    one, other = str(tmp_path / "distortions"), str(tmp_path / "reproducibility")
    assert cli(["blind", "score", str(answers), one, "--beside", other, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["beside"]
    assert [r["method"] for r in rows] == ["distortions", "reproducibility"]
    assert all(r["false-alarm rate"] == [0, 1] for r in rows)
    assert cli(["blind", "score", str(answers), one, "--beside", one]) != 0
    assert "as another folder does" in capsys.readouterr().err
