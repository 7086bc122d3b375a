"""Normal hierarchy: its limits in closed form, what does not matter, changes found, none where none is."""

import numpy as np
import pytest

from bayesid.estimation.hierarchical_fit import fit_hierarchy
from bayesid.estimation.hierarchical_normal import (
    Information,
    group_posterior,
    information,
    log_evidence,
    mixed,
)

K = 5


def day(rng, truth, rows=15, sd=0.6):
    """Linear regression on a few readings: an exact Gaussian likelihood."""
    x = rng.standard_normal((rows, truth.size)) / sd
    y = x @ truth + rng.standard_normal(rows)
    return Information(x.T @ x, x.T @ y)


def days(seed, count=3, change=0.0, where=(1, 2), spread=0.0, k=K):
    rng = np.random.default_rng(seed)
    mu = rng.standard_normal(k)
    truths = mu + spread * rng.standard_normal((count, k))
    truths[where] += change
    return [day(rng, t) for t in truths], truths


def fit(groups, k=K):
    return fit_hierarchy(groups, np.ones(k), np.ones((len(groups), k)))


def test_without_spread_the_days_are_multiplied_and_with_much_they_are_apart():
    groups, _ = days(0)
    prior = np.linspace(0.5, 2.0, K)
    p = group_posterior(groups, prior, np.zeros(K))
    whole = np.linalg.inv(sum(g.precision for g in groups) + np.diag(prior**-2))
    np.testing.assert_allclose(p.covariance, whole, rtol=1e-10)
    np.testing.assert_allclose(p.mean, whole @ sum(g.score for g in groups), rtol=1e-10)
    np.testing.assert_allclose(p.groups, np.tile(p.mean, (3, 1)), rtol=1e-10)
    p = group_posterior(groups, prior, np.full(K, 1e10))
    for b, g in enumerate(groups):
        np.testing.assert_allclose(p.groups[b], np.linalg.solve(g.precision, g.score), rtol=1e-6)
        np.testing.assert_allclose(p.spread[:, b, b], np.diag(np.linalg.inv(g.precision)), rtol=1e-6)


def test_evidence_and_posterior_are_those_of_one_large_gaussian():
    """Written out as a joint normal of mu and all days, by dense matrices."""
    groups, _ = days(1)
    prior, variance = np.linspace(0.5, 2.0, K), np.linspace(0.01, 0.5, K)
    b = len(groups)
    joint = np.kron(np.ones((b, b)), np.diag(prior**2)) + np.kron(np.eye(b), np.diag(variance))
    precision = np.zeros((b * K, b * K))
    for i, g in enumerate(groups):
        precision[i * K : (i + 1) * K, i * K : (i + 1) * K] = g.precision
    score = np.concatenate([g.score for g in groups])
    covariance = np.linalg.inv(np.linalg.inv(joint) + precision)
    mean = covariance @ score
    p = group_posterior(groups, prior, variance)
    np.testing.assert_allclose(p.groups.ravel(), mean, rtol=1e-8)
    blocks = covariance.reshape(b, K, b, K)
    for j in range(K):
        np.testing.assert_allclose(p.spread[j], blocks[:, j, :, j], rtol=1e-7, atol=1e-12)
    _, logdet = np.linalg.slogdet(np.eye(b * K) + joint @ precision)
    expected = -0.5 * logdet + 0.5 * score @ mean
    assert log_evidence(groups, prior, variance[None])[0] == pytest.approx(expected, rel=1e-9)
    assert log_evidence(groups, prior, variance[None] * 1.5)[0] != pytest.approx(expected, rel=1e-4)


