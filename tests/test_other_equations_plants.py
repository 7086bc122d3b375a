"""Plants with other equations: equilibria, symmetry, energy, another implementation, step, causes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bayesid.benchmark.other_equations import (
    LISTED,
    UNLISTED,
    VEHICLES,
    draw_campaign,
    executed,
    other_vehicle,
)
from bayesid.benchmark.other_equations.bundles import write_bundle
from bayesid.benchmark.other_equations.campaign import start_of
from bayesid.benchmark.other_equations.causes import KIND, settings_of
from bayesid.benchmark.other_equations.evidence import evidence, fitted_start
from bayesid.benchmark.other_equations.mmg_ship import mirrored_ship, self_propulsion_rps, ship_numbers
from bayesid.benchmark.other_equations.runs import RunPlan, mirrored_plan, orders_of
from bayesid.benchmark.other_equations.simulate import CHANNELS, carried, readings, simulate_run
from bayesid.benchmark.other_equations.strip_auv import auv_numbers, lift_of
from bayesid.errors import ModelError
from bayesid.model.effects import CATALOGUE
from bayesid.model.notation import STATES

PLAIN = settings_of(())


def cause(**fields):
    g = np.zeros(1, KIND)[0]
    for name, value in fields.items():
        g[name] = value
    return g


def rate_of(vehicle, x, delta=0.0, rps=None, g=PLAIN):
    out = np.empty(12)
    vehicle.rates(
        0.0, np.asarray(x, float), delta, rps or vehicle.rpm / 60, np.zeros(3), vehicle.numbers, g, out
    )
    return out


def state(**fields):
    x = np.zeros(12)
    for name, value in fields.items():
        x[STATES.index(name)] = value
    return x


@pytest.mark.parametrize("name", ["tanker_model", "tanker"])  # speeds are kept off zero by 1e-6 m/s
def test_a_ship_on_a_straight_course_keeps_the_speed_its_thrust_balances(name):
    v = other_vehicle(name)
    rps = self_propulsion_rps(v.numbers, v.U)
    assert rate_of(v, state(u=v.U), rps=rps)[6:] == pytest.approx(np.zeros(6), abs=1e-7)
    faster = rate_of(v, state(u=v.U), rps=1.05 * rps)
    assert faster[6] > 1e-4 * v.U**2 / v.L


@pytest.mark.parametrize("name", ["tanker_model", "tanker"])
def test_a_side_force_is_a_share_of_the_thrust_that_balances_the_drag(name):
    # a simulator knows its net thrust alone: that of the open propeller is larger by the thrust deduction
    v = other_vehicle(name)
    b, rps = v.numbers, self_propulsion_rps(v.numbers, v.U)
    with_it, without = (
        rate_of(v, state(u=v.U), rps=rps, g=g) for g in (cause(side_force=0.1), PLAIN)
    )  # fmt: skip
    mass, added = b["rho"] * b["volume"], 0.5 * b["rho"] * b["L"] ** 2 * b["d"] * b["m_y"]
    v_dot, r_dot = (with_it - without)[[7, 11]]
    drag = 0.5 * b["rho"] * b["L"] * b["d"] * v.U**2 * b["R_0"]
    assert (mass + added) * v_dot + mass * b["x_G"] * r_dot == pytest.approx(0.1 * drag, rel=1e-5)


def test_the_auv_settles_at_its_speed_and_rolls_against_the_torque_of_its_propeller():
    v = other_vehicle("strip_auv")
    t = np.arange(0.0, 60.0, 0.4)
    orders = np.column_stack([np.zeros(t.size), np.full(t.size, v.rpm)])
    end = simulate_run(v, PLAIN, t, orders, state(u=v.U, z=v.depth)).states[-1]
    assert end[6] == pytest.approx(v.U, rel=0.01)  # plus what a rolled vehicle pays for its depth
    b, rps = v.numbers, v.rpm / 60
    torque = b["rho"] * rps**2 * b["D_P"] ** 5 * b["k_Q"]
    # righting moment at rest in roll: m g z_G sin phi = Q (closed form)
    assert math.sin(-end[3]) == pytest.approx(torque / (9.81 * b["m"] * b["z_G"]), rel=0.03)


def test_a_turning_circle_is_that_of_another_implementation_of_the_mmg_method():
    # shipmmg 0.0.11 (ShipMMG project), its wake replaced by that of the paper, centre of gravity amidships,
    # 35 degrees of rudder at once, 1.179 m/s: advance, transfer, tactical diameter over L, then steady u v r
    b = ship_numbers(7.0, x_G=0.0)
    ship = replace(other_vehicle("tanker_model"), numbers=b)
    rps = self_propulsion_rps(b, 1.179)
    wanted = {
        -1: (2.7411043, 1.2037600, 2.8110835, 0.39694372, -0.13829315, 0.05798065),
        +1: (2.7744290, 1.2150941, 2.8155235, 0.39776822, 0.14052321, -0.05982343),
    }
    for port, numbers in wanted.items():
        rudder, shaft = np.full(3001, port * math.radians(35)), np.full(3001, rps)
        s = carried(ship, PLAIN, 0.0, state(u=1.179), rudder, shaft, 0.05)
        turned = np.abs(s[:, 5])
        across = np.abs(s[:, 1])
        places = [np.interp(math.pi / 2, turned, s[:, 0]), np.interp(math.pi / 2, turned, across)]
        found = [*np.divide([*places, np.interp(math.pi, turned, across)], 7), *s[-1, [6, 7, 11]]]
        assert found == pytest.approx(numbers, rel=2e-5)


def test_kvlcc2_turns_within_the_limits_imo_sets_and_its_models_keep_easily():
    v = other_vehicle("tanker_model")
    rps = self_propulsion_rps(v.numbers, 1.179)
    for port in (-1, 1):
        t = np.arange(0.0, 150.0, 0.5)
        orders = np.column_stack([np.full(t.size, port * math.radians(35)), np.full(t.size, 60 * rps)])
        orders[0, 0] = 0.0  # the rudder starts amidships and moves at its rate
        s = simulate_run(v, PLAIN, t, orders, state(u=1.179)).states
        turned = np.abs(s[:, 5])
        advance, diameter = (
            np.interp(a, turned, np.abs(s[:, k])) / 7 for a, k in ((math.pi / 2, 0), (math.pi, 1))
        )
        # IMO MSC.137(76): 4.5 and 5 lengths; free-running models of the hull turn in 3 to 3.4 lengths
        assert 2.8 < advance < 3.5 and 2.8 < diameter < 3.5


def run_of(v, kind="zigzag", **more):
    return RunPlan("r1", kind, "identify", kind, math.radians(10), math.radians(10), 1.0, v.rpm,
                   60 * v.LU - 60 * v.LU % v.dt, v.dt, 0.0, 0.4, (3.0, 5.0), **more)  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["zigzag", "turn", "spiral"])
def test_mirrored_orders_give_the_mirrored_track_of_the_mirrored_ship(kind):
    v = other_vehicle("tanker_model")
    w = replace(v, numbers=mirrored_ship(v.numbers))
    plan = run_of(v, kind)
    one, two = (
        simulate_run(ship, PLAIN, p.t, orders_of(ship, p), state(u=v.U, psi=p.heading, y=p.place[1]))
        for ship, p in ((v, plan), (w, mirrored_plan(plan)))
    )
    sign = np.ones(12)
    sign[[1, 3, 5, 7, 9, 11]] = -1.0
    assert two.states == pytest.approx(one.states * sign, abs=1e-9)
    same = simulate_run(v, PLAIN, plan.t, orders_of(v, mirrored_plan(plan)), two.states[0])
    assert np.abs(same.states - two.states)[:, :2].max() > 0.01 * v.L  # flow straightening differs by side


def test_mirrored_orders_give_the_mirrored_track_of_an_auv_without_propeller_torque():
    v = other_vehicle("strip_auv")
    v = replace(v, numbers=auv_numbers(k_Q=0.0))
    plan = run_of(v)
    one, two = (
        simulate_run(v, PLAIN, p.t, orders_of(v, p), state(u=v.U, psi=p.heading, y=p.place[1], z=5.0))
        for p in (plan, mirrored_plan(plan))
    )
    sign = np.ones(12)
    sign[[1, 3, 5, 7, 9, 11]] = -1.0
    assert two.states == pytest.approx(one.states * sign, abs=1e-7)
    assert np.abs(one.states[:, 3]).max() > math.radians(0.5)  # it rolls


@pytest.mark.parametrize("seed", range(3))
def test_momentum_and_weight_of_the_auv_do_no_work_together_and_strips_and_drag_only_take(seed):
    nothing = dict.fromkeys(("drag", "body_lift", "C_dc", "K_pp", "S_fin", "k_0", "k_1", "k_Q"), 0.0)
    x = np.random.default_rng(seed).normal(0.0, 0.3, 12)
    x[6] += 1.5

    def power(**kept):
        numbers = auv_numbers(**(nothing | kept))
        v = replace(other_vehicle("strip_auv"), numbers=numbers)
        rates = rate_of(v, x)
        gain = x[6:] @ numbers["mass"] @ rates[6:]
        # the centre of gravity lies z_G below the centre of buoyancy: height lost is energy gained
        c, s, ct, st = math.cos(x[3]), math.sin(x[3]), math.cos(x[4]), math.sin(x[4])
        lost = numbers["m"] * 9.81 * numbers["z_G"] * (s * ct * rates[3] + c * st * rates[4])
        return gain + lost

    assert power() == pytest.approx(0.0, abs=1e-10)
    assert power(C_dc=1.1) < 0 and power(drag=1.62, K_pp=0.13) < 0
    assert power(S_fin=0.01, fin_drag=0.0, induced=0.0) == pytest.approx(0.0, abs=1e-10)  # lift is across
    assert power(S_fin=0.01) < 0


def test_fins_lift_linearly_at_small_angles_and_less_beyond_stall():
    assert lift_of(0.05, 3.12, 0.45) == pytest.approx(3.12 * 0.05, rel=0.01)
    assert lift_of(-0.05, 3.12, 0.45) == -lift_of(0.05, 3.12, 0.45)
    angles = np.linspace(0.0, 0.7, 71)
    lift = [lift_of(a, 3.12, 0.45) for a in angles]
    assert 0.3 < angles[int(np.argmax(lift))] < 0.5 and lift[-1] < 0.8 * max(lift)


@pytest.mark.thorough
@pytest.mark.parametrize("name", VEHICLES)
def test_halving_the_step_changes_no_reading_by_a_tenth_of_the_noise(name):
    c = draw_campaign(5, name)
    for plan in c.runs[:3]:
        x0 = start_of(c, plan, PLAIN)
        law = orders_of(c.vehicle, plan)
        first = simulate_run(c.vehicle, PLAIN, plan.t, law, x0)
        finer = simulate_run(c.vehicle, PLAIN, plan.t, first.orders, x0, step=0.5 * c.vehicle.step)
        one, two = (readings(PLAIN, r.fine, r.states, r.parts) for r in (first, finer))
        assert (np.abs(one - two).max(axis=0) < [0.1 * c.vehicle.noise[n] for n in CHANNELS]).all()


def test_every_listed_cause_is_named_and_parametrised_as_in_the_catalogue():
    effects = {e.name: {p.name for p in e.parameters} for e in CATALOGUE}
    wind = {"from"}  # of the label; the catalogue has the components
    for name in LISTED:
        planted = draw_campaign(1, "tanker", (name,)).planted[0]
        known = effects[name] | (wind if name == "wind" else set())
        assert set(planted.parameters) <= known
    assert not set(UNLISTED) & set(effects)


SENSORS = ("gyro_scale", "heading_bias", "heading_drift", "velocity_latency", "position_lever_arm")
FORCES = tuple(n for n in (*LISTED, *UNLISTED) if n not in SENSORS)


@pytest.mark.thorough
@pytest.mark.parametrize("name", FORCES)
def test_every_cause_of_the_motion_moves_the_track_and_a_fitted_start_takes_only_a_part_of_it(name):
    c = draw_campaign(3, "tanker_model", (name,), (1.0,))
    c = replace(c, runs=(replace(c.runs[0], role="identify"),))  # a zig-zag
    runs = executed(c)
    shown = evidence(c, runs)
    assert shown["D"] > shown["D_pieces"] > 150.0
    assert evidence(c, runs, known=(name,))["D_pieces"] == pytest.approx(0.0, abs=1e-6)


def track(v, g, u=1.0, heading=0.5):
    t = np.arange(0.0, 60.0, v.dt)
    orders = np.column_stack([np.full(t.size, 0.1), np.full(t.size, v.rpm)])
    record = simulate_run(v, g, t, orders, state(u=u, psi=heading))
    return record, readings(g, record.fine, record.states, record.parts)


def test_a_current_carries_the_ship_along_and_shows_over_ground_only():
    v = other_vehicle("tanker_model")
    (still, clean), (moved, logged) = track(v, PLAIN), track(v, cause(current_n=0.1, current_e=-0.05))
    t = still.t[:, None]
    assert logged[:, :2] - clean[:, :2] == pytest.approx(t * [0.1, -0.05], abs=1e-9)
    assert moved.states[:, 6:] == pytest.approx(still.states[:, 6:], abs=1e-9)
    speed = np.hypot(*np.diff(logged[:, :2], axis=0).T) / v.dt
    middle = np.hypot(0.5 * (logged[1:, 4] + logged[:-1, 4]), 0.5 * (logged[1:, 5] + logged[:-1, 5]))
    assert middle == pytest.approx(speed, rel=2e-3)  # u, v are over ground


def test_sensor_causes_leave_the_motion_alone_and_change_their_own_readings():
    v = other_vehicle("tanker_model")
    _, clean = track(v, PLAIN)
    for fields, column in (
        ({"psi_bias": 0.03}, 2), ({"psi_drift": 0.003}, 2), ({"r_scale": 0.05}, 3), ({"v_late": 1.0}, 4),
        ({"arm_x": 1.0}, 0),
    ):  # fmt: skip
        _, logged = track(v, cause(**fields))
        changed = np.abs(logged - clean).max(axis=0) > 1e-6
        allowed = {2: [2], 3: [3], 4: [4, 5], 0: [0, 1]}[column]
        assert np.flatnonzero(changed).tolist() == allowed
    _, drifting = track(v, cause(psi_drift=0.003))
    assert drifting[:, 2] - clean[:, 2] == pytest.approx(0.003 * v.dt * np.arange(len(clean)))
    _, late = track(v, cause(v_late=2 * v.dt))
    assert late[2:, 4] == pytest.approx(clean[:-2, 4], abs=1e-12)


def test_gear_obeys_dead_time_lag_rate_offset_and_jam():
    v = other_vehicle("tanker_model")
    t = np.arange(0.0, 40.0, v.dt)
    orders = np.column_stack([np.where(t >= 5.0, 0.2, 0.0), np.full(t.size, v.rpm)])

    def rudder(**fields):
        record = simulate_run(v, cause(**fields), t, orders, state(u=1.0))
        return record.fine, record.rudder

    fine, plain = rudder()
    assert np.interp(5.0 + 0.2 / v.rudder_rate, fine, plain) == pytest.approx(0.2, abs=0.01)
    _, late = rudder(dead=2.0)
    assert np.interp(fine[fine > 8.0], fine + 2.0, plain) == pytest.approx(late[fine > 8.0], abs=1e-9)
    _, slow = rudder(slow=10.0)
    rate = 1.0 / (1.0 / v.rudder_rate + 10.0)
    assert np.interp(6.0, fine, slow) == pytest.approx(rate, rel=0.02)
    _, lag = rudder(lag=3.0)
    assert np.interp(8.0, fine, lag) == pytest.approx(0.2 * (1 - math.exp(-1)), rel=0.02)
    assert rudder(offset=0.05)[1] == pytest.approx(plain + 0.05)
    _, jam = rudder(jam_from=4.0, jam_for=6.0)
    assert np.abs(jam[fine < 9.9]).max() == 0.0 and np.interp(12.0, fine, jam) == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["strip_auv", "tanker_model"])
def test_the_lag_a_label_states_is_how_late_the_rudder_is(name):
    """The simulator of a bundle steers without a lag; the servo's own is none of what it knows."""
    c = draw_campaign(3, name, ("actuator_lag",), (1.0,))
    t = np.arange(0.0, 40.0 * c.vehicle.LU, c.vehicle.dt)
    small = 0.1 * c.vehicle.rudder_rate * c.vehicle.step  # the rate does not limit it
    orders = np.column_stack([np.where(t > 0, small, 0.0), np.full(t.size, c.vehicle.rpm)])
    record = simulate_run(c.vehicle, c.settings, t, orders, state(u=c.vehicle.U))
    short = small - record.rudder[record.fine >= c.vehicle.dt]
    late = np.sum(short) * (record.fine[1] - record.fine[0]) / small
    assert late == pytest.approx(c.planted[0].parameters["tau"], abs=1.1 * c.vehicle.step)


