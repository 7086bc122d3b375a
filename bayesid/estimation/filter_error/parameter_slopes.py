"""How readings and interval ends of a run move with the free parameters, held or made anew block by block.

Takes arrays, or what they are made of. Gives any block of samples. By far the largest part of a linearised
run: of a long one no more than a block is held at a time, and no number of it depends on where blocks end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.run_data import Array
from bayesid.simulation import Chain, TimePlan, chain_of, interval_maps, part_of, readings_on

# of the slopes of all runs that are held at once; made anew for every sum they double the time of a diagnosis
MOST_BYTES = 96_000_000
NUMBER = 8  # bytes
BLOCK = 2048  # samples made at a time
BESIDE = 2  # samples on either side that a late sensor's rates are taken from


def runs_held(samples: Sequence[float], width: int, parameters: int) -> tuple[bool, ...]:
    """Of which runs slopes are in memory at once: run by run while they fit.

    Parameters
    ----------
    samples : of every run
    width : states and channels
    """
    room, out = float(MOST_BYTES), []
    for n in samples:
        size = NUMBER * n * width * parameters
        out.append(size <= room)
        room -= size if out[-1] else 0.0
    return tuple(out)


class ParameterSlopes(Protocol):
    """Slopes of one run by its free parameters."""

    def part(self, first: int, last: int) -> tuple[Array, Array]:
        """Of the readings (last - first, q, p), and of the ends of the intervals that begin there."""
        ...


@dataclass(frozen=True, eq=False)
class HeldSlopes:
    """direct (n, q, p) of the readings at fixed state, psi (n-1, nx, p) of the ends of intervals."""

    direct: Array
    psi: Array

    def part(self, first: int, last: int) -> tuple[Array, Array]:
        return self.direct[first:last], self.psi[first:last]


@dataclass(frozen=True, eq=False)
class RemadeSlopes:
    """Slopes made anew for every block that is asked for.

    Attributes
    ----------
    plan, states : inputs and (n, nx) states at which they are taken
    free : (p,) positions of parameters
    picked : channels of the readings
    inputs, force, ratio_slope : latent forces (n-1, f) of the path and (p, f, f) how inertia changes what
        they do; no inputs where they have no part in it
    """

    model: Model
    par: Array
    plan: TimePlan
    states: Array
    free: Array
    picked: slice | list[int]
    inputs: tuple[str, ...]
    force: Array
    ratio_slope: Array

    @cached_property
    def _chain(self) -> Chain:
        """Of the whole run, once: for every block it would cost the square of the length."""
        return chain_of(self.model, self.par, self.plan, self.free)

    def part(self, first: int, last: int) -> tuple[Array, Array]:
        n = self.plan.t.size
        begin, end = max(0, first - BESIDE), min(n - 1, last - 1 + BESIDE)
        states = self.states[begin : end + 1]
        maps = interval_maps(
            self.model, self.par, self.plan, self.states, self.inputs, self.free, part=(begin, end),
            chain=self._chain,
        )  # fmt: skip
        psi = maps.psi
        heavy = np.flatnonzero(self.ratio_slope.any(axis=(1, 2)))
        if self.inputs and heavy.size:
            psi[:, :, heavy] += np.einsum(
                "ixf,pfg,ig->ixp", maps.gamma, self.ratio_slope[heavy], self.force[begin:end], optimize=True
            )
        read = readings_on(self.model, self.par, part_of(self.plan, begin, end), states, maps, self.free)
        kept = slice(first - begin, last - begin)
        return read.by_parameter[kept][:, self.picked], psi[first - begin : min(last, n - 1) - begin]


def blocks(n: int) -> Iterator[tuple[int, int]]:
    """First and last (exclusive) sample of every block of a run."""
    for first in range(0, n, BLOCK):
        yield first, min(n, first + BLOCK)
