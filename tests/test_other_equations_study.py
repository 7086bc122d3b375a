"""The study of vehicles with other equations: what counts as right, what is kept, what its report says."""

import json
import shutil
from types import SimpleNamespace as Plain

import pytest

import studies.other_equations.run as study
import studies.other_equations.verdicts as kept
from bayesid.errors import BayesidError
from bayesid.executor import HERE
from bayesid.progress import Progress
from studies.other_equations.report import _checks, failures, other_equations_report
from studies.other_equations.scoring import quantities, scored

QUIET = Progress(quiet=True)
CURRENT = {"name": "ocean_current", "params": {"V_north": 0.2, "V_east": -0.1}}
OFFSET = {"name": "rudder_offset", "params": {"offset": 0.04}}
GYRO = {"name": "gyro_scale", "params": {"scale": 0.03}}


def label(*effects, ratio=10.0, name="p1", text=None):
    text = text or "+".join(e["name"] for e in effects) or "none"
    return {"name": name, "label": text, "effects": list(effects), "effect_over_form_gap": ratio}


def verdict(word, *named, stated=(), sd=0.01, values=None):
    effects = [
        {"name": e["name"], "probability": 0.97, "parameters": {
            k: {"value": v + (values or 0.0), "sd": sd} for k, v in e["params"].items()}}
        for e in named
    ]  # fmt: skip
    return {"verdict": word, "effects": effects, "set95": list(stated), "probabilities": {}}


def right(given, said):
    return scored(given, said).right


def test_a_large_effect_is_found_where_it_is_named_with_its_size_or_in_a_set_of_three():
    said = verdict("effect", CURRENT, stated=["ocean_current"])
    assert right(label(CURRENT), said)
    off = verdict("effect", CURRENT, stated=["ocean_current"], values=0.0197)
    assert not right(label(CURRENT), off)  # 1.97 sd from the truth
    assert right(label(CURRENT), verdict("effect", CURRENT, stated=["ocean_current"], values=0.0195))
    three = ["rudder_offset", "none", "ocean_current"]
    assert right(label(CURRENT), verdict("ambiguous", stated=three))
    assert not right(label(CURRENT), verdict("ambiguous", stated=[*three, "wind"]))
    assert not right(label(CURRENT), verdict("none", stated=three))
    assert not right(label(CURRENT), verdict("model_form", stated=three))


def test_one_of_two_effects_is_found_only_where_the_other_is_in_the_small_set():
    pair = label(CURRENT, OFFSET)
    assert right(pair, verdict("several", CURRENT, OFFSET))
    assert not right(pair, verdict("effect", CURRENT, stated=["ocean_current"]))
    assert (
        scored(pair, verdict("ambiguous", stated=["rudder_offset", "wind"])).how
        == "one of two causes in the set"
    )
    assert right(pair, verdict("effect_with_remainder", CURRENT, stated=["ocean_current", "rudder_offset"]))


def test_a_second_name_that_is_not_planted_spoils_a_right_first_one():
    said = verdict("several", CURRENT, OFFSET, stated=["ocean_current", "rudder_offset"])
    case = scored(label(CURRENT), said)
    assert not case.right and case.wrong == {"rudder_offset"} and "cause and wrong name" in case.how
    (wrong,) = (q for q in quantities([case]) if q.name == "wrong names")
    assert (wrong.hits, wrong.count) == (1, 2)


def test_names_of_an_ambiguous_verdict_are_possible_not_given():
    said = verdict("ambiguous", OFFSET, GYRO, stated=["rudder_offset", "gyro_scale"])
    assert not scored(label(), said).named
    assert not right(label(), said)  # yet it is an alarm


@pytest.mark.parametrize("word", ["none", "coefficients", "model_form"])
def test_where_nothing_is_planted_a_verdict_without_a_cause_is_right(word):
    assert right(label(ratio=0.0), verdict(word, stated=[word]))
    assert not right(label(OFFSET), verdict(word, stated=["none"]))


