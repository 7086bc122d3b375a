"""A wind that changes over a run, and a measured one of which a ship takes the mean over a time."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from plain_kernel import uncompiled

import bayesid
from bayesid.equations.generate import module_source
from bayesid.equations.model import build_model
from bayesid.errors import VehicleError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.effects import CATALOGUE, catalogue_of
from bayesid.model.effects.wind_in_time import SHIP_VARYING, VARYING
from bayesid.model.vehicles import load_vehicle, write_vehicle
from bayesid.model.vehicles.new.scaling import scaled
from bayesid.model.vehicles.reading import BUILTIN_FOLDER
from bayesid.simulation import plan_run, simulate
from bayesid.trials import Run, Trial

SHIP = {"esso_osaka_mmg": SHIP_VARYING, "remus100": VARYING}


@lru_cache
def plain(name):
    model = build_model(load_vehicle(name), 3, SHIP[name])
    every = (*catalogue_of(name == "esso_osaka_mmg"), *SHIP[name])
    return uncompiled(model, module_source(model.kernel.spec, every))


def a_run(model, changes, wind=None, seconds=40.0):
    t = np.arange(0.0, seconds, 1.0)
    rpm = model.vehicle.rpm_ref
    measured = {} if wind is None else {"wind_speed": wind[0], "wind_from": wind[1]}
    plan = plan_run(model, t, {"n_cmd": np.full(t.size, rpm)}, exogenous=measured, max_step=0.25)
    x0 = np.array([0.0, 0.0, 0.5, model.scales["U"], 0.0, 0.0])
    return simulate(model, model.with_values(changes), plan, x0).states[:, :6]


@pytest.mark.parametrize("name", SHIP)
def test_a_wind_without_a_trend_is_the_steady_one_and_nothing_when_off(name):
    model = plain(name)
    steady = {"wind.blowing_north": 3.0, "wind.blowing_east": -2.0}
    same = {f"wind_varying.{k.partition('.')[2]}": v for k, v in steady.items()}
    still = a_run(model, {})
    assert np.abs(a_run(model, same) - a_run(model, steady)).max() < 1e-12
    assert np.abs(a_run(model, steady) - still).max() > 1e-3
    assert np.abs(a_run(model, dict.fromkeys(same, 0.0)) - still).max() == 0.0


@pytest.mark.parametrize("name", SHIP)
def test_a_wind_that_changes_pushes_as_the_same_wind_measured(name):
    """Closed form of the measured column: linear in north and east, the areas of the file or assumed ones."""
    model = plain(name)
    t = np.arange(0.0, 40.0, 1.0)
    north, east = 2.0 + 30.0 * t / 600, -1.0 - 45.0 * t / 600
    wind = np.hypot(north, east), np.arctan2(-east, -north)
    names = ("blowing_north", "blowing_east", "dnorth", "deast")
    told = {f"wind_varying.{n}": v for n, v in zip(names, (2.0, -1.0, 30.0, -45.0), strict=True)}
    gain = {"wind.gain": 1.0} if name == "esso_osaka_mmg" else {"wind.area_coefficients": 1.0}
    # the column is held over steps of 0.25 s
    assert np.abs(a_run(model, told) - a_run(model, gain, wind)).max() < 3e-3
    steady = {f"wind_varying.{n}": v for n, v in zip(names[:2], (2.0, -1.0), strict=True)}
    assert np.abs(a_run(model, steady) - a_run(model, told)).max() > 0.03


def test_a_wind_that_changes_is_no_part_of_the_catalogue():
    """Kernels and candidates of every vehicle stay as they are."""
    assert {e.name for e in (*VARYING, *SHIP_VARYING)} == {"wind_varying"}
    assert "wind_varying" not in {e.name for e in CATALOGUE}


def plan_of(vehicle, t, speed, come):
    model = build_model(vehicle, 3)
    plan = plan_run(model, t, {}, exogenous={"wind_speed": speed, "wind_from": come}, max_step=0.05)
    return plan.times + 0.5 * plan.steps, plan.exogenous[:, model.kernel.exogenous.index("wind_north")]


def test_the_mean_of_a_gust_rises_as_a_first_order_filter_and_of_a_ramp_lags_by_its_time():
    ship = load_vehicle("esso_osaka_mmg")
    slow = replace(ship, dimensions=ship.dimensions | {"wind_average": 4.0})
    t = np.arange(0.0, 60.0, 1.0)
    gust = np.where(t < 10.0, 0.0, 3.0)  # from the south, so that it blows north; up between 9 and 10 s
    south = np.full(t.size, np.pi)
    middle, north = plan_of(slow, t, gust, south)
    behind = 4.0 * 3.0
    at_10 = 3.0 - behind + behind * np.exp(-1 / 4.0)
    # between samples it is interpolated: within a hundredth of the gust
    for time in (12.0, 20.0, 40.0):
        expected = 3.0 + (at_10 - 3.0) * np.exp(-(time - 10.0) / 4.0)
        assert np.interp(time, middle, north) == pytest.approx(expected, abs=0.02)
    middle, north = plan_of(slow, t, 0.1 * t, south)
    assert np.interp(50.0, middle, north) == pytest.approx(0.1 * (50.0 - 4.0), abs=1e-3)
    # the control: without it every gust is taken, as the column has it
    middle, north = plan_of(ship, t, gust, south)
    assert np.interp(10.5, middle, north) == pytest.approx(3.0)
    assert np.array_equal(north, np.interp(middle, t, gust * np.cos(2 * np.pi)))


def test_a_time_of_the_mean_is_kept_by_the_file_and_zero_is_no_number(tmp_path):
    text = (BUILTIN_FOLDER / "esso_osaka_mmg.toml").read_text()
    path = tmp_path / "ship.toml"
    path.write_text(text.replace("[vehicle]\n", "[vehicle]\nwind_average = 2.5\n"))
    ship = load_vehicle(path)
    assert ship.dimensions["wind_average"] == 2.5
    assert load_vehicle(write_vehicle(ship, tmp_path / "again.toml")).digest == ship.digest
    twice = scaled(ship, length=2 * ship.L).vehicle  # by Froude, times go with the root of the length
    assert twice.dimensions["wind_average"] == pytest.approx(2.5 * np.sqrt(2.0))
    path.write_text(text.replace("[vehicle]\n", "[vehicle]\nwind_average = -1.0\n"))
    with pytest.raises(VehicleError, match="wind_average"):
        load_vehicle(path)


@pytest.mark.parametrize("key", ["depth_over_draught", "water_depth"])
def test_a_depth_of_the_water_is_refused_with_what_to_do(key, tmp_path):
    path = tmp_path / "ship.toml"
    text = (BUILTIN_FOLDER / "kvlcc2_mmg.toml").read_text()
    path.write_text(text.replace("[vehicle]\n", f"[vehicle]\n{key} = 1.5\n"))
    with pytest.raises(
        VehicleError, match=rf"{key} is not read: there is no factor for shallow water.*fit them"
    ):
        load_vehicle(path)


NOISE = {"x": 0.05, "y": 0.05, "psi": 0.005, "u": 0.01, "v": 0.01, "r": 0.002}
START = np.array([2.5, -1.5])  # m/s to north and east


def logged(change, gusts, seed, seconds=600.0):
    """Three zig-zags in a wind that no column tells, the last one held out.

    The wind acts as a measured one: linear over each run, and gusts of first order (15 s) of that sd [m/s].
    """
    model, rng = build_model(load_vehicle("esso_osaka_mmg"), 3), np.random.default_rng(seed)
    par, t = model.with_values({"wind.gain": 1.0}), np.arange(0.0, seconds + 0.5, 1.0)
    side = np.where((t // 20) % 2 == 0, 1.0, -1.0) * np.where((t // 120) % 2 == 0, 1.0, 0.5)
    orders = {"delta_r_cmd": np.radians(10.0) * side, "n_cmd": np.full(t.size, model.vehicle.rpm_ref)}
    runs = []
    for name, heading in (("a", 0.3), ("b", 2.0), ("c", 3.5)):
        air = START[:, None] + np.outer(np.full(2, change), t / 600)
        kept = np.exp(-1.0 / 15.0)
        gust = gusts * rng.standard_normal(2)
        for i in range(t.size):
            air[:, i] += gust
            gust = kept * gust + gusts * np.sqrt(1.0 - kept**2) * rng.standard_normal(2)
        wind = {"wind_speed": np.hypot(*air), "wind_from": np.unwrap(np.arctan2(-air[1], -air[0]))}
        x0 = np.zeros(len(model.states))
        x0[2:4] = heading, 0.9 * model.scales["U"]
        states = simulate(model, par, plan_run(model, t, orders, exogenous=wind), x0, full=True).states
        data = {c: states[:, i] + NOISE[c] * rng.standard_normal(t.size) for i, c in enumerate(NOISE)}
        runs.append(Run(name, name, "holdout" if name == "c" else "identify", t, data, dict(orders)))
    return Trial("gusts", Path("."), "esso_osaka_mmg", 3, tuple(runs), noise=NOISE)


@pytest.mark.slow
@pytest.mark.parametrize("change", [1.5, 0.0])
def test_a_change_of_the_wind_is_fitted_to_its_deviations_where_it_does_not_gust(change):
    names = ("blowing_north", "blowing_east", "dnorth", "deast")
    # runs of 600 s in this wind end in another minimum, told as not final, when begun from no wind
    free = [f"wind_varying.{n}" for n in names]
    trial = logged(change, 0.0, 2, 240.0)
    found = fit_trial(trial, free=(), effects=free, declared=SHIP_VARYING, parts=NoiseParts()).fit
    where = [found.names.index(n) for n in free]
    off = found.z[where] - np.array([*START, change, change])
    assert found.success
    # 4 sd of eight numbers: false alarm 5e-4
    assert np.all(np.abs(off) < 4 * found.sd[where]) and np.all(found.sd[where] < 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("change, seed", [(1.5, 21), (0.0, 21)])
def test_a_diagnosis_tells_a_wind_that_changes_from_one_that_gusts_alone(change, seed, tmp_path):
    """Gusts of 0.3 m/s: named are the change where there is one, and the steady wind where there is none."""
    (tmp_path / "more.py").write_text(
        "from bayesid.model.effects.wind_in_time import SHIP_VARYING as EFFECTS\n"
    )
    found = bayesid.diagnose(
        logged(change, 0.3, seed), effects=tmp_path / "more.py", next_manoeuvre=False, keep_model=False
    )
    assert (found.verdict, found.effects) == ("effect", ("wind_varying" if change else "wind",))
    if change:
        sizes = found.found.result.effects[0].parameters
        for value in (sizes["dnorth"], sizes["deast"]):
            assert abs(value.value - change) < 3 * value.sd < 1.0
