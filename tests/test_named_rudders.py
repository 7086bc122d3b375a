"""Named rudders that turn a vehicle the other way than its log does are told before any cause is weighed."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import bayesid
from bayesid.diagnosis.input import check_trial
from bayesid.diagnosis.input.simulator_instead import behaviour_of
from bayesid.equations.model import build_model
from bayesid.errors import ManoeuvreError
from bayesid.model.effects.named import whole_forces
from bayesid.model.vehicles import load_vehicle
from bayesid.model.vehicles.sufficient import lacking
from bayesid.report.fit_held import actuator_words
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run, Trial

LAUNCH = """
format = 1
[vehicle]
name = "launch with two rudders"
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
[actuators.3]
at = [-4.5, 0.0, 0.0]
direction = [1.0, 0.0, 0.0]
T_nn = 0.012
T_un = -0.8
[actuators.1]
kind = "fin"
at = [-4.8, -0.8, 0.0]
direction = [0.0, 1.0, 0.0]
F_uu = 300.0
[actuators.2]
kind = "fin"
at = [-4.8, 0.8, 0.0]
direction = [0.0, 1.0, 0.0]
F_uu = 300.0
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
NOISE = {"x": 0.2, "y": 0.2, "psi": 0.005, "r": 0.002}


@pytest.fixture(scope="module")
def zigzags(tmp_path_factory) -> Trial:
    file = tmp_path_factory.mktemp("launch") / "launch.toml"
    file.write_text(LAUNCH)
    model = build_model(load_vehicle(file), 3)
    rng, runs = np.random.default_rng(0), []
    for k, period in enumerate((18.0, 26.0)):
        t = np.arange(0.0, 120.0, 0.5)
        angle = 0.25 * np.sign(np.sin(2 * np.pi * t / period))
        commands = {"n_3_cmd": np.full(t.size, 600.0), "delta_1_cmd": angle, "delta_2_cmd": angle}
        plan = plan_run(model, t, commands)
        states = simulate(model, model.nominal, plan, steady_start(model)).states
        data = {n: states[:, model.states.index(n)] + rng.normal(0.0, NOISE[n], t.size) for n in NOISE}
        runs.append(Run(f"zz{k}", "zigzag", "identify", t, data, commands))
    return Trial("launch", Path("."), str(file), 3, tuple(runs), noise=NOISE)


def turned(trial: Trial, names: tuple[str, ...]) -> Trial:
    """The trial with some orders logged with the opposite sign."""
    runs = [
        replace(r, commands={k: -v if k in names else v for k, v in r.commands.items()}) for r in trial.runs
    ]
    return replace(trial, runs=tuple(runs))


def model_of(trial: Trial):
    return build_model(load_vehicle(trial.vehicle_ref), 3)


@pytest.mark.thorough
def test_rudders_of_the_right_sign_are_no_mistake(zigzags):
    assert check_trial(zigzags, model_of(zigzags)).findings == ()


@pytest.mark.thorough
def test_rudders_of_the_opposite_sign_are_told_with_their_mend(zigzags):
    wrong = turned(zigzags, ("delta_1_cmd", "delta_2_cmd"))
    (found,) = check_trial(wrong, model_of(wrong)).findings
    assert found.name == "sign of delta_1, delta_2"
    assert "`direction` in the vehicle file" in found.says
    assert found.correction.scale["delta_1_cmd"] == -1.0
    assert max(found.probability, found.together) > 0.95


def test_a_direction_of_the_wrong_sign_in_the_vehicle_file_is_told_alike(zigzags):
    model = model_of(zigzags)
    fins = tuple(replace(f, direction=(0.0, -f.direction[1], 0.0)) for f in model.vehicle.fins)
    (found,) = check_trial(zigzags, build_model(replace(model.vehicle, fins=fins), 3)).findings
    assert found.name == "sign of delta_1, delta_2"


@pytest.mark.thorough
def test_twin_rudders_have_one_lag_that_is_the_lag_of_both(zigzags):
    """One size on both gives the motion that each of two equal sizes gives."""
    model = model_of(zigzags)
    names = {e.name for e in model.causes}
    assert {"twin_fins_1_2_lag", "twin_fins_1_2_offset", "twin_fins_1_2_effectiveness"} <= names
    run = zigzags.runs[0]
    plan, start = plan_run(model, run.t, run.commands), steady_start(model)

    def motion(**values):
        return simulate(
            model, model.with_values({k.replace("__", "."): v for k, v in values.items()}), plan, start
        )

    for kind, size, value in (
        ("lag", "tau", 0.8),
        ("offset", "offset", 0.05),
        ("effectiveness", "share", 0.2),
    ):
        both = motion(**{f"twin_fins_1_2_{kind}__{size}": value}).states[:, :6]
        each = motion(**{f"delta_{k}_{kind}__{size}": value for k in (1, 2)}).states[:, :6]
        assert both == pytest.approx(each, rel=1e-9, abs=1e-9)
        assert np.abs(both - motion().states[:, :6]).max() > 1e-3


