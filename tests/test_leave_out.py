"""Readings of one run left out between two times by `leave_out` under [corrections]."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply, join, read_correction, without_effect
from bayesid.trials.left_out import LeftOut, read_left_out

T = 0.5 * np.arange(200)
RUN = Run("b", "", "identify", T, dict.fromkeys(("x", "y", "psi", "u", "v"), 1.0 + 0.01 * T), {})


def test_leave_out_empties_the_cells_of_its_run_alone():
    mend = Correction(leave_out=(LeftOut("b", ("u", "v"), 30.0, 65.0),))
    run = RUN
    mended = apply(mend, run)
    inside = (run.t >= 30.0) & (run.t <= 65.0)
    assert np.isnan(mended.data["u"][inside]).all() and np.isfinite(mended.data["u"][~inside]).all()
    np.testing.assert_array_equal(mended.data["psi"], run.data["psi"])
    other = replace(run, name="a")
    assert apply(mend, other) is other
    assert mend.channels == {"u", "v"} and mend.names_runs == ("b",)


def test_leave_out_is_read_as_it_is_written_and_joined():
    one = Correction(leave_out=(LeftOut("b", ("u", "v"), 1748000030.25, 1748000065.5),))
    other = Correction(leave_out=(LeftOut("a", ("u",), 3.0, 5.0),))
    problems: list[str] = []
    both = join([one, other])
    assert both is not None
    assert read_correction(tomllib.loads("\n".join(both.lines())), problems) == both and not problems
    assert join([one, Correction(scale={"psi": -1.0})]) is not None
    assert join([one, Correction(time_scale=2.0)]) is None


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("no list", "must be a list of tables"),
        ([{"run": "b", "channels": ["u"], "from": 1.0}], "to is needed"),
        ([{"run": "b", "channels": ["u"], "from": 1.0, "to": 2.0, "x": 1}], "'x' is not known"),
        ([{"run": "b", "channels": ["speed"], "from": 1.0, "to": 2.0}], "'speed' is no channel"),
        ([{"run": "b", "channels": [], "from": 1.0, "to": 2.0}], "channels must be a list of names"),
        ([{"run": 3, "channels": ["u"], "from": 1.0, "to": 2.0}], "run must be the name"),
        ([{"run": "b", "channels": ["u"], "from": "1", "to": 2.0}], "must be numbers"),
        ([{"run": "b", "channels": ["u"], "from": 3.0, "to": 2.0}], "is after to"),
    ],
)
def test_a_wrong_entry_is_told(entry, says):
    problems: list[str] = []
    read_correction({"leave_out": entry}, problems)
    assert len(problems) == 1 and says in problems[0]


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (LeftOut("c", ("u",), 1.0, 5.0), "there is no run c; there are b"),
        (LeftOut("b", ("w",), 1.0, 5.0), "b does not log w"),
        (LeftOut("b", ("u",), 500.0, 600.0), "b has no reading of u from 500 to 600 s"),
    ],
)
def test_an_entry_without_effect_is_told(entry, says):
    (words,) = without_effect(Correction(leave_out=(entry,)), [RUN])
    assert says in words


def test_an_order_is_refused_and_a_run_beside_those_concerned_is_told():
    """Empty cells of an order ended in a LinAlgError; a run beside `runs` kept its readings unsaid."""
    found: list[str] = []
    order = [{"run": "a", "channels": ["delta_r_cmd"], "from": 1, "to": 2}]
    assert read_left_out(order, "here", found) is None
    assert len(found) == 1 and "delta_r_cmd is no reading of the motion" in found[0]
    t = np.arange(5.0)
    runs = [Run(name, "", "identify", t, {"u": np.ones(5)}, {}) for name in ("a", "b")]
    mend = Correction(runs=("a",), scale={"u": 2.0}, leave_out=(LeftOut("b", ("u",), 1.0, 2.0),))
    assert any("changes nothing in b" in text for text in without_effect(mend, runs))
    assert without_effect(replace(mend, runs=()), runs) == []
