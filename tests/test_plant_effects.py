"""Each catalogue effect planted by the plant and switched on in bayesid.simulation: two codes, one
response."""

import math

import numpy as np
import pytest

from bayesid.benchmark.plant.body import build
from bayesid.benchmark.plant.execute_run import execute_run, start_state
from bayesid.benchmark.plant.listed_causes import CATALOGUE, Scales
from bayesid.benchmark.plant.sensing import heading_read, read
from bayesid.benchmark.plant.settings import settings
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import observe, plan_run, simulate

CHANNELS = ("x", "y", "psi", "u", "v", "r")
# Share of the effect by which the two may differ. The plant stalls as tanh, the catalogue as a rational
# function of the same second order; the late velocity log is a cubic through half-second samples there; the
# catalogue's step of drag takes two lengths of travel, the plant's none.
TOLERANCE = {"rudder_stall": 0.05, "velocity_latency": 0.25, "drag_step": 0.05}
USUAL = 0.01
SIZE = 0.7


@pytest.fixture(scope="module")
def both():
    """response(settings, parameters) -> readings of the plant and of simulate for the same orders."""
    vehicle = load_vehicle("nps_auv2")
    model = build_model(vehicle, 3)
    U = float(model.scales["U"])
    LU = vehicle.L / U
    t = np.arange(int(25 * LU / 0.5) + 1) * 0.5
    orders = np.zeros((t.size, 3))
    orders[:, 0] = math.radians(15) * np.sign(np.sin(np.pi * (t - 2 * LU - 0.01) / (5 * LU))) * (t > 2 * LU)
    orders[:, 0] += math.radians(2) * np.sin(2.0 * t / LU)
    orders[:, 2] = vehicle.rpm_ref * (1.0 - 0.2 * (t > 12 * LU))
    inputs = {"delta_r_cmd": orders[:, 0], "n_cmd": orders[:, 2]}
    plan = plan_run(model, t, inputs, max_step=0.002 * LU)
    start = start_state(0.97 * U, 0.7, 0.0, settings(), (0.0, 0.0))

    def response(fields, values):
        gap = settings(fields)
        mine = read(execute_run(build(vehicle, vehicle.coef, 3, gap), gap, t, orders, start), gap)
        par = model.with_values(values)
        theirs = observe(model, par, plan, simulate(model, par, plan, start[[0, 1, 5, 6, 7, 11]]).states)
        return mine, dict(zip(model.kernel.channels, theirs.T, strict=True))

    scales = Scales(vehicle.L, U, vehicle.rho, vehicle.mass, vehicle.r_G[2], 25 * LU)
    return response, scales


@pytest.mark.parametrize("case", [c for c in CATALOGUE if c.dof == 3], ids=lambda c: c.name)
def test_both_implementations_of_an_effect_agree(both, case):
    response, scales = both
    parameters, fields = case.draw(np.random.default_rng(4), SIZE, scales)
    values = {f"{case.name}.{name}": value for name, value in parameters.items()}
    if case.name == "wind":  # the catalogue knows the air by its velocity and assumes the areas
        fields |= {"air_x": 0.03, "air_y": 0.1, "air_arm": 0.05}
        values = {"wind.blowing_north": fields["air_n"], "wind.blowing_east": fields["air_e"]}
        values["wind.centre_moves"] = 0.0
    bare, _ = response({}, {})
    mine, theirs = response(fields, values)
    floor = {"x": 0.01 * scales.L, "y": 0.01 * scales.L}
    for name in CHANNELS:
        effect = max(np.abs(mine[name] - bare[name]).max(), floor.get(name, 5e-3))
        assert np.abs(mine[name] - theirs[name]).max() < TOLERANCE.get(case.name, USUAL) * effect, name


def test_a_gyrocompass_settles_through_the_true_heading():
    t = np.linspace(0.0, 80.0, 401)
    gap = settings({"psi_settle": 0.1, "psi_settle_t": 20.0, "psi_settle_w": math.pi / 20.0})
    off = heading_read(np.zeros(t.size), t, gap)
    # through nought after 10 s, at its other side after 20, each half swing e^-1 of the one before
    assert off[50] == pytest.approx(0.0, abs=1e-12)
    assert off[::100] == pytest.approx(0.1 * np.exp(-np.arange(5.0)) * np.array([1, -1, 1, -1, 1]))
