"""Vehicles in motion: against equations written out by hand and an adaptive integrator, and by symmetry.

Planar runs are compiled; in six degrees of freedom the rates are compared point by point, which needs no
compiler, and compiled runs are marked slow.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from plain_kernel import equations
from reference_motion import make_rate, rotation
from scipy.integrate import solve_ivp
from vehicle_sets import ROW_SETS

from bayesid.equations.layout import KernelSpec
from bayesid.equations.model import build_model
from bayesid.model.propulsion import propeller_moment
from bayesid.model.vehicles import Propulsion, load_vehicle
from bayesid.simulation import (
    actuate,
    gradient,
    gradient_batch,
    interval_maps,
    plan_run,
    sensitivities,
    simulate,
    simulate_batch,
    steady_start,
)

NAMES = ROW_SETS
PLANAR = [0, 1, 5, 6, 7, 11]
BOTH = [
    pytest.param(name, dof, id=f"{name}-{dof}dof")
    for name in NAMES
    for dof in ((3,) if load_vehicle(name).planar_only else (3, 6))
]


@lru_cache
def model_of(name, dof=3):
    return build_model(load_vehicle(name), dof)


def random_state(model, rng):
    """Twelve-entry state at about working speed, and inputs; in the plane for a planar model."""
    L, U = model.scales["L"], model.scales["U"]
    state = np.zeros(12)
    state[:3] = rng.uniform(-L, L, 3)
    state[3:6] = rng.uniform(-0.4, 0.4, 3)
    state[6:9] = U * np.array([rng.uniform(0.5, 1.2), *rng.uniform(-0.3, 0.3, 2)])
    state[9:] = U / L * rng.uniform(-0.5, 0.5, 3)
    fins = rng.uniform(-0.3, 0.3, 3)
    if model.dof == 3:
        state[[2, 3, 4, 8, 9, 10]] = 0.0
        fins[1:] = 0.0
    return state, fins, model.vehicle.rpm_ref * rng.uniform(0.5, 1.2)


def kernel_rate(model, prefix, state, fins, n, par, time=0.0):
    """Rate in twelve entries from the generated equations, run as plain Python."""
    kernel = equations(model.kernel.spec, prefix)
    kept = PLANAR if model.dof == 3 else list(range(12))
    x = np.concatenate([state[kept], np.zeros(len(kernel.states) - len(kept))])
    act = np.array([fins[0], n]) if model.dof == 3 else np.array([*fins, n])
    out = np.zeros(12)
    out[kept] = kernel.rate(x, act, np.zeros(len(kernel.exogenous)), time, par)[: len(kept)]
    return out


def same(found, expected, model, tolerance):
    """Equal to a share of the vehicle's own scales, entry by entry."""
    L, U = model.scales["L"], model.scales["U"]
    scale = np.array([U] * 3 + [U / L] * 3 + [U**2 / L] * 3 + [U**2 / L**2] * 3)
    return np.abs((found - expected) / scale).max() < tolerance


@pytest.mark.parametrize(("name", "dof"), BOTH)
def test_rates_agree_with_equations_written_out_by_hand(name, dof):
    """The generated graph against `reference_motion`: 1e-11 of U^2/L, rounding of a 6 x 6 inverse."""
    model = model_of(name, dof)
    rate = make_rate(model.vehicle, planar=dof == 3)
    for seed in range(5):
        state, fins, n = random_state(model, np.random.default_rng(seed))
        found = kernel_rate(model, "bare", state, fins, n, model.nominal)
        assert same(found, rate(state, fins, n), model, 1e-11)


