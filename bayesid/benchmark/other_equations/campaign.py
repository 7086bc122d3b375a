"""A campaign of a vehicle with other equations: drawn from a seed, executed, replayed without its causes.

Takes: a seed and factors. Gives a frozen `Campaign` with its whole truth, records and readings.
Does not: write files (`bundles`) or say how plainly a cause shows (`evidence`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.benchmark.other_equations.causes import Planted, Scales, plant_causes, settings_of
from bayesid.benchmark.other_equations.runs import RunPlan, helm, orders_of, plan_runs
from bayesid.benchmark.other_equations.simulate import CHANNELS, Record, readings, simulate_run
from bayesid.benchmark.other_equations.vehicles import OtherVehicle, other_vehicle
from bayesid.benchmark.plant.noise import ornstein_uhlenbeck

Array = np.ndarray
SUITES = {"full": CHANNELS, "track": ("x", "y", "psi")}
SEAS = {"none": 0.0, "calm": 1.0, "mid": 2.5}
CALM = np.array([0.7e-5, 1.0e-5, 0.4e-5])  # X, Y over 1/2 rho L^2 U^2, N over that times L
SETTLING = 15.0  # L/U of straight run before a record starts
STREAMS = ("causes", "runs", "sea", "noise")


@dataclass(frozen=True, eq=False)
class Campaign:
    """Settings and truth; `sea` holds sd of X, Y, N in units of 1/2 rho L^2 U^2 (L) and `sea_tau` [s]."""

    seed: int
    vehicle: OtherVehicle
    planted: tuple[Planted, ...]
    suite: str
    sea_name: str
    sea: tuple[float, float, float]
    sea_tau: float
    sigma: dict[str, float]
    runs: tuple[RunPlan, ...]

    @property
    def settings(self) -> np.void:
        return settings_of(self.planted)

    def rng(self, stream: str, *more: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, STREAMS.index(stream), *more])


@dataclass(frozen=True, eq=False)
class Executed:
    """One run: plan, record, clean and logged readings (n, 6) of CHANNELS; NaN where not logged."""

    plan: RunPlan
    record: Record
    clean: Array
    logged: Array


def scales_of(vehicle: OtherVehicle) -> Scales:
    """Sizes that causes are drawn in."""
    v = vehicle
    force = 0.5 * v.rho * v.L**2 * v.U**2
    return Scales(v.L, v.U, force, v.rudder_rate, v.run, v.dt / v.parts, v.rudder_lag)


def draw_campaign(
    seed: int,
    vehicle: str,
    causes: Sequence[str] = (),
    sizes: Sequence[float] | None = None,
    suite: str = "full",
    sea: str = "none",
) -> Campaign:
    """Campaign of a vehicle with some causes.

    Parameters
    ----------
    sizes : of the causes, 1 is usual; drawn from 0.5 to 1.5 if left out
    suite, sea : of SUITES and SEAS

    Raises
    ------
    ModelError                 for a vehicle or a cause that is not known
    """
    body = other_vehicle(vehicle)
    streams = {name: np.random.default_rng([seed, k]) for k, name in enumerate(STREAMS)}
    drawn = [float(streams["causes"].uniform(0.5, 1.5)) for _ in causes]
    planted = plant_causes(causes, sizes or drawn, streams["causes"], scales_of(body))
    runs = plan_runs(body, streams["runs"], sea != "none")
    level = SEAS[sea] * CALM * streams["sea"].uniform(0.7, 1.3, 3)
    tau = body.LU * float(np.exp(streams["sea"].uniform(0.0, np.log(5.0))))
    sigma = {
        name: float(f"{body.noise[name] * streams['noise'].uniform(0.8, 1.2):.3g}") for name in SUITES[suite]
    }
    X, Y, N = map(float, level)
    return Campaign(seed, body, planted, suite, sea, (X, Y, N), tau, sigma, runs)


def start_of(campaign: Campaign, plan: RunPlan, g: np.void) -> Array:
    """(12,) state after a straight approach under the helmsman at the first shaft speed of the run."""
    v, calm = campaign.vehicle, g.copy()
    calm["jam_for"] = 0.0
    rpm = plan.levels[0][2] if plan.levels else plan.rpm
    x = np.zeros(12)
    x[2], x[5], x[6] = v.depth, plan.heading, v.U * rpm / v.rpm
    t = -np.arange(round(SETTLING * v.LU / plan.dt), -1, -1) * plan.dt
    x = simulate_run(v, calm, t, helm(v, plan.heading, rpm), x).states[-1].copy()
    x[0], x[1] = plan.place
    return x


def _sea(campaign: Campaign, k: int, count: int, h: float) -> Array | None:
    c = campaign
    if not any(c.sea):
        return None
    force = scales_of(c.vehicle).force
    amplitude = np.array(c.sea) * force * np.array([1.0, 1.0, c.vehicle.L])
    rng = c.rng("sea", k)
    return np.stack([a * ornstein_uhlenbeck(rng, count, h, c.sea_tau) for a in amplitude], axis=1)


def executed(campaign: Campaign) -> tuple[Executed, ...]:
    """Every run executed and logged."""
    out, c, g = [], campaign, campaign.settings
    for k, plan in enumerate(c.runs):
        x0, orders = start_of(c, plan, g), orders_of(c.vehicle, plan)
        sea = _sea(c, k, (plan.t.size - 1) * c.vehicle.parts + 1, plan.dt / c.vehicle.parts)
        record = simulate_run(c.vehicle, g, plan.t, orders, x0, sea)
        clean = readings(g, record.fine, record.states, record.parts)
        sd = np.array([c.sigma.get(name, np.nan) for name in CHANNELS])
        logged = clean + sd * c.rng("noise", k).standard_normal(clean.shape)
        out.append(Executed(plan, record, clean, logged))
    return tuple(out)


def replayed(campaign: Campaign, run: Executed, causes: bool = True) -> Executed:
    """The run again on the orders it had, without disturbing force and noise; without its causes if asked."""
    g = campaign.settings if causes else settings_of(())
    record = simulate_run(
        campaign.vehicle, g, run.record.t, run.record.orders, start_of(campaign, run.plan, g)
    )
    clean = readings(g, record.fine, record.states, record.parts)
    return Executed(run.plan, record, clean, clean)