def test_a_start_is_fitted_exactly_where_the_model_is_linear():
    rng = np.random.default_rng(0)
    matrix, scale = rng.normal(size=(30, 4)), np.array([1.0, 0.1, 10.0, 1.0])
    wanted = rng.normal(size=30)
    exact = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    assert fitted_start(lambda z: matrix @ z, wanted, scale) == pytest.approx(exact, rel=1e-6)


def test_a_campaign_is_the_same_from_its_seed_and_its_bundle_tells_nothing_of_the_cause(tmp_path):
    one, two = (draw_campaign(9, "tanker_model", ("rudder_offset",), suite="track", sea="mid") for _ in "ab")
    a, b = executed(one), executed(two)
    assert all(np.array_equal(x.logged, y.logged, equal_nan=True) for x, y in zip(a, b, strict=True))
    write_bundle(one, a, "name = 1\n", tmp_path / "q")
    written = "".join(p.read_text("utf-8") for p in (tmp_path / "q").iterdir())
    assert "offset" not in written and "r[deg/s]" not in written and "psi[deg]" in written
    assert [r.role for r in one.runs].count("holdout") == 2
    sd = np.std(a[0].logged[:, 0] - a[0].clean[:, 0])
    assert sd == pytest.approx(one.sigma["x"], rel=0.15)


def test_what_is_not_known_is_refused():
    with pytest.raises(ModelError, match="no vehicle 'raft'"):
        draw_campaign(1, "raft")
    with pytest.raises(ModelError, match="no cause gremlins"):
        draw_campaign(1, "tanker", ("gremlins",))
