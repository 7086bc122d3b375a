"""Azimuth thrusters, waterjets and rudders of the vehicle file against plants told anew."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from actuator_plants import PLANTS, orders_of, plant_run, plant_trial
from plain_kernel import uncompiled

import bayesid
from bayesid.cli.main import run
from bayesid.diagnosis.input import unmoved_inputs
from bayesid.diagnosis.plain_words import sentence
from bayesid.diagnosis.result_parts import Effect as Told
from bayesid.diagnosis.result_parts import Value
from bayesid.equations.generate import module_source
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError, VehicleError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.segments import fit_in_pieces
from bayesid.manoeuvres import OpenLoop
from bayesid.manoeuvres.table import read_table, write_table
from bayesid.model.actuators import UNLIMITED
from bayesid.model.actuators.declare import servo
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed, write_vehicle
from bayesid.model.vehicles.new.scaling import scaled
from bayesid.report.fit_effects import effect_words
from bayesid.simulation import plan_run, simulate
from bayesid.simulation.time_plan import _turns
from bayesid.trials import load_trial, write_trial
from bayesid.trials.health import check_runs
from bayesid.trials.importing.names import in_bundle_format

#: a force weaker than stated, a servo slower than stated: of the plant, and the parameters that say so
BEYOND = {
    "azimuth": "thruster_stern_gain.share",
    "waterjet": "thruster_port_gain.share",
    "rudders": "delta_2_effectiveness.share",
}


def a_vehicle(which, folder):
    path = folder / f"{which}.toml"
    path.write_text(PLANTS[which][0])
    return load_vehicle(path)


@lru_cache
def plain(which, folder):
    """The model, its kernel run as plain Python."""
    model = build_model(a_vehicle(which, folder))
    declared = tuple(d.effect for d in model.kernel.declared)
    return uncompiled(model, module_source(model.kernel.spec, (*CATALOGUE, *declared))), declared


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("vehicles")


def _slower(model, which, share):
    """Servos at a share of their rates, as effects."""
    out = {}
    for signal in PLANTS[which][2]:
        stated = model.nominal[model.index[f"inverse_rate_{signal}"]]
        out[f"{signal}_rate_limit.inverse_rate_excess"] = stated * (1 / share - 1)
    return out


@pytest.mark.thorough
@pytest.mark.parametrize("planted", [{}, {"beyond": 0.8}, {"slower": 0.4}], ids=["stated", "weak", "slow"])
@pytest.mark.parametrize("which", PLANTS)
def test_a_boat_moves_as_the_plant_does(which, planted, folder):
    model, _ = plain(which, folder)
    t = np.arange(0.0, 25.0, 0.5)
    rng = np.random.default_rng(1)
    run, states = plant_run(which, "", t, orders_of(which, rng, t), rng, **planted)
    changes = {BEYOND[which]: planted.get("beyond", 1.0) - 1.0}
    changes |= _slower(model, which, planted["slower"]) if "slower" in planted else {}
    plan = plan_run(model, t, run.commands, max_step=0.02)
    found = simulate(model, model.with_values(changes), plan, states[0]).states[:, :6]
    # the plant's lag is an Euler step of 0.02 s
    assert np.abs(found - states).max() < 2e-3
    if planted:  # the control
        bare = simulate(model, model.nominal, plan, states[0]).states[:, :6]
        assert np.abs(bare - states).max() > 0.01


@pytest.mark.parametrize("which", PLANTS)
def test_every_effect_of_a_named_actuator_is_nothing_when_off_acts_when_on_and_is_told(which, folder):
    model, declared = plain(which, folder)
    t = np.arange(0.0, 16.0, 1.0)
    # every order moves, to both sides, from the first step on
    at = {
        s: {"n": 900, "bucket": 0.6}.get(s.partition("_")[0], 0.4) * np.sin(0.9 * np.arange(t.size) + i)
        for i, s in enumerate(orders_of(which, np.random.default_rng(0), t))
    }
    plan = plan_run(model, t, {f"{s}_cmd": v for s, v in at.items()}, max_step=0.2)
    bare = simulate(model, model.nominal, plan, np.zeros(6), full=False).states[:, :6]
    assert (
        np.abs(simulate(model, model.nominal, plan, np.zeros(6), full=True).states[:, :6] - bare).max()
        < 1e-12
    )
    signals = {s for a in model.vehicle.actuators for s in a.signals}
    for ending in ("offset", "lag", "dead_time", "rate_limit"):
        of = [e for e in declared if e.name.endswith(f"_{ending}")]
        together = {
            e.name for e in of if e.name.startswith(("twin_fins_", "thrusters_", "nozzles_"))
        }  # beside those of each
        assert {e.needs for e in of if e.name not in together} == signals
        pushers = which in ("rudders", "waterjet") and ending != "offset"
        assert len(together) == (which in ("rudders", "waterjet")) + pushers
    for effect in declared:
        p = effect.parameters[0]
        on = model.with_values({effect.key(p.name): p.off + model.prior_sd(effect.key(p.name))})
        assert np.abs(simulate(model, on, plan, np.zeros(6)).states[:, :6] - bare).max() > 1e-5, effect.name
        sizes = {p.name: Value(0.1, 0.01, p.unit)}
        said = sentence(
            Told(effect.name, 1.0, sizes, {}, "", effect.says, dict.fromkeys(effect.adjust, 0.01))
        )
        assert "{" not in said and not said.endswith("acts."), effect.name


@pytest.mark.slow
@pytest.mark.parametrize("which", PLANTS)
def test_a_weak_actuator_is_found_from_the_log_and_a_sound_one_is_not(which, folder):
    """Commands alone are read; the share is told to 3 of its deviations, what is sound as sound."""
    a_vehicle(which, folder)
    name = BEYOND[which]
    for beyond, seed in ((0.85, 1), (1.0, 2)):
        trial = plant_trial(which, folder / f"{which}.toml", seed, beyond=beyond)
        found = fit_in_pieces(
            trial, 15.0, free=("N_r0", "X_u|u|"), effects=(name.partition(".")[0],), parts=NoiseParts()
        )
        i = found.fit.names.index(name)
        assert found.fit.success
        assert abs(found.fit.z[i] - (beyond - 1.0)) < 3 * found.fit.sd[i] < 0.12
        words = effect_words(found)[0]
        assert ("less" in words) == (beyond < 1.0) and ("does not show" in words) == (beyond == 1.0)


@pytest.mark.parametrize("which", PLANTS)
def test_actuators_are_written_and_read_back(which, folder, tmp_path):
    vehicle = a_vehicle(which, folder)
    again = load_vehicle(write_vehicle(vehicle, tmp_path / "again.toml"))
    assert again.actuators == vehicle.actuators and again.digest == vehicle.digest
    signals = {s for a in vehicle.actuators for s in a.signals}
    assert signals == set(orders_of(which, np.random.default_rng(0), np.arange(3.0)))
    other = load_vehicle(write_vehicle(replace(vehicle, fins=(), thrusters=()), tmp_path / "none.toml"))
    assert other.digest != vehicle.digest


@pytest.mark.parametrize("which", PLANTS)
def test_files_of_the_documentation_fit_the_schema(which):
    import tomllib

    from bayesid.model.vehicles.schema import vehicle_schema

    jsonschema = pytest.importorskip("jsonschema")
    told = tomllib.loads(PLANTS[which][0])
    jsonschema.validate(told, vehicle_schema())
    next(iter(told["actuators"].values()))["kind"] = "wing"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(told, vehicle_schema())


@pytest.mark.thorough
def test_inputs_that_no_log_has_are_told_by_their_columns(folder):
    trial = plant_trial("waterjet", "x", 3)
    without = tuple(
        replace(r, commands={k: v for k, v in r.commands.items() if not k.startswith("bucket_port")})
        for r in trial.runs
    )
    told = " ".join(unmoved_inputs(replace(trial, runs=without), a_vehicle("waterjet", folder)))
    assert "bucket_port is an input" in told and "nozzle" not in told and "delta_r" not in told


def test_mistakes_in_actuators_are_told_at_once(tmp_path):
    path = tmp_path / "odd.toml"
    text = PLANTS["rudders"][0].replace('behind = "port"', 'behind = "bow"').replace('behind = "stbd"\n', "")
    text = text.replace('[actuators.1]\nkind = "fin"', '[actuators.rudder1]\nkind = "fin"')
    text += '\n[actuators.7]\nkind = "azimut"\n[actuators.8]\nkind = "fin"\nturn_lag = 0.3\n'
    path.write_text(text)
    with pytest.raises(VehicleError) as error:
        load_vehicle(path)
    for part in ("rudder1", "F_nn needs `behind`", "did you mean azimuth", "unknown key 'turn_lag'"):
        assert part in str(error.value), part
    path.write_text(PLANTS["rudders"][0].replace('behind = "port"', 'behind = "bow"'))
    with pytest.raises(VehicleError, match="behind 'bow', which is no thruster"):
        load_vehicle(path)
    path.write_text(PLANTS["waterjet"][0].replace("bucket_astern = 0.5\n", ""))
    with pytest.raises(VehicleError, match="give bucket_astern"):
        load_vehicle(path)


def test_a_measured_direction_is_taken_as_it_is_and_turns_right_round(folder):
    """Neither the rate limit nor the lag of the file is put behind a measured angle."""
    model, _ = plain("azimuth", folder)
    t = np.arange(0.0, 20.0, 0.5)
    commands = {"n_stern_cmd": np.full(t.size, 500.0)}
    turning = {"azimuth_stern": 2.0 * t}  # 115 degrees a second, six turns and more
    plan = plan_run(model, t, commands, turning, max_step=0.02)
    read = simulate(model, model.nominal, plan, np.zeros(6)).states
    order = plan_run(model, t, commands | {"azimuth_stern_cmd": 2.0 * t}, max_step=0.02)
    ordered = simulate(model, model.nominal, order, np.zeros(6)).states
    # thrust that goes round quickly pushes nowhere; ordered, it turns by 20 degrees a second
    assert np.abs(read[:, 3]).max() < 0.15 < np.abs(ordered[:, 3]).max()


def test_a_pod_goes_the_shorter_way_to_an_order_unless_stops_forbid_it(folder):
    """From 150 degrees to starboard to 150 to port: 60 degrees past astern, or 300 past ahead."""
    model, _ = plain("azimuth", folder)
    t = np.arange(0.0, 4.0, 0.5)
    orders = {"azimuth_stern_cmd": np.where(t < 1.0, 1.0, -1.0) * np.radians(150.0)}
    a = model.kernel.actuators.index("azimuth_stern")
    free = plan_run(model, t, orders).levels[:, a]
    assert np.degrees(free[-1]) == pytest.approx(210.0)
    stern = replace(model.vehicle.thrusters[0], turn_max_deg=160.0)
    stopped = build_model(replace(model.vehicle, thrusters=(stern, model.vehicle.thrusters[1])))
    assert np.degrees(plan_run(stopped, t, orders).levels[-1, a]) == pytest.approx(-150.0)
    # the position itself is continuous, whatever wrap was logged
    read = {"azimuth_stern": np.angle(np.exp(1j * 2.0 * t))}
    assert plan_run(model, t, {}, read).levels[-1, a] == pytest.approx(2.0 * t[-1])


def test_orders_of_a_pod_are_read_as_they_were_logged(folder, tmp_path):
    """Unwrapped on reading, a pod with stops would be ordered past them."""
    a_vehicle("azimuth", folder)
    trial = plant_trial("azimuth", folder / "azimuth.toml", 3)
    t = trial.runs[0].t
    there_and_back = {"azimuth_stern_cmd": np.where((t // 20) % 2 == 0, 2.5, -2.5)}
    trial = replace(trial, runs=tuple(replace(r, commands=r.commands | there_and_back) for r in trial.runs))
    again = load_trial(write_trial(trial, tmp_path / "bundle"))
    for one, two in zip(trial.runs, again.runs, strict=True):
        assert np.allclose(one.commands["azimuth_stern_cmd"], two.commands["azimuth_stern_cmd"])
    assert not [text for text in check_runs(again.runs) if "azimuth" in text]


def test_jets_whose_buckets_are_half_down_push_sideways_alone(folder):
    """Closed form: with bucket_astern s the jet goes nowhere ahead at b = -(1 - s)/(1 + s)."""
    vehicle = a_vehicle("waterjet", folder)
    model, _ = plain("waterjet", folder)
    t = np.array([0.0, 1e-3])
    orders = {f"n_{n}_cmd": np.full(2, 2000.0) for n in ("port", "stbd")}
    orders |= {f"bucket_{n}_cmd": np.full(2, -1 / 3) for n in ("port", "stbd")}
    orders |= {f"nozzle_{n}_cmd": np.full(2, 0.3) for n in ("port", "stbd")}
    x = simulate(model, model.nominal, plan_run(model, t, orders), np.zeros(6)).states[-1] / 1e-3
    side = 2 * vehicle.thrusters[0].T_nn * 1900.0**2 * np.sin(0.3)
    assert x[3] == pytest.approx(0.0, abs=1e-6)
    assert x[4] == pytest.approx(side / 115.0, rel=1e-3)
    assert x[5] == pytest.approx(-0.9 * side / 28.0, rel=1e-3)


def test_tables_of_orders_have_the_units_of_their_columns_and_are_read_back(tmp_path):
    """Revolutions of a thruster were written in degrees."""
    t = np.arange(3.0)
    orders = {
        "n_port_cmd": np.array([0.0, 900.0, 0.0]), "nozzle_port_cmd": np.array([0.0, 0.2, 0.0]),
        "bucket_port_cmd": np.array([1.0, -1.0, 1.0]), "delta_r_cmd": np.array([0.0, 0.1, 0.0]),
    }  # fmt: skip
    path = write_table(OpenLoop("jets", t, orders), tmp_path / "orders.csv")
    head = path.read_text().splitlines()[0]
    for part in ("n_port_cmd[rpm]", "nozzle_port_cmd[deg]", "bucket_port_cmd[-]", "delta_r_cmd[deg]"):
        assert part in head
    again = read_table(path)
    for name, values in orders.items():
        assert again.commands[name] == pytest.approx(values, abs=1e-12)
    path.write_text(path.read_text().replace("bucket_port_cmd[-]", "bucket_port_cmd[%]"))
    assert read_table(path).commands["bucket_port_cmd"] == pytest.approx([0.01, -0.01, 0.01])
    path.write_text("t[s],bucket_port_cmd[rpm]\n0,1\n1,1\n")
    with pytest.raises(ManoeuvreError, match=r"bucket_port_cmd\[-\]"):
        read_table(path)


@pytest.mark.parametrize("which", PLANTS)
def test_a_similar_vehicle_makes_similar_speed(which, folder):
    vehicle = a_vehicle(which, folder)
    twice = scaled(vehicle, length=2 * vehicle.L).vehicle
    faster = self_propulsion_speed(twice, twice.rpm_ref) / self_propulsion_speed(vehicle, vehicle.rpm_ref)
    assert faster == pytest.approx(np.sqrt(2), rel=1e-9)
    assert {a.name: a.direction for a in twice.actuators} == {a.name: a.direction for a in vehicle.actuators}


def test_a_manoeuvre_of_delta_r_is_refused_with_the_columns_there_are(folder):
    a_vehicle("waterjet", folder)
    with pytest.raises(ManoeuvreError, match=r"nozzle_port_cmd\[deg\], bucket_port_cmd\[-\]"):
        bayesid.simulate(str(folder / "waterjet.toml"), "zigzag:10/10")


def test_a_schema_lists_the_columns(folder):
    from bayesid.trials.schema import trial_schema

    text = json.dumps(trial_schema())
    assert all(name in text for name in ("azimuth_bow_cmd", "nozzle_port", "bucket_stbd", "delta_4"))


def test_a_vehicle_is_shown_with_its_actuators_and_their_effects(folder, capsys):
    a_vehicle("waterjet", folder)
    path = str(folder / "waterjet.toml")

    def said(*line):
        run(list(line))
        text = capsys.readouterr()
        return " ".join((text.out + text.err).split())

    shown = said("vehicle", "show", path)
    assert "waterjet" in shown and "nozzle_port[deg]" in shown and "bucket_astern 0.5" in shown
    assert "nozzle_port_lag" in said("effect", "list", "--vehicle", path)
    assert "servo" in said("effect", "show", "nozzle_port_lag", "--vehicle", path)
    assert "--vehicle" in said("effect", "show", "zzz")


def test_a_pod_with_stops_at_astern_is_not_taken_past_them():
    orders = np.radians([170.0, -170.0, -90.0, -10.0])
    assert _turns(orders, np.pi) == pytest.approx(orders)  # held at the stop, had it been unwrapped
    assert _turns(orders, np.radians(200.0)) == pytest.approx(orders)
    free = servo("azimuth_stern", UNLIMITED, 0.0, UNLIMITED)["limit_azimuth_stern"]
    assert _turns(orders, free) == pytest.approx(np.radians([170.0, 190.0, 270.0, 350.0]))


def test_a_table_with_numbered_actuators_is_in_the_format_of_a_bundle():
    heads = ["x[m]", "y[m]", "psi[rad]"]
    assert in_bundle_format([*heads, "n_1_cmd[rpm]", "azimuth_1_cmd[rad]"])
    assert not in_bundle_format(heads)
