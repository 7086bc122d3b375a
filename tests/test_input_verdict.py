"""A log that does not say what its header says is told before any gap; too little is told as such."""

from __future__ import annotations

import importlib
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.api.check import check
from bayesid.api.diagnose import diagnose
from bayesid.api.fit import fit
from bayesid.api.input_result import InputResult
from bayesid.api.simulate import simulate, simulate_model
from bayesid.diagnosis.input import (
    MOST_SAMPLES,
    WRONG_VEHICLE,
    check_trial,
    mended,
    not_enough,
    vehicle_behaviour,
)
from bayesid.diagnosis.input.wrong_vehicle import wrong_vehicle
from bayesid.diagnosis.input_gap import InputGap, _change, input_gap
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.run_errors import ErrorRow
from bayesid.equations.model import build_model
from bayesid.errors import TrialError
from bayesid.estimation.filter_error.fit_journal import SUFFIX, current_journal
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, steady_start
from bayesid.simulation import simulate as simulated
from bayesid.trials import Run, Trial
from bayesid.trials.condensing import condensed
from bayesid.trials.correction import Correction, apply
from bayesid.trials.mistakes import InputCheck, InputFinding
from studies.simulator_mistakes.plant import planted

DIVE = {"z": 0.05, "w": 0.008, "theta": 0.005, "q": 0.002}
NOISE = {"x": 0.03, "y": 0.03, "psi": 0.005, "r": 0.003, "u": 0.008, "v": 0.008}


@pytest.fixture(scope="module")
def clean() -> Trial:
    # nine readings in the time of a length: a fifth of the default, a fifth of the time of every check
    return simulate("remus100", "zigzag:10/10", "zigzag:13/10", "prbs:seed=2", noise=NOISE, seed=3, dt=0.1)


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("remus100"), 3)


@pytest.fixture(scope="module")
def clean_check(clean, model):
    """The clean log checked with its vehicle, once."""
    return check_trial(clean, model)


@pytest.fixture(scope="module")
def wrong_side(clean):
    """Diagnosis of the log with its rudder to the wrong side; that of the clean log is its `after`."""
    logged = wrong(clean, Correction(scale={"delta_r_cmd": -1.0}))
    return diagnose(logged, next_manoeuvre=False, keep_model=False)


def wrong(trial: Trial, correction: Correction) -> Trial:
    return replace(trial, runs=tuple(apply(correction, run) for run in trial.runs))


def test_a_clean_log_is_in_order_with_and_without_a_vehicle(clean, clean_check):
    for one in (check_trial(clean), clean_check):
        assert one.findings == ()
        assert "sign of the rudder" in one.in_order


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "correction"),
    [
        ("n: revolutions per second read as rpm", Correction(scale={"n_cmd": 1 / 60})),
        ("delta_r: radians read as degrees", Correction(scale={"delta_r_cmd": math.pi / 180})),
        ("sign of v", Correction(scale={"v": -1.0})),
        ("x, y: feet read as metres", Correction(scale={"x": 1 / 0.3048, "y": 1 / 0.3048})),
    ],
)
def test_the_vehicle_tells_what_kinematics_leaves_open(clean, model, name, correction):
    found = check_trial(wrong(clean, correction), model).findings
    assert [f.name for f in found] == [name]


@pytest.fixture(scope="module")
def dive() -> Trial:
    return simulate("nps_auv2", "combined:10/8", "vzigzag:10/5", dof=6, noise=NOISE | DIVE, seed=3, dt=0.1)


@pytest.mark.thorough
@pytest.mark.parametrize(("factor", "names"), [(1.0, []), (-1.0, ["sign of w"])])
def test_the_heave_of_a_pitching_turn_tells_its_sign(dive, factor, names):
    """Heave of 1 % of the speed: track and depth do not feel its sign, but the hull slides outwards.

    One run does not turn: there the noise of r is no mistake of r, though roll holds better without r.
    """
    model = build_model(load_vehicle("nps_auv2"), 6)
    assert [
        f.name for f in check_trial(wrong(dive, Correction(scale={"w": factor})), model).findings
    ] == names


