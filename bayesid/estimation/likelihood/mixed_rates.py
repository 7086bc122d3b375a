"""Noise of residuals whose channels are read at different rates: an autoregression per rate.

Takes residuals of several runs and which of them were read. Gives the covariance of a score. A channel read
at every tenth sample leaves nine empty cells between two readings, and a common autoregression of eight
samples sees no memory in it. Correlation between channels of different rates is taken for none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.estimation.likelihood.residual_noise import MOST_ORDER, ResidualNoise, residual_noise

Array = np.ndarray
# Median distance of a channel's readings [samples] from which it has a rate of its own.
SPARSE = 2
# Share of the noise left in residuals, below which it is not trusted.
LEAST_FREE = 0.5
# Share of the readings two sparse channels must have in common to share an autoregression.
TOGETHER = 0.9


@dataclass(frozen=True, eq=False)
class ChannelGroup:
    """Channels read at the same samples, and their noise at that rate.

    Attributes
    ----------
    channels : positions among all
    every : whether the noise goes from sample to sample, read or not; else from reading to reading
    noise : of the channels, a step being a sample or a reading
    readings : of all runs
    steps : mean length of a run
    """

    channels: tuple[int, ...]
    every: bool
    noise: ResidualNoise
    readings: int
    steps: int

    def rows(self, valid: Array) -> Array:
        """(n,) steps of its noise in a run."""
        if self.every:
            return np.ones(len(valid), dtype=bool)
        return np.asarray(valid[:, self.channels].any(axis=1))

    @property
    def worth(self) -> float:
        """Readings that would be as many if none erred with its neighbours."""
        return self.readings / (self.noise.correlation_time(self.steps) if self.noise.order else 1.0)


@dataclass(frozen=True, eq=False)
class MixedRateNoise:
    """Noise of all channels, in groups of one rate."""

    groups: tuple[ChannelGroup, ...]

    @property
    def order(self) -> int:
        """Largest of the groups; 0 is white."""
        return max(g.noise.order for g in self.groups)

    def for_unknowns(self, unknowns: int) -> MixedRateNoise:
        """The noise whose residuals these are, after a fit of so many unknowns.

        A fit takes its unknowns' share of the noise out of the residuals; readings that err together are as
        few as their correlation time says. White noise is left as stated.
        """
        worth = sum(
            g.readings / (g.noise.correlation_time(g.steps) if g.noise.order else 1.0) for g in self.groups
        )
        free = max(1.0 - unknowns / max(worth, 1.0), LEAST_FREE)
        scaled = (
            replace(g, noise=ResidualNoise(g.noise.lags / free, g.noise.coefficients)) if g.noise.order else g
            for g in self.groups
        )
        return MixedRateNoise(tuple(scaled))

    def of_score(self, columns: Array, valid: Array, step: float = 1.0) -> Array:
        """(k, k) covariance of sum over samples of columns^T e for (n, c, k) columns, 0 where not read.

        `step` is the distance of two samples over that of the samples the noise was found from.
        """
        k = columns.shape[2]
        out = np.zeros((k, k))
        for g in self.groups:
            own = columns[g.rows(valid)][:, g.channels]
            if g.noise.order and own.size:
                out += g.noise.of_score(own, step if g.every else 1.0)
            else:
                flat = own.reshape(-1, k)
                out += flat.T @ flat
        return out

    def draw(self, valid: Array, rng: np.random.Generator, step: float = 1.0) -> Array:
        """(n, c) errors of readings where there are any, `step` as in `of_score`."""
        out = np.zeros(valid.shape)
        for g in self.groups:
            rows = g.rows(valid)
            count = int(rows.sum())
            if g.noise.order:
                errors = g.noise.draw(count, rng, step if g.every else 1.0)
            else:
                errors = rng.standard_normal((count, len(g.channels)))
            out[np.flatnonzero(rows)[:, None], np.array(g.channels)] = errors
        return np.where(valid, out, 0.0)


def mixed_rate_noise(
    resids: Sequence[Array], valid: Sequence[Array], most: int = MOST_ORDER
) -> MixedRateNoise:
    """Autoregressions of the residuals of several runs, one per rate; see `residual_noise`."""
    groups = []
    for channels, every in _rates(valid):
        series, seen = [], []
        for resid, ok in zip(resids, valid, strict=True):
            rows = slice(None) if every else ok[:, channels].any(axis=1)
            series.append(resid[rows][:, channels])
            seen.append(ok[rows][:, channels])
        used = [i for i, s in enumerate(series) if len(s)] or [0]
        noise = residual_noise([series[i] for i in used], [seen[i] for i in used], most)
        readings = int(sum(s.sum() for s in seen))
        steps = int(np.mean([len(series[i]) for i in used]))
        groups.append(ChannelGroup(channels, every, noise, readings, steps))
    return MixedRateNoise(tuple(groups))


def _rates(valid: Sequence[Array]) -> list[tuple[tuple[int, ...], bool]]:
    """Groups of channels, those read at most samples first, and whether that is their rate."""
    count = valid[0].shape[1]
    gaps = [np.concatenate([np.diff(np.flatnonzero(ok[:, j])) for ok in valid]) for j in range(count)]
    sparse = [j for j in range(count) if gaps[j].size and np.median(gaps[j]) >= SPARSE]
    dense = tuple(j for j in range(count) if j not in sparse)
    found: list[tuple[tuple[int, ...], bool]] = [(dense, True)] if dense else []
    while sparse:
        first = np.concatenate([ok[:, sparse[0]] for ok in valid])
        own = []
        for j in sparse:
            other = np.concatenate([ok[:, j] for ok in valid])
            if (first & other).sum() >= TOGETHER * (first | other).sum():
                own.append(j)
        found.append((tuple(own), False))
        sparse = [j for j in sparse if j not in own]
    return found
