"""Orders that change between two stamps of a log."""

from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from types import SimpleNamespace as Plain

import numpy as np
import pytest

import bayesid
from bayesid.api.simulate import simulate_model
from bayesid.diagnosis import of_log
from bayesid.diagnosis.input import as_read, order_stamps
from bayesid.diagnosis.input.order_stamps import (
    acts_before_its_stamp,
    better,
    between_stamps,
    same_readings,
    step_of,
)
from bayesid.diagnosis.of_log import diagnose_log
from bayesid.diagnosis.run import diagnose as diagnose_trial
from bayesid.equations.model import build_model
from bayesid.errors import TrialError
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_trial_run, simulate
from bayesid.simulation.actuation import mean_positions
from bayesid.trials import Run, Trial, load_trial, write_trial
from bayesid.trials.averaging import averaged
from bayesid.trials.correction import Correction, apply
from bayesid.trials.health import check_runs

EFFECTS = {e.name: e for e in CATALOGUE}
DELAY = "actuator_dead_time.delay"


def run_of(t, order):
    return Run("r1", "zigzag 10/10", "identify", t, {"psi": np.zeros(t.size)}, {"delta_r_cmd": order})


def switched(run, delay):
    """The same by other means: rows without readings where an order switches `delay` before its row."""
    t, order = run.t, run.commands["delta_r_cmd"]
    new = t[1:][np.diff(order) != 0.0] - delay
    rows = np.unique(np.concatenate([t, new[(new > t[0]) & (new < t[-1])]]))
    own = np.searchsorted(rows, t)
    data = {}
    for name, values in run.data.items():
        data[name] = np.full(rows.size, np.nan)
        data[name][own] = values
    at = np.clip(np.searchsorted(t, rows + delay + 1e-9, side="right") - 1, 0, t.size - 1)
    commands = {n: v[np.searchsorted(t, rows, side="right") - 1] for n, v in run.commands.items()}
    commands["delta_r_cmd"] = order[at]
    return replace(run, t=rows, data=data, commands=commands), own


@pytest.mark.parametrize("vehicle", ["remus100", "generic_sub"])
@pytest.mark.parametrize(
    ("even", "delay"),
    [
        *((False, delay) for delay in (0.0, 0.03, 0.1, -0.07)),
        *((True, delay) for delay in (0.03, 0.2, 0.33, 0.85, -0.07, -0.45)),
    ],
)
def test_an_order_that_acts_before_its_row_moves_the_vehicle_as_one_with_a_row_where_it_switches(
    vehicle, even, delay
):
    """Rows 0.2 apart and uneven ones [L/U], with a servo that runs at its rate and with one that does not."""
    rng = np.random.default_rng(0)
    model = build_model(load_vehicle(vehicle), 3)
    unit = model.scales["L"] / model.scales["U"]
    t = unit * (0.2 * np.arange(60) if even else np.cumsum(rng.uniform(0.1, 0.3, 60)))
    order = np.repeat(rng.uniform(-0.3, 0.3, 12), 5)
    run = replace(
        run_of(t, order), commands={"delta_r_cmd": order, "n_cmd": np.full(60, model.vehicle.rpm_ref)}
    )
    found = apply(Correction(late={"delta_r_cmd": unit * delay}), run)
    up = int(np.floor(delay / 0.2 + 1e-6)) if even else 0  # rows move by whole ones, the plan by the rest
    rows = np.clip(np.arange(60) + up, 0, 59)
    assert np.array_equal(found.t, t) and np.array_equal(found.commands["delta_r_cmd"], order[rows])
    rest = delay - 0.2 * up
    assert found.acts_before.get("delta_r_cmd", 0.0) == pytest.approx(unit * rest, abs=1e-9)
    other, own = switched(run, unit * delay)
    start = np.zeros(len(model.states))
    start[model.states.index("u")] = model.scales["U"]
    psi = model.states.index("psi")
    one, two = (
        simulate(model, model.nominal, plan_trial_run(model, r), start).states[:, psi] for r in (found, other)
    )
    turned = np.ptp(one)
    assert turned > 0.1 and np.abs(one - two[own]).max() < 4e-4 * turned
    as_logged = simulate(model, model.nominal, plan_trial_run(model, run), start).states[:, psi]
    assert (np.abs(as_logged - one).max() > 2e-3 * turned) == (delay != 0.0)


