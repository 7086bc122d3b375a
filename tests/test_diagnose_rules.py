"""Every rule of the verdict on both sides of its threshold; no rule without a case."""

import math
from dataclasses import replace

import pytest

from bayesid.diagnosis.hypotheses.facts import Facts, Named
from bayesid.diagnosis.hypotheses.rules import NAMING, RULES, WORDS, deciding
from bayesid.diagnosis.hypotheses.verdict import names_of
from bayesid.diagnosis.threshold_table import (
    CAUSE_OVER_MOTION,
    CONFOUNDED_SHARE,
    EVEN_ODDS,
    NAMING_PROBABILITY,
    PRIOR_CONFLICT,
    TABLE,
    Limit,
)

# One effect that explains a gap; chance allows 4 nats, 19 of a free signal, 3.5 sd of a coefficient.
PLAIN = Facts(
    gain=50.0, gain_by_chance=4.0, free=30.0, free_by_chance=19.0, left=2.0, conflict=0.5,
    conflict_by_chance=3.5, none=0.0, outside=0.04, outside_acts=0.04, most_acts=0.96, undetectable=0.0,
    none_in_set=False, effects=1,
    widens=False, explains=True, acts=0.96, absorbed=0.2, re_tuned=0.5, idle=False,
    turns_beside=False, leeway=False, sure=0,
    form=False, of_motion=False, moved=False, covered=False, others_covered=False, over_motion=math.inf,
    runs_refute=False,
    runs_disagree=False,
)  # fmt: skip
FAINT = replace(PLAIN, gain=3.9, none_in_set=True, acts=0.3)
WIDE = replace(PLAIN, widens=True)
PAIR = replace(PLAIN, effects=2, sure=2)
FORM = replace(PLAIN, form=True)
BESIDE = replace(
    PLAIN, outside_acts=NAMING_PROBABILITY, most_acts=0.7, acts=0.7, left=30.0, over_motion=CAUSE_OVER_MOTION
)
TINY = 1e-9

