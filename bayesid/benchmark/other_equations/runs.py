"""The runs of a campaign and who steers them.

Takes: a vehicle and a generator. Gives run plans, and for a plan its table of orders or its law.
Does not: simulate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bayesid.benchmark.other_equations.simulate import Law
from bayesid.benchmark.other_equations.vehicles import DEG, OtherVehicle

Array = np.ndarray
RESOLUTION = math.radians(1e-3)  # of logged and executed orders
HELM_LIMIT = 5.0 * DEG


@dataclass(frozen=True)
class RunPlan:
    """One run: kind, rudder and switch [rad], shaft speed [rpm], seconds, start; `first` is +1 for port.

    `levels` are (time [s], rudder [rad], rpm) rows of a random run, in force from their time on.
    """

    name: str
    manoeuvre: str
    role: str
    kind: str
    rudder: float
    switch: float
    first: float
    rpm: float
    duration: float
    dt: float
    approach: float
    heading: float
    place: tuple[float, float]
    levels: tuple[tuple[float, float, float], ...] = ()

    @property
    def t(self) -> Array:
        return np.arange(round(self.duration / self.dt) + 1) * self.dt


def plan_runs(vehicle: OtherVehicle, rng: np.random.Generator, straight: bool) -> tuple[RunPlan, ...]:
    """Six runs, or with `straight` eight: two straight runs and a repeat measure a disturbance.

    Of six shapes (two zig-zags, two turns, a spiral, a random run) two are held out.
    """
    v = vehicle

    def plan(kind: str, words: str, rudder: float = 0.0, switch: float = 0.0, share: float = 1.0) -> RunPlan:
        rpm = round(v.rpm * float(rng.choice([0.85, 1.0, 1.0])), 1)
        made = RunPlan(
            "", words, "identify", kind, rudder * DEG, switch * DEG, float(rng.choice([-1.0, 1.0])), rpm,
            round(share * v.run / v.dt) * v.dt, v.dt, float(rng.choice([0.0, 3.0])) * v.LU,
            float(rng.uniform(0.0, 2.0 * math.pi)), (float(rng.normal(0, v.L)), float(rng.normal(0, v.L))),
        )  # fmt: skip
        return replace(made, levels=_levels(v, rng, made)) if kind == "random" else made

    one, two = (plan("zigzag", f"zigzag {a:g}/{b:g}", a, b) for a, b in v.zigzags)
    turns = [
        replace(plan("turn", f"turning circle {side} {a:g}{end}", a), first=sign)
        for side, sign, a, end in zip(
            ("port", "starboard"), (1.0, -1.0), rng.permutation(v.turns), (", pull-out", ""), strict=True
        )
    ]
    others = [plan("spiral", "spiral", max(v.turns), share=1.15), *turns, two]
    others = [others[k] for k in rng.permutation(len(others))]
    fit = [one, plan("random", "speed steps and random rudder", max(v.turns), share=1.15), *others[:2]]
    if straight:
        fit += [plan("straight", "straight run", share=0.6) for _ in range(2)]
        fit.append(replace(one, manoeuvre=f"{one.manoeuvre} repeat", place=(0.0, 0.0)))
    fit = [fit[k] for k in rng.permutation(len(fit))]
    runs = fit + [replace(run, role="holdout") for run in others[2:]]
    return tuple(replace(run, name=f"r{k + 1}") for k, run in enumerate(runs))


def mirrored_plan(plan: RunPlan) -> RunPlan:
    """The same run with port and starboard exchanged, mirrored about the north."""
    levels = tuple((t, -rudder, rpm) for t, rudder, rpm in plan.levels)
    place = (plan.place[0], -plan.place[1])
    return replace(plan, first=-plan.first, heading=-plan.heading, place=place, levels=levels)


def _levels(
    v: OtherVehicle, rng: np.random.Generator, plan: RunPlan
) -> tuple[tuple[float, float, float], ...]:
    factors, rows, t, rudder = rng.permutation([1.0, 0.8, 1.1, 0.9]), [], 0.0, 0.0
    while t < plan.duration:
        rpm = round(plan.rpm * float(factors[min(int(4 * t / plan.duration), 3)]), 1)
        rows.append((t, rudder, rpm))
        t += float(rng.uniform(1.0, 6.0)) * v.LU
        rudder = float(rng.uniform(-1.0, 1.0)) * plan.rudder
    return tuple(rows)


def rounded(angle: float) -> float:
    """A rudder order as it is logged."""
    return round(angle / RESOLUTION) * RESOLUTION


def orders_of(vehicle: OtherVehicle, plan: RunPlan) -> Array | Law:
    """(n, 2) rudder [rad] and rpm where they are known beforehand, else a law of the readings."""
    if plan.kind == "straight":
        return helm(vehicle, plan.heading, plan.rpm)
    if plan.kind == "zigzag":
        return _zigzag(vehicle, plan)
    t, out = plan.t, np.zeros((plan.t.size, 2))
    out[:, 1] = plan.rpm
    if plan.kind == "turn":
        until = 0.65 * plan.duration if "pull-out" in plan.manoeuvre else math.inf
        out[:, 0] = plan.first * plan.rudder * ((t >= plan.approach - 1e-9) & (t < until))
    elif plan.kind == "spiral":
        share = np.clip((t - plan.approach) / (0.95 * plan.duration - plan.approach), 0.0, 1.0)
        out[:, 0] = plan.first * plan.rudder * (1.0 - 2.0 * share) * (t >= plan.approach - 1e-9)
    else:
        times, rudder, rpm = np.array(plan.levels).T
        row = np.searchsorted(times, t + 1e-9, side="right") - 1
        out[:, 0], out[:, 1] = rudder[row], rpm[row]
    out[:, 0] = np.round(out[:, 0] / RESOLUTION) * RESOLUTION
    return out


def helm(vehicle: OtherVehicle, heading: float, rpm: float) -> Law:
    """A helmsman who keeps a compass heading; positive rudder turns to port."""

    def law(t: float, seen: dict[str, float]) -> tuple[float, float]:
        wanted = 0.7 * (seen["psi"] - heading) + 1.2 * vehicle.LU * seen["r"]
        return rounded(min(max(wanted, -HELM_LIMIT), HELM_LIMIT)), rpm

    return law


def _zigzag(vehicle: OtherVehicle, plan: RunPlan) -> Law:
    """Rudder thrown over whenever the heading has left its base by the switch angle; the base is the heading
    at the first order."""
    keep, base, side = helm(vehicle, plan.heading, plan.rpm), 0.0, 0.0

    def law(t: float, seen: dict[str, float]) -> tuple[float, float]:
        nonlocal base, side
        if t < plan.approach - 1e-9:
            return keep(t, seen)
        if side == 0.0:
            base, side = seen["psi"], plan.first
        elif -side * (seen["psi"] - base) >= plan.switch:
            side = -side
        return rounded(side * plan.rudder), plan.rpm

    return law