def test_whole_rows_earlier_are_orders_a_row_up():
    model = build_model(load_vehicle("remus100"), 3)
    t, order = 0.2 * np.arange(40), np.repeat([0.1, -0.2, 0.3, 0.0], 10)
    run = replace(run_of(t, order), commands={"delta_r_cmd": order, "n_cmd": np.full(40, 1500.0)})
    up = replace(run, commands=run.commands | {"delta_r_cmd": np.append(order[2:], order[-2:])})
    earlier = apply(Correction(late={"delta_r_cmd": 0.4}), run)
    one, two = (mean_positions(model, model.nominal, plan_trial_run(model, r)) for r in (earlier, up))
    rudder = model.kernel.actuators.index("delta_r")
    assert one[:, rudder] == pytest.approx(two[:, rudder], abs=2e-4)
    assert one[:, 1 - rudder] == pytest.approx(two[:, 1 - rudder], rel=1e-9)


def test_how_much_earlier_orders_act_adds_up_and_goes_with_name_and_clock():
    t = 0.2 * np.arange(12)
    run = replace(run_of(t, np.zeros(12)), commands={"delta_r_cmd": np.zeros(12), "n_cmd": np.ones(12)})
    once = apply(Correction(late={"delta_r_cmd": 0.1, "psi": 0.3}), run)
    assert once.acts_before == {"delta_r_cmd": 0.1} and once.digest != run.digest
    twice = apply(Correction(late={"delta_r_cmd": 0.05, "n_cmd": -0.1}, time_scale=2.0), once)
    assert twice.acts_before == {"delta_r_cmd": pytest.approx(0.3), "n_cmd": pytest.approx(0.2)}
    assert apply(Correction(late={"delta_r_cmd": -0.1}), once).acts_before == {}
    renamed = apply(Correction(rename={"delta_r_cmd": "delta_s_cmd"}), once)
    assert renamed.acts_before == {"delta_s_cmd": 0.1}
    assert apply(Correction(exchange=(("delta_r_cmd", "n_cmd"),)), once).acts_before == {"n_cmd": 0.1}
    assert apply(Correction(drop=("delta_r_cmd",)), once).acts_before == {}
    assert (
        apply(Correction(rename={"delta_r_cmd": "delta_r"}), once).acts_before == {}
    )  # what is measured is not late


@pytest.mark.parametrize("late", [1.0, 2.0, 2.07])
def test_an_order_logged_seconds_late_is_read_where_it_acts_by_checks_and_measures_too(late):
    """The sign of the rudder and the overshoots of a zig-zag are read off the rows."""
    model = build_model(load_vehicle("remus100"), 3)
    noise = {"x": 0.05, "y": 0.05, "psi": 0.003, "r": 0.002, "u": 0.004, "v": 0.004}
    orders = ("zigzag:13/13", "zigzag:10/10,rpm=1200")
    right = simulate_model(model, "remus100", orders, 0.2, None, None, noise, 3).runs
    rows = int(late / 0.2 + 1e-9)

    def behind(run):
        held = np.append(
            np.repeat(run.commands["delta_r_cmd"][:1], rows), run.commands["delta_r_cmd"][:-rows]
        )
        return replace(run, commands=run.commands | {"delta_r_cmd": held})

    logged = [behind(run) for run in right]
    assert bool(check_runs(logged)) == (late >= 2.0) and not check_runs(right)
    mended = [apply(Correction(late={"delta_r_cmd": late}), run) for run in logged]
    assert not check_runs(mended)
    for run, was in zip(mended, right, strict=True):
        np.testing.assert_array_equal(
            run.commands["delta_r_cmd"][:-rows], was.commands["delta_r_cmd"][:-rows]
        )


