"""The benchmark set: an edition is the same set each time, what differs is said, entries go part by part."""

import json
from dataclasses import replace

import pytest

from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.commitment import BlindError, derived_salt, digest_of_folder
from bayesid.benchmark.protocol.leak_check import check_pack
from bayesid.benchmark.protocol.make_pack import write_answer
from bayesid.errors import BayesidError
from bayesid.progress import Progress
from studies.benchmark_set.editions import EDITIONS, Edition
from studies.benchmark_set.make import answer_of, archive, factors_of, make_set, secret_for
from studies.benchmark_set.report import set_report
from studies.benchmark_set.run import compared, main

QUIET = Progress(quiet=True)
SMALL = Edition(
    "a small edition",
    "2026-01-01T00:00:00+00:00",
    1,
    0,
    kinds=("none",),
    factors={"dof": 3, "vehicle": "lauv"},
)


@pytest.mark.thorough
def test_an_edition_made_twice_is_the_same_to_the_byte(tmp_path):
    one, other = (make_set(SMALL, tmp_path / k, progress=QUIET) for k in "ab")
    assert one == other and len(one["pack"]) == 1
    for part in ("pack", "answers"):
        assert digest_of_folder(tmp_path / "a" / part) == digest_of_folder(tmp_path / "b" / part)
    assert archive(tmp_path / "a" / "pack", tmp_path / "a.tar.gz", "x") == archive(
        tmp_path / "b" / "pack", tmp_path / "b.tar.gz", "x"
    )
    assert make_set(SMALL, tmp_path / "a", progress=QUIET) == one  # what is there is kept
    assert check_pack(tmp_path / "a" / "pack")["secret_bits"] == 0  # anybody can draw it
    drawn = make_set(replace(SMALL, phrase="another"), tmp_path / "c", progress=QUIET)
    assert not set(drawn["pack"]) & set(one["pack"])


def test_what_differs_from_the_tracked_digests_is_said(tmp_path):
    tracked, made = tmp_path / "1.json", {"pack": {"p1": {"bundle": "b", "answer": "a"}}}
    assert compared(tracked, made, False) == ["pack: no digests are tracked for this part"]
    assert compared(tracked, made, True) == [] and compared(tracked, made, False) == []
    made["pack"]["p1"]["answer"] = "other"
    (sentence,) = compared(tracked, made, False)
    assert sentence.startswith("pack: 1 of 1 differ in the answer from the edition (p1")


def test_labels_of_other_equations_become_answers(tmp_path):
    told = {
        "name": "o1", "vehicle": "tanker", "channels": "full", "sea": None, "D_pieces": 900.0,
        "effects": [{"name": "rudder_offset", "params": {"offset": 0.03}, "more": {}},
                    {"name": "ocean_current", "params": {"V_north": 0.1}, "more": {}}],
        "D_each": [{"name": "rudder_offset", "D_pieces": 40.0}, {"name": "ocean_current", "D_pieces": 700.0}],
    }  # fmt: skip
    write_answer(tmp_path / "o1.json", answer_of(told), derived_salt(b"x" * 32, "o1"))
    found = load_answers(tmp_path)["o1"]
    assert found.kind == "two" and [c.shown.noncentrality for c in found.causes] == [40.0, 700.0]
    none = answer_of({**told, "effects": [{"name": "none", "params": {}}], "D_each": None})
    assert none["kind"] == "none" and none["effects"] == []


def test_causes_have_the_kinds_in_turn_and_a_noncentrality_to_aim_at():
    edition = EDITIONS["1"]
    made = [factors_of(edition, k, 5 + k) for k in range(edition.own)]
    assert [m["kind"] for m in made[:10]] == list(edition.kinds)
    assert all(edition.aim[0] <= m["aim"] <= edition.aim[1] for m in made if "aim" in m)


def test_salts_differ_and_come_from_the_secret_alone():
    assert derived_salt(b"a" * 32, "p1") == derived_salt(b"a" * 32, "p1") != derived_salt(b"a" * 32, "p2")
    assert derived_salt(b"a" * 32, "p1") != derived_salt(b"b" * 32, "p1")


def test_a_sealed_edition_needs_its_secret(tmp_path, monkeypatch):
    monkeypatch.setitem(EDITIONS, "sealed", replace(SMALL, phrase=""))
    with pytest.raises(BayesidError, match="give the file of its secret"):
        main("sealed", tmp_path)
    with pytest.raises(BayesidError, match="there are 1"):
        main("7", tmp_path)
    key = tmp_path / "key"
    key.write_text("not hexadecimal")
    with pytest.raises(BlindError, match="holds no 128 bits"):
        secret_for(EDITIONS["sealed"], tmp_path / "answers", key)


def test_tracked_entries_are_shown_part_by_part():
    row = json.loads(json.dumps({
        "method": "diagnosis", "bundles": 2, "detection rate": (1, 1), "detection rate, D >= 25": (1, 1),
        "false-alarm rate": (0, 1), "cause told of none": (0, 1),
        "mean probability of the true cause": 0.9, "the same, D >= 25": 0.9, "named right, D >= 25": (1, 1),
        "wrong names of all named": (0, 1), "log score": 0.1, "median CPU [s]": None,
    }))  # fmt: skip
    entry = {"entry": "ours", "verdicts": "0" * 64, "scores": {"all": row, "p": row}}
    report = set_report("1", {"p": {"none": 1, "effect": 1}}, {"x.tar.gz": "00"}, [entry])
    assert report.lead.startswith(
        "**Plain causes named right, and wrong names of all: ours 1 of 1 and 0 of 1.**"
    )
    tables = [b for s in report.sections for b in s.blocks if hasattr(b, "rows")]
    assert tuple(tables[2].rows[0][:3]) == ("ours", 2, "1/1 = 1.00") and len(tables) == 4
