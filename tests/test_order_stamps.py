"""Orders that change between two stamps of a log."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace as Plain

import numpy as np
import pytest

import bayesid
from bayesid.api.simulate import simulate_model
from bayesid.diagnosis.input import order_stamps
from bayesid.diagnosis.input.order_stamps import (
    acts_before_its_stamp,
    better,
    between_stamps,
    same_readings,
    step_of,
)
from bayesid.diagnosis.run import diagnose as diagnose_trial
from bayesid.equations.model import build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial
from bayesid.trials.condensing import condensed
from bayesid.trials.correction import Correction, apply
from bayesid.trials.health import check_run
from bayesid.trials.held_orders import at_readings, ordered_earlier

EFFECTS = {e.name: e for e in CATALOGUE}
DELAY = "actuator_dead_time.delay"


def run_of(t, order):
    return Run("r1", "zigzag 10/10", "identify", t, {"psi": np.zeros(t.size)}, {"delta_r_cmd": order})


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.2, 0.33, -0.07])
@pytest.mark.parametrize("scale", [1.0, 1.02])
def test_an_order_read_earlier_is_held_as_before_and_readings_stay_where_they_were(delay, scale):
    """As a function of time, on stamps that are not even; the clock of the log may run at another rate."""
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.1, 0.3, 40))
    order, n = np.repeat(rng.normal(size=8), 5), np.repeat(rng.normal(size=4), 10)
    run = run_of(t, order)
    run = replace(
        run, data={"psi": rng.normal(size=40)}, commands=run.commands | {"n_cmd": n},
        exogenous={"wind_speed": rng.normal(size=40)},
    )  # fmt: skip
    found = apply(Correction(late={"delta_r_cmd": delay}, time_scale=scale), run)
    own = np.flatnonzero(np.isfinite(found.data["psi"]))
    clock = t[0] + scale * (t - t[0])
    assert found.t[own] == pytest.approx(clock) and np.array_equal(found.data["psi"][own], run.data["psi"])
    assert np.array_equal(found.exogenous["wind_speed"][own], run.exogenous["wind_speed"])
    assert np.isfinite(found.exogenous["wind_speed"]).all()
    asked = np.linspace(clock[0], clock[-1] - 1e-3, 5001)
    asked = asked[np.abs(asked[:, None] - np.append(found.t, clock)).min(axis=1) > 1e-4]  # beside a switch
    for name, values, late in (("delta_r_cmd", order, scale * delay), ("n_cmd", n, 0.0)):
        there = found.commands[name][np.searchsorted(found.t, asked, side="right") - 1]
        at = np.clip(np.searchsorted(clock, asked + late, side="right") - 1, 0, 39)
        assert np.array_equal(there, values[at])
    # a row more for each switch between two rows, and for nothing else
    assert found.t.size - 40 <= 7 and (found.t.size == 40) == (delay == 0.0)


def test_an_order_read_whole_steps_earlier_keeps_its_numbers():
    t, order = 0.2 * np.arange(30), np.repeat([0.1, -0.2, 0.3], 10)
    found = apply(Correction(late={"delta_r_cmd": 0.4}), run_of(t, order))
    assert np.array_equal(found.commands["delta_r_cmd"], np.append(order[2:], [0.3, 0.3]))
    assert np.array_equal(found.t, t)


def test_orders_between_stamps_switch_when_they_act_and_the_trial_says_how_to_keep_it():
    """A switch logged at 2 s acts from 1.93 s on."""
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    trial = Trial("a", Path("."), "remus100", 3, (run_of(t, order),), {})
    assert step_of(trial) == pytest.approx(0.2)
    earlier, text = between_stamps(trial, step_of(trial), 0.07)
    found = earlier.runs[0]
    assert found.t[10] == pytest.approx(1.93) and np.array_equal(np.delete(found.t, 10), t)
    assert np.array_equal(found.commands["delta_r_cmd"], np.where(found.t < 1.92, 0.1, -0.1))
    assert same_readings(trial, earlier)
    assert "late = { delta_r_cmd = 0.07 }" in text
    _, text = between_stamps(trial, step_of(trial), np.nan)  # a size of a fit that did not arrive
    assert "late = { delta_r_cmd = 0.1 }" in text
    whole, text = between_stamps(trial, step_of(trial), 0.9)  # more is no matter of stamps
    assert "late = { delta_r_cmd = 0.2 }" in text and whole.runs[0].t.size == 30


def with_best(*effects, evidence=0.0, named=(), word="effect", none=0.0):
    """A diagnosis whose best explanation is these effects."""
    best = Plain(effects=effects, log_evidence=evidence)
    candidates = Plain(none=Plain(effects=(), log_evidence=none), refits=(best,), best=best)
    return Plain(candidates=candidates, verdict=Plain(effects=named, word=word))


def beside(monkeypatch, delay, sd, gain, arrives=True):
    """Fits beside the best explanation: of base evidence 100, and with a delay; gives what was asked for."""
    asked = []

    def fitted(found, effects):
        names = tuple(e.name for e in effects)
        asked.append(names)
        late = "actuator_dead_time" in names
        free = Plain(names=("N_v", DELAY) if late else ("N_v",))
        return Plain(
            free=free, values=np.array([1.0, delay]), sd=np.array([0.1, sd]),
            log_evidence=100.0 + (gain if late else 0.0), converged=arrives,
        )  # fmt: skip

    monkeypatch.setattr(order_stamps, "_fitted", fitted)
    return asked


@pytest.mark.parametrize("best", [("wind",), ("wind", "actuator_lag"), ("wind", "actuator_dead_time")])
@pytest.mark.parametrize(
    ("delay", "sd", "gain", "told"),
    [
        (-0.12, 0.01, 60.0, 0.12),
        (0.12, 0.01, 60.0, 0.0),  # later, as a servo does
        (-0.12, 0.1, 60.0, 0.0),  # not clearly
        (-0.12, 0.01, 10.0, 0.0),  # gains no more than refits scatter
    ],
)
def test_an_order_that_acts_before_it_is_logged_is_found_beside_the_best(
    monkeypatch, best, delay, sd, gain, told
):
    monkeypatch.setattr(order_stamps, "simplest", lambda candidates: candidates.best)
    monkeypatch.setattr(order_stamps, "_in_refits", lambda found: 0.0)
    found = with_best(*best)
    effects = {n: EFFECTS[n] for n in ("wind", "actuator_lag", "actuator_dead_time")}
    found = Plain(**vars(found), model=Plain(effects=effects))
    asked = beside(monkeypatch, delay, sd, gain)
    assert acts_before_its_stamp(found) == pytest.approx(told)
    assert asked == [("wind",), ("wind", "actuator_dead_time")]  # no lag, and one dead time
    beside(monkeypatch, delay, sd, gain, arrives=False)
    assert acts_before_its_stamp(found) == 0.0


def test_orders_are_read_earlier_only_where_that_explains_more_or_as_much_by_less():
    one = with_best("wind", evidence=300.0)
    assert better(one, with_best(none=400.0, evidence=-np.inf))
    assert not better(one, with_best("wind", evidence=310.0))
    two = with_best("wind", "actuator_lag", evidence=300.0)
    assert better(two, with_best("wind", evidence=290.0))
    assert not better(two, with_best("wind", evidence=270.0))
    assert not better(two, with_best("wind", evidence=290.0, word="outside"))
    assert not better(one, with_best("thrust_loss", evidence=290.0))  # as many


@pytest.mark.parametrize(
    ("gain", "arrived", "told"), [(60.0, True, 0.12), (60.0, False, np.nan), (5.0, True, 0.0)]
)
def test_an_early_order_of_a_refit_counts_by_what_it_gains_whatever_its_range(
    monkeypatch, gain, arrived, told
):
    free = Plain(names=("N_v", DELAY))
    fit = Plain(free=free, values=np.array([1.0, -0.12]), sd=np.array([0.1, 0.01]), log_evidence=100.0 + gain)
    fit.converged = arrived
    refits = (Plain(effects=("actuator_dead_time",), log_evidence=-300.0, fit=fit),)
    candidates = Plain(none=Plain(fit=Plain(log_evidence=100.0)), refits=refits)
    monkeypatch.setattr(order_stamps, "_beside_the_best", lambda found: 0.0)
    found = acts_before_its_stamp(Plain(candidates=candidates, model=Plain(effects=EFFECTS)))
    assert found == pytest.approx(told, nan_ok=True)


@pytest.mark.thorough
def test_a_servo_that_lags_is_no_early_order():
    trial, model = logged_every(0.8, 0.8, change={"actuator_lag.tau": 0.5})
    found = diagnose_trial(trial, model, plan_next=False)
    assert found.verdict.effects == ("actuator_lag",) and acts_before_its_stamp(found) == 0.0


def logged_every(step, dt, seed=3, change=None):
    """An AUV whose orders change every `step`, logged every `dt`: (trial, its model)."""
    model = build_model(load_vehicle("remus100"), 3)
    noise = {"x": 0.05, "y": 0.05, "psi": 0.003, "r": 0.002, "u": 0.004, "v": 0.004}
    runs = ("zigzag:13/13", "zigzag:10/10,rpm=1200", "turn:12", "prbs:12", "zigzag:12/12,rpm=1700")
    trial = simulate_model(model, "remus100", runs, step, None, change, noise, seed)
    every = round(dt / step)

    def thinned(run):
        columns = {g: {n: v[::every] for n, v in getattr(run, g).items()} for g in Run.GROUPS}
        return replace(run, t=run.t[::every], **columns)

    return replace(trial, runs=tuple(thinned(run) for run in trial.runs)), model


@lru_cache
def diagnosed(step):
    """Nothing planted, 0.8 s between stamps of a vehicle of 1.33 m."""
    trial, _ = logged_every(step, 0.8)
    return bayesid.diagnose(trial, "remus100", next_manoeuvre=False, keep_model=False)


@pytest.mark.thorough
@pytest.mark.parametrize(("step", "told"), [(0.1, True), (0.8, False)])
def test_a_log_whose_orders_change_between_its_stamps_is_read_so_and_one_whose_do_not_is_not(step, told):
    """In the control every order changes at a stamp."""
    said = [text for text in diagnosed(step).found.result.warnings if "change between stamps" in text]
    assert bool(said) == told


KNOWN_WRONG = (
    "orders that change eight times between stamps: a set of causes, none with orders at their means"
)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "step", [pytest.param(0.1, marks=pytest.mark.xfail(strict=True, reason=KNOWN_WRONG)), 0.8]
)
def test_nothing_planted_is_no_cause_however_orders_are_logged(step):
    assert diagnosed(step).verdict in ("none", "model_form")


@pytest.mark.parametrize("steps", [(0.1, 1.0), (0.2, 0.2, 0.25)])
def test_runs_logged_at_different_rates_have_no_half_step(steps):
    runs = tuple(
        replace(run_of(dt * np.arange(30), np.zeros(30)), name=f"r{k}") for k, dt in enumerate(steps)
    )
    assert step_of(Trial("a", Path("."), "remus100", 3, runs, {})) is None


def test_an_unknown_order_and_a_wrapped_direction_are_read_as_they_are_held():
    t = 0.2 * np.arange(12)
    late = Correction(late={"delta_r_cmd": 0.1, "azimuth_port_cmd": 0.1})
    order, way = np.repeat([np.nan, 0.2, 0.4], 4), np.repeat([3.1, -3.1, -3.0], 4)
    run = replace(run_of(t, order), commands={"delta_r_cmd": order, "azimuth_port_cmd": way})
    found = apply(late, run).commands
    known = np.isfinite(found["delta_r_cmd"])  # unknown until 0.7 s, 0.4 rad from 1.5 s on
    assert np.array_equal(found["delta_r_cmd"][known], [0.2] * 5 + [0.4] * 5) and known.size == 14
    assert not known[:4].any()
    assert set(found["azimuth_port_cmd"]) == {3.1, -3.1, -3.0}  # not halfway round by way of nought


def test_a_log_that_says_when_orders_act_has_no_step():
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    run = run_of(t, order)
    for late, told in (({"psi": 0.05}, True), ({"delta_r_cmd": 0.05}, False), ({"delta_r_cmd": 0.2}, False)):
        trial = Trial("a", Path("."), "remus100", 3, (apply(Correction(late=late), run),), {})
        assert (step_of(trial) is not None) == told


def test_rows_that_were_added_are_no_readings_for_checks_and_averages():
    """Orders at their means over a row again, and every reading as it was."""
    rng = np.random.default_rng(1)
    t, order = 0.2 * np.arange(40), 0.1 * rng.normal(size=40)
    run = replace(run_of(t, order), data={"psi": np.cumsum(0.01 * rng.normal(size=40))})
    moved = apply(Correction(late={"delta_r_cmd": 0.07}), run)
    assert moved.t.size > 70
    back = at_readings(moved)
    assert np.array_equal(back.t, t) and np.array_equal(back.data["psi"], run.data["psi"])
    mean = (0.13 * order[:-1] + 0.07 * order[1:]) / 0.2
    assert back.commands["delta_r_cmd"][:-1] == pytest.approx(mean)
    assert check_run(moved) == check_run(run) and at_readings(run) is run
    trial = Trial("a", Path("."), "remus100", 3, (moved,), {"psi": 0.01})
    model = load_vehicle("remus100")
    assert condensed(trial, model, 40) is trial  # as many readings as may be
    dense = condensed(replace(trial, noise={"psi": 0.01}), model, 20)
    assert all(np.isfinite(r.data["psi"]).any() and r.t.size <= 40 for r in dense.runs)


@pytest.mark.parametrize("begin", [0.0, 1.7e9])
def test_whole_rows_earlier_add_none_on_any_clock(begin):
    t, order = begin + 0.2 * np.arange(50), np.random.default_rng(2).normal(size=50)
    assert ordered_earlier(run_of(t, order), {"delta_r_cmd": 0.2}).t.size == 50