def test_a_propeller_with_an_open_water_torque_lists_the_vehicle_as_written_out_by_hand():
    """Right-handed: to port ahead, to starboard astern; without `Kq_a` with the square of the revolutions."""
    curve = {"Kt0": 0.45, "a": 1.1, "b": 1.0, "w": 0.06, "t": 0.1, "D": 0.14, "rpm_ref": 850.0}
    turning = {**curve, "Kq0": 0.07, "Kq_a": 1.2, "Kq_b": 1.3}
    vehicle = replace(load_vehicle("nps_auv2"), propulsion=Propulsion("kt", turning))
    model = build_model(vehicle, 6)
    rate = make_rate(vehicle)
    still = model.with_values({"Kq0": 0.0})
    for seed in range(5):
        state, fins, n = random_state(model, np.random.default_rng(seed))
        for turns in (n, -n):
            found = kernel_rate(model, "bare", state, fins, turns, model.nominal)
            assert same(found, rate(state, fins, turns), model, 1e-11)
            assert not same(found, kernel_rate(model, "bare", state, fins, turns, still), model, 1e-6)
    astern, ahead = propeller_moment("kt", turning, 1000.0, 0.5, [-600.0, 600.0])
    assert ahead < 0.0 < astern
    constant = {k: v for k, v in turning.items() if k not in ("Kq_a", "Kq_b")}
    moment = propeller_moment("kt", constant, 1000.0, [0.0, 1.0, 2.0], 600.0)
    np.testing.assert_allclose(moment, -1000.0 * 10.0**2 * 0.14**5 * 0.07, rtol=1e-9)
    zero = 1.2 * 10.0 * 0.14 / 0.94
    assert propeller_moment("kt", turning, 1000.0, zero, 600.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("name", "dof"), BOTH)
def test_uniform_current_is_a_change_of_frame(name, dof):
    """The same motion through water that moves with V: pose drifts with V, body velocity gains R'V."""
    model = model_of(name, dof)
    values = {"ocean_current.V_north": 0.3, "ocean_current.V_east": -0.2}
    V = np.array([0.3, -0.2, 0.0])
    if dof == 6:
        values["heave_current.V_down"] = V[2] = 0.1
    par = model.with_values(values)
    for seed in range(3):
        state, fins, n = random_state(model, np.random.default_rng(seed))
        still = kernel_rate(model, "bare", state, fins, n, model.nominal)
        flow = rotation(*state[3:6]).T @ V
        moving = state.copy()
        moving[6:9] += flow
        found = kernel_rate(model, "full", moving, fins, n, par)
        expected = still.copy()
        expected[:3] += V
        expected[6:9] -= np.cross(state[9:], flow)
        assert same(found, expected, model, 1e-11)


@pytest.mark.parametrize("name", [n for n in NAMES if not load_vehicle(n).planar_only])
def test_three_degrees_of_freedom_are_six_held_in_the_plane(name):
    """Forces X, Y, N and the mass matrix of the plane, with every effect on that both have."""
    planar, six = model_of(name, 3), model_of(name, 6)
    rng = np.random.default_rng(3)
    values = {
        planar.kernel.parameters[i]: off + rng.uniform(0.05, 0.2)
        for i, off in planar.effect_off.items()
        if planar.kernel.parameters[i] in six.index
    }
    par3, par6 = planar.with_values(values), six.with_values(values)
    for prefix in ("bare", "full"):
        three, all6 = equations(planar.kernel.spec, prefix), equations(six.kernel.spec, prefix)
        state, fins, n = random_state(planar, rng)
        x3, x6 = state[PLANAR], state
        if prefix == "full":
            left = len(planar.kernel.full.states) - len(six.kernel.full.states) + len(x6) - len(x3)
            x3, x6 = np.append(x3, [0.1, *np.zeros(left)]), np.append(x6, 0.1)  # heel, where it is a state
        exo3 = rng.uniform(-0.3, 0.3, len(three.exogenous))
        exo6 = np.array([dict(zip(three.exogenous, exo3, strict=True)).get(e, 0.0) for e in all6.exogenous])
        forces3 = three.forces(x3, np.array([fins[0], n]), exo3, 3.0, par3)
        forces6 = all6.forces(x6, np.array([*fins, n]), exo6, 3.0, par6)
        assert np.allclose(forces3, forces6[[0, 1, 5]], rtol=1e-12, atol=1e-12 * np.abs(forces3).max())
        block = all6.mass(par6)[np.ix_((0, 1, 5), (0, 1, 5))]
        assert np.allclose(three.mass(par3), block, rtol=1e-13)


MIRRORED = [1, 3, 5, 7, 9, 11]  # y phi psi v p r


