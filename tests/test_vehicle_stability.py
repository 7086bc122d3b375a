"""Stability indices, eigenvalues and findings of the built-in sets against independent numbers."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vehicle_sets import ROW_SETS

from bayesid.errors import VehicleError
from bayesid.model.vehicles import (
    Propulsion,
    check_vehicle,
    load_vehicle,
    self_propulsion_speed,
    stability,
    usual_speed,
)
from bayesid.model.vehicles.units_check import added_mass_out_of_proportion

REFERENCE = json.loads((Path(__file__).parent / "data" / "reference_stability.json").read_text("utf-8"))
EVERY = pytest.mark.parametrize("name", ROW_SETS)


@EVERY
def test_every_built_in_set_has_a_reference(name):
    assert name in REFERENCE


@EVERY
def test_horizontal_index_agrees_with_the_planar_simulator(name):
    """1e-4, relative above 1: the reference differenced at 1e-6 m/s, where v|v| moves the REMUS by 6e-5."""
    reference = REFERENCE[name]
    assert pytest.approx(reference["G_H"], rel=1e-4, abs=1e-4) == stability(load_vehicle(name)).G_H


@EVERY
def test_eigenvalues_agree_with_the_planar_simulator(name):
    found = [value.real for value in stability(load_vehicle(name)).horizontal]
    assert found == pytest.approx(sorted(REFERENCE[name]["eig_xL_over_U"], reverse=True), abs=1e-4)


@EVERY
def test_self_propulsion_speed_agrees_with_a_simulated_straight_run(name):
    vehicle, reference = load_vehicle(name), REFERENCE[name]
    assert vehicle.rpm_ref == reference["rpm"]
    assert self_propulsion_speed(vehicle, reference["rpm"]) == pytest.approx(reference["U0"], rel=1e-5)


def test_vertical_index_of_suboff_is_the_printed_one():
    """Roddy 1990 prints G_V = -1.163 and G_H = -0.443 for the fully appended model."""
    result = stability(load_vehicle("suboff_full"))
    assert pytest.approx(-1.163, abs=5e-4) == result.G_V
    assert pytest.approx(-0.443, abs=5e-4) == result.G_H


def test_rows_without_u_make_the_index_depend_on_speed():
    lauv = load_vehicle("lauv")
    assert pytest.approx(0.671, abs=5e-4) == stability(lauv).G_H
    assert stability(lauv, 3.0).G_H < stability(lauv, 1.0).G_H


@EVERY
def test_index_is_positive_exactly_where_every_eigenvalue_decays(name):
    result = stability(load_vehicle(name))
    assert (result.G_H > 0.0) == all(value.real < 0.0 for value in result.horizontal)


def test_vertical_eigenvalues_solve_the_linear_equations():
    """Second route: differentiate w and q dynamics numerically from the coefficients, with hydrostatics."""
    vehicle = load_vehicle("generic_sub")
    result = stability(vehicle)
    f2, f3, f4, f5 = (0.5 * vehicle.rho * vehicle.L**k for k in (2, 3, 4, 5))
    c, U, m = vehicle.coef, result.U, vehicle.mass
    inertia = np.array(
        [[m - f3 * c["Z_wdot"], -f4 * c["Z_qdot"]], [-f4 * c["M_wdot"], vehicle.Iyy - f5 * c["M_qdot"]]]
    )
    force = np.array(
        [
            [f2 * c["Z_w"] * U, (f3 * c["Z_q"] + m) * U, 0.0],
            [f3 * c["M_w"] * U, f4 * c["M_q"] * U, -vehicle.r_G[2] * vehicle.W],
        ]
    )
    matrix = np.vstack([np.linalg.solve(inertia, force), [0.0, 1.0, 0.0]])
    expected = np.sort_complex(np.linalg.eigvals(matrix) * vehicle.L / U)
    np.testing.assert_allclose(np.sort_complex(np.array(result.vertical)), expected, rtol=1e-9)


def test_a_boat_without_drag_has_no_speed_of_its_own():
    remus = load_vehicle("remus100")
    coef = {name: value for name, value in remus.coef.items() if name != "X_u|u|"}
    with pytest.raises(VehicleError, match="exceeds drag"):
        usual_speed(replace(remus, coef=coef))


@EVERY
def test_a_built_in_set_has_no_warning(name):
    warnings = [finding.text for finding in check_vehicle(load_vehicle(name)) if finding.level == "warning"]
    assert warnings == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"coef": {"Y_v": 0.03}}, "Y_v = 0.03 is positive; damping"),
        ({"coef": {"N_r": 0.004}}, "N_r"),
        ({"coef": {"N_dr": 0.004}}, "stern rudder"),
        ({"coef": {"Y_vdot": 0.01}}, "added mass should be negative"),
        ({"coef": {"X_uu": -0.001}}, "adds it again"),
        ({"coef": {"Y_vdot": 0.03}}, "not positive"),
        ({"B": 2e8}, "times m g"),
        ({"r_G": (0.0, 0.0, -0.3)}, "unstable in roll"),
        ({"Izz": 1.5e10}, "belong to no rigid body"),
        ({"uc_per_rpm": 10.0}, "lengths per second"),
        ({"a": -0.002}, r"a \+ b \+ c should be 0"),
        ({"mass": 2e12}, "more than a solid block as wide as it is long"),
        ({"mass": 100.0}, "less than the slenderest boat"),
        ({"Izz": 1e8}, "Izz .* radius of gyration of .* about 0.25 is usual"),
        ({"coef": {"Y_dr": -0.006}}, "puts the rudder at x = .* ahead of the origin"),
        ({"coef": {"M_ds": -0.02}}, "puts the stern planes at x = .* than the vehicle is long"),
    ],
)
def test_an_unphysical_number_is_found(change, words):
    boat = load_vehicle("generic_sub")
    values = boat.propulsion.values
    if "coef" in change:
        boat = replace(boat, coef=boat.coef | change["coef"])
    elif set(change) <= set(values):
        boat = replace(boat, propulsion=Propulsion("polynomial", values | change))
    else:
        boat = replace(boat, **change)
    found = [finding.text for finding in check_vehicle(boat) if finding.level == "warning"]
    assert any(re.search(words, text) for text in found), found


@pytest.mark.parametrize(
    ("number", "words"),
    [
        ("X_0,U", "resistance ahead should be negative"),
        ("t_P", "thrust deduction should be positive"),
        ("w_P0", "wake fraction at the propeller should be positive"),
    ],
)
def test_an_unphysical_number_of_a_ship_is_found(number, words):
    ship = load_vehicle("kvlcc2_mmg")
    ship = replace(ship, coef=ship.coef | {number: -ship.coef[number]})
    assert [words in f.text for f in check_vehicle(ship) if f.rows == (number,)] == [True]


def test_a_torque_of_the_propeller_stated_twice_is_a_warning():
    boat = load_vehicle("remus100")
    assert boat.propulsion.values["Q_ref"] != 0.0
    twice = replace(boat, coef=boat.coef | {"K_*": -1e-4})
    told = [[f.text for f in check_vehicle(b) if "counts twice" in f.text] for b in (twice, boat)]
    assert len(told[0]) == 1 and told[0][0].startswith("Q_ref and K_* both") and told[1] == []


def test_an_unstable_boat_and_missing_coupling_are_notes_not_warnings():
    texts = " ".join(finding.text for finding in check_vehicle(load_vehicle("suboff_full")))
    assert "G_H = -0.443" in texts
    assert "G_V = -1.163" in texts
    assert "Y_wp" in texts
    assert "no [prior]" in texts


def test_stability_of_a_boat_at_rest_is_refused():
    with pytest.raises(VehicleError, match="positive speed"):
        stability(load_vehicle("lauv"), 0.0)
    with pytest.raises(VehicleError, match="positive speed"):
        stability(load_vehicle("lauv"), math.nan)


def test_thrust_that_falls_with_speed_is_not_taken_for_hull_drag():
    """A fitted propeller has X_prop_u|u| < 0 beside X_u|u|; polynomial and nps alone hold the drag."""
    values = {"X_prop_u|u|": -1.0, "X_prop_un": 0.0, "X_prop_n|n|": 2e-6, "X_prop_n": 0.0, "rpm_ref": 1500.0}
    boat = replace(load_vehicle("remus100"), propulsion=Propulsion("quadratic", values))
    assert not [finding for finding in check_vehicle(boat) if finding.level == "warning"]


PRIME, SI = ("suboff_full", "generic_sub", "nps_auv2"), ("remus100", "lauv", "delphin2")


@pytest.mark.parametrize("name", [*PRIME, *SI])
def test_added_mass_in_other_units_than_stated_is_told_with_the_reason(name):
    """Either way round: SI rows under `nondimensional = true`, and prime ones under `false`."""
    vehicle = load_vehicle(name)
    other = replace(vehicle, nondimensional=not vehicle.nondimensional, U_ref=1.6)
    text, rows = added_mass_out_of_proportion(other)
    assert "Y_vdot" in rows
    assert f"is `nondimensional = {str(vehicle.nondimensional).lower()}` meant?" in text
    warnings = [finding for finding in check_vehicle(other) if finding.level == "warning"]
    assert any(finding.text == text and finding.rows == rows for finding in warnings)
    assert added_mass_out_of_proportion(vehicle) is None  # control


@pytest.mark.parametrize(("times", "odd"), [(8.5, False), (12.0, True)])
def test_added_mass_of_a_flat_disc_passes_and_more_does_not(times, odd):
    """A disc ten times as wide as thick has 8.5 times its mass in heave; no other units explain 12 times."""
    remus = load_vehicle("remus100")
    found = added_mass_out_of_proportion(replace(remus, coef=remus.coef | {"Z_wdot": -times * remus.mass}))
    assert (found is not None) == odd
    if found is not None:
        assert found[1] == ("Z_wdot",) and "12 times mass" in found[0] and "meant?" not in found[0]


@pytest.mark.parametrize(("stated", "word"), [(0.1, "too small"), (1.0, ""), (4.0, ""), (16.0, "too large")])
def test_a_speed_at_rpm_ref_far_from_the_stated_one_is_told(stated, word):
    remus = replace(load_vehicle("remus100"), U_ref=stated)
    texts = [f.text for f in check_vehicle(remus) if f.level == "warning"]
    assert bool(texts) == bool(word), texts
    if word:
        assert "runs at 1.54 m/s at rpm_ref" in texts[0]
        assert f"U_ref = {stated:g} m/s" in texts[0] and word in texts[0]
