"""Fins of an X, and named planes, obey the orders of rudder and stern planes as these would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.analysis.design.limits import limits
from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.read_run import filter_error_run, why_not_straight
from bayesid.model.actuators import Fin
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.orders import (
    gathered,
    own_orders,
    plane_limit,
    planes_together,
    rudders_together,
    spread,
)

FORCE, AFT = 20.0, -0.6
HALF = 0.5**0.5
ORDERED = ("zigzag:10/10,duration=40", "turn:15,duration=30", "vzigzag:5/5,duration=40")


def fin(name, side, down, direction, force=FORCE, at=AFT):
    return Fin(
        name=name, at=(at, 1e-6 * side, 1e-6 * down), direction=(0.0, *direction), F_uu=force,
        max_deg=25.0, rate_deg_s=60.0,
    )  # fmt: skip


X = (
    fin("1", -1, -1, (HALF, -HALF)),
    fin("2", 1, -1, (HALF, HALF)),
    fin("3", -1, 1, (HALF, HALF)),
    fin("4", 1, 1, (HALF, -HALF)),
)
CROSS = (
    fin("1", 0, -1, (1.0, 0.0)),
    fin("2", 0, 1, (1.0, 0.0)),
    fin("3", -1, 0, (0.0, 1.0)),
    fin("4", 1, 0, (0.0, 1.0)),
)


def without_fins():
    """A torpedo-shaped AUV without any row of a fin."""
    auv = load_vehicle("remus100")
    rows = {n: c for n, c in auv.coef.items() if "dr" not in n and "ds" not in n and "db" not in n}
    limits = dict.fromkeys(("delta_r", "delta_s", "delta_b"), np.radians(25.0))
    return replace(auv, coef=rows, limits=limits, rates=dict.fromkeys(limits, np.radians(60.0)))


def with_fins(fins):
    return replace(without_fins(), fins=tuple(fins))


def with_rows(sideways, up):
    """The same forces as of fins at one place, by the rows of a rudder and of a stern plane."""
    auv = without_fins()
    rows = {"Y_dr": sideways, "N_dr": AFT * sideways, "Z_ds": -up, "M_ds": AFT * up}
    scale = {"Y": 0.5 * auv.rho * auv.L**2, "Z": 0.5 * auv.rho * auv.L**2}
    scale |= {"N": scale["Y"] * auv.L, "M": scale["Y"] * auv.L}
    if not auv.nondimensional:
        scale = dict.fromkeys(scale, 1.0)
    return replace(auv, coef={**auv.coef, **{n: c / scale[n[0]] for n, c in rows.items()}})


@pytest.mark.thorough
def test_an_x_turns_and_pitches_it_as_rudder_and_planes_of_the_same_force():
    named = bayesid.simulate(with_fins(X), *ORDERED, noise={}).runs
    usual = bayesid.simulate(with_rows(4 * HALF * FORCE, 4 * HALF * FORCE), *ORDERED, noise={}).runs
    assert max(abs(run.data["theta"]).max() for run in usual) > 0.05
    for a, b in zip(named, usual, strict=True):
        for channel, values in b.data.items():
            np.testing.assert_allclose(a.data[channel], values, atol=1e-4 * max(1.0, abs(values).max()))


def test_of_a_cross_the_upright_fins_steer_and_the_level_ones_dive():
    auv = with_fins(CROSS)
    assert rudders_together(auv) == {"delta_1": 1.0, "delta_2": 1.0}
    assert planes_together(auv) == {"delta_3": -1.0, "delta_4": -1.0}  # a positive plane lifts the stern


def test_a_fin_of_an_x_obeys_the_sum_of_both_orders_and_the_four_give_them_back():
    auv = with_fins(X)
    assert rudders_together(auv) == {f"delta_{k}": 1.0 for k in "1234"}
    assert planes_together(auv) == {"delta_1": 1.0, "delta_2": -1.0, "delta_3": -1.0, "delta_4": 1.0}
    orders = {"delta_r_cmd": np.array([0.0, 0.1, 0.1]), "delta_s_cmd": np.array([0.05, 0.0, 0.05])}
    out = spread(auv, orders)
    np.testing.assert_allclose(out["delta_1_cmd"], [0.05, 0.1, 0.15])
    np.testing.assert_allclose(out["delta_2_cmd"], [-0.05, 0.1, 0.05])
    back = gathered(auv, {n: v for n, v in out.items() if n not in orders})
    for name, values in orders.items():
        np.testing.assert_allclose(back[name], values, atol=1e-15)
    assert set(own_orders(auv, orders)) == {f"delta_{k}_cmd" for k in "1234"}
    three = {n: v for n, v in out.items() if n not in orders and n != "delta_2_cmd"}
    assert gathered(auv, three) == three  # whose mean would be neither
    only = spread(auv, {**orders, "delta_3_cmd": np.zeros(3)})  # what has an order of its own keeps it
    assert not only["delta_3_cmd"].any() and only["delta_1_cmd"].any()


def test_a_fin_that_pushes_the_other_way_for_a_positive_angle_has_the_other_sign():
    mirrored = (*X[:3], replace(X[3], direction=(0.0, -HALF, HALF)))
    assert rudders_together(with_fins(mirrored))["delta_4"] == -1.0
    assert planes_together(with_fins(mirrored))["delta_4"] == -1.0


@pytest.mark.parametrize(
    ("fins", "rudders", "planes"),
    [
        (X[:2], "12", "12"),  # a V
        (X[:1], "", ""),  # one alone cannot keep rudder and planes apart
        ((X[0], X[3]), "", ""),  # nor can two that both climb as they turn to port
        ((*X[:2], *(replace(f, F_uu=30.0) for f in X[2:])), "1234", "1234"),  # larger ones below
        ((fin("1", 0, -1, (1.0, 0.0)), X[2], X[3]), "134", "34"),  # a Y
        ((fin("1", -1, -1, (0.94, -0.34)), fin("2", 1, -1, (0.94, 0.34))), "12", ""),  # canted rudders
        ((*CROSS[2:], fin("5", 1, 0, (0.0, 1.0), force=5.0)), "", "34"),
    ],
)
def test_which_fins_steer_and_dive(fins, rudders, planes):
    auv = with_fins(fins)
    assert set(rudders_together(auv)) == {f"delta_{k}" for k in rudders}
    assert set(planes_together(auv)) == {f"delta_{k}" for k in planes}
    assert planes_together(auv, bow=True) == {}


def test_planes_at_the_bow_have_an_order_of_their_own():
    bow = replace(fin("5", 1, 0, (0.0, 1.0)), at=(0.5, 0.0, 0.0))
    auv = with_fins((*X, bow))
    assert planes_together(auv, bow=True) == {"delta_5": -1.0} and "delta_5" not in planes_together(auv)
    assert spread(auv, {"delta_b_cmd": 0.1})["delta_5_cmd"] == pytest.approx(-0.1)


def test_their_own_limit_is_that_of_the_planes():
    auv = with_fins(X)
    assert plane_limit(auv) == pytest.approx(np.radians(25.0))
    assert plane_limit(with_fins(replace(f, max_deg=12.0) for f in X)) == pytest.approx(np.radians(12.0))
    bounds = limits(build_model(with_fins(replace(f, max_deg=12.0) for f in X), dof=6))
    assert bounds.plane == pytest.approx(np.radians(12.0))


@pytest.mark.thorough
def test_a_run_in_which_they_move_is_no_straight_one():
    """Though no rudder and no stern plane moves: these the vehicle has not."""
    auv = with_fins(X)
    model = build_model(auv, dof=6)
    trial = bayesid.simulate(auv, "straight:duration=5.5", "vzigzag:8/5,duration=40", dt=0.1)
    channels = [c for c in model.kernel.channels if c in trial.runs[0].data]
    straight, waves = (
        filter_error_run(model, run, dict.fromkeys(channels, 0.01), channels) for run in trial.runs
    )
    assert straight.straight and why_not_straight(model, straight) == ""
    assert not waves.straight and why_not_straight(model, waves) == "its delta_1 moves"