def test_when_an_order_is_first_known_moves_with_its_rows():
    t, order = 0.2 * np.arange(20), np.where(np.arange(20) < 10, 0.1, 0.2)
    run = replace(run_of(t, order), known_from={"delta_r_cmd": 1.4})
    assert apply(Correction(late={"delta_r_cmd": 0.07}), run).known_from == {"delta_r_cmd": 1.4}
    assert apply(Correction(late={"delta_r_cmd": 0.5}), run).known_from == {"delta_r_cmd": pytest.approx(1.0)}


def test_uneven_rows_of_an_order_logged_rows_late_move_to_where_it_acts():
    t = np.cumsum(np.random.default_rng(0).uniform(0.1, 0.3, 60))
    order = np.repeat(np.arange(12.0), 5)
    found = apply(Correction(late={"delta_r_cmd": 1.0}), run_of(t, order))
    at = np.searchsorted(t, t + 1.0 + 0.02, side="right") - 1
    assert np.array_equal(found.commands["delta_r_cmd"], order[at])
    assert found.acts_before == {"delta_r_cmd": pytest.approx(0.5 * np.median(np.diff(t)))}


@pytest.mark.parametrize("concerned", [(), ("r2",)])
def test_a_bundle_that_is_written_says_how_early_its_orders_act(tmp_path, concerned):
    t = 0.2 * np.arange(12)
    runs = tuple(replace(run_of(t, np.linspace(0.0, 0.2, 12)), name=name) for name in ("r1", "r2"))
    late = Correction(late={"delta_r_cmd": 0.07}, runs=concerned)
    runs = tuple(replace(run, data=run.data | {"x": t, "y": 0.0 * t}) for run in runs)
    trial = Trial("a", Path("."), "remus100", 3, tuple(apply(late, run) for run in runs), {"psi": 0.01})
    write_trial(trial, tmp_path, schema=False)
    back = load_trial(tmp_path)
    assert [r.acts_before for r in back.runs] == [r.acts_before for r in trial.runs]
    assert {bool(r.acts_before) for r in back.runs} == ({True} if not concerned else {False, True})
    other = apply(Correction(late={"delta_r_cmd": 0.1}), runs[0])
    with pytest.raises(TrialError, match="other times in other runs"):
        write_trial(replace(trial, runs=(other, trial.runs[1])), tmp_path / "two")


def test_averages_hold_an_order_at_its_means_from_when_it_acts():
    """One that changes all the time; one that rests switches in its own row, as much earlier as before."""
    rng = np.random.default_rng(1)
    t, order = 0.1 * np.arange(400), np.cumsum(0.01 * rng.normal(size=400))
    held = np.where(t < 17.3, 900.0, 1200.0)
    run = replace(
        run_of(t, order), data={"psi": np.cumsum(0.01 * rng.normal(size=400))},
        commands={"delta_r_cmd": order, "n_cmd": held},
    )  # fmt: skip
    earlier = apply(Correction(late={"delta_r_cmd": 0.07, "n_cmd": 0.07}), run)
    trial = Trial("a", Path("."), "remus100", 3, (earlier,), {"psi": 0.01})
    (dense,) = averaged(trial, 4.0, 100).runs
    assert dense.n_samples < 200 and dense.acts_before == {"n_cmd": 0.07}
    fine = np.linspace(0.0, 40.0, 400001)[:-1]
    acting = order[np.clip(np.floor((fine + 0.07) / 0.1 + 1e-9).astype(int), 0, 399)]
    for k in range(3, dense.n_samples - 3):
        between = (fine >= dense.t[k]) & (fine < dense.t[k + 1])
        assert dense.commands["delta_r_cmd"][k] == pytest.approx(acting[between].mean(), abs=2e-5)


