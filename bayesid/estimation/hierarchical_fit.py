"""Whether parameters are the same in several groups of data, which of them are not, and their values.

Takes what every group says alone (`hierarchical_normal.Information`). Gives a frozen `HierarchicalFit`: the
standard deviation tau between groups and the set of changed parameters are averaged over, none is chosen.

Models: all parameters vary by tau prior standard deviations, tau = 0 included; those of a set S vary by kappa
besides. Prior: tau = 0 with 2/3, else half-normal (Gelman 2006) with scale 1/2; S empty with 3/4, else of n
parameters in proportion to 2^-n, every set of one size alike, which minds the number of parameters looked at
(Scott & Berger 2010); kappa half-normal with scale 1. So no difference at all has 1/2 before the data. As the
expectation of a Bayes factor against a true model is 1, groups that are all the same are given a probability
of 0.05 or less of being so in at most 1 of 19 cases (Markov's inequality). "The same" is meant to `ALIKE`
prior standard deviations: no data tell a smaller spread from none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.special import logsumexp

from bayesid.estimation.hierarchical_normal import Information, group_posterior, log_evidence

Array = np.ndarray
NO_SPREAD, NO_CHANGE = 2.0 / 3.0, 3.0 / 4.0
SPREAD_SCALE, CHANGE_SCALE = 0.5, 1.0  # of tau and kappa [prior sd]
SPREADS = np.concatenate([[0.0], np.geomspace(0.01, 2.0, 12)])
CHANGES = np.geomspace(0.05, 5.0, 8)
MOST_CHANGED = 4
# Standard deviation between groups up to which parameters count as the same [prior sd].
ALIKE = 0.1
# Share of the probability below which sets of one more parameter are not looked at, and below which a model
# is left out of the averages.
NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class HierarchicalFit:
    """Parameters of several groups, in units of their prior.

    Attributes
    ----------
    same : probability that all parameters are the same in all groups, to `ALIKE` prior standard deviations
    changed : (k,) probability that a parameter varies beyond tau
    any_changed : probability that at least one does
    spread, spread_high : mean of tau and the value it stays below with 95 %
    varying : probability of tau > 0
    mean, covariance : (k,), (k, k) of what the groups share, mu
    between : (k,) mean variance of a parameter between groups
    groups, groups_sd : (b, k) partially pooled values
    apart, apart_sd : (b, k) a group's value minus the others', each weighed by what its data say of it
    others : (b, k) the others' value
    """

    same: float
    changed: Array
    any_changed: float
    spread: float
    spread_high: float
    varying: float
    mean: Array
    covariance: Array
    between: Array
    groups: Array
    groups_sd: Array
    apart: Array
    apart_sd: Array
    others: Array


@dataclass(frozen=True, eq=False)
class _Models:
    """All (tau, kappa) of one set of changed parameters, with log prior times evidence."""

    changed: tuple[int, ...]
    spread: Array
    variance: Array
    weight: Array


def fit_hierarchy(groups: Sequence[Information], prior_sd: Array, weight: Array) -> HierarchicalFit:
    """The hierarchy of some groups.

    Parameters
    ----------
    prior_sd : (k,) of mu, in the unit the information is in
    weight : (b, k) how far the data of a group tell a parameter beyond its prior, 0 to 1: what the others are
        averaged with. Only parameters told in two groups may change

    Raises
    ------
    ValueError
        fewer than two groups
    """
    if len(groups) < 2:
        raise ValueError("a hierarchy needs two groups")
    able = np.flatnonzero((weight > 0.0).sum(axis=0) > 1)
    models = _searched(groups, prior_sd, able)
    flat = np.exp(np.concatenate([m.weight for m in models]) - max(m.weight.max() for m in models))
    flat /= flat.sum()
    shares = np.split(flat, np.cumsum([m.weight.size for m in models])[:-1])
    k = prior_sd.size
    changed = np.zeros(k)
    for m, share in zip(models, shares, strict=True):
        changed[list(m.changed)] += share.sum()
    spreads = np.concatenate([m.spread for m in models])
    order = np.argsort(spreads, kind="stable")
    high = spreads[order][np.searchsorted(np.cumsum(flat[order]), 0.95)]
    alike = [m.variance.max(axis=1) <= ALIKE**2 for m in models]
    same = float(sum(s[a].sum() for s, a in zip(shares, alike, strict=True)))
    return HierarchicalFit(
        same,
        np.minimum(changed, 1.0),
        min(float(sum(s.sum() for m, s in zip(models, shares, strict=True) if m.changed)), 1.0),
        float(flat @ spreads),
        float(high),
        float(flat[spreads > 0].sum()),
        *_averaged(groups, prior_sd, weight, models, shares),
    )


def _searched(groups: Sequence[Information], prior_sd: Array, able: Array) -> list[_Models]:
    """No change, every single one, then sets that grow by the best."""
    most = min(MOST_CHANGED, able.size)
    halves = np.array([0.5**n for n in range(1, most + 1)])
    prior = [NO_CHANGE, *((1.0 - NO_CHANGE) * halves / halves.sum())] if most else [1.0]
    out = [_weighed(groups, prior_sd, (), prior[0])]
    best: tuple[int, ...] = ()
    for n in range(1, most + 1):
        tried = [
            _weighed(groups, prior_sd, (*best, int(j)), prior[n] / comb(able.size, n))
            for j in able
            if j not in best
        ]
        out += tried
        sums = [logsumexp(m.weight) for m in tried]
        best = tried[int(np.argmax(sums))].changed
        if logsumexp(sums) < logsumexp(np.concatenate([m.weight for m in out])) + np.log(NEGLIGIBLE):
            break
    return out


def _weighed(
    groups: Sequence[Information], prior_sd: Array, changed: tuple[int, ...], prior: float
) -> _Models:
    spread, share = (
        SPREADS,
        np.concatenate([[NO_SPREAD], (1.0 - NO_SPREAD) * _half_normal(SPREADS[1:], SPREAD_SCALE)]),
    )
    variance = np.repeat(spread[:, None] ** 2, prior_sd.size, axis=1)
    if changed:
        size = CHANGES.size
        variance, spread = np.repeat(variance, size, axis=0), np.repeat(spread, size)
        share = np.outer(share, _half_normal(CHANGES, CHANGE_SCALE)).ravel()
        variance[:, list(changed)] += np.tile(CHANGES**2, SPREADS.size)[:, None]
    evidence = log_evidence(groups, prior_sd, variance)
    return _Models(changed, spread, variance, np.log(prior) + np.log(share) + evidence)


def _half_normal(values: Array, scale: float) -> Array:
    """Prior share of each of some sizes in geometric steps."""
    share = values * np.exp(-0.5 * (values / scale) ** 2)
    return np.asarray(share / share.sum())


def _averaged(
    groups: Sequence[Information],
    prior_sd: Array,
    weight: Array,
    models: Sequence[_Models],
    shares: Sequence[Array],
) -> tuple[Array, ...]:
    """Means and variances over the models, the differences between their means included."""
    contrast = _contrasts(weight)
    parts = []
    largest = max(float(s.max()) for s in shares)
    for m, share in zip(models, shares, strict=True):
        for i in np.flatnonzero(share >= NEGLIGIBLE * largest):
            p = group_posterior(groups, prior_sd, m.variance[i])
            apart = np.einsum("kba,ak->bk", contrast, p.groups)
            apart_variance = np.einsum("kba,kac,kbc->bk", contrast, p.spread, contrast, optimize=True)
            own = np.diagonal(p.spread, axis1=1, axis2=2).T
            parts.append(
                (share[i], p.mean, p.covariance, m.variance[i], p.groups, own, apart, apart_variance)
            )
    w = np.array([p[0] for p in parts])
    w /= w.sum()
    mean, covariance, between, values, own, apart, apart_variance = (
        np.tensordot(w, np.array([p[i] for p in parts]), 1) for i in range(1, 8)
    )
    off = np.array([p[1] for p in parts]) - mean
    covariance = covariance + (w[:, None] * off).T @ off
    own = own + np.tensordot(w, (np.array([p[4] for p in parts]) - values) ** 2, 1)
    apart_variance = apart_variance + np.tensordot(w, (np.array([p[6] for p in parts]) - apart) ** 2, 1)
    sd = np.sqrt(np.maximum(apart_variance, 0.0))
    return mean, covariance, between, values, np.sqrt(own), apart, sd, values - apart


def _contrasts(weight: Array) -> Array:
    """(k, b, b) rows that take from a group's value the weighted mean of the others'."""
    b, k = weight.shape
    out = np.zeros((k, b, b))
    for j in range(k):
        for i in range(b):
            others = np.delete(np.arange(b), i)
            w = weight[others, j]
            out[j, i, others] = -w / w.sum() if w.sum() > 0 else -1.0 / others.size
            out[j, i, i] = 1.0
    return out