SIMULATOR_MISTAKES = {row.name: row.change for row in planted()}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("simulator", "turned", "also", "instead"),
    [
        # the rudder turns the wrong way too: one mistake of the simulator is both, the log's sign is one
        ("sign of the fins", False, (), ("sign of the fins",)),
        # the planes alone: nothing in the world tells the sign of the log from that of the file
        ("sign of the stern planes", False, ("simulator: sign of the stern planes",), ()),
        ("nothing", True, ("simulator: sign of the stern planes",), ()),
    ],
)
def test_what_only_the_vehicle_tells_is_asked_of_the_simulator_too(dive, simulator, turned, also, instead):
    right = load_vehicle("nps_auv2")
    model = build_model(SIMULATOR_MISTAKES.get(simulator, lambda v: v)(right), 6)
    logged = wrong(dive, Correction(scale={"delta_s_cmd": -1.0})) if turned else dive
    check = check_trial(logged, model)
    (found,) = check.findings
    assert (found.name, found.also, found.instead) == ("sign of delta_s", also, instead)
    assert found.together == pytest.approx(2 * found.probability if also else 0.0, rel=0.1)
    assert len(check.of_log.findings) == (0 if instead else 1)
    assert check.insisted.findings[0].instead == ()


@pytest.mark.thorough
def test_fins_of_a_weak_simulator_are_not_told_exchanged():
    """Fins per degree read as per radian hardly turn the vehicle, so that exchanged fins, one of which rests,
    answered better; the simulator mended answers as expected, in what other fins tell."""
    orders = ("vzigzag:10/5", "combined:10/8", "zigzag:20/20")
    trial = simulate(
        "nps_auv2", *orders, dof=6, noise=NOISE | DIVE | {"phi": 0.005, "p": 0.002}, seed=3, dt=0.1
    )
    right = load_vehicle("nps_auv2")
    model = build_model(SIMULATOR_MISTAKES["fins per degree"](right), 6)
    found = check_trial(trial, model)
    assert not any("exchanged" in f.name for f in found.of_log.findings)
    assert any("fin angles in degrees" in f.instead for f in found.findings)


@pytest.mark.thorough
def test_what_kinematics_tells_is_not_asked_of_the_simulator(clean, model, monkeypatch):
    module = importlib.import_module("bayesid.diagnosis.input.simulator_instead")
    monkeypatch.setattr(module, "mended_simulators", lambda model: pytest.fail("asked"))
    for correction in (Correction(scale={"delta_r_cmd": -1.0}), Correction(scale={"psi": -1.0})):
        assert check_trial(wrong(clean, correction), model).findings


@pytest.mark.parametrize("gain", [0.3, 1.0, 2.5])
def test_a_simulator_that_scatters_is_not_excused_by_it(gain):
    """Where a turn has to be seen: exactly known gains as ever, every wide one below a known gain of one."""
    known, wide = vehicle_behaviour._seen_density, [0.5, 2.0, 10.0]
    assert known(gain, 1e-9) == pytest.approx(vehicle_behaviour._gain_density(gain, 1e-9), abs=1e-6)
    scattered = [known(gain, sd) for sd in wide]
    assert max(scattered) < 0.0 and scattered[2] < scattered[1] < -0.5
    assert vehicle_behaviour._gain_density(gain, 10.0) == 0.0  # of a log it is: no turn was to be seen


def test_a_log_of_another_vehicle_leaves_no_refits(clean, tmp_path, monkeypatch):
    """No mistake of the simulator explains it: the diagnosis that was tried is thrown away, and its fits."""
    module = importlib.import_module("bayesid.api.diagnose")
    finding = InputFinding(WRONG_VEHICLE, "another", (), (), True, 1.0, (), 1.0, 1.0, None, instead=("any",))
    monkeypatch.setattr(module, "check_trial", lambda trial, model: InputCheck((finding,)))
    monkeypatch.setattr(module, "not_enough", lambda trial, model: ())
    monkeypatch.setattr("bayesid.diagnosis.of_log.acts_before_its_stamp", lambda found: False)

    def tried(*_, **__):
        (current_journal().folder / f"a{SUFFIX}").write_bytes(b"")
        return SimpleNamespace(result=SimpleNamespace(simulator=()))

    monkeypatch.setattr(module, "run", tried)
    assert module.diagnose(clean, journal=tmp_path).verdict == "input"
    assert list(tmp_path.iterdir()) == []


