"""What every force and mass effect does to the hull, written out by hand in numpy and compared at a point.

Expected values: the formulas of this file, from the sources the declarations name; they share nothing with
the declarations but names of parameters. Effects between command and actuator and in the sensors, which are
one-liners, are compared with the plant in `test_plant_effects`.
"""

import numpy as np
import pytest
from plain_kernel import equations, equations_with
from reference_motion import rotation
from test_physics_equations import random_point

from bayesid.benchmark.plant.body import build
from bayesid.benchmark.plant.settings import settings
from bayesid.equations.layout import KernelSpec
from bayesid.equations.model import build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.alternatives import ALTERNATIVES, of
from bayesid.model.effects.describe import alternatives, describe
from bayesid.model.effects.describe import equations as lines_of
from bayesid.model.vehicles import load_vehicle

BY_NAME = {e.name: e for e in (*CATALOGUE, *ALTERNATIVES)}
SIX = KernelSpec(6)
T = 37.0


class Point:
    """Random state, inputs and parameters of six degrees of freedom; attributes by name."""

    def __init__(self, name, seed=0, spec=SIX):
        kernel = equations_with(spec, (name,))
        x, self.act, self.exo, self.par = random_point(kernel, np.random.default_rng(seed), effects_on=False)
        self.exo[[i for i, n in enumerate(kernel.exogenous) if n.startswith("flow")]] = 0.0
        self.kernel, self.x = kernel, x
        self.index = {n: i for i, n in enumerate(kernel.parameters)}
        for p in BY_NAME[name].parameters:
            self.par[self.index[BY_NAME[name].key(p.name)]] = p.off
        self.named = dict(zip(kernel.states, x, strict=True))
        self.named |= dict(zip(kernel.actuators, self.act, strict=True))
        self.named |= dict(zip(kernel.exogenous, self.exo, strict=True))

    def __getattr__(self, name):
        return self.named[name] if name in self.named else self.par[self.index[name]]

    def coef(self, name):
        return self.par[self.index[name]]

    def change(self, name, values):
        """Wrench with the effect less wrench without."""
        par = self.par.copy()
        for key, value in values.items():
            par[self.index[f"{name}.{key}"]] = value
        at = self.kernel
        return at.forces(self.x, self.act, self.exo, T, par) - at.forces(
            self.x, self.act, self.exo, T, self.par
        )


def at(place, force):
    """Wrench of a force at a place of the hull."""
    return np.concatenate([force, np.cross(place, force)])


def rudder(s):
    """Side force and moment of the rudder rows."""
    out = np.zeros(6)
    for i, axis in ((1, "Y"), (5, "N")):
        out[i] = s.coef(f"{axis}_dr") * s.u**2 * s.delta_r
        out[i] += s.coef(f"{axis}_|r|dr") * s.u * abs(s.r) * s.delta_r
        out[i] += s.coef(f"{axis}_drdrdr") * s.u**2 * s.delta_r**3
        out[i] += (s.coef(f"{axis}_vdrdr") * s.v + s.coef(f"{axis}_rdrdr") * s.r) * s.u * s.delta_r**2
        out[i] += (s.coef(f"{axis}_vvdr") * s.v**2 + s.coef(f"{axis}_rrdr") * s.r**2) * s.delta_r
        out[i] += s.coef(f"{axis}_vrdr") * s.v * s.r * s.delta_r
    return out


def plane(s):
    out = np.zeros(6)
    for i, axis in ((2, "Z"), (4, "M")):
        out[i] = s.coef(f"{axis}_ds") * s.u**2 * s.delta_s
        out[i] += s.coef(f"{axis}_|q|ds") * s.u * abs(s.q) * s.delta_s
    return out


def thrust(s):
    pull = s.coef("X_prop_un") * s.u * s.n + s.coef("X_prop_n|n|") * s.n * abs(s.n) + s.coef("X_prop_n") * s.n
    return np.array([pull, 0, 0, 0, 0, 0])


def drag(s, linear):
    X = (s.coef("X_u|u|") + s.coef("X_prop_u|u|")) * s.u * abs(s.u) + s.coef("X_uu") * s.u**2
    return np.array([X + (s.coef("X_u0") * s.u if linear else 0.0), 0, 0, 0, 0, 0])


def lost(angle, inverse):
    return 1.0 / (1.0 + (angle * inverse) ** 2 / 3.0) - 1.0


