"""What a diagnosis leaves out: innovation outliers, events, and the loop over both."""

from dataclasses import replace
from types import SimpleNamespace as Plain

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial
from numpy.linalg import LinAlgError

from bayesid.diagnosis import exclusions
from bayesid.diagnosis.data.event import Event, without_readings
from bayesid.diagnosis.data.outliers import stripped
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses import sensitivity_bank as banks
from bayesid.errors import ModelError, TrialError
from bayesid.trials import Run


def test_yaw_rates_off_by_eight_sigma_are_found_along_the_fit_and_nothing_else_is():
    model = model_of("generic_sub")
    trial = planted_trial(model, other_vehicle(model, 5), seed=1, samples=160)
    problem = build_problem(model, trial)
    log = problem.logs[0]
    j = log.channels.index("r")
    at = np.array([40, 90, 91 + 30])
    readings = log.readings.copy()
    readings[at, j] += 8.0 * log.sigma[j]
    spoilt = [replace(log, readings=readings), *problem.logs[1:]]
    fitted = fit_with(replace(problem, logs=tuple(spoilt)), ())
    kept, found = stripped(model, spoilt, fitted.points, problem.environment.noise_model)
    assert {(r, c) for r, _, c in found} == {(log.name, "r")}
    assert {round(t, 6) for _, t, _ in found} == {round(float(log.plan.t[i]), 6) for i in at}
    assert not kept[0].valid[at, j].any()
    assert stripped(model, problem.logs, fitted.points, problem.environment.noise_model)[1] == ()


def test_single_readings_are_taken_from_their_run_and_channel_and_from_no_other():
    t = 0.1 * np.arange(40)
    run = Run("a", "turn", "identify", t, {"r": np.sin(t), "psi": t}, {"n_cmd": np.ones(40)})
    less = without_readings(run, [(run.name, float(run.t[7]), "r"), ("another", float(run.t[9]), "r")])
    assert list(np.flatnonzero(np.isnan(less.data["r"]))) == [7]
    for name, values in run.data.items():
        assert np.isfinite(values).all()  # the run itself is as it was
        if name != "r":
            np.testing.assert_array_equal(less.data[name], values)


EVENT = Event("a", 3.0, 5.0, "r", "sensor", 20.0)
EARLY, LATE = ("a", 1.0, "r"), ("a", 2.0, "psi")


def passes(
    monkeypatch,
    outliers=(),
    events=(),
    fails=lambda events, readings: None,
    unable=None,
    brief=lambda: (),
    depends=lambda: None,
    over=lambda: np.inf,
    first_look=False,
    source="measured",
    settled=lambda found: found,
):
    """Run the loop with stand-ins; what each pass excluded, and the outcome.

    `outliers` are contradicted readings once events are known and before: one entry per round of events.
    `brief` gives brief events or raises, `depends` what the rest depends on, `over` by how much a free force
    gains more than one of the motion.
    """
    seen = []

    def build(model, trial, notify, as_built, events, readings):
        if (error := fails(events, readings)) is not None:
            raise error
        seen.append((events, readings))
        return Plain(events=events, outliers=(*readings, EARLY), environment=Plain(source=source))

    rounds = iter(outliers)
    monkeypatch.setattr(exclusions, "build_problem", build)
    fitted = Plain(released=lambda: "base")
    monkeypatch.setattr(exclusions, "fit_with", lambda problem, effects: fitted)
    monkeypatch.setattr(exclusions, "innovation_outliers", lambda problem, base: next(rounds, ()))
    monkeypatch.setattr(
        exclusions,
        "compared",
        lambda problem, notify, seed, base: Compared(problem, f"compared {len(seen)}", unable),
    )
    monkeypatch.setattr(exclusions, "in_its_environment", lambda found, notify, seed: settled(found))
    best = Plain(fit=Plain(free=None, followed=None))
    monkeypatch.setattr(exclusions, "simplest", lambda candidates: best)
    monkeypatch.setattr(exclusions, "sought_in", lambda problem, free, points: None)
    monkeypatch.setattr(exclusions, "find_events", lambda problem, trial, best, notify: events)
    monkeypatch.setattr(exclusions, "_brief", lambda found, best, sought: brief())
    monkeypatch.setattr(exclusions, "dependence_beside", lambda found, best, sought: depends())
    monkeypatch.setattr(exclusions, "over_motion", lambda found, sought: over())
    monkeypatch.setattr(exclusions, "held_where_stuck", lambda found, *rest: found)
    monkeypatch.setattr(
        exclusions,
        "with_events",
        lambda candidates, found, depends: f"{candidates} + {len(found)}" if found else candidates,
    )
    return seen, exclusions.compare_without(None, None, first_look=first_look)


