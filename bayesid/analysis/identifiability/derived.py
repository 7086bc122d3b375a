"""What a vehicle does, rather than what its coefficients are: stability indices, turning circle, zig-zag.

Takes a `Model` and parameter vectors, usually draws of a posterior. Gives each quantity for every vector and
intervals of them: often well known where no coefficient is. Does not sample or judge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.manoeuvres import turn, zigzag
from bayesid.measures import turning_circle
from bayesid.measures import zigzag as zigzag_measures
from bayesid.model.ship_forces import rudder_slopes
from bayesid.simulation import plan_run, run_manoeuvre, simulate_batch, steady_start

Array = np.ndarray
DEG = math.pi / 180
UNITS = {
    "G_H": "", "G_V": "", "advance": "m", "tactical diameter": "m", "drift angle in the turn": "deg",
    "yaw rate in the turn": "deg/s", "speed ratio in the turn": "", "first overshoot": "deg",
    "second overshoot": "deg",
}  # fmt: skip


@dataclass(frozen=True)
class Standard:
    """The manoeuvres the quantities belong to.

    turn, zigzag : rudder [rad], the zig-zag's switch at the same angle; lengths : duration of each in L/U
    rpm : shaft speed, the vehicle's usual one if None
    """

    turn: float = 20 * DEG
    zigzag: float = 20 * DEG
    rpm: float | None = None
    turn_lengths: float = 40.0
    zigzag_lengths: float = 30.0
    samples: int = 400


@dataclass(frozen=True, eq=False)
class Derived:
    """Quantities of several vehicles.

    Attributes
    ----------
    values : quantity -> (m,) in the unit of `UNITS`; nan where a vehicle does not allow it
    """

    values: Mapping[str, Array]

    def interval(self, name: str, level: float = 0.9) -> tuple[float, float, float]:
        """Median and ends of the central interval, over the vehicles that have the quantity."""
        found = self.values[name][np.isfinite(self.values[name])]
        if not found.size:
            return (math.nan,) * 3
        low, middle, high = np.quantile(found, [0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level])
        return float(middle), float(low), float(high)

    def spread(self, name: str) -> float:
        """Half width of the 90 % interval over the median's size; nan for an index near zero's own sake."""
        middle, low, high = self.interval(name)
        return 0.5 * (high - low) / abs(middle) if middle else math.nan

    def missing(self, name: str) -> int:
        """Vehicles without the quantity: they diverge, or do not turn."""
        return int(np.sum(~np.isfinite(self.values[name])))


def indices(model: Model, pars: Array, speed: float) -> dict[str, Array]:
    """Straight-line stability indices of parameter vectors (m, n) at a speed [m/s], positive if stable.

    As `vehicles.stability`, for many vectors at once; G_V only of models in six degrees of freedom.
    """

    def of(name: str) -> Array:
        i = model.index.get(name)
        return np.zeros(len(pars)) if i is None else pars[:, i]

    rudder: dict[str, Array] = {}
    if model.kernel.spec.propulsion == "mmg":
        values = {name: of(name) for name in model.kernel.parameters} | {"U_ref": speed}
        rudder = rudder_slopes(values, speed, float(model.nominal[model.index["rpm_ref"]]))

    def slope(name: str) -> Array:
        axis, velocity = name.split("_")
        over_speed = of(f"{name},U") + of(f"{axis}_|u|{velocity}") + rudder.get(axis + velocity, 0.0)
        return of(name) + over_speed + of(f"{name}0") / speed

    lever = of("m") * of("x_G")
    with np.errstate(divide="ignore", invalid="ignore"):
        found = {
            "G_H": 1.0 - slope("N_v") * (slope("Y_r") - of("m")) / (slope("Y_v") * (slope("N_r") - lever))
        }
        if model.dof == 6:
            found["G_V"] = 1.0 - slope("M_w") * (slope("Z_q") + of("m")) / (
                slope("Z_w") * (slope("M_q") - lever)
            )
    return found


def derived(
    model: Model,
    pars: Array,
    standard: Standard | None = None,
    zigzags: int = 100,
    step: Callable[[], None] | None = None,
) -> Derived:
    """Standard quantities of parameter vectors.

    Parameters
    ----------
    pars : (m, n) full parameter vectors [SI]
    zigzags : the zig-zag is executed closed loop, one vehicle at a time: by the first so many only
    step : called after every zig-zag
    """
    standard = standard or Standard()
    pars = np.atleast_2d(pars)
    x0 = steady_start(model, standard.rpm)
    rpm = standard.rpm if standard.rpm is not None else float(model.vehicle.rpm_ref or 0.0)
    speed = float(x0[model.states.index("u")])
    time = model.scales["L"] / max(speed, 1e-6)
    values = indices(model, pars, speed)
    values |= _turns(model, pars, x0, rpm, standard, time)
    values |= _zigzags(model, pars[:zigzags], x0, rpm, standard, time, step)
    return Derived(values)


def _turns(
    model: Model, pars: Array, x0: Array, rpm: float, standard: Standard, time: float
) -> dict[str, Array]:
    dt = standard.turn_lengths * time / standard.samples
    order = turn(standard.turn, rpm, 2 * time, standard.turn_lengths * time, dt)
    plan = plan_run(model, order.t, order.commands)
    where = [model.states.index(s) for s in ("x", "y", "psi", "u", "v")]
    names = ("advance", "tactical diameter", "drift angle in the turn", "yaw rate in the turn",
             "speed ratio in the turn")  # fmt: skip
    found = np.full((len(pars), 5), np.nan)
    with np.errstate(all="ignore"):
        states = simulate_batch(model, pars, plan, x0)[:, :, where]
    for i, one in enumerate(states):
        if np.isfinite(one).all():
            x, y, psi, u, v = one.T
            c = turning_circle(order.t, x, y, psi, order.commands["delta_r_cmd"], u, v)
            found[i] = (c.advance, c.tactical_diameter, c.drift_angle / DEG, c.steady_yaw_rate / DEG,
                        c.speed_ratio)  # fmt: skip
    return dict(zip(names, found.T, strict=True))


def _zigzags(
    model: Model,
    pars: Array,
    x0: Array,
    rpm: float,
    standard: Standard,
    time: float,
    step: Callable[[], None] | None,
) -> dict[str, Array]:
    dt = standard.zigzag_lengths * time / standard.samples
    order = zigzag(standard.zigzag, standard.zigzag, rpm, time, standard.zigzag_lengths * time, dt)
    psi = model.states.index("psi")
    found = np.full((len(pars), 2), np.nan)
    for i, par in enumerate(pars):
        try:
            track, commands = run_manoeuvre(model, par, order, x0)
        except ModelError:  # diverges: it has no overshoot
            continue
        else:
            z = zigzag_measures(track.t, track.states[:, psi], commands["delta_r_cmd"])
            first, second = (*z.overshoots, math.nan, math.nan)[:2]
            found[i] = first / DEG, second / DEG
        finally:
            if step is not None:
                step()
    return dict(zip(("first overshoot", "second overshoot"), found.T, strict=True))


def full_vectors(problem: FitProblem, draws: Array) -> Array:
    """(m, n) parameter vectors of a problem's model for draws (m, k) [SI] of its free parameters."""
    positions, slopes = problem.params.chain(problem.model.index)
    zero = problem.params.place(problem.base, problem.model.index, np.zeros(draws.shape[1]))
    out = np.repeat(zero[None], len(draws), axis=0)
    out[:, positions] += draws @ slopes.T
    return out
