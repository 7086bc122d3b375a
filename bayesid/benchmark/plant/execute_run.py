"""Run one run: orders in, a finely recorded track out.

Takes: a `Body`, settings, orders known beforehand or a law that sees the state, process forces.
Does not: add sensor errors (`sensing`) or noise (`noise`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesid.benchmark.plant.advance import SERVO, follow, interval
from bayesid.benchmark.plant.body import Body
from bayesid.benchmark.plant.motion import N_STATES
from bayesid.errors import ModelError

ORDERS = ("delta_r_cmd", "delta_s_cmd", "n_cmd")
STEP = 0.02  # longest Runge-Kutta step in L/U
NO_DISTURBANCE = np.zeros((1, 5))

Law = Callable[[float, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class PlantTrack:
    """What happened.

    t : (n,) sample times [s]; orders : (n, 3) rudder, stern plane [rad], rpm given at the samples
    fine : (m,) times; states : (m, 16); fins : (m, 2) true angles; every `parts`-th fine row is a sample
    """

    t: np.ndarray
    orders: np.ndarray
    fine: np.ndarray
    states: np.ndarray
    fins: np.ndarray
    parts: int


def start_state(
    u: float, heading: float, depth: float, gap: np.void, place: tuple[float, float]
) -> np.ndarray:
    """(16,) straight run through the water at speed u [m/s], carried along by the current of t = 0."""
    x = np.zeros(N_STATES)
    x[0], x[1], x[2], x[5] = place[0], place[1], depth, heading
    c, s = math.cos(heading), math.sin(heading)
    north = gap["vn"] + gap["tide_n"] * math.sin(gap["tide_p"])
    east = gap["ve"] + gap["tide_e"] * math.sin(gap["tide_p"])
    x[6], x[7] = u + c * north + s * east, c * east - s * north
    return x


def execute_run(
    body: Body,
    gap: np.void,
    t: np.ndarray,
    orders: np.ndarray | Law,
    x0: np.ndarray,
    sea: np.ndarray = NO_DISTURBANCE,
    spacing: float = 1.0,
    step: float = STEP,
) -> PlantTrack:
    """Carry the vehicle through a run.

    Parameters
    ----------
    t : (n,) evenly spaced sample times from 0 [s]
    orders : (n, 3) rudder, stern plane [rad] and rpm, or a law (t, state (12,)) -> (3,) asked at each sample
    x0 : (16,) state at t = 0
    sea : (k, 5) process forces X Y N Z M on a grid of `spacing` [s]
    step : longest step in L/U

    Raises
    ------
    ModelError                 the state leaves the numbers a vehicle can have; says when
    """
    number = body.number
    dt = float(t[1] - t[0])
    parts = max(1, math.ceil(dt / (step * number["L"] / number["U0"]) - 1e-9))
    x, servo = np.array(x0, dtype=float), np.zeros(SERVO)
    given = np.zeros((t.size, 3))
    track = np.empty(((t.size - 1) * parts + 1, N_STATES + 2))
    late = float(gap["dead"])
    due: list[tuple[float, float]] = []
    for k in range(t.size - 1):
        given[k] = orders(float(t[k]), x[:12]) if callable(orders) else orders[k]
        if k == 0:
            follow(servo, given[0, 0], gap, True)
            servo[0], servo[3] = servo[2], given[0, 1]
            stops = number["dr_max"], number["ds_max"]
            fins = np.clip((servo[0], servo[3]), np.negative(stops), stops)
            track[0] = np.append(x, fins + (gap["offset"], gap["s_offset"]))
        due.append((t[k] + late, given[k, 0]))
        now = [order for order in due if order[0] < t[k + 1] - 1e-9]
        due = due[len(now) :]
        changes, values = np.array(now, dtype=float).reshape(-1, 2).T.copy()
        interval(
            x, servo, t[k], t[k + 1], parts, changes, values, given[k, 1], given[k, 2], body.packed, gap,
            sea, spacing, track[1 + k * parts : 1 + (k + 1) * parts],
        )  # fmt: skip
        if not (np.abs(x[6:9]).max() < 6 * number["U0"] and abs(x[4]) < 0.7 and abs(x[3]) < 0.8):
            raise ModelError(f"plant: the vehicle is out of control {t[k + 1]:g} s into the run")
    given[-1] = given[-2]
    fine = np.append(np.repeat(t[:-1], parts) + np.tile(np.arange(parts) * dt / parts, t.size - 1), t[-1])
    return PlantTrack(t, given, fine, track[:, :N_STATES], track[:, N_STATES:], parts)