def test_with_nothing_to_exclude_there_is_one_pass(monkeypatch):
    seen, found = passes(monkeypatch)
    assert seen == [((), ())] and found.candidates == "compared 1" and found.unable is None


def refuse(*args):
    raise AssertionError("a first look asks for this")


def test_a_first_look_compares_once_and_says_what_it_left_out(monkeypatch):
    seen, found = passes(
        monkeypatch, ((LATE,),), (EVENT,), brief=refuse, over=lambda: 7.0, first_look=True, settled=refuse
    )
    assert len(seen) == 2  # outliers are left out all the same
    assert found.problem.events == () and found.over_motion == 7.0
    assert "first look" in found.unable and "--quick" in found.unable


@pytest.mark.parametrize("source", ["measured", "assumed"])
def test_an_environment_no_straight_run_tells_is_asked_at_a_first_look_too(monkeypatch, source):
    """Without straight runs it comes out up to ten times too large."""
    asked = []
    passes(monkeypatch, first_look=True, source=source, settled=lambda found: asked.append(1) or found)
    assert len(asked) == (source == "assumed")


def test_outliers_are_left_out_together_with_those_found_before_anything_was_fitted(monkeypatch):
    seen, found = passes(monkeypatch, outliers=((LATE,),))
    assert seen == [((), ()), ((), (EARLY, LATE))] and found.candidates == "compared 2"


def test_outliers_are_sought_anew_without_the_events(monkeypatch):
    seen, found = passes(monkeypatch, outliers=((LATE,), (LATE,)), events=(EVENT,))
    assert seen[2:] == [((EVENT,), ()), ((EVENT,), (EARLY, LATE))]
    assert found.candidates == "compared 4 + 1" and found.problem.events == (EVENT,)


def test_events_whose_removal_cannot_be_diagnosed_are_counted_and_said(monkeypatch):
    def fails(events, readings):
        return ModelError("left the region") if events else None

    seen, found = passes(monkeypatch, events=(EVENT,), fails=fails)
    assert found.candidates == "compared 1" and found.problem.events == () and len(seen) == 1
    assert found.unable.startswith("the trial without a 3-5 s could not be diagnosed (left the region)")
    *_, found = passes(monkeypatch, events=(EVENT,), fails=fails, unable="no model form")
    assert found.unable.startswith("no model form; the trial without a 3-5 s could not")


def test_a_force_of_the_motion_is_asked_for_too_where_the_trial_without_events_cannot_be_diagnosed(
    monkeypatch,
):
    def fails(events, readings):
        return ModelError("left the region") if events else None

    _, found = passes(monkeypatch, events=(EVENT,), fails=fails, over=lambda: -30.0)
    assert found.over_motion == -30.0

    def singular():
        raise LinAlgError("not positive definite")

    _, found = passes(monkeypatch, events=(EVENT,), fails=fails, over=singular)
    assert found.over_motion == np.inf
    assert found.unable.endswith(
        "a force of the motion of any shape could not be looked for (not positive definite)"
    )


BRIEF = Event("b", 7.0, 9.0, "rudder", "motion", None, 40.0, brief=True)


def test_brief_events_are_looked_for_once_and_after_gross_ones(monkeypatch):
    seen, found = passes(monkeypatch, brief=lambda: (BRIEF,))
    assert seen == [((), ()), ((BRIEF,), ())] and found.candidates == "compared 2 + 1"
    seen, found = passes(monkeypatch, events=(EVENT,), brief=lambda: (BRIEF,))
    assert seen == [((), ()), ((EVENT,), ()), ((EVENT, BRIEF), ())] and found.candidates == "compared 3 + 2"
    rounds = ((LATE,), (LATE,), (LATE,))  # of outliers: at first, without gross events, without brief ones
    seen, _ = passes(monkeypatch, rounds, (EVENT,), brief=lambda: (BRIEF,))
    assert [events for events, _ in seen] == [(), (), (EVENT,), (EVENT,), (EVENT, BRIEF), (EVENT, BRIEF)]


def test_what_the_rest_depends_on_is_asked_once_nothing_more_is_left_out(monkeypatch):
    asked = []
    seen, found = passes(
        monkeypatch, events=(EVENT,), brief=lambda: (BRIEF,), depends=lambda: asked.append(1) or "the place"
    )
    assert len(seen) == 3 and asked == [1]
    assert found.dependence == "the place"


