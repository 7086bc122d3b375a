"""Sums of squares of residuals, cut so that noise level, memory and initial state can move without a new run.

Takes residuals of one run and channel for many vectors, and their slopes by the initial state. With residuals
r, correlation phi between neighbours (first-order autoregression) and slopes J by the initial state, the form
Q(r, s) = r^T R(phi)^-1 s is a fixed combination of a few sums that do not depend on phi.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

Array = np.ndarray
REGULAR = 0.05  # neighbours further apart or nearer than this share of the usual interval start afresh


@dataclass(frozen=True, eq=False)
class ChannelResiduals:
    """One channel of one run.

    Attributes
    ----------
    readings : (n,) SI, NaN where missing
    circular : an angle compared modulo a turn
    slopes : (n, m) by the initial states, 0 where missing; m = 0 where they are not marginalised
    links : (2, l) positions of readings and of their predecessors
    tau : correlation time the sums are divided by [readings], 1 for none
    """

    readings: Array
    circular: bool
    slopes: Array
    links: Array
    tau: float

    @cached_property
    def count(self) -> int:
        return int(np.isfinite(self.readings).sum())

    @cached_property
    def gram(self) -> Array:
        """(m, m) slopes by slopes, all readings."""
        return np.asarray(self.slopes.T @ self.slopes)

    def residuals(self, simulated: Array) -> Array:
        """(b, n) simulated minus read [SI], 0 where missing."""
        difference = simulated - self.readings
        if self.circular:
            difference = np.remainder(difference + np.pi, 2 * np.pi) - np.pi
        missing = ~np.isfinite(self.readings)
        if missing.any():
            difference[:, missing] = 0.0
        return difference


@dataclass(frozen=True, eq=False)
class ResidualSums:
    """What Q(r, r), Q(J, r) and Q(J, J) are made of, each for all readings and, with memory, for linked ones.

    squares : (4, b); mixed : (4, b, m); slopes : (4, m, m) -- all, linked, crossed, predecessors
    """

    squares: Array
    mixed: Array
    slopes: Array

    @staticmethod
    def of(channel: ChannelResiduals, resid: Array, memory: bool) -> ResidualSums:
        """Sums of (b, n) residuals."""
        j = channel.slopes
        parts = 4 if memory else 1
        squares, mixed = np.zeros((parts, resid.shape[0])), np.zeros((parts, resid.shape[0], j.shape[1]))
        slopes = np.zeros((parts, j.shape[1], j.shape[1]))
        squares[0], mixed[0], slopes[0] = np.einsum("bn,bn->b", resid, resid), resid @ j, j.T @ j
        if memory:
            now, before = channel.links
            r, p, jn, jp = resid[:, now], resid[:, before], j[now], j[before]
            squares[1:] = [2 * np.einsum("bn,bn->b", a, b) if a is not b else np.einsum("bn,bn->b", a, a)
                           for a, b in ((r, r), (r, p), (p, p))]  # fmt: skip
            mixed[1:] = r @ jn, r @ jp + p @ jn, p @ jp
            slopes[1:] = jn.T @ jn, jn.T @ jp + jp.T @ jn, jp.T @ jp
        return ResidualSums(squares, mixed, slopes)

    def at(self, phi: Array | None) -> tuple[Array, Array, Array]:
        """Q(r, r) (b,), Q(J, r) (b, m) and Q(J, J) (b or 1, m, m) at correlations phi (b,)."""
        if phi is None:
            return self.squares[0], self.mixed[0], self.slopes[None, 0]
        rest = 1.0 / (1.0 - phi * phi)
        factors = np.stack([np.ones_like(phi), rest - 1.0, -phi * rest, phi * phi * rest])
        return (
            np.einsum("pb,pb->b", factors, self.squares),
            np.einsum("pb,pbm->bm", factors, self.mixed),
            np.einsum("pb,pmk->bmk", factors, self.slopes),
        )


def neighbours(t: Array, finite: Array) -> Array:
    """(2, l) readings and their predecessors, where as far apart as most."""
    at = np.flatnonzero(finite)
    if at.size < 3:
        return np.zeros((2, 0), dtype=np.int64)
    gaps = np.diff(t[at])
    usual = np.median(gaps)
    linked = np.abs(gaps - usual) <= REGULAR * usual
    return np.stack([at[1:][linked], at[:-1][linked]])
