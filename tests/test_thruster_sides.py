"""Thrusters of the two sides exchanged: told where nothing else steers, from the turns alone."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.diagnosis.input import check_trial
from bayesid.diagnosis.input.steering import RUDDER, steering, with_rudder
from bayesid.equations.model import build_model
from bayesid.manoeuvres import OpenLoop
from bayesid.model.vehicles import builtin_names, load_vehicle
from bayesid.model.vehicles.check import check_vehicle
from bayesid.simulation.virtual_trial import virtual_trial

BOAT = "differential_boat"
NOISE = {"x": 0.03, "y": 0.03, "psi": 0.01, "r": 0.005}


def ordered(name, difference):
    """Revolutions about a mean, to port and to starboard for some seconds each."""
    t = np.arange(0.0, 80.0, 0.2)
    vehicle = load_vehicle(BOAT)
    mean, part = 0.6 * vehicle.rpm_ref, difference * vehicle.rpm_ref
    way = np.where((t % 20.0) < 10.0, part, -part) * (t > 5.0)
    return OpenLoop(name, t, {"n_port_cmd": mean + way, "n_stbd_cmd": mean - way})


@pytest.fixture(scope="module")
def logged():
    model = build_model(load_vehicle(BOAT), 3)
    runs = {name: ordered(name, part) for name, part in (("a", 0.2), ("b", 0.1), ("c", -0.15))}
    return virtual_trial(
        model, model.nominal, runs, title="boat", vehicle_ref=BOAT, noise=NOISE, rng=np.random.default_rng(0)
    ), model


def exchanged(trial):
    def other(run):
        c = run.commands
        return replace(run, commands={"n_port_cmd": c["n_stbd_cmd"], "n_stbd_cmd": c["n_port_cmd"]})

    return replace(trial, runs=tuple(other(run) for run in trial.runs))


def test_thrusters_as_they_stand_are_said_to_be_in_order(logged):
    found = check_trial(*logged)
    assert found.findings == () and "sides of thrusters" in " ".join(found.in_order)


def test_exchanged_columns_and_an_exchanged_vehicle_file_are_told_with_the_mend(logged):
    trial, model = logged
    (found,) = check_trial(exchanged(trial), model).findings
    assert found.name == "port and starboard thrusters exchanged" and "vehicle file" in found.says
    assert found.correction.exchange[-1] == ("n_port_cmd", "n_stbd_cmd")
    assert found.probability > 0.8  # a log mirrored in all its channels looks the same


def test_revolutions_that_all_count_the_other_way_are_not_called_exchanged(logged):
    """Both turn the vehicle the wrong way; only one drives it astern."""
    trial, model = logged
    astern = tuple(replace(r, commands={n: -v for n, v in r.commands.items()}) for r in trial.runs)
    (found,) = check_trial(replace(trial, runs=astern), model).findings
    assert found.name == "sign of n_port, n_stbd" and found.probability > 0.8
    assert found.correction.scale["n_port_cmd"] == -1.0


def test_thrusters_steer_only_where_nothing_else_does():
    for name in builtin_names():
        columns = steering(build_model(load_vehicle(name), 3))
        assert (columns[0].startswith("n_")) == (name in (BOAT, "six_thruster_rov"))
        assert columns == RUDDER or len(columns) % 2 == 0


def test_more_thrust_to_starboard_is_a_rudder_to_port(logged):
    trial, model = logged
    run = trial.runs[0]
    rudder = with_rudder(model, run, steering(model)).commands["delta_r_cmd"]
    difference = run.commands["n_stbd_cmd"] - run.commands["n_port_cmd"]
    assert np.array_equal(np.sign(rudder), np.sign(difference)) and np.abs(rudder).max() < 0.5


def test_two_thrusters_at_one_place_are_a_copy():
    boat = load_vehicle(BOAT)
    assert not [f for f in check_vehicle(boat) if "same place" in f.text]
    port, stbd = boat.thrusters
    copied = replace(boat, thrusters=tuple(replace(one, at=port.at) for one in boat.thrusters))
    (found,) = [f for f in check_vehicle(copied) if "same place" in f.text]
    assert f"thrusters {port.name} and {stbd.name}" in found.text and found.level == "warning"


def test_a_cube_that_drives_the_yaw_is_unphysical():
    vehicle = load_vehicle("remus100")
    cubed = [replace(vehicle, coef={**vehicle.coef, "N_rrr": c}) for c in (1e-3, -1e-3)]
    told = [[f.text for f in check_vehicle(one) if "N_rrr" in f.rows] for one in cubed]
    assert len(told[0]) == 1 and "should be negative" in told[0][0] and told[1] == []