@pytest.mark.parametrize(("name", "dof"), BOTH)
def test_port_and_starboard_are_mirror_images(name, dof):
    """Rows that break the symmetry (a constant sway force, say) are put to zero first."""
    model = model_of(name, dof)
    even = {"Y_*", "K_*", "N_*"}
    par = model.with_values({n: 0.0 for n in even if n in model.index})
    par[[model.index[n] for n in ("y_G", "y_B", "Ixy", "Iyz", "torque_ref") if n in model.index]] = 0.0
    for seed in range(3):
        state, fins, n = random_state(model, np.random.default_rng(seed))
        other, mirrored_fins = state.copy(), fins * [-1, 1, 1]
        other[MIRRORED] *= -1
        expected = kernel_rate(model, "bare", state, fins, n, par)
        expected[MIRRORED] *= -1
        assert same(kernel_rate(model, "bare", other, mirrored_fins, n, par), expected, model, 1e-12)


def turning_run(name, dof=3, lengths=4.0, per_length=200):
    """A port turn already under way, easing after half the time: no velocity changes sign, all is smooth."""
    model = model_of(name, dof)
    L, U, rpm = model.scales["L"], model.scales["U"], model.vehicle.rpm_ref
    t = np.linspace(0.0, lengths * L / U, 9)
    rudder = np.where(np.arange(9) < 4, 0.2, 0.12)
    par = model.nominal.copy()
    par[model.index["inverse_rate_r"]] = 1e-9  # held commands act at once, so that pieces are smooth
    plan = plan_run(model, t, {"delta_r_cmd": rudder, "n_cmd": np.full(9, rpm)}, max_step=L / U / per_length)
    x0 = np.zeros(len(model.states))
    for state, value in (("u", 0.9 * U), ("v", 0.08 * U), ("r", -0.3 * U / L)):
        x0[model.states.index(state)] = value
    return model, par, plan, x0, rudder, rpm


def adaptive(model, t, rudder, rpm, x0):
    """DOP853 over each held command."""
    kept = PLANAR if model.dof == 3 else list(range(12))
    rate = make_rate(model.vehicle, planar=model.dof == 3)
    L, U = model.scales["L"], model.scales["U"]
    state = np.zeros(12)
    state[kept] = x0
    out = [state]
    for i in range(t.size - 1):
        piece = solve_ivp(
            lambda _, s, i=i: rate(s, (rudder[i], 0.0, 0.0), rpm),
            (t[i], t[i + 1]), out[-1], method="DOP853", rtol=1e-12, atol=1e-13 * min(L, U, U / L),
        )  # fmt: skip
        out.append(piece.y[:, -1])
    return np.array(out)[:, kept]


def agrees_with_an_adaptive_integrator(name, dof):
    # generic_sub rolls fast: at 200 steps a length RK4 leaves 6e-8 of its roll rate, at 400 a sixteenth
    model, par, plan, x0, rudder, rpm = turning_run(name, dof, per_length=200 if dof == 3 else 400)
    found = simulate(model, par, plan, x0).states
    expected = adaptive(model, plan.t, rudder, rpm, x0)
    scale = np.abs(expected).max(axis=0)
    scale[scale < 1e-3 * model.scales["U"] / model.scales["L"]] = 1.0
    return np.abs((found - expected) / scale).max() < 1e-8


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_planar_runs_agree_with_an_adaptive_integrator(name):
    """Four hull lengths, DOP853 at 1e-12 on the equations written out by hand: 1e-8 of each state's range."""
    assert agrees_with_an_adaptive_integrator(name, 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["generic_sub", "nps_auv2"])
def test_runs_in_six_degrees_agree_with_an_adaptive_integrator(name):
    assert agrees_with_an_adaptive_integrator(name, 6)


def test_the_integrator_is_of_fourth_order():
    """Halving the step divides the error by 16: slope 4 within 0.1 where steps are short."""
    finest = turning_run("generic_sub", per_length=512)
    reference = simulate(*finest[:4]).states[-1]
    steps = np.array([16, 32, 64])
    errors = []
    for per_length in steps:
        model, par, plan, x0, *_ = turning_run("generic_sub", per_length=per_length)
        errors.append(np.abs(simulate(model, par, plan, x0).states[-1] - reference)[:2].max())
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert abs(slope - 4.0) < 0.1


