"""Which numbers of a model are unknown, where they start, how far they may go and what was known before.

Takes names and SI numbers. Gives the way from a free vector to a model's parameter vector and back to file
units. Does not know models, data or optimisers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from bayesid.errors import FitError, raise_all

Array = np.ndarray
Role = Literal["free", "fixed", "tied"]


@dataclass(frozen=True)
class Prior:
    """What was known of one parameter, as a residual that is standard normal under it.

    kind : "normal" (centre = mean, spread = sd), "lognormal" (centre = median, spread = sd of the logarithm;
        the sign of the centre is kept) or "uniform" (between the bounds: no residual)
    """

    kind: Literal["normal", "lognormal", "uniform"]
    centre: float = 0.0
    spread: float = math.inf

    def residual(self, value: float) -> tuple[float, float]:
        """Standardised distance from the centre and its slope; (0, 0) for a uniform prior."""
        if self.kind == "uniform" or math.isinf(self.spread):
            return 0.0, 0.0
        if self.kind == "normal":
            return (value - self.centre) / self.spread, 1.0 / self.spread
        ratio = max(value / self.centre, 1e-300)
        return math.log(ratio) / self.spread, 1.0 / (value * self.spread)

    @property
    def sd(self) -> float:
        """Standard deviation in the parameter's own unit, of a lognormal prior to first order."""
        return self.spread * abs(self.centre) if self.kind == "lognormal" else self.spread

    def describe(self) -> str:
        """Words for a table."""
        if self.kind == "uniform":
            return "uniform"
        return f"{self.kind} {self.centre:.4g} ± {self.spread:.3g}"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model.

    start : value it starts from, or keeps if fixed [SI]
    low, high : bounds [SI]
    scale : size of a change that matters [SI, positive]; |start| unless that is zero
    tie : (name, factor, offset): value = offset + factor * value of that free parameter
    file_scale : SI value over value in the vehicle file
    """

    name: str
    start: float
    role: Role = "free"
    low: float = -math.inf
    high: float = math.inf
    scale: float = 1.0
    prior: Prior | None = None
    tie: tuple[str, float, float] | None = None
    file_scale: float = 1.0


@dataclass(frozen=True)
class JointPrior:
    """Parameters known together: mean (k,) and covariance (k, k), SI."""

    names: tuple[str, ...]
    mean: Array
    covariance: Array

    @cached_property
    def whitener(self) -> Array:
        """(r, k) matrix that makes deviations standard normal; directions without spread are left out."""
        scale = np.sqrt(np.diag(self.covariance))
        scale = np.where(scale > 0, scale, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        keep = values > 1e-12 * values.max()
        return (vectors[:, keep] / np.sqrt(values[keep])).T / scale


@dataclass(frozen=True)
class ParameterSet:
    """Parameters of a problem, free ones in this order.

    Raises
    ------
    FitError
        all at once: doubled names, start outside its bounds, a tie to something that is not free, no free
        parameter
    """

    entries: tuple[Parameter, ...]
    joint: JointPrior | None = None

    def __post_init__(self) -> None:
        problems = []
        names = [p.name for p in self.entries]
        problems += [f"{n} is given twice" for n in sorted({n for n in names if names.count(n) > 1})]
        free = {p.name for p in self.entries if p.role == "free"}
        for p in self.entries:
            if p.role == "free" and not p.low < p.high:
                problems.append(f"{p.name}: lower bound {p.low:.6g} is not below upper bound {p.high:.6g}")
            elif p.role == "free" and not p.low <= p.start <= p.high:
                problems.append(f"{p.name} starts at {p.start:.6g}, outside {p.low:.6g} .. {p.high:.6g}")
            if not (math.isfinite(p.start) and math.isfinite(p.scale) and p.scale > 0):
                problems.append(
                    f"{p.name}: start {p.start} and scale {p.scale} must be finite, scale positive"
                )
            if (p.role == "tied") != (p.tie is not None):
                problems.append(f"{p.name}: a tied parameter, and no other, names what it is tied to")
            elif p.tie is not None and p.tie[0] not in free:
                problems.append(f"{p.name} is tied to {p.tie[0]}, which is not free")
        if self.joint is not None:
            problems += [f"joint prior of {n}, which is not free" for n in self.joint.names if n not in free]
        if problems:
            raise_all(FitError, "parameters", problems)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self.entries)

    def __getitem__(self, name: str) -> Parameter:
        for p in self.entries:
            if p.name == name:
                return p
        raise KeyError(name)

    @cached_property
    def free(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.entries if p.role == "free")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, in the order of a free vector."""
        return tuple(p.name for p in self.free)

    def vector(self, field: str) -> Array:
        """(k,) start, low, high, scale or file_scale of the free parameters."""
        return np.array([getattr(p, field) for p in self.free], dtype=float)

    @property
    def start(self) -> Array:
        return self.vector("start")

    @cached_property
    def prior_sd(self) -> Array:
        """(k,) prior standard deviation of the free parameters [SI], inf where there is none.

        That of the joint prior where a parameter is in it.
        """
        joint = (
            {}
            if self.joint is None
            else dict(zip(self.joint.names, np.sqrt(np.diag(self.joint.covariance)), strict=True))
        )
        return np.array([joint.get(p.name, math.inf if p.prior is None else p.prior.sd) for p in self.free])

    def values(self, x: Array) -> dict[str, float]:
        """Name -> SI value of every entry, tied and fixed ones included."""
        found = {p.name: float(v) for p, v in zip(self.free, x, strict=True)}
        for p in self.entries:
            if p.role == "fixed":
                found[p.name] = p.start
            elif p.tie is not None:
                found[p.name] = p.tie[2] + p.tie[1] * found[p.tie[0]]
        return {p.name: found[p.name] for p in self.entries}

    def place(self, base: Array, index: Mapping[str, int], x: Array) -> Array:
        """Model parameter vector: `base` with every entry of this set written in."""
        out = np.array(base, dtype=float)
        for name, value in self.values(x).items():
            out[index[name]] = value
        return out

    def chain(self, index: Mapping[str, int]) -> tuple[Array, Array]:
        """Positions (m,) in the model's vector that move, and their (m, k) slopes by the free vector."""
        column = {name: i for i, name in enumerate(self.names)}
        moving = [p for p in self.entries if p.role != "fixed"]
        slopes = np.zeros((len(moving), len(column)))
        for row, p in enumerate(moving):
            name, factor = (p.name, 1.0) if p.tie is None else p.tie[:2]
            slopes[row, column[name]] = factor
        return np.array([index[p.name] for p in moving], dtype=np.int64), slopes

    def prior_residuals(self, x: Array) -> tuple[Array, Array]:
        """Prior as residuals (p,) and their slopes (p, k) by the free vector."""
        resid, rows = [], []
        for i, p in enumerate(self.free):
            if p.prior is not None and p.prior.kind != "uniform":
                value, slope = p.prior.residual(float(x[i]))
                resid.append(value)
                rows.append(np.where(np.arange(x.size) == i, slope, 0.0))
        slopes = np.array(rows).reshape(len(rows), x.size)
        if self.joint is not None:
            where = [self.names.index(n) for n in self.joint.names]
            block = np.zeros((self.joint.whitener.shape[0], x.size))
            block[:, where] = self.joint.whitener
            resid += list(self.joint.whitener @ (x[where] - self.joint.mean))
            slopes = np.vstack([slopes, block])
        return np.asarray(resid, dtype=float), slopes

    def changed(self, names: Iterable[str], **changes: Any) -> ParameterSet:
        """The set with fields of some entries replaced."""
        wanted = set(names)
        unknown = wanted - {p.name for p in self.entries}
        if unknown:
            raise FitError(f"parameters: no entry {', '.join(sorted(unknown))}")
        return replace(
            self, entries=tuple(replace(p, **changes) if p.name in wanted else p for p in self.entries)
        )

    def started_at(self, x: Sequence[float] | Array) -> ParameterSet:
        """The set with other start values (k,), clipped into the bounds."""
        values = dict(zip(self.names, np.clip(x, self.vector("low"), self.vector("high")), strict=True))
        return replace(
            self, entries=tuple(replace(p, start=float(values.get(p.name, p.start))) for p in self.entries)
        )
