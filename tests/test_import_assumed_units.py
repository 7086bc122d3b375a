"""What a proposal says of a unit that no header states, and of axes that the compass contradicts."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.model.units import scale
from bayesid.trials.importing import Proposal, apply_map, propose
from bayesid.trials.importing.unit_words import split_unit

HEADS = ("time_s", "Northing", "Easting", "Compass_deg", "Rudder_cmd_deg", "Shaft_rpm")
STARTS = (0.0, 90.0, 200.0, 45.0, -120.0)  # deg, heading in which each run begins
CIRCLES = (1, 3)  # runs that turn to one side; the others weave


def logs(folder: Path, heads=HEADS, change=lambda rows: rows) -> list[Path]:
    """A run per heading: t, north, east, compass [deg], rudder to starboard [deg], rpm; first-order turns."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    paths = []
    for k, start in enumerate(STARTS):
        t = 0.2 * np.arange(500)
        rudder = (
            2.0 * np.sign(np.sin(0.25 * t)) * (t > 10.0) if k not in CIRCLES else np.where(t > 10, 12.0, 0.0)
        )
        rate, psi = 0.0, [math.radians(start)]
        for order in rudder[1:]:
            rate += 0.2 * (0.6 * math.radians(order) - rate) / 1.5
            psi.append(psi[-1] + 0.2 * rate)
        heading = np.array(psi)
        way = np.cumsum(1.5 * np.exp(1j * heading) * 0.2) + 0.1 * (
            rng.normal(size=500) + 1j * rng.normal(size=500)
        )
        compass = np.mod(np.degrees(heading) + 0.3 * rng.normal(size=500), 360.0)
        rows = change(np.column_stack((t, way.real, way.imag, compass, rudder, np.full(500, 1200.0))))
        path = folder / f"run_{k}.csv"
        np.savetxt(path, rows, fmt="%.3f", delimiter=",", header=",".join(heads), comments="")
        paths.append(path)
    return paths


def proposed(tmp_path: Path, heads=HEADS, change=lambda rows: rows) -> Proposal:
    return propose(logs(tmp_path / "logs", heads, change), "remus100", "trial")


def test_gon_is_a_hundredth_of_a_right_angle_and_asks_nothing(tmp_path):
    assert scale("gon", "rad", "here") == pytest.approx(math.pi / 200.0, rel=1e-15)
    assert split_unit("Rudder_cmd_gon") == ("Rudder_cmd", "gon") == split_unit("Rudder_cmd [gon]")
    found = proposed(tmp_path, (*HEADS[:4], "Rudder_cmd_gon", HEADS[5]))
    assert found.map.channels["delta_r_cmd"].unit == "gon"
    assert found.map.questions == ()


def test_a_unit_that_is_not_known_is_asked_with_the_one_taken(tmp_path):
    found = proposed(tmp_path, (*HEADS[:4], "Rudder_cmd_oxg", HEADS[5]))
    (question,) = found.map.questions
    assert "'Rudder_cmd_oxg' is read as delta_r_cmd" in question
    assert "'oxg'" in question and "taken as degrees" in question


def test_a_name_read_by_a_part_says_the_unit_taken_in_the_one_question(tmp_path):
    heads = ("time", "Northing", "Easting", "Compass", "Rudder_cmd_oxg", "Shaft")  # no other has a unit
    found = proposed(tmp_path, heads)
    (question,) = [q for q in found.map.questions if "Rudder" in q]
    assert "by a part of its name, its numbers taken as degrees" in question


def test_a_rudder_without_a_unit_is_remarked_and_not_asked(tmp_path):
    found = proposed(tmp_path, (*HEADS[:4], "Rudder_cmd", HEADS[5]))
    assert found.map.questions == ()
    assert "'Rudder_cmd' states no unit and is taken as degrees" in found.remarks


def test_a_rudder_with_its_unit_is_not_remarked(tmp_path):
    assert not [text for text in proposed(tmp_path).remarks if "Rudder" in text and "unit" in text]


# --- axes that the compass contradicts


def exchanged(rows):
    return rows[:, [0, 2, 1, 3, 4, 5]]


def anticlockwise(rows):
    return np.column_stack((rows[:, :3], np.mod(-rows[:, 3], 360.0), rows[:, 4:]))


def constant_offset(rows):
    return np.column_stack((rows[:, :3], np.mod(rows[:, 3] + 25.0, 360.0), rows[:, 4:]))


def test_exchanged_positions_are_among_the_guesses(tmp_path):
    question = proposed(tmp_path, change=exchanged).map.questions[0]
    assert "they agree with 'Northing' and 'Easting' exchanged" in question
    assert "other sign" not in question


def test_a_compass_to_port_is_a_guess_beside_an_easting_to_the_west(tmp_path):
    question = proposed(tmp_path, change=anticlockwise).map.questions[0]
    assert "'Easting' of the other sign" in question and "'Compass_deg' of the other sign" in question
    assert "turn over `rudder_positive`" in question and "exchanged" not in question


def test_the_mend_asked_for_a_compass_to_port_gives_the_log_of_a_right_one(tmp_path):
    made = []
    for name, change, factor in (("wrong", anticlockwise, -1.0), ("right", lambda rows: rows, 1.0)):
        (tmp_path / name).mkdir()
        sources = logs(tmp_path / name / "logs", change=change)
        found = propose(sources, "remus100", "trial").map
        channels = {**found.channels, "heading": replace(found.channels["heading"], scale=factor)}
        over = {"port": "starboard", "starboard": "port"}
        side = over[found.rudder_positive] if factor < 0 else found.rudder_positive
        mended = replace(found, channels=channels, questions=(), rudder_positive=side)
        made.append((side, apply_map(mended, sources)[0][0].data))
    assert made[0][0] == made[1][0] == "starboard"
    np.testing.assert_allclose(np.cos(made[0][1]["psi"] - made[1][1]["psi"]), 1.0, atol=1e-9)
    np.testing.assert_allclose(made[0][1]["delta_r_cmd"], made[1][1]["delta_r_cmd"])


def test_a_compass_that_is_off_by_as_much_everywhere_has_no_other_guess(tmp_path):
    (question,) = proposed(tmp_path, change=constant_offset).map.questions
    assert "magnetic north" in question and "they agree with" not in question


def test_exchanged_positions_are_asked_where_the_turns_of_the_runs_cancel(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{__name__}.STARTS", (8.0, 98.0, 8.0, 98.0))
    monkeypatch.setattr(f"{__name__}.CIRCLES", ())
    (question,) = proposed(tmp_path, change=exchanged).map.questions
    assert "does not run along the heading" in question and "exchanged" in question