def test_orders_between_stamps_act_earlier_and_the_trial_says_how_to_keep_it():
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    trial = Trial("a", Path("."), "remus100", 3, (run_of(t, order),), {})
    assert step_of(trial) == pytest.approx(0.2)
    earlier, text = between_stamps(trial, step_of(trial), 0.07)
    assert earlier.runs[0].acts_before == {"delta_r_cmd": 0.07} and np.array_equal(earlier.runs[0].t, t)
    assert same_readings(trial, earlier)
    assert "late = { delta_r_cmd = 0.07 }" in text
    _, text = between_stamps(trial, step_of(trial), np.nan)  # a size of a fit that did not arrive
    assert "late = { delta_r_cmd = 0.1 }" in text
    whole, text = between_stamps(trial, step_of(trial), 0.9)  # more is no matter of stamps
    assert "late = { delta_r_cmd = 0.2 }" in text and whole.runs[0].acts_before == {}
    assert np.array_equal(whole.runs[0].commands["delta_r_cmd"], np.append(order[1:], order[-1]))


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


@pytest.mark.thorough
@pytest.mark.parametrize("step", [0.1, 0.8])
def test_nothing_planted_is_no_cause_however_orders_are_logged(step):
    assert diagnosed(step).verdict in ("none", "model_form")


@pytest.mark.parametrize("steps", [(0.1, 1.0), (0.2, 0.2, 0.25)])
def test_runs_logged_at_different_rates_have_no_half_step(steps):
    runs = tuple(
        replace(run_of(dt * np.arange(30), np.zeros(30)), name=f"r{k}") for k, dt in enumerate(steps)
    )
    assert step_of(Trial("a", Path("."), "remus100", 3, runs, {})) is None


def test_a_log_that_says_when_orders_act_has_no_step():
    t, order = 0.2 * np.arange(30), np.where(np.arange(30) < 10, 0.1, -0.1)
    run = run_of(t, order)
    for late, told in (({"psi": 0.05}, True), ({"delta_r_cmd": 0.05}, False), ({"delta_r_cmd": 0.2}, False)):
        trial = Trial("a", Path("."), "remus100", 3, (apply(Correction(late=late), run),), {})
        assert (step_of(trial) is not None) == told


@pytest.mark.parametrize("interval", [None, 0.8])
@pytest.mark.parametrize("gains", [True, False])
def test_orders_that_act_early_are_read_so_once_more_and_kept_where_that_explains_more(
    monkeypatch, gains, interval
):
    """As logged, averaged or thinned: rows and readings are the same ones."""
    trial, model = logged_every(0.02, 0.02)
    asked = []

    def diagnose(of, model, seed):
        asked.append(of)
        return Plain(of=of, seed=seed)

    monkeypatch.setattr(of_log, "diagnose", diagnose)
    monkeypatch.setattr(of_log, "as_read", partial(as_read, resample=interval))
    monkeypatch.setattr(of_log, "acts_before_its_stamp", lambda found: 0.015)
    monkeypatch.setattr(of_log, "better", lambda one, other: gains)
    found, checked = diagnose_log(trial, model, seed=4)
    first, second = asked
    assert all(
        run.provenance[-1].startswith("averaged" if interval is None else "resampled") for run in first.runs
    )
    assert found.of is (second if gains else first) and found.seed == 4 and not checked.findings
    for one, other in zip(first.runs, second.runs, strict=True):
        restless = set(other.commands) - set(other.acts_before)  # at means from when they act
        assert one.acts_before == {} and all(s == 0.015 for s in other.acts_before.values())
        assert "n_cmd" not in restless and (interval is None or not restless)
        assert np.array_equal(one.t, other.t)
        assert np.array_equal(one.data["psi"], other.data["psi"], equal_nan=True)
        same = np.array_equal(one.commands["delta_r_cmd"], other.commands["delta_r_cmd"])
        assert same == ("delta_r_cmd" not in restless)
    assert any("read 0.015 s earlier" in text for text in second.warnings)
    assert set(first.warnings) < set(second.warnings)