@pytest.mark.parametrize("word", ["outside", "effect", "several", "effect_with_remainder", "ambiguous"])
def test_any_other_word_is_an_alarm_where_nothing_is_planted(word):
    assert not right(label(ratio=0.0), verdict(word, OFFSET, stated=["outside"]))


def test_a_cause_outside_the_list_is_answered_outside_by_the_word_alone():
    jam = label({"name": "rudder_jam", "params": {}}, text="outside")
    assert right(jam, verdict("outside", stated=["outside", "wind"]))
    assert not right(jam, verdict("ambiguous", stated=["outside"]))
    assert scored(jam, verdict("effect", OFFSET)).wrong == {"rudder_offset"}


@pytest.mark.parametrize("word", ["none", "model_form", "outside", "ambiguous"])
@pytest.mark.parametrize("given", [label(), label(text="outside"), label(OFFSET)], ids=lambda x: x["label"])
def test_a_mistake_of_the_simulator_is_a_wrong_name_beside_every_word(given, word):
    case = scored(given, verdict(word, stated=("rudder_offset",)) | {"simulator": ["another length"]})
    assert not case.right and case.wrong == {"simulator: another length"}


def test_below_the_form_gap_silence_a_set_or_the_cause_itself_is_right_and_no_other_name():
    faint = label(GYRO, ratio=0.1)
    assert right(faint, verdict("coefficients", stated=["coefficient_error"]))
    assert right(faint, verdict("ambiguous", stated=["wind", "gyro_scale", "none", "gyro_bias"]))
    assert not right(faint, verdict("ambiguous", stated=["wind", "gyro_bias"]))
    assert right(faint, verdict("effect", GYRO, stated=["gyro_scale"]))
    assert not right(faint, verdict("effect", OFFSET, stated=["rudder_offset"]))
    assert not right(faint, verdict("outside", stated=["outside"]))


def test_a_failed_diagnosis_is_never_right():
    assert not any(right(x, None) for x in (label(), label(OFFSET), label(OFFSET, ratio=0.1)))


def test_bars_are_missed_by_verdicts_of_other_bundles_and_met_by_the_truth():
    labels = [label(CURRENT), label(OFFSET), label(GYRO, ratio=0.1), label(ratio=0.0)]
    said = [verdict("effect", CURRENT), verdict("effect", OFFSET), verdict("effect", GYRO), verdict("none")]
    good = quantities([scored(x, v) for x, v in zip(labels, said, strict=True)])
    crossed = quantities([scored(x, v) for x, v in zip(labels, said[1:] + said[:1], strict=True)])
    assert {q.standing for q in good if q.count and q.bar} == {"met"}
    hits = {q.name: q.hits for q in crossed if q.count and q.bar}
    # the faint label drew `none`, which is no overclaim; whatever else there is goes wrong
    assert hits == {
        "cause found": 0,
        "nothing overclaimed": 1,
        "no cause where there is none": 0,
        "wrong names": 3,
    }


def test_the_report_leads_with_the_counts_and_shows_the_earlier_commit_beside(tmp_path):
    labels = [label(CURRENT, name="a"), label(ratio=0.0, name="b")]
    new = {
        "a": verdict("effect", CURRENT) | {"cpu_seconds": 3.0},
        "b": verdict("model_form") | {"failure": ""},
    }
    old = {"a": verdict("outside", stated=["outside"]), "b": verdict("effect", OFFSET)}
    cases, before = ([scored(x, v[x["name"]]) for x in labels] for v in (new, old))
    document = other_equations_report(cases, new, before, old, "abc1234", False)
    assert (
        "2 of 2 verdicts keep the rule" in document.lead and "of 1 names given 0 are wrong" in document.lead
    )
    now, then = document.lead.split("Commit abc1234 on 2 of these bundles: ")
    assert "0 raised a false alarm" in now and "1 raised a false alarm" in then and "0 of 2 verdicts" in then
    assert document.failures == () and failures(before) != []
    (table,) = document.sections[1].blocks
    assert table.rows[0][3] == "effect: ocean current 0.97" and table.rows[0][-1].startswith("no")
    study.writer.write(document, tmp_path, {"inputs": {}, "seeds": []})
    assert "model form" in (tmp_path / "report.md").read_text("utf-8")