def strips(s, height):
    """Cross-flow drag of strips as high as `height(2x/L)`: 20000 midpoints."""
    xi = (np.arange(20000) + 0.5) / 10000 - 1.0
    speed = s.v + 0.5 * s.L * xi * s.r
    force = -0.5 * s.rho * height(xi) * speed * abs(speed) * s.L / 20000
    return np.array([0, force.sum(), 0, 0, 0, (force * 0.5 * s.L * xi).sum()])


def race(s, speed_squared):
    extra = (speed_squared - s.u * abs(s.u)) * s.delta_r
    return np.array([0, s.coef("Y_dr") * extra, 0, 0, 0, s.coef("N_dr") * extra])


def usual(s):
    return s.U_ref * s.n / s.rpm_ref


def air(s, north, east, front, centre, moves):
    """Air at 1.2 kg/m3 on 3 % of L^2 ahead and 10 % abeam, at L/20 in wind abeam and further forward by
    `moves` per radian before that, and what front and centre add, less what still air does."""
    c, sn = np.cos(s.psi), np.sin(s.psi)
    out = np.zeros(6)
    for sign, (n, e) in ((1, (north, east)), (-1, (0.0, 0.0))):
        a, b = n * c + e * sn - s.u, e * c - n * sn - s.v
        q = sign * 0.6 * s.L**2 * np.hypot(a, b)
        arm = 0.05 + centre + moves * np.arctan2(-a, abs(b))
        out += q * np.array([0.03 * (1 + front) * a, 0.1 * b, 0, 0, 0, 0.1 * b * arm * s.L])
    return out


def memory(s, p):
    gone = p["fraction"] * s.u * (s.v_lagged - s.v)
    return np.array([0, s.coef("Y_v") * gone, 0, 0, 0, s.coef("N_v") * gone])


def suction(s, p):
    near = 0.5 * s.rho * s.L**2 * s.u**2 * np.exp(-s.z / (p["decay"] * s.L))
    return np.array([0, 0, -near * p["Z_s"], 0, near * s.L * p["M_s"], 0])


def line(s, p):
    across = s.v - 0.5 * s.L * s.r
    force = -p["k"] * np.hypot(s.u, across) * np.array([s.u, across, 0.0])
    return at((-0.5 * s.L, 0, 0), force)


def down(s):
    return rotation(s.phi, s.theta, s.psi).T @ np.array([0.0, 0.0, 1.0])


