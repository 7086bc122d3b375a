"""`bayesid export`: an ensemble of vehicles whose files, effects and seeds are the draws of the posterior."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.cli.main import run
from bayesid.diagnosis.diagnosed_file import read_diagnosed, write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import build_model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.model.vehicles import load_vehicle

MODEL = build_model(load_vehicle("lauv"), 3)
NAMES = ("N_v", "Y_v", "rudder_offset.offset")
MEAN = np.array([*MODEL.nominal[MODEL.positions(NAMES[:2])], 0.02])
SD = np.array([0.1, 0.2, 0.1]) * np.abs(MEAN)
SEA = NoiseModel((1.0, 2.0, 3.0), 5.0, 0.3, 60.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("model")
    covariance = np.diag(SD**2)
    covariance[0, 1] = covariance[1, 0] = 0.8 * SD[0] * SD[1]
    free = np.full(3, np.inf)
    one = WeightedHypothesis(("rudder_offset",), 1.0, NAMES, MEAN, covariance, -free, free, SEA)
    write_diagnosed(DiagnosedModel(MODEL, (one,), {"psi": 0.01}, "effect", "t"), out)
    return out


@pytest.mark.thorough
def test_vehicle_files_and_effects_are_draws_of_the_posterior(folder, tmp_path):
    found = bayesid.export(folder, tmp_path, 400, seed=3)
    record = json.loads((tmp_path / "ensemble.json").read_text(encoding="utf-8"))
    assert record["members"] == json.loads(json.dumps(found.numbers["members"]))
    values = []
    for member in record["members"]:
        model = build_model(load_vehicle(tmp_path / member["vehicle"]), 3)
        values.append([*model.nominal[model.positions(NAMES[:2])], member["effects"][NAMES[2]]])
        untouched = [n for n in model.coefficients if n not in NAMES]
        np.testing.assert_allclose(
            model.nominal[model.positions(untouched)], MODEL.nominal[MODEL.positions(untouched)], rtol=1e-6
        )
    z = (np.array(values) - MEAN) / SD
    assert np.abs(z.mean(axis=0)).max() < 4 / np.sqrt(400)
    assert np.abs(z.std(axis=0) - 1).max() < 4 / np.sqrt(800)
    assert abs(np.corrcoef(z[:, 0], z[:, 1])[0, 1] - 0.8) < 0.1
    assert sum(m["weight"] for m in record["members"]) == pytest.approx(1.0)
    assert len({m["disturbance"]["seed"] for m in record["members"]}) == 400
    assert record["members"][0]["disturbance"]["force_sd"] == {"X": 1.0, "Y": 2.0, "N": 3.0}


def test_the_estimate_is_a_vehicle_file_of_its_own(folder, tmp_path):
    bayesid.export(folder, tmp_path, 2)
    model = build_model(load_vehicle(tmp_path / "vehicle_estimate.toml"), 3)
    np.testing.assert_allclose(model.nominal[model.positions(NAMES[:2])], MEAN[:2], rtol=1e-6)
    untouched = [n for n in model.coefficients if n not in NAMES]
    np.testing.assert_allclose(
        model.nominal[model.positions(untouched)], MODEL.nominal[MODEL.positions(untouched)], rtol=1e-6
    )
    record = json.loads((tmp_path / "ensemble.json").read_text(encoding="utf-8"))
    assert record["estimate"]["vehicle"] == "vehicle_estimate.toml"
    assert record["estimate"]["effects"] == {NAMES[2]: pytest.approx(0.02)}


def test_a_seed_gives_the_same_ensemble_and_another_one_another(folder, tmp_path):
    one, same, other = (
        bayesid.export(folder, tmp_path / name, 5, seed=seed).numbers["members"]
        for name, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert one == same != other


def test_checks_that_the_model_failed_go_with_its_ensemble(folder, tmp_path, capsys):
    made = read_diagnosed(folder)
    write_diagnosed(replace(made, failed_checks=("The runs disagree.",)), tmp_path / "failed")
    assert run(["export", str(tmp_path / "failed"), "--draws", "2", "--out", str(tmp_path / "e")]) == 3
    assert "CHECK FAILED: The runs disagree." in capsys.readouterr().out
    record = json.loads((tmp_path / "e" / "ensemble.json").read_text(encoding="utf-8"))
    assert record["failed_checks"] == ["The runs disagree."]
    assert "CHECK FAILED" not in bayesid.export(folder, tmp_path / "f", 2).summary()


def test_the_command_writes_the_ensemble_and_refuses_a_folder_without_a_model(folder, tmp_path, capsys):
    assert run(["export", str(folder), "--draws", "3", "--out", str(tmp_path / "e")]) == 0
    assert "3 vehicles of equal weight, effects rudder_offset" in capsys.readouterr().out
    assert sorted(p.name for p in (tmp_path / "e").iterdir()) == [
        "ensemble.json", "vehicle.schema.json", "vehicle_1.toml", "vehicle_2.toml", "vehicle_3.toml",
        "vehicle_estimate.toml",
    ]  # fmt: skip
    assert run(["export", str(tmp_path), "--out", str(tmp_path / "f")]) == 2
    assert "bayesid fit" in capsys.readouterr().err
    with pytest.raises(ModelError, match="1 to 10000"):
        bayesid.export(folder, tmp_path / "g", 0)


def test_a_fit_takes_away_the_model_of_the_fit_before_and_leaves_that_of_a_diagnosis(folder, tmp_path):
    from bayesid.diagnosis.diagnosed_file import read_diagnosed, remove_fitted

    found = read_diagnosed(folder)
    for word, stays in (("fit", False), ("effect", True)):
        out = tmp_path / word
        out.mkdir()
        write_diagnosed(DiagnosedModel(MODEL, found.hypotheses, found.noise, word, "t"), out)
        remove_fitted(out)
        assert (out / "model.json").exists() == stays
    remove_fitted(tmp_path)  # nothing there
