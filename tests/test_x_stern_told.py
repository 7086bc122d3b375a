"""What `trial check` and `trial measure` tell of a vehicle whose fins are rudder and planes at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.cli.main import run as run_command
from bayesid.cli.trial import _rudder_lines
from bayesid.measures import named_measures
from bayesid.model.vehicles.orders import gathered
from bayesid.trials import trial_summary
from tests.test_x_stern import X, with_fins

SHIP = with_fins(X)
FINS = ["delta_1", "delta_2", "delta_3", "delta_4"]


@pytest.fixture(scope="module")
def trial():
    return bayesid.simulate(SHIP, "turn:15,duration=60", "vzigzag:10/5,duration=60", noise={}, seed=1)


@pytest.mark.thorough
def test_the_rudder_of_a_check_is_what_the_fins_make_together(trial):
    turn, upright = trial_summary(trial, SHIP)["runs"]
    assert turn["rudder_of"] == upright["rudder_of"] == FINS
    assert max(map(abs, turn["rudder_deg"])) == pytest.approx(15.0, abs=0.1)
    assert max(map(abs, upright["rudder_deg"])) < 0.1  # its fins go to 10 degrees, as planes
    (line,) = _rudder_lines([turn, upright], True)
    assert "mean of delta_1, delta_2, delta_3 and delta_4" in line


@pytest.mark.thorough
def test_one_fin_alone_is_said_to_be_one(trial):
    runs = trial_summary(trial)["runs"]
    assert all(len(run["rudder_of"]) == 1 for run in runs)
    assert max(map(abs, runs[1]["rudder_deg"])) == pytest.approx(10.0, abs=0.1)
    (line,) = _rudder_lines(runs, False)
    assert " alone" in line and "--vehicle" in line
    assert "--vehicle" not in _rudder_lines(runs, True)[0]


def test_a_single_rudder_by_its_name_counts_positive_to_port():
    (line,) = _rudder_lines([{"rudder_of": ["delta_1"]}], True)
    assert line == "rudder [deg] is that of delta_1, positive to port."


@pytest.mark.thorough
def test_three_of_four_fins_make_no_rudder(trial):
    runs = tuple(
        replace(run, commands={k: v for k, v in run.commands.items() if k != "delta_3_cmd"})
        for run in trial.runs
    )
    for run in trial_summary(replace(trial, runs=runs), SHIP)["runs"]:
        assert run["rudder_of"] == []


def test_a_vehicle_with_a_rudder_is_told_as_before():
    plain = bayesid.simulate("remus100", "turn:10,duration=60", noise={}, seed=1)
    (run,) = trial_summary(plain, bayesid.load_vehicle("remus100"))["runs"]
    assert run["rudder_of"] == ["delta_r"]
    assert _rudder_lines([run], True) == [
        "Rudder angles count positive to port, whatever side the log counts."
    ]
    assert _rudder_lines([{"rudder_of": []}], True) == []


@pytest.mark.thorough
def test_a_vertical_zigzag_is_one_of_the_stern_planes(trial):
    run = trial.runs[1]
    data = {**run.data, "delta_s": gathered(SHIP, run.commands)["delta_s_cmd"]}
    (found,) = named_measures(run.manoeuvre, run.t, data)
    rows = {row[0]: row[1] for row in found["rows"]}
    assert rows["stern plane"] == pytest.approx(10.0, abs=0.1) and "rudder" not in rows
    assert "initial_turning_distance" not in found["reasons"]
    cut = run.t < float(run.t[np.argmax(np.abs(np.diff(data["delta_s"])) > 0.3)]) + 1.0
    (short,) = named_measures(run.manoeuvre, run.t[cut], {k: v[cut] for k, v in data.items()})
    assert short["reasons"] and not any(
        word in why for why in short["reasons"].values() for word in ("rudder", "heading", "course")
    )


@pytest.mark.thorough
def test_a_check_of_a_bundle_prints_whose_angle_it_is(tmp_path, capsys):
    assert run_command(["simulate", "lauv", "turn:15,duration=40", "--out", str(tmp_path / "one")]) == 0
    capsys.readouterr()
    run_command(["trial", "check", str(tmp_path / "one")])
    assert "Rudder angles count positive to port" in capsys.readouterr().out