# name -> (parameters, wrench by hand)
CASES = {
    "rudder_effectiveness": ({"loss": 0.2}, lambda s, p: -0.2 * rudder(s)),
    "rudder_asymmetry": ({"asymmetry": 0.1}, lambda s, p: 0.1 * np.sign(s.delta_r) * rudder(s)),
    "rudder_stall": ({"inverse_stall_angle": 2.5}, lambda s, p: lost(s.delta_r, 2.5) * rudder(s)),
    "rudder_stall_inflow": (
        {"inverse_stall_angle": 0.7},
        lambda s, p: lost(s.delta_r - (s.v - 0.5 * s.L * s.r) / s.u, 0.7) * rudder(s),
    ),
    "rudder_propeller_interaction": (
        {"k": 0.4}, lambda s, p: 0.4 * race(s, usual(s) * abs(usual(s)))
    ),
    "rudder_propeller_interaction_loading": (
        {"k": 0.4}, lambda s, p: 0.4 * race(s, abs(usual(s)) * (2 * usual(s) - s.u))
    ),
    "stern_plane_effectiveness": ({"loss": 0.3}, lambda s, p: -0.3 * plane(s)),
    "thrust_loss": ({"loss": 0.15}, lambda s, p: -0.15 * thrust(s)),
    "thrust_decay": ({"loss_per_600s": 0.2}, lambda s, p: -0.2 * T / 600 * thrust(s)),
    "thrust_decay_late": ({"loss_per_600s": 0.2}, lambda s, p: -0.2 * (T / 600) ** 2 * thrust(s)),
    "hull_fouling": ({"drag_increase": 0.25}, lambda s, p: 0.25 * drag(s, linear=False)),
    "hull_fouling_all": ({"drag_increase": 0.25}, lambda s, p: 0.25 * drag(s, linear=True)),
    "power_of_drag": (
        {"power": 0.5},
        lambda s, p: drag(s, linear=False) * (np.sqrt(abs(s.u) / s.U_ref) - 1.0),
    ),
    "propeller_side_force": (
        {"side_force": 0.1}, lambda s, p: at((-0.5 * s.L, 0, 0), (0, 0.1 * thrust(s)[0], 0))
    ),
    "propeller_side_force_arm": (
        {"side_force": 0.1, "arm": 0.45},
        lambda s, p: at((-0.45 * s.L, 0, 0), (0, 0.1 * thrust(s)[0], 0)),
    ),
    "propeller_torque": (
        {"torque": 3.0}, lambda s, p: np.array([0, 0, 0, 3.0 * s.n * abs(s.n) / s.rpm_ref**2, 0, 0])
    ),
    "crossflow_drag": (
        {"Cd": 0.5, "tilt": 0.3}, lambda s, p: strips(s, lambda xi: 0.5 * s.height * (1 + 0.3 * xi))
    ),
    "crossflow_drag_midships": (
        {"Cd": 0.5}, lambda s, p: strips(s, lambda xi: 0.5 * s.height * 1.5 * (1 - xi**2))
    ),
    "cubic_damping": (
        {"Y_vvv": -0.3, "N_rrr": -0.2}, lambda s, p: np.array([0, -0.3 * s.v**3, 0, 0, 0, -0.2 * s.r**3])
    ),
    "fluid_memory": ({"fraction": 0.4, "lag": 1.5}, memory),
    "hull_asymmetry": (
        {"N_u_abs_v": 0.3}, lambda s, p: np.array([0, 0, 0, 0, 0, 0.3 * s.u * abs(s.v)])
    ),
    "hull_misalignment": (
        {"side_force": 0.3, "yaw_moment": -0.2},
        lambda s, p: s.u * abs(s.u) / s.U_ref**2 * np.array([0, 0.3, 0, 0, 0, -0.2]),
    ),
    "drag_step": (  # a logistic curve of four per length travelled
        {"extra_drag": 0.3, "onset": T - 0.4},
        lambda s, p: (
            -0.3 * s.u * abs(s.u) / s.U_ref**2 / (1 + np.exp(-4 * 0.4 * s.U_ref / s.L)) * np.eye(6)[0]
        ),
    ),
    "tether_drag": ({"k": 0.4}, line),
    "steady_force": (
        {"F_north": 0.3, "F_east": -0.2},
        lambda s, p: at((0, 0, 0), rotation(s.phi, s.theta, s.psi).T @ np.array([0.3, -0.2, 0.0])),
    ),
    "wind": (
        {
            "blowing_north": 2.0, "blowing_east": -1.0, "area_coefficients": 0.7, "front": 0.4,
            "centre": -0.08, "centre_moves": 0.2,
        },
        lambda s, p: air(s, 2.0, -1.0, 0.4, -0.08, 0.2)
        + 0.7 * air(s, s.wind_north, s.wind_east, 0.4, -0.08, 0.2),
    ),
    "trim_weight": (
        {"weight_excess": 0.4, "x": 0.3}, lambda s, p: at((0.3, 0, 0), 0.4 * down(s))
    ),
    "surface_suction": ({"Z_s": 0.1, "M_s": 0.05, "decay": 0.5}, suction),
}  # fmt: skip
# five Gauss points against 20000: the kink where v + x r changes sign
TOLERANCE = {"crossflow_drag": 0.02, "crossflow_drag_midships": 0.02}


def test_every_force_effect_is_written_out_by_hand():
    forces = {e.name for e in BY_NAME.values() if e.force and not e.planar}
    assert forces == set(CASES)
    assert {e.name for e in BY_NAME.values() if e.adjust} == set(MASSES) | SERVO


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("seed", range(3))
def test_an_effect_pushes_as_its_source_says(name, seed):
    values, expected = CASES[name]
    s = Point(name, seed)
    wanted = np.asarray(expected(s, values), dtype=float)
    found = s.change(name, values)
    size = np.abs(wanted).max()
    assert size > 0
    assert np.allclose(found, wanted, rtol=0, atol=TOLERANCE.get(name, 1e-10) * max(size, 1e-3))


