"""From hypotheses to facts to a verdict, over worlds drawn at random.

Expected: the outcomes of the ladder of conditions that the rules replaced.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnose import facts
from bayesid.diagnose.verdict import judge

FILE = Path(__file__).parent / "data" / "verdicts.json"
WORLDS = json.loads(FILE.read_text()) if FILE.exists() else []
FAMILY = {"a": "one", "b": "two", "c": "three", "d": "one"}
EFFECTS = tuple(SimpleNamespace(name=n, family=f, where=("N",)) for n, f in FAMILY.items())


def candidate(effects, log_evidence, chi2, converged):
    fit = SimpleNamespace(converged=converged, chi2=chi2)
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
    )  # fmt: skip
    problem = SimpleNamespace(
        model=SimpleNamespace(kernel=SimpleNamespace(effects=EFFECTS)),
        coefficients=SimpleNamespace(names=()),
        as_built=w["as_built"],
    )
    stand_ins = {
        "idle": lambda best, problem: tuple(n for n in w["idle"] if n in best.effects),
        "pulls": lambda fit, problem: np.array(w["pulls"]),
        "crossed": lambda best, none, k: SimpleNamespace(**w["runs"]),
    }
    return problem, comparison, stand_ins


@pytest.mark.parametrize("w", WORLDS, ids=range(len(WORLDS)))
def test_facts_and_verdict_are_those_of_the_code_the_campaigns_were_scored_with(w, monkeypatch):
    problem, comparison, stand_ins = world(w)
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(facts, name, stand_in)
    expected = w["expected"]
    assert vars(facts.grounds_of(problem, comparison).facts) == pytest.approx(expected["facts"])
    v = judge(problem, comparison)
    assert v.word == expected["word"]
    for names in ("effects", "set95", "hidden"):
        assert list(getattr(v, names)) == expected[names], names
    assert list(v.reasons[:-1]) == expected["reasons"] and v.reasons[-1].startswith("decided by: ")


def test_there_are_worlds_of_every_word_but_the_rarest():
    assert {w["expected"]["word"] for w in WORLDS} == {
        "none", "effect", "effect_with_remainder", "outside", "coefficients", "ambiguous",
    }  # fmt: skip
