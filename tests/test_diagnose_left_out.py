"""A diagnosis takes a name away where runs left out and their agreement speak against it."""

from __future__ import annotations

import importlib
from dataclasses import replace

import pytest
from diagnosis_results import a_result
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, MOTION_EVENT
from bayesid.diagnosis.hypotheses.verdict import REFUTED
from bayesid.diagnosis.run import diagnose
from bayesid.report.diagnosis.evidence import cause_blocks


@pytest.mark.thorough
@pytest.mark.parametrize(("gain", "named"), [(-0.3, False), (0.3, True)])
def test_a_name_falls_where_both_checks_fail_and_stands_where_one_holds(monkeypatch, gain, named):
    model = model_of("remus100")
    truth = other_vehicle(model, 3) | {"rudder_offset.offset": 0.05}
    trial = planted_trial(model, truth, 3, samples=160)
    run = importlib.import_module("bayesid.diagnosis.run")
    real = run.explained_model
    monkeypatch.setattr(
        run, "explained_model", lambda *a: replace(real(*a), given_gain=gain, given_error=0.1)
    )
    monkeypatch.setattr(run, "agreement", lambda best, coefficients: 1e-9)
    found = diagnose(trial, model, plan_next=False)
    if named:
        assert found.verdict.effects == ("rudder_offset",)
    else:
        assert (found.verdict.word, found.verdict.rule) == ("outside", LEFT_OUT_WORSE)
        assert found.result.effects == () and "rudder_offset" in found.verdict.set95


@pytest.mark.parametrize("rule", ["effect", LEFT_OUT_WORSE, MOTION_EVENT, REFUTED])
def test_probabilities_that_a_later_rule_overruled_say_so(rule):
    table = cause_blocks(a_result("outside", named=(), rule=rule))[-1]
    assert table.caption.endswith("a name needs 0.90.") == (rule == "effect")
