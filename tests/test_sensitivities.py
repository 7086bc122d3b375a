"""Exact derivatives of whole runs: states, readings, actuator chain and adjoint, against central differences.

`test_physics_equations` checks one evaluation of every kernel; here the compiled loops around it are checked,
in the plane for every parameter, in six degrees of freedom for a sample (slow: for every parameter).
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from plain_kernel import uncompiled

from bayesid.equations.model import build_model
from bayesid.model.vehicles import builtin_names, load_vehicle
from bayesid.simulation import (
    actuate,
    gradient,
    observe,
    observe_sensitivity,
    plan_run,
    sensitivities,
    simulate,
    steady_start,
)

# A parameter moved by this share of its size: truncation and cancellation are both near 1e-8.
SHARE = 1e-4


def with_eta(vehicle):
    """The vehicle with propeller-loading rows, which no built-in set has."""
    rows = ("X_vv,eta", "Y_v,eta", "Y_dr,eta", "N_r,eta", "N_v|v|,eta", "Z_w,eta", "K_*,eta", "M_q,eta")
    return replace(vehicle, coef={**vehicle.coef, **dict.fromkeys(rows, -1e-3)})


@lru_cache
def case(name, dof=3, all_on=True, samples=13, eta=False):
    """A lively run of two hull lengths; every effect away from its off value, every row non-zero."""
    vehicle = load_vehicle(name)
    model = build_model(with_eta(vehicle) if eta else vehicle, dof)
    L, U, rpm = model.scales["L"], model.scales["U"], model.vehicle.rpm_ref
    k = np.arange(samples)
    t = np.cumsum([0.0, *(0.2 + 0.05 * (k[:-1] % 3))]) * L / U
    # The phase keeps every stage off the kinks (play, rate limit, signs) by more than a difference moves it.
    inputs = {"delta_r_cmd": 0.17 * np.sin(1.7 * k + 0.29), "n_cmd": rpm * (1 + 0.1 * np.cos(k))}
    if dof == 6:
        inputs |= {"delta_s_cmd": 0.06 * np.cos(1.3 * k), "delta_b_cmd": 0.05 * np.sin(k)}
    wind = {"wind_speed": 2.0 + 0.1 * k, "wind_from": 0.5 + 0.05 * k}
    plan = plan_run(model, t, inputs, exogenous=wind)
    par = model.nominal.copy()
    if all_on:
        rng = np.random.default_rng(5)
        for effect in model.kernel.effects:
            for p in effect.parameters:
                i = model.index[effect.key(p.name)]
                par[i] = p.off + 0.1 * model.prior_sd(effect.key(p.name)) * rng.uniform(0.5, 1.0)
        rows = model.positions(model.candidate_rows)
        par[rows] = [1e-3 * typical(model, n) for n in model.candidate_rows]
    x0 = steady_start(model)
    x0[list(model.states).index("v")] = 0.05 * U
    return model, par, plan, x0


def typical(model, name):
    """Size of a row that matters: 1/2 rho L^k U^(2 - degree)."""
    from bayesid.model.terms import term

    row, s = term(name), model.scales
    return 0.5 * s["rho"] * s["L"] ** row.length_power * s["U"] ** (2 - row.velocity_power)


def size_of(model, par, name):
    """What a change of this parameter is measured in."""
    from bayesid.model.terms import TERMS

    value, s = abs(par[model.index[name]]), model.scales
    if name == "actuator_dead_time.delay":  # a switch that comes to lie in another step leaves a kink
        return 0.01 * model.prior_sd(name)
    if "." in name:
        return model.prior_sd(name)
    if name in ("W", "B"):
        return 0.01 * value
    if value != 0.0:
        return value
    if name.startswith("y_"):  # lists the vehicle: one degree, not ten
        return 1e-3 * s["L"]
    if name.startswith(("point", "x_", "z_")):
        return 0.1 * s["L"]
    if name.startswith("I"):
        return model.nominal[model.index["Izz"]]
    if name == "torque_ref":
        return 1e-5 * s["rho"] * s["L"] ** 3 * s["U"] ** 2
    row = next((t for t in TERMS if t.name == name), None)
    if row is not None and row.group == "propulsion":
        rpm = model.nominal[model.index["rpm_ref"]]
        return (
            1e-3
            * s["rho"]
            * s["L"] ** 2
            * s["U"] ** 2
            / rpm ** -row.unit_powers[3]
            / s["U"] ** row.name.count("u")
        )
    return 1e-3 * typical(model, name) if row is not None else 1.0


def step_of(model, name, size):
    """Change of a parameter for a difference: smaller where the run is far from linear in it.

    How long a servo runs, and out of the plane the trim by an arm of the whole weight: at `SHARE` the
    difference was off by 2e-6 (servo), 2e-5 (weight, buoyancy) to 9e-5 (trim). A tenth of the step leaves
    1e-9 of the first two; in the plane the weight does next to nothing and so little is lost in rounding.
    """
    heavy = model.dof == 6 and name in ("W", "B")
    if name.endswith("inverse_rate_excess") or name.startswith("servo_lag") or heavy:
        return 0.1 * SHARE * size
    trims = model.dof == 6 and name.removeprefix("cg_offset_x.")[:2] in ("x_", "z_")
    return (0.01 if trims else 1.0) * SHARE * size


def typical_size(model, names, values):
    """Range of each state or channel, at least a hundredth of what the vehicle usually does."""
    L, U = model.scales["L"], model.scales["U"]
    usual = {**dict.fromkeys("xyz", L), **dict.fromkeys("pqr", U / L), "phi": 1.0, "theta": 1.0, "psi": 1.0}
    floor = np.array([0.01 * usual.get(name, U) for name in names])
    return np.maximum(np.abs(values).max(axis=0), floor)


def worst(found, expected, floor):
    """Difference over the column's own size, or over a floor where the column is next to nothing."""
    size = np.maximum(np.abs(expected).max(), floor)
    return np.abs(found - expected).max() / size


