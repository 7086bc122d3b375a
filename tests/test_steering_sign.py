"""Outboards, azimuths and nozzles whose angles all count the other way are told before any cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from actuator_plants import AZIMUTH, WATERJET, plant_trial

from bayesid.diagnosis.input import check_trial
from bayesid.diagnosis.input.steering import mistakes_of_steering, steering, steering_shown, with_rudder
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run, Trial
from tests.test_named_rudders import LAUNCH, NOISE

OUTBOARDS = LAUNCH[: LAUNCH.index("[actuators.3]")] + LAUNCH[LAUNCH.index("[coef]") :]
for side, y in (("port", -0.7), ("stbd", 0.7)):
    OUTBOARDS += f"""
[actuators.{side}]
kind = "azimuth"
at = [-4.5, {y}, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 0.006
T_un = -0.4
turn_max_deg = 35.0
turn_rate_deg_s = 20.0
"""
ANGLES = ("azimuth_port", "azimuth_stbd")


@pytest.fixture(scope="module")
def boat(tmp_path_factory):
    file = tmp_path_factory.mktemp("boat") / "boat.toml"
    file.write_text(OUTBOARDS)
    return build_model(load_vehicle(file), 3)


@pytest.fixture(scope="module")
def zigzags(boat) -> Trial:
    rng, runs = np.random.default_rng(0), []
    for k, period in enumerate((18.0, 26.0)):
        t = np.arange(0.0, 120.0, 0.5)
        angle = 0.25 * np.sign(np.sin(2 * np.pi * t / period))
        commands = {f"n_{side}_cmd": np.full(t.size, 600.0) for side in ("port", "stbd")}
        commands |= {f"{name}_cmd": angle for name in ANGLES}
        states = simulate(boat, boat.nominal, plan_run(boat, t, commands), steady_start(boat)).states
        data = {n: states[:, boat.states.index(n)] + rng.normal(0.0, NOISE[n], t.size) for n in NOISE}
        runs.append(Run(f"zz{k}", "zigzag", "identify", t, data, commands))
    return Trial("boat", Path("."), "", 3, tuple(runs), noise=NOISE)


def turned(trial: Trial, *words: str) -> Trial:
    """The trial with orders that begin with some words logged with the opposite sign."""
    runs = [
        replace(r, commands={k: -v if k.startswith(words) else v for k, v in r.commands.items()})
        for r in trial.runs
    ]
    return replace(trial, runs=tuple(runs))


@pytest.fixture
def stated(tmp_path):
    """The boat without its equations, which take seconds to compile."""
    file = tmp_path / "boat.toml"
    file.write_text(OUTBOARDS)
    vehicle = load_vehicle(file)
    return SimpleNamespace(vehicle=vehicle, scales={"L": vehicle.L})


def follower() -> Run:
    """A turn that follows outboards at the stern with a lag, to port where they are positive."""
    rng, t = np.random.default_rng(1), np.arange(0.0, 120.0, 0.5)
    angle, rate = 0.25 * np.sign(np.sin(2 * np.pi * t / 18.0)), np.zeros(t.size)
    for k in range(1, t.size):
        rate[k] = 0.8 * rate[k - 1] - 0.2 * 0.5 * angle[k - 1]
    psi = np.cumsum(rate) * 0.5 + 0.005 * rng.standard_normal(t.size)
    commands = {f"n_{side}_cmd": np.full(t.size, 600.0) for side in ("port", "stbd")}
    return Run("zz", "", "identify", t, {"psi": psi}, commands | {f"{name}_cmd": angle for name in ANGLES})


def test_outboards_steer_as_one_rudder_and_their_right_sign_is_said(stated):
    assert steering(stated) == ANGLES
    run = follower()
    order = with_rudder(stated, run, ANGLES).input("delta_r")
    assert np.corrcoef(order, run.commands["azimuth_port_cmd"])[0, 1] > 0.999  # at the stern: to port
    astern = replace(run, commands={k: -v if k.startswith("n_") else v for k, v in run.commands.items()})
    np.testing.assert_allclose(with_rudder(stated, astern, ANGLES).input("delta_r"), -order)
    runs = [run] * 3
    assert steering_shown(stated, runs) == "sign of the azimuth angles of port and stbd"
    wrong = turned(Trial("boat", Path("."), "", 3, tuple(runs)), "azimuth").runs
    assert steering_shown(stated, wrong) == "" == steering_shown(stated, [astern] * 3)
    (mistake,) = mistakes_of_steering(ANGLES)
    assert set(mistake.correction.scale) == {n + e for n in ANGLES for e in ("", "_cmd")}


def test_thrusts_before_the_centre_turn_it_the_other_way_and_those_near_it_do_not(stated):
    def moved(x):
        thrusters = tuple(replace(a, at=(x, a.at[1], 0.0)) for a in stated.vehicle.thrusters)
        return SimpleNamespace(vehicle=replace(stated.vehicle, thrusters=thrusters), scales=stated.scales)

    run = follower()
    order = with_rudder(moved(4.5), run, ANGLES).input("delta_r")
    assert np.corrcoef(order, run.commands["azimuth_port_cmd"])[0, 1] < -0.999
    assert steering(moved(0.1)) == ("delta_r",)


@pytest.mark.thorough
def test_outboards_that_are_all_reversed_are_told_with_their_mend_and_right_ones_are_not(boat, zigzags):
    right = check_trial(zigzags, boat)
    assert right.findings == () and "sign of the azimuth angles of port and stbd" in right.in_order
    wrong = check_trial(turned(zigzags, "azimuth"), boat)
    (found,) = wrong.findings
    assert found.name == "sign of azimuth_port, azimuth_stbd"
    assert found.says.startswith("azimuths port and stbd have the opposite sign")
    assert found.correction.scale["azimuth_stbd_cmd"] == -1.0
    assert max(found.probability, found.together) > 0.95
    assert not any("azimuth" in text for text in wrong.in_order)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("text", "which", "word"), [(AZIMUTH, "azimuth", "azimuth_"), (WATERJET, "waterjet", "nozzle_")]
)
def test_pods_and_nozzles_among_other_orders_of_another_plant(text, which, word, tmp_path):
    """Orders at random, buckets down and a pod that turns by 115 degrees: right ones are no mistake."""
    file = tmp_path / "vehicle.toml"
    file.write_text(text)
    model = build_model(load_vehicle(file), 3)
    for seed in (3, 4):
        trial = plant_trial(which, file, seed)
        assert check_trial(trial, model).findings == ()
        told = check_trial(turned(trial, word), model).findings
        assert all(one.name.startswith(f"sign of {word}") for one in told)
        assert told or which == "azimuth"  # two runs of such a pod do not always tell
