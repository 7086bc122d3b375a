"""Words of the verdict, given what the hypotheses weigh."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.event_words import unexplained
from bayesid.diagnosis.events_counted import verdict_with
from bayesid.diagnosis.hypotheses import candidate as candidates
from bayesid.diagnosis.hypotheses import facts, verdict
from bayesid.diagnosis.hypotheses.kinematic import Kinematics
from bayesid.diagnosis.hypotheses.location import location_of, locations
from bayesid.diagnosis.hypotheses.probabilities import FormError
from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, OTHER_DEPENDENCE
from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle

FAMILY = {"a": "one", "b": "two", "c": "three", "d": "one"}
EFFECTS = tuple(
    SimpleNamespace(name=n, family=f, where=("N",), as_form="", sensor={}, parameters=())
    for n, f in FAMILY.items()
)
PROBLEM = SimpleNamespace(
    model=SimpleNamespace(kernel=SimpleNamespace(effects=EFFECTS), effects={e.name: e for e in EFFECTS}),
    coefficients=SimpleNamespace(names=()),
    as_built=False,
    form=None,
)


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    monkeypatch.setattr(facts, "idle", lambda best, problem, table, told: ())
    monkeypatch.setattr(facts, "parameters_told", lambda problem, best, sensors: {})
    monkeypatch.setattr(facts, "sizes_told", lambda problem, candidates, best: {})
    monkeypatch.setattr(facts, "pulls", lambda fit, problem: np.array([0.5]))
    agreed = SimpleNamespace(total=1.0, disagreement=0.5, disagree=False, refuted=False)
    monkeypatch.setattr(facts, "cross_validate", lambda best, none, k: agreed)


def candidate(log_evidence, *effects):
    fit = SimpleNamespace(converged=True, chi2=1.0)
    return SimpleNamespace(effects=effects, log_evidence=log_evidence, fit=fit, widens=False)


def judged(
    refits,
    probabilities,
    inside=None,
    left=0.0,
    before=30.0,
    absorbed=(),
    as_built=False,
    faint=(),
    speak=(),
    place="N",
):
    best = max(refits, key=lambda c: c.log_evidence)
    return verdict.decide(
        SimpleNamespace(**vars(PROBLEM) | {"as_built": as_built}),
        SimpleNamespace(
            none=candidate(0.0),
            refits=tuple(sorted(refits, key=lambda c: -c.log_evidence)),
            best=best,
            probabilities={"none": 0.0, "outside": 0.0} | probabilities,
            inside=inside or probabilities,
            evidence={n: 5.0 if n in speak else -0.5 for n in FAMILY},
            where=SimpleNamespace(places=(SimpleNamespace(channel="N", evidence=before),)),
            where_after=SimpleNamespace(places=(SimpleNamespace(channel=place, evidence=left),)),
            ambiguity=SimpleNamespace(
                names=tuple(FAMILY),
                absorbed=[0.99 if n in absorbed else 0.1 for n in FAMILY],
                detect=[1.0 if n in faint else 400.0 for n in FAMILY],
            ),
            thresholds=SimpleNamespace(named=3.0, remainder=19.0, conflict=3.0),
            carried=0.0,
            carried_beside=0.0,
            form_instead=np.inf,
            sets={},
            error=FormError(),
            off=(),
            stand=(),
        ),
    )  # fmt: skip


def test_a_cause_outside_in_the_set_leaves_the_name_but_another_family_does_not():
    alone = [candidate(50.0, "a")]
    assert judged(alone, {"a": 0.94, "outside": 0.06}).word == "effect"
    assert judged(alone, {"a": 0.6, "d": 0.4}).word == "effect"  # one family
    assert judged(alone, {"a": 0.88, "b": 0.12}).word == "ambiguous"
    assert judged(alone, {"a": 0.4, "outside": 0.6}).word == "outside"


def test_no_name_is_given_below_nine_tenths_whatever_the_rival():
    alone = [candidate(50.0, "a")]
    for rival in ("b", "outside"):
        assert judged(alone, {"a": 0.91, rival: 0.09}).word == "effect"
        unsure = judged(alone, {"a": 0.85, rival: 0.15})
        assert unsure.word == "ambiguous" and {"a", rival} <= set(unsure.set95)


def test_what_could_not_be_seen_and_does_not_speak_is_no_other_answer_than_none():
    nothing, p = [candidate(1.0, "c")], {"none": 0.8, "a": 0.07, "b": 0.06, "c": 0.07}
    assert judged(nothing, p).set95 == ("none", "a", "c", "b")
    assert judged(nothing, p, faint="ab").set95 == ("none", "c")
    assert judged(nothing, p, faint="abc").set95 == ("none",)
    assert "a" in judged(nothing, p, faint="ab", speak="a").set95


def test_no_effect_is_said_only_where_it_is_more_probable_than_not():
    faint = [candidate(1.0, "c")]
    assert judged(faint, {"none": 0.4, "c": 0.6}).word == "ambiguous"
    assert judged(faint, {"none": 0.6, "c": 0.4}).word == "none"
    # what chance gives a free signal is no gap, and what is beyond chance is
    for p in (0.1, 0.02):  # in the 95 % set or not
        v = judged(faint, {"none": p, "outside": 1.0 - p}, before=5.0)
        assert v.word == "none" and v.set95[0] in ("none", "outside") and "none" in v.set95
    assert judged(faint, {"none": 0.1, "outside": 0.9}, before=30.0).word == "outside"


def test_a_coefficient_is_called_wrong_from_nine_tenths_only():
    wide = [candidate(50.0, "coefficient_error:N_r")]
    wide[0].widens = True
    assert judged(wide, {"coefficient_error": 0.92, "outside": 0.08}).word == "coefficients"
    assert judged(wide, {"coefficient_error": 0.85, "outside": 0.15}).word == "ambiguous"


def test_an_explanation_that_does_not_follow_the_readings_is_said_to_leave_something():
    rough = [candidate(500.0, "a")]
    rough[0].fit.chi2 = 100.0
    assert judged(rough, {"a": 1.0}).word == "effect_with_remainder"


def test_what_is_left_turns_an_effect_into_one_with_a_remainder():
    assert judged([candidate(500.0, "a")], {"a": 1.0}, left=18.0).word == "effect"
    assert judged([candidate(500.0, "a")], {"a": 1.0}, left=25.0).word == "effect_with_remainder"


@pytest.fixture
def pair():
    return [candidate(1000.0, "a", "b"), candidate(700.0, "a"), candidate(200.0, "b")]


def test_several_effects_are_named_beside_a_remainder_that_is_small_for_each(pair):
    share, inside = {"a": 0.5, "b": 0.5}, {"a": 1.0, "b": 1.0}
    assert judged(pair, share, inside, left=25.0).effects == ("a", "b")
    only = judged(pair, share, inside, left=60.0)  # a tenth of 800, not of 300
    assert (only.word, only.effects) == ("effect_with_remainder", ("a",))
    neither = judged(pair, share, inside, left=90.0)
    assert (neither.word, neither.effects) == ("ambiguous", ("a", "b"))
    assert judged(pair, {"outside": 0.6, "a": 0.2, "b": 0.2}, inside, left=90.0).word == "outside"


@pytest.mark.parametrize(
    ("channel", "named"), [("psi", ("a",)), ("N", ("a",)), ("u,v", ()), ("r", ())], ids=lambda x: str(x)
)
def test_what_kinematics_tells_of_a_sensor_holds_beside_what_is_left_elsewhere(
    pair, monkeypatch, channel, named
):
    """A late velocity log of a vehicle that rolls: roll is left in the compass, and casts no doubt on it."""
    late = SimpleNamespace(**vars(EFFECTS[0]) | {"sensor": {"r": 1}, "sensor_delay": {"delay": ("u", "v")}})
    model = SimpleNamespace(kernel=PROBLEM.model.kernel, effects=PROBLEM.model.effects | {"a": late})
    for name, value in (("model", model), ("form", object()), ("turns", False)):
        monkeypatch.setattr(PROBLEM, name, value, raising=False)
    monkeypatch.setattr(facts, "_covered", lambda *more: ((), False))
    monkeypatch.setattr(facts, "given_by_roll", lambda *more: False)
    monkeypatch.setattr(facts, "given_by_leeway", lambda *more: False)
    told = Kinematics(50.0, {"a": 50.0})
    monkeypatch.setattr(facts, "by_kinematics", lambda problem, best: told)
    v = judged(pair, {"a": 0.5, "b": 0.5}, {"a": 1.0, "b": 1.0}, left=90.0, place=channel)
    assert v.effects == (named or ("a", "b")) and v.word == (
        "effect_with_remainder" if named else "ambiguous"
    )


def test_what_chance_may_leave_takes_no_effect_away_though_the_runs_disagree(pair, monkeypatch):
    differ = SimpleNamespace(total=1.0, disagreement=1e-5, disagree=True, refuted=False)
    monkeypatch.setattr(facts, "cross_validate", lambda best, none, k: differ)
    small = [candidate(60.0, "a", "b"), candidate(40.0, "a"), candidate(30.0, "b")]
    assert judged(small, {"a": 0.5, "b": 0.5}, {"a": 1.0, "b": 1.0}, left=12.0).effects == ("a", "b")


def test_an_effect_of_no_size_is_not_named_beside_another(pair, monkeypatch):
    monkeypatch.setattr(facts, "idle", lambda best, problem, table, told: ("b",))
    v = judged(pair, {"a": 0.5, "b": 0.5}, {"a": 1.0, "b": 1.0})
    assert (v.word, v.effects) == ("effect_with_remainder", ("a",))
    monkeypatch.setattr(facts, "idle", lambda best, problem, table, told: ("a",))
    assert judged([candidate(50.0, "a")], {"a": 1.0}).word == "ambiguous"


def test_an_effect_is_idle_where_its_sizes_are_worth_less_than_odds_of_twenty(monkeypatch):
    effect = {
        n: SimpleNamespace(key=lambda p, n=n: f"{n}.{p}", parameters=[SimpleNamespace(name=p) for p in ps])
        for n, ps in {"still": ("size", "shape"), "acts": ("size", "other")}.items()
    }
    table = {
        "still.size": (0.05, 0.1),
        "still.shape": (9.0, 0.1),
        "acts.size": (0.0, 0.1),
        "acts.other": (0.5, 0.1),
    }
    limits = dict.fromkeys(range(4), (-np.inf, np.inf))
    model = SimpleNamespace(
        effects=effect,
        index={k: i for i, k in enumerate(table)},
        effect_off={1: 1.0, 0: 0.0},
        effect_limits=limits,
        nominal=np.zeros(4),
    )
    monkeypatch.setattr(candidates, "parameter_table", lambda fit, problem: table)
    both = SimpleNamespace(effects=("still", "acts"), fit=None)
    assert candidates.idle(both, SimpleNamespace(model=model)) == ("still",)
    limits[3] = (0.6, 1.0)  # what is half is not that effect
    assert candidates.idle(both, SimpleNamespace(model=model)) == ("still", "acts")
    limits[3] = (-np.inf, np.inf)
    for z, names in ((2.4, ("still",)), (2.5, ())):  # 2.45 deviations are worth 3 nats
        table["still.size"] = (0.1 * z, 0.1)
        assert candidates.idle(both, SimpleNamespace(model=model)) == names
    # told with wider intervals where the equations lack a form, one number within 1.96 deviations of
    # nought, two of them together within 2.45, are no effect that could be told
    for size, others, names in (
        (0.195, 0.5, ("still",)), (0.197, 0.5, ()), (0.197, 0.24, ("acts",)), (0.197, 0.25, ()),
    ):  # fmt: skip
        told = table | {"still.size": (size, 0.1), "acts.other": (others, 0.1)}
        assert candidates.idle(both, SimpleNamespace(model=model), table, told) == names
    # a gain that the vehicle states, found where it is stated, is no more than is there already
    model.nominal[3] = 0.5
    table["still.size"] = (0.5, 0.1)
    assert candidates.idle(both, SimpleNamespace(model=model)) == ("acts",)


def test_a_mass_that_shows_in_its_moment_alone_is_not_idle():
    """Half of a deviation of mass at a place that is sure: of simulated masses worth 3 nats whose moment
    shows the size alone would give up more than every second."""
    model = build_model(load_vehicle("generic_sub"), 3)
    mass = SimpleNamespace(effects=("ballast_mass",), fit=None)
    length = model.scales["L"]
    for place, names in ((0.3, ()), (0.03, ("ballast_mass",))):
        table = {
            "ballast_mass.mass_fraction": (0.005, 0.01),
            "ballast_mass.x": (place * length, 0.06 * length),
        }
        assert candidates.idle(mass, SimpleNamespace(model=model), table) == names


def test_a_second_effect_that_might_be_another_is_not_named(pair):
    v = judged(pair, {"a": 0.5, "b": 0.3, "c": 0.2}, {"a": 1.0, "b": 0.6, "c": 0.4})
    assert (v.word, v.effects) == ("effect_with_remainder", ("a",))
    assert {"b", "c"} <= set(v.set95)


def test_what_the_coefficients_can_hide_is_named_where_it_is_sure_that_they_do_not():
    alone, unsure = [candidate(50.0, "a")], {"a": 0.89, "coefficient_error": 0.11}
    assert judged(alone, {"a": 1.0}, absorbed="a").word == "effect"
    assert judged(alone, unsure, absorbed="a").word == "coefficients"
    assert judged(alone, unsure).word == "ambiguous"
    assert judged(alone, unsure, absorbed="a", as_built=True).word == "ambiguous"


def the_rest(gain, carried=0.0):
    """Hypotheses of a trial without its events."""
    best = SimpleNamespace(effects=("a",), log_evidence=gain)
    return SimpleNamespace(best=best, refits=(best,), none=SimpleNamespace(log_evidence=0.0), carried=carried)


def test_a_motion_leaves_a_cause_outside_the_list_as_it_is():
    motion = Event("r1", 10.0, 16.0, "delta_r", "motion", 30.0, 200.0)
    before = verdict.Verdict("outside", (), ("outside",), (), (), "unlisted cause")
    found = verdict_with(before, (motion,), the_rest(50.0))
    assert replace(found, reasons=()) == before and "left out as events" in found.reasons[-1]


def test_a_motion_nothing_explains_is_a_gap_whatever_the_coefficients_do():
    event = Event("r1", 10.0, 16.0, "delta_r", "motion", 30.0, 200.0)
    much = the_rest(500.0)
    for word, after in (
        ("none", "outside"),
        ("coefficients", "outside"),
        ("effect", "effect_with_remainder"),
    ):
        before = verdict.Verdict(word, (), ("none",), (), ())
        assert verdict_with(before, (event,), much).word == after
    unsure = verdict.Verdict("ambiguous", (), ("outside",), (), ())
    assert verdict_with(unsure, (event,), much).word == "outside"


def test_a_motion_with_which_a_run_begins_says_what_is_taken_of_its_first_orders():
    """A log that begins as a thruster starts from rest: it is simulated as if it had long turned."""
    for opens in (True, False):
        event = Event("dive5", 0.0, 1.8, "N", "motion", None, 40.0, brief=True, opens=opens)
        said = unexplained(SimpleNamespace(events=(event,), dependence=None))
        assert ("dive5 begins with it" in said) is opens


def test_a_brief_motion_takes_the_verdict_from_coefficients_only_where_it_says_more():
    event = Event("r1", 10.0, 16.0, "delta_r", "motion", None, 40.0, brief=True)
    before = verdict.Verdict("coefficients", ("coefficient_error",), ("coefficient_error",), (), ())
    less, more = (verdict_with(before, (event,), the_rest(gain, carried=300.0)) for gain in (41.0, 39.0))
    assert replace(less, reasons=()) == before and "left out as events" in less.reasons[-2]
    assert (more.word, more.effects, more.set95) == ("outside", (), ("outside",))
    form = verdict.Verdict("model_form", (), ("model_form",), (), ())
    assert verdict_with(form, (event,), the_rest(500.0, carried=300.0)).word == "outside"


@pytest.mark.parametrize(
    ("word", "alone", "after", "set95"),
    [
        ("none", 0.0, "none", ("a",)),
        ("model_form", 0.0, "model_form", ("a",)),
        ("none", 31.0, "outside", ("outside",)),
        ("model_form", 31.0, "outside", ("outside",)),
        ("coefficients", 60.0, "outside", ("outside",)),
        ("coefficients", 40.0, "coefficients", ("a",)),
        ("effect", 60.0, "outside", ("outside", "a")),
        ("effect", 40.0, "effect_with_remainder", ("a",)),
        ("several", 40.0, "several", ("a",)),
        ("ambiguous", 40.0, "ambiguous", ("a", "outside")),
    ],
)
def test_a_force_with_the_place_is_what_is_left_or_what_it_is(word, alone, after, set95):
    """The best explanation gains 50 nats, the force 35 beside it."""
    before = verdict.Verdict(word, ("a",), ("a",), (), ())
    found = verdict_with(before, (), the_rest(50.0), Dependence("place", "hull", 35.0, 40.0, 0.2, alone))
    assert (found.word, found.set95) == (after, set95)
    assert (found.rule == OTHER_DEPENDENCE) == (after == "outside")
    assert (found.effects == ()) == (after == "outside")


@pytest.mark.parametrize(
    ("word", "gain", "carried", "after"),
    [
        ("effect", 199.0, 0.0, "outside"),
        ("effect", 201.0, 0.0, "effect_with_remainder"),
        ("effect", 199.0, 50.0, "effect_with_remainder"),  # a form may carry a part of the motion
        ("ambiguous", 199.0, 0.0, "outside"),
        ("ambiguous", 201.0, 0.0, "ambiguous"),
        ("several", 201.0, 0.0, "several"),
        ("effect_with_remainder", 199.0, 0.0, "outside"),
    ],
)
def test_an_effect_that_explains_less_than_a_motion_nothing_explains_is_possible_and_not_named(
    word, gain, carried, after
):
    """A rudder that stuck for six seconds was worth 102 nats, the cubic damping that was named 11."""
    motion = Event("r1", 10.0, 16.0, "delta_r", "motion", 30.0, 200.0)
    before = verdict.Verdict(word, ("a",), ("a", "outside", "b"), (), ())
    found = verdict_with(before, (motion,), the_rest(gain, carried))
    assert found.word == after and "left out as events" in found.reasons[-2]
    assert f"the best explanation of the rest +{gain:.1f}" in found.reasons[-1]
    if after == "outside":
        assert found.effects == () and found.set95 == ("outside", "a", "b")
    else:
        assert (found.effects, found.set95) == (before.effects, before.set95)
    # the control: readings that were wrong for a while are no motion
    sensor = verdict_with(before, (replace(motion, kind="sensor"),), the_rest(gain, carried))
    assert sensor.word == word


def test_a_named_cause_puts_the_gap_where_it_acts_and_an_unknown_one_where_a_free_signal_says():
    model = SimpleNamespace(effects={e.name: e for e in EFFECTS})
    found = (("psi", 60.0), ("N", 55.0))
    where = SimpleNamespace(places=[SimpleNamespace(channel=n, evidence=e) for n, e in found])

    def told(**probabilities):
        return SimpleNamespace(
            where=where, probabilities={"none": 0.0} | probabilities, thresholds=SimpleNamespace(named=3.0)
        )

    assert location_of(told(a=1.0), model) == "N"
    assert location_of(told(outside=1.0), model) == "psi"
    assert sum(locations(told(a=0.7, outside=0.3), model).values()) == pytest.approx(1.0)


def test_held_out_runs_take_a_name_away_and_give_none():
    named = verdict.Verdict("effect", ("a",), ("a",), (), ("reason",), "effect")
    assert verdict.after_holdout(named, ()) is named
    gone = verdict.after_holdout(named, ("5 lengths",))
    assert (gone.word, gone.effects, gone.set95, gone.rule) == ("ambiguous", ("a",), ("a",), verdict.REFUTED)
    assert gone.reasons[0] == "reason" and "5 lengths" in gone.reasons[-1] and "effect (" in gone.reasons[-1]
    silent = verdict.Verdict("none", (), ("none",), (), (), "nothing beyond chance")
    assert verdict.after_holdout(silent, ("5 lengths",)) is silent


def test_a_cause_is_not_named_where_runs_left_out_and_their_agreement_both_speak_against_it():
    named = verdict.Verdict("several", ("a", "b"), ("a", "none", "b"), (), ("reason",), "several sure")
    gone = verdict.after_left_out(named, -0.30, 0.15, 1e-44)
    assert (gone.word, gone.effects, gone.set95) == ("outside", (), ("outside", "a", "b"))
    assert gone.rule == LEFT_OUT_WORSE and gone.reasons[0] == "reason"
    assert "a + b: runs left out are missed by 1.3 times" in gone.reasons[-1]
    assert "several sure" in gone.reasons[-1]
    # one failed check is not enough, nor what was not asked, nor a verdict without a name
    for gain, error, agreement in (
        (-0.30, 0.31, 1e-44), (0.30, 0.15, 1e-44), (-0.30, 0.15, 2e-3), (math.nan, math.nan, 1e-44),
        (-0.30, 0.15, None),
    ):  # fmt: skip
        assert verdict.after_left_out(named, gain, error, agreement) is named
    unsure = verdict.Verdict("ambiguous", ("a",), ("a", "none"), (), (), "unsure effect")
    assert verdict.after_left_out(unsure, -0.30, 0.15, 1e-44) is unsure


def test_a_function_of_the_motion_is_a_cause_alone_and_part_of_a_form_beside_others(pair):
    shaped = SimpleNamespace(
        **vars(PROBLEM)
        | {"model": SimpleNamespace(
            kernel=PROBLEM.model.kernel,
            effects={e.name: SimpleNamespace(**vars(e) | {"as_form": "also" if e.name == "b" else ""})
                     for e in EFFECTS},
        )}
    )  # fmt: skip
    names = facts.like_a_form
    weighed = SimpleNamespace(form_instead=np.inf)
    assert names(weighed, pair[0], shaped.model) == ("b",) and names(weighed, pair[2], shaped.model) == ()
    assert names(weighed, pair[0], PROBLEM.model) == ()
