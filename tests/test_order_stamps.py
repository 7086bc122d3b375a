"""Orders that change between two stamps of a log."""

from dataclasses import replace
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
from bayesid.trials.correction import Correction, apply

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
    whole, text = between_stamps(trial, step_of(trial), 0.9)  # more is no matter of stamps
    assert "late = { delta_r_cmd = 0.2 }" in text and whole.runs[0].t.size == 30


def explained(*rows, none=0.0, named=()):
    """A comparison of refits of (effects, log evidence, delay, its sd), of which some are named."""

    def refit(effects, evidence, delay, sd):
        free = Plain(names=(DELAY,) if "actuator_dead_time" in effects else ())
        size = len(free.names)
        return Plain(
            effects=effects, log_evidence=evidence,
            fit=Plain(free=free, values=np.full(size, delay), sd=np.full(size, sd)),
        )  # fmt: skip

    refits = tuple(refit(*row) for row in rows)
    candidates = Plain(none=Plain(log_evidence=none), refits=refits)
    return Plain(candidates=candidates, model=Plain(effects=EFFECTS), verdict=Plain(effects=named))


@pytest.mark.parametrize(
    ("effects", "evidence", "delay", "sd", "told"),
    [
        (("actuator_dead_time",), 300.0, -0.12, 0.01, 0.12),
        (("wind", "actuator_dead_time"), 300.0, -0.12, 0.01, 0.12),
        (("actuator_dead_time",), 300.0, 0.12, 0.01, 0.0),  # later, as a servo does
        (("actuator_dead_time",), 300.0, -0.12, 0.1, 0.0),  # not clearly
        (("actuator_dead_time",), 10.0, -0.12, 0.01, 0.0),  # no better than none
        (("wind",), 300.0, 0.0, 0.0, 0.0),
    ],
)
def test_an_order_that_acts_before_it_is_logged_is_asked_about(
    monkeypatch, effects, evidence, delay, sd, told
):
    monkeypatch.setattr(order_stamps, "_beside_the_best", lambda found: 0.0)
    assert acts_before_its_stamp(explained((effects, evidence, delay, sd))) == pytest.approx(told)
    better_one = (("wind", "actuator_dead_time"), 400.0, -0.2, 0.01)
    assert acts_before_its_stamp(explained((effects, evidence, delay, sd), better_one)) == pytest.approx(0.2)


def test_orders_are_read_earlier_only_where_that_explains_more():
    one = explained((("wind",), 300.0, 0.0, 0.0))
    assert better(one, explained(none=400.0))
    assert not better(one, explained((("wind",), 310.0, 0.0, 0.0), none=290.0))
    # or about as much by fewer effects
    two = explained((("wind", "actuator_lag"), 300.0, 0.0, 0.0), named=("wind", "actuator_lag"))
    assert better(two, explained((("wind",), 290.0, 0.0, 0.0), named=("wind",)))
    assert not better(two, explained((("wind",), 270.0, 0.0, 0.0), named=("wind",)))


@pytest.mark.thorough
def test_a_lag_is_found_to_be_orders_between_stamps_and_a_true_lag_is_not():
    """Orders of an autopilot that change every 0.2 s and are logged every 0.8 s; in the control a servo lags
    and orders change at the stamps."""
    for step, tau in ((0.2, 0.0), (0.8, 0.5)):
        trial, model = logged_every(step, 0.8, change={"actuator_lag.tau": tau} if tau else None)
        found = diagnose_trial(trial, model, plan_next=False)
        early = order_stamps._beside_the_best(found)
        assert (0.1 < early < 0.6) if not tau else early == 0.0


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


@pytest.mark.thorough
def test_a_log_whose_orders_change_between_its_stamps_is_read_so_and_one_whose_do_not_is_not():
    """0.8 s between stamps of a vehicle of 1.33 m; in the control every order changes at a stamp."""
    for step, told in ((0.1, True), (0.8, False)):
        trial, _ = logged_every(step, 0.8)
        found = bayesid.diagnose(trial, "remus100", next_manoeuvre=False, keep_model=False)
        said = [text for text in found.found.result.warnings if "change between stamps" in text]
        assert bool(said) == told
        assert found.verdict in ("none", "model_form")


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