def test_the_prior_is_taken_out_again_and_a_direction_the_log_does_not_tell_is_cut():
    (g, *_), _ = days(2)
    own = np.array([0.5, 1.0, 10.0, 3.0, 1.0])  # one had a wide prior
    centre = np.array([0.1, 0.0, -2.0, 0.0, 0.0])
    covariance = np.linalg.inv(g.precision + np.diag(own**-2))
    mean = covariance @ (g.score + centre / own**2)
    found = information(mean, covariance, centre, own)
    np.testing.assert_allclose(found.precision, g.precision, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.score, g.score, rtol=1e-8, atol=1e-8)
    assert found.cut == 0
    wide = covariance.copy()
    wide[0, :] = wide[:, 0] = 0.0
    wide[0, 0] = 1.5 * own[0] ** 2
    found = information(mean, wide, centre, own)
    assert found.cut == 1 and np.linalg.eigvalsh(found.precision).min() > -1e-9
    np.testing.assert_allclose([found.precision[0, 0], found.score[0]], 0.0, atol=1e-9)


def test_explanations_are_mixed_by_mean_and_covariance():
    a, b = days(3, count=2)[0]
    one = mixed([a, b], [1.0, 0.0], np.ones(K))
    np.testing.assert_allclose(one.precision, a.precision, rtol=1e-8)
    both = mixed([a, b], [0.3, 0.7], np.ones(K))
    (ma, ca), (mb, cb) = a.posterior(np.ones(K)), b.posterior(np.ones(K))
    mean, covariance = both.posterior(np.ones(K))
    apart = ma - mb
    np.testing.assert_allclose(mean, 0.3 * ma + 0.7 * mb, rtol=1e-8)
    np.testing.assert_allclose(
        covariance, 0.3 * ca + 0.7 * cb + 0.21 * np.outer(apart, apart), rtol=1e-8, atol=1e-12
    )


def test_the_order_of_days_does_not_matter():
    groups, _ = days(4, count=4, change=2.0)
    one, other = fit(groups), fit(groups[::-1])
    assert one.same == pytest.approx(other.same, rel=1e-9)
    np.testing.assert_allclose(one.changed, other.changed, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(one.mean, other.mean, rtol=1e-9)
    np.testing.assert_allclose(one.apart, other.apart[::-1], rtol=1e-7, atol=1e-10)


@pytest.mark.thorough
def test_a_change_is_told_and_its_size_is_inside():
    told, inside, wrong = 0, 0, 0
    for seed in range(40):
        groups, truths = days(seed, change=1.5)
        f = fit(groups)
        told += f.changed[2] >= 0.8
        wrong += bool((np.delete(f.changed, 2) >= 0.8).any())
        inside += abs(f.apart[1, 2] - 1.5) < 1.96 * f.apart_sd[1, 2]
        assert np.argmax(np.abs(f.apart[:, 2]) / f.apart_sd[:, 2]) == 1 or f.changed[2] < 0.8
        assert truths[1, 2] - truths[0, 2] == pytest.approx(1.5)
    assert told >= 34 and wrong == 0
    assert inside >= 34  # 38 expected; fewer than 34 has a probability of 0.003


def test_two_changes_of_one_day_are_told_both():
    found = []
    for seed in range(10):
        groups, _ = days(seed, count=4, change=2.0, where=([1, 1], [0, 3]))
        found.append(fit(groups).changed >= 0.8)
    each = np.mean(found, axis=0)
    assert min(each[0], each[3]) >= 0.8 and max(each[[1, 2, 4]]) == 0.0


@pytest.mark.thorough
def test_days_that_are_the_same_are_told_no_change():
    """Bound of the module: one set with 0.05 or less in at most 1 of 19, so 10.5 of 200 expected at most."""
    same = np.array([fit(days(1000 + seed)[0]).same for seed in range(200)])
    assert np.sum(same <= 0.05) <= 10
    assert np.median(same) > 0.75


def test_days_that_all_vary_are_not_one_set_and_their_spread_is_found():
    fits = [fit(days(seed, count=5, spread=0.7)[0]) for seed in range(20)]
    assert max(f.same for f in fits) < 0.05
    assert np.mean([f.spread for f in fits]) == pytest.approx(0.7, rel=0.25)


def test_one_day_is_no_hierarchy():
    with pytest.raises(ValueError, match="two groups"):
        fit(days(0)[0][:1])
