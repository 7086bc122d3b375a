"""What is known of the coefficients before the next run: a normal distribution, and vehicles drawn from it.

Takes a `Model`, its vehicle's prior or an assumed relative sd. Gives frozen `Knowledge`. Does not fit; after
a fit the identified vehicle file carries the new knowledge.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError, ModelError
from bayesid.model.params import JointPrior, Parameter, ParameterSet

Array = np.ndarray
ASSUMED_RELATIVE_SD = 0.1  # relative sd of a coefficient whose file states none


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Normal distribution of some coefficients.

    Attributes
    ----------
    names : (k,) coefficients
    where : (k,) their positions among the model's parameters
    mean : (k,) [SI]
    root : (k, k) covariance = root root' [SI]; mean + root xi is a draw, xi of unit variance
    assumed : names whose spread the vehicle file does not state
    """

    names: tuple[str, ...]
    where: Array
    mean: Array
    root: Array
    assumed: tuple[str, ...]

    @property
    def sd(self) -> Array:
        """(k,) standard deviations [SI]."""
        return np.sqrt(np.sum(self.root**2, axis=1))

    def spread(self, inner: Array) -> Array:
        """(..., k) standard deviations [SI] of a covariance (..., k, k) given in units of this knowledge."""
        return np.sqrt(np.einsum("ij,...jk,ik->...i", self.root, inner, self.root))

    def draws(self, model: Model, rng: np.random.Generator, count: int, limit: float = 2.0) -> Array:
        """(count, n) parameter vectors of vehicles this knowledge allows; beyond `limit` sd drawn again."""
        xi = rng.standard_normal((count, len(self.names)))
        while (wide := np.abs(xi) > limit).any():
            xi[wide] = rng.standard_normal(int(wide.sum()))
        out = np.tile(model.nominal, (count, 1))
        out[:, self.where] = self.mean + xi @ self.root.T
        return out

    def parameters(self) -> ParameterSet:
        """The coefficients as free parameters with this knowledge as their joint prior."""
        sd = self.sd
        entries = tuple(
            Parameter(n, float(m), scale=float(s)) for n, m, s in zip(self.names, self.mean, sd, strict=True)
        )
        return ParameterSet(entries, JointPrior(self.names, self.mean, self.root @ self.root.T))


def knowledge(
    model: Model, names: Iterable[str] | None = None, assumed: float = ASSUMED_RELATIVE_SD
) -> Knowledge:
    """Knowledge a vehicle file states.

    Parameters
    ----------
    names : by default every coefficient of the file that is not zero, or has a stated spread
    assumed : relative sd where the file states none

    Raises
    ------
    FitError
        if nothing is left to know, or `assumed` is not positive
    """
    if not 0.0 < assumed < np.inf:
        raise FitError(f"assumed relative sd of {assumed:g}: give a positive number such as 0.1")
    chosen = tuple(names if names is not None else model.coefficients)
    where = model.positions(chosen)
    mean = model.nominal[where]
    stated = np.array([model.prior_sd(n) for n in chosen])
    is_stated = np.isfinite(stated) & (stated > 0)
    sd = np.where(is_stated, stated, assumed * np.abs(mean))
    keep = sd > 0
    if not keep.any():
        raise FitError(f"{model.vehicle.name}: no coefficient with a value or a stated spread to learn about")
    chosen = tuple(n for n, k in zip(chosen, keep, strict=True) if k)
    root = np.diag(sd[keep])
    prior = model.vehicle.prior
    if prior is not None and prior.covariance is not None:
        both = [n for n in chosen if n in prior.names]
        ours, theirs = [chosen.index(n) for n in both], [prior.names.index(n) for n in both]
        scale = np.array([model.file_scale(n) for n in both])
        covariance = np.diag(sd[keep] ** 2)
        covariance[np.ix_(ours, ours)] = prior.covariance[np.ix_(theirs, theirs)] * np.outer(scale, scale)
        root = _root(covariance)
    guessed = tuple(n for n, s in zip(chosen, is_stated[keep], strict=True) if not s)
    return Knowledge(chosen, where[keep], mean[keep], root, guessed)


def _root(covariance: Array) -> Array:
    """Lower triangular root of a covariance that may be singular to rounding."""
    sd = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    flat = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    triangle = np.asarray(np.linalg.qr(flat, mode="r"))
    return sd[:, None] * triangle.T


def controllable(model: Model, draws: Array, flies: Iterable[bool]) -> Array:
    """Draws that can be flown.

    Raises
    ------
    ModelError
        if fewer than half of them can
    """
    keep = np.fromiter(flies, dtype=bool, count=len(draws))
    if 2 * keep.sum() < keep.size:
        raise ModelError(
            f"{model.vehicle.name}: {keep.size - keep.sum()} of {keep.size} vehicles drawn from what is "
            "known diverge; state narrower knowledge (--prior 0.05) or check the coefficients"
        )
    return draws[keep]
