"""A measured wind acts on the ship whose log has it, and every command says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.api.check import check
from bayesid.api.inputs import model_of, vehicle_of
from bayesid.diagnosis.size_names import said_of
from bayesid.equations.model import build_model
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.vehicles import check_vehicle, load_vehicle
from bayesid.report.fit_effects import effect_words
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run, Trial
from bayesid.trials.measured_wind import apart_from_measured_wind, in_measured_wind, wind_words

SHIP = "esso_osaka_mmg"
NOISE = {"x": 0.02, "y": 0.02, "psi": 0.005, "u": 0.01, "v": 0.01, "r": 0.002}


def windy(gain=1.0, seed=None, vehicle=SHIP):
    """A run of the ship in a gusty wind that is measured; it felt `gain` times that wind."""
    ship = build_model(load_vehicle(SHIP))
    t = np.arange(0.0, 120.0, 0.5)
    commands = {
        "delta_r_cmd": 0.3 * np.sign(np.sin(t / 15.0)),
        "n_cmd": np.full(t.size, ship.vehicle.rpm_ref),
    }
    wind = {"wind_speed": 2.0 + 0.5 * np.sin(t / 7.0), "wind_from": np.full(t.size, 1.0)}
    plan = plan_run(ship, t, commands, exogenous=wind)
    track = simulate(ship, ship.with_values({"wind.gain": gain}), plan, steady_start(ship), full=True)
    rng = np.random.default_rng(seed)
    data = {
        name: track.states[:, ship.states.index(name)]
        + (0.0 if seed is None else NOISE[name] * rng.standard_normal(t.size))
        for name in NOISE
    }
    run = Run("zz", "zigzag", "identify", t, data, commands, exogenous=wind)
    return Trial("windy", Path("."), vehicle, 3, (run,), noise=NOISE)


def calm(trial):
    return replace(trial, runs=tuple(replace(run, exogenous={}) for run in trial.runs))


def test_the_simulator_of_a_windy_log_has_its_wind():
    trial = windy()
    run, model = trial.runs[0], model_of(trial)
    plan = plan_run(model, run.t, run.commands, exogenous=run.exogenous)
    states = simulate(model, model.nominal, plan, steady_start(model), full=True).states
    for name, logged in run.data.items():
        assert states[:, model.states.index(name)] == pytest.approx(logged, abs=1e-9)
    still = simulate(model, model.without_effects, plan, steady_start(model), full=True).states
    assert np.abs(still[:, model.states.index("psi")] - run.data["psi"]).max() > np.radians(5.0)


def test_nothing_blows_where_no_wind_is_measured_or_the_file_says_otherwise():
    trial, ship = windy(), load_vehicle(SHIP)
    assert in_measured_wind(ship, calm(trial)) is ship
    assert wind_words(ship, calm(trial)) is None
    sheltered = replace(ship, effects={"wind.gain": 0.0})
    assert in_measured_wind(sheltered, trial) is sheltered
    assert "not simulated" in wind_words(sheltered, trial)
    submarine = load_vehicle("generic_sub")
    assert in_measured_wind(submarine, trial) is submarine
    assert "not simulated" in wind_words(submarine, trial)
    for named in (None, SHIP, ship):
        blown = vehicle_of(named, trial)
        assert blown.effects == {"wind.gain": 1.0} and "as measured" in wind_words(blown, trial)
        assert apart_from_measured_wind(blown).digest == ship.digest
    assert "not simulated" in wind_words(ship, trial)
    assert vehicle_of(ship, calm(trial)) == ship


def test_a_wind_that_is_no_cause_to_be_named_blows_all_the_same():
    """`--exclude wind` takes it off the list: with any other effect on, or none, the same wind acts."""
    trial = windy()
    run, model = trial.runs[0], model_of(trial, exclude="wind")
    assert "wind" not in model.effects
    plan = plan_run(model, run.t, run.commands, exogenous=run.exogenous)
    faint = model.with_values({"rudder_offset.offset": 1e-9})
    heading = [
        simulate(model, par, plan, steady_start(model)).states[:, model.states.index("psi")]
        for par in (model.nominal, faint)
    ]
    assert heading[0] == pytest.approx(run.data["psi"], abs=1e-9)
    assert heading[1] == pytest.approx(heading[0], abs=1e-6)


@pytest.mark.thorough
def test_a_check_says_that_the_wind_acts():
    assert "acts on the vehicle, as measured" in check(windy(seed=1)).wind
    assert check(calm(windy(seed=1))).wind is None


@pytest.mark.thorough
def test_a_fit_tells_how_much_of_the_measured_wind_is_felt():
    """An anemometer above the hull: .8 of its speed is felt; without that the gain of 1 stands."""
    found = fit_trial(windy(0.8, seed=2), vehicle_of(SHIP, windy()), free=["N_dr"], effects=["wind.gain"])
    i = found.fit.names.index("wind.gain")
    assert found.fit.z[i] == pytest.approx(0.8, abs=3 * found.fit.sd[i])
    assert found.fit.sd[i] < 0.05
    (said,) = effect_words(found)
    assert said.startswith("wind has other sizes than the vehicle file states (gain 0.")
    right = fit_trial(windy(seed=3), vehicle_of(SHIP, windy()), free=["N_dr"], effects=["wind.gain"])
    assert right.gains["wind"] < 4.0
    assert "wind is as the vehicle file states (gain 1" in effect_words(right)[0]


def boat_with(**areas):
    return replace(load_vehicle("differential_boat"), dimensions=areas)


def test_measured_wind_acts_on_any_vehicle_whose_file_states_its_areas():
    """A boat with `air_front` was told that it states no areas; then that nothing reads them."""
    trial, boat = windy(), load_vehicle("differential_boat")
    stated = in_measured_wind(boat_with(air_front=0.07, air_side=0.15), trial)
    assert stated.effects == {"wind.gain": 1.0} and "as measured" in wind_words(stated, trial)
    assert "area_coefficients = 1" in wind_words(boat, trial) and "states no areas" in wind_words(boat, trial)
    assert in_measured_wind(boat, trial) is boat
    diving = replace(load_vehicle("generic_sub"), dimensions={"air_front": 0.07, "air_side": 0.15})
    assert in_measured_wind(diving, trial) is diving and "below the surface" in wind_words(diving, trial)
    assert "as measured" in wind_words(replace(diving, effects={"wind.gain": 1.0}), trial)


def test_the_wind_of_a_boat_that_states_areas_is_that_of_a_ship():
    """Force abeam by the table of ships on the boat's own areas: Y = rho/2 A C_D V^2 with C_D = 0.70."""
    boat = build_model(boat_with(air_side=0.15, air_front=0.07, air_centroid=0.1))
    t, still = np.array([0.0, 0.01]), 0.0 * steady_start(boat)
    plan = plan_run(boat, t, {f"n_{side}_cmd": np.zeros(2) for side in ("port", "stbd")})
    blown = boat.with_values({"wind.blowing_east": -4.0})
    rates = simulate(boat, blown, plan, still, full=True).states[-1] / 0.01
    index, par = boat.index, boat.nominal
    sway, turn = (rates[boat.states.index(s)] for s in "vr")
    m, x_G = par[index["m"]], par[index["x_G"]]
    force = (m - par[index["Y_vdot"]]) * sway + (m * x_G - par[index["Y_rdot"]]) * turn
    moment = (par[index["Izz"]] - par[index["N_rdot"]]) * turn + (m * x_G - par[index["N_vdot"]]) * sway
    expected = -0.5 * 1.2 * 0.15 * par[index["L"]] ** 2 * 0.70 * 16.0
    assert force == pytest.approx(expected, rel=5e-3)
    assert moment == pytest.approx(0.1 * par[index["L"]] * expected, rel=5e-3)


