"""The runs of a campaign and who steers them: tables for open loop, helmsman and planesman for closed loop.

Takes: a vehicle's size and rudder limits, a random generator; or any manoeuvre. Gives run plans and laws.
Does not: fly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.benchmark.plant.execute_run import ORDERS, Law
from bayesid.benchmark.plant.sensing import heading_read
from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import ClosedLoop, Manoeuvre, OpenLoop, held
from bayesid.manoeuvres.laws import DepthLaw, ZigzagLaw

RESOLUTION = math.radians(1e-3)  # of logged and executed orders


@dataclass(frozen=True)
class RunPlan:
    """One run: kind, sizes [rad], times [s], rpm, where and how it starts.

    `first` is +1 for port first; `levels` are (time [s], rudder [rad], rpm) rows of a random run; `ordered`
    is the manoeuvre of a run of kind "ordered", see `ordered_run`
    """

    name: str
    manoeuvre: str
    role: str
    kind: str
    duration: float
    dt: float
    rpm: float
    rudder: float
    switch: float
    approach: float
    first: float
    heading: float
    depth: float
    place: tuple[float, float]
    levels: tuple[tuple[float, float, float], ...] = ()
    ordered: Manoeuvre | None = None

    @property
    def t(self) -> np.ndarray:
        return np.arange(round(self.duration / self.dt) + 1) * self.dt


DESIGNS = {
    # vehicle: sample [s], durations by kind [s], rudder angles [deg] and zig-zags [deg]
    "generic_sub": (1.0, {"zigzag": 500, "turn": 480, "random": 600, "spiral": 600, "straight": 200}),
    "remus100": (0.5, {"zigzag": 190, "turn": 190, "random": 220, "spiral": 220, "straight": 140}),
    "nps_auv2": (0.5, {"zigzag": 220, "turn": 220, "random": 240, "spiral": 240, "straight": 160}),
    "lauv": (0.25, {"zigzag": 117, "turn": 117, "random": 143, "spiral": 143, "straight": 110}),
    "delphin2": (0.5, {"zigzag": 180, "turn": 190, "random": 220, "spiral": 220, "straight": 130}),
}
ZIGZAGS = {"remus100": ((8, 8), (13, 20), (10, 10))}
USUAL_ZIGZAGS = ((10, 10), (20, 20), (15, 15))
TURNS = {"remus100": (8, 10, 12)}
USUAL_TURNS = (12, 15, 20)


def plan_runs(
    rng: np.random.Generator, vehicle: str, rpm_ref: float, LU: float, L: float, depth: float,
    rich: bool, disturbance: bool,
) -> tuple[RunPlan, ...]:  # fmt: skip
    """Runs in the order they are executed, hold-outs last.

    A rich campaign has zig-zags, turns to both sides, a spiral and a random run with speed steps; a poor one
    zig-zags only. With `disturbance` two straight runs and a repeat are added to measure it.
    """
    dt, durations = DESIGNS[vehicle]
    zigzags, turns = ZIGZAGS.get(vehicle, USUAL_ZIGZAGS), TURNS.get(vehicle, USUAL_TURNS)
    big = math.radians(max(turns))

    def plan(kind: str, text: str, rudder: float = 0.0, switch: float = 0.0, first: float = 1.0) -> RunPlan:
        approach = float(rng.choice([0.0, 3.0, 8.0])) * LU
        plan = RunPlan(
            "", text, "identify", kind, float(durations[kind]), dt,
            round(rpm_ref * float(rng.choice([0.85, 1.0, 1.0, 1.05])), 1), math.radians(rudder),
            math.radians(switch), approach, first, float(rng.uniform(0.0, 2 * math.pi)), depth,
            (float(rng.normal(0.0, 0.7 * L)), float(rng.normal(0.0, 0.7 * L))),
        )  # fmt: skip
        return replace(plan, levels=_levels(rng, plan, big, LU)) if kind == "random" else plan

    def zigzag(sizes: tuple[int, int]) -> RunPlan:
        side = float(rng.choice([-1.0, 1.0]))
        return plan("zigzag", f"zigzag {sizes[0]}/{sizes[1]}", sizes[0], sizes[1], side)

    port, starboard = int(rng.choice(turns)), int(rng.choice(turns))
    ramp = plan("spiral", "spiral", max(turns), 0.0, float(rng.choice([-1.0, 1.0])))
    if rich:
        runs = [
            zigzag(zigzags[0]), zigzag(zigzags[1]), ramp,
            plan("random", "speed steps and random rudder", max(turns)),
            plan("turn", f"turning circle port {port}, pull-out", port),
            plan("turn", f"turning circle starboard {starboard}", -starboard),
        ]  # fmt: skip
        order = rng.permutation(len(runs))
        runs = [runs[k] for k in order]
        fit, kept = runs[:4], runs[4:]
    else:
        fit = [zigzag(zigzags[k]) for k in (0, 1, 0, 2)]
        kept = [zigzag(zigzags[1]), plan("turn", f"turning circle starboard {starboard}", -starboard)]
    if disturbance:
        again = next((run for run in fit if run.kind == "zigzag"), fit[0])
        fit += [plan("straight", "straight run"), plan("straight", "straight run")]
        fit += [replace(again, manoeuvre=f"{again.manoeuvre} repeat")]
        if rich:
            # a campaign of eight runs: one of the six shapes is left out of the fit
            fit.remove(next(run for run in fit if run is not again and run.kind != "straight"))
        fit = [fit[k] for k in rng.permutation(len(fit))]
    runs = fit + [replace(run, role="holdout") for run in kept]
    return tuple(replace(run, name=f"r{k + 1}") for k, run in enumerate(runs))


def ordered_run(
    manoeuvre: Manoeuvre, like: RunPlan, name: str, role: str = "identify", longest: float = math.inf
) -> RunPlan:
    """A run of any manoeuvre that starts where, at the heading and at the depth another one does.

    Parameters
    ----------
    manoeuvre : table or law of rudder, stern planes and rpm; what it does not order is 0, rpm as in `like`
    like : run whose start and sample time are taken over
    longest : the record is cut there [s]

    Raises
    ------
    ManoeuvreError             it orders bow planes, which the vehicles of the plant do not have
    """
    given = _ordered_channels(manoeuvre)
    if "delta_b_cmd" in given:
        raise ManoeuvreError(f"plant: {manoeuvre.name} orders bow planes; leave delta_b_cmd out")
    rpm = float(np.ravel(given.get("n_cmd", like.rpm))[0])
    whole = math.floor(min(manoeuvre.duration, longest) / like.dt + 1e-9) * like.dt
    if whole < like.dt:
        raise ManoeuvreError(f"plant: {manoeuvre.name} is over before the first sample ({like.dt:g} s)")
    return RunPlan(
        name, manoeuvre.name, role, "ordered", whole, like.dt, rpm, 0.0, 0.0, 0.0, 1.0, like.heading,
        like.depth, like.place, ordered=manoeuvre,
    )  # fmt: skip


def _levels(
    rng: np.random.Generator, run: RunPlan, big: float, LU: float
) -> tuple[tuple[float, float, float], ...]:
    """Random rudder levels held 1 to 6 L/U; rpm changes in four steps of the run."""
    factors = rng.permutation([1.0, 0.75, 1.1, 0.9])
    rows, t = [], 0.0
    rudder = 0.0
    while t < run.duration:
        share = factors[min(int(4 * t / run.duration), 3)]
        rows.append((t, rudder, round(run.rpm * float(share), 1)))
        t += float(rng.uniform(1.0, 6.0)) * LU
        rudder = float(rng.uniform(-big, big))
    return tuple(rows)


def _table(run: RunPlan) -> np.ndarray:
    t = run.t
    out = np.zeros((t.size, 3))
    out[:, 2] = run.rpm
    under_way = t >= run.approach - 1e-9
    if run.kind == "turn":
        until = run.approach + (0.65 * run.duration if "pull-out" in run.manoeuvre else math.inf)
        out[:, 0] = run.rudder * (under_way & (t < until))
    elif run.kind == "spiral":
        share = np.clip((t - run.approach) / (0.95 * run.duration - run.approach), 0.0, 1.0)
        out[:, 0] = run.first * run.rudder * (1.0 - 2.0 * share) * under_way
    elif run.kind == "random":
        times, rudders, rpms = np.array(run.levels).T
        row = np.searchsorted(times, t + 1e-9, side="right") - 1
        out[:, 0], out[:, 2] = rudders[row], rpms[row]
    elif isinstance(run.ordered, OpenLoop):
        # a change between two samples is given at the next one, as by a crew that orders at the log's rate
        for channel, values in held(run.ordered, run.ordered.t[0] + t + 1e-9).items():
            out[:, ORDERS.index(channel)] = values
    else:
        raise ManoeuvreError(f"plant: no table for a run of kind {run.kind!r}")
    return out


def orders_for(
    run: RunPlan, L: float, LU: float, dof: int, plane_max: float, gap: np.void
) -> np.ndarray | Law:
    """Orders of a run: (n, 3) where they are known beforehand, else a law of the state.

    Helmsman and laws look at the compass as it reads. In 6-DOF the planesman holds the depth of the start,
    unless the manoeuvre orders the planes itself. Orders are whole thousandths of a degree, as logged.
    """
    closed = run.ordered.controller() if isinstance(run.ordered, ClosedLoop) else None
    table = None if run.kind in ("zigzag", "straight") or closed else _table(run)
    if table is not None and dof == 3:
        return _rounded(table)
    busy = run.ordered is not None and "delta_s_cmd" in _ordered_channels(run.ordered)
    dive = None
    if dof == 6 and not busy:
        dive = DepthLaw((), 3.0 * L, math.radians(10.0), 0.6 * plane_max, 1.0, 0.5 * LU)()
    steer = ZigzagLaw(run.first * run.rudder, run.switch, run.approach)() if run.kind == "zigzag" else closed

    def law(t: float, state: np.ndarray) -> np.ndarray:
        seen = state.copy()
        seen[5] = heading_read(state[5], t, gap)
        out = np.array([0.0, 0.0, run.rpm])
        if table is not None:
            out[:] = table[min(round(t / run.dt), len(table) - 1)]
        elif steer is not None:
            for channel, value in steer(t, seen).items():
                out[ORDERS.index(channel)] = value
        else:
            # positive rudder turns to port, so a heading too far to starboard asks for positive rudder
            # (rate: below 1.1 L/U the unstable remus100 hunts at two orders a second, above 1.4 the lauv)
            wanted = 0.5 * (seen[5] - run.heading) + 1.15 * LU * seen[11]
            out[0] = min(max(wanted, -math.radians(5.0)), math.radians(5.0))
        if dive is not None:
            out[1] = dive(t, seen)["delta_s_cmd"]
        return _rounded(out)

    return law


def _ordered_channels(manoeuvre: Manoeuvre) -> Mapping[str, float | np.ndarray]:
    """Channels a manoeuvre orders, with what it orders at first (a table: always)."""
    return manoeuvre.start if isinstance(manoeuvre, ClosedLoop) else manoeuvre.commands


def _rounded(orders: np.ndarray) -> np.ndarray:
    out = orders.copy()
    out[..., :2] = np.round(out[..., :2] / RESOLUTION) * RESOLUTION
    return out