@pytest.mark.parametrize(("name", "within"), [("nps_auv2", 0.02), ("generic_sub", 0.1), ("lauv", 0.001)])
def test_default_steps_follow_a_moving_rudder(name, within):
    """Reversals of 20 deg for 40 L/U against steps 64 times shorter [m]; sensors tell 0.1 m at best."""
    model = model_of(name)
    time = model.scales["L"] / model.scales["U"]
    k = np.arange(26)
    t = 1.6 * time * k
    inputs = {"delta_r_cmd": 0.35 * (-1.0) ** k * (k > 0), "n_cmd": np.full(26, model.vehicle.rpm_ref)}
    x0 = steady_start(model)
    coarse, fine = (
        simulate(model, model.nominal, plan_run(model, t, inputs, max_step=step), x0).states
        for step in (None, 0.00125 * time)
    )
    assert np.hypot(*(coarse - fine)[:, :2].T).max() < within


def reversals(name, values):
    """Rudder of 20 deg to either side for 40 L/U; effects as multiples of L/U."""
    model = model_of(name)
    time = model.scales["L"] / model.scales["U"]
    k = np.arange(26)
    inputs = {"delta_r_cmd": 0.35 * (-1.0) ** k * (k > 0), "n_cmd": np.full(26, model.vehicle.rpm_ref)}
    par = model.with_values({key: value * time for key, value in values.items()})
    return model, par, 1.6 * time * k, inputs, steady_start(model)


LATE = [
    {"actuator_dead_time.delay": 0.37}, {"actuator_dead_time.delay": 0.05},
    {"actuator_dead_time.delay": -0.2},
    {"actuator_lag.tau": 0.3}, {"actuator_rate_limit.inverse_rate_excess": 1.0},
]  # fmt: skip


@pytest.mark.parametrize("values", LATE, ids=lambda v: "{0[0]} {0[1]}".format(*v.items()))
@pytest.mark.parametrize(("name", "within"), [("nps_auv2", 0.025), ("generic_sub", 0.1)])
def test_default_steps_follow_a_rudder_that_is_late(name, within, values):
    """Held over the same steps: 0.04 to 0.7 m (nps_auv2) and 0.2 to 1.5 m (generic_sub) off.

    The rudder of nps_auv2 goes over in a quarter of a step. Late, it does so within one, whose straight line
    has its mean and moment but not its mean square, the drag: 0.12 m of 200 m after 25 reversals.
    """
    if name == "nps_auv2" and "actuator_dead_time.delay" in values:
        within = 0.15
    model, par, t, inputs, x0 = reversals(name, values)
    time = model.scales["L"] / model.scales["U"]
    coarse, fine = (
        simulate(model, par, plan_run(model, t, inputs, max_step=step), x0).states
        for step in (None, 0.00125 * time)
    )
    assert np.hypot(*(coarse - fine)[:, :2].T).max() < within


ON_ITS_WAY = {  # position of a rudder [rad] that is told at 1 L/U to go from -0.3 to 0.3, s in L/U
    "servo": ({}, lambda s: np.clip(-0.3 + (s - 1.0) / 1.5, -0.3, 0.3)),
    "dead time": ({"actuator_dead_time.delay": 0.37}, lambda s: np.clip(-0.3 + (s - 1.37) / 1.5, -0.3, 0.3)),
    "lag": ({"actuator_lag.tau": 0.3}, lambda s: 0.3 - 0.6 * np.exp(-np.maximum(s - 1.0, 0.0) / 0.3)),
}


@pytest.mark.parametrize("kind", ON_ITS_WAY)
def test_a_step_reads_mean_and_moment_of_a_moving_rudder(kind):
    """Closed forms, over steps that begin and end while the rudder is under way; 60 degrees are 1 rad."""
    model, (late, position) = model_of("generic_sub"), ON_ITS_WAY[kind]
    time = model.scales["L"] / model.scales["U"]
    par = model.with_values({key: value * time for key, value in late.items()})
    par[model.index["inverse_rate_r"]] = 1e-9 if kind == "lag" else 1.5 * time
    t = np.array([0.0, 1.0, 4.0]) * time
    plan = plan_run(model, t, {"delta_r_cmd": np.array([-0.3, 0.3, 0.3])})
    act, _ = actuate(model, par, plan)
    off = (np.arange(20000) + 0.5) / 20000 - 0.5
    for step, begin, length in zip(act, plan.times / time, plan.steps / time, strict=True):
        values = position(begin + length * (off + 0.5))
        assert step[0] == pytest.approx(values.mean(), abs=2e-5)
        assert step[2] == pytest.approx(12.0 * (values * off).mean(), abs=4e-4)
    moved = np.abs(act[:, 2]).max()
    assert moved > 0.05  # a position held over each step has no moment at all


