"""Wind on a ship: directions, still air, the centre of pressure, measured wind as an input."""

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start

SPEED = 3.0


@pytest.fixture(scope="module")
def ship():
    return build_model(load_vehicle("esso_osaka_mmg"))


def acceleration(ship, values, wind=None):
    """Force over mass of wind on a ship at rest [m/s^2, m/s^2, rad/s^2], from half a second of motion."""
    t = np.array([0.0, 0.05])
    measured = None if wind is None else {k: np.full(2, v) for k, v in wind.items()}
    plan = plan_run(ship, t, {"delta_r_cmd": np.zeros(2), "n_cmd": np.zeros(2)}, exogenous=measured)
    x0 = 0.0 * steady_start(ship)
    both = [simulate(ship, ship.with_values(v), plan, x0, full=True) for v in (values, {})]
    return np.array([(both[0][s][-1] - both[1][s][-1]) / 0.05 for s in ("u", "v", "r")])


def blowing(come):
    """Wind from `come` degrees on the bow, the ship heading north."""
    angle = np.radians(come + 180.0)
    return {"wind.blowing_north": SPEED * np.cos(angle), "wind.blowing_east": SPEED * np.sin(angle)}


@pytest.mark.thorough
def test_a_beam_wind_pushes_as_the_table_says(ship):
    """Y = rho/2 A_L C_D V^2, drag of a loaded tanker abeam 0.70; accelerations in closed form."""
    _, sway, _ = acceleration(ship, blowing(90.0))
    index, par = ship.index, ship.nominal
    force = 0.5 * 1.2 * 0.52038 * 0.70 * SPEED**2
    m, x_G = par[index["m"]], par[index["x_G"]]
    mass = np.array(
        [[m - par[index["Y_vdot"]], m * x_G], [m * x_G, par[index["Izz"]] - par[index["N_rdot"]]]]
    )
    expected = np.linalg.solve(
        mass, [-force, 0.01299 * force]
    )  # from starboard: pushed to port, behind midship
    assert sway == pytest.approx(expected[0], rel=2e-3)


def test_the_bow_is_pushed_by_wind_from_ahead_and_the_stern_by_wind_from_astern(ship):
    """From the starboard bow the moment is to port, from the quarter to starboard."""
    _, sway_bow, turn_bow = acceleration(ship, blowing(45.0))
    _, sway_quarter, turn_quarter = acceleration(ship, blowing(135.0))
    assert sway_bow < 0 and sway_quarter < 0
    assert turn_bow < 0 < turn_quarter


def test_directions_mirror(ship):
    one, two = acceleration(ship, blowing(60.0)), acceleration(ship, blowing(-60.0))
    offset = ship.nominal[ship.index["x_G"]]
    assert offset > 0
    assert one == pytest.approx(two * [1, -1, -1], rel=1e-6)


def test_measured_wind_with_its_gain_and_the_zero_of_its_vane_is_the_same_wind(ship):
    known = acceleration(ship, blowing(70.0))
    measured = {"wind_speed": SPEED / 0.8, "wind_from": np.radians(70.0 - 10.0)}
    found = acceleration(ship, {"wind.gain": 0.8, "wind.vane_zero": np.radians(10.0)}, measured)
    assert found == pytest.approx(known, rel=1e-6)
    assert acceleration(ship, {}, measured) == pytest.approx(np.zeros(3), abs=1e-15)  # unread unless asked
    half = acceleration(ship, {"wind.gain": 0.4, "wind.vane_zero": np.radians(10.0)} | {
        k: 0.5 * v for k, v in blowing(70.0).items()}, measured)  # fmt: skip
    assert half == pytest.approx(known, rel=1e-6)  # the mean beyond the measured is in the same place


def drifted(ship, values, wind=None):
    """State of a ship after a minute at 600 rpm, from rest."""
    t = np.arange(0.0, 60.0, 0.5)
    measured = None if wind is None else {k: np.full(t.size, v) for k, v in wind.items()}
    orders = {"delta_r_cmd": np.full(t.size, 0.1), "n_cmd": np.full(t.size, 600.0)}
    plan = plan_run(ship, t, orders, exogenous=measured)
    return simulate(ship, ship.with_values(values), plan, 0.0 * steady_start(ship), full=True).states[-1]


def test_water_that_the_wind_moves_is_a_current_of_its_share():
    """The same motion as with a current of 0.01 times the wind, told or measured; without it, metres away."""
    ship, blows, share = build_model(load_vehicle("esso_osaka_mmg")), blowing(70.0), {"wind.water": 0.01}
    north, east = blows.values()
    current = {"ocean_current.V_north": 0.01 * north, "ocean_current.V_east": 0.01 * east}
    apart = drifted(ship, blows | current)
    assert drifted(ship, blows | share) == pytest.approx(apart, rel=1e-9)
    measured = {"wind_speed": SPEED / 0.8, "wind_from": np.radians(70.0 - 10.0)}
    taken = {"wind.gain": 0.8, "wind.vane_zero": np.radians(10.0)}
    assert drifted(ship, taken | share, measured) == pytest.approx(apart, rel=1e-6)
    assert np.hypot(*(drifted(ship, blows) - apart)[:2]) > 0.5


def test_other_vehicles_keep_their_wind():
    names = build_model(load_vehicle("remus100"), 3).effects["wind"].parameters
    assert [p.name for p in names] == [
        "blowing_north", "blowing_east", "area_coefficients", "front", "centre", "centre_moves"
    ]  # fmt: skip
