"""The equations of motion at a point: rigid body, potential flow, effects at their off values.

Expected values: vector forms in `reference_motion`, and conservation of energy.
"""

import numpy as np
import pytest
from plain_kernel import EVERY, equations
from reference_motion import rigid_body

from bayesid.equations.layout import KernelSpec
from bayesid.model.effects import CATALOGUE, catalogue_of

OFF = {e.key(p.name): p.off for e in (*CATALOGUE, *catalogue_of(ship=True)) for p in e.parameters}


def random_point(kernel, rng, effects_on=True):
    """State, inputs and parameters, none of them zero, shape parameters and thrust curve in their range."""
    par = rng.uniform(0.5, 1.5, len(kernel.parameters)) * rng.choice([-1.0, 1.0], len(kernel.parameters))
    named = {"m": 9.0, "L": 2.0, "rho": 1.2, "rpm_ref": 3.0, "U_ref": 1.5, "height": 0.4, "W": 7.0, "B": 6.5}
    named |= {
        "Ixx": 8.0,
        "Iyy": 9.0,
        "Izz": 9.5,
        "Kt0": 0.4,
        "kt_a": 0.9,
        "kt_b": 1.3,
        "w_p": 0.2,
        "t_p": 0.1,
    }
    named |= {"D": 0.6, "cross": 1.0, "strip_Y": 0.7, "strip_Z": 0.8, "x_G": 0.1, "y_G": 0.05, "z_G": 0.2}
    for i, name in enumerate(kernel.parameters):
        if name in named:
            par[i] = named[name]
        elif name in OFF:
            par[i] = OFF[name] + (rng.uniform(0.1, 0.4) if effects_on else 0.0)
        elif name.startswith("thruster_") and name.endswith(("_limit", "_dead_band", "_reverse")):
            par[i] = abs(par[i])  # as the reader of a vehicle file has them
    x = rng.uniform(0.2, 0.9, len(kernel.states)) * rng.choice([-1.0, 1.0], len(kernel.states))
    act = rng.uniform(0.1, 0.5, len(kernel.actuators)) * rng.choice([-1.0, 1.0], len(kernel.actuators))
    act[-1] = 2.0
    x[list(kernel.states).index("u")] = 1.1  # ahead, inside the thrust curve
    exo = rng.uniform(-0.5, 0.5, len(kernel.exogenous))
    return x, act, exo, par


@pytest.mark.parametrize("seed", range(5))
def test_rigid_body_side_is_the_vector_form(seed):
    """M_RB nudot + C(nu) nu about an origin away from G, with products of inertia."""
    kernel, rng = equations(KernelSpec(6), "bare"), np.random.default_rng(seed)
    names = list(kernel.parameters)
    par = np.zeros(len(names))
    mass, r_G = 3.0, rng.uniform(-1, 1, 3)
    half = rng.uniform(-1, 1, (3, 3))
    inertia = half @ half.T + 20.0 * np.eye(3)
    values = {"m": mass, "L": 1.0, "rho": 1.0, "rpm_ref": 1.0, "U_ref": 1.0}
    values |= dict(zip(("x_G", "y_G", "z_G"), r_G, strict=True))
    values |= {f"I{a}{a}": inertia[i, i] for i, a in enumerate("xyz")}
    values |= {"Ixy": -inertia[0, 1], "Ixz": -inertia[0, 2], "Iyz": -inertia[1, 2]}
    for name, value in values.items():
        par[names.index(name)] = value
    x = rng.uniform(-1, 1, 12)
    matrix, coriolis = rigid_body(mass, r_G, inertia)
    forces = kernel.forces(x, np.zeros(4), np.zeros(len(kernel.exogenous)), 0.0, par)
    assert np.allclose(kernel.mass(par), matrix, rtol=1e-12, atol=1e-12)
    assert np.allclose(forces, -coriolis(x[6:]), rtol=1e-12, atol=1e-12 * np.abs(coriolis(x[6:])).max())


