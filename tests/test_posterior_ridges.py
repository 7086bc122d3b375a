"""Ridges and the influence of the prior from draws, against Gaussian posteriors known in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.analysis.identifiability.posterior_ridges import ridges
from bayesid.analysis.identifiability.prior_influence import conflict, prior_sensitivity
from bayesid.estimation.sampling.chain_statistics import autocorrelation, ess_growth
from bayesid.report.sample_first_screen import COEFFICIENTS, coefficient_rows, group_words

NAMES = ("X_vv", "X_vr", "X_rr", "N_dr")
PRIOR_SD = np.array([2.0, 0.5, 30.0, 1.0])
STEADY = np.array([1.0, -1.0, 1.0, 0.0]) / np.sqrt(3)  # a steady turn sees one sum of v v, v r and r r


def posterior_of(rows, sd, count=40_000, seed=0):
    """Draws of the posterior of a linear trial that reads `rows` of coefficients in prior units with noise
    `sd`, prior standard normal; mean 0.
    """
    precision = np.eye(len(NAMES)) + np.asarray(rows).T @ np.asarray(rows) / sd**2
    covariance = np.linalg.inv(precision)
    root = np.linalg.cholesky(covariance)
    return np.random.default_rng(seed).standard_normal((count, len(NAMES))) @ root.T * PRIOR_SD, covariance


def test_a_steady_turn_fixes_one_combination_of_the_triple_and_leaves_two_open():
    draws, _ = posterior_of([STEADY, [0, 0, 0, 1.0]], 0.01)
    found = ridges(NAMES, draws, np.diag(PRIOR_SD**2))
    group = found.ridge
    assert group is not None and group.names == NAMES[:3] and group.family == "vv/vr/rr of X"
    assert abs(group.best.vector @ STEADY[:3]) == pytest.approx(1.0, abs=1e-4)
    assert (
        group.best.left == pytest.approx(0.01, rel=0.03) and group.best.status == "fixed"
    )  # 1/sqrt(1 + 1e4)
    assert [c.status for c in group.combinations[1:]] == ["open", "open"]
    assert all(c.left == pytest.approx(1.0, rel=0.03) for c in group.combinations[1:])
    assert sum(c.status == "fixed" for c in found.combinations) == 2  # the rudder row by itself too
    assert found.left[3] == pytest.approx(0.01, rel=0.03)
    assert np.all(found.left[:3] > 0.8)  # none of the triple is known by itself


def test_draws_of_the_prior_and_of_a_rich_trial_show_no_ridge():
    """The controls that must not show one."""
    for rows, status in (([[0, 0, 0, 0.0]], "open"), (np.eye(4), "fixed")):
        draws, _ = posterior_of(rows, 0.01)
        found = ridges(NAMES, draws, np.diag(PRIOR_SD**2))
        assert found.ridge is None
        assert {c.status for c in found.combinations} == {status}


def test_a_prior_that_ties_coefficients_is_not_taken_for_knowledge_of_the_runs():
    tied = np.array([[1.0, 0.99], [0.99, 1.0]])
    draws = np.random.default_rng(1).multivariate_normal([0, 0], tied, 40_000)
    found = ridges(("Y_v", "Y_r"), draws, tied)
    assert all(c.left == pytest.approx(1.0, rel=0.03) for c in found.combinations)


def test_coefficients_tied_across_families_are_a_group_of_their_own():
    """Two coefficients of correlation 0.99: known by their difference only."""
    rows = np.array([[1.0, 0.0, 0.0, -1.0]])
    draws, _ = posterior_of(rows / np.sqrt(2), 0.05)
    found = ridges(NAMES, draws, np.diag(PRIOR_SD**2))
    tied = [g for g in found.groups if not g.family]
    assert [set(g.names) for g in tied] == [{"X_vv", "N_dr"}]


def test_power_scaling_by_draws_is_its_closed_form():
    """Gaussian: share of the prior (C P C)_ii / C_ii; mean moves by -log 2 C P (m - m0) per doubling."""
    draws, covariance = posterior_of([STEADY, [0, 0, 0, 1.0]], 0.5, count=400_000)
    mean = np.array([0.3, -0.2, 0.5, 1.0])
    q = draws / PRIOR_SD + mean
    log_prior = -0.5 * np.sum(q**2, axis=1)
    shift, share = prior_sensitivity(q, log_prior)
    assert share == pytest.approx(np.sum(covariance**2, axis=0) / np.diag(covariance), abs=0.02)
    expected = -np.log(2) * covariance @ mean / np.sqrt(np.diag(covariance))
    assert shift == pytest.approx(expected, abs=0.02)
    assert np.isnan(prior_sensitivity(q, np.full(len(q), np.nan))).all()


def test_conflict_is_standard_normal_when_truths_come_from_the_prior_and_large_when_they_do_not():
    rng = np.random.default_rng(2)
    sd = 1 / np.sqrt(1 + 1 / 0.3**2)

    def estimates(truth):
        reading = truth + 0.3 * rng.standard_normal(truth.size)
        return sd**2 * reading / 0.3**2

    z = conflict(estimates(rng.standard_normal(20_000)), np.full(20_000, sd), np.zeros(1), np.ones(1))
    assert z.mean() == pytest.approx(0.0, abs=0.03) and z.std() == pytest.approx(1.0, abs=0.03)
    far = conflict(estimates(np.full(100, 5.0)), np.full(100, sd), np.zeros(1), np.ones(1))
    assert np.all(far > 3)
    unlearnt = conflict(np.array([0.0]), np.array([0.999]), np.zeros(1), np.ones(1))
    assert np.isnan(unlearnt).all()


def test_autocorrelation_of_an_autoregression_is_its_power():
    rng = np.random.default_rng(3)
    x = np.zeros((4, 2000, 32, 1))
    for i in range(1, 2000):
        x[:, i] = 0.8 * x[:, i - 1] + 0.6 * rng.standard_normal((4, 32, 1))
    assert autocorrelation(x, 6)[:, 0] == pytest.approx(0.8 ** np.arange(6), abs=0.02)
    steps, sizes = ess_growth(x)
    share = sizes[:, 0] / (steps * 4 * 32)
    assert share[2:] == pytest.approx(np.full(share.size - 2, 0.2 / 1.8), rel=0.15)  # (1 - phi) / (1 + phi)


def test_the_first_sentence_says_which_of_the_triple_is_known_by_itself():
    tight = np.array([0.0, 1.0, 0.0, 0.0])  # X_vr is read alone
    draws, _ = posterior_of([tight, [0, 0, 0, 1.0]], 0.01)
    found = ridges(NAMES, draws, np.diag(PRIOR_SD**2))
    group = next(g for g in found.groups if set(g.names) == set(NAMES[:3]))
    said = group_words(group, dict(zip(found.names, found.left.tolist(), strict=True)))
    assert (
        "Singly, X_vr is known (1 % of the prior left), X_vv and X_rr are not known (100 %, 100 %)." in said
    )
    assert "Singly" not in group_words(group)


def test_a_conflict_is_a_distance_and_a_pull_of_the_prior_counts_away_from_zero():
    """A coefficient of -2 that a doubled prior would move to -2.1, and one of 2 that it would move to 1.9."""
    posterior = SimpleNamespace(
        n_params=2, names=("N_r", "Y_r"), mean=(-2.0, 2.0), sd=(1.0, 1.0), prior_mean=(-5.0, 5.0),
        prior_sd=(1.0, 1.0),
    )  # fmt: skip
    view = SimpleNamespace(estimate=(-2.0, 2.0), conflict=(3.5, -3.5), shift=(-0.1, -0.1), share=(0.1, 0.1))
    rows = coefficient_rows(posterior, view, None)
    at = [COEFFICIENTS.index(name) for name in ("conflict", "prior twice [sd]")]
    assert [[row[i] for i in at] for row in rows] == [[3.5, 0.1], [3.5, -0.1]]
