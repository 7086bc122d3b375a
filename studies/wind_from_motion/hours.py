"""Winds of runs flown within hours of one another: one wind that changes slowly, and what single runs err.

Takes the wind each run tells by itself and the middle of the run. Gives winds told by all of them. Does not
read an anemometer.

Each component of the wind is a Gaussian process in time with an exponential correlation. A run tells it with
its stated covariance and a further error that no other run shares, whose size the disagreement of runs of the
same hour shows (random effects: Gelman et al. 2013, section 5.4). That error is partly a wind the run alone
had, a gust of its minutes, and partly a mistake of the ship's model; the motion does not part them, and every
share is as likely. Sizes are the most probable ones under wide log-normal priors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from studies.wind_from_motion.estimate import MotionWind

Array = np.ndarray
# Centre and sd of the logarithm of: sd of the wind [m/s], its correlation time [s], further error of a run.
PRIOR = ((2.0, 0.7), (2 * 3600.0, 0.7), (0.3, 1.0))
OWN = (0.1, 0.3, 0.5, 0.7, 0.9)  # shares of the further error's variance that are a wind of the run alone


@dataclass(frozen=True, eq=False)
class SharedWinds:
    """Winds told by all runs; `sd`, `time` and `scatter` are those of `PRIOR` as found."""

    winds: Mapping[str, MotionWind]
    sd: float
    time: float
    scatter: float


def shared_winds(alone: Sequence[MotionWind], middle: Sequence[float]) -> SharedWinds:
    """The winds of runs, each told by itself and by the others.

    Parameters
    ----------
    middle : of each run, on one clock [s]
    """
    apart = np.abs(np.subtract.outer(np.asarray(middle), np.asarray(middle)))
    read: Array = np.concatenate([w.mean for w in alone])
    stated = np.zeros((read.size, read.size))
    for i, wind in enumerate(alone):
        stated[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = wind.covariance
    centre, width = np.array(PRIOR).T

    own = np.eye(read.size, dtype=float)

    def slow(sd: float, time: float) -> Array:
        return np.asarray(np.kron(sd**2 * np.exp(-apart / time), np.eye(2)))

    def cost(x: Array) -> float:
        sd, time, scatter = np.exp(x)
        lower = cholesky(slow(sd, time) + scatter**2 * own + stated, lower=True)
        z = solve_triangular(lower, read, lower=True)
        far = (x - np.log(centre)) / width
        return float(np.log(np.diag(lower)).sum() + 0.5 * z @ z + 0.5 * far @ far)

    sd, time, scatter = np.exp(minimize(cost, np.log(centre), method="BFGS").x)
    told = cho_factor(slow(sd, time) + scatter**2 * own + stated)
    means, covariances = [], []
    for share in OWN:
        wind = slow(sd, time) + share * scatter**2 * own
        gain = cho_solve(told, wind).T
        means.append(gain @ read)
        covariances.append(wind - gain @ wind)
    mean = np.mean(means, axis=0)
    covariance = np.mean(covariances, axis=0) + np.cov(np.transpose(means), ddof=0)
    found = {
        one.run: MotionWind(
            one.run, mean[2 * i : 2 * i + 2], covariance[2 * i : 2 * i + 2, 2 * i : 2 * i + 2], one.status
        )
        for i, one in enumerate(alone)
    }  # fmt: skip
    return SharedWinds(found, float(sd), float(time), float(scatter))
