"""The study of excited terms counts what it says it counts."""

from __future__ import annotations

import pytest

from studies.excited_terms.counting import counted, share
from studies.excited_terms.report import excited_terms_report, told
from studies.excited_terms.run import main


def term(name, acts, status="found", group=None, shows=100.0, plain=1.0, value=1.0):
    return {
        "name": name, "acts": acts, "shows": shows if acts else 0.0, "pysindy": status,
        "group": list(group or [name]), "value": value, "sd": 0.1, "true": 1.0, "stepwise": "not needed",
        "plain": plain, "fisher": 0.5 if acts else None,
    }  # fmt: skip


def test_confusion_counts_follow_their_definitions():
    pair = ("Y_v", "Y_r")
    rows = [
        term("Y_dr", True), term("Y_vvv", False, plain=0.9), term("Y_v", True, group=pair),
        term("Y_r", False, group=pair), term("N_v", True, "not needed", shows=3.0, value=None),
    ]  # fmt: skip
    case = {
        "vehicle": "a", "runs": ["b"], "truth": "as_built", "terms": rows,
        "white_force": ["cannot tell"], "seconds": {"pysindy": 1.0, "stepwise": 1.0},
    }  # fmt: skip
    found = counted([case, case])
    ours = found["matrices"]["PySINDy"]
    assert ours["acts and shows"]["found"] == 2 and ours["absent"]["found"] == 2
    assert ours["acts and shows"]["found in a group"] == 2 == ours["absent"]["found in a group"]
    assert ours["acts, shows less"]["not needed"] == 2
    assert found["matrices"]["control: plain ensemble"]["absent"]["found"] == 4
    assert found["groups"] == {"found": 2, "with a term that acts": 2, "median size": 2.0}
    assert found["values"] == {"within 3 sd": 2, "of": 2}
    report = excited_terms_report([case, case], found)
    assert "Of 4 terms that PySINDy names singly 2 do not act" in report.lead
    assert any("Y_vvv (2)" in f for f in report.failures)


def test_an_interval_of_no_hits_is_the_rule_of_three():
    """0 of 100: 1 - 0.025^(1/100) = 3.6 %."""
    cases = [{"terms": [term("Y_v", True) for _ in range(100)]}]
    assert told(share(cases, lambda r: r["acts"], lambda r: False)) == "0 of 100 (0 %; 0 to 4)"
    assert told(share(cases, lambda r: not r["acts"], lambda r: True)) == "none"


def test_cases_that_go_wrong_as_a_whole_widen_the_interval():
    """Ten of forty cases wrong in all of ten terms: 400 independent terms would give 21 to 30 %, forty cases
    give 13 to 39."""
    cases = [{"terms": [term("Y_v", k >= 10) for _ in range(10)]} for k in range(40)]
    found = share(cases, lambda r: True, lambda r: not r["acts"])
    assert found["hits"] == 100 and found["low"] < 0.17 and found["high"] > 0.35


def test_a_truth_dealt_out_anew_spoils_every_verdict():
    """Two of ten terms act and are found; dealt out anew, four in five of the found are absent."""
    terms = [term(f"Y_{k}", k < 2, "found" if k < 2 else "not needed") for k in range(10)]
    case = {
        "vehicle": "a", "runs": ["b"], "truth": "as_built", "terms": terms, "white_force": [],
        "seconds": {"pysindy": 1.0, "stepwise": 1.0},
    }  # fmt: skip
    shares = counted([case] * 100)["shares"]
    assert shares["PySINDy"]["found singly and absent"]["hits"] == 0
    dealt = shares["control: labels permuted"]["found singly and absent"]
    assert 140 < dealt["hits"] < 180 and dealt["of"] == 200  # 160, sd 6


@pytest.mark.slow
def test_the_plain_ensemble_names_absent_terms_and_the_groups_do_not(tmp_path):
    """The control must fail on a spiral; the first study had 1 of 115 against 1108 of 1754."""
    found = main(tmp_path, 10, 100, quick=True)["counts"]["matrices"]
    control = found["control: plain ensemble"]
    assert control["absent"]["found"] > control["acts and shows"]["found"]
    assert found["PySINDy"]["absent"]["found"] <= 1
