"""Where no straight run tells the environment: what a gap passes for, and what is left beside its cause."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.benchmark.protocol.problem_file import read_problem, write_problem
from bayesid.diagnosis import environment_stage
from bayesid.diagnosis.data.model_form import ModelForm
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.environment_stage import in_its_environment
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.final_values import _noise
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.hypotheses.kinematic import NOTHING, by_kinematics, parameters_told
from bayesid.diagnosis.hypotheses.refit import refit
from bayesid.diagnosis.hypotheses.verdict import decide
from bayesid.diagnosis.result import schema
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.noise_identification import noise_beside


def unstated(trial):
    return replace(trial, environment=None)


def test_beside_its_cause_the_environment_is_quieter_than_the_gap_made_it():
    """A late rudder passes for a rough sea; with the lag in the model next to nothing is left of that."""
    model = model_of("generic_sub")
    lag = {"actuator_lag.tau": 0.75 * model.scales["L"] / model.scales["U"]}
    trial = unstated(planted_trial(model, other_vehicle(model, 3) | lag, 3, samples=160))
    problem = build_problem(model, trial)
    assert problem.environment.source == "assumed"
    lagged = fit_with(problem, (model.effects["actuator_lag"],))
    quiet, gain = noise_beside(lagged, problem.environment.noise_model)
    ratio = np.array(quiet.force) / np.array(problem.environment.noise_model.force)
    assert gain > 20.0 and ratio[-1] < 0.5
    again, little = noise_beside(lagged, quiet)
    assert little < 1.0 and np.allclose(again.force, quiet.force, rtol=0.5)


def test_what_straight_runs_measured_may_come_out_quieter_beside_the_cause_but_not_louder():
    """Process noise stated ten times too large is found again by the manoeuvres; a gap is no sea."""
    model = model_of("generic_sub")
    lag = {"actuator_lag.tau": 0.75 * model.scales["L"] / model.scales["U"]}
    trial = planted_trial(model, other_vehicle(model, 3) | lag, 3, samples=160)
    problem = build_problem(model, trial)
    true = problem.environment.noise_model
    loud = replace(true, force=tuple(10.0 * f for f in true.force))
    environment = replace(problem.environment, noise_model=loud, source="measured")
    wrong = replace(problem, environment=environment)
    beside_its_cause = fit_with(wrong, (model.effects["actuator_lag"],))
    quiet, gain = noise_beside(beside_its_cause, loud, louder=False)
    assert gain > 20.0 and quiet.force[-1] < 0.3 * loud.force[-1]
    ignorant = fit_with(replace(problem, environment=replace(environment, noise_model=true)), ())
    free, held = (noise_beside(ignorant, true, louder=louder)[0] for louder in (True, False))
    assert max(held.force) <= 1.001 * max(true.force) < 0.5 * max(free.force)


def test_a_sea_measured_below_the_bounds_of_a_first_guess_does_not_become_louder():
    model = model_of("generic_sub")
    problem = build_problem(model, planted_trial(model, other_vehicle(model, 3), 3, samples=100))
    true = problem.environment.noise_model
    calm = replace(true, force=tuple(1e-3 * f for f in true.force))
    quiet, gain = noise_beside(fit_with(problem, ()), calm, louder=False)
    assert (np.array(quiet.force) <= 1.001 * np.array(calm.force)).all() and gain >= 0.0


@pytest.mark.parametrize(("axis", "share", "taken"), [(0, 0.3, True), (2, 0.3, True), (1, 0.45, False)])
def test_only_a_force_below_what_straight_runs_left_possible_is_followed(monkeypatch, axis, share, taken):
    """0.375 is the lower end of 95 % of a factor with a spread of 0.5 in the logarithm."""
    fit = SimpleNamespace(converged=True, chi2=1.0)
    best = SimpleNamespace(log_evidence=100.0, fit=fit, effects=("lag",), widens=False, none=None, refits=())
    best.none = best
    measured = SimpleNamespace(
        source="measured", spread=0.5, noise_model=SimpleNamespace(force=(1.0, 2.0, 3.0))
    )
    problem = SimpleNamespace(environment=measured, with_environment=lambda noise, fits: noise)
    after = SimpleNamespace(log_evidence=150.0, fit=fit)
    force = np.array(measured.noise_model.force)
    force[axis] *= share

    def beside(fit, noise, louder):
        assert not louder
        return SimpleNamespace(force=tuple(force)), 50.0

    monkeypatch.setattr(environment_stage, "simplest", lambda candidates: candidates)
    monkeypatch.setattr(environment_stage, "noise_beside", beside)
    monkeypatch.setattr(environment_stage, "compared", lambda problem, *_, earlier: Compared(problem, after))
    found = Compared(problem, best)
    assert (in_its_environment(found, lambda text: None, 0) is not found) == taken


@pytest.mark.slow
def test_the_cause_is_named_in_the_environment_beside_it():
    model = model_of("generic_sub")
    lag = {"actuator_lag.tau": 0.75 * model.scales["L"] / model.scales["U"]}
    trial = unstated(planted_trial(model, other_vehicle(model, 3) | lag, 3, samples=160))
    problem = build_problem(model, trial)
    found = compare_without(model, trial)
    assert found.problem.environment.again
    assert found.problem.environment.noise_model.force[-1] < 0.5 * problem.environment.noise_model.force[-1]
    assert decide(found.problem, found.candidates).effects == ("actuator_lag",)


def test_an_environment_that_was_stated_is_not_measured_again(monkeypatch):
    problem = SimpleNamespace(environment=SimpleNamespace(source="stated"))
    found = SimpleNamespace(problem=problem, candidates=None)
    monkeypatch.setattr(environment_stage, "simplest", lambda candidates: None)
    assert in_its_environment(found, lambda text: None, 0) is found


def stage(monkeypatch, gain, evidence, follows=True):
    """What the stage answers where noise gains so much and the best beside it ends at this evidence."""

    def best(log_evidence, follows=True):
        fit = SimpleNamespace(converged=follows, chi2=1.0)
        none = SimpleNamespace(fit=fit, widens=False)
        return SimpleNamespace(
            log_evidence=log_evidence, fit=fit, effects=("lag",), none=none, refits=(), widens=False
        )

    environment = SimpleNamespace(source="assumed", noise_model="loud")
    problem = SimpleNamespace(environment=environment, with_environment=lambda noise, fits: noise)
    found = Compared(problem, best(100.0))
    later = Compared("quiet", best(evidence, follows))
    monkeypatch.setattr(environment_stage, "simplest", lambda candidates: candidates)
    monkeypatch.setattr(environment_stage, "noise_beside", lambda fit, noise, louder: ("quiet", gain))

    def compared(problem, notify, seed, earlier):
        assert (problem, earlier) == ("quiet", found.candidates)  # the best so far is tried there too
        return later

    monkeypatch.setattr(environment_stage, "compared", compared)
    return in_its_environment(found, lambda text: None, 0) is later


def test_the_hypotheses_are_those_of_the_new_environment_only_where_they_arrived_in_it(monkeypatch):
    assert stage(monkeypatch, 25.0, 130.0)
    assert not stage(monkeypatch, 15.0, 130.0)  # refits scatter by more
    assert not stage(monkeypatch, 25.0, 90.0)
    assert not stage(monkeypatch, 25.0, 130.0, follows=False)


def test_a_comparison_that_fails_there_leaves_what_was_found_and_says_so(monkeypatch):
    def fails(fit, noise, louder):
        raise ModelError("no path")

    fit = SimpleNamespace(converged=True, chi2=1.0)
    problem = SimpleNamespace(environment=SimpleNamespace(source="assumed", noise_model=None))
    found = Compared(problem, SimpleNamespace(fit=fit, effects=(), widens=False), "no form")
    monkeypatch.setattr(environment_stage, "simplest", lambda candidates: candidates)
    monkeypatch.setattr(environment_stage, "noise_beside", fails)
    answer = in_its_environment(found, lambda text: None, 0)
    assert answer.problem is problem and answer.unable.startswith("no form; ") and "no path" in answer.unable


@pytest.mark.parametrize(
    ("arrived", "gains", "after", "taken"),
    [
        (True, (5.0, 90.0), 140.0, "lag"),  # ahead in a noise of its own
        (True, (30.0, 40.0), 140.0, "wide"),
        (True, (5.0, 90.0), 95.0, None),  # what ends below the coefficients is not put before them
        (False, (0.0, 90.0), 95.0, "lag"),  # evidence of a fit that did not arrive is none
        (True, (5.0, 10.0), 140.0, None),
        (True, (None, 90.0), 140.0, "lag"),  # a path that noise cannot be told along takes the other not away
        (True, (30.0, None), 140.0, "wide"),
        (True, (None, None), 140.0, None),
    ],
)
def test_a_cause_is_not_put_behind_coefficients_by_the_noise_it_makes_itself(
    monkeypatch, arrived, gains, after, taken
):
    """Coefficients 40 nats ahead of a cause where the environment is what the gap made it."""

    def one(log_evidence, names, gain, converged=True):
        fit = SimpleNamespace(converged=converged, chi2=1.0, gain=gain, of=names)
        widens = bool(names) and names[0].startswith("coefficient_error")
        return SimpleNamespace(log_evidence=log_evidence, effects=names, fit=fit, widens=widens)

    wide = one(100.0, ("coefficient_error:every coefficient x3",), gains[0], arrived)
    refits = (wide, one(60.0, ("lag",), gains[1]), one(50.0, ("play",), 200.0))
    environment = SimpleNamespace(source="assumed", noise_model="loud")
    problem = SimpleNamespace(environment=environment, with_environment=lambda noise, fits: noise)
    found = Compared(problem, SimpleNamespace(none=one(0.0, (), 0.0), refits=refits, best=wide))
    later = SimpleNamespace(none=one(0.0, (), 0.0), refits=(one(after, ("lag",), 0.0),))
    monkeypatch.setattr(environment_stage, "simplest", lambda c: c.refits[0])
    begun = []

    def beside(fit, noise, louder):
        if fit.gain is None:
            raise ModelError("no path")
        return fit.of, fit.gain

    monkeypatch.setattr(environment_stage, "noise_beside", beside)

    def compared(noise, notify, seed, earlier):
        begun.append(earlier.effects)
        return Compared(noise, later)

    monkeypatch.setattr(environment_stage, "compared", compared)
    answer = in_its_environment(found, lambda text: None, 0)
    if taken is None:
        assert (answer.problem, answer.candidates) == (problem, found.candidates)
        assert (answer.unable is None) == (gains != (None, None))
    else:
        assert answer.candidates is later and begun == [wide.effects if taken == "wide" else ("lag",)]


def lacking(model, *effects, values):
    """Problem with a form, of a vehicle whose lateral rows are a third off, and its refit of some effects."""
    off = {n: 1.35 * model.nominal[model.index[n]] for n in ("Y_v", "N_r", "N_v") if n in model.index}
    problem = build_problem(model, planted_trial(model, off | values, 4, samples=160))
    problem = problem.with_form(ModelForm({"X": 0.0, "Y": 1e-3, "N": 1e-3}))
    chosen = tuple(model.effects[n] for n in effects)
    return problem, weighted_hypothesis(problem, effects, fit_with(problem, chosen))


def test_kinematics_tells_late_velocities_whatever_the_forces_are():
    model = model_of("generic_sub")
    late = 0.65 * model.scales["L"] / model.scales["U"]
    problem, refit = lacking(model, "velocity_latency", values={"velocity_latency.delay": late})
    said = by_kinematics(problem, refit)
    assert said.told == {"velocity_latency"} and said.evidence > 20.0
    value, sd = said.table["velocity_latency.delay"]
    assert abs(value - late) < 3.0 * sd and sd < 0.2 * late
    assert parameters_told(problem, refit)["velocity_latency.delay"] == (value, sd)
    assert by_kinematics(problem, weighted_hypothesis(problem, (), fit_with(problem, ()))) is NOTHING


def test_kinematics_has_no_say_outside_the_range_of_an_effect():
    """Positions that are late are velocities that are early: no such effect, and no evidence for one."""
    model = model_of("generic_sub")
    late = 0.6 * model.scales["L"] / model.scales["U"]
    problem, refit = lacking(model, "velocity_latency", values={"position_latency.delay": late})
    said = by_kinematics(problem, refit)
    assert said.evidence < 5.0 and not said.told
    assert all(value >= 0.0 for value, _ in parameters_told(problem, refit).values())


def test_kinematics_credits_a_compass_that_settles_with_no_more_than_it_explains():
    """Without the error of the compass there is no time to settle: a bias that stays explains more."""
    model = model_of("generic_sub")
    told = {}
    for name in ("heading_bias", "heading_settling"):
        problem, refit = lacking(model, name, values={"heading_bias.bias": 0.05})
        told[name] = by_kinematics(problem, refit).evidence
    assert 20.0 < told["heading_settling"] < told["heading_bias"]


def test_kinematics_does_not_part_a_turned_compass_from_turned_velocities():
    """Only their difference turns the track against the heading: each is told alone, neither beside it."""
    model = model_of("generic_sub")
    planted = {"heading_bias.bias": 0.05}
    problem, alone = lacking(model, "heading_bias", values=planted)
    assert by_kinematics(problem, alone).told == {"heading_bias"}
    problem, both = lacking(model, "heading_bias", "velocity_misalignment", values=planted)
    said = by_kinematics(problem, both)
    assert said.told == set() and said.evidence > 20.0 and not said.table


def test_refits_begin_where_the_same_unknowns_ended_in_the_other_environment():
    model = model_of("generic_sub")
    lag = {"actuator_lag.tau": 0.75 * model.scales["L"] / model.scales["U"]}
    problem = build_problem(model, planted_trial(model, other_vehicle(model, 3) | lag, 3, samples=160))
    effect = model.effects["actuator_lag"]
    ended = fit_with(problem, (effect,))
    noise = problem.environment.noise_model
    quiet = replace(noise, force=tuple(0.5 * f for f in noise.force))
    other = problem.with_environment(quiet, [ended])
    assert other.environment.again and not problem.environment.again
    assert other.ended_with(()) is None and other.ended_with((effect,)) == ended.points
    (near,), (anew,) = (refit(p, (effect,), print) for p in (other, problem.with_environment(quiet)))
    assert near.fit.iterations < anew.fit.iterations
    assert np.abs((near.fit.values - anew.fit.values) / anew.fit.sd).max() < 0.2


def test_that_an_environment_was_estimated_again_is_told_and_kept_and_files_without_it_are_read(tmp_path):
    model = model_of("generic_sub")
    problem = build_problem(model, planted_trial(model, other_vehicle(model, 3), 3, samples=60))
    anew = replace(problem, environment=replace(problem.environment, again=True), warnings=())
    assert [_noise(p).again for p in (problem, anew)] == [False, True]
    path = write_problem(anew, tmp_path / "posed.npz")
    assert read_problem(path)[0] == anew.environment
    with np.load(path) as stored:
        arrays = dict(stored)
    about = json.loads(str(arrays["about"]))
    del about["environment"]["again"]
    np.savez(path, **arrays | {"about": np.array(json.dumps(about))})
    assert read_problem(path)[0] == problem.environment
    kind = schema()["properties"]["environment"]
    assert kind["properties"]["again"] == {"type": "boolean"} and "again" not in kind["required"]