def misjudged(model, par, plan, x0, names, readings=True, tolerance=1e-6):
    """Parameters whose exact derivatives differ from central differences, with the difference.

    One of two steps must agree: where a switch lies between the two sides of the larger one (N_* of lauv:
    1e-5) the smaller one misses it (1e-11); a wrong derivative agrees with neither.
    """
    free = model.positions(names)
    result = sensitivities(model, par, plan, x0, free, full=True, rates=True)
    obs, by_obs = observe_sensitivity(model, par, plan, result, free)
    base = simulate(model, par, plan, x0, full=True)
    assert np.allclose(
        obs, observe(model, par, plan, base.states, result.rate, full=True), rtol=1e-10, atol=1e-10
    )
    scale = typical_size(model, base.names, base.states)
    obs_scale = typical_size(model, model.kernel.channels, obs)
    wrong = {}
    for c, name in enumerate(names):
        size, i = size_of(model, par, name), model.index[name]
        floor = 1e-4 / size  # a 1e-4 change of the run for a change of the parameter by its own size
        error = np.inf
        for h in (step_of(model, name, size), 0.1 * step_of(model, name, size)):
            if error < tolerance:
                break
            found = []
            for sign in (1, -1):
                moved = par.copy()
                moved[i] += sign * h
                run = sensitivities(model, moved, plan, x0, free[:1], initial=False, full=True, rates=True)
                seen = observe(model, moved, plan, run.track.states, run.rate, full=True)
                found.append((run.track.states, seen))
            by_state = (found[0][0] - found[1][0]) / (2 * h)
            by_reading = (found[0][1] - found[1][1]) / (2 * h)
            here = worst(result.jacobian[:, :, c] / scale, by_state / scale, floor)
            here = max(here, worst(by_obs[:, :, c] / obs_scale, by_reading / obs_scale, floor))
            error = min(error, here)
        if not error < tolerance:
            wrong[name] = error
    return wrong


def smooth_parameters(model):
    """All but the limits of the fins, which act on a run only by switching, and what a vehicle without fins
    has no slope by: effects on fins, and their servos."""
    aside = ("limit", "servo_lag") if model.vehicle.thrusters else ("limit",)
    there = (n for n in model.kernel.parameters if "." not in n or n.split(".")[0] in model.effects)
    return [n for n in there if not n.startswith(aside)]


