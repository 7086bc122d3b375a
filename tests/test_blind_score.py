"""Judging and scoring: intervals in closed form, verdicts of known worth, physical truths of D."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from bayesid.benchmark.plant import draw_campaign
from bayesid.benchmark.plant.body import cruising_speed
from bayesid.benchmark.plant.unlisted_causes import OUTSIDE
from bayesid.benchmark.protocol.answers import Answer, Cause, load_answers
from bayesid.benchmark.protocol.beside import method_row
from bayesid.benchmark.protocol.cause_families import FAMILIES, by_family, families_of, places_of
from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.benchmark.protocol.count_intervals import bootstrap, clopper
from bayesid.benchmark.protocol.detectability import Detectability, detectability, true_problem
from bayesid.benchmark.protocol.judgement import judge
from bayesid.benchmark.protocol.report import standings
from bayesid.benchmark.protocol.scores import at_least, calibration, score_quantities, share, shuffled
from bayesid.diagnosis.hypotheses.sensitivity_bank import EffectColumns, SensitivityBank, build_bank
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.model.effects import CATALOGUE
from bayesid.model.vehicles import load_vehicle
from studies.withheld_effects.baselines import choices

PLAIN = Detectability("", 400.0, 0.1, 50.0, "wind")


def truth(kind="effect", *names, shown=PLAIN, **more):
    causes = tuple(Cause(n, parameters=more.get(n, {}), shown=replace(shown, name=n)) for n in names)
    return Answer("pond", kind, causes, {"dof": "3", "sea": "calm"}, {}, "", {})


def said(word, *names, **more):
    """A verdict: named effects, or a probability for one name that may not be named."""
    top = more.pop("top", names[0] if names else word if word in ("none", "outside") else "wind")
    p = more.pop("p", 0.9)
    rest = {n: (1 - p) / 2 for n in ("none", "outside") if n != top}
    told = {"verdict": word, "effects": [{"name": n, "parameters": {}} for n in names], "set95": [top],
            "probabilities": {top: p} | rest, "where": {"channel": None, "evidence": {}},
            "gap": {"before": 5.0, "after": 0.0, "shrink": 1.0}}  # fmt: skip
    return told | more


@pytest.mark.parametrize("hits, count, low, high", [
    (0, 20, 0.0, 0.16843), (20, 20, 0.83157, 1.0), (5, 10, 0.18709, 0.81291), (0, 0, 0.0, 1.0),
])  # fmt: skip
def test_intervals_of_shares_are_those_of_clopper_and_pearson(hits, count, low, high):
    # 0 of n: 1 - 0.025^(1/n) by hand; 5 of 10 from their table
    assert clopper(hits, count) == pytest.approx((low, high), abs=1e-5)


def test_the_interval_of_a_mean_narrows_with_the_root_of_the_number():
    rng = np.random.default_rng(0)
    wide, narrow = (np.diff(bootstrap(rng.standard_normal(n), np.mean))[0] for n in (100, 1600))
    assert wide / narrow == pytest.approx(4.0, rel=0.3)
    assert wide == pytest.approx(2 * 1.96 / 10, rel=0.25)


@pytest.mark.parametrize("answer, verdict, outcome", [
    (truth("none"), said("none"), "right"),
    (truth("none"), said("outside"), "false alarm"),
    (truth("none"), said("effect", "wind"), "wrong name"),
    (truth("effect", "wind"), said("effect", "wind"), "right"),
    (truth("effect", "wind"), said("effect", "steady_force"), "right"),  # one family
    (truth("effect", "wind"), said("effect", "gyro_bias"), "wrong name"),
    (truth("effect", "wind"), said("several", "wind", "gyro_bias"), "wrong name"),
    (truth("effect", "wind"), said("none"), "no gap"),
    (truth("effect", "wind"), said("ambiguous"), "set"),
    (truth("effect", "coefficient_error"), said("coefficients"), "right"),
    (truth("effect", "wind"), said("coefficients", top="none"), "missed"),
    (truth("effect", "wind", shown=replace(PLAIN, absorbed=0.99)), said("coefficients"), "right"),
    (truth("outside", "vortex_shedding"), said("outside"), "right"),
    (truth("outside", "vortex_shedding"), said("effect_with_remainder", "wind"), "right"),
    (truth("outside", "vortex_shedding"), said("effect", "wind"), "wrong name"),
    (truth("two", "wind", "gyro_bias"), said("several", "wind", "gyro_bias"), "right"),
    (truth("two", "wind", "gyro_bias"), said("effect", "wind"), "in part"),
    (truth("two", "wind", "gyro_bias"), said("several", "wind", "rudder_offset"), "in part"),
    (truth("two", "wind", "gyro_bias"), said("effect", "rudder_offset"), "wrong name"),
    (truth("effect", "wind"), None, "failed"),
])  # fmt: skip
def test_each_outcome_has_its_word(answer, verdict, outcome):
    case = judge(answer, verdict)
    assert case.outcome == outcome
    assert (case.reason == "") == (outcome == "right")


def test_below_detectability_no_gap_is_covered_and_above_it_is_not():
    faint = truth("effect", "wind", shown=replace(PLAIN, noncentrality=10.0))
    assert judge(faint, said("none")).covered and judge(faint, said("effect", "wind")).covered
    assert not judge(faint, said("effect", "gyro_bias")).covered
    assert not judge(truth("effect", "wind"), said("none")).covered


def test_scores_are_those_of_the_stated_probabilities():
    case = judge(truth("effect", "wind"), said("effect", "wind", p=0.8))
    assert case.log == pytest.approx(-math.log(0.8))
    assert case.brier == pytest.approx(0.2**2 + 2 * 0.1**2)
    split = said("effect", "wind") | {"probabilities": {"wind": 0.3, "steady_force": 0.4, "none": 0.3}}
    assert judge(truth("effect", "wind"), split).p_right == pytest.approx(0.7)


def test_what_is_calibrated_is_that_the_first_answer_acts_alone_or_with_others():
    shares = said("several", "wind", "gyro_bias")
    shares["probabilities"] = {"wind": 0.3, "steady_force": 0.2, "gyro_bias": 0.48, "none": 0.02}
    assert judge(truth("two", "wind", "gyro_bias"), shares).stated == pytest.approx(0.5)  # by family
    acting = shares | {"acting": {"wind": 0.58, "steady_force": 0.4, "gyro_bias": 0.97, "none": 0.02}}
    case = judge(truth("two", "wind", "gyro_bias"), acting)
    assert case.top == "earth_force" and case.stated == pytest.approx(0.98)


def test_a_pair_with_a_hidden_cause_is_counted_apart():
    hidden = replace(PLAIN, absorbed=0.99)
    plain, other = (
        judge(truth("two", "wind", "gyro_bias", shown=s), said("outside")) for s in (PLAIN, hidden)
    )
    assert plain.deepest == PLAIN.absorbed and other.deepest == 0.99
    every, apart = (q for q in score_quantities([plain, other]) if q.name == "two effects both found")
    assert (every.count, apart.count) == (2, 1)


def test_rates_of_competitions_count_what_was_said_of_causes_and_of_none():
    faint = replace(PLAIN, noncentrality=10.0)
    told = [
        (truth("effect", "wind"), said("effect", "wind", p=0.8)),
        (truth("effect", "wind", shown=faint), said("none")),
        (truth("two", "wind", "gyro_bias"), said("outside")),
        (truth("outside", "vortex_shedding"), None),  # a diagnosis that failed detects nothing
        (truth("none"), said("ambiguous")),
        (truth("none"), said("none")),
    ]
    cases = [judge(a, v) for a, v in told]
    found = {(q.name, q.about): q for q in score_quantities(cases)}
    every, plain = (q for (name, _), q in found.items() if name == "detection rate")
    assert (every.hits, every.count) == (2, 4) and plain.hits == 2 and plain.count == 3
    (alarm,) = (q for (name, _), q in found.items() if name == "false-alarm rate")
    assert (alarm.hits, alarm.count) == (1, 2)
    mean, _ = (q for (name, _), q in found.items() if name == "mean probability of the true cause")
    one = [c.p_right for c in cases if c.kind in ("effect", "outside")]
    assert mean.count == 3 and mean.value == pytest.approx(sum(one) / 3) and one[0] == pytest.approx(0.8)


def test_a_model_form_is_an_alarm_where_nothing_is_planted_but_tells_no_cause():
    words = ("model_form", "coefficients", "outside", "ambiguous", "none")
    row = method_row("diagnosis", [judge(truth("none"), said(w)) for w in words])
    assert (row["false-alarm rate"], row["cause told of none"]) == ((4, 5), (2, 5))


def test_parameters_are_scored_in_stated_deviations_and_directions_wrap():
    answer = truth("effect", "wind", wind={"V_wind": 4.0, "from": 0.1})
    verdict = said("effect", "wind")
    verdict["effects"][0]["parameters"] = {"V_wind": {"value": 5.0, "sd": 0.5},
                                           "from": {"value": 2 * math.pi - 0.1, "sd": 0.2}}  # fmt: skip
    errors = {name: (error, z) for _, name, error, z in judge(answer, verdict).parameters}
    assert errors["V_wind"] == pytest.approx((0.25, 2.0))
    assert errors["from"][1] == pytest.approx(-1.0)


def test_place_counts_only_where_the_evidence_is_plain():
    told = {"channel": "psi", "evidence": {"psi": 60.0, "N": 3.0}}
    assert judge(truth("effect", "wind"), said("effect", "wind", where=told)).located is False
    assert judge(truth("effect", "heading_bias"), said("none", where=told)).located is True
    told = {"channel": "psi", "evidence": {"psi": 15.0}}
    assert judge(truth("effect", "wind"), said("effect", "wind", where=told)).located is None


def test_the_verdict_s_place_and_that_of_a_free_signal_alone_are_scored_apart():
    told = {"channel": "current", "evidence": {"psi": 60.0, "current": 55.0}}
    case = judge(truth("effect", "ocean_current"), said("effect", "ocean_current", where=told))
    assert (case.located, case.alone) == (True, False)


def test_a_cause_taken_for_process_noise_is_told_as_the_reason():
    # unit of a moment: half the density times L^3 U^2, here with the vehicle's own speed
    source = {"environment": {"force_rms": [2e-5, 2e-5, 2e-6, 0.0, 0.0]}}
    answer = replace(truth("outside", "vortex_shedding"), source=source)
    answer = replace(answer, factors=dict(answer.factors) | {"vehicle": "lauv"})
    vehicle = load_vehicle("lauv")
    unit = 0.5 * vehicle.rho * vehicle.L**2 * cruising_speed(vehicle, vehicle.rpm_ref) ** 2
    for times, said_so in ((1.0, False), (10.0, True)):
        told = said(
            "none", environment={"force": [2e-5 * unit, 2e-5 * unit, 2e-6 * unit * vehicle.L * times]}
        )
        reason = judge(answer, told).reason
        assert ("disturbance in N taken 10 times overestimated" in reason) == said_so


def test_every_unlisted_cause_of_the_plant_has_a_place():
    assert all(places_of(case.name) for case in OUTSIDE)
    assert all(places_of(e.name) for e in CATALOGUE)


def world(count=60, seed=0):
    """Answers of all kinds with the verdicts of one who knows them."""
    rng = np.random.default_rng(seed)
    names = [e.name for e in CATALOGUE if e.dof == 3]
    answers, verdicts = {}, {}
    for k in range(count):
        kind = ("none", "effect", "effect", "outside", "two")[k % 5]
        chosen = rng.choice(names, 12, replace=False)
        picked, seen = [], set()
        for n in chosen:
            if families_of([n]).isdisjoint(seen):
                picked.append(str(n))
                seen |= families_of([n])
        planted = {"none": [], "outside": ["vortex_shedding"], "two": picked[:2]}.get(kind, picked[:1])
        word = {"none": "none", "outside": "outside", "two": "several"}.get(kind, "effect")
        told = said(word, *(planted if kind in ("effect", "two") else []), p=0.98)
        told["set95"] = planted if kind in ("effect", "two") else [word]
        if kind == "two":
            told["probabilities"] = {planted[0]: 0.49, planted[1]: 0.49, "none": 0.02}
        answers[f"b{k:03d}"] = replace(truth(kind, *planted), name=f"b{k:03d}")
        verdicts[f"b{k:03d}"] = told
    return answers, verdicts


@pytest.mark.parametrize("hits, count, word", [
    (19, 20, "met"),  # 0.95 itself
    (18, 20, "undecided"),  # 0.90; the interval goes to 0.988
    (70, 100, "missed"),  # the interval ends at 0.788
    (0, 0, ""),
])  # fmt: skip
def test_a_bar_is_met_by_the_score_itself_and_undecided_where_only_its_interval_holds_it(hits, count, word):
    assert share("top-1", "", [True] * hits + [False] * (count - hits), at_least(0.95)).standing == word
    assert share("top-1", "", [True] * hits + [False] * (count - hits)).standing == ""


def test_a_sheet_counts_met_undecided_and_missed_apart():
    words = ["met", "met", "undecided", "missed", ""]
    assert standings(3, words, 7).endswith("7 bundles: of 4 bars 2 met, 1 undecided, 1 missed")


def test_one_who_knows_the_answers_meets_every_bar_and_the_control_fails():
    answers, verdicts = world()
    quantities = score_quantities([judge(answers[n], verdicts[n], 5.0) for n in answers])
    judged = [q for q in quantities if q.standing]
    assert len(judged) >= 12 and all(q.standing == "met" for q in judged)
    control = shuffled(answers, verdicts)
    assert control.standing == "missed" and control.count == 24


def test_one_who_always_says_none_fails_and_one_who_always_names_fails_otherwise():
    answers, _ = world()
    for word, names, missed in (("none", (), "top-1 by family"), ("effect", ("wind",), "wrong name")):
        found = {
            q.name: q.standing
            for q in score_quantities([judge(a, said(word, *names)) for a in answers.values()])
        }
        assert found[missed] == "missed"
    assert found["false alarm on none"] == found["false name on outside"] == "missed"


def test_calibration_passes_the_honest_and_not_the_boastful():
    rng = np.random.default_rng(1)
    honest, boastful = [], []
    for p in rng.uniform(0.3, 1.0, 400):
        answer = truth("effect", "wind")
        top = "wind" if rng.random() < p else "gyro_bias"
        honest.append(judge(answer, said("effect", top, p=p)))
        boastful.append(judge(answer, said("effect", top, p=0.5 + p / 2)))
    assert all(b.standing != "missed" for b in calibration(honest))
    assert sum(b.count for b in calibration(honest)) == 400
    assert any(b.standing == "missed" for b in calibration(boastful))
    assert all(b.count >= 20 for b in calibration(honest))


def test_families_share_out_all_probability():
    names = [e.name for e in CATALOGUE]
    even = by_family(dict.fromkeys([*names, "none", "outside", "coefficient_error"], 1.0))
    assert sum(even.values()) == len(names) + 3 and set(even) >= set(FAMILIES)
    assert even["current"] == 2.0  # steady and varying


@pytest.mark.thorough
def test_a_campaign_without_effect_leaves_nothing_and_information_goes_with_the_square_of_the_size():
    # plant and model share no code: what is left without an effect is their disagreement
    bare = draw_campaign(4, kind="none", vehicle="lauv", dof=3, sensors="full", sea="mid")
    problem = true_problem(bare)
    left = build_bank(problem, problem.path, [problem.environment.noise_model], []).total(0).ee
    assert left < 1.0
    found = []
    for size in (0.05, 0.1):
        fixed = {"vehicle": "lauv", "dof": 3, "sensors": "full", "sea": "mid", "sizes": (size, size)}
        found.append(detectability(draw_campaign(4, effects=["rudder_offset"], **fixed))[0])
    assert found[1].noncentrality / found[0].noncentrality == pytest.approx(4.0, rel=0.1)
    assert found[1].margin > found[0].margin
    assert 0.0 < found[0].absorbed < 0.5


def linear_bank(resid, columns):
    """Bank of three signatures and one coefficient in a world of 200 white readings."""
    ss, se = columns.T @ columns, columns.T @ resid
    effects = [e for e in CATALOGUE if len(e.parameters) == 1 and e.smooth and not e.parameters[0].one_sided][
        :3
    ]
    made = {e.name: EffectColumns(e, (np.array([1 + k]),)) for k, e in enumerate(effects)}
    return SensitivityBank(
        ((NormalEquations(ss, se, float(resid @ resid), 0.0, resid.size),),), (), 1, made
    ), list(made)


def test_baselines_choose_the_planted_signature_and_none_without():
    rng = np.random.default_rng(3)
    columns, noise = rng.standard_normal((200, 4)), rng.standard_normal(200)
    bank, names = linear_bank(noise + 3.0 * columns[:, 2], columns)
    told = choices(bank)
    assert told["bic"]["top"] == names[1] == told["correlation"]["top"]
    assert told["recalibrated"]["top"] == "none"
    assert sum(told["bic"]["probabilities"].values()) == pytest.approx(1.0)
    quiet = choices(linear_bank(noise, columns)[0])
    assert quiet["bic"]["top"] == quiet["correlation"]["top"] == "none"


def test_white_noise_statistics_name_an_effect_where_the_noise_is_not_white():
    # why they are baselines: a slow disturbance lies along some signature or other
    rng = np.random.default_rng(5)
    slow = np.cumsum(rng.standard_normal((200, 5)), axis=0)
    bank, _ = linear_bank(rng.standard_normal(200) + slow[:, 0], slow[:, 1:])
    assert choices(bank)["bic"]["top"] != "none"


def test_labels_of_a_collection_are_read_and_nonsense_is_refused(tmp_path):
    label = {"name": "a1", "vehicle": "lauv", "six_dof": False, "channels": "full", "label": "ocean_current",
             "effects": [{"name": "ocean_current", "variant": "ocean_current", "params": {"size": 0.5}}],
             "detect": {"delta_cost": 80.0}}  # fmt: skip
    file = tmp_path / "labels.json"
    file.write_text(json.dumps([label]))
    answer = load_answers(file)["a1"]
    assert answer.kind == "effect" and answer.families == {"current"}
    assert answer.causes[0].shown.noncentrality == 80.0
    file.write_text(json.dumps([{"name": "a1"}]))
    with pytest.raises(BlindError, match="the label of a1 cannot be read"):
        load_answers(file)
    (tmp_path / "b1.json").write_text("{}")
    with pytest.raises(BlindError, match=r"b1\.json: is no answer"):
        load_answers(tmp_path)