def test_an_area_that_is_not_stated_beside_one_that_is_is_said_to_be_assumed():
    (note,) = (f for f in check_vehicle(boat_with(air_front=0.07)) if "air_" in f.text)
    assert note.level == "note" and "air_side = 0.058" in note.text
    (note,) = (f for f in check_vehicle(boat_with(air_centroid=0.1)) if "air_" in f.text)
    assert "acts only beside air_front and air_side" in note.text
    for other in (boat_with(air_front=0.07, air_side=0.1), boat_with(), load_vehicle(SHIP)):
        assert not any("air_" in f.text for f in check_vehicle(other))


def test_a_measured_wind_that_acts_on_assumed_areas_is_said_to_act():
    boat = replace(load_vehicle("differential_boat"), effects={"wind.area_coefficients": 1.5})
    words = wind_words(boat, windy())
    assert "acts on 1.5 times the areas assumed" in words and "not simulated" not in words


def test_where_a_wind_was_measured_its_sentence_tells_on_which_areas_it_acts():
    """It told a wind of 0.07 m/s from somewhere where the measured wind explained all."""
    boat = build_model(load_vehicle("differential_boat"))
    wind = boat.effects["wind"]
    assert "times the areas assumed" in said_of(wind, boat, ["blowing_north", "area_coefficients"])
    assert said_of(wind, boat, ["blowing_north", "front"]) == wind.says
    ship = build_model(load_vehicle(SHIP))
    assert said_of(ship.effects["wind"], ship, ["blowing_north"]) == ship.effects["wind"].says
    assert "not the measured one" in said_of(ship.effects["wind"], ship, ["gain"])


