"""One replicate: a truth from the prior, its runs, its posterior, and where the truth ranks in it.

Takes a vehicle's name, a `Condition` and a seed. Gives plain numbers. Does not judge.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError, FitError
from bayesid.estimation.output_error import FitProblem, coefficient_set, fit
from bayesid.estimation.run_data import RunData
from bayesid.estimation.sampling import SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.estimation.sampling.priors import NoisePrior, draw_params
from bayesid.estimation.sampling.rank_statistics import inside, rank_of
from bayesid.model.params import ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import TimePlan, plan_run, simulate, steady_start

Array = np.ndarray
DEG = math.pi / 180
UNKNOWN = ("Y_v", "Y_r", "Y_dr", "N_v", "N_r", "N_dr", "Y_vdot", "N_rdot", "X_vr")  # of all three vehicles
CHANNELS = ("x", "y", "psi")
NOISE = {"x": 0.0125, "y": 0.0125, "psi": 0.3 * DEG}  # L, L, rad: centre of its prior
NOISE_WEIGHT = 8.0  # readings that prior is worth
START = {"u": 0.025, "v": 0.0075, "r": 0.013, "psi": 1.2 * DEG}  # U, U, U/L, rad: sd of the unknown start
PIECE_START = {"x": 0.02, "y": 0.02, **START}  # L: sd with which the start of a piece is known before
DT, STEP = 0.5, 0.25  # L/U
RUDDER = 12 * DEG
# end of each step of the rudder [L/U], and its angle over RUDDER
ORDERS = {
    "steps": ((1.4, 0.0), (7.2, -1.0), (16.0, 1.0), (24.0, -0.4)),
    "turn": ((1.4, 0.0), (16.0, 1.0)),
    "doublets": ((1.4, 0.0), (3.4, 0.8), (5.4, -0.8), (8.0, 0.5), (10.6, -0.5), (16.0, 0.0)),
}
RANKS, MOST_STEPS = 99, 8000
MOST_DRAWN = 20  # truths drawn until the vehicle does not diverge


@dataclass(frozen=True)
class Condition:
    """What the truth does and what the density assumes.

    Attributes
    ----------
    runs : of `ORDERS`
    noise : "white", "coloured" (first-order autoregression, correlation drawn anew from 0 to 1 per channel)
        or "student" (four degrees of freedom)
    pieces : equal pieces each run is cut into
    current : speed of a current from the south-west that the model does not know [U]
    start_known : whether every run begins at the steady state the model believes in
    prior_sd : of the coefficients, relative
    settings : of the density, beyond the prior of the noise
    control : whether its intervals must fail
    """

    runs: tuple[str, ...] = ("steps",)
    noise: str = "white"
    pieces: int = 1
    current: float = 0.0
    start_known: bool = False
    prior_sd: float = 0.05
    settings: dict[str, Any] = field(default_factory=lambda: {"memory": "ignore"})
    control: bool = False


@cache
def vehicle_model(name: str) -> Model:
    return build_model(load_vehicle(name), 3)


def unknowns_of(model: Model, prior_sd: float) -> ParameterSet:
    """The coefficients with a normal prior about the vehicle file's values."""
    entries = coefficient_set(model, UNKNOWN, relative_bounds=6 * prior_sd, use_prior=False)
    return ParameterSet(
        tuple(replace(p, prior=Prior("normal", p.start, prior_sd * p.scale)) for p in entries)
    )


def commands_of(model: Model, name: str) -> tuple[Array, dict[str, Array]]:
    """Grid of a run [s] and its orders."""
    s, steps = model.scales, ORDERS[name]
    t = np.arange(0.0, steps[-1][0] + 0.5 * DT, DT)
    rudder = RUDDER * np.select([t < end for end, _ in steps], [value for _, value in steps], steps[-1][1])
    shaft = np.full(t.size, float(model.vehicle.rpm_ref or 0.0))
    return t * s["L"] / s["U"], {"delta_r_cmd": rudder, "n_cmd": shaft}


def planned(model: Model, t: Array, orders: dict[str, Array]) -> TimePlan:
    return plan_run(model, t, orders, max_step=STEP * model.scales["L"] / model.scales["U"])


def errors_of(kind: str, sigma: Array, count: int, phi: Array, rng: np.random.Generator) -> Array:
    """(count, c) noise of the channels."""
    if kind == "student":
        return np.asarray(sigma * rng.standard_t(4, (count, sigma.size)))
    white = rng.standard_normal((count, sigma.size))
    if kind == "coloured":
        for i in range(1, count):
            white[i] = phi * white[i - 1] + np.sqrt(1 - phi**2) * white[i]
    return np.asarray(sigma * white)


def units_of(model: Model) -> dict[str, float]:
    """SI units of states in L and U."""
    length, speed = model.scales["L"], model.scales["U"]
    return {"x": length, "y": length, "psi": 1.0, "u": speed, "v": speed, "r": speed / length}


