"""What steers a vehicle, all of it as one rudder, and whether it steers as the log has it.

Takes a model and runs. Gives columns, a run with a rudder, the mistake of angles that all count the other way
or of thrusters of the two sides exchanged, and whether the runs show that it is none. Does not: ask actuators
of which one alone is reversed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.model.actuators import Pusher
from bayesid.model.vehicles.orders import NEAR_CENTRE, missing_actuators, named_rudders, side_of, spread
from bayesid.trials import Run
from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.judge import SOME_RUNS
from bayesid.trials.mistakes.signs import sign_evidence
from bayesid.trials.mistakes.table import COMMON, Mistake
from bayesid.words import and_list

RUDDER = ("delta_r",)
TURNING = ("azimuth_", "nozzle_")  # columns of the angle of a thrust
WORDS = {"delta": "rudder", "azimuth": "azimuth", "nozzle": "nozzle"}
SIDES = "n_"  # columns of revolutions of thrusters that steer by their difference
ALIKE = 0.05  # of their arm, by which thrusters of the two sides may differ in place and direction
AGAINST = -10.0  # nats of a run in which thrusters push the other way than the vehicle goes
FULL = 0.5  # rudder angle [rad] that stands for thrust ahead on one side at the usual revolutions


def steering(model: Model) -> tuple[str, ...]:
    """What turns a vehicle: its rudder, or where it has none the named ones that push sideways, or where it
    has none of these either the angles of thrusts off the centre, or else thrusters of the two sides."""
    if "delta_r" not in missing_actuators(model.vehicle):
        return RUDDER
    fins = tuple(f"delta_{name}" for name in named_rudders(model.vehicle))
    return fins or tuple(_thrusts(model)) or tuple(_sides(model)) or RUDDER


def steers_by_thrust(columns: Sequence[str]) -> bool:
    """Whether columns of `steering` are angles or revolutions of thrusts."""
    return any(name.startswith((*TURNING, SIDES)) for name in columns)


def with_rudder(model: Model, run: Run, columns: Sequence[str]) -> Run:
    """The run with what steers it as one rudder, positive to port: the mean of named ones, each as it turns
    the vehicle; one near the centre, which hardly turns it, is left out."""
    run = replace(run, commands=spread(model.vehicle, run.commands, run.measured_inputs))
    side = {f"delta_{fin.name}": side_of(fin, model.scales["L"]) for fin in model.vehicle.fins}
    thrusts, sides = _thrusts(model), _sides(model)
    orders = []
    for name in columns:
        angle = run.input(name)
        if angle is None:
            continue
        if name in thrusts:
            turning, pusher = thrusts[name]
            revolutions = run.input(pusher.signal)
            ahead = 1.0 if revolutions is None else np.sign(revolutions)
            orders.append(turning * ahead * np.sin(angle))
        elif name in sides:
            share = angle / (model.vehicle.rpm_ref or 100.0)
            orders.append(FULL * sides[name][0] * share * np.abs(share))
        elif side.get(name):
            orders.append(side[name] * angle)
    if not orders:
        return run
    return replace(run, commands={**run.commands, "delta_r_cmd": np.mean(orders, axis=0)})


def pushes_along(model: Model, run: Run) -> float | None:
    """Log likelihood [nats] of the side to which thrusters of the two sides push, from how the vehicle goes:
    astern by what should drive it ahead is a wrong sign of revolutions. None where either is not told."""
    push = np.zeros(run.n_samples)
    for name, (_, pusher) in _sides(model).items():
        revolutions = run.input(name)
        if revolutions is None:
            return None
        push = push + pusher.direction[0] * revolutions * np.abs(revolutions)
    way, on = _way(run), float(np.median(push))
    return None if not way or not on else 0.0 if way * on > 0.0 else AGAINST


def _way(run: Run) -> float:
    """How far a vehicle goes ahead of its bow [m], negative astern; 0 where that is not told."""
    for name in ("u", "u_water"):
        if name in run.data:
            speed = run.data[name]
            return float(np.nanmedian(speed)) * run.duration if np.isfinite(speed).any() else 0.0
    if not {"x", "y", "psi"} <= set(run.data):
        return 0.0
    x, y, psi = (run.data[name] for name in ("x", "y", "psi"))
    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(psi)
    ahead = np.diff(x[good]) * np.cos(psi[good][:-1]) + np.diff(y[good]) * np.sin(psi[good][:-1])
    return float(ahead.sum())


def mistakes_of_steering(columns: Sequence[str]) -> tuple[Mistake, ...]:
    """All angles that steer a vehicle, named ones, with the opposite sign; or thrusters of the two sides in
    place of each other, or all their revolutions with the opposite sign."""
    if not columns[0].startswith(SIDES):
        return (_sign_of_angles(columns),)
    both = Correction(scale={name: -1.0 for one in columns for name in (one, f"{one}_cmd")})
    said = (
        f"revolutions of thrusters {_names(columns)} have the opposite sign, or `direction` in the file has"
    )
    return _exchanged(columns), Mistake(f"sign of {', '.join(columns)}", said, both, COMMON)


def _exchanged(columns: Sequence[str]) -> Mistake:
    pairs = zip(columns[::2], columns[1::2], strict=True)
    return Mistake(
        "port and starboard thrusters exchanged",
        f"thrusters {_names(columns)} are exchanged, or `at` in the vehicle file has them so",
        Correction(exchange=tuple((a + end, b + end) for a, b in pairs for end in ("", "_cmd"))),
        COMMON,
    )


def _sign_of_angles(columns: Sequence[str]) -> Mistake:
    many = len(columns) > 1
    kinds = dict.fromkeys(WORDS[name.partition("_")[0]] for name in columns)
    stated = "`at`" if steers_by_thrust(columns) else "`direction`"
    return Mistake(
        f"sign of {', '.join(columns)}",
        f"{' and '.join(f'{kind}s' if many else kind for kind in kinds)} {_names(columns)} "
        f"{'have' if many else 'has'} the opposite sign, or {stated} in the vehicle file has",
        Correction(scale={name: -1.0 for one in columns for name in (one, f"{one}_cmd")}),
        COMMON,
    )


def steering_shown(model: Model, runs: Sequence[Run]) -> str:
    """In words that the turns after named rudders or thrusts tell the sign of their angles, and that it is
    right; empty where they do not, or where a rudder `delta_r` tells it by the channels alone."""
    columns = steering(model)
    if columns == RUDDER:
        return ""
    told = [sign_evidence(with_rudder(model, run, columns), ("rudder",)) for run in runs]
    lead = sum(one.get("rudder", 0.0) - one.get("rudder against", 0.0) for one in told)
    if not lead > SOME_RUNS:
        return ""
    if columns[0].startswith(SIDES):
        return f"sides of thrusters {_names(columns)}"
    kinds = dict.fromkeys(WORDS[name.partition("_")[0]] for name in columns)
    return f"sign of the {' and '.join(kinds)} angles of {_names(columns)}"


def _names(columns: Sequence[str]) -> str:
    return and_list([name.partition("_")[2] for name in columns])


def _thrusts(model: Model) -> dict[str, tuple[float, Pusher]]:
    """Column of the angle of each thrust off the centre -> 1 where a positive one turns the vehicle to port
    as it pushes ahead, -1 to starboard; and whose it is."""
    out = {}
    for pusher in model.vehicle.thrusters:
        angles = [name for name in pusher.signals if name.startswith(TURNING)]
        arm = pusher.at[0] * pusher.direction[0] + pusher.at[1] * pusher.direction[1]
        if angles and abs(arm) > NEAR_CENTRE * model.vehicle.L:
            out[angles[0]] = -math.copysign(1.0, arm), pusher
    return out


def _sides(model: Model) -> dict[str, tuple[float, Pusher]]:
    """Column of the revolutions of each fixed thruster that has its like on the other side, pair by pair -> 1
    where it turns the vehicle to port as it pushes ahead, -1 to starboard; and whose it is."""
    left = [one for one in model.vehicle.thrusters if _arm(one) and len(one.signals) == 1]
    out: dict[str, tuple[float, Pusher]] = {}
    while left:
        one = left.pop(0)
        near = ALIKE * abs(_arm(one))
        like = next((other for other in left if _mirrors(one, other, near)), None)
        if like is not None and abs(_arm(one)) > NEAR_CENTRE * model.vehicle.L:
            left.remove(like)
            out |= {each.signal: (-math.copysign(1.0, _arm(each)), each) for each in (one, like)}
    return out


def _arm(one: Pusher) -> float:
    """Moment to starboard of a thrust of one [m]."""
    return one.at[0] * one.direction[1] - one.at[1] * one.direction[0]


def _mirrors(one: Pusher, other: Pusher, near: float) -> bool:
    """Whether two thrusters stand on the two sides, and push alike but for that."""
    places = math.dist((one.at[0], -one.at[1], one.at[2]), other.at)
    towards = math.dist((one.direction[0], -one.direction[1], one.direction[2]), other.direction)
    return places < near and towards < ALIKE