def test_a_measured_rudder_runs_on_a_straight_line_between_its_samples():
    model = model_of("generic_sub")
    time = model.scales["L"] / model.scales["U"]
    t = np.array([0.0, 1.0, 4.0]) * time
    plan = plan_run(model, t, {}, measured={"delta_r": np.array([0.0, 0.3, 0.3])})
    act, _ = actuate(model, model.nominal, plan)
    first = plan.record[1]
    middle = (plan.times + 0.5 * plan.steps)[:first] / time
    np.testing.assert_allclose(act[:first, 0], 0.3 * middle, atol=1e-12)
    np.testing.assert_allclose(act[:first, 2], 0.3 * plan.steps[:first] / time, rtol=0.02)
    np.testing.assert_allclose(act[first:, [0, 2]], [[0.3, 0.0]] * (plan.steps.size - first), atol=1e-12)


def test_steps_as_long_as_was_asked_for_hold_the_rudder():
    """What a user chooses is what is integrated: the paper's cases are of that kind."""
    model, par, t, inputs, _ = reversals("generic_sub", {})
    plan = plan_run(model, t, inputs, max_step=0.5)
    act, _ = actuate(model, par, plan)
    na = len(model.kernel.actuators)
    assert np.ptp(act[:, 0]) > 0.6 and np.abs(act[:, na:]).max() < 0.5 * np.ptp(act[:, 0])


@pytest.mark.thorough
def test_a_late_rudder_is_followed_by_every_way_to_run():
    """Single run, lanes among other delays, sensitivities, adjoint, interval maps: the same steps."""
    model, par, t, inputs, x0 = reversals("nps_auv2", LATE[0])
    plan = plan_run(model, t, inputs)
    expected = simulate(model, par, plan, x0).states
    n, scale = expected.shape[1], np.abs(expected).max(axis=0)
    pars = np.repeat(model.nominal[None], 19, axis=0)
    pars[:, model.index["actuator_dead_time.delay"]] = np.linspace(0.0, 3.0, 19)
    pars[7] = par
    free = model.positions(["actuator_dead_time.delay", "Y_v"])
    slopes = sensitivities(model, par, plan, x0, free)
    weight = np.ones_like(expected) / scale
    states, by_par, _ = gradient(model, par, plan, x0, lambda s: weight)
    many = gradient_batch(model, pars, plan, x0, lambda s: np.broadcast_to(weight, s.shape))
    for found in (simulate_batch(model, pars, plan, x0)[7], slopes.track.states, states, many[0][7]):
        assert np.abs((found[:, :n] - expected) / scale).max() < 1e-10
    by_delay = np.einsum("ix,ixk->k", weight, slopes.jacobian[:, :, :2])
    assert np.allclose(by_par[free], by_delay, rtol=1e-8)
    assert np.allclose(many[1][7, free], by_delay, rtol=1e-8)
    ends = interval_maps(model, par, plan, expected, (), free).ends
    assert np.abs((ends - expected[1:]) / scale).max() < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize(("name", "within"), [("generic_sub", 0.1), ("suboff_full", 0.4)])