def test_a_mistake_of_the_simulator_that_is_named_stands_before_that_of_the_log(clean, model, monkeypatch):
    """Both explain what only the vehicle tells: the log is diagnosed as it is; mended, if that names none."""
    module = importlib.import_module("bayesid.api.diagnose")
    turn = Correction(scale={"delta_r_cmd": -1.0})
    finding = InputFinding(
        "sign of delta_r", "", ("delta_r",), (), True, 1.0, ("vehicle's turn",), 0.0, 0.0, turn,
        instead=("sign of the fins",),
    )  # fmt: skip
    monkeypatch.setattr(module, "check_trial", lambda trial, model: InputCheck((finding,)))
    monkeypatch.setattr(module, "not_enough", lambda trial, model: ())
    monkeypatch.setattr("bayesid.diagnosis.of_log.acts_before_its_stamp", lambda found: False)
    tried: list[float] = []
    right = condensed(clean, model.vehicle, MOST_SAMPLES, as_seen=True).runs[0].commands["delta_r_cmd"]

    def run(named: tuple[str, ...]):
        def diagnosed(trial, *_, **__):
            tried.append(float(trial.runs[0].commands["delta_r_cmd"] @ right))
            return SimpleNamespace(result=SimpleNamespace(simulator=named, verdict="coefficients", runs=()))

        return diagnosed

    monkeypatch.setattr(module, "run", run(("sign of the fins",)))
    found = module.diagnose(clean)
    assert found.verdict == "coefficients" and found.checked.findings == ()
    monkeypatch.setattr(module, "run", run(()))
    found = module.diagnose(clean)
    assert found.verdict == "input" and found.checked.findings[0].instead == ()
    assert [np.sign(one) for one in tried] == [1.0, 1.0, -1.0]


@pytest.mark.thorough
def test_the_mended_log_is_the_clean_one_and_states_the_noise_of_it(clean, model):
    logged = wrong(clean, Correction(scale={"u": 1 / 0.3048, "v": 1 / 0.3048}))
    logged = replace(logged, noise={**clean.noise, "u": NOISE["u"] / 0.3048, "v": NOISE["v"] / 0.3048})
    now = mended(logged, check_trial(logged, model))
    for a, b in zip(clean.runs, now.runs, strict=True):
        np.testing.assert_allclose(b.data["u"], a.data["u"], rtol=1e-9)
    assert now.noise["u"] == pytest.approx(NOISE["u"])


@pytest.mark.thorough
def test_diagnose_says_input_and_what_is_left_once_it_is_mended(wrong_side):
    found = wrong_side
    assert isinstance(found, InputResult)
    record = found.record()
    assert record["verdict"] == found.verdict == "input"
    assert record["input"]["findings"][0]["mend"][0] == "[corrections]"
    assert record["after_mend"]["verdict"] == "none"
    assert "no gap is left" in found.summary()
    # the rudder of the log is to the wrong side: the simulator turns where the vehicle did not
    heading, position = (record["missed"]["rms"][k] for k in ("heading [degrees]", "position [m]"))
    assert heading["as logged"] > 20.0 > 5.0 > heading["mended"]
    assert position["as logged"] > 5.0 * position["mended"]
    shown = next(r for r in found.after.found.result.runs if r.run in record["missed"]["run"])
    assert position["mended"] == pytest.approx(shown.position["nominal"])
    first = found.summary().splitlines()[0]
    assert first.startswith("With the log read as its header says, the simulator as given misses the ")
    assert f"by {number(position['as logged'])} m and {number(heading['as logged'])} degrees" in first
    assert first in found.report().lead


