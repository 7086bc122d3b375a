"""Vehicles without a rudder: thrusters of the vehicle file against a plant told anew."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from thruster_plants import BOAT, boat_run, boat_trial

import bayesid
from bayesid.api.compare import compare
from bayesid.diagnosis.input import unmoved_inputs
from bayesid.diagnosis.input.vehicle_behaviour import speed_ratio
from bayesid.diagnosis.next_manoeuvre import propose
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError, VehicleError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.segments import fit_in_pieces
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.effects.named import named_effects
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed, write_vehicle
from bayesid.model.vehicles.reading import BUILTIN_FOLDER
from bayesid.model.vehicles.sufficient import lacking
from bayesid.progress import Progress
from bayesid.report.fit_effects import effect_words
from bayesid.report.identify_first_screen import next_steps
from bayesid.simulation import plan_run, simulate
from bayesid.trials import load_trial, write_trial

PORT, LAG = "thruster_port_gain.share", "thruster_port_lag.tau"


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle(BOAT))


@pytest.mark.thorough
@pytest.mark.parametrize("planted", [{}, {"gain": (0.85, 1.0)}, {"current": (0.2, -0.1)}, {"lag": 0.8}])
def test_the_boat_moves_as_the_plant_does(model, planted):
    t = np.arange(0.0, 60.0, 0.5)
    swing = np.where((t // 10) % 2 == 0, 1.0, -0.6)
    orders = np.stack([900 * swing, 500 - 300 * swing], axis=1)
    run, states, _ = boat_run("", t, orders, np.random.default_rng(0), **planted)
    gain, current, lag = planted.get("gain", (1, 1)), planted.get("current", (0, 0)), planted.get("lag", 0)
    par = model.with_values({
        PORT: gain[0] - 1, "ocean_current.V_north": current[0], "ocean_current.V_east": current[1],
        LAG: lag, "thruster_stbd_lag.tau": lag,
    })  # fmt: skip
    plan = plan_run(model, t, run.commands, max_step=0.02)
    found = simulate(model, par, plan, states[0]).states[:, :6]
    assert np.abs(found - states).max() < 1e-3
    if planted:  # the control
        bare = simulate(model, model.nominal, plan, states[0]).states[:, :6]
        assert np.abs(bare - states).max() > 0.1


def test_thrusters_of_one_type_have_common_effects_which_are_those_of_each_by_one_size(model):
    kinds = {
        "gain": ("share", -0.2),
        "lag": ("tau", 0.6),
        "dead_time": ("delay", 0.7),
        "rate_limit": ("per_1000rpm", 1.5),
    }
    names = {e.name for e in model.causes}
    assert {n for n in names if n.startswith("thrusters_")} == {f"thrusters_port_stbd_{k}" for k in kinds}
    t = np.arange(0.0, 40.0, 0.5)
    swing = np.where((t // 8) % 2 == 0, 1.0, -0.6)
    orders = {"n_port_cmd": 900 * swing, "n_stbd_cmd": 500 - 300 * swing}
    plan, start = plan_run(model, t, orders), np.zeros(6)

    def motion(**values):
        par = model.with_values({k.replace("__", "."): v for k, v in values.items()})
        return simulate(model, par, plan, start).states[:, :6]

    bare = motion()
    for kind, (size, value) in kinds.items():
        together = motion(**{f"thrusters_port_stbd_{kind}__{size}": value})
        each = motion(**{f"thruster_{side}_{kind}__{size}": value for side in ("port", "stbd")})
        np.testing.assert_allclose(together, each, atol=1e-9)
        assert np.abs(together - bare).max() > 0.01
    port, stbd = model.vehicle.thrusters
    unlike = named_effects([port, replace(stbd, T_nn=1.1 * stbd.T_nn)])
    assert not any(e.name.startswith("thrusters_") for e in unlike)


@pytest.mark.parametrize(
    ("port", "stbd", "drifts"), [(0.0, 0.0, 0.0), (600.0, 600.0, 0.02), (-600.0, -700.0, None)]
)
def test_a_simulated_run_begins_at_the_speed_of_the_first_orders(tmp_path, port, stbd, drifts):
    (tmp_path / "orders.csv").write_text(f"t[s],n_port_cmd[rpm],n_stbd_cmd[rpm]\n0,{port},{stbd}\n30,0,0\n")
    run = bayesid.simulate(BOAT, f"table:{tmp_path / 'orders.csv'}", dt=0.5).runs[0]
    u = run.data["u"][run.t <= 29.0]
    if drifts is None:  # astern there is no such speed: it begins at rest
        assert u[0] == 0.0 and u[-1] < -0.2
    else:
        assert np.ptp(u) <= drifts * max(u[0], 1.0) and (u[0] > 0.3) == (port > 0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("piece", [15.0, None])
def test_a_weak_port_thruster_is_found_from_the_log(piece):
    # over whole runs the heading is radians off at the start values, and a search from there ends elsewhere
    found = fit_in_pieces(
        boat_trial(1, gain=(0.88, 1.0)), piece, free=("N_r0", "X_u|u|"), effects=("thruster_port_gain",),
        parts=NoiseParts(),
    )  # fmt: skip
    i = found.fit.names.index(PORT)
    assert found.fit.success and abs(found.fit.z[i] + 0.12) < 3 * found.fit.sd[i] < 0.02
    assert "Thruster port gives 12 % less thrust than stated" in effect_words(found)[0]
    (held,) = [r for r in found.runs if r.role == "holdout"]
    assert (held.rms_fitted / held.sigma).max() < 2.0 < (held.rms_nominal / held.sigma).max()


@pytest.mark.thorough
def test_a_sound_boat_has_no_weak_thruster():
    found = fit_trial(
        boat_trial(2), free=("N_r0", "X_u|u|"), effects=("thruster_port_gain",), parts=NoiseParts()
    )
    i = found.fit.names.index(PORT)
    assert abs(found.fit.z[i]) < 3 * found.fit.sd[i]
    assert "does not show" in effect_words(found)[0]


def test_thrusters_are_written_and_read_back(tmp_path):
    vehicle = load_vehicle(BOAT)
    again = load_vehicle(write_vehicle(vehicle, tmp_path / "again.toml"))
    assert again.thrusters == vehicle.thrusters and again.digest == vehicle.digest
    assert {t.signal for t in vehicle.thrusters} == {"n_port", "n_stbd"}


def test_a_lag_of_a_thruster_is_its_effect_and_is_stated_once(tmp_path):
    text = (BUILTIN_FOLDER / "differential_boat.toml").read_text()
    for name, lag in (("port", 0.3), ("stbd", 0.4)):
        text = text.replace(f"[actuators.{name}]", f"[actuators.{name}]\nlag = {lag}")
    (tmp_path / "boat.toml").write_text(text)
    boat = load_vehicle(tmp_path / "boat.toml")
    assert boat.effects == {"thruster_port_lag.tau": 0.3, "thruster_stbd_lag.tau": 0.4}
    assert boat.thrusters == load_vehicle("differential_boat").thrusters
    write_vehicle(boat, tmp_path / "again.toml")
    assert load_vehicle(tmp_path / "again.toml").effects == boat.effects
    (tmp_path / "twice.toml").write_text(text + "\n[effects.thruster_port_lag]\ntau = 0.3\n")
    with pytest.raises(VehicleError, match=r"thruster_port_lag.tau is stated by `lag`"):
        load_vehicle(tmp_path / "twice.toml")


def test_steady_speed_balances_both_thrusters():
    u = self_propulsion_speed(load_vehicle(BOAT), 1000.0)
    m = 940.0
    assert 2 * (2e-5 * m * m - 2e-3 * u * m) == pytest.approx(15 * u + 12 * u * u)


def test_mistakes_in_actuators_are_told_at_once(tmp_path):
    path = tmp_path / "odd.toml"
    text = BOAT.read_text().replace("[actuators.stbd]", "[actuators.starbord]")
    path.write_text(text.replace("direction = [1.0, 0.0, 0.0]\nT_nn = 2e-5", 'T_nn = "much"', 1))
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    for part in ("starbord", "direction is missing", "T_nn must be a finite number"):
        assert part in str(error.value)


@pytest.mark.thorough
def test_a_bundle_of_thruster_logs_is_read_and_inputs_that_do_not_move_are_told(tmp_path):
    trial = boat_trial(3)
    again = load_trial(write_trial(trial, tmp_path / "bundle"))
    for one, two in zip(trial.runs, again.runs, strict=True):
        assert np.allclose(one.commands["n_port_cmd"], two.commands["n_port_cmd"])
    vehicle = load_vehicle(BOAT)
    assert unmoved_inputs(again, vehicle) == ()
    still = [replace(r, commands={"n_port_cmd": np.full(r.t.size, 500.0)}) for r in again.runs]
    told = " ".join(unmoved_inputs(replace(again, runs=tuple(still)), vehicle))
    assert "n_port never moves" in told and "n_stbd is an input" in told and "delta_r" not in told
    # at another speed in each run it tells what it does
    still[0] = replace(still[0], commands={"n_port_cmd": np.full(still[0].t.size, 400.0)})
    assert "n_port" not in " ".join(unmoved_inputs(replace(again, runs=tuple(still)), vehicle))


def test_no_manoeuvre_of_the_rudder_is_proposed_to_a_vehicle_without_one(model):
    """A boat with two thrusters was told to run a Dieudonne spiral next."""
    assert propose(SimpleNamespace(model=model), None, ("wind",), 0.3) == ()


def test_a_shaft_the_vehicle_does_not_have_says_nothing_of_its_speed(model):
    """The log of a hovering vehicle with a column n was told to be another vehicle's, 3.2 times as fast."""
    t = np.arange(0.0, 60.0, 0.5)
    run, _, _ = boat_run("", t, np.full((t.size, 2), 400.0), np.random.default_rng(0))
    logged = replace(run, commands=run.commands | {"n_cmd": np.full(t.size, 1500.0)})
    assert speed_ratio(model, logged) is None
    assert speed_ratio(build_model(load_vehicle("esso_osaka_mmg")), logged) is not None  # the control


