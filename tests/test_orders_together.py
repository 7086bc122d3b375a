"""One order of the rudder and one of the shaft move the named rudders and shafts of a vehicle together."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import bayesid
from bayesid.cli.main import run as command
from bayesid.diagnosis import next_manoeuvre
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError, ModelError
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import filter_error_run, why_not_straight
from bayesid.manoeuvres import Scale, parse
from bayesid.measures import named_measures
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed
from bayesid.model.vehicles.orders import (
    gathered,
    own_orders,
    rudder_limits,
    rudders_together,
    shafts_together,
    spread,
)
from bayesid.model.vehicles.sufficient import lacking
from bayesid.prediction.intervals import measure_bands
from bayesid.prediction.manoeuvre_prediction import predict_manoeuvre
from bayesid.simulation import plan_run, run_manoeuvre, simulate, steady_start
from bayesid.simulation.balanced_speed import balanced_speed
from bayesid.trials import write_trial

FERRY = """
format = 1
[vehicle]
name = "ferry with two rudders and two shafts"
source = "made up"
nondimensional = false
plain_abs = true
planar_only = true
rho = 1025.0
L = 10.0
mass = 8000.0
Izz = 60000.0
U_ref = 4.0
[propulsion]
model = "quadratic"
rpm_ref = 600.0
[actuators.port]
at = [-4.5, -0.9, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 0.006
T_un = -0.4
[actuators.stbd]
at = [-4.5, 0.9, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 0.006
T_un = -0.4
[actuators.1]
kind = "fin"
at = [-4.8, -0.001, 0.0]
direction = [0.0, 1.0, 0.0]
F_uu = 200.0
max_deg = 30.0
rate_deg_s = 15.0
[actuators.2]
kind = "fin"
at = [-4.8, 0.001, 0.0]
direction = [0.0, 1.0, 0.0]
F_uu = 200.0
max_deg = 30.0
rate_deg_s = 15.0
[coef]
X_udot = -400
Y_vdot = -5000
N_rdot = -40000
"X_u|u|" = -180
Y_v = -2500
Y_r = 4000
N_v = -4000
N_r = -45000
"""
CENTRAL = "[control]\ndr_max_deg = 30.0\nrate_deg_s = 15.0\n"
SEA = NoiseModel((0.0,) * 3, 3.0, 0.0, 25.0)
ORDERED = ("turn:20,duration=60", "zigzag:10/10,duration=40")


@pytest.fixture(scope="module")
def ferry(tmp_path_factory):
    file = tmp_path_factory.mktemp("ferry") / "ferry.toml"
    file.write_text(FERRY)
    return load_vehicle(file)


@pytest.fixture(scope="module")
def central(tmp_path_factory):
    """The same ship, but for one rudder delta_r with the forces of both."""
    at = FERRY.index("[actuators.1]"), FERRY.index("[coef]")
    file = tmp_path_factory.mktemp("central") / "central.toml"
    file.write_text(FERRY[: at[0]] + CENTRAL + FERRY[at[1] :] + f"Y_dr = 400\nN_dr = {-4.8 * 400}\n")
    return load_vehicle(file)


def aft(ferry, *sides):
    """The ship with its rudders along these directions."""
    return replace(
        ferry,
        fins=tuple(replace(f, direction=(0.0, d, 0.0)) for f, d in zip(ferry.fins, sides, strict=True)),
    )


@pytest.mark.thorough
@pytest.mark.parametrize("sides", [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
def test_two_rudders_turn_a_ship_as_the_one_that_has_the_force_of_both(ferry, central, sides):
    one = bayesid.simulate(central, *ORDERED).runs
    two = bayesid.simulate(aft(ferry, *sides), *ORDERED).runs
    assert max(abs(run.data["psi"]).max() for run in one) > 3.0
    for a, b in zip(one, two, strict=True):
        assert not {"delta_r_cmd", "n_cmd"} & set(b.commands)
        for name, side in zip(("delta_1_cmd", "delta_2_cmd"), sides, strict=True):
            assert b.commands[name] == pytest.approx(side * a.commands["delta_r_cmd"], abs=1e-9)
        for name in ("x", "y", "psi", "u"):
            assert b.data[name] == pytest.approx(a.data[name], rel=1e-6, abs=1e-5)


@pytest.mark.thorough
def test_a_positive_order_turns_to_port_wherever_the_rudders_push(ferry):
    ahead = replace(ferry, fins=tuple(replace(f, at=(4.8, *f.at[1:])) for f in ferry.fins))
    assert rudders_together(ferry) == {"delta_1": 1.0, "delta_2": 1.0}
    assert rudders_together(ahead) == {"delta_1": -1.0, "delta_2": -1.0}
    for ship in (ferry, ahead):
        (run,) = bayesid.simulate(ship, "turn:20,side=starboard").runs
        assert run.data["psi"][-1] > 1.0


def test_orders_of_rudder_and_shaft_are_those_of_each_and_back(ferry):
    ship, t = aft(ferry, 1.0, -1.0), np.arange(3.0)
    given = {"delta_r_cmd": 0.1 * t, "n_cmd": 100.0 + t}
    own = own_orders(ship, given)
    assert set(own) == {"n_port_cmd", "n_stbd_cmd", "delta_1_cmd", "delta_2_cmd"}
    assert own["delta_2_cmd"] == pytest.approx(-0.1 * t) and own["n_stbd_cmd"] == pytest.approx(100.0 + t)
    back = gathered(ship, own)
    for name, values in given.items():
        assert back[name] == pytest.approx(values)
    measured = gathered(ship, {"delta_1": 0.2 + t, "delta_2": 0.4 - t}, "")
    assert measured["delta_r"] == pytest.approx(t - 0.1)


@pytest.mark.thorough
def test_a_rudder_ordered_by_its_own_name_is_ordered_alone(ferry):
    both = {"delta_r_cmd": 0.1, "delta_1_cmd": 0.2}
    assert spread(ferry, both) == both | {"delta_2_cmd": 0.1}
    assert spread(ferry, {"delta_r_cmd": 0.1}, {"delta_2": 0.3}) == {"delta_r_cmd": 0.1, "delta_1_cmd": 0.1}
    assert own_orders(ferry, both) == {"delta_1_cmd": 0.2, "delta_2_cmd": 0.1}
    model = build_model(ferry, 3)
    t = np.arange(0.0, 20.0, 0.5)
    alone, joint = (
        simulate(
            model,
            model.nominal,
            plan_run(model, t, {"n_cmd": np.full(t.size, 600.0), name: np.full(t.size, 0.2)}),
            steady_start(model),
        )["r"][5]
        for name in ("delta_1_cmd", "delta_r_cmd")
    )
    assert joint < 0.0 and alone == pytest.approx(0.5 * joint, rel=0.05)


@pytest.mark.thorough
def test_a_simulated_log_measures_as_the_simulation_did(ferry, tmp_path, capsys):
    text, model = "turn:20,duration=150", build_model(ferry, 3)
    speed = self_propulsion_speed(ferry, 600.0)
    order = parse(text, Scale(ferry.L, speed, 600.0, rudder_limits(ferry)[0]))
    track, orders = run_manoeuvre(model, model.nominal, order, steady_start(model))
    channels = {name: track[name] for name in ("x", "y", "psi", "u", "v")}
    (own,) = named_measures(text, track.t, {**channels, "delta_r": orders["delta_r_cmd"]})
    (tmp_path / "ferry.toml").write_text(FERRY)
    trial = replace(bayesid.simulate(ferry, text), vehicle_ref=str(tmp_path / "ferry.toml"))
    bundle = write_trial(trial, tmp_path / "log")
    capsys.readouterr()
    assert command(["trial", "measure", str(bundle), "--json"]) == 0
    (run,) = json.loads(capsys.readouterr().out).values()
    (logged,) = run["measures"]
    assert not logged["reasons"] and logged["kind"] == "turning circle"
    for (name, value, unit), (again, found, _) in zip(own["rows"], logged["rows"], strict=True):
        assert (name, found) == (again, pytest.approx(value, rel=1e-3)), unit
    assert {r[0]: r[1] for r in logged["rows"]}["rudder"] == pytest.approx(20.0)


@pytest.mark.thorough
def test_a_log_of_named_rudders_without_a_vehicle_asks_for_it(ferry, tmp_path, capsys):
    trial = replace(bayesid.simulate(ferry, "turn:20,duration=60"), vehicle_ref="")
    bundle = write_trial(trial, tmp_path / "log")
    assert command(["trial", "measure", str(bundle)]) == 0
    said = capsys.readouterr().out
    assert "not logged: delta_r" in said and "--vehicle" in said
    (tmp_path / "ferry.toml").write_text(FERRY)
    assert command(["trial", "measure", str(bundle), "--vehicle", str(tmp_path / "ferry.toml")]) == 0
    assert "tactical diameter" in capsys.readouterr().out


@pytest.mark.thorough
@pytest.mark.parametrize(
    "orders", [{"n_cmd": 600.0}, {"n_port_cmd": 450.0, "n_stbd_cmd": 450.0}, {"n_port_cmd": 600.0}]
)
def test_a_vehicle_begins_at_the_speed_its_shafts_make_in_the_end(ferry, orders):
    """Named shafts were not ordered: thrust and drag did not balance."""
    middle = tuple(replace(shaft, at=(-4.5, 0.0, 0.0)) for shaft in ferry.thrusters)  # it goes straight
    model = build_model(replace(ferry, thrusters=middle), 3)
    found = balanced_speed(model, np.array([model.nominal] * 2), orders)
    t = np.arange(0.0, 400.0, 1.0)
    held = {name: np.full(t.size, value) for name, value in orders.items()}
    start = np.zeros(len(model.states))
    start[model.states.index("u")] = 2.0
    end = simulate(model, model.nominal, plan_run(model, t, held), start)["u"][-1]
    assert found == pytest.approx([end] * 2, rel=1e-4)


@pytest.mark.thorough
def test_what_does_not_push_ahead_leaves_a_vehicle_at_rest(ferry):
    port = replace(ferry.thrusters[0], name="bow", at=(4.0, 0.0, 0.0), direction=(0.0, 1.0, 0.0))
    model = build_model(replace(ferry, thrusters=(*ferry.thrusters, port)), 3)
    assert shafts_together(model.vehicle) == ("n_port", "n_stbd")
    for still in ({}, {"n_bow_cmd": 300.0}, {"n_port_cmd": 0.0, "n_stbd_cmd": 0.0}):
        assert balanced_speed(model, model.nominal, still) == pytest.approx([0.0])
    astern = {"n_port_cmd": -600.0, "n_stbd_cmd": -300.0}
    with pytest.raises(ModelError, match="balance at n_port = -600 rpm, n_stbd = -300 rpm; give a speed"):
        balanced_speed(model, model.nominal, astern)


def test_a_thruster_that_turns_round_is_no_main_shaft_beside_shafts_that_do_not(tmp_path):
    azimuth = (
        '[actuators.bow]\nkind = "azimuth"\nat = [4.0, 0.0, 0.0]\ndirection = [1.0, 0.0, 0.0]\nT_nn = 0.001\n'
    )
    text = FERRY.replace("[actuators.1]", azimuth + "[actuators.1]", 1)
    (tmp_path / "ship.toml").write_text(text)
    ship = load_vehicle(tmp_path / "ship.toml")
    assert shafts_together(ship) == ("n_port", "n_stbd")
    orders = spread(ship, {"n_cmd": 600.0, "n_bow_cmd": 300.0})
    assert orders["n_port_cmd"] == orders["n_stbd_cmd"] == 600.0 and orders["n_bow_cmd"] == 300.0


def test_rudders_that_are_not_alike_are_not_ordered_together(ferry):
    one, two = ferry.fins
    odd = replace(ferry, fins=(one, replace(two, F_uu=2.0 * two.F_uu)))
    single, third = replace(ferry, fins=(one,)), replace(one, name="3", at=(-4.8, 0.0, 0.0))
    centre = replace(one, name="4", at=(0.1, 0.0, 0.0), F_uu=1.0)
    assert rudders_together(odd) == {}
    assert set(rudders_together(single)) == {"delta_1"}
    assert set(rudders_together(replace(ferry, fins=(one, two, third)))) == {"delta_1", "delta_2", "delta_3"}
    assert set(rudders_together(replace(ferry, fins=(one, two, centre)))) == {"delta_1", "delta_2"}
    level = replace(one, direction=(0.0, 0.0, 1.0))
    assert rudders_together(replace(ferry, fins=(level, replace(level, name="2")))) == {}
    with pytest.raises(ManoeuvreError, match=r"rudders 1 and 2 are not all alike.*delta_1_cmd"):
        bayesid.simulate(odd, "turn:20")
    with pytest.raises(ManoeuvreError, match="has no rudder; order its actuators by a table"):
        bayesid.simulate("differential_boat", "turn:20")


def test_a_vehicle_with_a_rudder_and_a_propeller_has_its_orders_as_they_are(ferry, central):
    assert rudders_together(central) == {} and set(shafts_together(central)) == {"n_port", "n_stbd"}
    ship, orders = load_vehicle("remus100"), {"delta_r_cmd": 0.1, "n_cmd": 900.0}
    assert spread(ship, orders) == gathered(ship, orders) == own_orders(ship, orders) == orders


def test_the_angles_of_a_manoeuvre_keep_within_those_of_the_rudders(ferry):
    angle, rate = rudder_limits(ferry)
    assert (math.degrees(angle), math.degrees(rate)) == pytest.approx((30.0, 15.0))
    (run,) = bayesid.simulate(ferry, "turn:duration=30").runs
    assert abs(run.commands["delta_2_cmd"]).max() == pytest.approx(angle)
    assert not any("rudder" in text for text in lacking(ferry)["design"])


def test_a_table_of_fins_alone_keeps_the_named_shafts_turning(ferry, tmp_path):
    (tmp_path / "fins.csv").write_text("t[s],delta_1_cmd[deg],delta_2_cmd[deg]\n0,0,0\n20,0,0\n")
    (run,) = bayesid.simulate(ferry, f"table:{tmp_path / 'fins.csv'}").runs
    assert run.commands["n_port_cmd"] == pytest.approx(600.0)
    assert run.data["u"][-1] == pytest.approx(self_propulsion_speed(ferry, 600.0), rel=1e-6)


@pytest.mark.thorough
def test_a_predicted_turn_is_measured_by_the_rudders_of_the_vehicle(ferry):
    """Of a vehicle that is known exactly the prediction is the simulation."""
    model = build_model(ferry, 3)
    given = model.nominal[model.positions(("N_r",))]
    known = WeightedHypothesis(
        (),
        1.0,
        ("N_r",),
        given,
        np.diag((1e-9 * given) ** 2),
        given - np.inf,
        given + np.inf,
        SEA,
        np.zeros(1),
    )
    found = DiagnosedModel(model, (known,), {}, "fit", "")
    text = "turn:20,duration=150"
    order = parse(text, Scale(ferry.L, self_propulsion_speed(ferry, 600.0), 600.0, rudder_limits(ferry)[0]))
    predicted = {
        m["quantity"]: m for m in measure_bands(predict_manoeuvre(found, text, order, 20), named_measures)
    }
    (run,) = bayesid.simulate(ferry, text).runs
    own = {**run.data, "delta_r": gathered(ferry, run.commands)["delta_r_cmd"]}
    (measured,) = named_measures(text, run.t, own)
    for quantity, value, _ in measured["rows"]:
        assert predicted[quantity]["mean"] == pytest.approx(value, rel=1e-3)


def test_the_next_manoeuvre_is_sought_within_the_angles_of_the_named_rudders(ferry, monkeypatch):
    tried = []
    monkeypatch.setattr(next_manoeuvre, "worst_margin", lambda bank, names, size: 0.0)
    monkeypatch.setattr(next_manoeuvre, "added_equations", lambda problem, bank, one: tried.append(one))
    log = SimpleNamespace(plan=SimpleNamespace(t=np.array([0.0, 1e4])))
    problem = SimpleNamespace(model=build_model(ferry, 3), logs=[log])
    next_manoeuvre.propose(problem, SimpleNamespace(effects={}), [], 0.3)
    turns = [one.commands["delta_r_cmd"] for one in tried if one.name == "turning circle"]
    assert {float(abs(rudder).max()) for rudder in turns} == {rudder_limits(ferry)[0]}


@pytest.mark.thorough
@pytest.mark.parametrize("shaft", ["n_port", "n_stbd"])
def test_a_run_in_which_a_named_shaft_changes_its_revolutions_is_no_straight_one(ferry, shaft):
    model = build_model(ferry)
    trial = bayesid.simulate(ferry, "straight:duration=60", seed=1)
    (run,) = trial.runs
    channels = [c for c in model.kernel.channels if c in run.data]
    log = filter_error_run(model, run, dict.fromkeys(channels, 0.01), channels)
    assert log.straight and why_not_straight(model, log) == ""
    steps = np.where(run.t > 30.0, 1.1, 1.0) * run.commands[f"{shaft}_cmd"]
    changed = replace(run, commands={**run.commands, f"{shaft}_cmd": steps})
    log = filter_error_run(model, changed, dict.fromkeys(channels, 0.01), channels)
    assert not log.straight and why_not_straight(model, log) == f"its revolutions {shaft} change"


def test_a_shaft_slower_than_a_thruster_that_runs_evenly_may_not_change_either(ferry):
    model = build_model(ferry)
    (run,) = bayesid.simulate(ferry, "straight:duration=60", seed=1).runs
    channels = [c for c in model.kernel.channels if c in run.data]
    even = {"n_port_cmd": np.full(run.t.size, 3000.0), "n_stbd_cmd": np.where(run.t > 30.0, 80.0, 100.0)}
    changed = replace(run, commands={**run.commands, **even})
    log = filter_error_run(model, changed, dict.fromkeys(channels, 0.01), channels)
    assert why_not_straight(model, log) == "its revolutions n_stbd change"


def test_named_rudders_act_as_early_as_the_order_that_moves_them_together(ferry):
    model, t = build_model(ferry, 3), np.arange(30.0)
    names, orders = model.kernel.actuators, {"delta_r_cmd": np.where(t < 10, 0.1, -0.1)}
    one, other = names.index("delta_1"), names.index("delta_2")
    plan = plan_run(model, t, orders, acts_before={"delta_r_cmd": 0.4})
    assert (plan.sooner[one], plan.sooner[other]) == (0.4, 0.4)
    own = plan_run(model, t, orders, acts_before={"delta_r_cmd": 0.4, "delta_1_cmd": 0.1})
    assert (own.sooner[one], own.sooner[other]) == (0.1, 0.4)
    measured = plan_run(model, t, orders, {"delta_1": np.zeros(30)}, acts_before={"delta_r_cmd": 0.4})
    assert (measured.sooner[one], measured.sooner[other]) == (0.0, 0.4)  # what is measured is not ordered