def runs_of(
    model: Model, par: Array, condition: Condition, sigma: Array, phi: Array, rng: np.random.Generator
) -> list[RunData]:
    """Readings of every run, whole or in pieces, with starts that are not quite where they are believed."""
    unit, out = units_of(model), []
    level = np.array([NOISE[c] * unit[c] for c in CHANNELS])
    steady = steady_start(model, float(model.vehicle.rpm_ref or 0.0))
    known = START if condition.pieces == 1 else PIECE_START
    if condition.start_known:
        known = {}
    sd = np.array([known[c] * unit[c] for c in known])
    where = [model.states.index(c) for c in known]
    for name in condition.runs:
        t, orders = commands_of(model, name)
        x0 = np.array(steady)
        begin = [model.states.index(c) for c in START]
        moved = np.array([START[c] * unit[c] for c in START]) * rng.standard_normal(len(begin))
        x0[begin] += 0.0 if condition.start_known else moved
        states = simulate(model, par, planned(model, t, orders), x0).states
        if not np.isfinite(states).all():
            raise FitError(f"{name}: the vehicle drawn diverges")
        readings = states[:, [model.states.index(c) for c in CHANNELS]]
        readings = readings + errors_of(condition.noise, sigma, t.size, phi, rng)
        edges = np.linspace(0, t.size, condition.pieces + 1).astype(int)
        for k, (a, b) in enumerate(zip(edges, edges[1:], strict=False)):
            believed = np.array(steady)
            if condition.pieces > 1:  # a piece begins where its readings say, to `PIECE_START`
                believed = np.array(states[a])
                believed[where] += sd * rng.standard_normal(len(where))
            part = planned(model, t[a:b] - t[a], {c: x[a:b] for c, x in orders.items()})
            out.append(
                RunData(f"{name} {k + 1}", part, CHANNELS, readings[a:b], level, believed, tuple(known), sd)
            )
    return out


def replicate(vehicle: str, condition: Condition, seed: int) -> dict[str, Any]:
    """One truth, its runs, one posterior: ranks, hits and how the sampler fared."""
    begin, rng, model = time.process_time(), np.random.default_rng([2018, seed]), vehicle_model(vehicle)
    params, unit = unknowns_of(model, condition.prior_sd), units_of(model)
    level = np.array([NOISE[c] * unit[c] for c in CHANNELS])
    noise = NoisePrior("inverse_gamma", level, NOISE_WEIGHT)
    for drawn in range(1, MOST_DRAWN + 1):
        truth, sigma = draw_params(params, 1, rng)[0], noise.draw(1, rng)[0]
        phi = rng.uniform(size=level.size)
        along = condition.current * model.scales["U"] / math.sqrt(2)
        current = {f"ocean_current.{c}": along for c in ("V_north", "V_east")} if along else {}
        par = params.place(model.with_values(current), model.index, truth)
        try:
            runs = runs_of(model, par, condition, sigma, phi, rng)
            break
        except BayesidError:
            if drawn == MOST_DRAWN:
                raise
    problem = FitProblem(model, params, tuple(runs), np.array(model.nominal))
    choice = SamplingSettings(noise_weight=NOISE_WEIGHT, **condition.settings)
    density = trial_density(problem, fit(problem).z, choice, dict(zip(CHANNELS, level, strict=True)))
    density = replace(density, threads=1)
    options = SamplerOptions(first=50, max_steps=MOST_STEPS, seed=seed, weights={"gaussian": 0.9, "de": 0.1})
    posterior = sample(density, density.laplace, options)
    told = dict(zip(params.names, truth, strict=True))
    told |= {f"sigma:{c}": s for c, s in zip(CHANNELS, sigma, strict=True)}
    told |= {f"phi:{c}": p for c, p in zip(CHANNELS, phi, strict=True)}
    at = [i for i, n in enumerate(posterior.names) if n in told]  # starts of runs are not judged
    names, draws = [posterior.names[i] for i in at], posterior.flat[:, at]
    whole = np.array([told[n] for n in names])
    return {
        "vehicle": vehicle, "names": names, "truth": whole, "vehicles_drawn": drawn,
        "rank": rank_of(draws, whole, RANKS),
        "inside50": inside(draws, whole, 0.5), "inside90": inside(draws, whole, 0.9),
        "sd_over_prior": posterior.sd[at] / posterior.prior_sd[at],
        "converged": posterior.converged, "reasons": posterior.convergence.reasons,
        "rhat": float(np.nanmax(posterior.convergence.rhat)),
        "tau": float(posterior.convergence.tau.max()), "ess": float(posterior.convergence.ess_bulk.min()),
        "steps": posterior.steps, "cpu_seconds": time.process_time() - begin,
    }  # fmt: skip