def test_a_direction_of_any_length_is_written_and_read_as_one_vehicle(tmp_path):
    """A unit vector that was written was made one again, a rounding off: its fits were of another."""
    text = (
        (BUILTIN_FOLDER / "differential_boat.toml")
        .read_text("utf-8")
        .replace("direction = [1.0, 0.0, 0.0]", "direction = [1.0, -1.0, 0.0]")
    )
    assert "[1.0, -1.0, 0.0]" in text
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    first = load_vehicle(tmp_path / "mine.toml")
    write_vehicle(first, tmp_path / "again.toml")
    second = load_vehicle(tmp_path / "again.toml")
    assert [a.direction for a in second.actuators] == [a.direction for a in first.actuators]
    assert np.hypot(*first.actuators[0].direction[:2]) == pytest.approx(1.0)
    assert build_model(second).digest == build_model(first).digest


def test_manoeuvres_of_a_rudder_are_not_compared_for_a_boat_without_one():
    with pytest.raises(ManoeuvreError, match="has no rudder: manoeuvres are compared for rudder"):
        compare(BOAT, quick=True)
    assert any("no rudder" in text for text in lacking(load_vehicle(BOAT))["design"])


@pytest.mark.thorough
def test_rows_made_of_freed_added_masses_are_freed_with_them_unless_they_are_kept():
    """N_v is Y_vdot - X_udot: held at what a wrong added mass made of it, damping would make up for it."""
    progress, said = Progress(quiet=True), list[str]()
    progress.note = said.append
    found = bayesid.fit(boat_trial(3), free="Y_vdot,N_r0", pieces=15.0, progress=progress).found
    names = set(found.problem.params.names)
    assert {"Y_vdot", "N_r0", "N_v", "X_vr"} <= names
    assert "freed as well" in " ".join(said)
    kept = bayesid.fit(boat_trial(3), free="Y_vdot,N_r0", fix="N_v,X_vr,Y_r", pieces=15.0).found
    assert {"N_v", "X_vr"}.isdisjoint(kept.problem.params.names)


def test_what_is_open_of_a_boat_is_not_sent_to_a_design_that_it_cannot_have():
    open_ = SimpleNamespace(directions=(1,), structural=())
    boat, sub = " ".join(next_steps(open_, vehicle=load_vehicle(BOAT))), " ".join(next_steps(open_))
    assert "bayesid design" not in boat and "moves by itself" in boat and "bayesid design" in sub
