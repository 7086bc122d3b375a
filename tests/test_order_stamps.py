"""Orders that change between two stamps of a log."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Plain

import numpy as np
import pytest

import bayesid
from bayesid.api.simulate import simulate_model
from bayesid.diagnosis.input.order_stamps import (
    acts_before_its_stamp,
    better,
    between_stamps,
    same_readings,
    step_of,
)
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
def test_an_order_read_earlier_is_its_mean_while_a_row_holds(delay):
    """Against quadrature of the order as it is held, on stamps that are not even."""
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.1, 0.3, 40))
    order = np.repeat(rng.normal(size=8), 5)
    found = apply(Correction(late={"delta_r_cmd": delay}), run_of(t, order)).commands["delta_r_cmd"]
    for k in range(3, 36):
        s = np.linspace(t[k], t[k + 1], 20_001)[:-1] + delay
        assert found[k] == pytest.approx(order[np.searchsorted(t, s, side="right") - 1].mean(), abs=1e-3)


def test_an_order_read_whole_steps_earlier_keeps_its_numbers():
    t, order = 0.2 * np.arange(30), np.repeat([0.1, -0.2, 0.3], 10)
    found = apply(Correction(late={"delta_r_cmd": 0.4}), run_of(t, order)).commands["delta_r_cmd"]
    assert np.array_equal(found, np.append(order[2:], [0.3, 0.3]))


def test_orders_between_stamps_switch_halfway_and_the_trial_says_how_to_keep_it():
    """A switch logged at 2 s acts from 1.9 s on: half of the row before."""
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    trial = Trial("a", Path("."), "remus100", 3, (run_of(t, order),), {})
    assert step_of(trial) == pytest.approx(0.2)
    earlier, text = between_stamps(trial, step_of(trial))
    found = earlier.runs[0].commands["delta_r_cmd"]
    assert found[9] == pytest.approx(0.0, abs=1e-9)
    assert np.array_equal(np.delete(found, 9), np.delete(order, 9))  # to the bit: no other row is a switch
    assert same_readings(trial, earlier)
    assert "late = { delta_r_cmd = 0.1 }" in text


def explained(*rows, none=0.0):
    """A comparison of refits of (effects, log evidence, delay, its sd)."""

    def refit(effects, evidence, delay, sd):
        free = Plain(names=(DELAY,) if "actuator_dead_time" in effects else ())
        size = len(free.names)
        return Plain(
            effects=effects, log_evidence=evidence,
            fit=Plain(free=free, values=np.full(size, delay), sd=np.full(size, sd)),
        )  # fmt: skip

    refits = tuple(refit(*row) for row in rows)
    candidates = Plain(none=Plain(log_evidence=none), refits=refits)
    return Plain(candidates=candidates, model=Plain(effects=EFFECTS))


@pytest.mark.parametrize(
    ("effects", "evidence", "delay", "sd", "told"),
    [
        (("actuator_dead_time",), 300.0, -0.12, 0.01, True),
        (("wind", "actuator_dead_time"), 300.0, -0.12, 0.01, True),
        (("actuator_dead_time",), 300.0, 0.12, 0.01, False),  # later, as a servo does
        (("actuator_dead_time",), 300.0, -0.12, 0.1, False),  # not clearly
        (("actuator_dead_time",), 10.0, -0.12, 0.01, False),  # no better than none
        (("wind",), 300.0, 0.0, 0.0, False),
    ],
)
def test_an_order_that_acts_before_it_is_logged_is_asked_about(effects, evidence, delay, sd, told):
    assert acts_before_its_stamp(explained((effects, evidence, delay, sd))) == told


def test_orders_are_read_earlier_only_where_that_explains_more():
    one = explained((("wind",), 300.0, 0.0, 0.0))
    assert better(one, explained(none=400.0))
    assert not better(one, explained((("wind",), 310.0, 0.0, 0.0), none=290.0))


def logged_every(step, dt, seed=3):
    """An AUV whose orders change every `step`, logged every `dt`: (trial, its model)."""
    model = build_model(load_vehicle("remus100"), 3)
    noise = {"x": 0.05, "y": 0.05, "psi": 0.003, "r": 0.002, "u": 0.004, "v": 0.004}
    runs = ("zigzag:13/13", "zigzag:10/10,rpm=1200", "turn:12", "prbs:12", "zigzag:12/12,rpm=1700")
    trial = simulate_model(model, "remus100", runs, step, None, None, noise, seed)
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
    assert np.isnan(found["delta_r_cmd"][:4]).all() and found["delta_r_cmd"][7] == pytest.approx(0.3)
    assert found["azimuth_port_cmd"][3] == 3.1  # not halfway round by way of nought
    assert found["azimuth_port_cmd"][7] == pytest.approx(-3.05)
