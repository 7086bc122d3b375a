"""Vehicles: values, conventions, dialects and round trips. Faulty files are in test_vehicle_files.py."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from bayesid.errors import VehicleError
from bayesid.model.terms import TERMS, alias, term
from bayesid.model.vehicles import (
    GRAVITY,
    added_mass,
    builtin_names,
    coef_si,
    identified,
    load_vehicle,
    prime_scale,
    rigid_body_mass,
    write_vehicle,
)
from bayesid.model.vehicles.convention import (
    complete_from_fossen,
    moving_with,
    munk_and_coriolis,
    rudder_to_port,
)
from bayesid.model.vehicles.inertia import planar_part
from bayesid.model.vehicles.orders import has_rudder
from bayesid.model.vehicles.reading import BUILTIN_FOLDER, read_vehicle
from bayesid.model.vehicles.sufficient import lacking
from bayesid.model.vehicles.writing import vehicle_toml

EVERY = pytest.mark.parametrize("name", builtin_names())
PLAIN = """
[vehicle]
name = "test"
nondimensional = false
rho = 1000.0
L = 2.0
mass = 80.0
W_equals_B = true
Ixx = 2.0
Iyy = 40.0
Izz = 40.0
r_G = [0.0, 0.0, 0.05]
{head}
[propulsion]
model = "thrust"
T_ref = 10.0
rpm_ref = 300.0
[coef]
"X_u|u|" = -6.0
X_udot = -2.0
Y_vdot = -60.0
Z_wdot = -60.0
N_rdot = -14.0
M_qdot = -14.0
K_pdot = -0.5
Y_v = -50.0
N_v = 4.5
Y_r = 12.0
N_r = -30.0
Y_dr = 18.0
N_dr = -18.0
{tail}
"""


def read(head="", tail="", folder=None):
    return read_vehicle(tomllib.loads(PLAIN.format(head=head, tail=tail)), "test.toml", folder)


def test_built_in_sets_are_these():
    assert set(builtin_names()) == {
        "delphin2",
        "differential_boat",
        "esso_osaka_mmg",
        "generic_sub",
        "kvlcc2_mmg",
        "lauv",
        "nps_auv2",
        "remus100",
        "six_thruster_rov",
        "suboff_full",
    }


@EVERY
def test_built_in_values_are_those_of_the_file(name):
    data = tomllib.loads((BUILTIN_FOLDER / f"{name}.toml").read_text("utf-8"))
    vehicle = load_vehicle(name)
    stated = {key: float(value) for key, value in data["coef"].items()}
    derived = data["vehicle"].get("convention") == "fossen"  # Coriolis rows follow from the added mass
    assert stated.items() <= vehicle.coef.items() and (derived or stated.keys() == vehicle.coef.keys())
    assert vehicle.W == vehicle.B == vehicle.mass * GRAVITY
    most = data.get("control", {}).get("dr_max_deg", np.inf)
    assert np.degrees(vehicle.limits["delta_r"]) == pytest.approx(most)


@pytest.mark.parametrize("name", ["differential_boat", "six_thruster_rov", "kvlcc2_mmg", "esso_osaka_mmg"])
def test_vehicles_without_rows_of_a_rudder_are_not_told_to_have_one(name):
    told = [text for texts in lacking(load_vehicle(name)).values() for text in texts]
    assert not any("rudder does not turn" in text or "damps" in text for text in told)
    assert has_rudder(load_vehicle(name)) == name.endswith("mmg")
    finless = replace(
        load_vehicle("lauv"), coef={k: v for k, v in load_vehicle("lauv").coef.items() if k != "N_dr"}
    )
    assert any("rudder does not turn" in text for text in lacking(finless)["fit"])  # control


@EVERY
def test_total_mass_matrix_is_positive_definite_and_nearly_symmetric(name):
    vehicle = load_vehicle(name)
    total = rigid_body_mass(vehicle) + added_mass(vehicle)
    total = planar_part(total) if vehicle.planar_only else total
    assert np.linalg.eigvalsh(0.5 * (total + total.T))[0] > 0.0


def test_rigid_body_mass_gives_the_kinetic_energy_of_particles():
    """Independent: 1/2 nu' M nu = sum of 1/2 m |v + omega x r|^2 over eight particles."""
    rng = np.random.default_rng(3)
    mass, place = rng.uniform(1.0, 2.0, 8), rng.normal(size=(8, 3))
    square = np.einsum("i,ij,ik->jk", mass, place, place)
    tensor = np.trace(square) * np.eye(3) - square
    body = replace(
        load_vehicle("lauv"),
        mass=mass.sum(),
        r_G=tuple(mass @ place / mass.sum()),
        Ixx=tensor[0, 0],
        Iyy=tensor[1, 1],
        Izz=tensor[2, 2],
        Ixy=square[0, 1],
        Ixz=square[0, 2],
        Iyz=square[1, 2],
    )
    nu = rng.normal(size=6)
    speed = nu[:3] + np.cross(nu[3:], place)
    assert 0.5 * nu @ rigid_body_mass(body) @ nu == pytest.approx(
        0.5 * mass @ (speed**2).sum(axis=1), rel=1e-13
    )