# rule, facts it decides, and per fact: a value on the other side of the threshold and the rule that then does
CASES = [
    ("unlisted cause", replace(PLAIN, outside=EVEN_ODDS + TINY, free=19 + TINY), {
        "outside": (EVEN_ODDS + 0.0, "effect"), "free": (19.0, "effect")}),
    ("unlisted cause", replace(FAINT, outside=EVEN_ODDS + TINY), {
        "outside": (EVEN_ODDS + 0.0, "faint"), "free": (19.0, "nothing beyond chance")}),
    ("unlisted cause", replace(PLAIN, outside=EVEN_ODDS + TINY, over_motion=CAUSE_OVER_MOTION + 0.0), {
        "over_motion": (CAUSE_OVER_MOTION - TINY, "unlisted cause or a force of the motion")}),
    ("unlisted cause beside others", BESIDE, {
        "outside_acts": (NAMING_PROBABILITY - TINY, "unsure effect"),
        "most_acts": (NAMING_PROBABILITY + 0.0, "unsure effect"), "free": (19.0, "unsure effect"),
        "left": (19.0, "unsure effect"), "over_motion": (CAUSE_OVER_MOTION - TINY, "unsure effect"),
        "outside": (EVEN_ODDS + TINY, "unlisted cause"), "gain": (3.9, "faint")}),
    ("unlisted cause beside others", replace(BESIDE, left=2.0, explains=False), {
        "explains": (True, "unsure effect"), "over_motion": (math.inf, "unsure effect")}),
    ("unlisted cause beside others", replace(BESIDE, effects=2, sure=0, runs_refute=True), {
        "outside_acts": (0.5, "refuted by the runs"), "of_motion": (True, "shapes of a model form")}),
    ("unlisted cause beside others", replace(BESIDE, widens=True), {
        "outside_acts": (0.5, "unsure coefficient")}),
    ("unlisted cause beside others", replace(BESIDE, form=True), {
        "covered": (True, "unlisted cause in place of a model form")}),
    ("unlisted cause in place of a model form", replace(BESIDE, form=True, covered=True, most_acts=0.95), {
        "outside_acts": (NAMING_PROBABILITY - TINY, "model form"), "left": (19.0, "model form"),
        "free": (19.0, "model form"), "over_motion": (CAUSE_OVER_MOTION - TINY, "model form"),
        "form": (False, "unsure effect"), "outside": (EVEN_ODDS + TINY, "unlisted cause")}),
    ("unlisted cause in place of a model form", replace(BESIDE, form=True, gain=3.9, moved=True), {
        "over_motion": (math.inf, "coefficient beside a model form")}),
    ("force of the motion", replace(PLAIN, outside=EVEN_ODDS + TINY, over_motion=-200.0), {
        "outside": (EVEN_ODDS + 0.0, "effect"), "free": (19.0, "effect"),
        "over_motion": (9.0, "unlisted cause")}),
    ("force of the motion", replace(PLAIN, outside=EVEN_ODDS + TINY, over_motion=-CAUSE_OVER_MOTION), {
        "over_motion": (-CAUSE_OVER_MOTION + TINY, "unlisted cause or a force of the motion")}),
    ("unlisted cause or a force of the motion", replace(PLAIN, outside=EVEN_ODDS + TINY, over_motion=0.0), {
        "outside": (EVEN_ODDS + 0.0, "effect"), "free": (19.0, "effect")}),
    ("coefficients moved", replace(FAINT, conflict=3.5 + TINY, none=EVEN_ODDS - TINY), {
        "conflict": (3.5, "faint"), "none": (EVEN_ODDS + 0.0, "faint"), "none_in_set": (False, "faint"),
        "gain": (4.0, "none not excluded")}),
    ("coefficients moved", replace(FAINT, conflict=PRIOR_CONFLICT + TINY, conflict_by_chance=2.0), {
        "conflict": (PRIOR_CONFLICT + 0.0, "faint")}),
    ("nothing beyond chance", replace(FAINT, none=0.4, undetectable=0.1 + TINY), {
        "undetectable": (0.1, "faint"), "none": (0.3, "faint"), "gain": (4.0, "none not excluded")}),
    ("nothing beyond chance", replace(FAINT, none=0.1, outside=0.45, free=19.0), {
        "free": (19 + TINY, "faint"), "outside": (0.4, "faint")}),
    ("nothing beyond chance", replace(FAINT, none=0.6, none_in_set=True, conflict=9.0), {
        "none": (0.45, "coefficients moved")}),
    ("faint", replace(FAINT, none=0.3), {"gain": (4.0, "none not excluded")}),
    ("faint coefficient, probably none", replace(WIDE, none_in_set=True, none=EVEN_ODDS + TINY), {
        "none": (EVEN_ODDS + 0.0, "faint coefficient"), "none_in_set": (False, "wrong coefficient"),
        "widens": (False, "probably none")}),
    ("faint coefficient", replace(WIDE, none_in_set=True, none=0.3), {
        "none_in_set": (False, "wrong coefficient"), "widens": (False, "none not excluded")}),
    ("unsure coefficient", replace(WIDE, acts=NAMING_PROBABILITY - TINY), {
        "acts": (NAMING_PROBABILITY + 0.0, "wrong coefficient"), "widens": (False, "unsure effect")}),
    ("wrong coefficient", replace(WIDE, acts=NAMING_PROBABILITY + 0.0, runs_refute=True, absorbed=1.0,
    idle=True), {
        "acts": (NAMING_PROBABILITY - TINY, "unsure coefficient"), "widens": (False, "refuted by the runs")}),
    ("refuted by the runs", replace(PLAIN, runs_refute=True), {
        "runs_refute": (False, "effect"), "explains": (False, "effect with a remainder")}),
    ("refuted by the runs", replace(PAIR, runs_refute=True), {"runs_refute": (False, "several sure")}),
    ("several sure", replace(PAIR, absorbed=1.0, none_in_set=True), {
        "sure": (1, "several, one sure"), "effects": (1, "none not excluded")}),
    ("coefficient beside a model form", replace(FORM, moved=True, covered=True), {
        "moved": (False, "model form"), "covered": (False, "effect"), "form": (False, "effect")}),
    ("coefficient beside a model form", replace(FORM, moved=True, widens=True), {
        "moved": (False, "model form"), "form": (False, "wrong coefficient")}),
    ("model form", replace(FORM, covered=True, acts=NAMING_PROBABILITY - TINY), {
        "covered": (False, "unsure effect")}),
    ("model form", replace(FORM, covered=True, acts=1.0, runs_refute=True), {
        "covered": (False, "refuted by the runs"), "form": (False, "refuted by the runs")}),
    ("shapes of a model form", replace(PAIR, sure=0, of_motion=True), {
        "of_motion": (False, "several, none sure"), "outside": (EVEN_ODDS + TINY, "unlisted cause")}),
    ("model form", replace(FORM, gain=3.9), {"gain": (4.0, "effect"), "form": (False, "faint")}),
    ("model form", replace(FORM, widens=True), {
        "widens": (False, "effect"), "form": (False, "wrong coefficient")}),
    ("model form", replace(FORM, none_in_set=True, none=EVEN_ODDS + TINY), {
        "none": (EVEN_ODDS + 0.0, "none not excluded"), "form": (False, "probably none")}),
    ("model form", replace(FORM, covered=True, outside=EVEN_ODDS + 0.0, acts=0.3), {
        "outside": (EVEN_ODDS + TINY, "unlisted cause")}),
    ("one sure beside a model form", replace(PAIR, form=True, sure=1, others_covered=True), {
        "others_covered": (False, "several, one sure"), "left": (19 + TINY, "several, one sure"),
        "runs_disagree": (True, "several, one sure"), "explains": (False, "several, one sure"),
        "effects": (1, "effect")}),
    ("several, none sure", replace(PAIR, sure=0), {
        "sure": (1, "several, one sure"), "effects": (1, "effect")}),
    ("several, one sure", replace(PAIR, sure=1, none_in_set=True), {
        "sure": (0, "several, none sure"), "effects": (1, "none not excluded")}),
    ("confounded with coefficients", replace(
        PLAIN, absorbed=CONFOUNDED_SHARE + TINY, none_in_set=True, none=0.9, acts=NAMING_PROBABILITY - TINY,
    ), {
        "absorbed": (CONFOUNDED_SHARE + 0.0, "probably none"),
        "re_tuned": (1 - NAMING_PROBABILITY, "probably none"),
        "acts": (NAMING_PROBABILITY + 0.0, "probably none")}),
    ("probably none", replace(PLAIN, none_in_set=True, none=EVEN_ODDS + TINY), {
        "none": (EVEN_ODDS + 0.0, "none not excluded"), "none_in_set": (False, "effect")}),
    ("none not excluded", replace(PLAIN, none_in_set=True, none=0.06), {"none_in_set": (False, "effect")}),
    ("unsure effect", replace(PLAIN, acts=NAMING_PROBABILITY - TINY), {"acts": (NAMING_PROBABILITY + 0.0,
    "effect")}),
    ("no size beside a model form", replace(FORM, idle=True), {
        "idle": (False, "effect"), "form": (False, "effect without size"),
        "acts": (NAMING_PROBABILITY - TINY, "unsure effect")}),
    ("effect without size", replace(PLAIN, idle=True), {"idle": (False, "effect")}),
    ("turns by itself", replace(PLAIN, turns_beside=True, left=25.0), {
        "turns_beside": (False, "effect with a remainder"), "idle": (True, "effect without size"),
        "acts": (NAMING_PROBABILITY - TINY, "unsure effect")}),
    ("leeway reads the same", replace(PLAIN, leeway=True, left=25.0), {
        "leeway": (False, "effect with a remainder"),
        "acts": (NAMING_PROBABILITY - TINY, "unsure effect")}),
    ("effect with a remainder", replace(PLAIN, left=19 + TINY), {"left": (19.0, "effect")}),
    ("effect with a remainder", replace(PLAIN, runs_disagree=True), {"runs_disagree": (False, "effect")}),
    ("effect with a remainder", replace(PLAIN, explains=False), {"explains": (True, "effect")}),
    ("effect", PLAIN, {"left": (25.0, "effect with a remainder"), "gain": (3.9, "faint"),
        "free": (19.0, "effect")}),
]  # fmt: skip


