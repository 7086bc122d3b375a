"""The built-in sets behave as in an independent simulator: turns, zig-zags, spirals, and free turns in 6-DOF.

`data/reference_behaviour.json` was computed by another program (RK4). Its steady values are reproduced to
0.1 %; transients depend on the step it moves and orders in: lengths by the way of one step, overshoots by
the heading it turns through in one.
"""

import json
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from plain_kernel import uncompiled
from vehicle_sets import ROW_SETS

from bayesid import manoeuvres, measures
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, run_manoeuvre, simulate, steady_start

REFERENCE = json.loads((Path(__file__).parent / "data" / "reference_behaviour.json").read_text("utf-8"))
EVERY = pytest.mark.parametrize("name", ROW_SETS)
DEG = math.pi / 180
STEADY, TRANSIENT = 1e-3, 5e-3


def step_of_reference(name):
    """[s], from the times it prints."""
    return 0.2 if REFERENCE[name]["L_over_U"] > 10 else 0.02


@lru_cache
def boat(name):
    model = build_model(load_vehicle(name), 3)
    return model, steady_start(model), REFERENCE[name]


@EVERY
def test_turning_circle(name):
    model, x0, ref = boat(name)
    L, time = model.vehicle.L, model.vehicle.L / ref["U0"]
    turn = ref["turn"]
    order = manoeuvres.turn(-turn["delta"] * DEG, ref["rpm"], 5 * time, 60 * time, 0.02 * time)
    track, commands = run_manoeuvre(model, model.nominal, order, x0)
    states = [track[name] for name in ("x", "y", "psi")]
    found = measures.turning_circle(track.t, *states, commands["delta_r_cmd"], track["u"], track["v"])
    assert found.steady_diameter / L == pytest.approx(turn["steady_D"], rel=STEADY)
    assert found.steady_yaw_rate / DEG == pytest.approx(turn["r_deg_s"], rel=STEADY)
    assert found.drift_angle / DEG == pytest.approx(turn["drift_deg"], rel=STEADY)
    assert found.speed_ratio == pytest.approx(turn["speed_ratio"], rel=STEADY)
    for value, key in (
        (found.advance, "advance"),
        (found.transfer, "transfer"),
        (found.tactical_diameter, "TD"),
    ):
        way = step_of_reference(name) / time
        assert value / L == pytest.approx(turn[key], rel=TRANSIENT, abs=way), key


@pytest.mark.thorough
@EVERY
@pytest.mark.parametrize("angle", [10, 20])
def test_zigzag(name, angle):
    model, x0, ref = boat(name)
    if f"zz{angle}" not in ref:
        pytest.skip("the rudder of this set does not reach that far")
    time, zz = model.vehicle.L / ref["U0"], ref[f"zz{angle}"]
    order = manoeuvres.zigzag(-angle * DEG, angle * DEG, ref["rpm"], time, 40 * time, 0.005 * time)
    track, commands = run_manoeuvre(model, model.nominal, order, x0)
    found = measures.zigzag(track.t, track["psi"], commands["delta_r_cmd"])
    overshoots = np.array(found.overshoots[:3]) / DEG
    turned = ref["turn"]["r_deg_s"] * step_of_reference(name)
    assert overshoots == pytest.approx(zz["overshoots"], rel=TRANSIENT, abs=turned)
    assert found.period / time == pytest.approx(
        zz["period_LU"], rel=TRANSIENT, abs=2 * step_of_reference(name) / time
    )


@EVERY
def test_spiral(name):
    """Rudder from 0 to its end between 20 and 580 s: where the vehicle is, how often it has turned."""
    model, x0, ref = boat(name)
    spiral, L = ref["spiral"], model.vehicle.L
    end = min(25.0 * DEG, model.vehicle.limits.get("delta_r", 25 * DEG))
    dt = 0.25 if L > 50 else 0.02
    t = np.arange(0.0, 600.0 + 0.5 * dt, dt)
    rudder = -end * np.clip((t - 20.0) / 560.0, 0.0, 1.0)
    plan = plan_run(model, t, {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, ref["rpm"])})
    track = simulate(model, model.nominal, plan, x0)
    assert track["psi"][-1] / (2 * math.pi) == pytest.approx(spiral["turns"], rel=STEADY)
    for state in "uvr":
        assert track[state][-1] == pytest.approx(spiral[f"{state}_end"], rel=STEADY)
    way = np.hypot(track["x"][-1] - spiral["x"], track["y"][-1] - spiral["y"])
    assert way < STEADY * spiral["path"]


@pytest.mark.parametrize("name", [n for n in ROW_SETS if "sixdof" in REFERENCE[n]])
def test_free_turn_in_six_degrees(name):
    """Planes fixed, for 30 L/U: list, trim and depth at the end; the kernel as plain Python."""
    ref = REFERENCE[name]
    model = uncompiled(build_model(load_vehicle(name), 6))
    L, time, six = model.vehicle.L, model.vehicle.L / ref["U0"], ref["sixdof"]
    t = np.linspace(0.0, 30 * time, 301)
    rudder = np.full(t.size, -six["rudder_deg"] * DEG)
    plan = plan_run(model, t, {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, ref["rpm"])})
    track = simulate(model, model.nominal, plan, steady_start(model))
    assert np.abs(track["r"][-1]) / DEG == pytest.approx(six["r_deg_s"], rel=TRANSIENT)
    assert np.abs(track["phi"]).max() / DEG == pytest.approx(six["phi_max_deg"], rel=1e-2)
    assert track["theta"][-1] / DEG == pytest.approx(six["theta_end_deg"], rel=TRANSIENT, abs=0.02)
    assert np.ptp([0.0, track["z"][-1] / L]) == pytest.approx(abs(six["depth_change_L"]), rel=1e-2, abs=5e-3)
