"""Logs of a vehicle with stern planes: read by name, else asked for, and asked which way they pitch it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.trials.importing import propose
from bayesid.trials.importing.names import guess_role
from bayesid.trials.importing.planes import _FIN, pitches
from bayesid.trials.importing.raw import RawChannel
from tests.test_trial_import import _table
from tests.test_x_stern import X, with_fins

BOW_DOWN = -1.0  # of remus100: M_ds < 0


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("pitch_fin_cmd", "delta_s"), ("Elevator", "delta_s"), ("stern plane", "delta_s"),
        ("sternplane_order", "delta_s"), ("horizontal fins", "delta_s"), ("Dive plane angle", "delta_s"),
        ("horizontal_rudder", "delta_s"), ("yaw fin", "delta_r"), ("vertical_fins_cmd", "delta_r"),
        ("vertical rudder", "delta_r"), ("rudder", "delta_r"), ("bow plane", "delta_b"), ("pitch", "theta"),
        ("fin 3", None),
    ],
)  # fmt: skip
def test_planes_and_rudders_are_told_by_the_way_they_turn_the_vehicle(name, role):
    found = guess_role(RawChannel(name, np.zeros(3), np.zeros(3), "deg"))
    assert (found.role if found else None) == role


@pytest.fixture(scope="module")
def dive():
    return bayesid.simulate("remus100", "vzigzag:10/8,duration=60", noise={}, seed=1).runs[0]


def log_of(tmp_path, run, head, sign=1.0):
    data = {k: np.degrees(v) if k in ("psi", "theta") else v for k, v in run.data.items()}
    heads = {
        "x": "north [m]",
        "y": "east [m]",
        "z": "depth [m]",
        "psi": "heading [deg]",
        "theta": "pitch [deg]",
    }
    columns = {"t [s]": run.t} | {head: data[k] for k, head in heads.items() if k in data}
    columns |= {"rudder order [deg]": 0.0 * run.t, "shaft order [rpm]": run.commands["n_cmd"]}
    columns |= {head: sign * np.degrees(run.commands["delta_s_cmd"])} if head else {}
    return _table(tmp_path, {"t": run.t}, columns)


def about_planes(proposal):
    return [text for text in proposal.map.questions if "planes" in text]


@pytest.mark.thorough
def test_stern_planes_are_read_and_the_run_is_named_by_them(tmp_path, dive):
    found = propose([log_of(tmp_path, dive, "pitch fin cmd [deg]")], pitches=BOW_DOWN)
    assert found.map.channels["delta_s_cmd"].source == "pitch fin cmd [deg]"
    assert about_planes(found) == [] and found.map.runs[0].manoeuvre.startswith("vertical zigzag")
    assert any("lowers the bow" in text and "as the vehicle has it" in text for text in found.remarks)


@pytest.mark.thorough
def test_planes_that_count_the_other_way_than_those_of_the_vehicle_are_asked_about(tmp_path, dive):
    (asked,) = about_planes(propose([log_of(tmp_path, dive, "elevator [deg]", -1.0)], pitches=BOW_DOWN))
    assert "raises the bow" in asked and "scale = -1" in asked and "delta_s_cmd" in asked
    assert about_planes(propose([log_of(tmp_path, dive, "elevator [deg]", -1.0)], pitches=1.0)) == []


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("head", "words"),
    [("fin 3 [deg]", "'fin 3 [deg]' may be the order or the angle of a fin"), ("", "no stern planes found")],
)
def test_planes_that_no_name_tells_are_asked_for_where_the_vehicle_has_some(tmp_path, dive, head, words):
    log = log_of(tmp_path, dive, head)
    (asked,) = about_planes(propose([log], pitches=BOW_DOWN))
    assert words in asked and "delta_s_cmd" in asked
    assert about_planes(propose([log])) == []


@pytest.mark.thorough
def test_a_log_of_the_plane_is_not_asked_for_planes(tmp_path):
    run = bayesid.simulate("remus100", "zigzag:10/10,duration=60", noise={}, seed=1).runs[0]
    data = {
        "north [m]": run.data["x"],
        "east [m]": run.data["y"],
        "heading [deg]": np.degrees(run.data["psi"]),
    }
    columns = {"t [s]": run.t} | data | {"rudder order [deg]": np.degrees(run.commands["delta_r_cmd"])}
    assert about_planes(propose([_table(tmp_path, {"t": run.t}, columns)], pitches=BOW_DOWN)) == []


def test_which_way_positive_planes_pitch_a_vehicle_is_the_sign_of_its_moment():
    assert pitches(bayesid.load_vehicle("remus100")) == BOW_DOWN
    assert pitches(bayesid.load_vehicle("esso_osaka_mmg")) is None and pitches(with_fins(X)) is None


@pytest.mark.thorough
@pytest.mark.parametrize("pitched", [False, True])
def test_planes_that_hardly_move_are_degrees_where_nothing_pitches(tmp_path, dive, pitched):
    """0.3 would be 17 degrees as radians: so much pitches a vehicle under way."""
    log = log_of(tmp_path, dive, "pitch fin cmd [deg]", 0.03)
    if not pitched:
        rows = [line.split(",") for line in log.read_text().splitlines()]
        k = rows[0].index("pitch [deg]")
        log.write_text("\n".join(",".join([*r[:k], r[k] if not j else "0.5", *r[k + 1 :]])
                                 for j, r in enumerate(rows)))  # fmt: skip
        log.write_text(log.read_text().replace(",0.5,", ",0.4,", 1))
    asked = propose([log], pitches=BOW_DOWN).map.questions
    assert any("radians?" in text for text in asked) is pitched


@pytest.mark.thorough
@pytest.mark.parametrize("period", [15.0, 30.0, 60.0])
@pytest.mark.parametrize("vehicle", ["remus100", "lauv"])
def test_slow_planes_which_the_pitch_follows_tell_their_side_too(tmp_path, vehicle, period):
    """The righting moment lets pitch follow slow planes; its rate alone told the other side by 25 errors."""
    t = 0.1 * np.arange(1200)
    orders = tmp_path / "orders.csv"
    rows = np.column_stack([t, 3.0 * np.sin(2 * np.pi * t / period)])
    np.savetxt(orders, rows, delimiter=",", header="t[s],delta_s_cmd[deg]", comments="", fmt="%.6g")
    run = bayesid.simulate(vehicle, f"table:{orders}", dof=6, noise={}, seed=1).runs[0]
    right = propose([log_of(tmp_path, run, "stern plane cmd [deg]")], pitches=BOW_DOWN)
    assert not about_planes(right) and any("lowers the bow" in text for text in right.remarks)
    (asked,) = about_planes(propose([log_of(tmp_path, run, "elevator [deg]", -1.0)], pitches=BOW_DOWN))
    assert "raises the bow" in asked and "scale = -1" in asked


@pytest.mark.thorough
@pytest.mark.parametrize("planes", [1.0, -1.0])
@pytest.mark.parametrize("pitch", [1.0, -1.0])
def test_a_pitch_of_the_other_sign_is_not_put_down_to_the_planes(tmp_path, dive, pitch, planes):
    """The depth tells which of both is turned."""
    below = {"theta": pitch * dive.data["theta"], "z": dive.data["z"] + 30.0}
    turned = replace(dive, data={**dive.data, **below})
    asked = propose([log_of(tmp_path, turned, "elevator [deg]", planes)], pitches=BOW_DOWN).map.questions
    about_pitch = [text for text in asked if "line of theta" in text]
    assert bool(about_pitch) == (pitch < 0)
    assert [("raises the bow" in text and "delta_s_cmd" in text) for text in asked].count(True) == (
        planes < 0
    )


@pytest.mark.thorough
def test_a_depth_that_was_turned_as_it_is_negative_is_turned_back_where_the_pitch_says_so(tmp_path, dive):
    """A depth from the start of the run, of a vehicle that climbs."""
    above = replace(dive, data={**dive.data, "z": dive.data["z"] - 30.0})
    asked = propose([log_of(tmp_path, above, "elevator [deg]")], pitches=BOW_DOWN).map.questions
    (about,) = [text for text in asked if "line of theta" in text]
    depth, pitch = (f"`scale = {n}` in the line of {role}" for n, role in ((1, "depth"), (-1, "theta")))
    assert about.index(depth) < about.index(pitch)
    assert not any("raises the bow" in text for text in asked)


def test_a_distance_to_the_surface_is_no_control_surface():
    assert _FIN.search("distance to surface") is None and _FIN.search("control surface") is not None