@pytest.mark.parametrize("name, facts, other", CASES, ids=[f"{c[0]} {i}" for i, c in enumerate(CASES)])
def test_a_rule_decides_on_its_side_of_every_threshold_only(name, facts, other):
    assert deciding(facts).name == name
    for field, (value, instead) in other.items():
        assert deciding(replace(facts, **{field: value})).name == instead, field


def test_every_rule_has_a_case_and_a_name_of_its_own():
    names = [rule.name for rule in RULES]
    assert len(set(names)) == len(names)
    assert {case[0] for case in CASES} == set(names)
    assert {rule.word for rule in RULES} == set(WORDS)


NAMES = Named(
    best=("a", "b"), sure=("b",), confounded=("c", "d"), along=("d",),
    set95=("outside", "a", "none", "b"), undetectable=(),
)  # fmt: skip
SAID = {
    "unlisted cause": ("outside", (), ()),
    "unlisted cause beside others": ("outside", (), ()),
    "unlisted cause in place of a model form": ("outside", (), ()),
    "force of the motion": ("model_form", (), ()),
    "unlisted cause or a force of the motion": ("ambiguous", ("a", "b"), ()),
    "coefficient beside a model form": ("coefficients", (), ()),
    "model form": ("model_form", (), ()),
    "shapes of a model form": ("model_form", (), ()),
    "one sure beside a model form": ("effect", ("b",), ()),
    "coefficients moved": ("coefficients", (), ("c", "d")),
    "nothing beyond chance": ("none", (), ()),
    "faint": ("ambiguous", ("a", "b"), ()),
    "faint coefficient, probably none": ("none", (), ()),
    "faint coefficient": ("ambiguous", (), ()),
    "unsure coefficient": ("ambiguous", ("a", "b"), ("c", "d")),
    "wrong coefficient": ("coefficients", ("coefficient_error",), ("c", "d")),
    "refuted by the runs": ("ambiguous", ("a", "b"), ()),
    "several sure": ("several", ("b",), ("c", "d")),
    "several, none sure": ("ambiguous", ("a", "b"), ("c", "d")),
    "several, one sure": ("effect_with_remainder", ("b",), ("c", "d")),
    "confounded with coefficients": ("coefficients", (), ("d",)),
    "probably none": ("none", (), ()),
    "none not excluded": ("ambiguous", ("a", "b"), ()),
    "unsure effect": ("ambiguous", ("a", "b"), ()),
    "no size beside a model form": ("model_form", (), ()),
    "effect without size": ("ambiguous", ("a", "b"), ()),
    "turns by itself": ("ambiguous", ("a", "b"), ()),
    "leeway reads the same": ("ambiguous", ("a", "b"), ()),
    "effect with a remainder": ("effect_with_remainder", ("a",), ()),
    "effect": ("effect", ("a",), ()),
}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_says_its_word_and_names_those_of_its_outcome(rule):
    """Agreed with the format: a naming word names, none and outside name nothing, "none" is in its set."""
    effects, confounded, set95 = names_of(rule, NAMES)
    assert (rule.word, effects, confounded) == SAID[rule.name]
    assert bool(effects) or rule.word not in NAMING
    none = "model_form" if rule.silent == "model_form" else "none"
    assert set95 == tuple(none if n == "none" else n for n in NAMES.set95)
    without = names_of(rule, replace(NAMES, set95=("outside",)))[2]
    assert rule.silent or rule.word not in ("none", "model_form")
    silent = bool(rule.silent)
    assert without == ((none, "outside") if silent else ("outside",))
    assert not set(names_of(rule, replace(NAMES, confounded=("a", "b", "c"), along=("a", "c")))[1]) & set(
        effects
    )
    beside = names_of(rule, replace(NAMES, form=True))[2]
    assert beside == ("outside", "a", "model_form", "b")  # nothing but the form
    # an effect and the coefficient it stands for are one force in two words
    stand = names_of(rule, replace(NAMES, stand=("e",)))[2]
    both = () if rule.word in ("none", "outside") else ("coefficient_error", "e")
    assert stand == (*set95, *(n for n in both if n not in effects))


