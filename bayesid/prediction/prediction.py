"""A predicted run: draws over causes, parameters, start and disturbance, what is told, its 95 % band.

Plain arrays. Does not simulate (`run_prediction`, `manoeuvre_prediction`).

What is told of coefficients that were fitted is the mean of the draws. Where they are as given the draws come
from what is stated of them, often a third of their value, and the mean of such tracks is the track of no
vehicle: there it is the model that the diagnosis shows, and the draws give the band alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.estimation.run_data import Array

INTERVAL_LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Centre:
    """One explanation as it is, undisturbed: its weight, readings (n, q), in a closed loop (n,) orders as in
    `Prediction.orders`."""

    weight: float
    readings: Array
    orders: Mapping[str, Array] | None = None


@dataclass(frozen=True, eq=False)
class Prediction:
    """A predicted run.

    Attributes
    ----------
    name, manoeuvre : as given
    t : (n,) [s]
    channels : (q,) names
    draws : (k, n, q) readings without white noise [SI]
    commands : name -> (n,) orders; in a closed loop those of the first draw
    orders : name -> (k, n) orders of every draw in a closed loop, and under `ORDER_TIMES` since when each is
        given [s]; None otherwise
    lead : length of the lead-in whose readings were used [s], 0 for a manoeuvre
    lost : draws that diverged
    noise : (q,) white noise of the sensors, nan where none is known
    given : (n, q) the vehicle as given, without disturbance; None where it diverges or ends at another time
    given_orders : name -> (n,) its orders in a closed loop, None otherwise
    vehicles : (k,) which of the drawn vehicles each draw is; all of them, in order, by default
    occasion : number of the run among those the vehicles are followed through
    centres : explanations with coefficients as given, or the estimate of a fit of whose draws some diverge:
        they add up to what is told; empty elsewhere, or where one diverges
    estimate : the estimate of a fit as it is, undisturbed; None of a diagnosis, or where it diverges
    """

    name: str
    manoeuvre: str
    t: Array
    channels: tuple[str, ...]
    draws: Array
    commands: Mapping[str, Array]
    orders: Mapping[str, Array] | None
    lead: float
    lost: int
    noise: Array
    given: Array | None = None
    given_orders: Mapping[str, Array] | None = None
    vehicles: Array = None  # type: ignore[assignment]
    occasion: int = 0
    centres: tuple[Centre, ...] = ()
    estimate: Centre | None = None

    def __post_init__(self) -> None:
        if self.vehicles is None:
            object.__setattr__(self, "vehicles", np.arange(len(self.draws)))

    def about_estimate(self) -> Prediction:
        """The same, told by the estimate where draws about it diverge.

        Those that are left are of a law that reaches beyond what the estimate stands for. Of seven held-out
        runs of a ship in which 7 to 49 of 300 diverged their mean missed the position by 12 m (geometric
        mean), their median by 12 m, the estimate by 7 m; the heading by 14, 24 and 16 degrees.
        """
        return replace(self, centres=(self.estimate,)) if self.lost and self.estimate else self

    def sensor_noise(self, seed: int) -> np.random.Generator:
        """Generator of the white noise of the sensors in this run."""
        return generator_of(seed, self.occasion, 1) if self.occasion else np.random.default_rng(seed)

    @property
    def mean(self) -> Array:
        """(n, q) mean of the draws."""
        return self.draws.mean(axis=0)

    @property
    def told(self) -> Array:
        """(n, q) what is predicted: the centres, else the mean of the draws."""
        if not self.centres:
            return self.mean
        whole = sum(c.weight for c in self.centres)
        return np.asarray(sum(c.weight / whole * c.readings for c in self.centres))

    def band(
        self, level: float = INTERVAL_LEVEL, rng: np.random.Generator | None = None
    ) -> tuple[Array, Array]:
        """(n, q) limits between which a reading lies with this probability, sample by sample.

        Parameters
        ----------
        rng : adds the white noise of the sensors; without it the band is for what they would read on average
        """
        draws = self.draws
        if rng is not None:
            draws = draws + np.nan_to_num(self.noise) * rng.standard_normal(draws.shape)
        low, high = np.quantile(draws, (0.5 - 0.5 * level, 0.5 + 0.5 * level), axis=0)
        return low, high


def generator_of(seed: int, *use: int) -> np.random.Generator:
    """Random numbers of one use, independent of those of the seed itself and of other uses."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=use))