def test_prime_values_scale_with_the_power_of_length_of_their_row():
    boat = load_vehicle("generic_sub")
    half = 0.5 * 1025.0
    assert prime_scale(boat, "Y_v") == pytest.approx(half * 102.2615**2)
    assert prime_scale(boat, "N_rdot") == pytest.approx(half * 102.2615**5)
    assert coef_si(boat)["N_r"] == pytest.approx(half * 102.2615**4 * -0.005324)
    assert prime_scale(boat, "X_prop_un") == 1.0
    assert all(prime_scale(load_vehicle("lauv"), row) == 1.0 for row in TERMS)


def test_prime_rows_that_are_not_quadratic_need_a_reference_speed():
    data = tomllib.loads((BUILTIN_FOLDER / "generic_sub.toml").read_text("utf-8"))
    data["coef"]["N_vvv"] = -0.03
    with pytest.raises(VehicleError, match=r"U_ref .* N_vvv"):
        read_vehicle(data, "ship.toml", None)
    data["vehicle"]["U_ref"] = 4.0
    ship = read_vehicle(data, "ship.toml", None)
    assert coef_si(ship)["N_vvv"] == pytest.approx(-0.03 * 0.5 * 1025.0 * 102.2615**3 / 4.0)


SECTION_7 = {
    "X_vr": "-Y_vdot",
    "X_rr": "-Y_rdot",
    "X_wq": "+Z_wdot",
    "X_qq": "+Z_qdot",
    "X_rp": "-Y_pdot",
    "Y_wp": "-Z_wdot",
    "Y_pq": "-Z_qdot",
    "Y_r": "+X_udot",
    "Z_vp": "+Y_vdot",
    "Z_rp": "+Y_rdot",
    "Z_pp": "+Y_pdot",
    "Z_q": "-X_udot",
    "K_vw": "+Z_wdot-Y_vdot",
    "K_vq": "+Y_rdot+Z_qdot",
    "K_wr": "-Y_rdot-Z_qdot",
    "K_wp": "-Y_pdot",
    "K_qr": "+N_rdot-M_qdot",
    "K_pq": "+K_rdot",
    "M_w": "-Z_wdot+X_udot",
    "M_q": "-Z_qdot",
    "M_vp": "-Y_rdot",
    "M_vr": "+Y_pdot",
    "M_rp": "+K_pdot-N_rdot",
    "M_rr": "+K_rdot",
    "M_pp": "-K_rdot",
    "N_v": "+Y_vdot-X_udot",
    "N_r": "+Y_rdot",
    "N_p": "+Y_pdot",
    "N_wp": "+Z_qdot",
    "N_vq": "-Y_pdot",
    "N_pq": "+M_qdot-K_pdot",
    "N_qr": "-K_rdot",
}
PAIRS = {"Y_rdot": "N_vdot", "Z_qdot": "M_wdot", "Y_pdot": "K_vdot", "K_rdot": "N_pdot"}


def test_added_mass_brings_exactly_the_rows_of_potential_flow():
    """The list derived by hand for an x-z symmetric body; every other row stays at zero."""
    rng = np.random.default_rng(0)
    inertia = {row.name: float(rng.normal()) for row in TERMS if row.is_inertia}
    inertia |= {recovery: inertia[name] for name, recovery in PAIRS.items()}
    expected = {row: eval(formula, {}, inertia) for row, formula in SECTION_7.items()}
    assert munk_and_coriolis(inertia) == pytest.approx(expected)