@pytest.mark.thorough
def test_the_gap_of_a_right_log_is_the_same_as_logged_and_mended(clean, wrong_side, model):
    """The same replay is behind both numbers, whatever the noise it was read with."""
    found = wrong_side.after.found  # the mended log is the clean one to the bit
    read = condensed(clean, model.vehicle, MOST_SAMPLES, as_seen=True)  # averaged as the diagnosis reads it
    finding = SimpleNamespace(all_runs=False, runs=(clean.runs[1].name,))
    gap = input_gap(found, read, (finding,))
    assert clean.runs[1].name in gap.run
    for row in gap.rows:
        assert row.values[0] == pytest.approx(row.values[1], rel=1e-6)
    assert input_gap(found, read, (SimpleNamespace(all_runs=False, runs=("nowhere",)),)) is None


def test_the_gap_is_told_of_the_run_on_which_the_mend_changes_it_most():
    """Of a rudder to the wrong side a run without orders shows nothing."""

    def rows(before, after):
        return InputGap("run", (ErrorRow("heading", "degrees", (before, after)),))

    straight, turn, lost = rows(116.0, 116.0), rows(170.0, 3.0), rows(math.nan, 3.0)
    assert _change(straight) == 0.0 < _change(turn) < _change(lost) == math.inf
    assert lost.sentence() == (
        "With the log read as its header says, the simulator as given diverges on the run; with it mended, "
        "it misses it by 3 degrees."
    )


def test_a_dead_rudder_is_not_answered_none(clean):
    dead = tuple(
        replace(run, commands={**run.commands, "delta_r_cmd": np.zeros(run.n_samples)}) for run in clean.runs
    )
    found = diagnose(replace(clean, runs=dead))
    assert found.verdict == "input"
    assert found.record()["after_mend"] is None


def test_three_readings_and_a_heading_lost_between_readings_are_not_enough(clean, model):
    def every(k: int, most: int) -> Trial:
        runs = []
        for run in clean.runs:
            groups = {g: {n: v[::k][:most] for n, v in getattr(run, g).items()} for g in run.GROUPS}
            runs.append(replace(run, t=run.t[::k][:most], **groups))
        return replace(clean, runs=tuple(runs))

    few = every(100, 3)
    assert "3 readings" in not_enough(few, model)[0]
    assert diagnose(few).verdict == "not_enough"
    with pytest.raises(TrialError, match="3 readings"):
        fit(few)
    spun = replace(
        clean,
        runs=tuple(
            replace(r, data={**r.data, "psi": np.arange(r.n_samples) * math.radians(160)}) for r in clean.runs
        ),
    )
    assert "160 degrees" in not_enough(spun, model)[0]
    assert not_enough(clean, model) == ()


def test_straight_and_steady_runs_alone_are_not_enough(model):
    straight = simulate("remus100", "straight:duration=60", noise=NOISE, seed=1)
    assert "straight and steady" in not_enough(straight, model)[0]


@pytest.mark.thorough
def test_check_gives_one_sentence_per_mistake(clean):
    found = check(wrong(clean, Correction(exchange=(("x", "y"),))))
    assert len(found.sentences) == 1
    assert 'exchange = [["x", "y"]]' in found.sentences[0]


@pytest.mark.thorough
def test_a_remark_that_the_mend_accounts_for_is_not_repeated(clean):
    turned = wrong(clean, Correction(scale={"psi": -1.0}))
    assert any("turns against r" in text for text in check(turned).same)
    assert check(clean, with_vehicle=False).same == frozenset()


def test_mistakes_that_are_not_told_apart_have_a_common_probability(clean):
    """Heading and yaw rate alone do not tell a heading to port from one that counts from east."""
    turned = wrong(clean, Correction(scale={"psi": -1.0}))
    angles = [replace(run, data={k: run.data[k] for k in ("psi", "r")}) for run in turned.runs]
    turned = replace(turned, runs=tuple(angles))
    found = check_trial(turned).findings[0]
    assert {found.name, *found.also} >= {"sign of psi", "heading from east"}
    assert found.probability < found.together <= 1.0 + 1e-12


def test_a_heading_with_the_wrong_sign_beside_a_track_is_told_alone(clean):
    """No yaw rate is logged, so that its sign makes no second mistake of this one."""
    turned = wrong(clean, Correction(scale={"psi": -1.0}))
    pose = [replace(run, data={k: run.data[k] for k in ("x", "y", "psi")}) for run in turned.runs]
    found = check_trial(replace(turned, runs=tuple(pose))).findings[0]
    assert found.name == "sign of psi"
    assert not found.also and found.probability > 0.99


