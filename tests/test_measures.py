"""Standard measures against closed forms: a kinematic circle and the first-order steering equation."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import dieudonne, pull_out, zigzag
from bayesid.measures import pull_out as measure_pull_out
from bayesid.measures import spiral as measure_spiral
from bayesid.measures import turning_circle
from bayesid.measures import zigzag as measure_zigzag

DEG = math.pi / 180


def circle(
    side=1.0,
    speed=5.0,
    radius=200.0,
    drift=0.0,
    current=(0.0, 0.0),
    psi0=0.4,
    t0=40.0,
    turns=2.2,
    dt=0.5,
    t=None,
):
    """Straight approach, then at once a circle: rate speed/radius, course = heading - side*drift."""
    rate = side * speed / radius
    t = np.arange(0.0, t0 + turns * 2 * np.pi / abs(rate), dt) if t is None else t
    turning = np.clip(t - t0, 0.0, None)
    psi = psi0 + rate * turning
    chi, chi0 = psi - side * drift, psi0 - side * drift
    straight = speed * np.minimum(t - t0, 0.0)
    x = straight * np.cos(psi0) + radius * side * (np.sin(chi) - math.sin(chi0)) + current[0] * t
    y = straight * np.sin(psi0) - radius * side * (np.cos(chi) - math.cos(chi0)) + current[1] * t
    rudder = np.where(t >= t0 - 1e-9, -side * 20 * DEG, 0.0)
    return {"t": t, "x": x, "y": y, "psi": psi, "rudder": rudder}


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_kinematic_circle_gives_radius_as_advance_and_transfer(side):
    m = turning_circle(**circle(side))
    assert m.reasons == {}
    assert m.side == ("starboard" if side > 0 else "port")
    # linear interpolation across a step of 2.5 m on a circle of 200 m errs by up to s^2/8R = 4 mm
    assert m.advance == pytest.approx(200.0, abs=0.01)
    assert m.transfer == pytest.approx(200.0, abs=0.01)
    assert m.tactical_diameter == pytest.approx(400.0, abs=0.01)
    assert m.steady_diameter == pytest.approx(400.0, rel=1e-9)
    assert m.steady_yaw_rate == pytest.approx(5 / 200, rel=1e-9)
    assert m.t90 == pytest.approx(math.pi / 2 * 40, abs=1e-6)
    assert m.speed_ratio == pytest.approx(1.0, rel=1e-9)
    assert m.speed_loss == pytest.approx(0.0, abs=1e-9)
    assert m.drift_angle == pytest.approx(0.0, abs=1e-9)
    assert m.rudder == pytest.approx(20 * DEG)
    assert m.execute == 40.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_drift_angle_is_found_from_the_track_alone_and_positive_on_both_sides(side):
    m = turning_circle(**circle(side, drift=9 * DEG))
    assert m.drift_angle == pytest.approx(9 * DEG, abs=1e-9)


def test_unknown_current_is_found_and_does_not_change_the_steady_circle():
    m = turning_circle(**circle(current=(0.4, -0.7)))
    assert m.drift_velocity == pytest.approx((0.4, -0.7), abs=1e-9)
    assert m.steady_diameter == pytest.approx(400.0, rel=1e-9)


def test_known_current_is_taken_off_the_track_and_the_speeds():
    run = circle(current=(0.4, -0.7))
    psi = run["psi"]
    run["u"] = 5 + 0.4 * np.cos(psi) - 0.7 * np.sin(psi)
    run["v"] = -0.4 * np.sin(psi) - 0.7 * np.cos(psi)
    m = turning_circle(**run, current=(0.4, -0.7))
    assert (m.advance, m.transfer, m.approach_speed) == pytest.approx((200, 200, 5), abs=0.01)
    # without the correction the set carries it along for the time of a quarter circle
    along = (0.4 * math.cos(0.4) - 0.7 * math.sin(0.4)) * math.pi / 2 * 40
    assert turning_circle(**run).advance == pytest.approx(200 + along, abs=0.01)


def test_velocities_and_track_give_the_same_steady_turn():
    run = circle(drift=9 * DEG)
    beta = np.where(run["t"] > 40, 9 * DEG, 0.0)
    m = turning_circle(**run, u=5 * np.cos(beta), v=-5 * np.sin(beta))
    assert (m.drift_angle, m.steady_speed, m.steady_diameter) == pytest.approx((9 * DEG, 5, 400), rel=1e-9)


def test_sign_convention_of_the_rudder_and_wrapping_of_the_heading_do_not_matter():
    run = circle()
    other = {**run, "rudder": -run["rudder"], "psi": np.angle(np.exp(1j * run["psi"]))}
    assert numbers(turning_circle(**other)) == pytest.approx(numbers(turning_circle(**run)), nan_ok=True)


def numbers(measure):
    """All plain numbers of a result, in order."""
    values = [getattr(measure, f.name) for f in fields(measure)]
    return [v for v in values if isinstance(v, float)]


def test_uneven_sampling_and_missing_rows_change_the_circle_by_less_than_a_sample():
    rng = np.random.default_rng(5)
    t = np.sort(np.unique(np.r_[np.arange(0, 60, 0.5), rng.uniform(0, 590, 900)]))
    run = circle(t=t, t0=40.0)
    for name in ("x", "y", "psi"):
        run[name] = np.where(rng.uniform(size=t.size) < 0.1, np.nan, run[name])
    m = turning_circle(**run)
    assert (m.advance, m.transfer) == pytest.approx((200, 200), abs=0.5)
    assert m.tactical_diameter == pytest.approx(400, abs=0.5)
    assert m.steady_diameter == pytest.approx(400, rel=1e-6)


def test_noise_of_a_metre_and_half_a_degree_moves_the_circle_by_less_than_its_own_size():
    errors = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        run = circle()
        run["x"] = run["x"] + rng.normal(0, 1.0, run["t"].size)
        run["y"] = run["y"] + rng.normal(0, 1.0, run["t"].size)
        run["psi"] = run["psi"] + rng.normal(0, 0.5 * DEG, run["t"].size)
        m = turning_circle(**run)
        errors.append([m.advance - 200, m.transfer - 200, m.tactical_diameter - 400, m.steady_diameter - 400])
    # one raw sample has sigma 1 m (start and end together 1.4 m); the local fits must do better and be
    # unbiased
    assert np.std(errors, axis=0).max() < 1.0
    assert np.abs(np.mean(errors, axis=0)).max() < 0.8


def test_short_turn_says_what_is_missing():
    m = turning_circle(**circle(turns=0.4))
    assert math.isfinite(m.advance) and math.isnan(m.tactical_diameter) and math.isnan(m.steady_diameter)
    assert "180 deg needed" in m.reasons["tactical_diameter"]
    assert "270 deg needed" in m.reasons["steady_diameter"]


def test_gap_at_ninety_degrees_is_reported_not_bridged():
    run = circle()
    at90 = 40 + math.pi / 2 * 40
    run["psi"] = np.where(np.abs(run["t"] - at90) < 20, np.nan, run["psi"])
    m = turning_circle(**run)
    assert math.isnan(m.advance) and "gap" in m.reasons["advance"]
    assert m.tactical_diameter == pytest.approx(400, abs=0.01)


@pytest.mark.parametrize(("apart", "error"), [(22.0, 0.001), (40.0, 0.01), (60.0, None)])
def test_a_circle_with_few_fixes_is_measured_between_them_and_not_with_fewer_than_eight(apart, error):
    run = circle()
    every = round(apart * DEG * 40 / float(np.diff(run["t"]).mean()))  # 40 s a radian
    for name in ("x", "y"):
        run[name] = np.where(np.arange(run["t"].size) % every == 3, run[name], np.nan)
    m = turning_circle(**run)
    if error is None:
        assert math.isnan(m.advance) and "no position there" in m.reasons["advance"]
    else:
        assert m.tactical_diameter == pytest.approx(400, abs=400 * error)
        assert (m.advance, m.transfer) == (
            pytest.approx(200, abs=200 * error),
            pytest.approx(200, abs=200 * error),
        )


def test_a_gap_of_the_fixes_at_ninety_degrees_is_not_bridged():
    run = circle()
    run["x"] = np.where(np.abs(run["t"] - (40 + math.pi / 2 * 40)) < 12, np.nan, run["x"])  # 34 degrees
    m = turning_circle(**run)
    assert math.isnan(m.advance) and "gap" in m.reasons["advance"]


def test_run_without_a_rudder_order_is_a_result_full_of_reasons():
    run = circle()
    run["rudder"] = np.zeros_like(run["t"])
    m = turning_circle(**run)
    assert all(math.isnan(v) for v in numbers(m)) and "no rudder order" in m.reasons["advance"]


def test_measured_rudder_dates_the_order_at_the_foot_of_its_ramp():
    run = circle()
    run["rudder"] = -20 * DEG * np.clip((run["t"] - 40) / 5, 0, 1)  # 4 deg/s
    assert turning_circle(**run).execute == pytest.approx(40.0, abs=0.05)


def test_arrays_of_different_length_are_one_clear_message():
    run = circle()
    run["x"] = run["x"][:-1]
    with pytest.raises(ManoeuvreError, match="x has shape"):
        turning_circle(**run)


# First-order steering T r' + r = -K delta, stepped exactly, commands held over the step.
T, K = 8.0, 0.12


def steer(manoeuvre, bias=0.0, cubic=False, linear=1.0):
    """Heading, yaw rate, ordered rudder; `cubic`: T r' + linear r + 400 r^3 = -K delta, by small steps."""
    dt = getattr(manoeuvre, "dt", None) or float(manoeuvre.t[1] - manoeuvre.t[0])
    control = manoeuvre.controller() if hasattr(manoeuvre, "controller") else None
    state, psi, r, out = np.zeros(12), 0.3, 0.0, []
    for k, t in enumerate(manoeuvre.t):
        state[5], state[11] = psi, r
        delta = control(t, state.copy())["delta_r_cmd"] if control else manoeuvre.commands["delta_r_cmd"][k]
        out.append((t, psi, r, delta))
        goal = -K * (delta + bias)
        if cubic:
            for _ in range(20):
                r += dt / 20 / T * (goal - linear * r - 400 * r**3)
                psi += dt / 20 * r
        else:
            decay = math.exp(-dt / T)
            psi += goal * dt + (r - goal) * T * (1 - decay)
            r = goal + (r - goal) * decay
    return np.array(out).T


