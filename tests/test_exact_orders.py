"""A zig-zag whose orders are given when they are due: nothing measured of it depends on its step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from bayesid.equations.model import build_model
from bayesid.manoeuvres import depth_change, zigzag
from bayesid.measures.zigzag import zigzag as measured
from bayesid.model.notation import ORDER_TIMES
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import steady_start
from bayesid.simulation.closed_loop import run_manoeuvre

DEG = np.pi / 180
MODEL = build_model(load_vehicle("lauv"), 3)
TIME = MODEL.scales["L"] / MODEL.scales["U"]


def run(step, exact, effect=None, seconds=30.0):
    """A 10/10 zig-zag with orders every `step` L/U: track, orders, measures."""
    par = MODEL.nominal.copy()
    for name, value in (effect or {}).items():
        par[MODEL.index[name]] = value
    order = zigzag(
        10 * DEG,
        10 * DEG,
        float(MODEL.vehicle.rpm_ref),
        approach=2 * TIME,
        duration=seconds * TIME,
        dt=step * TIME,
    )
    track, orders = run_manoeuvre(MODEL, par, order, steady_start(MODEL), max_step=0.005 * TIME, exact=exact)
    x, y, psi = (track.states[:, MODEL.states.index(n)] for n in ("x", "y", "psi"))
    return track, orders, measured(track.t, psi, orders["delta_r_cmd"], x, y, orders.get(ORDER_TIMES))


@pytest.mark.parametrize(
    "effect", [None, {"actuator_dead_time.delay": 0.21 * TIME}, {"actuator_lag.tau": 0.3 * TIME}]
)
def test_orders_are_given_when_they_are_due_whatever_the_step(effect):
    coarse, fine, late = (run(*how, effect) for how in ((0.1, True), (0.0125, True), (0.1, False)))
    times = [order_times(one) for one in (coarse, fine, late)]
    count = min(map(len, times))
    assert count >= 8
    times = [t[:count] for t in times]
    np.testing.assert_allclose(times[0], times[1], atol=2e-3 * TIME)
    assert np.abs(times[2] - times[1]).max() > 0.05 * TIME  # the control: at the instants of the law
    track = fine[0]
    psi = CubicSpline(track.t, track.states[:, MODEL.states.index("psi")])
    np.testing.assert_allclose(np.abs(psi(times[1][1:]) - psi(times[1][0])), 10 * DEG, atol=2e-3 * DEG)


def test_measures_of_a_zigzag_do_not_depend_on_its_step():
    coarse, fine, late = (run(*how)[2] for how in ((0.05, True), (0.0125, True), (0.05, False)))
    for name, tolerance in (("period", 2e-3), ("reach", 4e-3), ("initial_turning_time", 1e-3)):
        one, other, control = (getattr(m, name) / TIME for m in (coarse, fine, late))
        assert one == pytest.approx(other, abs=tolerance)
        assert name != "period" or abs(control - other) > 3 * tolerance
    np.testing.assert_allclose(coarse.overshoots[:2], fine.overshoots[:2], atol=0.02 * DEG)


def order_times(one):
    """When the rudder is ordered over [s]."""
    track, orders, _ = one
    moved = np.flatnonzero(np.diff(orders["delta_r_cmd"])) + 1
    return orders.get(ORDER_TIMES, track.t)[moved]


def test_the_time_of_an_order_lies_between_its_sample_and_the_one_before():
    track, orders, _ = run(0.1, True)
    moved = np.flatnonzero(np.diff(orders["delta_r_cmd"])) + 1
    since = orders[ORDER_TIMES]
    assert moved.size >= 4
    assert np.all(since[moved] <= track.t[moved]) and np.all(since[moved] > track.t[moved - 1])
    still = np.setdiff1d(np.arange(track.t.size), moved)
    np.testing.assert_array_equal(since[still], track.t[still])


def test_fins_stay_between_the_orders_where_one_falls_within_a_step():
    track, _, _ = run(0.1, True)
    rudder = track.actuators[:, MODEL.kernel.actuators.index("delta_r")]
    assert np.all(np.abs(rudder) <= 10 * DEG * (1 + 1e-9)) and np.ptp(rudder) > 19 * DEG


def test_a_law_that_does_not_say_when_it_is_due_gives_orders_at_its_own_instants():
    model = build_model(load_vehicle("generic_sub"), 6)
    time = model.scales["L"] / model.scales["U"]
    length, rpm = model.scales["L"], float(model.vehicle.rpm_ref)
    order = depth_change(0.2 * length, rpm, time, 8 * time, 0.1 * time, 3 * length, 0.2, 0.3)
    begin = steady_start(model)
    plain, exact = (run_manoeuvre(model, model.nominal, order, begin, exact=e) for e in (False, True))
    np.testing.assert_array_equal(plain[0].states, exact[0].states)
    assert ORDER_TIMES not in plain[1]
