"""One run as the estimators see it: inputs, readings, noise and what is known of the initial state.

Takes arrays. Gives `RunData`. Does not simulate; the readers beside each estimator fill it from a logged run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.model.channels import channel
from bayesid.simulation import TimePlan

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class RunData:
    """Readings of one run.

    Attributes
    ----------
    name : for messages and tables
    plan : time grid and inputs
    channels : (c,) names of the readings compared
    readings : (n, c) SI; NaN where a sample is missing or set aside
    sigma : (c,) one sigma of white noise, SI
    x0 : (nx,) initial state; the centre of its prior where it is free
    initial : names of the states whose initial value is unknown
    initial_sd : (k,) prior standard deviation of those, inf for none
    manoeuvre, role : as in the trial bundle
    path : (n, nx) first guess of the states, from the readings; empty for output error, which needs none
    straight : nothing ordered, course kept: what moves the vehicle sideways is the environment
    jumps : (n-1, nx) standard deviation by which the state may jump at the end of each interval; None unless
        an event took the vehicle or its navigation out of the model's hands
    """

    name: str
    plan: TimePlan
    channels: tuple[str, ...]
    readings: Array
    sigma: Array
    x0: Array
    initial: tuple[str, ...] = ()
    initial_sd: Array = field(default_factory=lambda: np.zeros(0))
    manoeuvre: str = ""
    role: str = "identify"
    path: Array = field(default_factory=lambda: np.zeros((0, 0)))
    straight: bool = False
    jumps: Array | None = None

    def __post_init__(self) -> None:
        n, c = self.plan.t.size, len(self.channels)
        if self.readings.shape != (n, c) or np.shape(self.sigma) != (c,):
            raise FitError(
                f"run {self.name!r}: readings {self.readings.shape} and noise {np.shape(self.sigma)} "
                f"do not match {n} samples of {c} channels"
            )
        if not (np.isfinite(self.sigma).all() and (np.asarray(self.sigma) > 0).all()):
            bad = [f"{k} ({s})" for k, s in zip(self.channels, self.sigma, strict=True) if not s > 0]
            raise FitError(f"run {self.name!r}: noise must be positive, not {', '.join(bad) or 'nan'}")

    @property
    def n(self) -> int:
        """Number of samples."""
        return int(self.plan.t.size)

    @cached_property
    def valid(self) -> Array:
        """(n, c) which readings count, row by row: in another order every filter is compiled again."""
        return np.ascontiguousarray(np.isfinite(self.readings))

    @property
    def circular(self) -> Array:
        """(c,) True for angles compared modulo a turn."""
        return np.array([channel(c).circular for c in self.channels])

    def positions(self, model: Model) -> list[int]:
        """(c,) positions of the channels among those the model gives."""
        return [model.kernel.channels.index(c) for c in self.channels]

    def residuals(self, simulated: Array) -> Array:
        """(n, c) simulated minus read, over sigma; circular channels by the shortest way; 0 where missing."""
        difference = simulated - self.readings
        around = self.circular
        if around.any():
            difference[:, around] = np.remainder(difference[:, around] + np.pi, 2 * np.pi) - np.pi
        return np.where(self.valid, difference / self.sigma, 0.0)

    def without(self, bad: Array) -> RunData:
        """The run with some readings, (n, c) bool, set aside."""
        return replace(self, readings=np.where(bad, np.nan, self.readings))

    def with_sigma(self, sigma: Mapping[str, float]) -> RunData:
        """The run with other noise for some channels."""
        values = [sigma.get(c, s) for c, s in zip(self.channels, self.sigma, strict=True)]
        return replace(self, sigma=np.array(values, dtype=float))