def test_steps_of_six_degrees_converge_regularly(name, within):
    """As above with planes at work, drift and heave changing sign: default steps [m], above second order.

    A fin on the straight line with its mean and moment leaves third order until errors are below 1 mm: a
    quarter of a step leaves 0.7 % (generic_sub) and 4 % (suboff_full, unstable) of them; second order 6 %.
    The jump of Y_v|r| and Z_w|q| at v = 0 and w = 0 left 1.6 m and no regular order.
    """
    model = model_of(name, 6)
    time = model.scales["L"] / model.scales["U"]
    k = np.arange(26)
    t = 1.6 * time * k
    inputs = {
        "delta_r_cmd": 0.35 * (-1.0) ** k * (k > 0),
        "delta_s_cmd": 0.1 * (-1.0) ** (k // 3) * (k > 0),
        "n_cmd": np.full(26, model.vehicle.rpm_ref),
    }
    x0 = steady_start(model)
    reference, default, *rest = (
        simulate(model, model.nominal, plan_run(model, t, inputs, max_step=step), x0).states
        for step in (0.0003 * time, None, 0.02 * time, 0.01 * time, 0.005 * time)
    )
    assert np.linalg.norm((default - reference)[:, :3], axis=1).max() < within
    errors = [np.linalg.norm((states - reference)[:, :3], axis=1).max() for states in rest]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2] and errors[0] > 20.0 * errors[2]
    assert errors[2] < 1e-3


def lively(name, dof):
    """Both rudder sides, changing shaft speed, a chain with a rate limit: twelve samples, uneven in time."""
    model = model_of(name, dof)
    L, U, rpm = model.scales["L"], model.scales["U"], model.vehicle.rpm_ref
    t = np.cumsum([0.0, 0.5, 0.3, 0.5, 0.9, 0.2, 0.5, 0.4, 0.5, 0.5, 0.7, 0.5]) * L / U
    inputs = {
        "delta_r_cmd": 0.2 * np.sin(3.0 * np.arange(12)),
        "n_cmd": rpm * (1 + 0.1 * np.cos(np.arange(12))),
    }
    if dof == 6:
        inputs |= {"delta_s_cmd": 0.05 * np.cos(2.0 * np.arange(12))}
    return model, plan_run(model, t, inputs), steady_start(model)


def variants_agree(name, dof):
    """Worst relative difference of every other way to run the same vehicle from the plain run."""
    model, plan, x0 = lively(name, dof)
    par = model.nominal
    expected = simulate(model, par, plan, x0).states
    n, scale = expected.shape[1], np.maximum(np.abs(expected).max(axis=0), 1e-9)
    free = model.positions(["m", "Y_v"])
    others = {
        "full": simulate(model, par, plan, x0, full=True).states[:, :n],
        "lanes": simulate_batch(model, np.repeat(par[None], 19, 0), plan, x0)[18],
        "lanes, full": simulate_batch(model, par[None], plan, x0, full=True)[0][:, :n],
        "variational": sensitivities(model, par, plan, x0, free).track.states,
        "variational, full": sensitivities(model, par, plan, x0, free, full=True).track.states[:, :n],
        "adjoint": gradient(model, par, plan, x0, np.zeros_like)[0],
    }
    return {key: np.abs((states - expected) / scale).max() for key, states in others.items()}


def test_planar_kernel_variants_agree():
    assert max(variants_agree("generic_sub", 3).values()) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("name", "dof"), [p for p in BOTH if p.values != ("generic_sub", 3)])
def test_every_kernel_variant_agrees(name, dof):
    assert max(variants_agree(name, dof).values()) < 1e-12


def test_lanes_run_each_vehicle_as_if_alone():
    """Different parameters, actuator chains and starts side by side; a batch that leaves lanes empty."""
    model, plan, x0 = lively("generic_sub", 3)
    rng = np.random.default_rng(1)
    pars = model.nominal * (1 + 0.02 * rng.standard_normal((19, model.nominal.size)))
    pars[:, model.index["actuator_lag.tau"]] = rng.uniform(0, 5, 19)
    starts = x0 + 0.01 * rng.standard_normal((19, x0.size))
    found = simulate_batch(model, pars, plan, starts)
    for i in (0, 15, 16, 18):
        alone = simulate(model, pars[i], plan, starts[i]).states
        assert np.allclose(found[i], alone, rtol=1e-11, atol=1e-11 * np.abs(alone).max())


def test_threads_do_not_change_a_batch():
    model, plan, x0 = lively("generic_sub", 3)
    pars = model.nominal * (1 + 0.02 * np.random.default_rng(2).standard_normal((130, model.nominal.size)))
    assert np.array_equal(
        simulate_batch(model, pars, plan, x0, threads=1), simulate_batch(model, pars, plan, x0, threads=2)
    )


def test_kernel_of_a_spec_is_named_after_it():
    assert KernelSpec(6, sections=21).name == "sixdof_strips21"
