"""A late clock of the rudder: told by runs that begin, not told by a zig-zag that repeats."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from bayesid.trials.importing.rudder_clock import left_without, rivals_of, rudder_shifts, sides_apart
from tests.test_trial_import import DEG, zigzag_log

LATE = 3.0


def turns(begins: bool, late: float = LATE):
    """(rudder order to starboard, yaw rate) of a zig-zag, its first minute left out unless it `begins`."""
    t, angle, psi = zigzag_log(20, 10, np.inf, 0.0, seconds=240.0)
    rate = np.gradient(psi, t)
    first, last = (0.0, 240.0) if begins else (60.0, 180.0)
    inside = (t >= first) & (t <= last)
    return (t[inside] + late, -angle[inside]), (t[inside], rate[inside])


def test_the_clock_is_told_where_the_zigzag_begins_and_not_where_it_goes_on():
    found = rudder_shifts([turns(begins=True)])
    assert (found[0].seconds, found[0].side) == (-LATE, 1) and rivals_of(found) == []
    found = rudder_shifts([turns(begins=False)])
    both = [found[0], *rivals_of(found)]
    assert {s.side for s in both} == {1, -1} and any(s.seconds == -LATE and s.side == 1 for s in both)


def a_turn(late=LATE):
    """A straight run of 40 s and a turn of 60 s."""
    t = np.arange(0.0, 100.0, 0.1)
    rate = np.where(t < 40.0, 0.0, 0.05 * (1.0 - np.exp(-(t - 40.0) / 4.0)))
    return (t + late, np.where(t < 40.0, 0.0, 20.0 * DEG)), (t, rate)


def test_a_turn_tells_the_clock_of_a_zigzag_that_does_not():
    found = rudder_shifts([turns(begins=False), a_turn()])
    assert (found[0].seconds, found[0].side) == (-LATE, 1) and rivals_of(found) == []


def test_a_clock_that_is_right_is_left():
    found = rudder_shifts([turns(begins=True, late=0.0)])
    assert found[0].is_lag and found[0].side == 1
    assert found[0].left == pytest.approx(left_without([turns(begins=True, late=0.0)]), rel=0.3)


def test_runs_of_two_signs_have_each_their_side_and_late_ones_have_not():
    zigzag, (turn, rate) = turns(begins=True, late=0.0), a_turn(late=0.0)
    mixed = [zigzag, ((turn[0], -turn[1]), rate)]
    left, sides = sides_apart(mixed)
    assert sides == [1, -1] and left < 0.1 * rudder_shifts(mixed)[0].left
    late = [turns(begins=True), a_turn()]
    assert sides_apart(late)[0] > 2.0 * rudder_shifts(late)[0].left


def asked_of(tmp_path, begins, late):
    t, angle, psi = zigzag_log(20, 10, np.inf, 0.0, seconds=240.0)
    first, last = (0.0, 240.0) if begins else (60.0, 180.0)
    inside = (t >= first) & (t <= last)
    t, angle, psi = t[inside], angle[inside], psi[inside]
    north, east = (0.1 * np.cumsum(1.5 * f(psi)) for f in (np.cos, np.sin))
    motion = {"unix [s]": 1.7e9 + t, "north [m]": north, "east [m]": east, "heading [deg]": psi / DEG % 360.0}
    motion |= {"r [deg/s]": np.gradient(psi / DEG, t)}
    orders = {"unix [s]": 1.7e9 + t + late, "rudder order [deg]": -angle / DEG, "rpm order": 0.0 * t + 900.0}
    return propose([_table(tmp_path / f"r1_{n}.csv", c) for n, c in (("nav", motion), ("fins", orders))])


def _table(path, columns):
    """With all digits of the stamps."""
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(f"{v:.3f}" for v in row) for row in rows)]))
    return path


@pytest.mark.thorough
@pytest.mark.parametrize("begins", [True, False])
def test_the_question_tells_one_shift_only_where_one_explains_the_turns(tmp_path, begins):
    found = asked_of(tmp_path, begins, LATE)
    (asked,) = [text for text in found.map.questions if "clock" in text]
    assert ("shifted by -3 s" in asked or "-3 s (to starboard" in asked) and "clock_offset" in asked
    assert ("tells neither" in asked) is not begins
    assert not any("as the turns tell" in text for text in found.remarks)
    if begins:
        assert found.map.rudder_positive == "starboard" and "turns to starboard" in asked


@pytest.mark.thorough
def test_clocks_that_agree_are_not_asked_about(tmp_path):
    found = asked_of(tmp_path, True, 0.0)
    assert not [text for text in found.map.questions if "clock" in text]
    assert any("turns to starboard, as the turns tell" in text for text in found.remarks)