@pytest.mark.thorough
@pytest.mark.parametrize(("other", "also"), [("nps_auv2", True), ("delphin2", False)])
def test_a_log_of_another_vehicle_is_told_and_its_own_is_not(clean, clean_check, other, also):
    """Nothing but that is told by the file of `delphin2`, which makes the revolutions look like another
    unit."""
    stranger = build_model(load_vehicle(other), 3)
    found = [f.name for f in check_trial(clean, stranger).findings]
    assert WRONG_VEHICLE in found and (also or found == [WRONG_VEHICLE])
    assert clean_check.findings == ()


@pytest.mark.thorough
def test_what_kinematics_tells_of_the_log_of_another_vehicle_stays_told(clean):
    stranger = build_model(load_vehicle("delphin2"), 3)
    turned = check_trial(wrong(clean, Correction(scale={"psi": -1.0})), stranger)
    assert [f.name for f in turned.findings] == ["sign of psi", WRONG_VEHICLE]


def test_a_vehicle_that_starts_from_rest_is_no_slower_vehicle(model):
    """Runs cut while it still gathers way: it is as fast as the simulator is after such a start."""
    t = np.arange(0.0, 60.0, 1.0)
    commands = {"delta_r_cmd": 0.2 * np.sign(np.sin(t / 9.0)), "n_cmd": np.full(t.size, 90.0)}
    x0 = 0.1 * steady_start(model, 90.0)
    par = model.nominal
    states = simulated(model, par, plan_run(model, t, commands), x0).states
    data = {k: states[:, model.states.index(k)] for k in ("x", "y", "psi", "u", "v", "r")}
    runs = [Run(f"r{k}", "zigzag", "identify", t, data, commands) for k in (1, 2)]
    assert vehicle_behaviour.speed_ratio(model, runs[0]) < 0.5
    assert vehicle_behaviour.speed_beside_simulation(model, runs[0]) == pytest.approx(1.0, abs=0.02)
    assert wrong_vehicle(model, runs) is None
    slow = [replace(run, data=run.data | {"u": 0.2 * run.data["u"]}) for run in runs]
    assert wrong_vehicle(model, slow) is not None


def test_revolutions_of_an_engine_ahead_of_a_gear_are_asked_about(model):
    t = np.arange(0.0, 60.0, 1.0)
    commands = {
        "delta_r_cmd": 0.2 * np.sign(np.sin(t / 9.0)),
        "n_cmd": np.full(t.size, model.vehicle.rpm_ref),
    }
    plan = plan_run(model, t, commands)
    states = simulated(model, model.nominal, plan, steady_start(model)).states
    data = {k: states[:, model.states.index(k)] for k in ("x", "y", "psi", "u", "v", "r")}

    def told(gear: float, rudder: float = 1.0) -> str:
        logged = {"n_cmd": gear * commands["n_cmd"], "delta_r_cmd": rudder * commands["delta_r_cmd"]}
        found = wrong_vehicle(model, [Run(f"r{k}", "zigzag", "identify", t, data, logged) for k in (1, 2)])
        return "" if found is None else found.says

    assert "ahead of a gear" in told(2.6)
    assert "gear" not in told(2.6, rudder=0.1) and told(2.6, rudder=0.1)  # its turn is another vehicle's, too
    assert "gear" not in told(0.3) and told(0.3)  # faster than it can be at its revolutions: none has such
    assert not told(1.0)


def test_a_weak_rudder_is_no_other_vehicle(model):
    """Negative control: a rudder of 60 % and thrust of 80 % are causes of a gap."""
    nominal = model.nominal
    weak = {k: 0.6 * nominal[model.index[k]] for k in ("N_dr", "Y_dr")}
    logged = replace(build_model(load_vehicle("remus100"), 3), nominal=model.with_values(weak))
    weaker = simulate_model(
        logged, "remus100", ("zigzag:10/10", "zigzag:13/10", "prbs:seed=2"), 0.1, None, None, NOISE, 3
    )
    assert "wrong vehicle" not in [f.name for f in check_trial(weaker, model).findings]
