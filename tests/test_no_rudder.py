"""Vehicles steered by thrusters: no rudder manoeuvres, no effects of what is not there; tables by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import OpenLoop, with_rows_every
from bayesid.model.actuators import Fin
from bayesid.model.vehicles import load_vehicle

TABLE = "t[s],n_port_cmd[rpm],n_stbd_cmd[rpm]\n0,800,800\n10,900,700\n20,700,900\n30.2,800,800\n40,800,800\n"
IDLE = {"rudder_offset", "rudder_stall", "actuator_lag", "propeller_side_force", "thrust_loss"}


def test_a_zigzag_of_a_boat_without_a_rudder_is_refused_and_a_table_is_not(tmp_path):
    with pytest.raises(ManoeuvreError, match=r"has no rudder; order its actuators by a table.*n_port_cmd"):
        bayesid.simulate("differential_boat", "zigzag:10/10")
    (tmp_path / "orders.csv").write_text(TABLE)
    text = f"table:{tmp_path / 'orders.csv'}"
    (coarse,) = bayesid.simulate("differential_boat", text).runs
    (fine,) = bayesid.simulate("differential_boat", text, dt=0.5).runs
    assert coarse.n_samples == 5 and fine.n_samples == 81 + 1  # 30.2 s stays beside the half seconds
    for name in ("x", "y", "psi"):  # the same motion, read more often
        there = np.isin(fine.t, coarse.t)
        np.testing.assert_allclose(fine.data[name][there], coarse.data[name], rtol=0, atol=2e-3)
    held = fine.commands["n_port_cmd"]
    assert held[fine.t == 19.5] == 900 and held[fine.t == 20.0] == 700 and held[fine.t == 30.0] == 700


def test_an_order_that_nothing_obeys_is_refused_with_the_columns_there_are(tmp_path):
    (tmp_path / "orders.csv").write_text("t[s],delta_r_cmd[deg],n_cmd[rpm]\n0,0,800\n10,15,800\n40,15,800\n")
    with pytest.raises(ManoeuvreError, match=r"obeys delta_r_cmd; order its.*n_stbd_cmd"):
        bayesid.simulate("differential_boat", f"table:{tmp_path / 'orders.csv'}")
    amidships = (tmp_path / "orders.csv").read_text().replace(",15,", ",0,")
    (tmp_path / "orders.csv").write_text(amidships)
    (run,) = bayesid.simulate("differential_boat", f"table:{tmp_path / 'orders.csv'}").runs
    assert run.data["u"][-1] > 0.1  # n_cmd is that of both thrusters


def test_a_manoeuvre_with_the_rudder_amidships_needs_none():
    (run,) = bayesid.simulate("differential_boat", "straight:duration=20,rpm=800").runs
    assert np.abs(run.data["psi"]).max() < 0.2 and set(run.commands) == {"n_port_cmd", "n_stbd_cmd"}


def test_rows_every_step_hold_the_commands_and_rows_near_a_step_are_not_doubled():
    order = OpenLoop("steps", np.array([0.0, 0.1 * 3, 1.0]), {"delta_r_cmd": np.array([0.0, 0.2, 0.1])})
    fine = with_rows_every(order, 0.1)
    assert fine.t.size == 11 and set(order.t) <= set(fine.t)
    assert fine.commands["delta_r_cmd"].tolist() == [0.0] * 3 + [0.2] * 7 + [0.1]
    with pytest.raises(ManoeuvreError, match="positive"):
        with_rows_every(order, -1.0)


@pytest.mark.thorough
def test_effects_of_what_a_vehicle_does_not_have_are_not_on_offer():
    boat, sub = (build_model(load_vehicle(name), 3) for name in ("differential_boat", "generic_sub"))
    assert not IDLE & set(boat.effects) and set(sub.effects) > IDLE
    assert {"thruster_port_gain", "ocean_current", "wind", "steady_force"} <= set(boat.effects)
    # nothing that moves the boat is dropped: each of these has no force at any of its values
    rng = np.random.default_rng(0)
    full = {n for n in sub.effects if n not in boat.effects}
    state = np.array([0.0, 0.0, 0.3, 0.8, 0.1, 0.05])
    bare = _rates(boat, boat.nominal, state)
    # a part of a form has no force while the rudder that is not there is amidships: it is asked alone
    parts = {n for n in full if sub.effects[n].as_form == "only"}
    for together in (full - parts, *({n} for n in full)):
        par = boat.nominal.copy()
        for i, name in enumerate(boat.kernel.parameters):
            if name.partition(".")[0] in together:
                par[i] = rng.uniform(0.05, 0.1)
        assert together and _rates(boat, par, state) == pytest.approx(bare, abs=1e-12), together


def _rates(model, par, state):
    from bayesid.simulation import plan_run, simulate

    x0 = np.concatenate([state, np.zeros(len(model.states) - 6)])
    orders = {"n_port_cmd": np.full(2, 900.0), "n_stbd_cmd": np.full(2, 600.0), "n_cmd": np.full(2, 800.0)}
    track = simulate(model, par, plan_run(model, np.array([0.0, 1.0]), orders), x0, full=True)
    return track.states[-1][:6]


@pytest.mark.parametrize(
    ("level", "text", "said"),
    [(False, "vzigzag:5/5", "has no stern planes"), (True, "zigzag:10/10", "has no rudder")],
)
def test_a_law_that_moves_what_a_vehicle_lacks_is_refused(level, text, said):
    """Two upright fins dive as little as two level ones steer."""
    along = (0.0, 0.0, 1.0) if level else (0.0, 1.0, 0.0)
    fins = tuple(Fin(name=k, at=(-0.6, 0.0, 0.0), direction=along, F_uu=20.0) for k in ("1", "2"))
    auv = load_vehicle("remus100")
    auv = replace(auv, coef={n: c for n, c in auv.coef.items() if "dr" not in n and "ds" not in n}, fins=fins)
    with pytest.raises(ManoeuvreError, match=said):
        bayesid.simulate(auv, text, dof=6)
