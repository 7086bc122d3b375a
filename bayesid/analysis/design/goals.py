"""What the next manoeuvre is for: shrink what is still flat, predict a wanted run, or tell two causes apart.

A goal takes information matrices (one per vehicle drawn, executed runs included) and gives one number,
larger is better, and the same in a unit the reader knows. The third goal lives in `discrimination`, it needs
the gap diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bayesid.analysis.design.criteria import flat_space, gain, posterior
from bayesid.analysis.design.information import Logging, RunInformation, columns, planned
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.equations.model import Model
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre

Array = np.ndarray


class Goal(Protocol):
    """What every goal answers."""

    @property
    def name(self) -> str:
        """What it is for."""

    @property
    def unit(self) -> str:
        """Of `shown`."""

    def value(self, matrices: Array) -> float:
        """Larger is better; `matrices` (d, k, k) of all runs together."""

    def shown(self, matrices: Array) -> float:
        """The same in `unit`."""


@dataclass(frozen=True, eq=False)
class InformationGoal:
    """Everything counts: expected information gain (Bayesian D)."""

    name: str = "learn most about all coefficients"
    unit: str = "information gain [nats]"

    def value(self, matrices: Array) -> float:
        return float(np.mean(gain(matrices)))

    def shown(self, matrices: Array) -> float:
        return self.value(matrices)


@dataclass(frozen=True, eq=False)
class ContractionGoal:
    """Directions the executed runs left open (Bayesian A, restricted to them).

    space : (k, m) orthonormal columns
    """

    space: Array
    name: str = "shrink the directions left open"
    unit: str = "mean share of variance left in them"

    def value(self, matrices: Array) -> float:
        return -self.shown(matrices)

    def shown(self, matrices: Array) -> float:
        left = posterior(matrices)
        return float(np.mean(np.einsum("im,dij,jm->d", self.space, left, self.space))) / self.space.shape[1]


def shrink(now: RunInformation) -> ContractionGoal:
    """Goal: the directions that keep more than a quarter of their variance after the runs executed so far."""
    space = flat_space(now)
    if not space.shape[1]:
        space = flat_space(now, keep=0.0)[:, :1]
    return ContractionGoal(space)


@dataclass(frozen=True, eq=False)
class PredictionGoal:
    """Readings of a wanted manoeuvre (I-optimal: mean variance; G-optimal: the worst one).

    rows : (d, n, k) whitened sensitivities of its readings, per vehicle drawn
    scatter : (k, k) covariance by which the coefficients of a single run differ from the vehicle's
    """

    rows: Array
    wanted: str
    worst: bool = False
    unit: str = "rms error of its prediction over sensor noise"
    scatter: Array | float = 0.0

    @property
    def name(self) -> str:
        return f"predict {self.wanted}" + (", worst reading" if self.worst else "")

    def variance(self, matrices: Array) -> Array:
        """(d, n) predicted variance of every reading over that of its noise."""
        left = posterior(matrices) + self.scatter
        return np.asarray(np.einsum("dni,dij,dnj->dn", self.rows, left, self.rows))

    def value(self, matrices: Array) -> float:
        return -float(np.log(self.shown(matrices)))

    def shown(self, matrices: Array) -> float:
        variance = self.variance(matrices)
        each = np.max(variance, axis=1) if self.worst else np.mean(variance, axis=1)
        return float(np.sqrt(np.mean(each)))


def predict(
    model: Model,
    knowledge: Knowledge,
    draws: Array,
    wanted: Manoeuvre,
    logging: Logging,
    worst: bool = False,
    scatter: Array | float = 0.0,
) -> PredictionGoal:
    """Goal: the track of a wanted manoeuvre, executed from a known start by every vehicle drawn.

    A closed-loop manoeuvre is replayed with the orders it gave, as a fit predicts it.
    """
    rows = []
    for par in draws:
        execution = planned(model, par, wanted, logging)
        rows.append(prediction_rows(model, knowledge, par, execution.run))
    return PredictionGoal(np.array(rows), wanted.name, worst, scatter=scatter)


def prediction_rows(model: Model, knowledge: Knowledge, par: Array, run: RunData, most: int = 60) -> Array:
    """(n, k) whitened sensitivities by xi of at most `most` instants of a run, its start known."""
    by_xi, _ = columns(model, knowledge, par, run)
    pick = np.unique(np.linspace(0, len(by_xi) - 1, min(most, len(by_xi))).astype(int))
    return by_xi[pick].reshape(-1, by_xi.shape[2])