def test_gross_events_stay_left_out_where_brief_ones_cannot_be(monkeypatch):
    def fails(events, readings):
        return ModelError("left the region") if BRIEF in events else None

    _, found = passes(monkeypatch, events=(EVENT,), brief=lambda: (BRIEF,), fails=fails)
    assert found.candidates == "compared 2 + 1" and found.problem.events == (EVENT,)
    assert (
        found.unable == "the trial without b 7-9 s could not be diagnosed (left the region); they are counted"
    )


def test_a_search_for_brief_events_that_fails_costs_nothing_else(monkeypatch):
    def brief():
        raise LinAlgError("not positive definite")

    seen, found = passes(monkeypatch, brief=brief)
    assert len(seen) == 1 and found.candidates == "compared 1"
    assert found.unable == "brief events could not be looked for (not positive definite)"


def test_outliers_whose_removal_cannot_be_diagnosed_are_counted_and_said(monkeypatch):
    def fails(events, readings):
        return ModelError("left the region") if readings else None

    seen, found = passes(monkeypatch, outliers=((LATE,),), fails=fails, unable="no model form")
    assert seen == [((), ())] * 2 and found.candidates == "compared 2"
    assert found.unable.startswith("no model form; without 2 readings that all others contradict the trial")
    assert "(left the region)" in found.unable


def test_a_trial_with_nothing_to_identify_from_is_an_error(monkeypatch):
    with pytest.raises(TrialError, match="nothing"):
        passes(monkeypatch, fails=lambda events, readings: TrialError("nothing"))


class Follows:
    """A problem whose nominal path, readings' path or neither can be gone on from."""

    def __init__(self, path, *followed):
        self.path, self.followed, self.model, self.coefficients = path, followed, None, None
        self.logs, self.environment = (Plain(name="a"), Plain(name="b")), Plain(noise_model=None)

    def along_readings(self):
        return Follows(["at a", "at b"], *self.followed)

    def fit(self, problem, effects):
        if ("read" if problem.path[0] == "at a" else "nominal") not in self.followed:
            raise ModelError("it diverges")
        return Plain(released=lambda: "base")


@pytest.mark.parametrize("followed", ["nominal", "read"])
def test_a_fit_begins_along_the_readings_where_the_nominal_path_cannot_be_simulated(monkeypatch, followed):
    problem = Follows(["path", "path"], followed)
    monkeypatch.setattr(exclusions, "fit_with", problem.fit)
    used, base = exclusions._begun(problem)
    assert base == "base" and (used is problem) is (followed == "nominal")


def test_runs_that_cannot_be_followed_at_all_are_named_with_the_next_move(monkeypatch):
    problem = Follows(["path", "path"])
    monkeypatch.setattr(exclusions, "fit_with", problem.fit)

    def fit(model, logs, free, noise_model, start, iterations):
        if start == ["at b"]:
            raise ModelError("it diverges")

    monkeypatch.setattr(exclusions, "fit", fit)
    with pytest.raises(ModelError, match=r"along the readings of b \(it diverges\).*trial check.*--resample"):
        exclusions._begun(problem)


def exactly(stated):
    return Plain(names=stated.names, mean=stated.mean, sd=0.01 * stated.sd)


@pytest.mark.parametrize(
    ("known", "asked"),
    [
        (("Y_vvv,U", "N_rrr,U"), False), (("Y_vvv", "N_rrr", "N_v"), False), (("Y_vvv,U",), True),
        (("Y_vvv,U", "N_rrr,eta"), True), (("Y_vvr,U", "N_rrr"), True), ((), True),
    ],
)  # fmt: skip
def test_what_the_file_of_a_vehicle_has_as_uncertain_rows_is_not_asked_as_an_effect(known, asked):
    """A ship by Abkowitz or MMG has the cubes of its own; a wrong value of them is a wrong coefficient."""
    model = model_of("kvlcc2_mmg")
    problem = Plain(
        model=model, logs=[Plain(plan=Plain(measured=()))], channels=("x", "y", "psi"),
        coefficients=Plain(names=known), form=None, velocity_from_track=False,
        stated=Plain(names=known, mean=np.full(len(known), -2.0), sd=np.full(len(known), 0.2)),
    )  # fmt: skip
    cubes = model.effects["cubic_damping"]
    assert banks.testable(problem, cubes) is asked
    assert banks.testable(problem, model.effects["crossflow_drag"])
    # a user's effect of that name may be another force, and a row known to a thousandth is no other force
    assert banks.testable(problem, replace(cubes, as_form=""))
    assert banks.testable(Plain(**vars(problem) | {"stated": exactly(problem.stated)}), cubes)
    said = " ".join(banks.not_asked(problem))
    assert ("cubic damping is told as an error of these rows" in said) is not asked
