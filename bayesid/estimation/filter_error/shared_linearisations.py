"""Linearisations that many fits share: refits of one trial all begin at the same points.

Takes points and free parameters. Gives paths and normal equations, the paths of an earlier fit where it stood
at the very same points. Does not change a bit: slopes by one parameter do not depend on which others are
free, and products are formed anew (those of wider matrices are summed in another order, by which a fit would
depend on the fits made before it, and a diagnosis that was stopped would not end with the same numbers).

While a fit lets its path settle its parameters do not move, so that a dozen refits pass through the same
points. When points come up a second time they are linearised for the parameters of every effect at once,
which costs little more than for one, and kept for the rest.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, forces, linearise_runs
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.normal_equations import stacked_equations
from bayesid.estimation.filter_error.parameter_slopes import NUMBER, HeldSlopes, runs_held
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.estimation.run_data import RunData

# Sets of points kept per model, their bytes at most, and points remembered as seen once.
MOST_SETS, MOST_BYTES, MOST_SEEN = 4, 200_000_000, 32


@dataclass(frozen=True, eq=False)
class _Set:
    """All runs linearised about one set of points for `parameters`; `logs` keeps their identities taken."""

    logs: tuple[RunData, ...]
    free: GaussianPrior
    paths: tuple[Linearisation, ...]

    def positions(self, free: GaussianPrior) -> np.ndarray | None:
        """Where the parameters of `parameters` stand; none if one is missing or has another prior mean."""
        at = {int(p): i for i, p in enumerate(self.free.where)}
        if any(int(p) not in at for p in free.where):
            return None
        found = np.array([at[int(p)] for p in free.where], dtype=np.int64)
        return found if np.array_equal(self.free.mean[found], free.mean) else None


@dataclass(eq=False)
class _Kept:
    """What one model keeps."""

    sets: OrderedDict[bytes, _Set] = field(default_factory=OrderedDict)
    seen: OrderedDict[bytes, tuple[RunData, ...]] = field(default_factory=OrderedDict)


_kept: WeakKeyDictionary[Model, _Kept] = WeakKeyDictionary()


def linear(
    model: Model,
    logs: Sequence[RunData],
    points: Sequence[Trajectory],
    free: GaussianPrior,
    noise_model: NoiseModel,
) -> tuple[list[Linearisation], list[NormalEquations]]:
    """What `fresh` gives, made of what an earlier fit left where it stood at the same points."""
    kept = _kept.setdefault(model, _Kept())
    key = _digest(logs, points, noise_model)
    found = kept.sets.get(key)
    if found is None:
        known = kept.seen.get(key)
        if known is None or not _same(known, logs):
            _remember(kept.seen, key, tuple(logs), MOST_SEEN)
            return fresh(model, logs, points, free, noise_model)
        whole = free + _others(model, free, points[0].par)
        width = points[0].states.shape[1] + len(model.kernel.channels)
        samples = [log.n for log in logs]
        size = NUMBER * len(whole.names) * width * sum(samples)
        if not all(runs_held(samples, width, len(whole.names))) or size * MOST_SETS > MOST_BYTES:
            return fresh(model, logs, points, free, noise_model)
        inputs = forces(model)
        paths = linearise_runs(model, logs, points, whole.where, inputs)
        found = _Set(tuple(logs), whole, tuple(paths))
        _remember(kept.sets, key, found, MOST_SETS)
    at = found.positions(free) if _same(found.logs, logs) else None
    if at is None:
        return fresh(model, logs, points, free, noise_model)
    paths = [
        replace(p, by_parameter=HeldSlopes(_picked(p.direct, at), _picked(p.psi, at))) for p in found.paths
    ]
    return paths, stacked_equations(model, paths, free, noise_model)


def _picked(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """values[:, :, at], quick where most positions are 0, 1, 2, ..., as those of coefficients are."""
    lead = int(np.argmin(np.append(at == np.arange(at.size), False)))
    out = np.empty((*values.shape[:2], at.size))
    out[:, :, :lead] = values[:, :, :lead]
    if lead < at.size:
        out[:, :, lead:] = values[:, :, at[lead:]]
    return out


def fresh(
    model: Model,
    logs: Sequence[RunData],
    points: Sequence[Trajectory],
    free: GaussianPrior,
    noise_model: NoiseModel,
) -> tuple[list[Linearisation], list[NormalEquations]]:
    """Every run linearised for the forces of the environment and `parameters`."""
    paths = linearise_runs(model, logs, points, free.where, forces(model))
    return paths, stacked_equations(model, paths, free, noise_model)


def _others(model: Model, free: GaussianPrior, par: np.ndarray) -> GaussianPrior:
    """Parameters of all effects that have a slope and are at their prior mean, apart from those of
    `parameters`."""
    out = GaussianPrior((), free.where[:0], free.mean[:0], free.sd[:0], free.low[:0])
    for effect in model.causes:
        if not effect.smooth:
            continue
        prior = effect_prior(model, effect)
        if np.array_equal(par[prior.where], prior.mean) and not np.isin(prior.where, free.where).any():
            out = out + prior
    return out


def _digest(logs: Sequence[RunData], points: Sequence[Trajectory], noise_model: NoiseModel) -> bytes:
    out = blake2b(repr((noise_model, [id(log) for log in logs])).encode())
    for p in points:
        for values in (p.par, p.states, p.force):
            out.update(np.ascontiguousarray(values).tobytes())
        out.update(b"" if p.before is None else np.ascontiguousarray(p.before).tobytes())
    return out.digest()


def _same(one: Sequence[RunData], other: Sequence[RunData]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


def _remember(where: OrderedDict[bytes, Any], key: bytes, value: Any, most: int) -> None:
    where[key] = value
    while len(where) > most:
        where.popitem(last=False)