def test_forces_that_are_no_coefficients_are_scaled_by_one_effect_each_and_twins_by_one(zigzags):
    vehicle = model_of(zigzags).vehicle
    shafts = tuple(f"thruster_{a.name}_gain" for a in vehicle.actuators if a not in vehicle.fins)
    assert set(whole_forces(vehicle.actuators)) == {"twin_fins_1_2_effectiveness", *shafts} and shafts
    apart = tuple(replace(f, F_uu=f.F_uu * k) for k, f in enumerate(vehicle.fins, 1))
    single = {"delta_1_effectiveness", "delta_2_effectiveness"}
    assert single < set(whole_forces(replace(vehicle, fins=apart).actuators))


def held_fit(vehicle, signals, names, *failed, still=()):
    orders = {f"{s}_cmd": np.full(9, 0.0 if s in still else 0.2) for s in signals}
    return SimpleNamespace(
        trial=SimpleNamespace(identify=[SimpleNamespace(commands=orders, measured_inputs={})]),
        vehicle=vehicle, problem=SimpleNamespace(params=SimpleNamespace(names=names)),
        fit=SimpleNamespace(uncertainty={}), posterior=SimpleNamespace(not_final=lambda: list(failed)),
    )  # fmt: skip


def test_a_fit_that_is_not_final_asks_for_the_thrust_it_holds():
    auv = load_vehicle("remus100")
    (said,) = actuator_words(held_fit(auv, ("n", "delta_r"), ("Y_v",), "the runs disagree"))
    assert said.endswith("`--with thrust_loss`.")
    freed = held_fit(auv, ("n", "delta_r"), ("Y_v", "thrust_loss.loss"), "the runs disagree")
    assert actuator_words(freed) == []
    assert actuator_words(held_fit(auv, ("n",), ("Y_v",))) == []
    assert actuator_words(held_fit(auv, ("n",), ("Y_v",), "the runs disagree", still=("n",))) == []


def test_a_fit_that_is_not_final_asks_for_the_forces_it_holds(zigzags):
    model = model_of(zigzags)

    def fit(names, *failed, still=()):
        every = {s for a in model.vehicle.actuators for s in a.signals}
        return held_fit(model.vehicle, every, names, *failed, still=still)

    every = list(whole_forces(model.vehicle.actuators))
    (said,) = actuator_words(fit(("Y_v",), "the runs disagree"))
    assert f"`--with {','.join(every)}`" in said
    (said,) = actuator_words(fit(("Y_v", f"{every[0]}.share"), "the runs disagree"))
    assert every[0] not in said and every[1] in said
    assert actuator_words(fit(("Y_v",))) == []
    (said,) = actuator_words(fit(("Y_v",), "the runs disagree", still=("n_3",)))  # it does nothing there
    assert "thruster_3_gain" in every and "thruster_3_gain" not in said


def test_the_lag_of_a_fin_is_that_of_its_effect(tmp_path):
    """`lag` of [actuators.NAME] was refused: it was taken for that of a thruster."""
    file = tmp_path / "launch.toml"
    file.write_text(LAUNCH.replace("F_uu = 300.0", "F_uu = 300.0\nlag = 0.4"))
    vehicle = load_vehicle(file)
    assert [fin.lag for fin in vehicle.fins] == [0.4, 0.4] and not vehicle.effects
    file.write_text(LAUNCH)
    lagging, plain = build_model(vehicle, 3), build_model(load_vehicle(file), 3)
    late = plain.nominal.copy()
    late[[plain.index[f"delta_{name}_lag.tau"] for name in "12"]] = 0.4
    t = np.arange(0.0, 30.0, 0.5)
    orders = {"n_3_cmd": np.full(t.size, 600.0)} | {f"delta_{n}_cmd": 0.2 * (t > 5.0) for n in "12"}

    def heading(model, par):
        states = simulate(model, par, plan_run(model, t, orders), steady_start(model)).states
        return states[:, model.states.index("psi")]

    assert np.ptp(heading(plain, plain.nominal) - heading(plain, late)) > 0.005
    np.testing.assert_allclose(heading(lagging, lagging.nominal), heading(plain, late), atol=1e-12)


def test_fins_that_are_no_twins_have_no_common_effect(zigzags):
    vehicle = model_of(zigzags).vehicle
    apart = tuple(replace(f, F_uu=f.F_uu * k) for k, f in enumerate(vehicle.fins, 1))
    named = {e.name for e in build_model(replace(vehicle, fins=apart), 3).causes}
    assert "delta_1_lag" in named and not any(name.startswith("twin") for name in named)


