"""Ships by the MMG method: against an independent plant, mirror images, slopes, quadrants, files."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from bayesid.api.simulate import simulate_model
from bayesid.benchmark.other_equations.causes import settings_of
from bayesid.benchmark.other_equations.mmg_ship import self_propulsion_rps, ship_numbers, ship_rates
from bayesid.benchmark.other_equations.simulate import carried
from bayesid.benchmark.other_equations.vehicles import OtherVehicle, other_vehicle
from bayesid.equations.model import build_model
from bayesid.errors import VehicleError
from bayesid.model.ship_forces import ship_forces
from bayesid.model.terms.mmg import CROSS_FLOW, DEFINITIONS, FORCES, NUMBERS
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed
from bayesid.model.vehicles.reading import BUILTIN_FOLDER, read_vehicle
from bayesid.simulation import plan_run, sensitivities, simulate, steady_start

RPM = 711.1


@pytest.fixture(scope="module")
def ship():
    return build_model(load_vehicle("kvlcc2_mmg"))


def plant() -> OtherVehicle:
    return replace(other_vehicle("tanker_model"), numbers=ship_numbers(7.0), rates=ship_rates)


def test_the_straight_run_is_that_of_the_independent_plant(ship):
    rps = self_propulsion_rps(ship_numbers(7.0), 1.179)
    assert self_propulsion_speed(ship.vehicle, 60 * rps) == pytest.approx(1.179, rel=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("orders", ["turn:35,side=starboard", "turn:35,side=port", "zigzag:20/20"])
def test_tracks_are_those_of_the_independent_plant(ship, orders):
    """Written apart from the table (test_other_equations_plants compares it with a third implementation);
    the rudder moves within a step here and in 20 parts of it there."""
    run = simulate_model(ship, ship.vehicle, (orders,), None, RPM, None, None, 0).runs[0]
    parts, h = 20, float(run.t[1] - run.t[0])
    rudder = np.zeros(parts * (run.t.size - 1) + 1)
    most = ship.vehicle.rates["delta_r"] * h / parts
    for i in range(rudder.size - 1):
        gap = run.commands["delta_r_cmd"][i // parts] - rudder[i]
        rudder[i + 1] = rudder[i] + min(max(gap, -most), most)
    x = np.zeros(12)
    x[6] = run.data["u"][0]
    fine = carried(plant(), settings_of(()), 0.0, x, rudder, np.full(rudder.size, RPM / 60), h / parts)
    at = fine[::parts]
    for name, k, tolerance in (("x", 0, 2e-3), ("y", 1, 2e-3), ("psi", 5, 2e-5), ("u", 6, 1e-5),
                               ("v", 7, 1e-5), ("r", 11, 5e-6)):  # fmt: skip
        assert np.abs(at[:, k] - run.data[name]).max() < tolerance


def test_circles_are_those_of_another_implementation_of_the_method(ship):
    """shipmmg 0.0.11 with the wake of the paper (see test_other_equations_plants), centre of gravity midship,
    35 degrees at once, 1.179 m/s: advance, transfer, tactical diameter over L, then steady u, v, r."""
    b = ship.vehicle
    still = replace(
        b, r_G=(0.0, 0.0, 0.0), Izz=b.mass * (0.25 * b.L) ** 2, rates={**b.rates, "delta_r": np.inf}
    )
    model = build_model(still)
    t = np.arange(0.0, 150.01, 0.05)
    for side, numbers in {
        -1: (2.7411043, 1.2037600, 2.8110835, 0.39694372, -0.13829315, 0.05798065),
        +1: (2.7744290, 1.2150941, 2.8155235, 0.39776822, 0.14052321, -0.05982343),
    }.items():
        rpm = 60 * self_propulsion_rps(ship_numbers(7.0), 1.179)
        orders = {"delta_r_cmd": np.full(t.size, side * np.radians(35)), "n_cmd": np.full(t.size, rpm)}
        x0 = steady_start(model)
        x0[list(model.states).index("u")] = 1.179
        run = simulate(model, model.nominal, plan_run(model, t, orders), x0)
        turned, across = np.abs(run["psi"]), np.abs(run["y"])
        places = [np.interp(np.pi / 2, turned, run["x"]), np.interp(np.pi / 2, turned, across)]
        found = [*np.divide([*places, np.interp(np.pi, turned, across)], 7), *(run[s][-1] for s in "uvr")]
        assert found == pytest.approx(numbers, rel=5e-5)


def test_the_mirrored_ship_runs_the_mirrored_track(ship):
    swap = {"C_2plus": "C_2minus", "gamma_plus": "gamma_minus"}
    values = {a: ship.vehicle.coef[b] for a, b in (swap | {b: a for a, b in swap.items()}).items()}
    mirror = build_model(replace(ship.vehicle, coef=ship.vehicle.coef | values))
    t = np.arange(0.0, 80.0, 0.5)
    both = []
    for model, side in ((ship, 1.0), (mirror, -1.0)):
        rudder = side * np.where(t < 40, 0.5, -0.3)
        plan = plan_run(model, t, {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, RPM)})
        both.append(simulate(model, model.nominal, plan, steady_start(model)))
    for name, sign in {"x": 1, "y": -1, "psi": -1, "u": 1, "v": -1, "r": -1}.items():
        assert both[0][name] == pytest.approx(sign * both[1][name], abs=1e-9)


@pytest.mark.thorough
def test_sensitivities_of_every_number_are_those_of_differences(ship):
    """Central differences of 1e-4 of the number; kinks of wake and flow straightening leave a few 1e-5."""
    t = np.arange(0.0, 60.0, 0.5)
    rudder = 0.4 * np.sign(np.sin(t / 8.0))
    plan = plan_run(ship, t, {"delta_r_cmd": rudder, "n_cmd": np.where(t < 30, RPM, 0.7 * RPM)})
    x0 = steady_start(ship)
    names = [n for n in NUMBERS if n in ship.vehicle.coef] + ["Y_vvr,U", "X_0,U"]
    found = sensitivities(ship, ship.nominal, plan, x0, ship.positions(names), initial=False)
    S = found.jacobian
    for k, name in enumerate(names):
        i, out = ship.index[name], []
        step = 1e-4 * abs(ship.nominal[i])
        for side in (-1, 1):
            par = ship.nominal.copy()
            par[i] += side * step
            run = simulate(ship, par, plan, x0)
            out.append(np.column_stack([run[s] for s in ship.states]))
        slope = (out[1] - out[0]) / (2 * step)
        size = np.abs(slope).max(axis=0) + 1e-9
        assert np.abs((S[:, :, k] - slope) / size).max() < 5e-4, name


def test_formulas_hold_in_four_quadrants_and_at_rest():
    values = {**load_vehicle("kvlcc2_mmg").coef, "rho": 1000.0, "L": 7.0, "U_ref": 1.2, "D_P": 0.216,
              "H_R": 0.345, "A_R": 0.0539, "x_R": -0.5}  # fmt: skip
    u, n = np.meshgrid([-1.0, -1e-9, 0.0, 1e-9, 1.0], [-600.0, 0.0, 600.0])
    f = ship_forces(values, u, v=0.1, r=0.02, delta_r=0.3, n=n)
    assert all(np.isfinite(value).all() for value in f.values())
    assert (f["T"][2] > 0).all() and (f["T"][0] < 0).all()  # thrust has the sign of the revolutions
    # no jump through standstill: a nanometre per second changes nothing
    assert np.ptp(f["propeller X"][:, 1:4], axis=1) == pytest.approx(0.0, abs=1e-5)
    assert np.ptp(f["rudder N"][:, 1:4], axis=1) == pytest.approx(0.0, abs=1e-5)
    # bollard: the race alone turns the ship, to port with rudder to port
    still = ship_forces(values, 0.0, delta_r=0.3, n=600.0)
    assert still["rudder N"] < 0 < still["rudder Y"]
    # race of the momentum theory, u_R^2 = epsilon^2 eta kappa^2 8 T/(pi rho D^2)
    race = 8 * still["T"] / (np.pi * 1000.0 * 0.216**2)
    expected = 1.09 * 0.5 * np.sqrt(0.216 / 0.345 * race)
    assert still["u_R"] == pytest.approx(expected, rel=1e-4)


def test_a_stalled_rudder_pushes_less_and_its_slope_amidships_stays():
    values = {**load_vehicle("kvlcc2_mmg").coef, "rho": 1000.0, "L": 7.0, "U_ref": 1.2, "D_P": 0.216,
              "H_R": 0.345, "A_R": 0.0539, "x_R": -0.5}  # fmt: skip
    stalled = values | {"inverse_stall": 2.0}
    for angle, share in ((1e-4, 1.0), (0.6, 1 / (1 + (2 * np.sin(0.6)) ** 2 / 3))):
        plain, less = (ship_forces(b, 1.2, delta_r=angle, n=600.0)["F_N"] for b in (values, stalled))
        assert less / plain == pytest.approx(share, rel=1e-6)


def test_every_number_acts_in_a_formula_and_no_formula_reads_what_is_not_there():
    text = " ".join([*DEFINITIONS.values(), *(f for f, _ in FORCES.values()), *CROSS_FLOW.values()])
    assert all(name in text for name in NUMBERS)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('model = "mmg"', 'model = "thrust"\nT_ref = 1.0'), "need .propulsion. model"),
        (("k_0 = 0.2931", ""), "k_0 missing"),
        (("planar_only = true", "planar_only = false\nIxx = 1.0\nIyy = 2.0"), "planar_only"),
    ],
)
def test_a_file_that_is_half_a_ship_is_refused(change, says):
    text = (BUILTIN_FOLDER / "kvlcc2_mmg.toml").read_text("utf-8").replace(*change)
    with pytest.raises(VehicleError, match=says):
        read_vehicle(tomllib.loads(text), "ship.toml", None)


@pytest.mark.parametrize("name", ["kvlcc2_mmg", "esso_osaka_mmg"])
def test_a_ship_stops_and_goes_astern_and_starts_from_rest(name):
    """Crash stop with the rudder over, then ahead again from standstill: no simulation leaves its bounds."""
    model = build_model(load_vehicle(name))
    rpm = model.vehicle.rpm_ref
    t = np.arange(0.0, 300.0, 0.5)
    orders = {"delta_r_cmd": np.where(t < 150, 0.6, -0.6), "n_cmd": np.full(t.size, -rpm)}
    run = simulate(model, model.nominal, plan_run(model, t, orders), steady_start(model))
    assert run["u"][0] > 0 > run["u"][-1]
    assert np.abs(run.states[:, 3:5]).max() < 1.5 * run["u"][0]
    assert np.abs(run["r"]).max() < 2.0 * run["u"][0] / model.vehicle.L
    ahead = {"delta_r_cmd": np.full(t.size, 0.6), "n_cmd": np.full(t.size, rpm)}
    start = simulate(model, model.nominal, plan_run(model, t, ahead), 0.0 * steady_start(model))
    assert start["u"][-1] > 0 > start["r"][-1]  # to port, as the rudder


def test_two_screws_and_rudders_stand_in_a_ship_as_one_by_the_factors_of_the_guide():
    """Of the disc area of both, with K_T as a function of its own J: forces are twice those of one, ahead and
    astern; with the larger diameter alone they are not."""
    ship = load_vehicle("esso_osaka_mmg")
    one = {**ship.coef, **ship.propulsion.values, "rho": ship.rho, "L": ship.L, "U_ref": 0.5}
    root = np.sqrt(2.0)
    larger = one | {"D_P": root * one["D_P"], "H_R": root * one["H_R"], "A_R": 2.0 * one["A_R"]}
    both = larger | {"k_0": one["k_0"] / 2.0, "k_1": one["k_1"] / root}
    rng = np.random.default_rng(5)
    u, v, r, rudder = rng.uniform([[-0.3], [-0.1], [-0.1], [-0.6]], [[0.6], [0.1], [0.1], [0.6]], (4, 200))
    n = rng.uniform(-600.0, 900.0, 200)
    single, pair = (ship_forces(values, u, v, r, rudder, n) for values in (one, both))
    for name in ("propeller X", "rudder X", "rudder Y", "rudder N"):
        assert np.abs(single[name]).max() > 0.0
        np.testing.assert_allclose(pair[name], 2.0 * single[name], rtol=1e-9, atol=1e-12)
    at_rest, under_way = (
        [float(ship_forces(values, speed, n=600.0)["propeller X"]) for values in (one, larger)]
        for speed in (0.0, 0.5)
    )
    assert at_rest[1] == pytest.approx(4.0 * at_rest[0])
    assert under_way[1] > 4.05 * under_way[0]