# ---- parts of a form that a planar model leaves out ------------------------------------------------------
EVEN = {  # name of the size without its axis -> product that a mirror image leaves as it is
    "asymmetry_in_turns": {
        "vv": lambda s: s.v**2, "vr": lambda s: s.v * s.r, "rr": lambda s: s.r**2,
    },
    "asymmetry_under_rudder": {
        "v_dr": lambda s: s.u * s.v * s.delta_r, "r_dr": lambda s: s.u * s.r * s.delta_r,
        "dr_dr": lambda s: (s.u * s.delta_r) ** 2,
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "axis", "product"), [(n, a, p) for n, even in EVEN.items() for a in "YN" for p in even]
)
def test_an_asymmetry_pushes_by_an_even_product_in_its_axis_alone(name, axis, product):
    s = Point(name, 1, KernelSpec(3))
    assert {p.name for p in BY_NAME[name].parameters} == {f"{a}_{p}" for a in "YN" for p in EVEN[name]}
    found = s.change(name, {f"{axis}_{product}": 0.7})
    wanted = 0.7 * EVEN[name][product](s) * np.array([axis == "X", axis == "Y", axis == "N"])
    assert np.abs(wanted).max() > 1e-6 and found == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", ["six_thruster_rov", "differential_boat"])
def test_a_vehicle_without_a_rudder_may_turn_unlike_its_mirror_image(name):
    names = {e.name for e in build_model(load_vehicle(name), 3).kernel.effects}
    assert "asymmetry_in_turns" in names and "asymmetry_under_rudder" not in names


# ---- effects that change what the hull weighs ------------------------------------------------------------
SERVO = {"actuator_lag", "actuator_rate_limit"}


def point_mass(mass, r):
    r = np.asarray(r, dtype=float)
    return mass * (r @ r * np.eye(3) - np.outer(r, r))


def inertia(s):
    return np.array(
        [[s.Ixx, -s.Ixy, -s.Ixz], [-s.Ixy, s.Iyy, -s.Iyz], [-s.Ixz, -s.Iyz, s.Izz]]
    )  # fmt: skip


def with_mass(s, mass, r_G, about_origin, W, B, r_B):
    """Parameters of the bare model with other mass properties."""
    par = s.par.copy()
    values = {"m": mass, "W": W, "B": B}
    values |= dict(zip(("x_G", "y_G", "z_G"), r_G, strict=True))
    values |= dict(zip(("x_B", "y_B", "z_B"), r_B, strict=True))
    values |= {f"I{a}{a}": about_origin[i, i] for i, a in enumerate("xyz")}
    values |= {"Ixy": -about_origin[0, 1], "Ixz": -about_origin[0, 2], "Iyz": -about_origin[1, 2]}
    for name, value in values.items():
        par[s.index[name]] = value
    return par


def hull(s):
    return np.array([s.x_G, s.y_G, s.z_G]), np.array([s.x_B, s.y_B, s.z_B])


def ballasted(s, p, spread):
    """A body of mass mu m at (x, y_G, z_G), its own weight displaced, beside the hull; parallel axes."""
    r_G, r_B = hull(s)
    share, place = p["mass_fraction"], np.array([p["x"], s.y_G, s.z_G])
    own = inertia(s) - point_mass(s.m, r_G) if spread else 0.0
    total = inertia(s) + share * own + point_mass(share * s.m, place)
    B = s.B + share * s.W
    centre = (s.B * r_B + share * s.W * place) / B
    return with_mass(
        s, s.m * (1 + share), (r_G + share * place) / (1 + share), total, s.W * (1 + share), B, centre
    )


def shifted(s, r):
    r_G, r_B = hull(s)
    return with_mass(s, s.m, r_G + np.array(r), inertia(s), s.W, s.B, r_B)


def heavier_water(s, p):
    par = s.par.copy()
    for name, key in (("X_udot", "e_X"), ("Y_vdot", "e_Y"), ("N_rdot", "e_N")):
        par[s.index[name]] *= 1 + p[key]
    return par


BALLAST = {"mass_fraction": 0.08, "x": 0.3}
MASSES = {
    "ballast_mass": (BALLAST, lambda s, p: ballasted(s, p, spread=True)),
    "ballast_mass_point": (BALLAST, lambda s, p: ballasted(s, p, spread=False)),
    "cg_offset_x": ({"x_G": 0.04}, lambda s, p: shifted(s, (0.04, 0, 0))),
    "cg_offset_y": ({"y_G": 0.03}, lambda s, p: shifted(s, (0, 0.03, 0))),
    "added_mass_error": ({"e_X": 0.1, "e_Y": -0.2, "e_N": 0.3}, heavier_water),
}