@pytest.mark.parametrize("name", ["generic_sub"])
def test_every_planar_parameter_has_its_exact_derivative(name):
    """Mass and shape properties, rows stated and not stated, effects, thrust; states and readings: 1e-6."""
    model, par, plan, x0 = case(name)
    assert misjudged(model, par, plan, x0, smooth_parameters(model)) == {}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "dof", "eta", "lengths"),
    [
        ("delphin2", 3, False, (3,)),
        ("nps_auv2", 3, False, (3,)),
        ("generic_sub", 6, False, (2, 3)),
        ("generic_sub", 3, True, (3,)),
    ],
    ids=["thrust curve", "strips", "six degrees", "propeller loading"],
)
def test_every_parameter_of_every_kernel_has_its_exact_derivative(name, dof, eta, lengths):
    """The text of the kernels run as plain Python over three samples; compiled runs are slow tests.

    In six degrees over two samples, a tenth of the time, and over three what leaves no trace in two (a plane
    that has not moved yet). Of the large kernels only the parameters that `generic_sub` does not have in the
    plane, which has them compiled above.
    """
    above = set(case("generic_sub")[0].kernel.parameters)
    wanted = None
    for samples in lengths:
        model, par, plan, x0 = case(name, dof, samples=samples, eta=eta)
        plain = uncompiled(model)
        wanted = [n for n in smooth_parameters(model) if n not in above] if wanted is None else wanted
        assert misjudged(plain, par, plan, x0, wanted) == {}
        wanted = without_trace(plain, par, plan, x0, wanted)
    # three samples are too few for a servo of the planes; strips have no heave in the plane
    assert set(wanted) <= {"servo_lag_s", "servo_lag_b", "strip_Z"}


def without_trace(model, par, plan, x0, names):
    """Parameters that change nothing in this run, so that any derivative of zero would pass."""
    free = model.positions(names)
    result = sensitivities(model, par, plan, x0, free, full=True, rates=True)
    _, by_obs = observe_sensitivity(model, par, plan, result, free)
    moved = [np.abs(slopes).max(axis=(0, 1)) for slopes in (result.jacobian[:, :, : free.size], by_obs)]
    return [n for n, *sizes in zip(names, *(m[: free.size] for m in moved), strict=True) if not max(sizes)]


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in builtin_names() if n != "generic_sub"])
def test_every_planar_parameter_of_every_vehicle_has_its_exact_derivative(name):
    model, par, plan, x0 = case(name)
    assert misjudged(model, par, plan, x0, smooth_parameters(model)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["generic_sub", "nps_auv2"])
def test_every_parameter_in_six_degrees_has_its_exact_derivative(name):
    model, par, plan, x0 = case(name, 6)
    assert misjudged(model, par, plan, x0, smooth_parameters(model)) == {}


def test_derivatives_hold_where_effects_are_off():
    """At their off values, where a diagnosis differentiates; smooth effects only, two-sided differences."""
    model, _, plan, x0 = case("generic_sub")
    names = [e.key(p.name) for e in model.kernel.effects if e.smooth for p in e.parameters]
    skipped = (
        "actuator_lag",
        "actuator_dead_time",
        "position_latency",
        "velocity_latency",
        "ground_velocity_latency",
    )  # one-sided: below
    names = [n for n in names if not n.startswith(skipped)]
    assert misjudged(model, model.nominal, plan, x0, names) == {}


@pytest.mark.parametrize(
    "name",
    [
        "actuator_dead_time.delay",
        "actuator_backlash.half_width",
        "actuator_rate_limit.inverse_rate_excess",
        "position_latency.delay",
        "velocity_latency.delay",
        "ground_velocity_latency.delay",
    ],
)
def test_one_sided_effects_have_the_slope_of_their_own_side(name):
    """Forward differences at 1e-6 of the prior width, of first order only: 1e-3 of the column."""
    model, _, plan, x0 = case("generic_sub")
    par, free = model.nominal, model.positions([name])
    result = sensitivities(model, par, plan, x0, free, initial=False, full=True, rates=True)
    obs, by_obs = observe_sensitivity(model, par, plan, result, free)
    h = 1e-6 * model.prior_sd(name)
    moved = par.copy()
    moved[free] += h
    run = sensitivities(model, moved, plan, x0, free, initial=False, full=True, rates=True)
    expected = (observe(model, moved, plan, run.track.states, run.rate, full=True) - obs) / h
    scale = np.maximum(np.abs(obs).max(axis=0), 1e-9)
    assert np.abs(expected).max() > 0.0
    assert worst(by_obs[:, :, 0] / scale, expected / scale, 0.0) < 1e-3


