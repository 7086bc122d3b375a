"""A run in a current begins straight: carried by the water, not at rest beside it."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.manoeuvres import OpenLoop
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed
from bayesid.simulation import carried_by_water, plan_run, simulate, steady_start
from bayesid.simulation.virtual_trial import virtual_run

CURRENT = {"ocean_current.V_north": 0.3, "ocean_current.V_east": -0.4}


@pytest.fixture(scope="module", params=["generic_sub", "nps_auv2"])
def model(request):
    return build_model(load_vehicle(request.param), 3)


def straight(model, seconds=60.0):
    t = np.arange(0.0, seconds, 0.5)
    rpm = model.vehicle.rpm_ref
    return OpenLoop("straight", t, {"delta_r_cmd": np.zeros(t.size), "n_cmd": np.full(t.size, rpm)})


@pytest.mark.thorough
def test_amidships_a_vehicle_keeps_its_heading_and_is_set_by_the_current(model):
    order = straight(model)
    run = virtual_run(model, model.with_values(CURRENT), order, name="s")
    speed = self_propulsion_speed(model.vehicle, model.vehicle.rpm_ref)
    assert np.abs(run.data["psi"]).max() < 1e-6
    assert run.data["x"] == pytest.approx((speed + 0.3) * run.t, rel=1e-4, abs=1e-4)
    assert run.data["y"] == pytest.approx(-0.4 * run.t, rel=1e-4, abs=1e-4)


def test_begun_at_rest_beside_the_water_it_swings(model):
    """The control: what runs began with before."""
    order = straight(model)
    plan = plan_run(model, order.t, order.commands)
    swung = simulate(model, model.with_values(CURRENT), plan, steady_start(model)).states
    assert np.abs(swung[:, model.states.index("psi")]).max() > 0.02


def test_the_water_is_taken_up_on_every_heading_and_without_the_sensors(model):
    for heading in (0.0, 1.0, -2.5):
        still = steady_start(model, heading=heading)
        begun = carried_by_water(model, model.with_values({**CURRENT, "velocity_scale.scale": 0.1}), still)
        u, v = (begun[model.states.index(k)] - still[model.states.index(k)] for k in "uv")
        north = u * np.cos(heading) - v * np.sin(heading)
        east = u * np.sin(heading) + v * np.cos(heading)
        assert (north, east) == pytest.approx((0.3, -0.4), abs=1e-12)


def test_without_a_current_nothing_changes(model):
    still = steady_start(model)
    assert carried_by_water(model, model.nominal, still) is still