def test_the_table_says_of_every_number_what_it_is_and_what_fixed_it():
    symbols = [limit.symbol for limit in TABLE]
    assert len(set(symbols)) == len(symbols) and len(TABLE) >= 25
    for limit in TABLE:
        assert isinstance(limit, Limit) and limit > 0
        assert limit.unit and limit.meaning.endswith(".") and limit.evidence.endswith("."), limit.symbol


def test_the_numbers_of_the_table_are_those_the_practice_campaigns_were_scored_with():
    """A number is changed together with its evidence, and on purpose."""
    assert {limit.symbol: float(limit) for limit in TABLE} == {
        "EVEN_ODDS": 0.5,
        "NAMING_PROBABILITY": 0.9,
        "SURE_PROBABILITY": 0.97,
        "CONFOUNDED_SHARE": 0.98,
        "UNDETECTABLE_NONCENTRALITY": 10.0,
        "GAP_IS_SURE_BELOW": 0.01,
        "MINOR_SHARE": 0.1,
        "PRIOR_CONFLICT": 3.0,
        "ONE_COEFFICIENT": 0.999,
        "LISTED_BESIDE_EVIDENCE": 20.0,
        "DISAGREEMENT_P_VALUE": 1e-3,
        "FOLLOWS_DATA_CHI2": 1.5,
        "NOT_FOLLOWING_CHI2": 25.0,
        "ARRIVED_SHARE": 0.8,
        "FORM_EVIDENCE": 20.0,
        "FORM_LEAVES": 0.5,
        "FORM_LEAVES_BESIDE": 1.0,
        "SIZE_DEVIATIONS": 1.5,
        "ADD_EVIDENCE": 5.0,
        "DROP_EVIDENCE": 3.0,
        "LEAST_RUNS": 3.0,
        "MOST_EFFECTS": 3,
        "LEAST_FREE_SIGNAL_SHARE": 0.5,
        "MOST_EXCHANGES": 3,
        "RIVALS_TRIED": 2,
        "LINEARISATION_SCATTER": 20.0,
        "WALD_SLACK": 3.0,
        "LEAST_NAMING_EVIDENCE": 3.0,
        "INTERVAL_TOLD": 0.95,
        "FALSE_ALARM": 0.01,
        "NOISE_MODEL_SLACK": 10.0,
        "PRIOR_NONE": 0.5,
        "PRIOR_CATALOGUE": 0.4,
        "PRIOR_OUTSIDE": 0.1,
        "USUAL_SIZE_PROBABILITY": 0.5,
        "SHOWN_NONCENTRALITY": 100.0,
        "BARE_MENTION": 1.15,
        "UNLISTED_ALIKE_SHARE": 0.5,
        "OTHER_FORM_PROBABILITY": 0.25,
        "REMAINDER_EVIDENCE": 3.0,
        "LEAST_REMAINDER_SHARE": 1e-3,
        "FREE_SIGNAL_SLACK": 10.0,
        "BRIEF_EVENT_EVIDENCE": 30.0,
        "CAUSE_OVER_MOTION": 5.0,
        "STUCK_TRIED": 20.0,
        "STUCK_EVIDENCE": 30.0,
        "WIND_READ_SCATTER": 10.0,
        "DEPENDENCE_EVIDENCE": 30.0,
        "DEPENDENCE_OVER_RIVALS": 5.0,
    }


def test_every_verdict_word_has_an_answer_of_its_own():
    from diagnosis_results import a_result

    from bayesid.diagnosis.answer import answer

    said = {word: answer(a_result(word)).headline for word in WORDS}
    assert all(said.values()) and len(set(said.values())) == len(WORDS)
