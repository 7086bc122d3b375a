"""Wind told by the motion of a ship: signs, closed forms, a planted wind, a calm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.api.simulate import simulate_model
from bayesid.equations.model import build_model
from bayesid.model.vehicles import CoefficientPrior, load_vehicle
from bayesid.progress import Progress
from bayesid.simulation import plan_trial_run
from bayesid.trials import Run, Trial
from studies.wind_from_motion import run as study
from studies.wind_from_motion.estimate import MotionWind, unread, wind_of
from studies.wind_from_motion.hours import shared_winds
from studies.wind_from_motion.report import NO_SHIP, scores, wind_report
from studies.wind_from_motion.run import clock, mean_wind, pushing_wind, row, winds

T = np.arange(0.0, 20.0, 1.0)


def calm_run():
    channels = {c: np.zeros(T.size) for c in ("x", "y", "psi", "u", "v", "r")}
    commands = {"delta_r_cmd": np.zeros(T.size), "n_cmd": np.full(T.size, 600.0)}
    return Run("r", "zigzag", "holdout", T, channels, commands)


def given(run, mean):
    """The run with a steady wind as an anemometer logs it; `mean` [m/s] is where the air goes."""
    come = np.full(run.t.size, np.arctan2(-mean[1], -mean[0]) % (2 * np.pi))
    return replace(run, exogenous={"wind_speed": np.full(run.t.size, np.hypot(*mean)), "wind_from": come})


def test_a_wind_given_blows_where_the_simulation_lets_it_blow():
    model = build_model(load_vehicle("esso_osaka_mmg"))
    plan = plan_trial_run(model, given(calm_run(), (-1.5, 0.5)))
    held = dict(zip(model.kernel.exogenous, plan.exogenous.T, strict=False))
    assert held["wind_north"][3] == pytest.approx(-1.5) and held["wind_east"][3] == pytest.approx(0.5)
    assert not unread(given(calm_run(), (1.0, 0.0))).exogenous


def test_direction_sd_is_that_of_the_component_across():
    wind = MotionWind("r", np.array([2.0, 0.0]), np.diag([9.0, 0.04]), "converged")
    assert wind.direction_sd == pytest.approx(0.1)
    assert wind.evidence == pytest.approx(4.0 / 9.0)
    none = MotionWind("r", np.array([1e-3, 0.0]), np.eye(2), "converged")
    assert none.direction_sd == pytest.approx(np.pi / np.sqrt(3.0))


def test_gusts_push_as_a_stronger_steady_wind_does():
    """A wind of 1 and 3 m/s by turns pushes as one of sqrt((1 + 9)/2); a steady wind is its own."""
    steady = given(calm_run(), (1.2, -0.5))
    for wind in (pushing_wind(steady), mean_wind(steady)):
        assert wind == pytest.approx((1.2, -0.5))
    speed = np.where(np.arange(T.size) % 2 == 0, 1.0, 3.0)
    gusty = replace(steady, exogenous={"wind_speed": speed, "wind_from": np.full(T.size, np.pi)})
    assert mean_wind(gusty) == pytest.approx((2.0, 0.0))
    assert pushing_wind(gusty) == pytest.approx((np.sqrt(5.0), 0.0))


def test_direction_errors_go_the_short_way_round():
    run = given(calm_run(), (-1.0, 0.05))
    told = row(run, MotionWind("r", np.array([-1.0, -0.05]), 0.01 * np.eye(2), "converged").record())
    assert np.degrees(told["direction_error"]) == pytest.approx(2 * np.degrees(np.arctan(0.05)), abs=1e-6)
    (only,) = [scores([told | {"measured": [-1.2, 0.06]}])]
    assert only["named"] == 100.0 and only["windy"] == 1


@pytest.mark.slow
@pytest.mark.parametrize("air", [(1.2, -0.9), (0.0, 0.0)])
def test_a_planted_wind_is_found_and_a_calm_is_not_named(air):
    ship = load_vehicle("esso_osaka_mmg")
    ship = replace(ship, prior=CoefficientPrior(dict.fromkeys(ship.coef, 0.05)))
    model = build_model(ship)
    par = model.nominal.copy()
    for name, value in zip(("wind.blowing_north", "wind.blowing_east"), air, strict=True):
        par[model.index[name]] = value
    windy = replace(model, nominal=par)
    logged = simulate_model(windy, ship, ("zigzag:20/20",), None, 600.0, None, None, 0).runs[0]
    rng = np.random.default_rng(1)
    noise = {"x": 0.005, "y": 0.005, "psi": 0.002, "u": 0.004, "v": 0.004, "r": 0.001}
    data = {c: v + noise[c] * rng.standard_normal(v.size) for c, v in logged.data.items() if c in noise}
    run = replace(logged, data=data)
    trial = Trial("planted", Path(), "esso_osaka_mmg", 3, (run,), noise=noise)
    wind = wind_of(trial, run, ship, ("N_v", "N_|u|r", "Y_|u|v"), 0)
    off = np.abs(wind.mean - air) / np.sqrt(np.diag(wind.covariance))
    assert off.max() < 3.0
    assert (wind.evidence > 9.21) == any(air)


def test_sds_too_small_name_no_wind_that_scaled_sds_do_not():
    """Errors of four sd beside a chi-square of 32: scaled by four it is 2, below the 1 % of 9.21."""
    run = given(calm_run(), (4.0, 0.0))
    covariance = np.diag([2.0, 2.0])
    far = row(run, MotionWind("r", np.array([8.0, 0.0]), covariance, "converged").record())
    told = scores([far | {"z": [4.0, -4.0]}])
    assert told["rms_z"] == pytest.approx(4.0)
    assert told["named"] == 100.0 and told["named_scaled"] == 0.0
    careful = scores([far | {"z": [0.1, -0.1]}])  # sds too large are not made smaller
    assert careful["named_scaled"] == 100.0


def test_a_kept_wind_serves_its_own_inputs_and_a_run_without_a_ship_is_marked(monkeypatch, tmp_path):
    """Another seed, and another ship, are found anew; without a fitted ship the published one is not used."""
    calls = []

    def counted(trial, run, ship, free, seed):
        calls.append((ship.name, seed))
        return MotionWind(run.name, np.array([2.0, 0.0]), np.eye(2), "converged")

    monkeypatch.setattr(study, "wind_of", counted)
    log, ship = given(calm_run(), (2.0, 0.1)), load_vehicle("esso_osaka_mmg")
    trial = Trial("pond", tmp_path, "", 3, (log,))

    def ask(ship, seed):
        return winds(trial, [log], lambda run: ship, ("Y_v",), seed, tmp_path, Progress(quiet=True), "x")["r"]

    assert ask(ship, 0) == ask(ship, 0) and len(calls) == 1
    ask(ship, 1)
    ask(replace(ship, coef=ship.coef | {"Y_r": 2 * ship.coef["Y_r"]}), 1)
    assert len(calls) == 3
    assert ask(None, 1) == {"failed": NO_SHIP}
    other, one = replace(log, name="turn_14-Oct_14_08_51"), replace(log, name="turn_14-Oct_14_02_51")
    found = {one.name: ask(ship, 1), other.name: ask(None, 1)}
    told = wind_report(
        study.wind_record([one, other], {"published ship": found})
        | {"inputs": {"quick": True}, "attribution": "none"}
    )
    assert "For 1 runs no ship could be fitted" in told.lead
    assert told.sections[2].blocks[0].rows[1][4] == NO_SHIP


def told_alone(seed, spread, scatter, own=0.5):
    """Winds of 6 days of 6 runs each, ten minutes apart, as they blow and as each run tells its own; `own` is
    the share of the scatter's variance that blows."""
    rng = np.random.default_rng(seed)
    middle = np.concatenate([day * 1e6 + 600.0 * np.arange(6) for day in range(6)])
    slow = np.repeat(rng.normal(0.0, spread, (6, 2)), 6, axis=0)
    true = slow + rng.normal(0.0, np.sqrt(own) * scatter, slow.shape)
    read = true + rng.normal(0.0, np.hypot(0.1, np.sqrt(1.0 - own) * scatter), true.shape)
    alone = [MotionWind(f"r{i}", m, 0.01 * np.eye(2), "converged") for i, m in enumerate(read)]
    return middle, true, alone


