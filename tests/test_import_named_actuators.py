"""Series are read as the actuators a vehicle has, and runs are named by what is seen of them."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from bayesid.trials.importing.named_actuators import Steering, named_guess, sides_across
from bayesid.trials.importing.proposing import lines_of_inputs
from bayesid.trials.importing.raw import RawChannel
from bayesid.trials.importing.seen_motion import motion_words
from bayesid.trials.trial import Run
from tests.test_trial_import import DEG, _table, motion

ACROSS = {"n_port": -0.17, "n_stbd": 0.17, "delta_1": -0.17, "delta_2": 0.17, "n_bow": 0.0}
TOGETHER = {"delta_r": {"delta_1": 1.0, "delta_2": 1.0}, "n": {"n_port": 1.0, "n_stbd": 1.0}}
FERRY = Steering(tuple(ACROSS), sides_across(ACROSS), frozenset({"delta_r", "delta_s", "n"}), TOGETHER)


@pytest.mark.parametrize(
    ("name", "unit", "role"),
    [
        ("Shaft PS [rpm]", "rpm", "n_port"), ("Shaft SB [rpm]", "rpm", "n_stbd"),
        ("Port shaft", None, "n_port"),
        ("RPM_stbd", None, "n_stbd"), ("Rudder angle PS [deg]", "deg", "delta_1"),
        ("rudder2 [deg]", "deg", "delta_2"),
        ("rudderStbd", None, "delta_2"), ("Bow thruster [rpm]", "rpm", "n_bow"), ("n_port", "rpm", "n_port"),
        ("Shaft [rpm]", "rpm", None), ("Rudder angle [deg]", "deg", None), ("Rudder 3 [deg]", "deg", None),
        ("Roll PS [deg]", "deg", None), ("Bow thruster [A]", "A", None), ("Heading [deg]", "deg", None),
    ],
)  # fmt: skip
def test_a_series_is_of_the_actuator_its_name_says(name, unit, role):
    found = named_guess(RawChannel(name, np.zeros(3), np.zeros(3), unit), FERRY)
    assert (found.role if found else None) == role


def test_a_number_has_a_side_where_it_alone_is_there():
    assert sides_across(ACROSS) == {"delta_1": "port", "delta_2": "stbd"}
    four = {f"delta_{k}": y for k, y in enumerate((-0.1, -0.2, 0.1, 0.0), 1)}
    assert sides_across(four) == {"delta_3": "stbd"}


def columns_of(truth) -> dict[str, np.ndarray]:
    order = truth["delta_r_cmd"] / DEG
    noise = np.random.default_rng(1).standard_normal((4, order.size))
    return {
        "t [s]": truth["t"], "X_basin [mm]": 1e3 * truth["x"], "Y_basin [mm]": 1e3 * truth["y"],
        "Heading [deg]": truth["psi"] / DEG, "Yaw rate [deg/s]": truth["r"] / DEG,
        "Rudder order [deg]": order, "Rudder angle PS [deg]": order + 0.1 * noise[0],
        "Rudder angle SB [deg]": order + 0.1 * noise[1], "Shaft PS [rpm]": truth["n_cmd"] + noise[2],
        "Shaft SB [rpm]": truth["n_cmd"] + noise[3],
    }  # fmt: skip


def test_the_actuators_of_the_vehicle_are_read_and_none_it_lacks(tmp_path):
    log = _table(tmp_path, truth := motion(np.random.default_rng(7)), columns_of(truth))
    found = propose([log], steering=FERRY)
    channels = {role: entry.source for role, entry in found.map.channels.items()}
    assert channels["delta_1"] == "Rudder angle PS [deg]" and channels["delta_2"] == "Rudder angle SB [deg]"
    assert channels["n_port"] == "Shaft PS [rpm]" and channels["n_stbd"] == "Shaft SB [rpm]"
    assert channels["delta_1_cmd"] == channels["delta_2_cmd"] == "Rudder order [deg]"
    assert not {"delta_r", "delta_r_cmd", "n", "n_cmd"} & set(channels)
    assert any("is read as the order of delta_1 and delta_2 alike" in text for text in found.remarks)
    (steers,) = [text for text in found.map.questions if "what steers" in text]
    assert "n_bow_cmd = ..." in steers and "n_port" not in steers and "delta_1" not in steers
    assert not any("[actuators.NAME]" in text for text in found.map.questions)
    bare = propose([log]).map.channels  # no vehicle is known: the rudder and the propeller of any
    assert {"delta_r", "delta_r_cmd", "n"} <= set(bare) and "delta_1" not in bare


def test_a_position_in_the_axes_of_a_basin_is_one(tmp_path):
    log = _table(tmp_path, truth := motion(np.random.default_rng(7)), columns_of(truth))
    channels = propose([log], steering=FERRY).map.channels
    assert channels["x"].source == "X_basin [mm]" and channels["y"].unit == "mm"
    other = {k.replace("basin", "accel"): v for k, v in columns_of(truth).items()}
    assert "x" not in propose([_table(tmp_path, truth, other)], steering=FERRY).map.channels


def look(seconds=80.0, **given) -> Run:
    """A run at 1.4 m/s and 600 rpm whose rudder does nothing, but for what is given."""
    t = np.arange(0.0, seconds, 0.2)
    rng = np.random.default_rng(3)
    made = {"u": 1.4, "psi": 0.0, "n_port": 600.0, "n_stbd": 600.0, "n_bow": 0.0}
    made |= {k: f(t / seconds) if callable(f) else f for k, f in given.items()}
    series = {k: np.broadcast_to(v, t.shape) + 0.002 * rng.standard_normal(t.size) for k, v in made.items()}
    data = {k: v for k, v in series.items() if k in ("u", "psi")}
    inputs = {k: v for k, v in series.items() if k not in data}
    return Run("look", "", "identify", t, data, {"delta_r_cmd": np.zeros(t.size)}, inputs)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "straight"),
        ({"psi": lambda s: 0.6 * s}, "straight"),  # a hull that is not straight
        ({"u": lambda s: 1.1 + 0.3 * s}, "straight"),  # speed regained after a turn
        ({"n_port": 600.0, "n_stbd": 560.0}, "straight"),
        ({"u": lambda s: 0.7 + 0.7 * s, "n_port": lambda s: np.where(s < 0.2, 300, 600),
          "n_stbd": lambda s: np.where(s < 0.2, 300, 600)}, "speed steps"),
        ({"u": lambda s: 1.4 - s, "n_port": lambda s: np.where(s < 0.2, 600, 0),
          "n_stbd": lambda s: np.where(s < 0.2, 600, 0)}, "coast"),
        ({"u": lambda s: 0.6 + 0.8 * s}, "acceleration"),
        ({"u": lambda s: 1.4 - 0.8 * s}, "slowing down"),
        ({"psi": lambda s: 0.6 * s, "n_bow": lambda s: 900.0 * np.sign(s - 0.5)}, "steered without rudder"),
        ({"psi": lambda s: 0.6 * s, "n_port": lambda s: 600 + 200 * s}, "steered without rudder"),
        ({"psi": lambda s: 2.0 * s}, "steered without rudder"),
    ],
)  # fmt: skip
def test_a_run_whose_rudder_rests_is_called_what_its_motion_is(given, words):
    assert motion_words(look(**given)) == words


@pytest.mark.parametrize(
    ("after", "words"), [(50.0, "turning circle 20 and pull-out"), (6.0, "turning circle 20")]
)
def test_a_turn_is_a_pull_out_where_the_rudder_is_amidships_for_long(tmp_path, after, words):
    t = np.arange(0.0, 80.0 + after, 0.2)
    order = np.where((t > 5.0) & (t < 80.0), 20.0, 0.0)
    rate = np.where((t > 8.0) & (t < 83.0), 7.0, 0.0)
    psi = np.cumsum(rate * 0.2) * DEG
    x, y = (np.cumsum(0.3 * f(psi)) for f in (np.cos, np.sin))
    columns = {
        "t [s]": t, "north [m]": x, "east [m]": y, "heading [deg]": psi / DEG, "rudder order [deg]": order,
        "rpm": np.full(t.size, 900.0),
    }  # fmt: skip
    logs = [_table(tmp_path, {"t": t}, columns, f"{k}.csv") for k in range(4)]  # each of them a run
    assert {run.manoeuvre for run in propose(logs).map.runs} == {words}


def test_a_throttle_is_proposed_for_revolutions_and_one_steering_for_both_azimuths():
    unused = ["throttle_port_pct", "throttle_stbd_pct", "steering_cmd_deg", "heading"]
    lines = lines_of_inputs(["n_port", "azimuth_port", "azimuth_stbd"], unused)
    assert lines[0].startswith('n_port_cmd = { from = "throttle_port_pct", scale = ..., unit = "rpm" }')
    assert lines[1:] == ['azimuth_port_cmd = "steering_cmd_deg"', 'azimuth_stbd_cmd = "steering_cmd_deg"']
    assert lines_of_inputs(["n_3"], ["Thruster 3 (rpm)", "Thruster 4 (rpm)"]) == [
        'n_3_cmd = "Thruster 3 (rpm)"'
    ]
    percent = lines_of_inputs(
        ["n_port", "bucket_1", "delta_1", "azimuth_bow"], ["throttle port [%]", "Steering"]
    )
    assert percent[0].startswith('n_port_cmd = { from = "throttle port [%]", scale = ..., unit = "rpm" }')
    assert percent[1:] == ["bucket_1_cmd = ...", "delta_1_cmd = ...", 'azimuth_bow_cmd = "Steering"']
    assert lines_of_inputs(["azimuth_bow"], ["wind angle", "roll angle"]) == ["azimuth_bow_cmd = ..."]
    assert lines_of_inputs(["azimuth_bow"], ["wind angle"]) == ["azimuth_bow_cmd = ..."]
