"""Mean wind of one run from its motion: ship and wind fitted together, wind columns unread.

Takes a run without wind columns and a ship with what is known of it. Gives the wind and its covariance.
Does not read an anemometer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.errors import ModelError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.posterior import coefficient_posterior
from bayesid.estimation.output_error import FitOptions
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import TrialFit
from bayesid.model.vehicles import CoefficientPrior, Vehicle
from bayesid.trials import Run, Trial

Array = np.ndarray
BLOWING = ("wind.blowing_north", "wind.blowing_east")
SHAPE = ("wind.side", "wind.centre", "wind.centre_moves")  # of its coefficients over direction
# The wind drives the water, by a share with a prior of its own. A current of each run, free in both
# components, is not told from a wind by its motion: directions came out 52 degrees off.
WATER = "wind.water"
PIECE, ROUNDS = 60.0, 8  # s
#: memory of the residuals, excess between pieces, power of the readings: as in the fits of the same logs
PARTS = NoiseParts(3, 2.0, 0.0, 0.05, 0.05)
NAMED = 9.21  # chi-square of two numbers, probability 1 %


@dataclass(frozen=True, eq=False)
class MotionWind:
    """Where the air goes, (2,) mean [m/s] to x0 and y0, and its (2, 2) covariance."""

    run: str
    mean: Array
    covariance: Array
    status: str

    @property
    def evidence(self) -> float:
        """Chi-square of no wind."""
        return float(self.mean @ np.linalg.solve(self.covariance, self.mean))

    @property
    def direction_sd(self) -> float:
        """Sd of the direction [rad], to first order, at most that of no knowledge."""
        speed = max(float(np.hypot(*self.mean)), 1e-9)
        across = np.array([-self.mean[1], self.mean[0]]) / speed
        return min(float(np.sqrt(across @ self.covariance @ across)) / speed, float(np.pi / np.sqrt(3.0)))

    def record(self) -> dict[str, Any]:
        return {
            "mean": self.mean.tolist(), "covariance": self.covariance.tolist(), "status": self.status,
            "evidence": self.evidence, "direction_sd": self.direction_sd,
        }  # fmt: skip


def unread(run: Run) -> Run:
    """The run without its wind columns."""
    return replace(run, role="identify", exogenous={})


def wind_of(trial: Trial, run: Run, ship: Vehicle, free: Sequence[str], seed: int) -> MotionWind:
    """Wind of one run, with everything the ship's prior leaves open.

    Raises
    ------
    ModelError
        if the ship diverges at the estimate
    """
    found = fit_in_pieces(
        replace(trial, runs=(unread(run),)), PIECE, ship, None, free=(*free, *SHAPE, WATER, *BLOWING),
        options=FitOptions(seed=seed, profile=True, rounds=ROUNDS), parts=PARTS,
    )  # fmt: skip
    # with the parts of noise that the pieces of the run ask for: those given are for the estimate
    posterior = coefficient_posterior(found.problem, found.fit.z)
    where = [posterior.names.index(n) for n in BLOWING]
    covariance = posterior.kept_prior[np.ix_(where, where)]
    return MotionWind(run.name, posterior.estimate[where], covariance, found.fit.status)


def informed(found: TrialFit, ship: Vehicle) -> Vehicle:
    """The ship at the estimate of a fit, known as well as readings and prior leave it."""
    posterior = found.posterior
    if posterior is None:
        raise ModelError("the fit has no posterior: the ship diverges at its estimate")
    rows = [i for i, n in enumerate(posterior.names) if n in ship.coef]
    names = tuple(posterior.names[i] for i in rows)
    unit = np.array([found.model.file_scale(n) for n in names])
    values = dict(zip(names, (posterior.estimate[rows] / unit).tolist(), strict=True))
    covariance = posterior.kept_prior[np.ix_(rows, rows)] / np.outer(unit, unit)
    known = {n: sd for n, sd in (ship.prior.relative_sd if ship.prior else {}).items() if n not in values}
    shape = {n: posterior.names.index(n) for n in SHAPE}
    return replace(
        ship, coef=ship.coef | values, prior=CoefficientPrior(known, names, covariance),
        effects={n: float(posterior.estimate[i]) for n, i in shape.items()},
        effects_sd={n: float(np.sqrt(posterior.kept_prior[i, i])) for n, i in shape.items()},
    )  # fmt: skip