def off(winds, true):
    errors = np.array([w.mean for w in winds]) - true
    sds = np.array([np.sqrt(np.diag(w.covariance)) for w in winds])
    return np.sqrt(np.mean(errors**2)), np.sqrt(np.mean((errors / sds) ** 2))


@pytest.mark.parametrize(("own", "better", "widest"), [(0.0, 0.8, 1.6), (0.5, 0.9, 1.3)])
def test_runs_of_the_same_hours_tell_their_wind_better_and_how_wrong_each_is(own, better, widest):
    """Sds stated several times too small: read off how runs of one day differ, with no wind ever measured."""
    single, together, scatter = [], [], []
    for seed in range(6):
        middle, true, alone = told_alone(seed, 1.5, 0.5, own)
        shared = shared_winds(alone, middle)
        single.append(off(alone, true))
        together.append(off(list(shared.winds.values()), true))
        scatter.append(shared.scatter)
    single, together = np.mean(single, axis=0), np.mean(together, axis=0)
    assert single[1] > 3.0
    assert together[0] < better * single[0]
    assert 0.7 < together[1] < widest
    assert 0.3 < np.mean(scatter) < 0.6


def test_winds_days_apart_and_told_well_stay_as_they_are():
    _, _, alone = told_alone(0, 2.0, 0.0)
    far = shared_winds(alone, 1e7 * np.arange(len(alone)))
    for wind in alone:
        assert np.abs(far.winds[wind.run].mean - wind.mean).max() < 0.1
    # the frame the wind is told in does not matter
    turned = np.array([[0.6, -0.8], [0.8, 0.6]])
    again = shared_winds(
        [replace(w, mean=turned @ w.mean) for w in alone], 600.0 * np.arange(len(alone))
    ).winds
    same = shared_winds(alone, 600.0 * np.arange(len(alone))).winds
    for wind in alone:
        assert np.abs(again[wind.run].mean - turned @ same[wind.run].mean).max() < 1e-3


def test_the_clock_of_a_run_is_in_its_name_and_parts_of_a_record_follow_one_another():
    first = replace(calm_run(), name="random_06-Aug_16_24_25_1")
    assert clock(replace(first, name="turn_06-Aug_16_24_26")) - clock(first) == 1.0
    assert clock(replace(first, name="random_06-Aug_16_24_25_4")) - clock(first) == 3 * first.duration
