"""A boat steered by its thrusters alone: a long log is cut at pauses and by what they do, and named by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from bayesid.cli.trial_import import _say
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.orders import thrusters_turning
from bayesid.trials.importing import propose
from bayesid.trials.importing.named_actuators import Steering
from tests.test_trial_import import DEG, _table

TWO = {"n_port": -1.0, "n_stbd": 1.0}
BOAT = Steering(
    tuple(TWO), {}, frozenset({"delta_r", "delta_s", "n"}), {"delta_r": {}, "n": dict.fromkeys(TWO, 1.0)},
    turning=TWO,
)  # fmt: skip
STEP, SECONDS = 0.2, 90.0
T = np.arange(0.0, SECONDS, STEP)
FILE = """
format = 1
[vehicle]
name = "catamaran"
L = 2.0
mass = 62.0
Izz = 20.0
planar_only = true
nondimensional = false
rho = 1000.0
[propulsion]
model = "quadratic"
rpm_ref = 900.0
[coef]
X_udot = -5.6
Y_vdot = -75.0
N_rdot = -12.2
"X_u|u|" = -15.5
Y_v = -20.0
N_r = -10.0
{actuators}
"""


def thruster(name: str, y: float, direction: str = "[1.0, 0.0, 0.0]") -> str:
    return f"[actuators.{name}]\nat = [-0.8, {y}, 0.0]\ndirection = {direction}\nT_nn = 2e-5\n"


def differences(kind: str) -> np.ndarray:
    """Port less starboard [rpm] of a stretch of 90 s."""
    over = np.sign(np.sin(2 * np.pi * (T - 10.0) / 16.0)) + 0.0
    return {
        "straight": np.zeros(T.size),
        "zigzag": np.where((T > 10.0) & (T < 80.0), 400.0 * over, 0.0),
        "turn": np.where((T > 10.0) & (T < 85.0), 400.0, 0.0),
    }[kind]


def columns_of(kinds: list[str], pause: float) -> dict[str, np.ndarray]:
    """A log of stretches one after the other, with `pause` [s] unlogged between them."""
    rng = np.random.default_rng(5)
    both = np.concatenate([differences(kind) for kind in kinds])
    ahead = np.concatenate([np.where(T < 4.0, 0.0, 900.0)] * len(kinds))
    rate = np.convolve(0.02 * both, np.full(10, 0.1))[: both.size]
    psi = np.cumsum(rate * STEP) + 40.0
    north, east = (np.cumsum(ahead / 900.0 * STEP * f(psi * DEG)) for f in (np.cos, np.sin))
    t = np.concatenate([k * (SECONDS + pause) + T for k in range(len(kinds))])
    noise = rng.standard_normal((4, t.size))
    return {
        "t [s]": t, "north [m]": north + 0.02 * noise[0], "east [m]": east + 0.02 * noise[1],
        "heading [deg]": np.mod(psi + 0.1 * noise[2], 360.0), "yaw rate [deg/s]": rate + 0.1 * noise[3],
        "port rpm cmd [rpm]": ahead + np.where(ahead > 0, both / 2, 0.0),
        "stbd rpm cmd [rpm]": ahead - np.where(ahead > 0, both / 2, 0.0),
    }  # fmt: skip


def proposed(folder, kinds, pause, steering=BOAT):
    columns = columns_of(kinds, pause)
    return propose([_table(folder, {"t": columns["t [s]"]}, columns)], steering=steering)


KINDS = ["straight", "zigzag", "turn", "zigzag", "turn"]


def test_a_morning_in_one_file_is_a_run_between_two_pauses_each(tmp_path):
    found = proposed(tmp_path, KINDS, 400.0)
    begin = [k * 490.0 for k in range(5)]
    assert [run.window for run in found.map.runs] == [(b, pytest.approx(b + 89.8)) for b in begin]
    words = [run.manoeuvre for run in found.map.runs]
    assert words[0] in ("straight", "speed steps") and words[1] == words[3] == "zigzag"
    assert words[2] == words[4] == "turning circle"
    assert [run.role for run in found.map.runs] == ["identify"] * 4 + ["holdout"]
    assert any("pauses 4 times for 400 s or more: another run begins" in text for text in found.remarks)
    assert not any("gap" in text for text in found.remarks)


def test_without_pauses_the_thrusters_cut_it(tmp_path):
    """Control: a log of one manoeuvre is one run."""
    found = proposed(tmp_path, ["straight", "turn", "straight", "zigzag", "straight"], STEP).map.runs
    words = [run.manoeuvre for run in found]
    assert {"turning circle", "zigzag"} < set(words) and len(words) >= 4
    turn = next(run for run in found if run.manoeuvre == "turning circle")
    assert 94.0 < turn.window[0] <= 100.0 and 170.0 < turn.window[1] < 180.0
    (alone,) = proposed(tmp_path, ["zigzag"], STEP).map.runs
    assert alone.window is None and alone.manoeuvre == "zigzag"


def test_two_pauses_cut_a_log_whose_thrusters_say_nothing(tmp_path):
    """As of an ROV, whose thrusters stand aslant: what they do has no name."""
    rov = replace(BOAT, turning={})
    found = proposed(tmp_path, KINDS[:3], 400.0, rov).map.runs
    assert [run.window[0] for run in found] == [0.0, 490.0, 980.0]
    assert [run.manoeuvre for run in found] == [""] * 3 and found[-1].role == "holdout"
    (whole,) = proposed(tmp_path, KINDS[:3], 30.0, rov).map.runs
    assert whole.window is None


def test_a_course_held_by_thrusters_is_straight(tmp_path):
    columns = columns_of(["straight"], 0.0)
    trim = np.repeat(np.random.default_rng(2).choice([-60.0, 0.0, 60.0], 30), 15)[: T.size]
    columns["port rpm cmd [rpm]"] = np.full(T.size, 900.0) + trim
    columns["stbd rpm cmd [rpm]"] = np.full(T.size, 900.0) - trim
    (run,) = propose([_table(tmp_path, {"t": T}, columns)], steering=BOAT).map.runs
    assert run.manoeuvre in ("straight", "acceleration")


@pytest.mark.parametrize(
    ("actuators", "turning"),
    [
        (thruster("port", -0.4) + thruster("stbd", 0.4), TWO),
        (thruster("1", -0.4) + thruster("2", 0.4) + thruster("3", 0.0), {"n_1": -1.0, "n_2": 1.0}),
        (thruster("port", -0.4) + thruster("stern", 0.0), {}),
        (thruster("port", -0.4, "[0.8, 0.6, 0.0]") + thruster("stbd", 0.4, "[0.8, -0.6, 0.0]"), {}),
        (thruster("port", -0.4) + thruster("stbd", 0.4) + thruster("bow", 0.0, "[0.0, 1.0, 0.0]"), {}),
    ],
)
def test_thrusters_that_turn_a_boat_by_their_difference(tmp_path, actuators, turning):
    (tmp_path / "boat.toml").write_text(FILE.format(actuators=actuators))
    assert thrusters_turning(load_vehicle(tmp_path / "boat.toml")) == turning
    assert thrusters_turning(load_vehicle("remus100")) == {}


def test_a_boat_without_rudder_and_shaft_is_told_of_neither(tmp_path, capsys, monkeypatch):
    drawn: list[str] = []
    monkeypatch.setattr(
        Figure, "savefig",
        lambda figure, *_, **__: drawn.extend(str(l.get_label()) for a in figure.axes for l in a.lines),
    )  # fmt: skip
    _say(proposed(tmp_path, KINDS, 400.0), tmp_path)
    said = capsys.readouterr().out
    assert "axes ned, frd\n" in said and "positive rudder" not in said and "not named" not in said
    assert "5 runs: " in said and "2 x zigzag" in said
    assert "speed of thruster port [rpm]" in drawn and not any("shaft" in label for label in drawn)
    nameless = proposed(tmp_path, KINDS[:3], 400.0, replace(BOAT, turning={}))
    _say(nameless, tmp_path)
    assert "3 runs\n" in capsys.readouterr().out
