"""Blind predictions of a ship no model could be made of: rows with the reason, no traceback."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.errors import FitError, ModelError
from bayesid.progress import Progress
from bayesid.trials import Run, Trial
from studies.blind_predictions import run as study


def run_of(name, role):
    t = np.arange(0.0, 40.0, 0.5)
    return Run(name, "zigzag", role, t, {"psi": 0.01 * t}, {"delta_r_cmd": np.zeros(t.size)})


@pytest.fixture
def ship(tmp_path, monkeypatch):
    """A set of known and blind runs, and what fails when they are modelled."""
    known = Trial("known", tmp_path, "lauv", 3, (run_of("z_1", "identify"), run_of("z_2", "holdout")))
    blind = replace(known, runs=(run_of("turn_9", "holdout"),))
    monkeypatch.setattr(study, "known_runs", lambda *args: known)
    monkeypatch.setattr(study, "load_trial", lambda *args: blind)
    monkeypatch.setattr(study, "prepared", lambda blind, run: run)
    return study.SETS["esso_osaka"]


def failing_fit(monkeypatch):
    def fitted(*args):
        raise FitError("the vehicle diverges at the start values")

    monkeypatch.setattr(study, "fitted", fitted)
    return "diverges at the start values"


def failing_model(monkeypatch):
    def predictive_model(*args, **choices):
        raise ModelError("the fit has no posterior")

    monkeypatch.setattr(study, "fitted", lambda *args: SimpleNamespace())
    monkeypatch.setattr(study, "predictive_model", predictive_model)
    return "the fit has no posterior"


@pytest.mark.parametrize("failing", [failing_fit, failing_model])
def test_runs_without_a_model_get_a_row_with_the_reason(ship, tmp_path, monkeypatch, failing):
    reason = failing(monkeypatch)
    (tmp_path / "turn_9.csv").write_text("of an earlier study")
    shown = Progress(quiet=True)
    study.expectation("esso_osaka", ship, tmp_path, tmp_path, True, 0, shown)
    (row,) = json.loads((tmp_path / "expected.json").read_text())["runs"]
    assert row["run"] == "z_2" and reason in row["failed"]
    assert reason in (tmp_path / "EXPECTATION.md").read_text()
    study.predictions("esso_osaka", ship, tmp_path, tmp_path, True, 0, shown)
    told = json.loads((tmp_path / "predictions.json").read_text())["predictions"]
    assert "no model could be made" in told["turn_9"]["failed"] and reason in told["turn_9"]["failed"]
    assert not (tmp_path / "turn_9.csv").exists()


def test_bands_of_other_logs_are_not_taken(tmp_path):
    file, inputs = tmp_path / "expected.json", {"trial": "ab", "quick": False}
    with pytest.raises(SystemExit, match="run with --expect first"):
        study.expected_kinds(file, inputs)
    file.write_text('{"inputs": {"trial": "ab", "quick": false, "lead": 6.0}, "kinds": {"turn": 2.0}}')
    assert study.expected_kinds(file, inputs) == {"turn": 2.0}
    with pytest.raises(SystemExit, match="another trial and quick"):
        study.expected_kinds(file, {"trial": "cd", "quick": True})