def test_an_effect_with_a_slope_does_nothing_at_the_mean_of_its_prior():
    """A screen takes residuals about these means: with the measured wind at area 1 every hypothesis had that
    wind, no effect too, 59000 nats off."""
    boat = build_model(load_vehicle("differential_boat"))
    t = np.arange(0.0, 20.0, 0.5)
    wind = {"wind_speed": np.full(t.size, 3.0), "wind_from": np.full(t.size, 1.0)}
    orders = {"n_port_cmd": np.full(t.size, 800.0), "n_stbd_cmd": np.full(t.size, 600.0)}
    plan, start = plan_run(boat, t, orders, exogenous=wind), steady_start(boat)
    plain = simulate(boat, boat.nominal, plan, start, full=True).states
    smooth = [e for e in boat.effects.values() if e.smooth and not e.as_form]
    assert "wind" in {e.name for e in smooth}
    for effect in smooth:
        par = boat.nominal.copy()
        par[[boat.index[effect.key(p.name)] for p in effect.parameters]] = [p.mean for p in effect.parameters]
        states = simulate(boat, par, plan, start, full=True).states
        assert states[:, :6] == pytest.approx(plain[:, :6], abs=1e-9), effect.name


def test_a_fit_in_no_measured_wind_does_not_speak_of_one():
    """`fit --with wind` of a log without an anemometer said that the measured wind is not what acts."""
    found = fit_trial(calm(windy(0.0, seed=4)), load_vehicle(SHIP), free=["N_dr"], effects=["wind"])
    (said,) = (w for w in effect_words(found) if "wind" in w)
    assert "measured" not in said


def test_areas_that_nothing_reads_or_that_are_nought_are_said():
    none = boat_with(air_front=0.07, air_side=0.0)
    (note,) = (f for f in check_vehicle(none) if "air_" in f.text)
    assert note.level == "warning" and "one is 0" in note.text
    beside = replace(boat_with(air_front=0.07, air_side=0.1), effects={"wind.area_coefficients": 1.0})
    (note,) = (f for f in check_vehicle(beside) if "area_coefficients" in f.text)
    assert note.level == "warning" and "gain = 1" in note.text


def test_no_wind_is_weighed_far_below_the_surface_whatever_areas_are_stated():
    for vehicle in (load_vehicle(SHIP), boat_with(air_front=0.07, air_side=0.1), load_vehicle("generic_sub")):
        assert build_model(vehicle).effects["wind"].at_surface