def nomoto_overshoots(delta, switch, count):
    """Closed form: after an execute at rate r0 the overshoot is T r0 - K delta T ln(1 + r0/(K delta))."""
    goal, rate, start, found, executes = K * delta, 0.0, 0.0, [], [0.0]
    for k in range(count):
        if k:  # every leg is looked at from the side it turns to
            rate, start = -rate, -switch

        def beyond(s, rate=rate, start=start):
            return start + goal * s + (rate - goal) * T * (1 - math.exp(-s / T)) - switch

        leg = brentq(beyond, 0.0, 500.0, xtol=1e-12)
        rate = goal + (rate - goal) * math.exp(-leg / T)
        executes.append(executes[-1] + leg)
        found.append(T * rate - goal * T * math.log(1 + rate / goal))
    return found, executes


@pytest.mark.parametrize(("delta", "switch"), [(10, 10), (20, 20), (20, 5), (-10, 10)])
def test_zigzag_of_the_first_order_steering_equation_matches_its_closed_form(delta, switch):
    run = zigzag(delta * DEG, switch * DEG, 60, approach=5.0, duration=250.0, dt=0.01)
    t, psi, _, rudder = steer(run)
    m = measure_zigzag(t, psi, rudder)
    expected, executes = nomoto_overshoots(abs(delta) * DEG, switch * DEG, 4)
    # the order is given at the first step after the switch angle: at most dt late, dt*r < 0.02 deg
    assert m.overshoots[:4] == pytest.approx(expected, abs=0.02 * DEG)
    assert m.executes[:4] == pytest.approx([5 + e for e in executes[:4]], abs=0.04)
    assert m.switch == pytest.approx(switch * DEG, abs=0.02 * DEG)
    assert m.initial_turning_time == pytest.approx(executes[1], abs=0.011)
    assert m.first_side == ("port" if delta > 0 else "starboard")
    assert m.reasons.get("reach") is None and executes[1] < m.reach < executes[2]


