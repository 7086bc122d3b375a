"""A vehicle that goes sideways, logged in forward-left-up axes that its columns name."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from bayesid.trials.importing.axes import body_of
from bayesid.trials.importing.map_text import map_text
from bayesid.trials.importing.named_sides import body_of_name
from tests.raw_logs import DEG

KNOT = 1852.0 / 3600.0


def log(folder, gyro=1.0, without=(), exchanged=False, steadily=0.0):
    """A vehicle driven ahead, sideways and down while it turns.

    gyro : -1 for a yaw rate that counts to starboard
    steadily : mean speed to starboard [m/s]
    """
    t = np.arange(0.0, 240.0, 0.2)
    psi = 0.4 + 1.2 * np.sin(2.0 * np.pi * t / 90.0)
    r = np.gradient(psi, t)
    u, v, w = 0.3 + 0.1 * np.sin(t / 17.0), steadily + 0.6 * np.cos(t / 13.0), 0.05 * np.sin(t / 11.0)
    rng = np.random.default_rng(4)
    north, east = (
        np.cumsum(speed) * 0.2 + 0.02 * rng.standard_normal(t.size)
        for speed in (u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi))
    )
    columns = {
        "t [s]": t, "usbl_east_m": east, "usbl_north_m": north, "depth_m": 5.0 + 0.2 * np.cumsum(w),
        "ahrs_yaw_enu_deg": 90.0 - psi / DEG, "gyro_z_deg_s": -gyro * r / DEG,
        "dvl_fwd_kn": u / KNOT, "dvl_port_kn": -v / KNOT, "dvl_up_kn": -w / KNOT,
        "rudder order [deg]": np.sign(np.sin(t / 7.0)) * 10.0,
    }  # fmt: skip
    if exchanged:
        columns["dvl_port_kn"] = -columns["dvl_port_kn"]
    kept = {name: values for name, values in columns.items() if name not in without}
    path = folder / "dive.csv"
    rows = np.column_stack(list(kept.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(kept), comments="", fmt="%.9g")
    return path


@pytest.mark.parametrize(
    ("role", "name", "body"),
    [
        ("v", "dvl_port_kn", "flu"), ("v", "dvl stbd [m/s]", "frd"), ("w", "dvl_up_kn", "flu"),
        ("w", "dvl_down_mps", "frd"), ("v", "dvl_y", None), ("w", "port", None), ("v", "port_dvl_y", None),
        ("v", "log:dvl_port_vel", "flu"),
    ],
)  # fmt: skip
def test_the_last_word_of_a_velocity_tells_its_side(role, name, body):
    assert body_of_name(role, name) == body


@pytest.mark.parametrize("steadily", [0.0, -0.8])
def test_velocities_of_a_vehicle_that_goes_sideways_are_read_without_a_question(tmp_path, steadily):
    found = propose([log(tmp_path, steadily=steadily)])
    asked = [text for text in found.map.questions if "rudder" not in text]
    assert asked == []
    assert (found.map.world, found.map.body) == ("enu", "flu")
    channels = found.map.channels
    assert [channels[k].source for k in ("psi", "v", "w")] == ["ahrs_yaw_enu_deg", "dvl_port_kn", "dvl_up_kn"]
    assert [channels[k].scale for k in ("v", "w")] == [1.0, 1.0]
    assert "body axes flu, as 'dvl_port_kn' and 'dvl_up_kn' say" in found.remarks


def test_a_velocity_to_port_beside_a_yaw_rate_to_starboard_has_its_own_sign(tmp_path):
    found = propose([log(tmp_path, gyro=-1.0)])
    assert found.map.body == "frd"
    assert [found.map.channels[k].scale for k in ("v", "w")] == [-1.0, -1.0]
    assert any("counts positive to port, as its name says" in text for text in found.remarks)
    assert not any("counts against" in text for text in found.map.questions)


def test_a_velocity_to_starboard_that_is_called_port_is_asked_about(tmp_path):
    found = propose([log(tmp_path, exchanged=True)])
    assert any("sway 'dvl_port_kn' counts against the body axes" in text for text in found.map.questions)
    assert found.map.channels["v"].scale == -1.0


@pytest.mark.parametrize(
    ("without", "words"),
    [
        (("ahrs_yaw_enu_deg",), "cannot be held against the track, as no heading is read"),
        (("dvl_port_kn",), "alone does not integrate to the track, and no speed to the side is read"),
    ],
)
def test_what_the_speed_lacks_to_be_held_against_the_track_is_said(tmp_path, without, words):
    asked = propose([log(tmp_path, without=without)]).map.questions
    assert any(words in text for text in asked), asked
    assert not any("does not integrate to the track; right column" in text for text in asked)


def test_a_track_to_the_side_without_its_speed_may_be_that_of_a_vehicle_that_goes_sideways(tmp_path):
    asked = propose([log(tmp_path, without=("dvl_port_kn",), steadily=-0.8)]).map.questions
    assert any("off the heading" in text and "does the vehicle go sideways" in text for text in asked), asked


def test_a_yaw_rate_without_a_heading_takes_the_body_axes_of_the_names(tmp_path):
    found = propose([log(tmp_path, without=("ahrs_yaw_enu_deg",))])
    assert found.map.body == "flu"
    assert not any(text.startswith("body: ") for text in found.map.questions)


def test_a_map_says_every_channel_that_its_body_axes_turn(tmp_path):
    text = map_text(propose([log(tmp_path)]).map)
    (line,) = [line for line in text.splitlines() if "# Axes of x, y, z, psi and of " in line]
    said = line.partition(" and of ")[2].partition(" in the log")[0].split(", ")
    turned = {k for k in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi") if body_of(k, 1.0, "flu") < 0}
    assert turned <= set(said) and "theta" in turned
