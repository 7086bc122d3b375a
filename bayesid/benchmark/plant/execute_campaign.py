"""Run a campaign: true tracks, what the sensors log, and the noise-free answer to the same orders.

Takes: a `Campaign`. Gives the logged runs and their truth.
Does not: write files (`bundles`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bayesid.benchmark.plant.advance import forces_along
from bayesid.benchmark.plant.body import Body, build
from bayesid.benchmark.plant.campaign import Campaign
from bayesid.benchmark.plant.execute_run import NO_DISTURBANCE, PlantTrack, execute_run, start_state
from bayesid.benchmark.plant.forces import thrust_of
from bayesid.benchmark.plant.noise import measured, process_forces
from bayesid.benchmark.plant.orders import RunPlan, orders_for
from bayesid.benchmark.plant.sensing import read
from bayesid.benchmark.plant.settings import GROUPS
from bayesid.errors import ModelError

SETTLING_LENGTHS = 12.0  # L/U of straight run before a record starts
# what changes with time starts with the record, not with the approach
TIMED = (
    "an", "ae", "tide_w", "t_decay", "t_late", "step_d", "stuck_to", "psi_creep", "psi_settle", "psi_swing",
    "r_creep",
)  # fmt: skip
LOGGED = {3: ("delta_r_cmd", "n_cmd"), 6: ("delta_r_cmd", "delta_s_cmd", "n_cmd")}


@dataclass(frozen=True, eq=False)
class ExecutedRun:
    """One run: its plan, the logged channels (NaN = missing) and orders, and the truth behind them."""

    plan: RunPlan
    t: np.ndarray
    data: dict[str, np.ndarray]
    commands: dict[str, np.ndarray]
    track: PlantTrack
    start: np.ndarray


@dataclass(frozen=True, eq=False)
class ExecutedCampaign:
    """All runs; `typical` is the force (X Y N Z M) [N, N m] that process noise is relative to."""

    campaign: Campaign
    runs: tuple[ExecutedRun, ...]
    typical: np.ndarray

    def run(self, name: str) -> ExecutedRun:
        for run in self.runs:
            if run.plan.name == name:
                return run
        raise ModelError(f"plant: no run {name!r}; there are {', '.join(r.plan.name for r in self.runs)}")


@lru_cache(maxsize=4)
def execute_campaign(campaign: Campaign) -> ExecutedCampaign:
    """Run every run.

    Raises
    ------
    ModelError                 a vehicle left the numbers a vehicle can have; says when
    """
    gap, c = campaign.gap, campaign
    body = build(c.vehicle, c.coef, c.dof, gap)
    typical = _typical(c, body) if any(c.disturbance.amplitude) else np.zeros(5)
    runs = []
    for k, plan in enumerate(c.runs):
        start = _start(c, body, plan)
        sea, spacing = NO_DISTURBANCE, 1.0
        if any(c.disturbance.amplitude):
            amplitude = np.array(c.disturbance.amplitude) * typical
            sea, spacing = process_forces(c.rng("process", k), plan.duration, amplitude, c.disturbance.tau)
        track = execute_run(body, gap, plan.t, _orders(c, body, plan), start, sea, spacing)
        data = measured(
            c.rng("noise", k), plan.t, read(track, gap), c.sigma,
            (c.disturbance.drift, c.disturbance.drift_tau), c.disturbance.outliers, c.disturbance.gaps,
        )  # fmt: skip
        given = dict(zip(("delta_r_cmd", "delta_s_cmd", "n_cmd"), track.orders.T, strict=True))
        runs.append(ExecutedRun(plan, plan.t, data, {n: given[n] for n in LOGGED[c.dof]}, track, start))
    return ExecutedCampaign(c, tuple(runs), typical)


def true_response(
    campaign: Campaign, run: str, orders: np.ndarray | None = None, sensors: bool = True
) -> dict[str, np.ndarray]:
    """What the true vehicle would log in a run without process noise, drift and sensor noise.

    Parameters
    ----------
    run : name of a run of the campaign; its start and its orders are taken
    orders : (n, 3) other orders at the samples of the run: rudder, stern plane [rad], rpm
    sensors : with the planted sensor errors; without them the true state over ground

    Returns
    -------
    channel -> (n,) array for all twelve pose and velocity channels, SI; psi unwrapped
    """
    executed = execute_campaign(campaign).run(run)
    body = build(campaign.vehicle, campaign.coef, campaign.dof, campaign.gap)
    given = executed.track.orders if orders is None else np.asarray(orders, dtype=float)
    track = execute_run(body, campaign.gap, executed.t, given, executed.start)
    blind = campaign.gap.copy()
    if not sensors:
        for field in GROUPS["sensors"]:
            blind[field] = 0.0
    return read(track, blind)


def _orders(c: Campaign, body: Body, plan: RunPlan):
    number = body.number
    LU = number["L"] / number["U0"]
    return orders_for(plan, number["L"], LU, c.dof, number["ds_max"], c.gap)


def _start(c: Campaign, body: Body, plan: RunPlan) -> np.ndarray:
    """State after a straight approach by the helmsman at the first revolutions of the run."""
    number, calm = body.number, c.gap.copy()
    for field in TIMED:
        calm[field] = 0.0
    if calm["twist_t"] > 0.0:  # at 0 it is out of line all along
        calm["twist_t"] = math.inf
    first = plan.levels[0][2] if plan.levels else plan.rpm
    x = start_state(number["U0"] * first / number["n_ref"], plan.heading, plan.depth, calm, plan.place)
    steady = RunPlan(**{**vars(plan), "kind": "straight", "rpm": first, "levels": (), "ordered": None})
    count = round(SETTLING_LENGTHS * number["L"] / number["U0"] / plan.dt)
    t = np.arange(count + 1) * plan.dt
    x = execute_run(body, calm, t, _orders(c, body, steady), x, step=0.05).states[-1].copy()
    x[0], x[1] = plan.place
    return x


def _typical(c: Campaign, body: Body) -> np.ndarray:
    """(5,) X: thrust of the straight run; Y, N: rms fluid force over the first zig-zag or turn
    (without one: over the first run); Z, M as Y, N."""
    number, gap = body.number, c.gap
    plan = next((run for run in c.runs if run.kind in ("zigzag", "turn")), c.runs[0])
    track = execute_run(body, gap, plan.t, _orders(c, body, plan), _start(c, body, plan))
    rows = slice(None, None, track.parts)
    rpm = track.orders[:, 2].copy()
    force = forces_along(track.t, track.states[rows].copy(), track.fins[rows].copy(), rpm, body.packed, gap)
    rms = np.sqrt(np.mean(force**2, axis=0))
    push = abs(thrust_of(number["U0"], number["n_ref"], number))
    return np.array([push, rms[1], rms[5], rms[1], rms[5]])
