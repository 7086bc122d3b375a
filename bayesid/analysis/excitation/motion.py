"""Body motion of one run, with its rate: what a regression of forces reads.

Takes a simulated run, or (see `track_smoother`) a logged one. Gives a frozen `Motion`. Does not know
coefficients, except where it asks a model for the exact accelerations of its own run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.simulation import TimePlan, positions_at_samples, rates_on, simulate

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion at n points of one run.

    Attributes
    ----------
    name : of the run
    t : (n,) [s]
    gap : (n,) time each point stands for [s]
    states : (n, nx) pose and velocity over ground, order of `Model.states`
    rate : (n, nv) velocity rates [m/s^2, rad/s^2], order of the kernel's velocities
    actuators : (n, na) positions, order of the kernel's actuators [rad, rpm]
    sd, rate_sd : (n, nx) and (n, nv) one standard deviation of both
    edges : (n+1,) ends of the intervals the points are the middles of; None for points in time
    """

    name: str
    t: Array
    gap: Array
    states: Array
    rate: Array
    actuators: Array
    sd: Array
    rate_sd: Array
    edges: Array | None = None


def exact_motion(model: Model, par: Array, plan: TimePlan, x0: Array, name: str = "simulated") -> Motion:
    """Motion of a simulated run at its samples, free of noise, rates from the equations themselves.

    Parameters
    ----------
    par : (n,) parameter vector, SI, effects off
    plan, x0 : as in `simulate`
    """
    track = simulate(model, par, plan, x0, full=False)
    positions = positions_at_samples(model, par, plan, full=False)
    rate, _, _ = rates_on(model, par, track.states, positions, np.zeros(0, dtype=np.int64))
    nothing = np.zeros_like(track.states)
    gap = np.gradient(plan.t)
    return Motion(name, plan.t, gap, track.states, rate, positions, nothing, np.zeros_like(rate))