def test_added_mass_coriolis_does_no_work():
    rng = np.random.default_rng(1)
    inertia = {row.name: float(rng.normal()) for row in TERMS if row.is_inertia}
    extra = munk_and_coriolis(inertia)
    for _ in range(20):
        nu = dict(zip("uvwpqr", rng.normal(size=6), strict=True))
        power = sum(
            value * eval(term(name).regressor, {}, nu) * nu["uvwpqr"["XYZKMN".index(name[0])]]
            for name, value in extra.items()
        )
        assert power == pytest.approx(0.0, abs=1e-13)


def test_rows_that_move_with_freed_added_masses_are_those_kirchhoffs_equations_give():
    """N_v = Y_vdot - X_udot and X_vr = -Y_vdot move, N_r does not; equal added masses cancel for no row."""
    assert set(moving_with(["X_udot", "Y_vdot"])) >= {"N_v", "X_vr", "Y_r"}
    assert "N_r" not in moving_with(["X_udot", "Y_vdot", "N_rdot"])
    assert moving_with([]) == ()
    for name in ("Y_vdot", "Z_wdot"):
        moved = munk_and_coriolis({"X_udot": -1.0, "Y_vdot": -2.0, "Z_wdot": -5.0})
        more = munk_and_coriolis({"X_udot": -1.0, "Y_vdot": -2.0, "Z_wdot": -5.0, name: -3.0})
        changed = {k for k in more if more[k] != moved.get(k)}
        assert changed == set(moving_with([name]))


def test_fossen_sets_are_completed_on_load():
    """Delphin2: N_v = +4.5 apart from added mass becomes about -54 with its Munk moment."""
    vehicle = read('convention = "fossen"')
    assert vehicle.coef["N_v"] == 4.5 - 60.0 + 2.0
    assert vehicle.coef["Y_r"] == 12.0 - 2.0
    assert vehicle.coef["X_vr"] == 60.0
    assert vehicle.coef["Y_v"] == -50.0
    assert read().coef["N_v"] == 4.5


def test_a_row_that_only_the_convention_gives_is_known_as_such_and_changes_no_digest():
    completed = read('convention = "fossen"')
    assert "X_vr" in completed.completed and "N_v" not in completed.completed  # N_v is stated, and completed
    assert read().completed == ()
    assert replace(completed, completed=()).digest == completed.digest


def test_starboard_rudder_is_turned_and_nothing_else():
    port, starboard = read().coef, read('rudder_positive = "starboard"').coef
    assert starboard["N_dr"] == 18.0
    assert starboard["Y_dr"] == -18.0
    changed = {name for name in port if port[name] != starboard[name]}
    assert changed == {"Y_dr", "N_dr"}
    assert rudder_to_port(rudder_to_port(port)) == port


def test_a_covariance_follows_both_conversions():
    """Monte Carlo free: y = A x is linear, so the covariance is A S A' (here by numerical perturbation)."""
    names = ["N_v", "Y_vdot", "N_dr"]
    spread = np.array([[1.0, 0.4, 0.2], [0.4, 9.0, -0.5], [0.2, -0.5, 4.0]])
    tail = f"[prior]\nrelative_sd = 0.1\ncovariance = {{names = {names}, matrix = {spread.tolist()}}}"
    prior = read('convention = "fossen"\nrudder_positive = "starboard"', tail).prior
    at = {name: i for i, name in enumerate(prior.names)}
    found = prior.covariance
    # N_v' = N_v + Y_vdot - X_udot, N_dr' = -N_dr, X_vr' = -Y_vdot; X_udot has sd 0.2
    assert found[at["N_v"], at["N_v"]] == pytest.approx(1.0 + 9.0 + 2 * 0.4 + 0.2**2)
    assert found[at["N_v"], at["N_dr"]] == pytest.approx(-(0.2 - 0.5))
    assert found[at["X_vr"], at["Y_vdot"]] == pytest.approx(-9.0)
    assert prior.relative_sd["Y_v"] == pytest.approx(0.1)


