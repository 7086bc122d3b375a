"""The next manoeuvre: what the search may order, and that what it finds beats what it could have had."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bayesid.analysis.design import (
    PlanningCase,
    SearchEffort,
    choose,
    knowledge,
    library_within,
    limits,
    next_manoeuvre,
    usual_logging,
)
from bayesid.analysis.design.freeform import frame
from bayesid.analysis.design.goals import InformationGoal, predict, shrink
from bayesid.analysis.design.information import RunInformation
from bayesid.analysis.design.run_selection import best_sets, rank
from bayesid.equations.model import build_model
from bayesid.errors import FitError, ManoeuvreError
from bayesid.manoeuvres import read_table, write_table
from bayesid.model.vehicles import load_vehicle

MODEL = build_model(load_vehicle("generic_sub"), 3)
KNOWN = knowledge(MODEL, [n for n in MODEL.coefficients if n not in ("X_udot", "Y_vdot", "N_rdot")])
CASE = PlanningCase(MODEL, KNOWN, usual_logging(MODEL), limits(MODEL, duration=400.0))
SMALL = SearchEffort(search=2, judge=4, evaluations=120, random=4)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 1.0), st.floats(0.001, 0.1))
def test_orders_keep_to_angle_rate_and_shaft_speed(seed: int, rudder: float, rate: float) -> None:
    bounds = replace(CASE.bounds, rudder=0.6 * rudder, rate=rate)
    shape = frame(bounds, 19.0)
    orders = shape.orders(np.random.default_rng(seed).uniform(-1, 1, shape.size))
    fin = orders.commands["delta_r_cmd"]
    assert np.max(np.abs(fin)) <= bounds.rudder * (1 + 1e-12)
    assert np.max(np.abs(np.diff(fin))) <= rate * bounds.dt * (1 + 1e-9)
    assert orders.commands["n_cmd"].min() >= bounds.rpm[0] and orders.commands["n_cmd"].max() <= bounds.rpm[1]
    assert fin[0] == 0.0 and orders.commands["n_cmd"][0] == bounds.usual
    assert orders.t[-1] == pytest.approx(bounds.duration, abs=bounds.dt)


def test_orders_are_read_back_where_the_rate_allows() -> None:
    shape = frame(replace(CASE.bounds, rate=1.0), 19.0)
    x = np.random.default_rng(0).uniform(-1, 1, shape.size)
    orders = shape.orders(x)
    # the order at a knot is that of the last grid point before it
    assert shape.read(orders.t, orders.commands) == pytest.approx(x, abs=0.1)


def test_a_submerged_vehicle_without_planes_is_not_given_orders_of_planes() -> None:
    auv = load_vehicle("remus100")
    bare = replace(auv, coef={k: v for k, v in auv.coef.items() if not k.endswith("ds")})
    whole, without = build_model(auv, 6), build_model(bare, 6)
    assert limits(whole).plane > 0.0 and limits(without).plane == 0.0
    assert "vzigzag" in library_within(whole, limits(whole))
    assert "vzigzag" not in library_within(without, limits(without))
    assert not frame(limits(without), 1.0).planes
    with pytest.raises(ManoeuvreError, match=r"plane of 0\.1 is beyond what it can do, 0 "):
        limits(without, plane=0.1)


def test_library_within_limits_lasts_as_long_as_asked() -> None:
    found = library_within(MODEL, CASE.bounds)
    assert len(found) >= 14
    for name, manoeuvre in found.items():
        assert manoeuvre.duration == pytest.approx(400.0, abs=0.02 * 400), name


@pytest.fixture(scope="module")
def infos() -> dict:
    draws = CASE.draws(np.random.default_rng(1), 3)
    found = library_within(MODEL, CASE.bounds)
    return {n: CASE.of(found[n], draws, n) for n in ("zigzag_10", "turn", "chirp", "pullout", "random")}


def test_choice_of_three_is_the_best_of_all_sets(infos: dict) -> None:
    now = np.zeros_like(infos["turn"].matrices)
    goal = InformationGoal()
    choice = choose(infos, goal, now, 3)
    every = [goal.value(sum(infos[n].matrices for n in s)) for s in combinations_with_replacement(infos, 3)]
    assert choice.values[-1] == pytest.approx(max(every))
    assert list(choice.values) == sorted(choice.values)
    assert choice.names[0] == rank({n: infos[n] for n in choice.names}, goal, now)[0][0]


def test_shrinking_needs_another_run_than_the_one_executed(infos: dict) -> None:
    now = infos["turn"]
    best = rank(infos, shrink(now), now.matrices)[0][0]
    repeated, other = (1 - shrink(now).shown(now.matrices + infos[n].matrices) for n in ("turn", best))
    assert best != "turn" and other > 2 * repeated > 0


def test_worst_reading_is_never_predicted_better_than_the_mean(infos: dict) -> None:
    draws = CASE.draws(np.random.default_rng(1), 3)
    turn = library_within(MODEL, CASE.bounds)["turn"]
    mean, worst = (predict(MODEL, KNOWN, draws, turn, CASE.logging, w) for w in (False, True))
    for info in infos.values():
        assert worst.shown(info.matrices) > mean.shown(info.matrices)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["shrink", "predict", "gain"])
def test_design_beats_library_and_random_orders_on_vehicles_it_never_saw(kind: str) -> None:
    wanted = library_within(MODEL, CASE.bounds)["zigzag_10"]
    plan = next_manoeuvre(CASE, kind, np.random.default_rng(2), wanted=wanted, effort=SMALL, count=2)
    assert plan.best.kind == "designed"
    assert plan.designed.value > max(c.value for c in plan.randoms)


@pytest.mark.thorough
def test_same_seed_same_design() -> None:
    effort = replace(SMALL, evaluations=60)
    one, two = (next_manoeuvre(CASE, "gain", np.random.default_rng(2), effort=effort, count=1) for _ in "ab")
    assert one.designed == two.designed


@pytest.mark.thorough
def test_design_stays_within_its_room() -> None:
    narrow = replace(CASE, bounds=replace(CASE.bounds, box=600.0))
    plan = next_manoeuvre(narrow, "gain", np.random.default_rng(3), effort=SMALL, count=1)
    track = plan.execution.track
    assert max(np.ptp(track["x"]), np.ptp(track["y"])) <= 600.0
    assert "straight" in plan.refused and "area" in plan.refused["straight"]


def test_table_of_a_design_executes_the_same_run(tmp_path: Path) -> None:
    shape = frame(CASE.bounds, 19.0)
    orders = shape.orders(np.random.default_rng(6).uniform(-1, 1, shape.size))
    back = read_table(write_table(orders, tmp_path / "next.csv"))
    one, two = (CASE.execution(m).track.states[-1] for m in (orders, back))
    assert one == pytest.approx(two, rel=1e-6)


def test_held_orders_change_only_at_the_steps_of_the_autopilot() -> None:
    bounds = limits(MODEL, duration=400.0, hold=10.0)
    shape = frame(bounds, 19.0)
    x = np.random.default_rng(6).uniform(-1, 1, shape.size)
    held, free = shape.orders(x), frame(CASE.bounds, 19.0).orders(x)
    for name, values in held.commands.items():
        changed = held.t[1:][np.diff(values) != 0]
        assert changed.size > 3
        assert np.allclose(changed, 10.0 * np.round(changed / 10.0), atol=1e-9)
        assert np.ptp(values) > 0.5 * np.ptp(free.commands[name])
    with pytest.raises(ManoeuvreError, match="fewer than ten"):
        limits(MODEL, duration=400.0, hold=60.0)


def test_goals_without_what_they_need_are_refused() -> None:
    with pytest.raises(FitError, match="needs a wanted manoeuvre"):
        next_manoeuvre(CASE, "predict", np.random.default_rng(0))
    with pytest.raises(FitError, match="needs causes"):
        next_manoeuvre(CASE, "tell", np.random.default_rng(0))
    with pytest.raises(FitError, match="is unknown"):
        next_manoeuvre(CASE, "win", np.random.default_rng(0))


def test_pitch_and_depth_bind_a_diving_vehicle() -> None:
    deep = build_model(load_vehicle("generic_sub"), 6)
    bounds = limits(deep, duration=300.0, depth=20.0, pitch=math.radians(5.0))
    case = PlanningCase(deep, knowledge(deep), usual_logging(deep), bounds)
    shape = frame(bounds, deep.scales["L"] / deep.scales["U"])
    x = np.zeros(shape.size)
    n = len(shape.knots)
    x[n : 2 * n] = 1.0
    execution = case.execution(shape.orders(x))
    assert set(bounds.violations(execution.track)) == {"depth", "pitch"}


def test_the_best_pair_is_the_best_of_all_pairs_and_keeps_the_time() -> None:
    rng = np.random.default_rng(1)
    k, names = 3, "abcde"

    def info(name: str) -> RunInformation:
        a = rng.standard_normal((4, 2, k))
        return RunInformation(name, 60.0 * (1 + names.index(name)), np.einsum("dni,dnj->dij", a, a))

    candidates = {n: info(n) for n in names}
    now = np.zeros((4, k, k))
    single, pair, triple = best_sets(candidates, now)

    def mean_gain(chosen) -> float:
        total = np.eye(k) + sum(candidates[n].matrices for n in chosen)
        return float(np.mean(0.5 * np.linalg.slogdet(total)[1]))

    every = [(a, b) for i, a in enumerate(names) for b in names[i:]]
    assert pair.adds[1] == pytest.approx(max(map(mean_gain, every)))
    assert set(pair.names) == set(max(every, key=mean_gain))
    assert single.adds[1] < pair.adds[1] < triple.adds[1]
    assert triple.left < pair.left < single.left
    short = best_sets(candidates, now, most=180.0)
    assert [len(s.names) for s in short] == [1, 2, 3]
    assert all(s.seconds <= 180.0 for s in short)
    assert short[2].names == ("a", "a", "a")
    assert best_sets(candidates, now, most=30.0) == ()
