"""What effects do to a run, and which of them look alike on a stated design.

Runs a simulated vehicle; fits nothing.

The design is a choice, printed with the numbers: other runs, sensors or vehicles give other look-alikes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayesid.api.inputs import scale_of
from bayesid.api.simulate import simulate_model
from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.hypotheses.sensitivity_bank import build_bank, isolability, testable
from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError
from bayesid.estimation.parameters import effect_prior
from bayesid.manoeuvres import parse
from bayesid.model.effects import Effect
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import observe, plan_run, simulate, steady_start
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials.trial import Environment

VEHICLE = "remus100"
RUNS = ("straight", "zigzag:10/10", "turn:12", "prbs")
NOISE = {"x": 0.2, "y": 0.2, "psi": 0.005, "u": 0.01, "v": 0.01, "r": 0.002}
CALM = 1e-5  # disturbing force over 1/2 rho L^2 U^2
SHOWN = "zigzag:10/10"
PLANE, DEPTH = np.radians(3.0), 2.0  # of the doublet: amplitude [rad], depth at its beginning [m]
LEAST = 10.0  # noncentrality below which an effect is called not to show


@dataclass(frozen=True)
class Trace:
    """Noncentrality of an effect of one prior sd, share that coefficients absorb, and its look-alikes."""

    shows: float
    absorbed: float
    rivals: tuple[str, ...]


@cache
def model() -> Model:
    """The vehicle of all examples, in the horizontal plane."""
    return build_model(load_vehicle(VEHICLE), 3)


@cache
def deep_model() -> Model:
    """The same vehicle in six degrees of freedom."""
    return build_model(load_vehicle(VEHICLE), 6)


@cache
def traces() -> dict[str, Trace]:
    """Effect -> what the runs of the design show of it."""
    found = model()
    trial = simulate_model(found, VEHICLE, RUNS, 0.5, None, None, NOISE, 1)
    problem = build_problem(found, replace(trial, environment=Environment(CALM, 0.0)))
    effects = [e for e in found.kernel.effects if testable(problem, e)]
    bank = build_bank(problem, problem.path, [problem.environment.noise_model], effects)
    told = isolability(bank, size=1.0)
    visible = {n for n, d in zip(told.names, told.detect, strict=True) if d >= LEAST}
    return {
        name: Trace(d, a, tuple(r for r in told.rivals(name) if r in visible) if name in visible else ())
        for name, d, a in zip(told.names, told.detect.tolist(), told.absorbed.tolist(), strict=True)
    }


def changed(effect: Effect | None) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Times and noise-free readings of one zig-zag with the effect at one prior sd; None if it diverges."""
    found = model()
    par = found.nominal.copy()
    if effect is not None:
        prior = effect_prior(found, effect)
        par[prior.where] = np.maximum(par[prior.where], prior.mean) + prior.sd
    try:
        run = virtual_run(found, par, parse(SHOWN, scale_of(found, None, 0.5)), name="shown")
    except BayesidError:
        return None
    return run.t, run.data


def changed_in_depth(effect: Effect | None) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """The same for one doublet of the stern planes, begun at `DEPTH`."""
    found = deep_model()
    par = found.nominal.copy()
    if effect is not None:
        prior = effect_prior(found, effect)
        par[prior.where] = np.maximum(par[prior.where], prior.mean) + prior.sd
    t = np.arange(0.0, 20.01, 0.1)
    planes = np.where(t < 4, 0.0, np.where(t < 7, 1.0, np.where(t < 10, -1.0, 0.0))) * PLANE
    rpm = np.full(t.size, found.vehicle.rpm_ref)
    plan = plan_run(found, t, {"delta_r_cmd": 0.0 * t, "delta_s_cmd": planes, "n_cmd": rpm})
    start = steady_start(found)
    start[found.states.index("z")] = DEPTH
    try:
        states = simulate(found, par, plan, start, full=True).states
    except BayesidError:
        return None
    readings = observe(found, par, plan, states, full=True)
    return t, {c: readings[:, k] for k, c in enumerate(found.kernel.channels)}


def sizes(effect: Effect) -> dict[str, tuple[float, str]]:
    """Parameter -> (value of one prior sd [SI], unit) for the vehicle of the examples."""
    found = model()
    prior = effect_prior(found, effect)
    value = np.maximum(found.nominal[prior.where], prior.mean) + prior.sd
    return {p.name: (float(value[prior.names.index(effect.key(p.name))]), p.unit) for p in effect.parameters}


def constants() -> dict[str, float]:
    """Constants of the vehicle that a sentence on an effect may speak of."""
    return {name: float(model().nominal[at]) for name, at in model().index.items() if "." not in name}