@pytest.mark.parametrize("late", [0.0, 0.73])
@pytest.mark.parametrize("name", ["thrusters_port_stbd_dead_time", "thruster_port_dead_time"])
def test_the_slope_by_a_dead_time_of_orders_that_switch_together(name, late):
    """Two delayed switches at one time are one edge of the pieces, which moves with both delays."""
    model = build_model(load_vehicle("differential_boat"), 3)
    t = np.arange(0.0, 12.0, 0.9)
    swing = np.where(np.arange(t.size) // 3 % 2 == 0, 1.0, -0.6)
    plan = plan_run(model, t, {"n_port_cmd": 900 * swing, "n_stbd_cmd": 500 - 300 * swing})
    column = model.kernel.full.act_columns.index(model.index[f"{name}.delay"])
    at = model.with_values({f"{name}.delay": late})
    _, slopes = actuate(model, at, plan, slopes=True, full=True)
    h = 1e-5
    here, then = (
        actuate(model, model.with_values({f"{name}.delay": late + d}), plan, full=True)[0] for d in (h, 2 * h)
    )
    expected = (then - here) / h
    assert np.abs(expected).max() > 100.0
    np.testing.assert_allclose(slopes[:, :, column], expected, atol=2e-3 * np.abs(expected).max())


def test_lag_inside_a_rate_limit_starts_without_slope():
    """A servo that runs at its limit loses tau^2 only: a diagnosis must look at a lag that is not zero."""
    model, _, plan, _ = case("generic_sub")
    _, slopes = actuate(model, model.nominal, plan, slopes=True, full=True)
    column = model.kernel.full.act_columns.index(model.index["actuator_lag.tau"])
    change = []
    for tau in (1e-3, 1e-4):
        late, _ = actuate(model, model.with_values({"actuator_lag.tau": tau}), plan)
        change.append(np.abs(late - actuate(model, model.nominal, plan)[0])[:, 0].max())
    assert np.abs(slopes[:, 0, column]).max() < 1e-12
    assert change[0] / change[1] == pytest.approx(100.0, rel=1e-2)


def test_a_short_delay_is_not_lost_on_a_slow_rudder():
    """A rudder at its rate limit starts to move later by the delay, however long the steps are."""
    model = build_model(load_vehicle("generic_sub"), 3)
    t = np.array([0.0, 10.0, 20.0, 30.0])
    inputs = {"delta_r_cmd": np.array([0.0, 0.3, 0.3, 0.3]), "n_cmd": np.full(4, 60.0)}
    rate = 1.0 / model.nominal[model.index["inverse_rate_r"]]
    swept = []
    for delay in (0.0, 0.4):
        plan = plan_run(model, t, inputs, max_step=5.0)
        rudder, _ = actuate(model, model.with_values({"actuator_dead_time.delay": delay}), plan)
        swept.append(rudder[:, 0] @ plan.steps)
    assert 0.3 / rate < 10.0
    assert swept[0] - swept[1] == pytest.approx(0.3 * 0.4, rel=1e-12)


def test_initial_states_have_their_exact_derivatives():
    """With the start of the memory of the hull, which depends on them."""
    model, par, plan, x0 = case("generic_sub")
    result = sensitivities(model, par, plan, x0, np.array([], dtype=int))
    scale = typical_size(model, result.track.names, result.track.states)
    for i, name in enumerate(model.states):
        h = 1e-5 * max(abs(x0[i]), model.scales["U"] if name in "uv" else 0.1)
        low, high = x0.copy(), x0.copy()
        low[i] -= h
        high[i] += h
        expected = (simulate(model, par, plan, high).states - simulate(model, par, plan, low).states) / (
            2 * h
        )
        assert worst(result.jacobian[:, :, i] / scale, expected / scale, 0.0) < 1e-6, name


def test_slopes_add_up_to_the_change_of_force_where_heave_changes_sign():
    """Integral of d(dw/dt)/dw over w against the difference of dw/dt: 1 % of what Z_w|q| contributes.

    Its sign jumped at w = 0 by 2 |v q|, which no slope held: 100 % of it was missing.
    """
    model, par, _, x0 = case("generic_sub", 6, all_on=False, samples=3)
    model, (L, U) = uncompiled(model), (model.scales["L"], model.scales["U"])
    plan = plan_run(model, np.array([0.0, 1e-3 * L / U]), {"n_cmd": np.full(2, 60.0)}, max_step=L / U)
    v, w, q = (model.states.index(name) for name in "vwq")
    x0[[v, q]] = 0.05 * U, 0.3 * U / L

    def heave(at, par):
        x0[w] = at
        return sensitivities(model, par, plan, x0, np.array([], dtype=int))

    without = par.copy()
    without[model.index["Z_w|q|"]] = 0.0
    edges = np.linspace(-0.001 * U, 0.001 * U, 101)
    found, change = [], []
    for values in (par, without):
        slopes = [heave(at, values).jacobian[1, w, w] - 1.0 for at in 0.5 * (edges[1:] + edges[:-1])]
        found.append(np.sum(slopes) * (edges[1] - edges[0]))
        last, first = (heave(at, values).track["w"][1] - at for at in edges[[-1, 0]])
        change.append(last - first)
    assert abs(change[0] - change[1]) > 1e-7 * U
    assert found[0] - found[1] == pytest.approx(change[0] - change[1], rel=0.01)


@pytest.mark.parametrize("all_on", [False, True], ids=["bare", "all effects"])
def test_adjoint_gradient_equals_the_forward_one(all_on):
    """A random scalar of the states, by every parameter and by the start: 1e-10."""
    model, par, plan, x0 = case("generic_sub", all_on=all_on)
    free = np.arange(par.size)
    result = sensitivities(model, par, plan, x0, free, full=all_on)
    scale = 1.0 / typical_size(model, result.track.names, result.track.states)
    weight = np.random.default_rng(3).standard_normal(result.track.states.shape) * scale
    states, by_par, by_x0 = gradient(model, par, plan, x0, lambda s: weight, full=all_on)
    expected = np.einsum("ix,ixk->k", weight, result.jacobian)
    assert np.array_equal(states, result.track.states) or np.allclose(states, result.track.states, rtol=1e-13)
    found = np.concatenate([by_par, by_x0])
    size = np.maximum(
        np.abs(expected),
        1e-10 * np.abs(expected * np.append(par, x0)).max() / np.maximum(np.abs(np.append(par, x0)), 1e-6),
    )
    assert (np.abs(found - expected) / np.maximum(size, 1e-300)).max() < 1e-10


@pytest.mark.slow
def test_adjoint_gradient_equals_the_forward_one_in_six_degrees():
    model, par, plan, x0 = case("generic_sub", 6)
    result = sensitivities(model, par, plan, x0, np.arange(par.size))
    size = typical_size(model, result.track.names, result.track.states)
    weight = np.ones_like(result.track.states) / size
    _, by_par, by_x0 = gradient(model, par, plan, x0, lambda s: weight)
    expected = np.einsum("ix,ixk->k", weight, result.jacobian)
    found = np.concatenate([by_par, by_x0])
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize(
    "name",
    [
        "rudder_offset.offset",
        "actuator_lag.tau",
        "actuator_dead_time.delay",
        "actuator_backlash.half_width",
        "actuator_rate_limit.inverse_rate_excess",
        "inverse_rate_r",
        "limit_r",
    ],
)
def test_positions_of_the_rudder_have_exact_slopes(name):
    """Chain with every link at work: a slow servo with lag, play, a delay, and a stop the command reaches."""
    model, _, plan, _ = case("generic_sub")
    par = model.with_values(
        {
            "rudder_offset.offset": 0.02,
            "actuator_lag.tau": 0.3 * plan.t[1],
            "actuator_dead_time.delay": 0.37 * plan.t[1],
            "actuator_backlash.half_width": 0.01,
            "actuator_rate_limit.inverse_rate_excess": plan.t[1],
            "limit_r": 0.12,
        }
    )
    i, h = model.index[name], 1e-6
    _, slopes = actuate(model, par, plan, slopes=True)
    low, high = par.copy(), par.copy()
    low[i] -= h
    high[i] += h
    expected = (actuate(model, high, plan)[0] - actuate(model, low, plan)[0]) / (2 * h)
    column = model.kernel.full.act_columns.index(i)
    assert np.abs(expected).max() > 0.0
    assert worst(slopes[:, :, column], expected, 0.0) < 1e-6


def test_a_delayed_measured_rudder_is_read_off_the_line_between_its_samples():
    """No jump at delay = 0, and the slope of the line; a delay by one sample shifts the samples by one."""
    model = build_model(load_vehicle("generic_sub"), 3)
    t = np.arange(0.0, 40.0, 2.0)
    rudder = 0.1 * np.sin(0.3 * t)
    plan = plan_run(model, t, {"n_cmd": np.full(t.size, 60.0)}, {"delta_r": rudder}, max_step=2.0)
    positions = [
        actuate(model, model.with_values({"actuator_dead_time.delay": d}), plan)[0][:, 0]
        for d in (0.0, 1e-9, 2.0)
    ]
    assert np.allclose(positions[0], positions[1], atol=1e-9)
    assert np.allclose(positions[2][1:], positions[0][:-1], atol=1e-12)
