"""Gross events: found, dated, told apart, left out; gaps that last are no events."""

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.event import blanked, released
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.data.windows import ratios, windows
from bayesid.diagnosis.event_search import identify_events, suspects
from bayesid.diagnosis.events_counted import verdict_with
from bayesid.diagnosis.hypotheses.verdict import Verdict
from bayesid.estimation.filter_error.linearise import linearise
from bayesid.estimation.parameters import NO_PARAMETERS

SAMPLES = 160  # two runs of 64 L/U


def spoiled(trial, spoil):
    """The trial with the readings of its turn changed by `spoil(data, t)`."""
    runs = []
    for run in trial.runs:
        data = {c: v.copy() for c, v in run.data.items()}
        if run.name == "turn":
            spoil(data, run.t)
        runs.append(replace(run, data=data))
    return replace(trial, runs=tuple(runs))


def begin(model):
    """When the events of these tests happen: in a turn, 30 L/U after its start."""
    return 30.0 * model.scales["L"] / model.scales["U"]


@lru_cache
def case(name, event):
    """Trial of another vehicle of the prior with one event, its problem and its events."""
    model = model_of(name)
    L, U, rho = (model.scales[k] for k in ("L", "U", "rho"))
    first = begin(model)

    def blow(run, t):
        hit = (t > first) & (t < first + 1.0 * L / U) & (run == "turn")
        return {"Y": 4e-3 * 0.5 * rho * L**2 * U**2 * hit, "N": -2e-3 * 0.5 * rho * L**3 * U**2 * hit}

    force = blow if event == "blow" else None
    truth = other_vehicle(model, 3)
    if event == "current":
        truth |= {"ocean_current.V_north": 0.2 * U}
    trial = planted_trial(model, truth, 3, force, samples=SAMPLES)

    def jump(data, t):
        data["x"] += 2.0 * L * (t > first)

    def freeze(data, t):
        stuck = (t > first) & (t < first + 4.0 * L / U)
        data["psi"][stuck] = data["psi"][stuck][0]

    if event in ("jump", "freeze"):
        trial = spoiled(trial, {"jump": jump, "freeze": freeze}[event])
    problem = build_problem(model, trial)
    return trial, problem, identify_events(problem, trial, suspects(problem))


@pytest.mark.thorough
@pytest.mark.parametrize("name, event, kind, channel, lasts", [
    ("remus100", "jump", "jump", "x,y", 0.0),
    ("remus100", "freeze", "sensor", "psi", 4.0),
    ("generic_sub", "blow", "motion", None, 1.0),
])  # fmt: skip
def test_an_event_is_dated_and_its_channel_told(name, event, kind, channel, lasts):
    _, problem, events = case(name, event)
    model = problem.model
    time, first = model.scales["L"] / model.scales["U"], begin(model)
    assert [(e.run, e.kind) for e in events] == [("turn", kind)]
    assert channel in (None, events[0].channel)
    # a frozen heading shows once the true one has left it; samples are 0.4 L/U apart
    assert first - 1.5 * time < events[0].start < first + (0.5 * lasts + 1.0) * time
    assert abs(events[0].end - first - lasts * time) < 1.5 * time


@pytest.mark.parametrize("name, event", [("remus100", "jump"), ("generic_sub", "blow")])
def test_without_the_event_the_trial_is_an_ordinary_one(name, event):
    trial, problem, events = case(name, event)
    rest = build_problem(problem.model, trial, events=events)
    assert rest.events == events
    before, after = fit_with(problem, ()), fit_with(rest, ())
    assert before.chi2 > 2.0 or not before.converged
    assert after.converged and 0.8 < after.chi2 < 1.2
    truth = other_vehicle(problem.model, 3)
    z = [(v - truth[n]) / s for n, v, s in zip(after.free.names, after.values, after.sd, strict=True)]
    assert np.abs(z).max() < 4.0


def test_a_gap_that_lasts_is_no_event():
    # control: far more misfit than any event above, in every window
    _, problem, events = case("remus100", "current")
    assert fit_with(problem, ()).chi2 > 10.0
    assert events == () and suspects(problem) == ()


@pytest.mark.parametrize("name", ["remus100", "generic_sub"])
def test_no_window_of_a_clean_trial_stands_out(name):
    # misfit per reading of some 30 readings: 1 give or take 0.26; 40 windows of two runs
    _, problem, events = case(name, "")
    model, fitted = problem.model, fit_with(problem, ())
    paths = [linearise(model, log, p, NO_PARAMETERS.where)
             for log, p in zip(problem.logs, fitted.points, strict=True)]  # fmt: skip
    found = ratios(windows(model, paths, NO_PARAMETERS, problem.environment.noise_model))
    assert found.size > 30 and 0.8 < np.median(found) < 1.2 and found.max() < 2.5
    assert events == () and suspects(problem, fitted) == ()


def test_only_what_an_event_spoiled_is_left_out():
    trial, problem, events = case("remus100", "freeze")
    run = trial.run("turn")
    kept = blanked(run, events)
    inside = (run.t >= events[0].start) & (run.t <= events[0].end)
    np.testing.assert_array_equal(np.isnan(kept.data["psi"]), inside)
    assert not np.isnan(kept.data["r"]).any()
    log = next(log for log in problem.logs if log.name == "turn")
    assert released(problem.model, log, events).jumps is None  # the vehicle went on as before
    moved = released(problem.model, log, (replace(events[0], kind="motion"),))
    assert np.count_nonzero(moved.jumps.any(axis=1)) == 1


def test_a_motion_nothing_explains_is_a_gap_and_a_sensor_fault_is_not():
    quiet = Verdict("none", (), ("none",), (), ())
    events = case("remus100", "freeze")[2]
    none = SimpleNamespace(effects=(), log_evidence=0.0)
    rest = SimpleNamespace(best=none, refits=(), none=none, carried=0.0)
    assert verdict_with(quiet, events, rest).word == "none"
    assert verdict_with(quiet, (replace(events[0], kind="motion"),), rest).word == "outside"
    assert verdict_with(quiet, (), rest) is quiet
