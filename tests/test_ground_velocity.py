"""Velocity over ground that a filter in earth axes makes late, turned by the heading of the moment."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from gap_trials import model_of, noise_of, orders, planted_trial
from scipy.interpolate import CubicSpline

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.simulation import observe, plan_run, simulate, steady_start

LATE, BODY = "ground_velocity_latency", "velocity_latency"


@lru_cache
def turning():
    """Readings of a turn with every sensor in time, densely sampled: channel -> (n,), and the plan."""
    model = model_of()
    manoeuvre = orders(model)["turn"]
    t = np.arange(0.0, manoeuvre.t[-1], 0.05 * model.scales["L"] / model.scales["U"])
    inputs = {k: np.interp(t, manoeuvre.t, v) for k, v in manoeuvre.commands.items()}
    plan = plan_run(model, t, inputs)
    states = simulate(model, model.nominal, plan, steady_start(model), full=True).states
    readings = observe(model, model.nominal, plan, states)
    return model, t, plan, states, dict(zip(model.kernel.channels, readings.T, strict=True))


def late_by_hand(t, data, delay):
    """u + i v: the velocity of a spline through the track, `delay` ago, in the axes of now."""
    north, east = CubicSpline(t, data["x"], bc_type="natural"), CubicSpline(t, data["y"], bc_type="natural")
    return (north(t - delay, 1) + 1j * east(t - delay, 1)) * np.exp(-1j * data["psi"])


def test_readings_are_the_tracks_velocity_of_a_while_ago_in_the_axes_of_now():
    """The rate of turn of the moment stands for the mean over the delay: off to its second order."""
    model, t, plan, states, data = turning()

    def off(share):
        delay = share * model.scales["L"] / model.scales["U"]
        par = model.with_values({f"{LATE}.delay": delay})
        readings = dict(zip(model.kernel.channels, observe(model, par, plan, states).T, strict=True))
        moved = readings["u"] + 1j * readings["v"] - late_by_hand(t, data, delay)
        return np.abs(moved)[30:-5].max() / model.scales["U"]

    prompt = np.abs(data["u"] + 1j * data["v"] - late_by_hand(t, data, 0.4 / model.scales["U"]))[30:-5].max()
    assert prompt > 0.01 * model.scales["U"]
    assert off(0.2) < 0.01
    assert off(0.2) > 3.0 * off(0.1)


def test_it_is_told_from_a_delay_in_the_axes_of_the_vehicle():
    """In a steady turn u and v are constant: a delay in body axes is not seen, one in earth axes is."""
    model = model_of()
    sigma, trial, delay = noise_of(model), planted_trial(model), 0.3 * model.scales["L"] / model.scales["U"]
    rng = np.random.default_rng(3)

    def late(run):
        clean = {c: run.data[c] for c in ("x", "y", "psi")}
        plan = plan_run(model, run.t, run.commands)
        states = simulate(model, model.nominal, plan, steady_start(model), full=True).states
        true = dict(zip(model.kernel.channels, observe(model, model.nominal, plan, states).T, strict=True))
        body = late_by_hand(run.t, true, delay)
        u, v = (part + sigma["u"] * rng.standard_normal(part.size) for part in (body.real, body.imag))
        return replace(run, data={**run.data, **clean, "u": u, "v": v})

    problem = build_problem(model, replace(trial, runs=tuple(late(run) for run in trial.runs)))

    def gained(name):
        fitted = fit_with(problem, (model.effects[name],))
        return fitted, weighted_hypothesis(problem, (name,), fitted).log_evidence

    found, best = gained(LATE)
    at = found.free.names.index(f"{LATE}.delay")
    assert abs(found.values[at] - delay) < 3.0 * found.sd[at] + 0.02 * delay
    assert best > gained(BODY)[1] + 20.0
