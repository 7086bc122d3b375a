"""The answer of a diagnosis: engineering units, one interval, three errors, failures beside the headline."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_results import RESULT, a_result, draws

from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence.effect_draws import warning
from bayesid.diagnosis.evidence.replay import Replay
from bayesid.diagnosis.failed_checks import NO_MODEL, failures
from bayesid.diagnosis.hypotheses.rules import (
    LEEWAY,
    LEFT_OUT_WORSE,
    MOTION_EVENT,
    NO_SIZE_BESIDE_FORM,
    NONE_SURE,
    REFUTED,
    TURNS_BY_ITSELF,
    UNLISTED_BESIDE,
    UNSURE,
)
from bayesid.diagnosis.plain_words import in_words, intervals, sentence, size_words
from bayesid.diagnosis.result_parts import (
    Effect,
    Estimate,
    InPlaceOf,
    Moved,
    Refit,
    Retuning,
    RunError,
    StretchFound,
    Value,
)
from bayesid.diagnosis.run_sizes import RunSizes
from bayesid.diagnosis.size_names import contract, declared_sizes
from bayesid.diagnosis.summary import summary
from bayesid.diagnosis.third_model import explained_words
from bayesid.diagnosis.threshold_table import SURE_PROBABILITY
from bayesid.diagnosis.unnamed_words import WHY
from bayesid.equations.model import build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.environment import EFFECTS
from bayesid.model.effects.of_ships import SHIP_EFFECTS
from bayesid.model.vehicles import load_vehicle
from bayesid.places import Places
from bayesid.report.diagnosis.holdout import proof_label
from bayesid.report.diagnosis.report import diagnosis_report, write_diagnosis_report
from bayesid.report.writer.blocks import Row

MODELS = ("nominal", "recalibrated", "with effect")


def a_run(name="r2", role="holdout", position=(76.0, 30.0, 1.3), heading=(0.5, 0.3, 0.005)):
    rms = {m: {"x": p, "y": 0.0, "psi": h} for m, p, h in zip(MODELS, position, heading, strict=True)}
    return RunError(name, "turn 25", role, 100.0, 10.0, dict(zip(MODELS, position, strict=True)), rms)


def an_effect(name, **sizes):
    """A catalogue effect with sizes (value, sd)."""
    declared = next(e for e in CATALOGUE if e.name == name)
    parameters = {n: Value(v, sd, "") for n, (v, sd) in sizes.items()}
    return Effect(name, 0.97, parameters, {}, "", declared.says, {"inverse_rate_r": 180 / math.pi / 1000})


def test_coefficients_kept_as_given_are_found_beside_the_effects_by_a_fit_that_is_named():
    found = a_result()
    names = ",".join(e.name for e in found.effects)
    kept = " ".join(answer(replace(found, retuning=Retuning(False, -0.1, 0.2, {}))).steps)
    assert f"`bayesid fit BUNDLE --with {names} --out FOLDER`" in kept
    own = replace(found, effects=tuple(replace(e, name="ice") for e in found.effects))
    kept = " ".join(answer(replace(own, retuning=Retuning(False, -0.1, 0.2, {}))).steps)
    assert "--effects FILE --out FOLDER`" in kept
    of_file = replace(found, effects=tuple(replace(e, name="thruster_stbd_gain") for e in found.effects))
    kept = " ".join(answer(replace(of_file, retuning=Retuning(False, -0.1, 0.2, {}))).steps)
    assert "--with thruster_stbd_gain" in kept and "--effects" not in kept
    for other in (Retuning(True, 0.5, 0.2, {}), Retuning(False, -0.1, 0.2, {}, as_given=True)):
        assert "--with" not in " ".join(answer(replace(found, retuning=other)).steps)


def test_an_error_that_an_explanation_does_not_lessen_is_said_beside_that_which_it_does():
    nearer = answer(
        replace(a_result(), runs=(a_run(position=(12.4, 30.0, 7.7), heading=(1.05, 0.07, 1.08)),))
    )
    assert "instead of 12.4 m and 60.2 degrees (no gain in heading)" in nearer.outcome
    little = a_run(position=(12.4, 30.0, 7.7), heading=(1.05, 0.07, 0.9))  # by a seventh
    assert "(hardly a gain in heading)" in answer(replace(a_result(), runs=(little,))).outcome
    both = answer(replace(a_result(), runs=(a_run(),)))
    assert "no gain" not in both.outcome


def test_what_sticks_is_told_with_its_order_held_and_not_as_left_out():
    stuck = Event("r2", 50.0, 65.0, "rudder", "stuck", None, 231.0, value=0.2513, sd=0.0173, stuck="delta_r")
    found = replace(a_result("outside", ()), rule=MOTION_EVENT, events=(stuck,))
    said = answer(found)
    assert "in r2 from 50.0 to 65.0 s" in said.headline
    assert "as if the rudder stuck at 14.4 ± 0.99 degrees to port, whatever is ordered" in said.headline
    assert "with its order held then" in " ".join(said.steps)
    brief = replace(found, events=(replace(stuck, kind="motion", brief=True),))
    assert "without that time" in " ".join(answer(brief).steps)


def test_a_slow_rudder_is_told_in_degrees_a_second_with_its_interval():
    """1/R - 1/R0 = 1/28 - 1/1000 s/deg; its deviation of 2 % of 1/R is one of about 2 % of R."""
    per_degree = 180 / math.pi
    excess, sd = (1 / 28 - 1 / 1000) * per_degree, 0.02 / 28 * per_degree
    slow = an_effect("actuator_rate_limit", inverse_rate_excess=(excess, sd))
    assert sentence(slow) == "The rudder moves at 28 degrees a second instead of 1000 degrees a second."
    assert intervals(slow)[0] == "28.0 degrees a second (95 %: 26.9 to 29.1)"


@pytest.mark.parametrize(
    "name, sizes, said",
    [
        ("rudder_offset", {"offset": (-0.02, 0.002)}, "1.1 degrees to starboard"),
        ("thrust_loss", {"loss": (-0.1, 0.01)}, "10 % more thrust"),
        ("ocean_current", {"V_north": (0.0, 0.01), "V_east": (-0.3, 0.01)}, "0.3 m/s towards 270 degrees"),
        ("actuator_dead_time", {"delay": (0.4, 0.1)}, "0.4 seconds later"),
    ],
)
def test_the_sign_of_a_size_is_a_word(name, sizes, said):
    assert said in sentence(an_effect(name, **sizes))


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda e: e.name)
def test_every_effect_of_the_catalogue_has_a_sentence_whose_places_are_its_own(effect):
    sizes = {p.name: Value(0.1, 0.01, p.unit) for p in effect.parameters}
    if effect.name == "wind":  # told by the contract's names
        sizes = {"V_wind": Value(5.0, 0.5, "m/s"), "from": Value(0.1, 0.1, "rad")}
    said = sentence(Effect(effect.name, 1.0, sizes, {}, "", effect.says, dict.fromkeys(effect.adjust, 0.01)))
    assert effect.says and "{" not in said and not said.endswith("acts.")


def test_an_effect_of_a_user_without_a_sentence_is_told_by_its_name():
    assert sentence(Effect("weed_on_rudder", 0.97, {})) == "Weed on rudder acts."


@pytest.mark.parametrize("of", [EFFECTS, SHIP_EFFECTS], ids=["areas assumed", "areas declared"])
def test_the_speed_of_a_wind_is_as_uncertain_as_the_areas_it_acts_on(of):
    """A push is one of areas and squared speed: with twice the areas the same push is .71 of the speed."""
    wind = next(e for e in of if e.name == "wind")
    assumed = {p.name: p.assumed for p in wind.parameters}
    found = {"blowing_north": Value(-8.0, 0.1, "m/s"), "blowing_east": Value(-6.0, 0.1, "m/s")}
    told = contract("wind", found, assumed)
    reach = 2 * told["V_wind"].sd
    for areas in (0.5, 2.0):
        assert (abs(10.0 / np.sqrt(areas) - 10.0) < reach) == (of is EFFECTS)
    assert told["from"].sd == pytest.approx(0.01)
    assert told["V_wind"].value == pytest.approx(10.0)
    back = declared_sizes("wind", {n: v.value for n, v in told.items()})
    assert back == pytest.approx({n: v.value for n, v in found.items()})


def test_a_wind_of_no_speed_worth_telling_comes_from_no_direction():
    """It was 0.2 m/s (-1.2 to 1.6) from 74 degrees (-279 to 427)."""
    wind = next(e for e in EFFECTS if e.name == "wind")
    found = {"blowing_north": Value(-0.05, 0.7, "m/s"), "blowing_east": Value(-0.2, 0.7, "m/s")}
    told = Effect("wind", 1.0, contract("wind", found), {}, "", wind.says)
    assert "0.21 m/s from any direction acts" in sentence(told)
    assert intervals(told) == ["0.21 m/s (95 %: 0.00 to 1.58)", "any direction"]


def a_fouled_hull(moved, certain):
    """`RESULT` with a coefficient of drag that fouling would move as well."""
    effect = next(e for e in CATALOGUE if e.name == "hull_fouling")
    told = Effect(effect.name, 0.0, {"drag_increase": Value(0.5, 0.02, "-")}, says=effect.says)
    drag = Moved(given=-2.0, prior_sd=0.2, retuned=-3.0, explained=-3.0, retuned_sd=0.04, explained_sd=0.04)
    spin = Moved(given=-1.0, prior_sd=0.2, retuned=-2.0, explained=-2.0, retuned_sd=0.001, explained_sd=0.001)
    here = (InPlaceOf(told, "X_u|u|", moved, certain),)
    return replace(RESULT, moved={"X_u|u|": drag, "N_r": spin}, in_place_of=here)


def test_an_effect_that_does_what_a_coefficient_does_is_told_where_that_is_certainly_off():
    off, within = a_fouled_hull(5.0, True), a_fouled_hull(2.0, False)
    said = (
        "Or it is no wrong X_u|u| but hull fouling, which no run tells from it: the hull has 50 % more drag"
    )
    for word in ("coefficients", "effect"):
        told = answer(replace(off, verdict=word))
        assert said in (told.headline if word == "coefficients" else " ".join(told.certainty))
        assert "No effect is needed" not in told.headline
        silent = answer(replace(within, verdict=word))
        assert "Or it is no wrong" not in silent.headline + " ".join(silent.certainty)
    for each in (off, within):  # before a coefficient that moves more surely
        assert answer(each).moved[0].startswith("X_u|u| +50 ± 2 %")
        assert "as hull fouling would move it" in answer(each).moved[0]


def test_what_a_report_says_to_simulate_with_is_what_a_simulation_takes():
    sizes = {"V_wind": Value(5.0, 0.5, "m/s"), "from": Value(0.6, 0.1, "rad")}
    found = replace(RESULT.effects[0], parameters=sizes)
    said = next(s for s in answer(replace(RESULT, effects=(found,))).steps if "--set" in s)
    names = {w.partition("=")[0] for w in said.split() if w.startswith("wind.")}
    known = build_model(load_vehicle("remus100"), 3).index
    assert names and names <= set(known)


def test_the_interval_shown_is_that_of_the_draws_where_they_are_to_be_used_and_no_note_says_otherwise():
    size = Value(0.25, 0.01, "-", 0.1, 0.3)
    effect = replace(an_effect("thrust_loss"), parameters={"loss": size})
    assert intervals(effect) == ["25 % less (95 %: 10 to 30)"]
    posterior = draws(force=-1.13)
    assert warning(posterior) is not None
    told = replace(RESULT, posterior=posterior, warnings=(warning(posterior), "no straight run"))
    assert "intervals of the draws" not in summary(told) and "no straight run" in summary(told)


def test_three_errors_are_always_told_in_metres_and_degrees():
    told = summary(replace(RESULT, runs=(a_run(),)))
    line = {row.split()[0]: row.split()[1:] for row in told.splitlines() if row.startswith("  ")}
    assert line["as"] == ["given", "76", "28.6"]
    assert line["re-tuned"] == ["30", "17.2"] and line["explained"] == ["1.3", "0.29"]


def test_none_with_a_large_error_says_that_re_tuning_closes_it():
    runs = (a_run(position=(76.0, 1.3, 1.3), heading=(0.5, 0.006, 0.006)),)
    said = answer(a_result("none", (), (), 0.0, runs=runs)).headline
    assert "No effect is needed" in said and "76 m" in said and "re-tuned, by 1.3 m" in said
    close = (a_run(position=(1.4, 1.3, 1.3), heading=(0.006, 0.006, 0.006)),)
    assert "agree to 1.4 m" in answer(a_result("none", (), (), 0.0, runs=close)).headline


def test_an_explanation_that_predicts_worse_than_as_given_stands_in_the_box():
    worse, better = a_run(position=(10.0, 9.0, 30.0)), a_run("r3", position=(76.0, 30.0, 1.3))
    said = failures(a_result(runs=(worse, better)))
    assert len(said) == 1 and "1 of 2 held-out runs worse" in said[0] and "30 m" in said[0]
    assert failures(a_result(runs=(better,))) == ()
    report = diagnosis_report(a_result(runs=(worse,)))
    assert any("worse" in text for text in report.failures)


@pytest.mark.parametrize("word", ["model_form", "coefficients", "none"])
def test_a_re_tuned_model_that_predicts_worse_stands_there_too_where_predictions_draw_it(word):
    worse = a_run(position=(10.0, 90.0, 90.0))
    found = a_result(word, (), (), 0.0, runs=(worse,))
    said = failures(found)
    if word == "none":  # what is drawn then is the simulator as given
        assert said == ()
        return
    assert "re-tuned model predicts 1 of 1 held-out runs worse" in said[0] and "90 m" in said[0]
    assert "Do not predict" in " ".join(answer(found).steps)
    assert failures(replace(found, retuning=Retuning(False, -0.1, 0.05, {}))) == ()


def sizes_by_run(share, absent, runs=3):
    told = {f"r{k}": Estimate(0.2, 0.01) for k in range(runs)}
    return RunSizes({"wind.V_north": told}, {"wind.V_north": 0.2 * share}, share, absent)


@pytest.mark.parametrize(("share", "absent"), [(0.1, False), (0.0, False), (0.6, True)])
def test_runs_that_differ_in_size_fail_a_check_where_a_run_without_it_would_be_no_surprise(share, absent):
    found = a_result(runs_agree=1e-6, run_sizes={"wind": sizes_by_run(share, absent)})
    said = [text for text in failures(found) if "disagree about the size" in text]
    told = [text for text in answer(found).certainty if "From run to run the size differs" in text]
    assert (bool(said), bool(told)) == (absent, not absent)
    if absent:
        assert "of wind: " in said[0] and "a run without it would be no surprise" in said[0]
    else:
        by = "by 10 % (wind)" if share else "by less than 1 % (wind)"
        assert by in told[0] and told[0].endswith("; the interval counts that.")
        few = replace(found, run_sizes={"wind": sizes_by_run(share, absent, runs=2)})
        assert any(text.endswith("(wind), one sd.") for text in answer(few).certainty)  # nothing widens two
    agreed = replace(found, runs_agree=0.2)
    assert not failures(agreed) and not any("From run to run" in t for t in answer(agreed).certainty)
    two = replace(found, explanation=("wind", "steady_force"))  # of one of which nothing is known
    assert any("disagree about the size of" in t and "steady force" in t for t in failures(two))
    assert not any("From run to run" in text for text in answer(two).certainty)


def test_what_the_runs_tell_apart_from_the_name_is_not_said_to_leave_its_trace():
    found = a_result(ambiguity_groups=(("wind", "steady_force", "rudder_offset"),))
    chances = {"wind": 0.97, "steady_force": 0.02, "rudder_offset": 1e-5}
    said = next(t for t in answer(replace(found, probabilities=chances)).certainty if "same trace" in t)
    assert "steady force" in said and "rudder offset" not in said


def test_runs_that_disagree_a_fit_that_stopped_and_absurd_coefficients_stand_in_the_box():
    assert "disagree" in failures(a_result(runs_agree=1e-6))[0] and failures(a_result(runs_agree=0.2)) == ()
    stopped = replace(a_result(), refits=(Refit(("wind",), 50.0, 1.0, False, {}),))
    assert "before it converged" in failures(stopped)[0]
    moved = {"N_v": Moved(-0.01, 0.001, -0.01, -0.05)}
    assert "N_v by 40 times" in failures(a_result(moved=moved))[0]


@pytest.mark.parametrize(
    ("moved", "told"),
    [
        (Moved(-0.01, 0.001, -0.01, -0.021), ("N_v by 11 times its stated uncertainty, +110 %",)),
        (Moved(-0.01, 0.001, -0.01, -0.019), ()),  # 9 times
        (Moved(-0.01, 0.03, -0.01, 0.1), ("N_v by 4 times its stated uncertainty, -0.01 to 0.1",)),
        (Moved(-0.01, 0.04, -0.01, 0.1), ()),  # 2.75 times: its size was hardly stated
    ],
)
def test_a_coefficient_out_of_all_reason_is_told_in_the_box_with_both_measures(moved, told):
    said = failures(a_result(moved={"N_v": moved}))
    assert [all(text in said[0] for text in told)] * bool(told) == [True] * len(said)


def test_a_row_that_the_file_does_not_state_is_not_measured_by_its_stated_uncertainty():
    """X_rr "by 555 times its stated uncertainty" was completed from `convention = "fossen"`."""
    own = Moved(-0.485, 0.052, -33.0, -29.3, 8.7, 10.2)
    completed = replace(own, completed=True)
    (said,) = failures(a_result(moved={"X_rr": completed}))
    assert said.startswith("The explanation needs rows far from what added mass gives")
    assert "completed from the convention of the file, not stated (X_rr -0.485 to -29.3)" in said
    assert "uncertainty" not in said and "it stands for another force of the same motion" in said
    (said,) = failures(a_result(moved={"X_rr": completed, "N_v": Moved(-0.01, 0.001, -0.01, -0.05)}))
    assert "those stated (N_v by 40 times its stated uncertainty, +400 %)." in said
    assert "It also needs rows far from what added mass gives" in said
    (said,) = failures(a_result(moved={"X_rr": own}))
    assert "X_rr by 554 times its stated uncertainty" in said and "completed" not in said  # control
    ((moved,), (stated,)) = (answer(a_result(moved={"X_rr": m})).moved for m in (completed, own))
    assert "(completed from the convention of the file, not stated" in moved and "uncertainty" not in moved
    assert "times its stated uncertainty" in stated


def test_re_tuning_out_of_all_reason_is_told_where_no_effect_is_named():
    far = {n: Moved(-0.01, 0.001, -0.5, -0.01) for n in ("N_v", "N_r", "Y_v")}
    for word in ("none", "model_form"):
        (said,) = failures(a_result(word, (), (), 0.0, moved=far))
        assert said.startswith("Re-tuning needs coefficients far from those stated (N_v by 490 times")
        assert "and 1 more" in said
    assert failures(a_result("coefficients", (), (), 0.0, moved=far)) == ()  # the headline is about them
    assert "N_v" in answer(a_result("coefficients", (), (), 0.0, moved=far)).headline


def test_an_added_mass_that_is_clearly_negative_fails_a_check_in_each_model_that_has_it():
    def said(retuned, explained, sd=1.0, given=-90.9, name="Y_vdot"):
        moved = {name: Moved(given, 13.6, retuned, explained, sd, sd)}
        return [text for text in failures(a_result(moved=moved)) if "negative added mass" in text]

    (first, second) = said(83.0, 10.0)
    assert first.startswith(
        "Re-tuned, Y_vdot is 83 instead of -90.9: a negative added mass, which no hull has."
    )
    assert second.startswith("With the explanation, Y_vdot is 10 instead of -90.9")
    assert said(83.0, -80.0) == [first]
    assert said(-180.0, -20.0) == []  # far off, but an added mass
    assert said(1.0, 1.0) == []  # not clearly
    assert said(83.0, 10.0, name="Y_rdot") == []  # of either sign
    assert said(83.0, 10.0, given=5.0) == []  # the file has it so


def test_with_what_diverges_or_predicts_worse_nothing_is_to_be_predicted():
    good, lost = a_run(), a_run("r3", "identify", (76.0, 30.0, None), (0.5, 0.3, None))
    worse = a_run("r4", position=(10.0, 9.0, 30.0))
    for runs, told in (((good,), ""), ((good, lost), "r3 diverges"), ((good, worse), "worse")):
        steps = " ".join(answer(a_result(runs=runs)).steps)
        assert ("`bayesid predict" in steps) == (not told) and ("Do not predict" in steps) == bool(told)
        assert told in steps
    assert any("simulation of r3 diverges" in text for text in failures(a_result(runs=(good, lost))))


def test_a_run_that_diverges_has_words_and_no_number():
    said = summary(replace(RESULT, runs=(a_run(position=(None, 30.0, 1.3), heading=(None, 0.3, 0.005)),)))
    assert "diverges" in said and "nan" not in said and "inf" not in said


@pytest.mark.parametrize("gone", [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)])
@pytest.mark.parametrize("word", ["effect", "none", "coefficients"])
def test_models_that_diverge_are_said_to_and_no_error_is_made_up(gone, word):
    def without(values):
        return tuple(None if k in gone else x for k, x in enumerate(values))

    run = a_run(position=without((76.0, 30.0, 1.3)), heading=without((0.5, 0.3, 0.005)))
    found = answer(a_result(word, runs=(run,)))
    said = " ".join((found.headline, found.outcome, *found.failures))
    used = (0, 1, 2) if word == "effect" else (0, 1)
    assert said.count("diverge") >= (1 if set(gone) & set(used) else 0)
    assert "nan" not in said and "by (rms)" not in said and " of ." not in said and "to  on" not in said


def test_coefficients_freed_all_at_once_are_told_without_private_words():
    assert in_words("coefficient_error:every coefficient x10").startswith(
        "coefficients ten times further off"
    )
    assert in_words("coefficient_error:N_r") == "coefficient error of N_r"


@pytest.mark.thorough
def test_the_picture_is_on_the_first_screen_and_small(tmp_path):
    t = np.linspace(0.0, 100.0, 201)
    log = np.column_stack([np.sin(t / 20), np.cos(t / 20), t / 20])
    models = {m: log + k for k, m in enumerate(MODELS)}
    shown = Replay(
        "r2", "turn 25", "holdout", t, 10.0, ("x", "y", "psi"), log, models,
        a_run().rms, np.full(log.shape, 0.1), {},
    )  # fmt: skip
    found = replace(RESULT, runs=(a_run(),), drawings=replace(RESULT.drawings, replays=(shown,)))
    assert any(isinstance(block, Row) for block in diagnosis_report(found).first)
    written = write_diagnosis_report(found, tmp_path)
    assert (tmp_path / "figures" / "picture_track.png").stat().st_size < 100_000
    text = written.read_text(encoding="utf-8")
    assert text.index("Track of") < text.index(">Contents<")


def test_an_interval_of_draws_is_as_wide_as_the_runs_differ():
    from diagnosis_results import draws

    from bayesid.diagnosis.effects_found import _interval
    from bayesid.diagnosis.evidence.effect_draws import choice

    drawn = draws()
    assert choice(drawn) == "draws"
    key, of = next(iter(drawn.parameters.items()))
    assert _interval(drawn, key, 0.5 * of.sd) == pytest.approx((of.low95, of.high95))
    low, high = _interval(drawn, key, 3.0 * of.sd)
    assert (low - of.mean) == pytest.approx(3 * (of.low95 - of.mean))
    assert (high - of.mean) == pytest.approx(3 * (of.high95 - of.mean))
    assert _interval(None, key, of.sd) == (None, None) == _interval(drawn, "none", of.sd)


def test_a_model_with_coefficients_as_given_is_not_called_one_with_the_re_tuned():
    """As given it has not the force that the equations lack either; re-tuned it has."""
    without = replace(RESULT, verdict="model_form", explanation=(), model_form=None)
    said = explained_words(replace(without, retuning=Retuning(True, -0.1, 0.2, {})))
    assert "as re-tuned" in said and "nor the force that the equations lack" in said  # no fit has it
    form = replace(without, model_form=SimpleNamespace())
    for kept in (True, False):
        said = explained_words(replace(form, retuning=Retuning(kept, -0.1, 0.2, {})))
        assert ("are one" in said) is kept
        assert ("as given" in said) is not kept


def test_a_sensor_that_errs_is_judged_by_its_own_readings():
    """A gyro moves no track: what falls is the error of the yaw rate, and only then is it said."""
    run = a_run(position=(0.44, 0.5, 0.44), heading=(0.005, 0.005, 0.005))
    shown = replace(
        RESULT, explanation=("gyro_scale",), effects=(an_effect("gyro_scale", scale=(0.02, 0.001)),)
    )

    def outcome(after):
        rates = dict(zip(run.rms, (0.01, 0.009, after), strict=True))
        rms = {m: {**run.rms[m], "r": rates[m]} for m in run.rms}
        return answer(replace(shown, runs=(replace(run, rms=rms),))).outcome

    assert "0.11 degrees a second instead of 0.57" in outcome(0.002)
    assert "no gain" not in outcome(0.002)
    assert "no gain" in outcome(0.0095)


def test_a_probability_that_two_of_a_kind_share_is_said_to_be_of_both():
    """A current and one that changes: which of them it is is less sure than that water moves."""
    moving = an_effect("ocean_current_varying", V_north=(-0.2, 0.01), V_east=(0.1, 0.01))
    shared = replace(moving, in_its_place={"ocean_current": 0.24})
    for effect, said in (
        (moving, "(probability 0.97)."),
        (shared, "(probability 0.97 that it or ocean current acts)."),
    ):
        found = answer(replace(RESULT, verdict="effect", effects=(effect,)))
        assert found.headline.endswith(said)
        assert any(
            text.startswith("Ocean current varying: probability 0.97 that it") for text in found.certainty
        )


def test_only_what_is_of_its_kind_and_probable_enough_stands_in_the_place_of_an_effect():

    from bayesid.diagnosis.effects_found import _in_its_place

    inside = {"a": 0.7, "of its kind": 0.2, "faint": 0.04, "other": 0.5}
    families = {"a": "kind", "of its kind": "kind", "faint": "kind", "other": "another"}
    assert _in_its_place(SimpleNamespace(inside=inside), families, "a") == {"of its kind": 0.2}
    assert _in_its_place(SimpleNamespace(inside=inside), {}, "a") == {}


def test_nothing_is_to_be_predicted_where_no_model_was_written_or_the_fit_stopped():
    unmade = replace(a_result(), warnings=(f"{NO_MODEL}: the simulation diverges",))
    assert "Do not predict" in answer(unmade).steps[-1] and "diverges" in answer(unmade).steps[-1]
    stopped = replace(a_result(), refits=(Refit(("wind",), 50.0, 1.0, False, {}),))
    assert "stopped before it converged" in answer(stopped).steps[-1]
    assert "--model" in answer(a_result()).steps[-1] and "Do not" not in answer(a_result()).steps[-1]


def test_re_tuning_is_advised_for_the_coefficients_that_leave_their_uncertainty():
    """A fit of all coefficients to two zig-zags, as it was advised, left six combinations open."""
    runs = (a_run(position=(76.0, 1.3, 1.3), heading=(0.5, 0.006, 0.006)),)
    moved = {"N_dr": Moved(-1.0, 0.1, -1.4, -1.4), "Y_v": Moved(-1.0, 0.1, -1.01, -1.01)}
    steps = answer(replace(a_result("none", (), (), 0.0, runs=runs), moved=moved)).steps
    assert any("`bayesid fit BUNDLE --free N_dr --out FOLDER`" in s for s in steps)
    written = answer(
        replace(a_result("none", (), (), 0.0, runs=runs), moved=moved), Places("pond", "gap")
    ).steps
    (told,) = [s for s in written if s.startswith("Re-tune: `bayesid export gap --out")]
    assert "--free N_dr" in told and "frees only what moved" in told


def test_re_tuning_is_advised_for_all_coefficients_that_surely_moved_of_which_six_are_listed():
    """By their stated deviations alone the six would be others. A fit that kept the others took what they do
    for a force that the equations lack and missed a held-out turn by 8 degrees."""
    runs = (a_run(position=(76.0, 1.3, 1.3), heading=(0.5, 0.006, 0.006)),)
    moved = {f"N_{i}": Moved(-1.0, 0.1, -1.1 - 0.1 * i, -1.0, 0.001 * (i + 1) ** 2) for i in range(1, 10)}
    found = answer(replace(a_result("none", (), (), 0.0, runs=runs), moved=moved))
    (advice,) = (step for step in found.steps if "--free" in step)
    listed = [text.split()[0] for text in found.moved]
    assert listed == [f"N_{i}" for i in range(1, 7)]
    assert f"--free {','.join([*listed, 'N_7', 'N_8', 'N_9'])} " in advice


def test_what_moves_within_its_stated_uncertainty_is_freed_but_not_listed():
    runs = (a_run(position=(76.0, 1.3, 1.3), heading=(0.5, 0.006, 0.006)),)
    moved = {
        "N_dr": Moved(-1.0, 0.2, -1.4, -1.4, 0.01),
        "N_r": Moved(-1.0, 0.2, -1.05, -1.0, 0.01),
        "N_v": Moved(-1.0, 0.2, -1.01, -1.0, 0.01),
    }
    found = answer(replace(a_result("none", (), (), 0.0, runs=runs), moved=moved))
    assert [text.split()[0] for text in found.moved] == ["N_dr"]
    assert any("--free N_dr,N_r --out" in step for step in found.steps)


def test_coefficients_that_moved_are_told_by_what_the_runs_leave_open_of_them():
    """The drag of a fouled tanker moved by 40 %, known to 0.7; a term left open led the list, by -12501 %."""
    moved = {
        "N_vvv": Moved(-0.0002, 0.00002, 0.0244, 0.0244, 0.0266),  # 1230 stated, 0.9 of its own
        "X_u|u|": Moved(-0.00145, 0.000145, -0.00202, -0.00202, 0.00001),
        "Y_dr": Moved(0.0072, 0.0007, 0.0036, 0.0036, 0.0003),
        "X_vvvv": Moved(0.005, 0.0005, 0.348, 0.348, 0.055),
        "N_v": Moved(-1.0, 0.1, -1.04, -1.04, 0.01),  # sure, and within what was stated
    }
    found = replace(a_result("model_form", (), (), 0.0), moved=moved)
    assert [text.split(" (")[0] for text in answer(found).moved] == [
        "X_u|u| +39.3 ± 0.7 %", "Y_dr -50 ± 4 %", "X_vvvv 0.005 to 0.348 ± 0.055",
    ]  # fmt: skip
    (said,) = (text for text in failures(found) if "far from those stated" in text)
    assert "X_vvvv" in said and "N_vvv" not in said


def test_a_coefficient_that_goes_or_turns_its_sign_is_told_by_its_values():
    """N_v was told as "-212 %" of a submarine, N_rdot, which had gone, as "-100 %"."""
    moved = {
        "N_v": Moved(-427.0, 40.0, 477.0, 477.0, 2.0),
        "N_r": Moved(-1000.0, 100.0, -1.0, -1.0, 0.5),
        "Y_v": Moved(-100.0, 10.0, -20.0, -20.0, 1.0),
    }
    found = replace(a_result("model_form", (), (), 0.0), moved=moved)
    assert [text.split(" (")[0] for text in answer(found).moved] == [
        "N_r -1000 to -1 ± 0.5", "N_v -427 to 477 ± 2", "Y_v -80 ± 1 %",
    ]  # fmt: skip
    assert any("N_v by 23 times its stated uncertainty, -427 to 477" in text for text in failures(found))


def test_an_added_mass_that_has_gone_fails_a_check():
    def said(retuned, name="N_rdot"):
        moved = {name: Moved(-120.0, 20.0, retuned, -110.0, 0.1, 0.1)}
        return [text for text in failures(a_result(moved=moved)) if "without added mass" in text]

    (one,) = said(-1e-13)
    assert one.startswith("Re-tuned, N_rdot ended at zero: no hull is without added mass.")
    assert not said(-2.0) and not said(-1e-13, "N_vdot")  # one of either sign may be nothing


@pytest.mark.parametrize("form_sd", [0.0, 0.0004, 0.02, 0.06])
def test_a_row_that_a_force_the_equations_lack_widens_is_said_to_be_and_fails_its_check(form_sd):
    """X_vvvv of a tanker moved by 424 stated deviations, 4 of those a form of its size gives it."""
    row = Moved(0.00507, 0.000507, 0.22, 0.22, 0.055, 0.055, form_sd=form_sd)
    found = replace(a_result("model_form", (), (), 0.0), moved={"X_vvvv": row})
    assert any("far from those stated" in text for text in failures(found))
    said = answer(found).moved[0]
    assert ("may be part of the force the equations lack" in said) is (form_sd > row.prior_sd)


def test_where_the_explanation_keeps_coefficients_as_given_no_change_of_them_by_it_is_listed():
    """Every line ended with "explained +0 %"."""
    moved = {"N_v": Moved(-1.0, 0.1, -1.5, -1.0, 0.01)}
    kept = replace(a_result(moved=moved), retuning=Retuning(False, -0.1, 0.2, {}))
    assert answer(kept).moved == ("N_v +50 ± 1 % (5.0 times its stated uncertainty)",)
    assert "that re-tuning moves, the surest first (the explanation keeps them as given)\n  N_v" in summary(
        kept
    )
    both = replace(kept, retuning=Retuning(True, 0.5, 0.2, {}))
    assert answer(both).moved == ("N_v +50 ± 1 % (5.0 times its stated uncertainty, explained +0 %)",)
    assert "that re-tuning moves, the surest first\n  N_v" in summary(both)


def test_a_verdict_that_needs_no_effect_and_no_other_coefficients_shows_the_simulator_as_given():
    given = replace(a_result("model_form", (), ("wind",)), retuning=Retuning(False, 0.3, 0.4, {}))
    assert answer(given).labels[2] == proof_label(given) == "as given, nothing added"
    tuned = replace(given, retuning=Retuning(True, 0.5, 0.4, {}))
    assert answer(tuned).labels[2] == "explained" != proof_label(tuned)


def test_a_name_of_a_probability_that_was_often_wrong_is_told_as_probable():
    slow = an_effect("actuator_lag", tau=(0.4, 0.05))
    found = replace(a_result(), effects=(replace(slow, probability=float(SURE_PROBABILITY) - 1e-3),))
    told = answer(found)
    assert told.headline.startswith("Probably the rudder follows its orders with a lag of 0.4 seconds (")
    assert any("one in twelve was wrong" in text for text in told.certainty)
    sure = answer(replace(found, effects=(replace(slow, probability=float(SURE_PROBABILITY)),)))
    assert sure.headline.startswith("The rudder follows its orders")
    assert not any("was wrong" in text for text in sure.certainty)


def test_what_an_explanation_leaves_open_of_a_coefficient_is_not_held_against_it():
    left = Moved(-0.0002, 0.00002, 0.0, 0.0244, 0.0, 0.0266)  # 1230 stated, 0.9 of its own
    assert failures(a_result(moved={"N_vvv": left})) == ()
    for sd in (0.001, None):  # sure, and of an earlier version
        (said,) = failures(a_result(moved={"N_vvv": replace(left, explained_sd=sd)}))
        assert said.startswith("The explanation needs") and "N_vvv by 1230 times" in said


def test_an_explanation_by_coefficients_that_keeps_them_as_given_is_called_the_simulator_as_given():
    wide = ("coefficient_error:every coefficient x10",)
    same = (a_run(position=(17.9, 15.6, 17.9), heading=(0.2, 0.13, 0.2)),)
    found = replace(
        a_result("ambiguous", (), (), 0.0, runs=same),
        explanation=wide,
        retuning=Retuning(False, 5.0, 0.0, {}),
    )
    assert explained_words(found).startswith("Explained: the simulator as given")
    told = answer(found).outcome
    assert "nothing is gained" in told and "as given" in told and "re-tuned" in told
    assert answer(found).labels[2] == proof_label(found) == "as given, nothing added"
    sure = " ".join(answer(found).certainty)
    assert "they are no proof of it" in sure and "no worse" not in sure
    everything = diagnosis_report(found)
    tables = [b for section in everything.sections for b in section.blocks]
    assert "errors explained" not in repr(tables) and "repeats the first" in repr(tables)
    assert "times as large" not in explained_words(found)


def test_an_explanation_that_does_not_predict_runs_left_out_better_is_not_what_predicts():
    same = (a_run(position=(17.9, 15.6, 17.9), heading=(0.2, 0.13, 0.2)),)
    kept = Retuning(False, -0.1, 0.2, {}, True, -0.5, 0.1)
    wind = an_effect("wind", blowing_north=(2.0, 0.1), blowing_east=(1.0, 0.1))
    found = replace(a_result(runs=same), effects=(wind,), retuning=kept)
    assert "the simulator as given" in explained_words(found)
    assert "It predicts runs left out worse (errors 1.6 times as large" in explained_words(found)
    unsure = replace(found, retuning=replace(kept, given_gain=-0.05))
    assert "better is not sure (errors 1.1 times as large" in explained_words(unsure)
    told = answer(found)
    assert "nothing is gained" in told.outcome and "--set" not in " ".join(told.steps)
    assert "--set" in " ".join(answer(replace(found, retuning=replace(kept, as_given=False))).steps)


def test_a_size_found_beside_coefficients_out_of_reason_is_said_to_be_where_these_do_not_predict():
    wind = an_effect("wind", blowing_north=(2.0, 0.1), blowing_east=(1.0, 0.1))
    row = Moved(-0.087, 0.013, -0.09, -0.087, 0.001, None, False, 0.068, 0.002)
    found = replace(a_result(moved={"K_*": row}), effects=(wind,), retuning=Retuning(False, 0.1, 0.2, {}))
    (said,) = (text for text in failures(found) if "far from those stated" in text)
    assert said.startswith("The fit that the size told is from needs coefficients")
    assert "K_* by 12 times its stated uncertainty, -0.087 to 0.068" in said
    # controls: not surely moved, and beside the explanation that predicts
    for other in (replace(row, beside_sd=0.1), replace(row, beside=None, beside_sd=None)):
        assert not any(
            "far from those stated" in text for text in failures(replace(found, moved={"K_*": other}))
        )


def test_coefficients_that_predict_alone_take_the_place_of_an_explanation_and_are_a_step():
    same = (a_run(position=(4.7, 0.78, 0.78), heading=(1.04, 0.13, 0.13)),)
    alone = Retuning(True, -0.3, 0.9, {}, False, -0.3, 0.9, True, 0.4, 0.1)
    wind = an_effect("wind", blowing_north=(2.0, 0.1), blowing_east=(1.0, 0.1))
    found = replace(a_result(runs=same), effects=(wind,), retuning=alone)
    assert "coefficients re-tuned alone" in explained_words(found)
    assert "(errors 0.67 times as large, one standard error 0.61 to 0.74)" in explained_words(found)
    told = answer(found)
    assert told.labels[2] == "re-tuned, nothing added"
    assert (
        "no better than with re-tuned coefficients alone" in told.outcome and "59.6 degrees" in told.outcome
    )
    assert "bayesid fit" in " ".join(told.steps) and "--set" not in " ".join(told.steps)
    # coefficients out of reason are those of the re-tuning
    far = {"N_v": Moved(-0.01, 0.001, -0.05, -0.05)}
    assert any(text.startswith("Re-tuning needs") for text in failures(replace(found, moved=far)))
    # the control: an explanation that predicts is shown as such
    kept = answer(replace(found, retuning=Retuning(True, 0.3, 0.1, {})))
    assert kept.labels[2] == "explained" and "no better than" not in kept.outcome


@pytest.mark.parametrize(
    ("set95", "others"),
    [
        (("heading_bias", "propeller_side_force", "outside"), "propeller side force or something else"),
        (("heading_bias",), "something else"),
    ],
)
def test_a_vehicle_that_turns_by_itself_is_told_before_any_probability(set95, others):
    found = a_result(
        "ambiguous", ("heading_bias",), ("heading_bias",), set95=set95, rule=TURNS_BY_ITSELF,
        probabilities={"heading_bias": 0.98, "outside": 0.02},
    )  # fmt: skip
    told = answer(found).headline
    assert told == (
        "Every run turns to one side with the rudder amidships, which heading bias does not explain: "
        f"{others} may be behind both."
    )


@pytest.mark.parametrize(
    ("set95", "probabilities", "rest"),
    [
        (("rudder_offset", "propeller_side_force"), {}, "propeller side force (0.24)."),
        (("rudder_offset", "none"), {"none": 0.2}, "nothing at all (0.20)."),
        (
            ("rudder_offset", "outside", "none"),
            {"none": 0.2},
            "something not on the list (0.06), or nothing at all (0.20).",
        ),
    ],
)
def test_the_likeliest_of_several_causes_is_told_with_its_size(set95, probabilities, rest):
    given = {"none": 0.0, "rudder_offset": 0.7, "propeller_side_force": 0.24, "outside": 0.06} | probabilities
    found = replace(
        a_result("ambiguous", (), (), set95=set95, rule=UNSURE, probabilities=given),
        effects=(an_effect("rudder_offset", offset=(-0.02, 0.002)),),
    )
    said = "More likely than not the rudder stands 1.1 degrees to starboard of where it is ordered (0.70)"
    assert answer(found).headline == f"{said}; these runs do not exclude {rest}"
    open_to = "1.15 degrees to starboard (95 %: 0.92 to 1.37)"
    assert f"If it is rudder offset: {open_to}." in answer(found).certainty
    # not where runs speak against it, where it is not more probable than the rest, or where it has no size
    for other in (
        replace(found, rule="refuted by the runs"),
        replace(found, probabilities=given | {"rudder_offset": 0.5}),
        replace(found, effects=(replace(found.effects[0], parameters={}),)),
    ):
        assert answer(other).headline.startswith("These runs cannot tell")
        assert not any(line.startswith("If it is") for line in answer(other).certainty)


def test_a_cause_that_left_out_runs_speak_against_is_no_name_and_the_headline_says_why():
    found = a_result(
        "outside", (), ("wind", "cubic_damping"), set95=("outside", "wind", "cubic_damping", "tether_drag"),
        rule=LEFT_OUT_WORSE, probabilities={"wind": 0.98, "outside": 0.02},
    )  # fmt: skip
    said = answer(found)
    assert said.headline == (
        "No known effect explains these runs, alone or with another, in the heading reading. The best "
        "explanation, wind + cubic damping, predicts each run, left out of the estimate, worse than the "
        "simulator as given does, and the runs disagree about its size."
    )
    assert any(x.startswith("The probabilities before that: wind (0.98)") for x in said.certainty)
    assert not any("What else it could be" in x for x in said.certainty)


LAG = next(e for e in CATALOGUE if e.name == "actuator_lag")


def test_a_name_that_held_out_runs_took_away_is_told_with_its_size_and_why():
    found = a_result("ambiguous", (), ("actuator_lag",), set95=("actuator_lag",), rule=REFUTED)
    lag = Effect("actuator_lag", 0.98, {"tau": Value(1.5, 0.06, "s", 1.38, 1.62)}, says=LAG.says)
    found = replace(found, effects=(lag,), runs=(a_run(),))
    said = answer(found)
    assert said.headline == (
        "By the identification runs, the rudder follows its orders with a lag of 1.5 seconds (0.98), but "
        "held-out runs are predicted worse so than with re-tuned coefficients: it is not named."
    )
    assert any(x.startswith("If it is actuator lag: ") and "95 %" in x for x in said.certainty)
    assert any("read last, which took the name away" in x for x in said.certainty)
    assert not any("after the verdict stood" in x for x in said.certainty)


def test_what_may_act_beside_something_unlisted_is_listed_by_how_probably_it_acts():
    found = a_result(
        "outside", (), ("wind",), set95=("outside", "wind", "crossflow_drag"), rule=UNLISTED_BESIDE,
        probabilities={"outside": 0.47, "wind": 0.27, "crossflow_drag": 0.23},
    )  # fmt: skip
    found = replace(found, acting={"outside": 0.94, "wind": 0.54, "crossflow_drag": 0.46})
    said = answer(replace(found, where=replace(found.where, channel="Y", after={"rudder": 90.0, "Y": 3.0})))
    assert said.headline.startswith(
        "Something acts that is not among the known effects (probability 0.94), in the rudder's angle"
    )
    beside = [x for x in said.certainty if x.startswith("What may act beside it: ")]
    assert beside == ["What may act beside it: wind (0.54), crossflow drag (0.46)."]
    assert not any("What else it could be" in x for x in said.certainty)


def test_the_headline_says_when_something_acts_that_acts_in_one_run():
    found = replace(a_result("outside", (), ()), acting={"outside": 0.97})
    stretch = StretchFound("r4", 725.2, 769.8, 90.0, math.radians(-5.4), math.radians(0.3))
    where = replace(found.where, channel="rudder", evidence={"rudder": 80.0}, stretch=stretch)
    said = "Something acts that is not among the known effects (probability 0.97), in the rudder's angle"
    when = ", only in r4 from 725 to 770 s"
    size = ", as if it stood 5.4 ± 0.3 degrees further to starboard on average."
    assert answer(replace(found, where=where)).headline == said + when + size
    port = replace(where, stretch=replace(stretch, value=math.radians(5.4)))
    assert "further to port" in answer(replace(found, where=port)).headline
    unknown = replace(where, stretch=replace(stretch, value=None, sd=None))
    assert answer(replace(found, where=unknown)).headline == said + when + "."
    assert answer(replace(found, where=replace(where, stretch=None))).headline == said + "."
    elsewhere = replace(where, evidence={"N": 90.0, "rudder": 80.0})  # where the stretch is of another place
    assert answer(replace(found, where=elsewhere)).headline == said + "."


def test_the_headline_says_when_the_vehicle_moved_as_nothing_known_explains():
    motion = Event("r3", 63.1, 64.0, "X+Y+N", "motion", 11.8, 101.8)
    alone = a_result(
        "outside", (), (), set95=("outside", "cubic_damping"), rule=MOTION_EVENT, events=(motion,)
    )
    said = "No known effect explains how the vehicle moves in r3 from 63.1 to 64.0 s."
    assert answer(alone).headline == f"{said} What may act beside it: cubic damping."
    assert answer(replace(alone, set95=("outside", "model_form"))).headline == said
    lasting = answer(replace(alone, rule="unlisted cause")).headline
    assert lasting.startswith("Something acts that is not among") and lasting.endswith(said)
    unsure = a_result("ambiguous", (), (), set95=("wind", "gyro_bias"), rule=UNSURE, events=(motion,))
    assert answer(unsure).headline.endswith(said)
    assert answer(replace(alone, set95=("outside",))).headline == said
    named = replace(a_result("effect_with_remainder"), events=(motion, replace(motion, kind="sensor")))
    told = answer(named).headline
    assert told.endswith(f" It does not explain the whole gap. {said}")
    coefficients = answer(a_result("coefficients", (), (), events=(motion,))).headline
    assert coefficients.startswith("No effect is needed, but") and coefficients.endswith(said)
    placed = a_result("coefficients", (), (), dependence=Dependence("place", "hull", 40.0, 40.0, 0.2, 50.0))
    found = answer(placed).headline
    assert found.startswith("Coefficients lie further off") and "from place to place by at least 20%" in found
    # the control: readings that were wrong are no motion
    wrong = replace(named, events=(replace(motion, kind="sensor"),))
    assert answer(wrong).headline.endswith("It does not explain the whole gap.")


@pytest.mark.parametrize(
    ("place", "value", "sd", "stuck", "told"),
    [
        ("rudder", 3.0, 0.2, "delta_r", "rudder stuck at 3 ± 0.2 degrees to port, whatever is ordered"),
        ("rudder", -12.5, 1.0, "delta_r", "rudder stuck at 12.5 ± 1 degrees to starboard, whatever is ordered"),  # noqa: E501
        ("rudder", 0.1, 0.2, "delta_r", "rudder stuck at 0.1 ± 0.2 degrees, whatever is ordered"),
        ("Z+M", -2.0, 0.2, "delta_s", "stern planes stuck at -2 ± 0.2 degrees, whatever is ordered"),
        ("rudder", -2.0, 0.3, None, "rudder stood 2 ± 0.3 degrees further to starboard on average"),
        ("N", 5.0, 0.3, None, ""),
    ],
)  # fmt: skip
def test_the_headline_says_what_a_brief_motion_looks_like(place, value, sd, stuck, told):
    motion = Event(
        "r3", 63.1, 64.0, place, "motion", None, 50.0, True, math.radians(value), math.radians(sd), stuck
    )
    alone = a_result("outside", (), (), set95=("outside",), rule=MOTION_EVENT, events=(motion, motion))
    said = (
        "No known effect explains how the vehicle moves in r3 from 63.1 to 64.0 s, in r3 from 63.1 to 64.0 s."
    )
    assert answer(alone).headline == said + (f" In r3 it moves then as if the {told}." * 2 if told else "")
    shaft = replace(motion, stuck="n", value=812.0, sd=4.2)
    headline = answer(replace(alone, events=(shaft,))).headline
    assert headline.endswith(
        "In r3 it moves then as if the shaft stayed at 812 ± 4.2 rpm, whatever is ordered."
    )
    slower = replace(motion, channel="rpm", stuck=None, value=-31.0, sd=4.2)
    headline = answer(replace(alone, events=(slower,))).headline
    assert headline.endswith(" as if the shaft turned 31 ± 4.2 rpm slower than ordered.")


@pytest.mark.parametrize(
    ("shares", "acting", "together", "start", "end"),
    [
        (
            (0.5, 0.4, 0.1),
            (0.5, 0.45, 0.15),
            0.1,
            "These runs cannot tell which it is: ",
            "may act together.",
        ),
        ((0.5, 0.4, 0.1), (0.5, 0.4, 0.1), 0.0, "These runs cannot tell which it is: ", "gyro bias (0.10)."),
        ((0.4, 0.5, 0.1), (0.8, 0.9, 0.1), 0.8, "Several things act together and these runs", "bias (0.10)."),
        ((0.6, 0.3, 0.1), (0.8, 0.7, 0.1), 0.6, "Several things act together and these runs", "bias (0.10)."),
        (
            (0.6, 0.4, 0.1),
            (0.6, 0.4, 0.1),
            0.0,
            "More likely than not the rudder",
            "wind (0.40), gyro bias (0.10).",
        ),
        (
            (0.6, 0.3, 0.1),
            (0.7, 0.4, 0.1),
            0.2,
            "More likely than not the rudder",
            "; two of them may act together.",
        ),
        # sorted by what is printed
        (
            (0.3, 0.4, 0.3),
            (0.4, 0.5, 0.6),
            0.5,
            "These runs cannot tell which it is: gyro bias",
            "act together.",
        ),
    ],
)
def test_which_of_several_and_several_at_once_are_different_sentences(shares, acting, together, start, end):
    names = ("rudder_offset", "wind", "gyro_bias")
    found = a_result(
        "ambiguous", (), (), set95=names, rule=NONE_SURE, probabilities=dict(zip(names, shares, strict=True)),
        acting={"none": 0.0} | dict(zip(names, acting, strict=True)), together=together,
    )  # fmt: skip
    told = answer(replace(found, effects=(an_effect("rudder_offset", offset=(-0.02, 0.002)),))).headline
    assert told.startswith(start) and told.endswith(end)
    # sizes are those of a cause that acts alone
    sized = "; 1.1 degrees to starboard)" in told
    assert sized == start.startswith("These runs cannot tell which it is: ")


def two_that_act(unnamed, acting=(0.987, 0.983), **others):
    """Two causes of one explanation that is ambiguous, as an AUV with list and trim had them."""
    names = ("propeller_torque", "trim_weight")
    sizes = (
        an_effect("propeller_torque", torque=(-0.372, 0.08)),
        an_effect("trim_weight", weight_excess=(2.03, 0.3), x=(0.24, 0.1)),
    )
    found = a_result(
        "ambiguous", (), names, set95=names, rule=NONE_SURE, together=1.0, next_manoeuvre=(), unnamed=unnamed,
        probabilities={"none": 0.0} | dict(zip(names, (0.49, 0.49), strict=True)),
        acting={"none": 0.0} | dict(zip(names, acting, strict=True)), **others,
    )  # fmt: skip
    return replace(found, effects=sizes)


def test_causes_with_the_probability_of_a_name_are_told_with_why_they_have_none():
    """ "cannot tell which: propeller torque (0.99), trim weight (0.98)" contradicted itself."""
    names = ("propeller_torque", "trim_weight")
    told = answer(two_that_act(dict.fromkeys(names, "form"))).headline
    assert told == (
        "By their probabilities propeller torque (0.99) and trim weight (0.98) act together, but neither is "
        f"named as a cause: of each, {WHY['form']}."
    )
    told = answer(two_that_act({"propeller_torque": "form", "trim_weight": "size"})).headline
    assert told.endswith(f": of propeller torque, {WHY['form']}; of trim weight, {WHY['size']}.")
    told = answer(two_that_act({"propeller_torque": "form"}, acting=(0.987, 0.3))).headline
    assert told.startswith("By their probabilities propeller torque (0.99) acts, but it is not named")
    assert told.endswith(f": of propeller torque, {WHY['form']}. Beside them may act: trim weight (0.30).")
    # control: that neither has the probability of a name is what the old sentence says
    told = answer(two_that_act(dict.fromkeys(names, "probability"), acting=(0.8, 0.7))).headline
    assert told.startswith(
        "Several things act together and these runs cannot tell which: propeller torque (0.80"
    )


def test_of_several_that_act_the_only_one_with_a_size_is_told_and_the_others_without_theirs():
    """Offsets of -166 to 230 rpm stood beside a loss of thrust of 21 % as if they were as sure."""
    found = two_that_act({"propeller_torque": "probability", "trim_weight": "size"}, acting=(0.86, 0.73))
    told = answer(found)
    assert (
        told.headline.startswith("More likely than not ") and "(0.86); what acts beside it" in told.headline
    )
    assert told.headline.endswith("the size of trim weight may be none.")
    assert not any("Trim weight: probability" in line for line in told.certainty)
    both = two_that_act(
        dict.fromkeys(("propeller_torque", "trim_weight"), "probability"), acting=(0.86, 0.73)
    )
    assert answer(both).headline.startswith("Several things act together")
    assert any("Trim weight: probability" in line for line in answer(both).certainty)
    less = two_that_act({"propeller_torque": "probability", "trim_weight": "size"}, acting=(0.45, 0.73))
    assert answer(less).headline.startswith("Several things act together")


def test_sizes_of_several_that_are_not_named_stand_on_the_first_screen_with_their_intervals():
    found = two_that_act(dict.fromkeys(("propeller_torque", "trim_weight"), "form"))
    said = answer(found).certainty
    assert any(
        line.startswith("Propeller torque: probability 0.97 that it acts; as the expl") for line in said
    )
    assert any("2.03 N heavier (95 %: 1.44 to 2.62)" in line for line in said)
    assert not any("95 %: " in line for line in answer(replace(found, rule=UNSURE)).certainty)  # of one alone


@pytest.mark.parametrize("asked", [True, False])
def test_causes_that_are_not_separated_are_to_be_told_apart_by_a_manoeuvre(asked):
    names = ("propeller_torque", "trim_weight")
    found = two_that_act(dict.fromkeys(names, "form"), next_asked=asked)
    said = " ".join(answer(found, Places("pond", vehicle=" --vehicle auv.toml")).steps)
    assert "`bayesid design pond --vehicle auv.toml --tell propeller_torque,trim_weight`" in said
    assert ("as `--quick` asks" in said) != asked
    planned = replace(found, next_manoeuvre=RESULT.next_manoeuvre)
    assert "--tell" not in " ".join(answer(planned).steps)  # control: that one is said
    alone = replace(found, set95=names[:1])
    assert "--tell" not in " ".join(answer(alone).steps)
    boat = replace(found, trial=replace(found.trial, steers=False))  # `design` refuses it
    said = " ".join(answer(boat, Places("pond")).steps)
    assert "--tell" not in said and "tables of your own" in said


def test_what_leeway_may_give_is_said_with_the_leeway():
    found = a_result("ambiguous", (), (), set95=("heading_bias",), rule=LEEWAY)
    told = answer(replace(found, effects=(an_effect("heading_bias", bias=(0.0063, 0.0005)),))).headline
    assert told.startswith("Either the compass reads 0.36 degrees too much, or a constant side force")
    assert "(v) both look the same" in told


@pytest.mark.parametrize(
    "sd, said", [(0.17, "42 %"), (0.02, "42.1 %"), (1.7, "40 %"), (0.0, "42.1 %"), (np.inf, "42.1 %")]
)
def test_a_size_has_no_digit_that_its_interval_does_not_ask_for(sd, said):
    assert f" {said} more drag" in sentence(an_effect("hull_fouling", drag_increase=(0.4213, sd)))


def test_the_length_of_a_vector_has_no_digit_that_its_interval_does_not_ask_for():
    sharp = sentence(an_effect("ocean_current", V_north=(0.3, 0.001), V_east=(0.413, 0.001)))
    blunt = sentence(an_effect("ocean_current", V_north=(0.3, 3.0), V_east=(0.413, 3.0)))
    assert "of 0.51 m/s" in sharp and "of 0.5 m/s" in blunt


def test_what_the_explanation_has_beside_the_name_is_told_with_its_probability():
    """The run that is shown was predicted with it, and a reader must know with what."""
    more = replace(
        RESULT, explanation=(*(e.name for e in RESULT.effects), "actuator_backlash"),
        acting={**RESULT.acting, "actuator_backlash": 0.78},
    )  # fmt: skip
    said = " ".join(answer(more).certainty)
    also = "The explanation also has actuator backlash"
    assert f"{also} (0.78 that it acts), not named: a name asks for 0.90." in said
    sure = replace(more, acting={**RESULT.acting, "actuator_backlash": 0.97})
    assert f"{also} (0.97 that it acts), not named." in " ".join(answer(sure).certainty)  # of an older file
    for reason, words in WHY.items():
        told = " ".join(answer(replace(sure, unnamed={"actuator_backlash": reason})).certainty)
        assert f"{also} (0.97 that it acts), not named: {words}." in told
    assert "The explanation also has" not in " ".join(answer(RESULT).certainty)


def test_a_size_is_told_beside_a_name_where_there_is_one_alone():
    slow = an_effect("actuator_rate_limit", inverse_rate_excess=(5.0, 0.5))
    slow = replace(slow, instead={"inverse_rate_r": 14.3})
    assert size_words(slow) == "3 degrees a second"  # not the limit of the vehicle file beside it
    several = replace(
        slow, says="{a:%}, {b:%}", parameters=dict.fromkeys("ab", next(iter(slow.parameters.values())))
    )
    assert size_words(several) == ""


def test_where_a_cause_and_a_force_of_the_motion_explain_as_much_both_are_said():
    from bayesid.diagnosis.cannot_tell import cannot_tell
    from bayesid.diagnosis.hypotheses.rules import CAUSE_OR_FORM

    both = replace(
        RESULT, verdict="ambiguous", rule=CAUSE_OR_FORM, effects=(), set95=("model_form", "outside"),
        probabilities={"outside": 0.9}, acting={"outside": 0.9},
    )  # fmt: skip
    said = cannot_tell(both)
    assert "not among the known effects, or the equations lack a force" in said
    assert "0.9" not in said and "act beside it" not in said  # the probabilities know nothing of that force
    beside = replace(both, set95=("model_form", "outside", "wind"))
    assert cannot_tell(beside).endswith("What may act beside it: wind.")


def test_what_probably_acts_beside_a_force_the_equations_lack_stands_in_the_first_sentence():
    """ "no cause beside it can be told" stood above "What may act beside it: thrust loss (0.97)"."""
    lacks = replace(
        a_result("model_form", (), ()), rule=NO_SIZE_BESIDE_FORM,
        set95=("model_form", "thrust_loss", "outside"), acting={"thrust_loss": 0.97, "outside": 0.4},
    )  # fmt: skip
    told = answer(lacks).headline
    assert told.endswith(f"thrust loss (0.97) may act beside it, not named: {WHY['size']}.")
    two = replace(
        lacks, rule="model form", set95=("model_form", "wind", "heading_bias"),
        acting={"wind": 0.97, "heading_bias": 0.95}, unnamed={"wind": "form", "heading_bias": "leeway"},
    )  # fmt: skip
    assert f"not named: of wind, {WHY['form']}; of heading bias, {WHY['leeway']}" in answer(two).headline
    alike = answer(replace(two, unnamed={})).headline
    assert alike.endswith(
        f"wind (0.97) and heading bias (0.95) may act beside it, not named: of each, {WHY['form']}."
    )
    # control: nothing that is more likely than not
    unlikely = answer(replace(lacks, acting={"thrust_loss": 0.4})).headline
    assert unlikely.endswith("no cause beside it can be told.")
