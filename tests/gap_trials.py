"""Short trials with a known gap, executed by the model itself, for tests of filter-error fit and
diagnosis."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from bayesid.equations.model import build_model
from bayesid.manoeuvres import OpenLoop
from bayesid.model.vehicles import CoefficientPrior, load_vehicle
from bayesid.simulation import observe, plan_run, simulate, steady_start
from bayesid.trials import Run, Trial
from bayesid.trials.trial import Environment

SIGMA = {"x": 0.05, "y": 0.05, "psi": 0.005, "r": 0.005, "u": 0.01, "v": 0.01}  # over L, L, 1, U/L, U, U


@lru_cache
def model_of(name="remus100", relative_sd=0.05):
    """Planar model; every coefficient known to the same share."""
    vehicle = load_vehicle(name)
    return build_model(replace(vehicle, prior=CoefficientPrior(dict.fromkeys(vehicle.coef, relative_sd))), 3)


def noise_of(model):
    """White sensor noise, SI."""
    s = model.scales
    unit = {"x": s["L"], "y": s["L"], "psi": 1.0, "r": s["U"] / s["L"], "u": s["U"], "v": s["U"]}
    return {c: share * unit[c] for c, share in SIGMA.items()}


def orders(model, samples=80):
    """Two rudder histories with shaft steps: a zig-zag by the clock, and a turn one way then the other."""
    t = 0.4 * model.scales["L"] / model.scales["U"] * np.arange(samples)
    k, rpm = np.arange(samples), model.vehicle.rpm_ref
    zigzag = 0.2 * np.sign(np.sin(2 * np.pi * (k - 4) / 26)) * (k > 4)
    turn = np.where(k < 6, 0.0, np.where(k < 45, 0.25, -0.12))
    shaft = np.where((k > 50) & (k < 66), 0.8, 1.0) * rpm
    return {
        "zigzag": OpenLoop("zig-zag", t, {"delta_r_cmd": zigzag, "n_cmd": np.full(samples, rpm)}),
        "turn": OpenLoop("turn", t, {"delta_r_cmd": turn, "n_cmd": shaft}),
    }


def planted_trial(model, values=None, seed=0, force=None, samples=80, holdout=(), executed=None):
    """Trial of the model with other parameters.

    Parameters
    ----------
    values : parameter -> value, SI
    force : (run name, steps' time) -> dict of forces [N, N m] added from outside
    executed : (run name, orders) -> orders that are executed; those logged by default
    """
    par, sigma = model.with_values(values or {}), noise_of(model)
    rng = np.random.default_rng(seed)
    runs = []
    for name, manoeuvre in orders(model, samples).items():
        done = manoeuvre.commands if executed is None else executed(name, manoeuvre.commands)
        plan = plan_run(model, manoeuvre.t, done)
        if force is not None:
            exogenous = plan.exogenous.copy()
            for axis, values_now in force(name, plan.times).items():
                exogenous[:, model.kernel.exogenous.index(f"force_{axis}")] += values_now
            plan = replace(plan, exogenous=exogenous)
        states = simulate(model, par, plan, steady_start(model), full=True).states
        readings = observe(model, par, plan, states)
        where = model.kernel.channels.index
        data = {c: readings[:, where(c)] + sd * rng.standard_normal(samples) for c, sd in sigma.items()}
        role = "holdout" if name in holdout else "identify"
        runs.append(Run(name, manoeuvre.name, role, manoeuvre.t, data, manoeuvre.commands))
    calm = Environment(force_rms=1e-6, nav_drift=0.0)
    return Trial("pond", Path("."), model.vehicle.name, 3, tuple(runs), noise=sigma, environment=calm)


def other_vehicle(model, seed):
    """Coefficients of one vehicle of the prior: name -> value, SI."""
    rng = np.random.default_rng(seed)
    return {
        n: model.nominal[model.index[n]] + model.prior_sd(n) * rng.standard_normal()
        for n in model.coefficients
    }