def potential_flow(A):
    """Rows of an x-z symmetric body without viscosity, from its eight added masses (equations.md 7)."""
    rows = {f"{k}": v for k, v in A.items()}
    Xu, Yv, Zw, Kp, Mq, Nr = (A[k] for k in ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot"))
    Yr, Zq, Yp, Kr = (A[k] for k in ("Y_rdot", "Z_qdot", "Y_pdot", "K_rdot"))
    rows |= {"N_vdot": Yr, "M_wdot": Zq, "K_vdot": Yp, "N_pdot": Kr}
    rows |= {"X_vr": -Yv, "X_rr": -Yr, "X_wq": Zw, "X_qq": Zq, "X_rp": -Yp}
    rows |= {"Y_r": Xu, "Y_wp": -Zw, "Y_pq": -Zq, "Z_q": -Xu, "Z_vp": Yv, "Z_rp": Yr, "Z_pp": Yp}
    rows |= {"K_vw": Zw - Yv, "K_vq": Yr + Zq, "K_wr": -(Yr + Zq), "K_qr": Nr - Mq, "K_wp": -Yp, "K_pq": Kr}
    rows |= {"M_w": -(Zw - Xu), "M_q": -Zq, "M_vp": -Yr, "M_rp": Kp - Nr, "M_vr": Yp}
    rows |= {"M_rr": Kr, "M_pp": -Kr}
    rows |= {"N_v": Yv - Xu, "N_r": Yr, "N_wp": Zq, "N_pq": Mq - Kp, "N_vq": -Yp, "N_p": Yp, "N_qr": -Kr}
    return rows


@pytest.mark.parametrize("seed", range(5))
def test_added_mass_coriolis_does_no_work(seed):
    """Power of all forces that remain in ideal flow: zero at any velocity, so kinetic energy never drifts."""
    kernel, rng = equations(KernelSpec(6), "bare"), np.random.default_rng(seed)
    names = list(kernel.parameters)
    par = np.zeros(len(names))
    added = dict(
        zip(("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot"), -rng.uniform(1, 3, 6), strict=True)
    )
    added |= {k: rng.uniform(-0.4, 0.4) for k in ("Y_rdot", "Z_qdot", "Y_pdot", "K_rdot")}
    values = {
        "m": 2.0,
        "Ixx": 2.0,
        "Iyy": 3.0,
        "Izz": 3.5,
        "x_G": 0.1,
        "z_G": 0.2,
        "L": 1.0,
        "rpm_ref": 1.0,
        **potential_flow(added),
    }
    for name, value in values.items():
        par[names.index(name)] = value
    x = rng.uniform(-1, 1, 12)
    forces = kernel.forces(x, np.zeros(4), np.zeros(len(kernel.exogenous)), 0.0, par)
    assert np.abs(forces).max() > 0.1
    assert abs(forces @ x[6:]) < 1e-12 * np.abs(forces * x[6:]).max()
    assert np.allclose(kernel.mass(par), kernel.mass(par).T, atol=1e-15)


def test_potential_flow_keeps_its_kinetic_energy_over_a_tumble():
    """20 s at about one turn in six seconds: drift below 1e-10, the integrator's (RK4, 0.01 s)."""
    kernel = equations(KernelSpec(6), "bare")
    names = list(kernel.parameters)
    par = np.zeros(len(names))
    added = {"X_udot": -0.3, "Y_vdot": -2.0, "Z_wdot": -1.8, "K_pdot": -0.1, "M_qdot": -0.8, "N_rdot": -0.9}
    added |= {"Y_rdot": 0.1, "Z_qdot": -0.2, "Y_pdot": 0.05, "K_rdot": 0.02}
    values = {
        "m": 2.0,
        "Ixx": 0.5,
        "Iyy": 1.5,
        "Izz": 1.6,
        "x_G": 0.05,
        "z_G": 0.1,
        "L": 1.0,
        "rpm_ref": 1.0,
        **potential_flow(added),
    }
    for name, value in values.items():
        par[names.index(name)] = value
    x = np.array([0, 0, 0, 0.1, 0.1, 0, 1.0, 0.3, -0.2, 0.4, 0.3, 0.9])
    act, exo, h, mass = np.zeros(4), np.zeros(len(kernel.exogenous)), 0.02, kernel.mass(par)
    energy = [0.5 * x[6:] @ mass @ x[6:]]
    for _ in range(1000):
        k1 = kernel.rate(x, act, exo, 0.0, par)
        k2 = kernel.rate(x + 0.5 * h * k1, act, exo, 0.0, par)
        k3 = kernel.rate(x + 0.5 * h * k2, act, exo, 0.0, par)
        k4 = kernel.rate(x + h * k3, act, exo, 0.0, par)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        x[4] = 0.1  # pitch and roll move no energy without weight; away from the singularity of Euler angles
        energy.append(0.5 * x[6:] @ mass @ x[6:])
    assert np.ptp(energy) < 1e-7 * energy[0]


@pytest.mark.parametrize("spec", EVERY, ids=lambda s: s.name)
def test_off_values_reproduce_the_bare_equations(spec):
    bare, full = equations(spec, "bare"), equations(spec, "full")
    x, act, exo, par = random_point(full, np.random.default_rng(10), effects_on=False)
    n = len(bare.states)
    expected, found = (k.rate(z, act, exo, 0.4, par) for k, z in ((bare, x[:n]), (full, x)))
    assert np.allclose(found[:n], expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("spec", EVERY, ids=lambda s: s.name)
@pytest.mark.parametrize("prefix", ["bare", "full"])
def test_no_force_jumps_where_a_motion_or_a_fin_changes_sign(spec, prefix):
    """Rows, strips and effects, cross-flow and turn at full size: a step over a jump loses fourth order.

    2e-9 apart; no slope is steeper than a few hundred, a jump of (v/|v|) R |r| is 0.1 and more.
    """
    kernel = equations(spec, prefix)
    x, act, exo, par = random_point(kernel, np.random.default_rng(4))
    exo[:] = 0.0
    names = list(kernel.parameters)
    par[[i for i, n in enumerate(names) if "current" in n]] = 0.0  # velocity through the water is that of x
    points = [(x, list(kernel.states).index(v)) for v in kernel.velocities]
    points += [(act, i) for i in range(len(kernel.actuators) - 1)]
    for vector, i in points:
        kept = vector[i]
        sides = []
        for value in (1e-9, -1e-9):
            vector[i] = value
            sides.append(kernel.forces(x, act, exo, 0.4, par))
        vector[i] = kept
        assert np.abs(sides[0] - sides[1]).max() < 1e-5, (prefix, i)
