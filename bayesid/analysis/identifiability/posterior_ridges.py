"""Which combinations of coefficients a sampled posterior fixes and which it leaves open, from its draws.

Takes draws and the covariance of the prior, optionally that of the Laplace approximation beside it.
Gives `Ridges`: eigenvectors of the posterior covariance in units of the prior, over all coefficients and over
groups that stand in for each other. Does not sample, judge convergence or choose sentences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bayesid.analysis.identifiability.open_directions import FAMILIES, OPEN_DATA_SHARE, family_of
from bayesid.estimation.output_error.flat_directions import combination, varimax

Array = np.ndarray
Status = Literal["fixed", "narrowed", "open"]
FIXED = 0.1  # sd over prior sd up to which a combination counts as fixed
OPEN = float(
    np.sqrt(OPEN_DATA_SHARE)
)  # and from which it counts as open: most of the variance is the prior's
TIED = 0.8  # correlation from which two coefficients stand in for each other


@dataclass(frozen=True, eq=False)
class Combination:
    """A combination of coefficients, each in units of its prior sd.

    Attributes
    ----------
    names : (g,)
    vector : (g,) unit vector
    left : posterior sd over prior sd along it, from draws
    laplace : the same by the Laplace approximation; nan without one
    """

    names: tuple[str, ...]
    vector: Array
    left: float
    laplace: float

    @property
    def name(self) -> str:
        """ "0.71 X_vr - 0.70 X_vv"."""
        return combination(self.names, self.vector)

    @property
    def status(self) -> Status:
        return "fixed" if self.left <= FIXED else "open" if self.left >= OPEN else "narrowed"

    @property
    def shared(self) -> bool:
        """Whether it joins two coefficients or more."""
        return len(self.name.split()) > 2


@dataclass(frozen=True, eq=False)
class Group:
    """Coefficients that stand in for each other, and what is known of their combinations.

    Attributes
    ----------
    names : (g,)
    family : "vv/vr/rr of X" where they are rows of one family, else ""
    correlation : largest |correlation| of two of them
    combinations : (g,) best known first
    """

    names: tuple[str, ...]
    family: str
    correlation: float
    combinations: tuple[Combination, ...]

    @property
    def best(self) -> Combination:
        return self.combinations[0]

    @property
    def worst(self) -> Combination:
        return self.combinations[-1]

    @property
    def contrast(self) -> float:
        """How many times less is known along the open end than along the fixed one."""
        return self.worst.left / max(self.best.left, 1e-300)


@dataclass(frozen=True, eq=False)
class Ridges:
    """What draws say about k coefficients together.

    Attributes
    ----------
    names : (k,)
    left : (k,) posterior over prior sd of every coefficient by itself
    combinations : (k,) of all coefficients, best known first
    groups : strongest ridge first
    """

    names: tuple[str, ...]
    left: Array
    combinations: tuple[Combination, ...]
    groups: tuple[Group, ...]

    @property
    def ridge(self) -> Group | None:
        """The group whose open end is most in contrast with a combination the runs do know; None where no
        combination of two coefficients is better known than they are."""
        return next(
            (g for g in self.groups if g.worst.status != "fixed" and g.best.shared and g.correlation >= 0.5),
            None,
        )


def ridges(names: Sequence[str], draws: Array, prior: Array, laplace: Array | None = None) -> Ridges:
    """Combinations a posterior fixes and leaves open.

    Parameters
    ----------
    names : (k,) coefficients
    draws : (m, k) of the posterior [SI]
    prior : (k, k) covariance of the prior [SI]; a coefficient of infinite variance is left out
    laplace : (k, k) covariance of the Laplace approximation [SI]
    """
    keep = np.flatnonzero(np.isfinite(np.diag(prior)) & (np.diag(prior) > 0))
    kept = tuple(names[int(i)] for i in keep)
    unit = np.sqrt(np.diag(prior)[keep])
    scale = np.outer(unit, unit)
    known = np.atleast_2d(np.cov(draws[:, keep] / unit, rowvar=False))
    before = prior[np.ix_(keep, keep)] / scale
    second = None if laplace is None else laplace[np.ix_(keep, keep)] / scale
    return ridges_of(kept, known, before, second)


def ridges_of(names: Sequence[str], known: Array, before: Array, second: Array | None = None) -> Ridges:
    """The same from covariances (k, k) of posterior and prior, both in units of the prior sd."""
    kept = tuple(names)
    whole = _combinations(kept, np.arange(len(kept)), known, before, second)
    left = np.sqrt(np.diag(known))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.nan_to_num(known / np.outer(left, left))
    groups = [
        Group(
            tuple(kept[i] for i in where),
            family,
            float(np.abs(correlation[np.ix_(where, where)] - np.eye(where.size)).max()),
            _combinations(kept, where, known, before, second),
        )
        for where, family in _groups(kept, correlation)
    ]
    return Ridges(kept, left, whole, tuple(sorted(groups, key=lambda g: -g.contrast)))


def _combinations(
    names: Sequence[str], where: Array, known: Array, before: Array, second: Array | None
) -> tuple[Combination, ...]:
    """Eigenvectors of a part of the posterior covariance, the open ones turned to few names each."""
    part = np.ix_(where, where)
    values, vectors = np.linalg.eigh(known[part])
    rows = vectors.T.copy()
    loose = np.sqrt(np.maximum(values, 0.0)) >= OPEN
    if loose.sum() > 1:
        rows[loose] = varimax(rows[loose])
    found = []
    for row in rows:
        row = row * (np.sign(row[np.argmax(np.abs(row))]) or 1.0)
        held = float(np.sqrt(row @ before[part] @ row))
        left = float(np.sqrt(max(row @ known[part] @ row, 0.0))) / held
        other = float("nan") if second is None else float(np.sqrt(max(row @ second[part] @ row, 0.0))) / held
        found.append(Combination(tuple(names[int(i)] for i in where), row, left, other))
    return tuple(sorted(found, key=lambda c: c.left))


def _groups(names: Sequence[str], correlation: Array) -> list[tuple[Array, str]]:
    """Families of rows of one axis, and coefficients tied by their correlation across them."""
    found: list[tuple[Array, str]] = []
    for family in FAMILIES:
        for axis in "XYZKMN":
            where = [i for i, n in enumerate(names) if n[0] == axis and family_of(n) == family]
            if len(where) > 1:
                found.append((np.array(where), f"{family} of {axis}"))
    linked = np.abs(correlation) >= TIED
    seen: set[int] = set()
    for first in range(len(names)):
        if first in seen:
            continue
        chain, reached = [first], {first}
        while chain:
            for j in map(int, np.flatnonzero(linked[chain.pop()])):
                if j not in reached:
                    reached.add(j)
                    chain.append(j)
        seen |= reached
        if len(reached) > 1 and not any(reached <= set(where.tolist()) for where, _ in found):
            found.append((np.array(sorted(reached)), ""))
    return found
