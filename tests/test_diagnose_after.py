"""What fails after the verdict costs a sentence; the verdict, its JSON and the report stay."""

import json
from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.cli import diagnose as command
from bayesid.diagnosis import diagnosed_model, run
from bayesid.diagnosis.attempt import attempt
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NOT_LINEARISABLE
from bayesid.trials import write_trial

MODEL = model_of("remus100")


def astray(*_, **__):
    raise ModelError(NOT_LINEARISABLE)


def singular(*_, **__):
    raise np.linalg.LinAlgError("Matrix is not positive definite")


def test_a_step_that_fails_leaves_its_default_and_a_sentence():
    told = []
    assert attempt("no map", astray, 7, told) == 7
    assert attempt("no root", singular, None, told) is None
    assert attempt("sum", lambda: 1 + 1, 0, told) == 2
    assert told[0] == f"no map: {NOT_LINEARISABLE}"
    assert told[1] == "no root: Matrix is not positive definite" and len(told) == 2


def test_a_fault_of_the_program_is_called_one():
    told = []
    assert attempt("no key", lambda: {}["x"], (), told) == ()
    assert told == ["no key: unexpected KeyError: 'x' (a fault of bayesid, not of the data)"]


def test_a_stop_by_the_user_is_not_swallowed():
    def stopped():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt("no map", stopped, 7, [])


@pytest.mark.thorough
@pytest.mark.usefixtures("without_pictures")
def test_every_step_after_the_verdict_may_fail(tmp_path, monkeypatch, capsys):
    """The worst case through the command line: draws, hold-out, next run and model all leave the model."""
    truth = other_vehicle(MODEL, 5) | {"ocean_current.V_north": 0.05 * MODEL.scales["U"]}
    trial = planted_trial(MODEL, truth, 5)
    again = replace(planted_trial(MODEL, truth, 6).run("turn"), name="later", role="holdout")
    write_trial(replace(trial, vehicle_ref="remus100", runs=(*trial.runs, again)), tmp_path / "trial")
    for module, name, fails in (
        (run, "validate_holdout", singular),
        (run, "propose", astray),
        (run, "sample_effect", astray),
        (diagnosed_model, "fit", astray),
        (diagnosed_model, "posterior", astray),
    ):
        monkeypatch.setattr(module, name, fails)
    out = tmp_path / "out"
    assert command.diagnose(tmp_path / "trial", out=out) == 0
    record = json.loads((out / "diagnosis.json").read_text())
    assert [e["name"] for e in record["effects"]] == ["ocean_current"]
    text = " ".join(record["warnings"])
    for step in ("held-out runs", "next manoeuvre", "posterior of ocean_current", "diagnosed model"):
        assert step in text
    assert text.count(NOT_LINEARISABLE) == 3 and not (out / "model.json").exists()
    assert f"verdict: {record['verdict']}" in capsys.readouterr().out
    assert "ocean current" in (out / "report.md").read_text()
