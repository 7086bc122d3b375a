"""Actuators that stick for long: found, held and told; nothing where they follow their orders."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from types import SimpleNamespace as Plain

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis import stuck_stage
from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.cut_runs import sought_in
from bayesid.diagnosis.data.event import Event, blanked, released
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.event_words import unexplained
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.joined_runs import Joined
from bayesid.diagnosis.run import diagnose
from bayesid.diagnosis.stuck_search import (
    Stuck,
    _beside,
    _best_times,
    _Ordered,
    _times_tried,
    stuck_actuators,
)
from bayesid.diagnosis.stuck_stage import _same, held_where_stuck
from bayesid.errors import ModelError
from bayesid.trials import Environment


@dataclass(frozen=True)
class Problem:
    events: tuple = ()
    outliers: tuple = ()


MODEL = model_of("remus100")
LENGTH = MODEL.scales["L"] / MODEL.scales["U"]
# Samples in which the rudder stays where it was.
STUCK = {"zigzag": (60, 115), "turn": (12, 70)}
# Gusts over 1/2 rho L^2 U^2.
GUSTS = 1e-4


def trial_of(stuck, seed=3, samples=160):
    """Two runs in gusts, in some of which the rudder stays where it was, logged as ordered."""
    rng = np.random.default_rng(seed)
    size = {"X": 0.5 * MODEL.scales["rho"] * (MODEL.scales["L"] * MODEL.scales["U"]) ** 2}
    size |= {"Y": size["X"], "N": size["X"] * MODEL.scales["L"]}

    def gusts(name, t):
        keep = np.exp(-np.diff(t, prepend=t[0]) / (4.0 * LENGTH))
        out = {}
        for axis, unit in size.items():
            white = np.sqrt(1.0 - keep**2) * rng.standard_normal(t.size)
            white[0] = rng.standard_normal()
            out[axis] = (
                GUSTS
                * unit
                * np.array(list(accumulate(zip(keep, white, strict=True), gust, initial=0.0)))[1:]
            )
        return out

    def executed(name, commands):
        kept = {c: v.copy() for c, v in commands.items()}
        if name in stuck:
            first, last = stuck[name]
            kept["delta_r_cmd"][first:last] = kept["delta_r_cmd"][first - 1]
        return kept

    trial = planted_trial(MODEL, other_vehicle(MODEL, seed), seed, gusts, samples, executed=executed)
    return replace(trial, environment=Environment(force_rms=GUSTS, nav_drift=0.0))


def gust(before, step):
    """Next value of a first-order Gauss-Markov process."""
    keep, white = step
    return keep * before + white


def left_by_none(trial):
    problem = build_problem(MODEL, trial)
    none = fit_with(problem, ())
    return problem, sought_in(problem, none.free, none.followed)


def test_a_rudder_that_sticks_in_both_runs_is_found_in_both_although_coefficients_are_free():
    trial = trial_of(STUCK)
    found = stuck_actuators(left_by_none(trial)[1], trial)
    assert [(e.run, e.stuck, e.kind) for e in found.events] == [
        (n, "delta_r", "stuck") for n in sorted(STUCK)
    ]
    assert found.gain > 100.0 and found.chosen > 0.0
    for event in found.events:
        run = next(r for r in trial.runs if r.name == event.run)
        first, last = STUCK[event.run]
        order = run.commands["delta_r_cmd"]
        away = first + np.flatnonzero(np.abs(order[first:last] - order[first - 1]) > 1e-6)
        assert event.start == pytest.approx(run.t[away[0]], abs=2.0 * LENGTH)
        assert event.end == pytest.approx(run.t[away[-1] + 1], abs=2.0 * LENGTH)


@pytest.mark.parametrize("seed", [3, 4])
def test_a_rudder_that_follows_is_not_said_to_stick(seed):
    trial = trial_of({}, seed)
    assert stuck_actuators(left_by_none(trial)[1], trial).gain < 5.0


def test_orders_that_were_held_are_released_before_it_is_asked_anew():
    """Held elsewhere, along the same path, linear theory finds the same."""
    trial = trial_of(STUCK)
    sought = left_by_none(trial)[1]
    before = stuck_actuators(sought, trial)
    wrong = Event(
        "zigzag", 20.0 * LENGTH, 26.0 * LENGTH, "rudder", "stuck", None, value=0.05, stuck="delta_r"
    )
    held = build_problem(MODEL, trial, events=(wrong,))
    again = stuck_actuators(sought_in(held, sought.free, [p.point for p in sought.paths]), trial)
    assert again.gain == pytest.approx(before.gain, rel=0.2)
    assert [(e.run, e.stuck) for e in again.events] == [(e.run, e.stuck) for e in before.events]


def test_all_times_at_once_gain_what_each_does_alone():
    rng = np.random.default_rng(0)
    count, m = 7, 14
    columns, resid = rng.standard_normal((40, m)), rng.standard_normal(40)
    whole = Joined(columns.T @ columns, columns.T @ resid)
    stays = rng.standard_normal(count)
    first, last = (
        np.array(x)
        for x in zip(*[(f, k) for f in range(count) for k in range(f + 1, count + 1)], strict=True)
    )
    one = _Ordered(
        None, "a", np.zeros(0), np.zeros(0), np.arange(count), count + np.arange(count), stays, first, last
    )
    best = _best_times(whole, one)
    gains = []
    for f, k in zip(first, last, strict=True):
        moved = columns[:, f:k].sum(axis=1)
        sure = stays[f] * moved + columns[:, count + f : count + k].sum(axis=1)
        cov = np.eye(40) + np.outer(0.15 * moved, 0.15 * moved)
        left = resid - sure
        gains.append(
            0.5 * resid @ resid - 0.5 * left @ np.linalg.solve(cov, left) - 0.5 * np.linalg.slogdet(cov)[1]
        )
    assert best.most == pytest.approx(max(gains), rel=1e-9) and best.at == int(np.argmax(gains))
    assert best.average == pytest.approx(np.log(np.mean(np.exp(np.array(gains) - max(gains)))) + max(gains))
    f, k = first[best.at], last[best.at]
    moved = columns[:, f:k].sum(axis=1)
    sure = stays[f] * moved + columns[:, count + f : count + k].sum(axis=1)
    precision = moved @ moved + 0.15**-2
    assert best.value == pytest.approx(stays[f] + moved @ (resid - sure) / precision)
    assert best.sd == pytest.approx(precision**-0.5)
    # what is left of the other columns beside it is that of the dense model
    rest = _beside(whole, one, f, k)
    cov = np.eye(40) + np.outer(0.15 * moved, 0.15 * moved)
    assert rest.ss == pytest.approx(columns.T @ np.linalg.solve(cov, columns))
    assert rest.se == pytest.approx(columns.T @ np.linalg.solve(cov, resid - sure))


def test_times_are_tried_only_where_the_order_goes_away_and_never_from_the_start():
    class Cut:
        start, width, count = 0.0, 1.0, 6

    t = np.arange(0.0, 6.0, 0.5)
    order = np.where(t < 3.0, 0.0, 0.2)
    stays = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.2])
    first, last = _times_tried(Cut(), t, order, stays, 0.1)
    assert set(zip(first.tolist(), last.tolist(), strict=True)) == {
        (f, k) for f in (1, 2, 3) for k in range(4, 7) if k - f >= 2
    }
    assert _times_tried(Cut(), t, order, stays, 0.3)[0].size == 0


def test_what_sticks_keeps_its_readings_and_loses_its_order():
    trial = trial_of({})
    run = trial.runs[0]
    event = Event(run.name, run.t[10], run.t[20], "rudder", "stuck", None, value=0.1, stuck="delta_r")
    held = blanked(run, (event,))
    order, before = held.commands["delta_r_cmd"], run.commands["delta_r_cmd"]
    assert (
        (order[10:20] == 0.1).all()
        and (order[20:] == before[20:]).all()
        and (order[:10] == before[:10]).all()
    )
    assert all((held.data[c] == run.data[c]).all() for c in run.data)
    problem = build_problem(MODEL, trial)
    assert released(MODEL, problem.logs[0], (event,)) is problem.logs[0]
    assert event.unexplained


def passes(monkeypatch, searches, evidences, before=None, left=lambda found: 0.0, depends=lambda *rest: None):
    """The stage with stand-ins: what is suspected round by round, and the log evidence of each refit."""
    held, searches, evidences = [], iter(searches), iter(evidences)

    def candidates(evidence):
        return Plain(best=Plain(log_evidence=evidence, fit=Plain(free=None, followed=None)))

    def suspected(found, trial):
        one = next(searches)
        if isinstance(one, Exception):
            raise one
        return one

    def build(model, trial, notify, as_built, events, *rest):
        held.append(events)
        return Problem(events)

    class Fit:
        def __init__(self, problem):
            self.log_evidence = -abs(problem.events[-1].value)

        def released(self):
            return self

    monkeypatch.setattr(stuck_stage, "_suspected", suspected)
    monkeypatch.setattr(stuck_stage, "build_problem", build)
    monkeypatch.setattr(stuck_stage, "fit_with", lambda problem, effects: Fit(problem))
    monkeypatch.setattr(
        stuck_stage, "compared", lambda problem, *rest: Compared(problem, candidates(next(evidences)))
    )
    monkeypatch.setattr(stuck_stage, "in_its_environment", lambda found, *rest: found)
    monkeypatch.setattr(stuck_stage, "simplest", lambda candidates: candidates.best)
    monkeypatch.setattr(stuck_stage, "sought_in", lambda *rest: None)
    monkeypatch.setattr(stuck_stage, "force_left", left)
    monkeypatch.setattr(stuck_stage, "dependence_beside", depends)
    monkeypatch.setattr(stuck_stage, "over_motion", lambda found, sought: -7.0)
    monkeypatch.setattr(stuck_stage, "with_events", lambda candidates, events, depends: candidates)
    found = before or Compared(Problem(), candidates(0.0))
    if before is not None:
        found = replace(before, candidates=candidates(0.0))
    return held, held_where_stuck(found, MODEL, None, lambda text: None, None, 0)


def suspect(value, ordered=None, start=10.0, gain=50.0):
    start, end = start * LENGTH, (start + 20.0) * LENGTH
    event = Event("a", start, end, "rudder", "stuck", None, gain, value=value, sd=0.001, stuck="delta_r")
    return Stuck((event,), (replace(event, value=value if ordered is None else ordered),), gain, 5.0)


def fails(*rest):
    raise np.linalg.LinAlgError("not positive definite")


def values(found):
    return [(e.value, round(e.evidence, 6)) for e in found.problem.events]


def test_it_is_told_from_thirty_nats_beyond_what_was_tried(monkeypatch):
    told = passes(monkeypatch, [suspect(0.2), Stuck()], [35.0])[1]
    assert values(told) == [(0.2, 30.0)] and told.over_motion == -7.0  # asked of what is left beside it
    assert values(passes(monkeypatch, [suspect(0.2), Stuck()], [34.9])[1]) == []
    held, found = passes(monkeypatch, [suspect(0.2, gain=19.9)], [])
    assert held == [] and values(found) == []


def test_where_nothing_is_suspected_nothing_else_can_fail(monkeypatch):
    assert passes(monkeypatch, [Stuck()], [], left=fails)[1].unable is None


def test_beside_a_free_force_that_does_as_much_it_is_not_told_also_where_a_later_round_fails(monkeypatch):
    for last in (Stuck(), ModelError("no path")):
        found = passes(monkeypatch, [suspect(0.2), last], [100.0], left=lambda found: 1000.0)[1]
        assert values(found) == [] and "in a would explain 95 nats" in found.unable
    found = passes(monkeypatch, [suspect(0.2), ModelError("no path")], [100.0])[1]
    assert values(found) == [(0.2, 95.0)] and "no path" in found.unable


def test_a_question_that_fails_afterwards_costs_its_answer_only(monkeypatch):
    before = Compared(Problem(), None, unable="the verdict counts 3 readings")
    found = passes(monkeypatch, [suspect(0.2), Stuck()], [100.0], before, depends=fails)[1]
    assert values(found) == [(0.2, 95.0)] and found.dependence is None
    assert "3 readings" in found.unable and "not positive definite" in found.unable


def test_what_is_told_is_what_was_held_or_was_found_beside_it(monkeypatch):
    rounds = [suspect(0.3, 0.1), suspect(0.25, 0.05, 14.0), suspect(0.2, 0.0, 18.0)]
    held, found = passes(monkeypatch, rounds, [100.0, 200.0, 300.0])
    assert held[-1][0].value == 0.0 and values(found) == [(0.0, 295.0)]
    newer = passes(monkeypatch, [suspect(0.2), suspect(0.25, start=14.0)], [100.0, 90.0])[1]
    assert values(newer) == [(0.25, 95.0)]
    worse = passes(monkeypatch, [suspect(0.2), suspect(0.25, start=14.0)], [100.0, 40.0])[1]
    assert values(worse) == [(0.2, 95.0)]


def test_an_actuator_that_stuck_amidships_is_held_once(monkeypatch):
    held, found = passes(monkeypatch, [suspect(0.0005, 0.0), suspect(0.0005, 0.0)], [100.0])
    assert len(held) == 2 and len(found.problem.events) == 1


def test_held_for_another_length_or_elsewhere_is_not_the_same():
    one = Event("a", 10.0 * LENGTH, 30.0 * LENGTH, "rudder", "stuck", None, value=0.1, stuck="delta_r")
    brief = Event("b", 0.0, 1.0, "N", "motion", None, brief=True)
    near = replace(one, start=10.5 * LENGTH, value=0.105)
    assert _same((near,), (brief, one), MODEL) and not _same((near,), (brief,), MODEL)
    for other in (
        replace(one, end=32.0 * LENGTH),
        replace(one, value=0.12),
        replace(one, run="c"),
        replace(one, stuck="n"),
    ):
        assert not _same((other,), (one,), MODEL)


@pytest.mark.thorough
def test_a_diagnosis_tells_where_a_rudder_stuck_and_names_no_effect():
    trial = trial_of(STUCK)
    found = diagnose(trial, MODEL, plan_next=False)
    assert (found.verdict.word, found.verdict.effects) == ("outside", ())
    events = found.result.events
    assert {(e.run, e.stuck) for e in events} == {(n, "delta_r") for n in STUCK}
    for event in events:
        first = STUCK[event.run][0]
        order = next(r for r in trial.runs if r.name == event.run).commands["delta_r_cmd"]
        assert abs(event.value - order[first - 1]) < 3.0 * event.sd
    assert "as if the rudder stuck at" in unexplained(found.result)
    assert "as if the rudder stuck at" in answer(found.result).headline


@pytest.mark.thorough
def test_a_rudder_off_its_order_is_not_told_as_one_that_sticks():
    planted = other_vehicle(MODEL, 5) | {"rudder_offset.offset": 0.03}
    found = diagnose(planted_trial(MODEL, planted, 5, samples=160), MODEL, plan_next=False)
    assert all(e.kind != "stuck" for e in found.result.events)
