"""The plant against what is true of any vehicle, and against three other ways of getting the same track."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from reference_motion import make_rate
from scipy.integrate import solve_ivp

from bayesid.benchmark.plant import CASES, draw_campaign
from bayesid.benchmark.plant.body import build, factors_of
from bayesid.benchmark.plant.campaign import still
from bayesid.benchmark.plant.execute_campaign import execute_campaign
from bayesid.benchmark.plant.execute_run import execute_run, start_state
from bayesid.benchmark.plant.listed_causes import Scales
from bayesid.benchmark.plant.noise import ornstein_uhlenbeck
from bayesid.benchmark.plant.sensing import read
from bayesid.benchmark.plant.servo import kink_after, second_order, servo_at
from bayesid.benchmark.plant.settings import settings
from bayesid.errors import ModelError
from bayesid.model.vehicles import Propulsion, load_vehicle

NOTHING = settings()


def boat(name, dof=3, gap=NOTHING):
    vehicle = load_vehicle(name)
    return vehicle, build(vehicle, vehicle.coef, dof, gap)


def zigzag_table(t, LU, rudder, rpm, plane=0.0):
    """Rudder to and fro every ten lengths from five seconds on; the stern plane waves slowly."""
    orders = np.zeros((t.size, 3))
    orders[:, 0] = rudder * np.sign(np.sin(np.pi * (t - 4.9) / (10 * LU))) * (t >= 5)
    orders[:, 1] = plane * np.sin(2 * np.pi * t / (15 * LU))
    orders[:, 2] = rpm
    return orders


@pytest.mark.parametrize(("name", "dof"), [("nps_auv2", 3), ("nps_auv2", 6), ("delphin2", 3), ("lauv", 3)])
def test_bare_plant_equals_a_vector_formulation_integrated_by_dop853(name, dof):
    vehicle, body = boat(name, dof)
    speed, order, plane = body.number["U0"], math.radians(12.0), math.radians(2.0)
    t = np.arange(41) * 1.0
    orders = np.tile([0.0, plane, vehicle.rpm_ref], (t.size, 1))
    orders[5:, 0] = order
    slow = replace(vehicle, rates={**vehicle.rates, "delta_r": 0.1, "delta_s": 1e3})
    body = build(slow, slow.coef, dof, NOTHING)
    x0 = start_state(speed, 0.4, 10.0, NOTHING, (1.0, 2.0))
    track = execute_run(body, NOTHING, t, orders, x0)
    rate = make_rate(slow, planar=dof == 3)
    state, reached = x0[:12], []
    for span in ((0.0, 5.0), (5.0, 5.0 + order / 0.1), (5.0 + order / 0.1, 40.0)):

        def slope(now, y):
            return rate(y, (min(max(0.1 * (now - 5.0), 0.0), order), plane, 0.0), vehicle.rpm_ref)

        done = solve_ivp(slope, span, state, method="DOP853", rtol=1e-10, atol=1e-10)
        state = done.y[:, -1]
        reached.append(state)
    # 0.02 L/U of Runge-Kutta leaves less than a tenth of a millimetre in twenty lengths
    assert np.abs(track.states[-1, :12] - state).max() < 1e-4


def test_the_plant_lists_with_the_torque_of_an_open_water_curve():
    curve = {"Kt0": 0.45, "a": 1.1, "b": 1.0, "w": 0.06, "t": 0.1, "D": 0.14, "rpm_ref": 850.0}
    turning = Propulsion("kt", {**curve, "Kq0": 0.07, "Kq_a": 1.2, "Kq_b": 1.3})
    vehicle = replace(load_vehicle("nps_auv2"), propulsion=turning)
    t, orders = np.arange(11) * 1.0, np.tile([0.0, 0.0, 850.0], (11, 1))
    tracks = []
    for one in (vehicle, replace(vehicle, propulsion=Propulsion("kt", curve))):
        body = build(one, one.coef, 6, NOTHING)
        tracks.append(execute_run(body, NOTHING, t, orders, start_state(1.2, 0.0, 10.0, NOTHING, (0.0, 0.0))))
    done = solve_ivp(
        lambda now, y: make_rate(vehicle)(y, (0.0, 0.0, 0.0), 850.0),
        (0.0, 10.0),
        start_state(1.2, 0.0, 10.0, NOTHING, (0.0, 0.0))[:12],
        method="DOP853",
        rtol=1e-10,
        atol=1e-10,
    )
    assert np.abs(tracks[0].states[-1, :12] - done.y[:, -1]).max() < 1e-4
    assert tracks[0].states[-1, 3] < tracks[1].states[-1, 3] - 1e-4  # to port; the control has no torque


@pytest.mark.parametrize(
    ("name", "duration", "dt", "angle"), [("generic_sub", 600, 1.0, 15), ("remus100", 210, 0.5, 10)]
)
def test_bare_plant_and_bayesid_simulate_tell_one_track_within_a_millimetre(name, duration, dt, angle):
    # the one place where both are imported; simulate holds the rudder at its mean over each step, so that its
    # error falls with the square of the step: 0.1 m at the default 0.08 L/U, 0.2 mm here
    from bayesid.equations.model import build_model
    from bayesid.simulation import plan_run, simulate

    vehicle, body = boat(name)
    t = np.arange(int(duration / dt) + 1) * dt
    LU = body.number["L"] / body.number["U0"]
    orders = zigzag_table(t, LU, math.radians(angle), vehicle.rpm_ref)
    x0 = start_state(body.number["U0"], 0.3, 0.0, NOTHING, (0.0, 0.0))
    track = execute_run(body, NOTHING, t, orders, x0, step=0.01)
    model = build_model(vehicle, 3)
    inputs = {"delta_r_cmd": orders[:, 0], "n_cmd": orders[:, 2]}
    other = simulate(
        model, model.nominal, plan_run(model, t, inputs, max_step=0.0025 * LU), x0[[0, 1, 5, 6, 7, 11]]
    )
    mine = track.states[:: track.parts]
    assert np.hypot(mine[:, 0] - other["x"], mine[:, 1] - other["y"]).max() < 1e-3
    assert np.abs(mine[:, 5] - other["psi"]).max() < 1e-5


def test_a_steady_current_only_carries_the_track_along():
    vehicle, _ = boat("generic_sub")
    t = np.arange(301) * 1.0
    orders = zigzag_table(t, 19.0, 0.2, 60.0)
    drift = settings({"vn": 0.4, "ve": -0.7})
    tracks = [
        execute_run(build(vehicle, vehicle.coef, 3, g), g, t, orders, start_state(5.4, 1.0, 0.0, g, (0, 0)))
        for g in (NOTHING, drift)
    ]
    still, carried = (track.states[:: track.parts] for track in tracks)
    assert np.abs(carried[:, :2] - still[:, :2] - t[:, None] * [0.4, -0.7]).max() < 1e-6


def test_mirrored_orders_give_the_mirrored_track():
    """With a propeller that turns the other way round, whose torque lists the hull to the other side."""
    vehicle, body = boat("remus100", 6)
    values = vehicle.propulsion.values
    other = replace(vehicle.propulsion, values={**values, "Q_ref": -values["Q_ref"]})
    mirrored = build(replace(vehicle, propulsion=other), vehicle.coef, 6, NOTHING)
    t = np.arange(81) * 0.5
    orders = zigzag_table(t, 0.86, 0.12, 1500.0, 0.01)
    x0 = start_state(1.5, 0.0, 5.0, NOTHING, (0.0, 0.0))
    port = execute_run(body, NOTHING, t, orders, x0).states[:, :12]
    starboard = execute_run(mirrored, NOTHING, t, orders * [-1.0, 1.0, 1.0], x0).states[:, :12]
    flip = np.array([1, -1, 1, -1, 1, -1] * 2)
    assert np.abs(port - flip * starboard).max() < 1e-9


def test_a_body_in_ideal_fluid_keeps_its_energy():
    # equations.md section 7: added-mass Coriolis and Munk terms of a body without viscosity do no work
    vehicle = load_vehicle("generic_sub")
    c = vehicle.coef
    ideal = {name: c[name] for name in ("X_udot", "Y_vdot", "Y_rdot", "N_vdot", "N_rdot")}
    ideal |= {"X_vr": -c["Y_vdot"], "X_rr": -c["Y_rdot"], "Y_r": c["X_udot"], "N_r": c["Y_rdot"]}
    ideal |= {"N_v": c["Y_vdot"] - c["X_udot"]}
    free = replace(vehicle, coef=ideal, propulsion=Propulsion("polynomial", {
        "a": 0.0, "b": 0.0, "c": 1e-3, "uc_per_rpm": 0.09, "rpm_ref": 60.0}))  # fmt: skip
    body = build(free, ideal, 3, NOTHING)
    x0 = start_state(4.0, 0.3, 0.0, NOTHING, (0.0, 0.0))
    x0[7], x0[11] = 0.8, 0.02
    t = np.arange(201) * 1.0
    track = execute_run(body, NOTHING, t, np.zeros((t.size, 3)), x0, step=0.1)
    kept = [0, 1, 5]
    mass = np.linalg.inv(body.inverse[np.ix_(kept, kept)])
    speed = track.states[:, [6, 7, 11]]
    energy = 0.5 * np.einsum("ki,ij,kj->k", speed, mass, speed)
    assert np.ptp(speed[:, 1]) > 1.0
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-6


def test_servo_solution_solves_its_own_equation():
    h, tau, rate, order = 1e-5, 0.4, 0.3, 0.5
    angle = -0.2
    for _ in range(150_000):
        angle += h * min(max((order - angle) / tau, -rate), rate)
    assert servo_at(-0.2, order, tau, rate, 1.5) == pytest.approx(angle, abs=2e-6)
    assert servo_at(-0.2, order, 0.0, rate, 1.5) == pytest.approx(-0.2 + 0.45)
    assert kink_after(-0.2, order, tau, rate, 9.0) == pytest.approx((0.7 - rate * tau) / rate)
    # stops at 0.1 rad on either side: the near one is left after a third of a second
    assert kink_after(-0.2, order, tau, rate, 0.1) == pytest.approx(1.0 / 3.0)


def test_second_order_servo_follows_the_textbook_step_response():
    w, z, t = 3.0, 0.6, 0.9
    damped = w * math.sqrt(1 - z * z)
    step = 1 - math.exp(-z * w * t) * (math.cos(damped * t) + z * w / damped * math.sin(damped * t))
    assert second_order(0.0, 0.0, 1.0, w, z, 1e9, t)[0] == pytest.approx(step, abs=2e-4)


@pytest.mark.parametrize(
    ("name", "product"),
    [("N_dr", "u u dr"), ("Y_v|r|", "sv Rv |r|"), ("N_|v|r", "Rv r"), ("Y_v|v|", "v Rv"), ("X_ww", "w w"),
     ("Z_ww", "|w| Rw"), ("Z_|w|", "u |w|"), ("Y_v0", "v"), ("X_vdr", "u v dr"), ("Y_|r|dr", "u |r| dr"),
     ("K_p|p|", "p |p|"), ("X_u|u|", "u |u|"), ("Z_vv", "v v"), ("Y_*", "u u"), ("M_|w|q", "Rw q")],
)  # fmt: skip
def test_coefficient_names_mean_their_products(name, product):
    assert factors_of(name) == tuple(product.split())


def test_a_name_without_meaning_is_refused():
    with pytest.raises(ModelError, match="Y_banana"):
        factors_of("Y_banana")


def flown_with(case, size, seed=3):
    dof = case.dof
    vehicle = load_vehicle("nps_auv2")
    scales = Scales(vehicle.L, 1.83, vehicle.rho, vehicle.mass, vehicle.r_G[2], 60.0)
    gap = settings(case.draw(np.random.default_rng(seed), size, scales)[1]) if case else NOTHING
    body = build(vehicle, vehicle.coef, dof, gap)
    t = np.arange(121) * 0.5
    orders = zigzag_table(t, 2.9, 0.25, 450.0, 0.03 if dof == 6 else 0.0)
    orders[:, 0] += 0.02 * np.sin(0.7 * t)  # a dead band only shows in small orders
    depth = 1.0 if dof == 6 else 0.0
    track = execute_run(body, gap, t, orders, start_state(1.7, 0.7, depth, NOTHING, (0.0, 0.0)))
    return read(track, gap)


def difference(case, size):
    bare, with_it = flown_with(replace(case, draw=lambda *_: ({}, {})), 1.0), flown_with(case, size)
    return max(np.abs(with_it[name] - bare[name]).max() for name in bare)


NAMES = [f"{case.name} {case.variant}".strip() for case in CASES]


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_every_case_shows_at_its_reference_size_and_not_at_a_vanishing_one(case):
    # the second-order servo vanishes at infinite frequency; its steps are not cut at kinks: a sixth of a
    # step of delay remains, 10 ms of 15 degrees of rudder, two centimetres on the track
    vanishing = 1e-3 if case.variant == "second order" else 1e-9
    assert difference(case, vanishing) < (3e-2 if case.variant == "second order" else 1e-4)
    assert difference(case, 1.0) > 1e-3


@pytest.mark.thorough
@pytest.mark.parametrize(("effect", "before"), [("bent_fin", 0), ("drag_step", 0), ("hull_misalignment", 1)])
def test_what_begins_on_the_way_leaves_the_approach_alone(effect, before):
    """A record begins in the state of the vehicle without it; a hull out of line all along drifts before."""
    c = still(draw_campaign(1, effects=(effect,), dof=3, sizes=(1.0, 1.0)))
    with_it, without = (execute_campaign(x).runs[0] for x in (c, replace(c, planted=())))
    assert np.array_equal(with_it.start, without.start) == (not before)
    assert np.abs(with_it.track.states[-1] - without.track.states[-1]).max() > 0.01  # the control: it acts


def test_correlated_noise_has_its_variance_and_memory():
    x = ornstein_uhlenbeck(np.random.default_rng(5), 200_000, 0.1, 2.0)
    # 200 000 samples hold about 10 000 independent ones: 2 % on the variance is two sigma
    assert x.var() == pytest.approx(1.0, rel=0.05)
    assert np.mean(x[20:] * x[:-20]) == pytest.approx(math.exp(-1.0), abs=0.05)


def test_a_vehicle_out_of_control_is_reported_with_its_time():
    vehicle, _ = boat("remus100")
    gap = settings({"vvv": 1e6})
    t = np.arange(401) * 0.5
    orders = zigzag_table(t, 0.86, 0.2, 1500.0)
    with pytest.raises(ModelError, match=r"out of control .* s into the run"):
        execute_run(
            build(vehicle, vehicle.coef, 3, gap), gap, t, orders, start_state(1.5, 0.0, 0.0, gap, (0, 0))
        )


def test_the_plant_loads_nothing_of_the_model_it_checks():
    code = (
        "import sys, bayesid.benchmark.plant; bad = [m for m in sys.modules if m.startswith("
        "tuple('bayesid.' + n for n in ('model.effects', 'equations', 'simulate', 'estimation')))]; "
        "sys.exit(' '.join(bad))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stderr.strip() == ""


def test_factors_that_exclude_each_other_are_refused():
    with pytest.raises(ModelError, match="executed in the plane only"):
        draw_campaign(1, vehicle="remus100", dof=6)
    with pytest.raises(ModelError, match="no effect 'gremlin'"):
        draw_campaign(1, effects=("gremlin",))