def test_relative_sd_holds_for_all_or_for_those_named():
    assert read(tail="[prior]\nrelative_sd = 0.2").prior.relative_sd == dict.fromkeys(read().coef, 0.2)
    some = read(tail="[prior.relative_sd]\nYv = 0.2\nN_dr = 0.1").prior.relative_sd
    assert some == {"Y_v": 0.2, "N_dr": 0.1}
    assert read().prior is None


def test_other_spellings_are_read_in_every_table():
    text = PLAIN.format(head="", tail="").replace('"X_u|u|"', "Xuau").replace("Y_vdot", "Yvdot")
    assert read_vehicle(tomllib.loads(text), "t", None).coef == read().coef
    text = PLAIN.format(head='dialect = "prestero"', tail="").replace('"X_u|u|"', "Xuu")
    assert read_vehicle(tomllib.loads(text), "t", None).coef == read().coef


@EVERY
def test_a_written_vehicle_reads_back_the_same(name, tmp_path):
    vehicle = load_vehicle(name)
    again = load_vehicle(write_vehicle(vehicle, tmp_path / "out.toml"))
    assert again == vehicle
    assert again.digest == vehicle.digest


def test_an_identified_vehicle_keeps_values_covariance_and_sources(tmp_path):
    boat = load_vehicle("generic_sub")
    names, rng = ["N_v", "Y_v|v|", "X_rr"], np.random.default_rng(2)
    root = rng.normal(size=(3, 3))
    values = {"N_v": -6e4, "Y_v|v|": -3e5, "X_rr": -2e6, "X_prop_un": -500.0}
    scale = np.array([prime_scale(boat, name) for name in names])
    covariance = (root @ root.T) * np.outer(scale, scale)
    found = identified(boat, values, source="fit of trial 'pond'", names=names, covariance=covariance)
    again = load_vehicle(write_vehicle(found, tmp_path / "fit.toml"))
    assert again == found
    assert again.prior.names == tuple(names)
    np.testing.assert_allclose(again.prior.covariance, root @ root.T, rtol=1e-12)
    si = coef_si(again)
    assert [si[name] for name in values] == pytest.approx(list(values.values()), rel=1e-14)
    assert si["X_prop_n|n|"] == coef_si(boat)["X_prop_n|n|"]
    assert again.sources["N_v"] == "fit of trial 'pond'"
    assert again.digest != boat.digest


def test_a_second_fit_keeps_what_the_first_one_knew():
    first = identified(read(), {"N_v": 1.0}, source="a", names=["N_v"], covariance=np.array([[4.0]]))
    second = identified(first, {"Y_v": -1.0}, source="b", names=["Y_v"], covariance=np.array([[9.0]]))
    assert second.prior.names == ("Y_v", "N_v")
    np.testing.assert_array_equal(second.prior.covariance, np.diag([9.0, 4.0]))


def test_text_with_every_awkward_character_survives_writing():
    text = 'quote " back \\ tab \t newline \n bell \x07 delete \x7f line \u2028 ship \U0001f6a2 \U000e0001'
    vehicle = replace(load_vehicle("lauv"), name=text, sources={"Y_v": text})
    again = read_vehicle(tomllib.loads(vehicle_toml(vehicle, "c.npz")), "t", None)
    assert again.name == text
    assert again.sources == {"Y_v": text}


def test_digest_ignores_spelling_and_order_but_no_number():
    text = PLAIN.format(head="", tail="")
    plain = read_vehicle(tomllib.loads(text), "t", None).digest
    other = read_vehicle(tomllib.loads(text.replace("Y_dr = 18.0", "Ydelta = 18")), "t", None).digest
    moved = read_vehicle(tomllib.loads(text.replace("Y_dr = 18.0", "Y_dr = 18.000001")), "t", None).digest
    assert plain == other
    assert plain != moved


def test_every_row_can_be_given_in_a_file_under_its_ascii_key():
    data = tomllib.loads(PLAIN.format(head="", tail=""))
    rows = [row.name for row in TERMS if row.group in ("base", "eta") and not row.is_inertia]
    data["coef"] = {alias(name): -1.0 for name in rows}
    assert set(read_vehicle(data, "t", None).coef) == set(rows)


def test_a_file_without_conversion_is_unchanged_by_completion_of_zero_added_mass():
    assert complete_from_fossen({"Y_v": -1.0}) == {"Y_v": -1.0}