@pytest.mark.thorough
def test_a_vehicle_with_two_rudders_that_are_not_alike_is_not_said_to_have_none(tmp_path):
    file = tmp_path / "launch.toml"
    file.write_text(LAUNCH)
    assert not [text for text in lacking(load_vehicle(file))["design"] if "has no rudder" in text]
    head, _, tail = LAUNCH.rpartition("F_uu = 300.0")
    file.write_text(f"{head}F_uu = 200.0{tail}")
    ship = load_vehicle(file)
    (design,) = [text for text in lacking(ship)["design"] if "has no rudder" in text]
    with pytest.raises(ManoeuvreError, match=r"columns t\[s\], n_3_cmd\[rpm\], delta_1_cmd") as said:
        bayesid.design(ship, quick=True)
    for text in (design, str(said.value)):
        assert (
            "has no rudder delta_r, its rudders 1 and 2 are not all alike and have orders of their own"
            in text
        )
    # what its table orders, its table can order
    columns = str(said.value).partition("columns ")[2].partition(")")[0].split(", ")
    (tmp_path / "orders.csv").write_text(f"{','.join(columns)}\n0,600,0,0\n20,600,10,10\n40,600,0,0\n")
    (run,) = bayesid.simulate(ship, f"table:{tmp_path / 'orders.csv'}").runs
    assert abs(run.data["psi"][-1]) > 0.1


@pytest.mark.thorough
def test_a_manoeuvre_is_designed_for_two_alike_rudders_by_their_own_columns(tmp_path):
    file = tmp_path / "launch.toml"
    file.write_text(LAUNCH)
    found = bayesid.design(load_vehicle(file), quick=True, tries=20, duration=60.0, prior=0.1)
    found.save(tmp_path / "next")
    table = tmp_path / "next" / "next_manoeuvre.csv"
    header, *_ = table.read_text().splitlines()
    assert header == "t[s],n_3_cmd[rpm],delta_1_cmd[deg],delta_2_cmd[deg]"
    assert found.plan.candidates[0].shown < found.plan.before
    (run,) = bayesid.simulate(file, f"table:{table}").runs
    most = abs(found.plan.orders.commands["delta_r_cmd"]).max()
    assert most > 0.1 and abs(run.commands["delta_1_cmd"]).max() == pytest.approx(most)
    assert run.commands["delta_1_cmd"] == pytest.approx(run.commands["delta_2_cmd"])


def fins_at(zigzags, *places):
    """The ship with the two fins of the launch at other places, along other directions."""
    vehicle = model_of(zigzags).vehicle
    fins = tuple(replace(f, at=at, direction=to) for f, (at, to) in zip(vehicle.fins, places, strict=True))
    return build_model(replace(vehicle, fins=fins), 3)


PORT, STARBOARD, SIDEWAYS = (-5.0, -0.9, 0.4), (-5.0, 0.9, 0.4), (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("one", "other", "twins"),
    [
        ((PORT, SIDEWAYS), (STARBOARD, SIDEWAYS), True),
        ((PORT, (0.0, 0.8, 0.6)), (STARBOARD, (0.0, 0.8, -0.6)), True),
        ((PORT, (0.0, 0.8, 0.6)), (STARBOARD, (0.0, -0.8, 0.6)), True),
        ((PORT, (0.0, 0.8, 0.6)), (STARBOARD, (0.0, 0.8, 0.6)), False),
        ((PORT, (0.0, 0.8, 0.6)), (STARBOARD, (0.0, 0.6, 0.8)), False),
        ((PORT, SIDEWAYS), (PORT, SIDEWAYS), False),
        ((PORT, SIDEWAYS), ((-4.0, 0.9, 0.4), SIDEWAYS), False),
    ],
)
def test_twins_are_fins_that_mirror_each_other(zigzags, one, other, twins):
    named = {e.name for e in fins_at(zigzags, one, other).causes}
    assert any(name.startswith("twin") for name in named) == twins


@pytest.mark.thorough
def test_a_fin_at_the_centre_says_nothing_of_the_sign_of_the_rudders(zigzags):
    """It does not turn the ship: with it, whichever side it is ordered to, the answer is that of the other
    fin alone."""
    model = fins_at(zigzags, (STARBOARD, SIDEWAYS), ((0.0, 0.9, 0.4), SIDEWAYS))
    run = zigzags.runs[0]
    alone = replace(run, commands={k: x for k, x in run.commands.items() if k != "delta_2_cmd"})
    said = [behaviour_of(model, [run])(r)["steering"] for r in (run, alone)]
    assert said[0] == said[1] != 0.0
