"""One run of a vehicle with other equations: orders or a law in, a fine record and clean readings out.

Takes: a vehicle, causes, sample times, orders known beforehand or a law that sees the readings, a
disturbing force. Steering gear and shaft answer to orders alone, so that they are carried beside the motion
and a piece of a run can be started anywhere. Does not add noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit

from bayesid.benchmark.other_equations.vehicles import OtherVehicle
from bayesid.benchmark.plant.servo import servo_at
from bayesid.errors import ModelError

CHANNELS = ("x", "y", "psi", "r", "u", "v")
Law = Callable[[float, dict[str, float]], tuple[float, float]]
Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Record:
    """What happened: sample times, (n, 2) orders of rudder [rad] and shaft [rpm], and on the fine grid times,
    (m, 12) states, rudder [rad] and shaft [1/s], its mean over the step that follows; every `parts`-th fine
    row is a sample."""

    t: Array
    orders: Array
    fine: Array
    states: Array
    rudder: Array
    shaft: Array
    parts: int


@cache
def _stepper(rates: Callable[..., None]) -> Callable[..., None]:
    """Compiled Runge-Kutta of fourth order over a fine grid.

    Rudder and force are linear within a step; the shaft, which may jump at an order, is constant.
    """

    @njit
    def carry(t0, x, rudder, shaft, sea, h, b, g, out):  # pragma: no cover - compiled
        k1, k2, k3, k4 = np.empty(12), np.empty(12), np.empty(12), np.empty(12)
        out[0] = x
        for i in range(rudder.size - 1):
            t, y, n = t0 + i * h, out[i], shaft[i]
            d, f = 0.5 * (rudder[i] + rudder[i + 1]), 0.5 * (sea[i] + sea[i + 1])
            rates(t, y, rudder[i], n, sea[i], b, g, k1)
            rates(t + 0.5 * h, y + 0.5 * h * k1, d, n, f, b, g, k2)
            rates(t + 0.5 * h, y + 0.5 * h * k2, d, n, f, b, g, k3)
            rates(t + h, y + h * k3, rudder[i + 1], n, sea[i + 1], b, g, k4)
            out[i + 1] = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    return carry


def carried(
    vehicle: OtherVehicle, g: np.void, t0: float, x: Array, rudder: Array, shaft: Array, h: float,
    sea: Array | None = None,
) -> Array:  # fmt: skip
    """(m, 12) states on the grid of `rudder` and `shaft`, from x at t0."""
    out = np.empty((rudder.size, 12))
    force = np.zeros((rudder.size, 3)) if sea is None else sea
    _stepper(vehicle.rates)(t0, np.asarray(x, float), rudder, shaft, force, h, vehicle.numbers, g, out)
    return out


@njit(cache=True)
def _gear(given, start, lag, own, rate, h, held, out):
    """Rudder on the fine grid: a lag in the order, then the vehicle's own lag and rate; `held` jams it."""
    late, angle = start[0], start[1]
    for i in range(given.size):
        late = given[i] if lag <= 0.0 else late + (given[i] - late) * (1.0 - math.exp(-h / lag))
        if not held[i]:
            angle = servo_at(angle, late, own, rate, h)
        out[i] = angle
    start[0], start[1] = late, angle


class Gear:
    """Steering gear and shaft of one run: an order per sample in, fine rudder angles and shaft speeds out."""

    def __init__(self, vehicle: OtherVehicle, g: np.void, dt: float, parts: int) -> None:
        self.vehicle, self.g, self.parts, self.h = vehicle, g, parts, dt / parts
        self.late = round(float(g["dead"]) / self.h)
        self.rate = 1.0 / (1.0 / vehicle.rudder_rate + float(g["slow"]))
        self.waiting: list[float] = []
        self.state = np.zeros(2)
        self.turns = 0.0
        self.at = 0

    def begin(self, rudder: float, rpm: float) -> float:
        """Angle before the first order: that order as if it had long been held."""
        self.waiting = [rudder] * self.late
        self.state[:] = rudder
        self.turns = rpm / 60.0
        return float(self._stops(np.array([rudder]))[0])

    def follow(self, rudder: float, rpm: float) -> tuple[Array, Array]:
        """Rudder at the ends of the steps of the next sample interval, and mean shaft speeds over them."""
        self.waiting += [rudder] * self.parts
        given, self.waiting = np.array(self.waiting[: self.parts]), self.waiting[self.parts :]
        times = (self.at + np.arange(self.parts)) * self.h
        held = (times >= self.g["jam_from"]) & (times < self.g["jam_from"] + self.g["jam_for"])
        out = np.empty(self.parts)
        lag, own = float(self.g["lag"]), self.vehicle.rudder_lag
        _gear(given, self.state, lag, own, self.rate, self.h, held, out)
        self.at += self.parts
        wanted, steps = rpm / 60.0, self.h / max(self.vehicle.shaft_lag, 1e-9)
        left = np.exp(-steps * np.arange(self.parts + 1))
        shaft = wanted + (self.turns - wanted) * (left[:-1] - left[1:]) / steps
        self.turns = wanted + (self.turns - wanted) * float(left[-1])
        return self._stops(out), shaft

    def _stops(self, angle: Array) -> Array:
        top = self.vehicle.rudder_max
        return np.clip(angle, -top, top) + float(self.g["offset"])