def test_zigzag_measures_are_the_same_seen_in_a_mirror_and_with_the_other_rudder_sign():
    t, psi, _, rudder = steer(zigzag(10 * DEG, 10 * DEG, 60, 5.0, 150.0, 0.05))
    m, other = measure_zigzag(t, psi, rudder), measure_zigzag(t, -psi, rudder)
    assert numbers(m) == pytest.approx(numbers(other), nan_ok=True)
    assert m.overshoots == pytest.approx(other.overshoots)
    assert {m.first_side, other.first_side} == {"port", "starboard"}


def test_zigzag_tolerates_noise_gaps_and_uneven_sampling():
    t, psi, _, rudder = steer(zigzag(10 * DEG, 10 * DEG, 60, 20.0, 200.0, 0.05))
    exact = measure_zigzag(t, psi, rudder)
    errors = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        keep = np.sort(rng.choice(t.size, t.size // 3, replace=False))
        noisy = psi[keep] + rng.normal(0, 0.3 * DEG, keep.size)
        noisy[rng.uniform(size=keep.size) < 0.05] = np.nan
        m = measure_zigzag(t[keep], noisy, rudder[keep] + rng.normal(0, 0.1 * DEG, keep.size))
        assert len(m.overshoots) == len(exact.overshoots)
        errors.append(np.subtract(m.overshoots[:4], exact.overshoots[:4]))
    # raw heading noise 0.3 deg, and the difference of two values; maximum picking alone would be off by
    # +0.6 deg
    assert np.std(errors) < 0.3 * DEG
    assert abs(np.mean(errors)) < 0.15 * DEG


@pytest.mark.parametrize("dt", [0.02, 0.2, 1.0])
def test_rudder_that_travels_at_a_finite_rate_gives_the_same_executes_at_any_sampling(dt):
    t, psi, _, rudder = steer(zigzag(20 * DEG, 20 * DEG, 60, 10.0, 150.0, 0.02))
    measured, travel = np.empty_like(rudder), 0.0
    for k, order in enumerate(rudder):
        measured[k] = travel
        travel += np.clip(order - travel, -3 * DEG * 0.02, 3 * DEG * 0.02)
    every = round(dt / 0.02)
    m, exact = measure_zigzag(t[::every], psi[::every], measured[::every]), measure_zigzag(t, psi, rudder)
    # the rudder is still travelling when the run ends, so the last order may or may not be seen
    assert m.executes[:5] == pytest.approx(exact.executes[:5], abs=0.05 + 0.05 * dt)


def test_run_that_starts_with_the_rudder_over_counts_its_start_as_the_first_execute():
    t, psi, _, rudder = steer(zigzag(10 * DEG, 10 * DEG, 60, 5.0, 150.0, 0.05))
    late = t > 5.2
    whole, m = measure_zigzag(t, psi, rudder), measure_zigzag(t[late], psi[late], rudder[late])
    assert m.executes[1:] == whole.executes[1:] and m.overshoots == pytest.approx(whole.overshoots)
    assert m.rudder == pytest.approx(whole.rudder) and m.first_side == whole.first_side
    assert "rudder over" in m.reasons["initial_turning_time"]


def test_zigzag_cut_short_reports_the_overshoots_it_has():
    t, psi, _, rudder = steer(zigzag(10 * DEG, 10 * DEG, 60, 5.0, 250.0, 0.05))
    executes = measure_zigzag(t, psi, rudder).executes
    cut = t <= executes[2] + 0.5
    m = measure_zigzag(t[cut], psi[cut], rudder[cut])
    assert len(m.executes) == 3 and len(m.overshoots) == 1
    assert "execute 3" in m.reasons["overshoots"] and "four needed" in m.reasons["period"]


def test_initial_turning_distance_is_speed_times_time_at_constant_speed():
    t, psi, _, rudder = steer(zigzag(10 * DEG, 10 * DEG, 60, 5.0, 100.0, 0.05))
    step = np.diff(t, prepend=t[0])
    x, y = np.cumsum(3 * np.cos(psi) * step), np.cumsum(3 * np.sin(psi) * step)
    m = measure_zigzag(t, psi, rudder, x, y)
    assert m.initial_turning_distance == pytest.approx(3 * m.initial_turning_time, rel=1e-3)


def test_stable_vehicle_keeps_no_yaw_rate_after_a_pull_out():
    t, psi, _, rudder = steer(pull_out(20 * DEG, 60, 10, 60, 120, 0.1))
    m = measure_pull_out(t, psi, rudder)
    assert m.turning_rate == pytest.approx(K * 20 * DEG, rel=1e-2)
    assert m.residual_rate == pytest.approx(0.0, abs=1e-4 * m.turning_rate + K * 20 * DEG * math.exp(-60 / T))
    assert m.side == "port" and m.reasons == {}


def test_unstable_vehicle_keeps_the_rate_of_its_cubic():
    # T r' - 0.3 r + 400 r^3 = 0 rests at r = sqrt(0.3/400)
    for side in (1, -1):
        t, psi, _, rudder = steer(pull_out(side * 20 * DEG, 60, 10, 100, 300, 0.1), cubic=True, linear=-0.3)
        m = measure_pull_out(t, psi, rudder)
        assert m.residual_rate == pytest.approx(math.sqrt(0.3 / 400), rel=1e-3)


def test_pull_out_that_has_not_settled_says_so():
    t, psi, _, rudder = steer(pull_out(20 * DEG, 60, 10, 60, 12, 0.1))
    m = measure_pull_out(t, psi, rudder)
    assert math.isnan(m.residual_rate) and "run on" in m.reasons["residual_rate"]


def test_spiral_of_a_stable_vehicle_has_no_loop():
    run = dieudonne(60, hold=120.0, approach=20.0, dt=0.2)
    t, psi, _, rudder = steer(run)
    m = measure_spiral(t, psi, rudder, shortest=100.0)
    assert m.reasons == {} and m.differ == () and m.unsettled == ()
    assert m.loop_width == pytest.approx(0.0, abs=0.01 * DEG)
    assert m.loop_height == pytest.approx(0.0, abs=1e-5)
    assert dict(m.going_up)[max(a for a, _ in m.going_up)] == pytest.approx(-K * 15 * DEG, rel=1e-4)


def test_spiral_of_an_unstable_vehicle_shows_the_loop_of_its_cubic():
    # -0.3 r + 400 r^3 = -K delta: the branches end at |delta| = 2/3 * 0.3 * sqrt(0.3/1200)/K = 1.51 deg
    run = dieudonne(60, hold=400.0, approach=20.0, dt=0.5)
    t, psi, _, rudder = steer(run, bias=1e-6, cubic=True, linear=-0.3)
    m = measure_spiral(t, psi, rudder, shortest=300.0)
    edge = 2 / 3 * 0.3 * math.sqrt(0.3 / 1200) / K
    assert 1.4 * DEG < edge < 1.6 * DEG
    assert sorted(round(a / DEG) for a in m.differ) == [-1, 0, 1]
    # steps of one degree around +-1.51 deg: the jump lies between 1 and 2
    assert 2 * DEG < m.loop_width < 4 * DEG
    assert m.loop_height == pytest.approx(2 * math.sqrt(0.3 / 400), rel=1e-2)


def test_holds_too_short_to_settle_are_named():
    t, psi, _, rudder = steer(dieudonne(60, hold=12.0, approach=20.0, dt=0.1))
    assert measure_spiral(t, psi, rudder, shortest=10.0).unsettled


def test_spiral_with_too_few_holds_says_so():
    t, psi, _, rudder = steer(pull_out(20 * DEG, 60, 10, 60, 120, 0.1))
    m = measure_spiral(t, psi, rudder, shortest=5.0)
    assert math.isnan(m.loop_width) and "at least five" in m.reasons["loop_width"]


def test_steering_before_a_turn_or_zigzag_is_not_taken_for_it():
    run = circle(t0=60.0)
    run["rudder"] = np.where((run["t"] > 10) & (run["t"] < 20), 15 * DEG, run["rudder"])
    assert turning_circle(**run).execute == 60.0
    t, psi, _, rudder = steer(zigzag(20 * DEG, 20 * DEG, 60, 60.0, 150.0, 0.05))
    rudder = np.where((t > 10) & (t < 20), 11 * DEG, rudder)
    assert measure_zigzag(t, psi, rudder).executes[0] == pytest.approx(60.0)


CHANNEL = st.lists(
    st.one_of(st.floats(-10, 10), st.just(math.nan), st.just(0.0), st.floats(width=32)),
    min_size=24,
    max_size=24,
).map(np.array)


@settings(max_examples=40, deadline=None)
@given(CHANNEL, CHANNEL, CHANNEL, CHANNEL.map(lambda c: np.repeat(c[:4], 6)))
def test_no_data_make_a_measure_fail_without_a_reason(x, y, psi, rudder):
    t = np.cumsum(np.linspace(0.1, 2.0, 24))
    results = (
        turning_circle(t, x, y, psi, rudder, x, y),
        measure_zigzag(t, psi, rudder, x, y),
        measure_pull_out(t, psi, rudder),
        measure_spiral(t, psi, rudder, 0.5),
    )
    for m in results:
        lost = [
            f.name
            for f in fields(m)
            if isinstance(getattr(m, f.name), float) and math.isnan(getattr(m, f.name))
        ]
        assert not set(lost) - set(m.reasons), (m, lost)
