"""From hypotheses to facts to a verdict, over worlds drawn at random.

Expected: the outcomes of the table of horizons of conditions that the rules replaced.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.hypotheses import facts
from bayesid.diagnosis.hypotheses.kinematic import Kinematics, given_by_leeway, given_by_roll
from bayesid.diagnosis.hypotheses.probabilities import FormError
from bayesid.diagnosis.hypotheses.verdict import decide
from bayesid.diagnosis.threshold_table import NAMING_PROBABILITY
from bayesid.model.effects import CATALOGUE

FILE = Path(__file__).parent / "data" / "verdicts.json"
WORLDS = json.loads(FILE.read_text()) if FILE.exists() else []
FAMILY = {"a": "one", "b": "two", "c": "three", "d": "one"}
EFFECTS = tuple(
    SimpleNamespace(name=n, family=f, where=("N",), as_form="", sensor={}) for n, f in FAMILY.items()
)


def candidate(effects, log_evidence, chi2, converged):
    fit = SimpleNamespace(converged=converged, chi2=chi2, equations=())
    widens = bool(effects) and effects[0].startswith("coefficient_error")
    return SimpleNamespace(effects=tuple(effects), log_evidence=log_evidence, fit=fit, widens=widens)


def world(w):
    """Problem, comparison, and what stands in for the questions asked of fits."""
    refits = tuple(sorted((candidate(*r) for r in w["refits"]), key=lambda c: -c.log_evidence))
    none = candidate((), 0.0, w["none_chi2"], True)

    def place(evidence):
        return SimpleNamespace(places=(SimpleNamespace(channel="N", evidence=evidence),))

    comparison = SimpleNamespace(
        none=none, refits=refits, best=refits[0] if refits else none, probabilities=w["p"],
        inside=w["inside"], evidence=w["evidence"], where=place(w["before"]),
        where_after=None if w["after"] is None else place(w["after"]),
        ambiguity=SimpleNamespace(names=tuple(FAMILY), absorbed=w["absorbed"], detect=w["detect"]),
        thresholds=SimpleNamespace(named=3.0, remainder=19.0, conflict=w["conflict"]),
        carried=0.0, carried_beside=0.0, form_instead=np.inf, error=FormError(), sets={}, off=(), stand=(),
    )  # fmt: skip
    problem = SimpleNamespace(
        model=SimpleNamespace(kernel=SimpleNamespace(effects=EFFECTS), effects={e.name: e for e in EFFECTS}),
        coefficients=SimpleNamespace(names=()),
        as_built=w["as_built"],
        form=None,
    )
    stand_ins = {
        "parameters_told": lambda problem, best, sensors: {},
        "sizes_told": lambda problem, candidates, best: {},
        "idle": lambda best, problem, table, told: tuple(n for n in w["idle"] if n in best.effects),
        "beyond_range": lambda best, problem, table: (),
        "pulls": lambda fit, problem: np.array(w["pulls"]),
        "cross_validate": lambda best, none, k: SimpleNamespace(**w["runs"]),
    }
    return problem, comparison, stand_ins


@pytest.mark.parametrize("w", WORLDS, ids=range(len(WORLDS)))
def test_facts_and_verdict_are_those_of_the_code_the_campaigns_were_scored_with(w, monkeypatch):
    problem, comparison, stand_ins = world(w)
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    expected = w["expected"]
    without_form = {
        "turns_beside": False,
        "leeway": False,
        "form": False,
        "of_motion": False,
        "moved": False,
        "covered": False,
        "others_covered": False,
        "over_motion": np.inf,
    }
    found = dict(vars(facts.grounds_of(problem, comparison).facts))
    re_tuned = found.pop("re_tuned")
    assert re_tuned == pytest.approx(w["p"]["none"] + w["p"].get("coefficient_error", 0.0))
    outside_acts = found.pop("outside_acts")
    assert outside_acts == w["inside"]["outside"]
    families = [{n for n, f in FAMILY.items() if f == family} for family in {*FAMILY.values()}]
    others = [sum(w["inside"].get(n, 0.0) for n in family) for family in families]
    assert found.pop("most_acts") == max(
        *others, *(w["inside"].get(n, 0.0) for n in ("none", "coefficient_error"))
    )
    assert found == pytest.approx(expected["facts"] | without_form)
    v = decide(problem, comparison)
    if expected["word"] == "coefficients" and re_tuned <= 1 - NAMING_PROBABILITY and not found["widens"]:
        # that code also said so of coefficients that hardly explain anything
        assert v.word == "ambiguous" and list(v.set95) == expected["set95"] and not v.confounded
        return
    assert v.word == expected["word"]
    for names in ("effects", "set95"):
        assert list(getattr(v, names)) == expected[names], names
    # that code also listed as confounded what it named
    assert list(v.confounded) == [n for n in expected["hidden"] if n not in expected["effects"]]
    assert list(v.reasons[:-1]) == expected["reasons"] and v.reasons[-1].startswith("decided by: ")


def test_there_are_worlds_of_every_word_but_the_rarest():
    assert {w["expected"]["word"] for w in WORLDS} == {
        "none", "effect", "effect_with_remainder", "outside", "coefficients", "ambiguous",
    }  # fmt: skip


def test_what_an_effect_explains_is_lost_against_the_best_refit_without_it():
    told = {("a", "b", "c"): 100.0, ("b",): 20.0, ("c",): 30.0, ("a", "b"): 90.0, ("b", "d"): 95.0}
    refits = tuple(candidate(names, e, 1.0, True) for names, e in told.items())
    comparison = SimpleNamespace(refits=refits, none=candidate((), 5.0, 1.0, True))
    assert facts._part(comparison, refits[0], "a") == 70.0  # over c alone; b with d is no part of it
    assert facts._part(comparison, refits[0], "c") == 10.0
    assert facts._part(comparison, refits[1], "b") == 15.0  # over no effect


def test_an_effect_these_runs_cannot_test_is_not_hidden(monkeypatch):
    """Without an entry among the detectable ones its absorbed share is nought."""
    problem, comparison, stand_ins = world({**WORLDS[0], "absorbed": [], "detect": []} | NAMED)
    comparison.ambiguity.names = ()
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    found = facts.grounds_of(problem, comparison).facts
    assert (found.effects, found.sure, found.absorbed) == (2, 1, 0.0)


NAMED = {
    "refits": [[["a", "b"], 50.0, 1.0, True], [["a"], 20.0, 1.0, True]],
    "inside": {"a": 0.99, "b": 0.5, "none": 0.0, "outside": 0.0},
    "idle": [],
    "after": 0.0,
}


def test_what_is_worth_a_mention_or_leaves_a_trace_is_not_undetectable():
    told = SimpleNamespace(names=("a", "b", "c", "d"), detect=(9.9, 9.9, 9.9, 10.0))
    comparison = SimpleNamespace(
        ambiguity=told, evidence={"a": 1.2, "b": 1.1, "d": -1.0}, probabilities={"none": 0.01}
    )
    assert facts.undetectable(comparison) == ("b", "c")
    comparison.probabilities["none"] = 0.0099
    assert facts.undetectable(comparison) == ()


def test_a_hidden_effect_is_listed_beside_the_best_within_twenty_nats_only(monkeypatch):
    evidence = {"a": 50.0, "b": 30.5, "c": 29.5}
    w = {**WORLDS[0], "absorbed": [0.99] * 4, "as_built": False, "evidence": evidence}
    problem, comparison, stand_ins = world(w | NAMED)
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    named = facts.grounds_of(problem, comparison).named
    assert named.confounded == ("a", "b", "c", "d") and named.along == ("a", "b")


@pytest.mark.parametrize(
    ("alone", "both", "excess", "of_form", "within", "together"),
    [
        (
            {"a": 20.0, "c": 10.0},
            30.0,
            1.0,
            1.0,
            ("a", "c"),
            True,
        ),  # all of it is less than the form may leave
        ({"a": 930.0, "c": 940.0}, 960.0, 1.0, 1.0, ("a", "c"), False),  # each can stand for the other
        ({"a": 20.0, "c": 940.0}, 960.0, 1.0, 1.0, ("a",), True),  # one is large, the other its rest
        ({"a": 20.0, "c": 10.0}, 30.0, 1.0, 20.0, (), True),  # the runs disagree about the form alone
        ({"a": 20.0, "c": 10.0}, 30.0, 20.0, 20.0, ("a", "c"), True),  # and about the causes as much
    ],
)
def test_causes_that_stand_for_each_other_are_more_than_a_form_leaves(
    alone, both, excess, of_form, within, together, monkeypatch
):
    """A form worth 100 nats: each of two may be less than half of it beside the other, and both much more."""
    monkeypatch.setattr(facts, "lost_without_form", lambda problem, best, axes, resonance: 100.0)
    monkeypatch.setattr(facts, "form_excess", lambda problem, best: of_form)
    monkeypatch.setattr(facts, "axes_of", lambda problem, name: frozenset("YN"))
    monkeypatch.setattr(facts, "excess_where_apart", lambda equations, k: excess)
    monkeypatch.setattr(facts, "remembers", lambda effect: False)
    refits = (
        candidate(("a", "c"), both, 1.0, True),
        *(candidate((n,), g, 1.0, True) for n, g in alone.items()),
    )
    comparison = SimpleNamespace(refits=refits, none=candidate((), 0.0, 1.0, True), off=())
    model = SimpleNamespace(effects=dict.fromkeys("abcd"))
    problem = SimpleNamespace(form=object(), model=model, coefficients=SimpleNamespace(names=()))
    assert facts._covered(problem, comparison, refits[0], Kinematics()) == (within, together)
    problem.form = None
    assert facts._covered(problem, comparison, refits[0], Kinematics()) == ((), True)


@pytest.mark.parametrize(("late", "within"), [(False, ()), (True, ("a",))])
def test_what_a_resonance_carries_is_not_held_against_a_cause_that_lasts(monkeypatch, late, within):
    """A cause of 60 nats; the form is worth 200 with its resonance and 80 without; it may leave half."""

    def worth(problem, best, axes, resonance):
        return 200.0 if resonance else 80.0

    for name, stand_in in {
        "lost_without_form": worth,
        "form_excess": lambda problem, best: 1.0,
        "axes_of": lambda problem, name: frozenset("YN"),
        "excess_where_apart": lambda equations, k: 1.0,
        "remembers": lambda effect: late,
    }.items():
        monkeypatch.setattr(facts, name, stand_in)
    best = candidate(("a",), 60.0, 1.0, True)
    comparison = SimpleNamespace(refits=(best,), none=candidate((), 0.0, 1.0, True), off=())
    model = SimpleNamespace(effects={"a": None})
    problem = SimpleNamespace(form=object(), model=model, coefficients=SimpleNamespace(names=()))
    assert facts._covered(problem, comparison, best, Kinematics())[0] == within


@pytest.mark.parametrize(
    ("turns", "form", "told", "best", "beside"),
    [
        (True, True, (), ("a",), True),
        (False, True, (), ("a",), False),
        (True, False, (), ("a",), False),  # equations that lack nothing would show what turns the vehicle
        (True, True, ("a",), ("a",), False),  # what kinematics tells holds whatever turns the vehicle
        (True, True, (), ("b",), False),  # no sensor
        (True, True, (), ("a", "b"), False),  # a sensor beside what may turn it
    ],
)
def test_a_sensor_alone_is_not_the_cause_where_the_vehicle_turns_by_itself(
    turns, form, told, best, beside, monkeypatch
):
    """a is of a sensor; b and c push the vehicle, and c gains less than chance allows."""
    refits = [[list(best), 100.0, 1.0, True], [["c"], 2.0, 1.0, True], [["b"], 30.0, 1.0, True]]
    shares = dict.fromkeys(WORLDS[0]["p"], 0.0) | {"a": 0.98, "outside": 0.02}
    problem, comparison, stand_ins = world(WORLDS[0] | NAMED | {"refits": refits, "p": shares})
    ports = {"a": "sensor", "b": "force", "c": "input", "d": "force"}
    for effect in EFFECTS:
        monkeypatch.setattr(effect, "port", ports[effect.name], raising=False)
    problem.turns, problem.form = turns, object() if form else None
    stand_ins["given_by_roll"] = lambda problem, effect, table: False
    stand_ins["given_by_leeway"] = lambda *_: False
    stand_ins["by_kinematics"] = lambda problem, best: Kinematics(parts=dict.fromkeys(told, 50.0))
    stand_ins["_covered"] = lambda problem, comparison, best, sensors: ((), True)
    stand_ins["like_a_form"] = lambda comparison, best, model: ()
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    found = facts.grounds_of(problem, comparison)
    assert found.facts.turns_beside is beside
    if beside:
        assert found.named.set95 == ("a", "b")


@pytest.mark.parametrize(
    ("best", "idle", "rolls", "small", "word"),
    [
        ("ab", (), (), True, "ambiguous"),  # the control: b has a size, and is more than the form leaves
        ("ab", ("b",), (), True, "model_form"),
        ("ab", (), ("b",), True, "model_form"),  # the planar model leaves out the list that gives it
        ("ab", ("b",), (), False, "ambiguous"),  # together they are more than the form leaves
        ("b", (), ("b",), True, "effect"),  # alone it explains everything
    ],
)
def test_causes_that_have_no_size_or_are_a_list_do_not_keep_the_rest_from_the_form(
    best, idle, rolls, small, word, monkeypatch
):
    """Of a and b together, neither sure, a is no larger than what the form leaves."""
    inside = {"a": 0.6, "b": 0.5 if len(best) > 1 else 0.99, "none": 0.0, "outside": 0.0}
    shares = dict.fromkeys(WORLDS[0]["p"], 0.0) | {"b": 0.99, "outside": 0.01}
    refits = [[list(best), 50.0, 1.0, True], [["a"], 20.0, 1.0, True]]
    more = {"idle": idle, "inside": inside, "p": shares, "refits": refits, "absorbed": [0.0] * 4}
    problem, comparison, stand_ins = world(WORLDS[0] | NAMED | more)
    problem.turns, problem.form = False, object()
    stand_ins["by_kinematics"] = lambda problem, best: Kinematics()
    stand_ins["given_by_roll"] = lambda problem, effect, table: effect.name in rolls
    stand_ins["given_by_leeway"] = lambda *_: False
    stand_ins["_covered"] = lambda problem, comparison, best, sensors: (
        ("a",) if len(best.effects) > 1 else (),
        True,
    )
    stand_ins["_small"] = lambda problem, comparison, best, names, share: small
    stand_ins["like_a_form"] = lambda comparison, best, model: ()
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    assert decide(problem, comparison).word in (word, f"{word}_with_remainder")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, "probability"),  # b acts with 0.5
        ({"p": 0.99}, None),
        ({"p": 0.99, "idle": ("b",)}, "size"),
        ({"p": 0.99, "idle": ("b",), "range": ("b",)}, "range"),
        ({"p": 0.99, "range": ("b",)}, None),  # idle asks for the range
        ({"p": 0.99, "leeway": "b"}, "leeway"),
        ({"p": 0.99, "covered": ("b",)}, "form"),
        ({"p": 0.99, "after": 25.0}, None),  # a remainder of 25 nats beside the 300 that b explains
        ({"p": 0.99, "after": 35.0}, "remainder"),
        ({"idle": ("b",), "after": 35.0}, "size"),  # the first that holds
    ],
)
def test_an_effect_that_is_not_named_has_the_reason_that_decided(change, reason, monkeypatch):
    """a explains 1000 nats and is sure; b adds 300."""
    refits = [[["a", "b"], 1300.0, 1.0, True], [["a"], 1000.0, 1.0, True], [["b"], 300.0, 1.0, True]]
    inside = {"a": 0.99, "b": change.get("p", 0.5), "none": 0.0, "outside": 0.0}
    w = WORLDS[0] | NAMED | {"refits": refits, "inside": inside, "after": change.get("after", 0.0)}
    problem, comparison, stand_ins = world(w)
    stand_ins["idle"] = lambda best, problem, table, told: change.get("idle", ())
    stand_ins["beyond_range"] = lambda best, problem, table: change.get("range", ())
    stand_ins["given_by_leeway"] = lambda problem, effect, *_: effect.name == change.get("leeway")
    stand_ins["_covered"] = lambda problem, comparison, best, sensors: (change.get("covered", ()), True)
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    named = facts.grounds_of(problem, comparison).named
    assert named.unnamed == ({} if reason is None else {"b": reason})
    assert named.sure == (("a", "b") if reason is None else ("a",))
    assert decide(problem, comparison).unnamed == named.unnamed


@pytest.mark.parametrize(
    ("scale", "dof", "list_gives_it"),
    [(-0.005, 3, True), (0.005, 3, False), (-0.02, 3, False), (-0.005, 6, False)],
)
def test_a_list_of_up_to_eight_degrees_reads_as_a_slow_gyro_in_a_planar_model(scale, dof, list_gives_it):
    gyro = next(e for e in CATALOGUE if e.name == "gyro_scale")
    problem = SimpleNamespace(model=SimpleNamespace(dof=dof))
    assert given_by_roll(problem, gyro, {gyro.key("scale"): (scale, 1e-4)}) is list_gives_it
    assert np.cos(np.radians(8.0)) - 1.0 == pytest.approx(gyro.parameters[0].roll_from, abs=1e-4)


@pytest.mark.parametrize(
    ("bias", "channels", "form", "leeway_gives_it"),
    [
        (0.02, "x y psi", True, True),
        (-0.02, "x y psi r", True, True),
        (0.04, "x y psi", True, False),  # more than a side force pushes it aside
        (0.0, "x y psi", True, False),
        (0.02, "x y psi u v", True, False),  # v tells them apart
        (0.02, "x y psi", False, False),  # the force is weighed as well there
    ],
)
def test_a_small_bias_of_the_heading_reads_like_leeway(bias, channels, form, leeway_gives_it):
    compass = next(e for e in CATALOGUE if e.name == "heading_bias")
    problem = SimpleNamespace(form=object() if form else None, channels=tuple(channels.split()))
    assert given_by_leeway(problem, compass, {compass.key("bias"): (bias, 1e-4)}) is leeway_gives_it


@pytest.mark.parametrize("form", [True, False])
@pytest.mark.parametrize(
    ("beside", "bias", "leeway_gives_it"),
    [
        ("velocity_misalignment", 0.004, True),  # a log that is turned leaves the zero of v unknown
        ("velocity_misalignment", 0.04, False),
        ("velocity_scale", 0.004, False),  # one that reads too much does not
        ("gyro_scale", 0.004, False),
    ],
)
def test_a_velocity_log_that_is_turned_does_not_tell_a_bias_of_the_heading_from_leeway(
    form, beside, bias, leeway_gives_it
):
    """Track, heading and a turned log give the difference of the two angles; a bulk carrier of other
    equations, whose log was turned by 2.4 degrees, was told a compass 0.2 degrees off as well."""
    effects = {e.name: e for e in CATALOGUE}
    compass = effects["heading_bias"]
    problem = SimpleNamespace(form=object() if form else None, channels=("x", "y", "psi", "u", "v"))
    told = {compass.key("bias"): (bias, 1e-4)}
    assert given_by_leeway(problem, compass, told, [effects[beside]]) is leeway_gives_it


@pytest.mark.parametrize(
    ("best", "leeway", "word"),
    [
        ("ab", (), "effect_with_remainder"),  # the control: a is sure, b is not
        ("ab", ("a",), "ambiguous"),
        ("a", (), "effect"),
        ("a", ("a",), "ambiguous"),
    ],
)
def test_what_leeway_may_give_is_possible_and_not_named(best, leeway, word, monkeypatch):
    inside = {"a": 0.98, "b": 0.7 if len(best) > 1 else 0.0, "none": 0.0, "outside": 0.02}
    shares = dict.fromkeys(WORLDS[0]["p"], 0.0) | {"a": 0.98, "outside": 0.02}
    refits = [[list(best), 90.0, 1.0, True], [["b"], 20.0, 1.0, True]]
    more = {"idle": (), "inside": inside, "p": shares, "refits": refits, "absorbed": [0.0] * 4}
    problem, comparison, stand_ins = world(WORLDS[0] | NAMED | more)
    problem.turns, problem.form = False, object()
    stand_ins["by_kinematics"] = lambda problem, best: Kinematics()
    stand_ins["given_by_roll"] = lambda problem, effect, table: False
    stand_ins["given_by_leeway"] = lambda problem, effect, *_: effect.name in leeway
    stand_ins["_covered"] = lambda problem, comparison, best, sensors: ((), False)
    stand_ins["_small"] = lambda problem, comparison, best, names, share: False
    stand_ins["like_a_form"] = lambda comparison, best, model: ()
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    found = decide(problem, comparison)
    assert found.word == word and "a" in found.set95
