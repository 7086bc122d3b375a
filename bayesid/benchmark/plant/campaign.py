"""A campaign: a vehicle that differs from its file, the runs it makes, the disturbance it meets.

Takes: what was drawn (`draw`). Gives a frozen `Campaign` that holds the whole truth.
Does not: run it (`execute_campaign`) or write it (`bundles`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesid.benchmark.plant.orders import RunPlan
from bayesid.benchmark.plant.settings import settings
from bayesid.model.vehicles import Vehicle


@dataclass(frozen=True)
class Planted:
    """One thing that is wrong: contract name ("" outside it), form, kind, size, parameters and settings."""

    name: str
    variant: str
    kind: str
    size: float
    parameters: dict[str, float]
    fields: dict[str, float]


@dataclass(frozen=True)
class Disturbance:
    """Process noise: force amplitudes X Y N Z M over the typical force of the axis, times [s], drift [m]."""

    sea: str
    amplitude: tuple[float, ...] = (0.0,) * 5
    tau: float = 1.0
    drift: float = 0.0
    drift_tau: float = 1.0
    outliers: float = 0.0
    gaps: bool = False


@dataclass(frozen=True, eq=False)
class Campaign:
    """Settings and truth of one campaign; `coef` are the true coefficients in file units."""

    seed: int
    attempt: int
    kind: str
    vehicle: Vehicle
    vehicle_name: str
    dof: int
    sensors: str
    prior_sd: float
    rich: bool
    planted: tuple[Planted, ...]
    coef: dict[str, float]
    coefficient_error: dict[str, float]
    disturbance: Disturbance
    sigma: dict[str, float]
    runs: tuple[RunPlan, ...]

    @property
    def gap(self) -> np.void:
        """All settings together."""
        total: dict[str, float] = {}
        for planted in self.planted:
            for field, value in planted.fields.items():
                total[field] = total.get(field, 0.0) + value
        return settings(total)

    @property
    def label(self) -> str:
        """none, the names joined by +, or outside."""
        if not self.planted:
            return "none"
        return "+".join("outside" if p.kind == "outside" else p.name for p in self.planted)

    def rng(self, stream: str, *more: int) -> np.random.Generator:
        return stream_of(self.seed, self.attempt, stream, *more)


STREAMS = ("design", "effects", "coefficients", "runs", "sea", "sensors", "process", "noise")


def stream_of(seed: int, attempt: int, stream: str, *more: int) -> np.random.Generator:
    """A generator of its own for each aspect, so that fixing one factor leaves the other draws alone."""
    return np.random.default_rng([seed, attempt, STREAMS.index(stream), *more])


def still(campaign: Campaign) -> Campaign:
    """The same campaign without process noise, drift, outliers and gaps."""
    return replace(campaign, disturbance=Disturbance("still"))