def test_checks_are_counted_by_whether_the_verdict_is_right():
    cases = [Plain(name=n, right=right) for n, right in zip("abcd", (True, False, True, True), strict=True)]
    far = {"a": True, "b": True, "c": False}
    given = {n: {"checks": {"far": fails}} for n, fails in far.items()} | {"d": {"failure": "diverged"}}
    (section,) = _checks(cases, given)
    assert list(map(list, section.blocks[0].rows)) == [["far", "1 of 2", "1 of 1"]]
    assert _checks(cases[:1], {"a": {}}) == ()  # verdicts kept before do not say


def bundle(folder, name, text="x"):
    (folder / name).mkdir(parents=True)
    (folder / name / "trial.toml").write_text(text)
    return folder / name


def test_kept_verdicts_are_not_made_again_unless_bundle_code_or_seed_changed(tmp_path, monkeypatch):
    asked = []

    def load(path):
        asked.append(path.name)
        raise BayesidError("no trial")

    monkeypatch.setattr(kept, "load_trial", load)
    bundles = [bundle(tmp_path, "a"), bundle(tmp_path, "b")]
    first = kept.verdicts(bundles[:1], tmp_path / "v", 0, HERE, QUIET)
    both = kept.verdicts(bundles, tmp_path / "v", 0, HERE, QUIET)
    assert asked == ["a", "b"] and both["a"] == first["a"] and both["a"]["failure"] == "no trial"
    (bundles[0] / "trial.toml").write_text("y")
    kept.verdicts(bundles, tmp_path / "v", 0, HERE, QUIET)
    assert asked == ["a", "b", "a"]
    kept.verdicts(bundles, tmp_path / "v", 1, HERE, QUIET)
    assert asked[3:] == ["a", "b"]
    monkeypatch.setattr(kept, "code_digest", lambda: "other")
    kept.verdicts(bundles, tmp_path / "v", 1, HERE, QUIET)
    assert asked[5:] == ["a", "b"]


def test_bundles_are_found_in_the_folder_in_practice_foreign_or_beside_it(tmp_path):
    there = tmp_path / "practice_foreign"
    there.mkdir()
    (tmp_path / "data").mkdir()
    with pytest.raises(BayesidError, match="holds neither"):
        study.bundles_in(tmp_path)
    (there / "labels.json").write_text("[]")
    assert all(study.bundles_in(p) == there for p in (there, tmp_path))
    assert study.bundles_in(tmp_path / "data") == there


def test_a_quick_run_takes_one_bundle_of_each_kind_and_the_baseline_only_of_the_same_bundles(
    tmp_path, monkeypatch
):
    data = tmp_path / "set"
    labels = [label(CURRENT, name="a"), label(OFFSET, name="b"), label(ratio=0.0, name="c")]
    digest = study.digest_of_folder(bundle(data, "a"))
    for name in "bc":
        bundle(data, name)
    (data / "labels.json").write_text(json.dumps(labels))
    said = {"a": verdict("effect", CURRENT), "c": verdict("none")}

    def answers(bundles, *more):
        return {b.name: said[b.name] | {"bundle": "", "failure": "", "cpu_seconds": 1.0} for b in bundles}

    monkeypatch.setattr(study, "verdicts", answers)
    old = {"a": verdict("outside") | {"bundle": digest}, "c": verdict("none") | {"bundle": "another"}}
    (tmp_path / "baseline.json").write_text(json.dumps({"commit": "abc", "verdicts": old}))
    monkeypatch.setattr(study, "BASELINE", tmp_path / "baseline.json")
    found = study.main(tmp_path / "out", data, quick=True)
    assert [c["name"] for c in found["cases"]] == ["a", "c"]
    assert [(c["name"], c["right"]) for c in found["before"]] == [("a", False)]
    assert "A quick run" in (tmp_path / "out" / "report.md").read_text("utf-8")
    shutil.rmtree(data / "a")
    with pytest.raises(BayesidError, match="no bundle for the labels a"):
        study.main(tmp_path / "out", data)
