"""`bayesid diagnose` as a user runs it: draws of the named effect, and every file it promises."""

import importlib
import json
from types import SimpleNamespace

import pytest
from diagnosis_results import a_result
from gap_trials import model_of, planted_trial
from jsonschema import validate

from bayesid.api.diagnose import DiagnoseResult
from bayesid.cli.main import run
from bayesid.diagnosis.result import schema
from bayesid.estimation.sampling import load_posterior
from bayesid.trials import write_trial


@pytest.mark.thorough
def test_a_diagnosis_with_draws_holds_the_planted_current_and_writes_its_posterior(tmp_path, capsys):
    # the only test that takes a whole diagnosis through arviz; other effects are left out to save time
    model, current = model_of("generic_sub"), 0.5  # m/s northward, a tenth of the speed
    write_trial(planted_trial(model, {"ocean_current.V_north": current}, 1, samples=40), tmp_path / "pond")
    others = ",".join(name for name in model.effects if name != "ocean_current")
    line = ["diagnose", str(tmp_path / "pond"), "--vehicle", "generic_sub", "--prior", "0.02"]
    assert run([*line, "--exclude", others, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "verdict: effect" in said
    assert f"`bayesid predict {tmp_path / 'pond'} " in said and f"--model {tmp_path / 'out'}`" in said
    assert "BUNDLE" not in said + (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    record = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert record["posterior"]["converged"], record["posterior"]["reasons"]
    posterior = load_posterior(tmp_path / "out" / "posterior.nc")
    i = posterior.names.index("ocean_current.V_north")
    assert abs(posterior.mean[i] - current) < 4 * posterior.sd[i]
    assert posterior.convergence.ess_tail.min() >= 400
    validate(record, schema())
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert written >= {"diagnosis.json", "model.json", "posterior.nc", "report.html", "report.md"}


@pytest.mark.parametrize(("agree", "code"), [(0.2, 0), (1e-6, 3)])
def test_a_script_learns_by_the_exit_code_that_a_check_failed(monkeypatch, capsys, agree, code):
    """Runs that disagree about the size of what is named are a check that fails."""
    found = DiagnoseResult(SimpleNamespace(result=a_result(runs_agree=agree)))
    monkeypatch.setattr(importlib.import_module("bayesid.api.diagnose"), "diagnose", lambda *_, **__: found)
    assert run(["diagnose", "example"]) == code
    assert ("CHECK FAILED: The runs disagree" in capsys.readouterr().out) == (code == 3)
