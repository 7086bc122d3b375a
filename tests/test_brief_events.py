"""Events that are not gross: a force in one run is dated; none, and one that lasts, are no event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis import brief_events as module
from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.brief_events import _gains, _joined, _largest_of, brief_events
from bayesid.diagnosis.cut_runs import (
    BriefSignal,
    CutRun,
    Joint,
    cut,
    orders,
    prior_root,
    signals_of,
    sought_in,
)
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.event_description import _anew
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.hypotheses.rules import MOTION_EVENT
from bayesid.diagnosis.run import diagnose
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.linearise import linearise_runs
from bayesid.report.diagnosis.first_screen import picture_of
from bayesid.simulation import observe, plan_run, simulate, steady_start

BEGIN, LASTS = 25.0, 4.0  # L/U
SIZE = 1e-4  # over 1/2 rho L^3 U^2


def brief(run, t):
    return (t > BEGIN) & (t < BEGIN + LASTS) & (run == "turn")


def nothing(run, t):
    return np.zeros(t.size)


def trial_of(model, acts, size=SIZE):
    """Two runs; `acts` (run, time over L/U) says when a turning moment does."""
    L, U, rho = (model.scales[k] for k in ("L", "U", "rho"))

    def force(run, t):
        return {"N": size * 0.5 * rho * L**3 * U**2 * acts(run, t * U / L)}

    return planted_trial(model, other_vehicle(model, 3), 3, force, samples=160)


def fitted(trial):
    model = model_of("remus100")
    problem = build_problem(model, trial)
    return problem, weighted_hypothesis(problem, (), fit_with(problem, ()))


def found_in(problem, none, least, tight=False):
    return brief_events(sought_in(problem, none.fit.free, none.fit.followed), lambda: least, tight)


def events_of(acts, size=SIZE, least=0.0):
    model = model_of("remus100")
    problem, none = fitted(trial_of(model, acts, size))
    return model.scales["L"] / model.scales["U"], none, found_in(problem, none, least)


@pytest.mark.thorough
@pytest.mark.parametrize("size", [1e-4, 4e-4, 1e-3])
def test_a_moment_is_dated_whether_the_fit_without_it_follows_the_readings_or_not(size):
    time, none, found = events_of(brief, size)
    assert none.fit.converged == (size < 2e-4)
    assert [(e.run, e.kind, e.brief, e.misfit) for e in found] == [("turn", "motion", True, None)]
    assert found[0].start / time == pytest.approx(BEGIN, abs=1.01)
    assert found[0].end / time == pytest.approx(BEGIN + LASTS, abs=1.01)


@pytest.mark.thorough
def test_it_has_to_gain_more_than_what_would_do_instead():
    problem, none = fitted(trial_of(model_of("remus100"), brief))
    (event,) = found_in(problem, none, 0.0)
    assert event.evidence > 100.0
    assert found_in(problem, none, event.evidence - 1.0) == (event,)
    assert found_in(problem, none, event.evidence + 1.0) == ()


@pytest.mark.thorough
@pytest.mark.parametrize(("more", "told"), [(-6.0, 1), (-4.0, 0), (1.0, 0)])
def test_what_a_force_of_the_motion_explains_nearly_as_well_is_no_event(more, told, monkeypatch):
    problem, none = fitted(trial_of(model_of("remus100"), brief))
    (event,) = found_in(problem, none, 0.0)
    monkeypatch.setattr(module, "_by_motion", lambda sought, errors: event.evidence + more)
    assert len(found_in(problem, none, 0.0)) == told
    assert len(found_in(problem, none, 0.0, tight=True)) == 1  # told anew, not decided anew


def test_without_a_moment_there_is_no_event():
    assert events_of(nothing, least=-np.inf)[-1] == ()


@pytest.mark.thorough
@pytest.mark.parametrize(
    "acts",
    [lambda run, t: np.sign(np.sin(t / 5.0)), lambda run, t: np.sin(t / 9.0 + (run == "turn"))],
    ids=["every few lengths", "a swell"],
)
def test_what_lasts_is_no_event(acts, monkeypatch):
    monkeypatch.setattr(module, "CAUSE_OVER_MOTION", -np.inf)
    assert events_of(acts, 5e-5, -np.inf)[-1] == ()
    monkeypatch.setattr(module, "MOST_TIME_SHARE", 1.0)
    assert events_of(acts, 5e-5, -np.inf)[-1] != ()


def test_a_moment_is_told_by_the_rudder_that_would_have_turned_the_vehicle_as_much():
    model = model_of("remus100")
    problem, none = fitted(trial_of(model, brief))
    (event,) = found_in(problem, none, 0.0, tight=True)
    assert event.channel == "rudder" and event.stuck is None
    lasts = (event.end - event.start) * model.scales["U"] / model.scales["L"]
    per_speed_squared = SIZE * 0.5 * model.scales["rho"] * model.scales["L"] ** 3
    equal = per_speed_squared / model.nominal[model.index["N_dr"]] * LASTS / lasts
    assert event.value == pytest.approx(equal, rel=0.2)
    assert 0.0 < event.sd < 0.2 * abs(event.value)


@pytest.mark.thorough
@pytest.mark.parametrize(("channel", "off"), [("psi", 0.03), ("psi", 0.01), ("x", 0.2), ("u", 0.04)])
def test_readings_wrong_for_a_time_are_no_motion(channel, off, monkeypatch):
    """By two to six times their noise (L, U): a motion where sensors are not asked, or nothing at all."""
    model = model_of("remus100")
    trial = trial_of(model, nothing)
    zigzag, turn = trial.runs
    unit = {"psi": 1.0, "x": model.scales["L"], "u": model.scales["U"]}
    wrong = turn.data[channel].copy()
    wrong[60:72] += off * unit[channel]
    problem, none = fitted(replace(trial, runs=(zigzag, replace(turn, data={**turn.data, channel: wrong}))))
    assert found_in(problem, none, 0.0) == ()
    if off == 0.03:
        sets = module.channel_sets
        monkeypatch.setattr(
            module, "channel_sets", lambda problem: {k: v for k, v in sets(problem).items() if v[0]}
        )
        assert [e.run for e in found_in(problem, none, 0.0)] == ["turn"]


def executed(model, trial, name, actuator, first, last):
    """The trial with one run made with the order of one sample kept for some time, logged as ordered."""
    stuck = next(r for r in trial.runs if r.name == name)
    kept = {c: v.copy() for c, v in stuck.commands.items()}
    kept[f"{actuator}_cmd"][first:last] = kept[f"{actuator}_cmd"][first]
    plan, par = plan_run(model, stuck.t, kept), model.with_values(other_vehicle(model, 3))
    readings = observe(model, par, plan, simulate(model, par, plan, steady_start(model), full=True).states)
    rng = np.random.default_rng(4)
    at = model.kernel.channels.index
    data = {c: readings[:, at(c)] + sd * rng.standard_normal(stuck.t.size) for c, sd in trial.noise.items()}
    return replace(trial, runs=tuple(replace(r, data=data) if r.name == name else r for r in trial.runs))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("actuator", "name", "first", "last"), [("delta_r", "zigzag", 87, 99), ("n", "turn", 47, 58)]
)
def test_an_actuator_that_sticks_is_told_with_where_it_stuck(actuator, name, first, last):
    model = model_of("remus100")
    trial = planted_trial(model, other_vehicle(model, 3), 3, samples=160)
    problem, none = fitted(executed(model, trial, name, actuator, first, last))
    (event,) = found_in(problem, none, 0.0, tight=True)
    run = next(r for r in trial.runs if r.name == name)
    order = run.commands[f"{actuator}_cmd"]
    moves = first + int(np.flatnonzero(order[first:] != order[first])[0])
    step = 0.5 * model.scales["L"] / model.scales["U"]
    assert (event.run, event.stuck) == (name, actuator)
    assert event.value == pytest.approx(order[first], rel=0.1)
    assert abs(event.value - order[first]) < 2.0 * event.sd
    assert event.start == pytest.approx(run.t[moves], abs=2.0 * step)
    assert event.end == pytest.approx(run.t[last], abs=2.0 * step)


@pytest.mark.thorough
def test_a_diagnosis_says_when_and_blames_no_effect():
    """What stands beside an event follows a part of it; beside the rest it has its own times and size."""
    model = model_of("remus100")
    trial = trial_of(model, brief)
    found = diagnose(trial, model, plan_next=False)
    (before,), (event,) = found.problem.events, found.result.events
    assert (found.verdict.word, found.verdict.rule, found.verdict.effects) == ("outside", MOTION_EVENT, ())
    time = model.scales["L"] / model.scales["U"]
    assert before.brief and event.evidence == before.evidence
    assert event.start / time == pytest.approx(BEGIN, abs=0.5)
    assert event.end / time == pytest.approx(BEGIN + LASTS, abs=0.5)
    assert event.channel == "rudder" and event.value < -5.0 * event.sd
    shown = found.result.drawings.replays[0]
    assert shown.run == found.result.runs[0].run == "turn"
    readings = next(r for r in trial.runs if r.name == "turn").data["psi"]
    np.testing.assert_allclose(shown.readings[:, shown.channels.index("psi")], readings)  # those then as well
    events = (event, replace(event, run="zigzag"), replace(event, kind="sensor"))
    assert picture_of(shown, answer(found.result), events).events == ((event.start, event.end),)


def test_events_found_again_are_told_once_each_with_the_evidence_of_those_they_stand_for():
    def event(start, end, evidence, run="a", value=None):
        return Event(run, start, end, "rudder", "motion", None, evidence, True, value, 0.1)

    two, one = (event(10, 20, 60.0), event(25, 32, 25.0)), event(12, 30, 400.0, value=0.2)
    assert _anew(two, (one,)) == (event(12, 30, 85.0, value=0.2),)
    parts = event(10, 14, 300.0, value=0.1), event(16, 20, 100.0, value=0.3)
    assert _anew(two[:1], parts) == (event(10, 14, 45.0, value=0.1), event(16, 20, 15.0, value=0.3))
    other, gross = event(10, 20, 9.0, "b"), Event("a", 11.0, 12.0, "X", "motion", 20.0, 50.0)
    assert _anew((two[0], gross), (other,)) == (two[0], gross)


def test_an_order_beyond_the_limit_is_the_limit():
    model = model_of("remus100")
    trial = planted_trial(model, samples=40)
    zigzag = trial.runs[0]
    commands = {**zigzag.commands, "delta_r_cmd": 9.0 * zigzag.commands["delta_r_cmd"]}
    problem = build_problem(model, replace(trial, runs=(replace(zigzag, commands=commands), trial.runs[1])))
    limit = float(model.nominal[model.index["limit_r"]])
    assert 0.0 < limit < 1.8 and np.abs(orders(problem, 0, "delta_r")).max() == limit
    assert orders(problem, 1, "n").max() == model.vehicle.rpm_ref


def test_signals_of_a_run_that_overlap_or_touch_are_one():
    def signal(run, first, last):
        return BriefSignal(1.0, run, "N", first, last, np.zeros(0), np.zeros((0, 0)))

    a, b, c, d = signal(0, 4, 8), signal(0, 8, 9), signal(0, 11, 12), signal(1, 5, 7)
    assert _joined([d, c, a, b]) == [[a, b], [c], [d]]


def test_what_a_signal_gains_is_its_evidence_and_its_choice_is_counted():
    """Columns of a run, made anew for one signal and whitened with all others, against one normal matrix."""
    problem, none = fitted(trial_of(model_of("remus100"), brief))
    free, signals = none.fit.free, signals_of(problem)
    paths = linearise_runs(problem.model, problem.logs, none.fit.points, free.where)
    runs = [cut(problem, free, k, path, signals) for k, path in enumerate(paths)]
    sought = module.Sought(problem, free, paths, runs, signals)
    joint = Joint(runs, sought.known, [])
    best = module._largest(sought, joint)
    tried = sum(_largest_of(sought, r, *joint.rest(r.run))[0] for r in runs)
    assert best.chosen == pytest.approx(np.log(tried)) and best.chosen > np.log(1000)
    with_it = Joint(runs, sought.known, [best]).log_evidence - joint.log_evidence
    assert with_it == pytest.approx(best.gain + best.chosen, rel=1e-6)


def equations(rng, rows, columns):
    a, e = rng.standard_normal((rows, columns)), rng.standard_normal(rows)
    return NormalEquations(a.T @ a, a.T @ e, float(e @ e), 0.0, rows)


def test_gains_are_those_of_one_linear_model_of_all_runs():
    """Two runs, three shared parameters: evidence of the joint model with a signal over that without it."""
    rng = np.random.default_rng(0)
    known, signals = 3, 6
    runs = [CutRun(k, 0.0, 1.0, signals, equations(rng, 60, known + signals)) for k in (0, 1)]

    def joint(allowed):
        """Log evidence with signals (run, columns, root), each run's own."""
        size = known + sum(root.shape[1] for *_, root in allowed)
        total, begin = None, known
        bases = {k: np.zeros((known + signals, size)) for k in (0, 1)}
        for basis in bases.values():
            basis[:known, :known] = np.eye(known)
        for run, columns, root in allowed:
            bases[run][known + columns, begin : begin + root.shape[1]] = root
            begin += root.shape[1]
        for k, basis in bases.items():
            g = runs[k].equations
            one = NormalEquations(basis.T @ g.ss @ basis, basis.T @ g.se, g.ee, 0.0, g.used)
            total = one if total is None else total + one
        return posterior(total).log_evidence

    def gain(ss, se, columns, root):
        return _gains((root.T @ ss[np.ix_(columns, columns)] @ root)[None], (se[columns] @ root)[None])[0]

    first, second = np.array([1, 2, 3]), np.array([0, 1])
    roots = 0.7 * prior_root(1, 3, 0.5), 0.4 * prior_root(1, 2, 0.5)
    alone = gain(*Joint(runs, known, []).rest(1), first, roots[0])
    assert alone == pytest.approx(joint([(1, first, roots[0])]) - joint([]), rel=1e-9)
    kept = BriefSignal(alone, 1, "N", 1, 4, first, roots[0])
    for run in (0, 1):  # beside the first, in the other run and in its own
        more = gain(*Joint(runs, known, [kept]).rest(run), second, roots[1])
        both = joint([(1, first, roots[0]), (run, second, roots[1])])
        assert more == pytest.approx(both - joint([(1, first, roots[0])]), rel=1e-9)
