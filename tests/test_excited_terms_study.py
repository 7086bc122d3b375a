"""The study of excited terms counts what it says it counts."""

from __future__ import annotations

import pytest

from studies.excited_terms.report import counted, excited_terms_report, interval
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
        "seconds": {"pysindy": 1.0, "stepwise": 1.0},
    }  # fmt: skip
    found = counted([case, case])
    ours = found["matrices"]["PySINDy"]
    assert ours["acts and shows"]["found"] == 2 and ours["absent"]["found"] == 2
    assert ours["acts and shows"]["found in a group"] == 2 == ours["absent"]["found in a group"]
    assert ours["acts, shows less"]["not needed"] == 2
    assert found["matrices"]["control: plain ensemble"]["absent"]["found"] == 4
    assert found["groups"] == {"found": 2, "with a term that acts": 2, "median size": 2.0}
    assert found["values"] == {"within 3 sd": 2, "of": 2}
    assert "2 of 4" in excited_terms_report([case, case], found).lead


def test_an_interval_of_no_hits_is_the_rule_of_three():
    """0 of 100: 1 - 0.025^(1/100) = 3.6 %."""
    assert interval(0, 100) == "0 of 100 (0 %; 0 to 4)"
    assert interval(0, 0) == "none"


@pytest.mark.slow
def test_the_plain_ensemble_names_absent_terms_and_the_groups_do_not(tmp_path):
    """The control must fail on a spiral; the whole study has 1 of 115 against 1108 of 1754."""
    found = main(tmp_path, 10, 100, quick=True)["counts"]["matrices"]
    control = found["control: plain ensemble"]
    assert control["absent"]["found"] > control["acts and shows"]["found"]
    assert found["PySINDy"]["absent"]["found"] <= 1