def simulate_run(
    vehicle: OtherVehicle,
    g: np.void,
    t: Array,
    orders: Array | Law,
    x0: Array,
    sea: Array | None = None,
    step: float | None = None,
) -> Record:
    """Carry a vehicle through a run.

    Parameters
    ----------
    g : causes, see `causes.settings_of`
    t : (n,) evenly spaced sample times [s]
    orders : (n, 2) rudder [rad] and shaft [rpm], or a law (t, readings) -> (rudder, rpm) asked at each sample
    x0 : (12,) pose and velocity through the water at the first sample
    sea : (m, 3) disturbing forces on the fine grid
    step : longest step [s]

    Raises
    ------
    ModelError                 the state leaves the numbers a vehicle can have; says when
    """
    dt = float(t[1] - t[0])
    parts = max(1, math.ceil(dt / (step or vehicle.step) - 1e-9))
    h, count = dt / parts, (t.size - 1) * parts + 1
    states, rudder, shaft = np.empty((count, 12)), np.empty(count), np.empty(count)
    given, gear = np.zeros((t.size, 2)), Gear(vehicle, g, dt, parts)
    force = np.zeros((count, 3)) if sea is None else sea
    states[0] = x0
    for k in range(t.size - 1):
        a, b = k * parts, (k + 1) * parts + 1
        given[k] = (
            orders(float(t[k]), seen(float(t[k] - t[0]), states[a], g)) if callable(orders) else orders[k]
        )
        if k == 0:
            rudder[0] = gear.begin(*given[0])
        rudder[a + 1 : b], shaft[a : b - 1] = gear.follow(*given[k])
        states[a:b] = carried(vehicle, g, float(t[k]), states[a], rudder[a:b], shaft[a:b], h, force[a:b])
        if not (np.abs(states[b - 1, 6:9]).max() < 6 * vehicle.U and np.abs(states[b - 1, 3:5]).max() < 1.2):
            raise ModelError(
                f"other equations: {vehicle.name} is out of control {t[k + 1] - t[0]:g} s into the run"
            )
    given[-1], shaft[-1] = given[-2], shaft[-2]
    return Record(t, given, t[0] + np.arange(count) * h, states, rudder, shaft, parts)


def seen(t: float, state: Array, g: np.void) -> dict[str, float]:
    """Readings a helmsman steers by, some time [s] into the run."""
    return {
        "psi": float(state[5] + g["psi_bias"] + g["psi_drift"] * t),
        "r": float(state[11] * (1.0 + g["r_scale"])),
    }


def readings(g: np.void, fine: Array, states: Array, parts: int) -> Array:
    """(n, 6) clean readings of CHANNELS at the samples; velocities over ground, heading unwrapped."""
    psi, r, c, s = states[:, 5], states[:, 11], np.cos(states[:, 5]), np.sin(states[:, 5])
    # body axes of a vehicle that rolls and pitches: the current turns with all three angles
    ph, th = states[:, 3], states[:, 4]
    cn, ce = float(g["current_n"]), float(g["current_e"])
    ahead = cn * c + ce * s
    u = states[:, 6] + np.cos(th) * ahead
    v = states[:, 7] + np.sin(ph) * np.sin(th) * ahead + np.cos(ph) * (ce * c - cn * s)
    late = float(g["v_late"])
    out = [
        states[:, 0] + g["arm_x"] * c - g["arm_y"] * s,
        states[:, 1] + g["arm_x"] * s + g["arm_y"] * c,
        psi + g["psi_bias"] + g["psi_drift"] * (fine - fine[0]),
        r * (1.0 + g["r_scale"]),
        *((np.interp(fine - late, fine, w) if late else w) for w in (u, v)),
    ]
    return np.stack(out, axis=1)[::parts]