@pytest.mark.parametrize("name", MASSES)
def test_a_mass_effect_is_the_model_with_the_other_mass(name):
    """Forces and mass matrix, centre of gravity and products of inertia away from zero."""
    values, changed = MASSES[name]
    s = Point(name)
    by_hand, on = changed(s, values), s.par.copy()
    for key, value in values.items():
        on[s.index[f"{name}.{key}"]] = value
    assert np.allclose(s.kernel.mass(on), s.kernel.mass(by_hand), rtol=1e-12, atol=1e-13)
    found, expected = (s.kernel.forces(s.x, s.act, s.exo, T, par) for par in (on, by_hand))
    assert np.allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert not np.allclose(s.kernel.mass(on), s.kernel.mass(s.par), rtol=1e-6)


def test_the_plants_ballast_brings_the_same_inertia():
    """Centre of gravity off the origin, where the hull's own m x_G^2 must not count twice."""
    from dataclasses import replace

    vehicle = replace(load_vehicle("nps_auv2"), r_G=(0.2, 0.05, 0.061))
    number = build(vehicle, vehicle.coef, 6, settings({"ballast": 0.08, "ballast_x": 0.5})).number
    v, r_G, water = vehicle, np.array(vehicle.r_G), np.array([0.5, 0.05, 0.061])
    about = np.array([[v.Ixx, -v.Ixy, -v.Ixz], [-v.Ixy, v.Iyy, -v.Iyz], [-v.Ixz, -v.Iyz, v.Izz]])
    expected = about + 0.08 * (about - point_mass(v.mass, r_G)) + point_mass(0.08 * v.mass, water)
    found = [number[k] for k in ("Ix", "Iy", "Iz", "Ixy", "Ixz", "Iyz")]
    wanted = [*np.diag(expected), -expected[0, 1], -expected[0, 2], -expected[1, 2]]
    assert found == pytest.approx(wanted, rel=1e-12)


def test_a_stern_that_swings_outward_spares_the_plants_rudder_from_stalling():
    """Positive rudder turns to port: drift to starboard, bow to port, less angle between flow and rudder."""
    from bayesid.benchmark.plant.forces import _rudder_angle

    vehicle = load_vehicle("generic_sub")
    number = build(vehicle, vehicle.coef, 3, settings()).number
    gap, order, U, L = settings({"hard_stall": 1 / 0.4}), 0.45, 5.0, vehicle.L
    straight = _rudder_angle(order, U, 0.0, 0.0, number, gap)
    turning = _rudder_angle(order, U, 0.1 * U, -0.2 * U / L, number, gap)
    assert straight == pytest.approx(order * (1 - 3 * (order - 0.4) / 0.4))  # past its stall by 0.05 rad
    assert turning == order  # atan(0.2) less


# ---- other forms ------------------------------------------------------------------------------------------
@pytest.mark.parametrize("effect", ALTERNATIVES, ids=lambda e: e.name)
def test_an_alternative_stands_in_for_an_effect_of_its_family(effect):
    base = BY_NAME[of(effect.name)]
    assert base in CATALOGUE and effect not in CATALOGUE
    assert (effect.family, effect.port, effect.where) == (base.family, base.port, base.where)
    assert effect.name in base.form and effect in alternatives(base)


@pytest.mark.parametrize("effect", ALTERNATIVES, ids=lambda e: e.name)
def test_an_alternative_is_absent_at_its_off_value(effect):
    s = Point(effect.name)
    bare = equations(SIX, "bare")
    par = np.array([s.par[s.index[n]] if n in s.index else 0.0 for n in bare.parameters])
    found = s.kernel.forces(s.x, s.act, s.exo, T, s.par)
    assert np.allclose(found, bare.forces(s.x, s.act, s.exo, T, par), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("effect", [*CATALOGUE, *ALTERNATIVES], ids=lambda e: e.name)
def test_an_effect_can_be_told_in_words(effect):
    text = describe(effect)
    assert all(word in text for word in (effect.name, effect.source, effect.form))
    assert all(p.about in text for p in effect.parameters)
    assert lines_of(effect)
