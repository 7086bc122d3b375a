"""Studies and packs diagnose a log as `bayesid diagnose` reads it, with dense readings averaged."""

from dataclasses import replace

import numpy as np
import pytest

import bayesid
from bayesid.benchmark.protocol import solve_pack
from bayesid.benchmark.protocol.commitment import digest_of_folder
from bayesid.diagnosis.input import as_read, checked_and_read
from bayesid.equations.model import build_model
from bayesid.errors import ModelError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import load_trial, write_trial
from bayesid.trials.correction import Correction
from bayesid.trials.mistakes.finding import InputCheck, InputFinding
from studies.other_equations import verdicts

NOISE = {"x": 0.1, "y": 0.1, "psi": 0.003, "u": 0.02, "v": 0.02, "r": 0.003}


class _Stopped(ModelError):
    pass


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    trial = bayesid.simulate("remus100", "zigzag:10/10,duration=120", dt=0.05, noise=NOISE)
    assert trial.identify[0].n_samples > 1000
    return write_trial(replace(trial, vehicle_ref="remus100"), tmp_path_factory.mktemp("read") / "b")


def test_a_diagnosis_a_pack_and_a_study_read_the_same(bundle, tmp_path, monkeypatch):
    seen = []

    def diagnose(trial, model, **_):
        seen.append(trial)
        raise _Stopped("stopped")

    for place in ("bayesid.api.diagnose.run", "bayesid.diagnosis.of_log.diagnose"):
        monkeypatch.setattr(place, diagnose)
    with pytest.raises(_Stopped):
        bayesid.diagnose(bundle)
    verdicts._keep(tmp_path, "code", 0, bundle)
    settings = solve_pack.SolveSettings()
    now = {"code": "code"}
    solve_pack._solve_one((bundle, tmp_path / "pack", digest_of_folder(bundle), settings, now))
    logged, (user, study, pack) = load_trial(bundle), seen
    assert user.identify[0].n_samples < 0.6 * logged.identify[0].n_samples
    for other in (study, pack):
        for a, b in zip(user.runs, other.runs, strict=True):
            np.testing.assert_array_equal(a.t, b.t)
            for name in a.data:
                np.testing.assert_array_equal(a.data[name], b.data[name])
        assert user.noise == other.noise


def test_averages_know_the_noise_of_the_single_readings(bundle):
    logged = load_trial(bundle)
    read = as_read(logged, build_model(load_vehicle("remus100"), 3))
    assert read.noise["psi"] < 0.7 * logged.noise["psi"]
    assert read.of_single_readings({"psi": 2 * read.noise["psi"], "z": 0.5}) == pytest.approx({
        "psi": 2 * logged.noise["psi"], "z": 0.5,
    })  # fmt: skip
    assert logged.of_single_readings(logged.noise) == dict(logged.noise)


@pytest.mark.thorough
def test_bands_of_a_dense_log_hold_its_single_readings(tmp_path):
    orders = ("zigzag:10/10,duration=60", "turn:8,duration=60", "zigzag:5/5,duration=60")
    trial = bayesid.simulate("remus100", *orders, dt=0.05, noise=NOISE, seed=4, holdout=orders[2])
    found = bayesid.diagnose(replace(trial, vehicle_ref="remus100"), next_manoeuvre=False)
    assert found.found.trial.noise["psi"] < 0.7 * NOISE["psi"]
    found.save(tmp_path / "gap")
    (held,) = trial.holdout
    told = bayesid.predict(trial, held.name, model=tmp_path / "gap", draws=100).record()
    assert min(check["inside"] for check in told["band_checks"].values()) > 0.9
    assert not [text for text in told["failed_checks"] if "too narrow" in text or "names no cause" in text]


def test_a_mistake_that_one_of_the_simulator_explains_is_left_to_the_diagnosis(bundle, monkeypatch):
    logged, model = load_trial(bundle), build_model(load_vehicle("remus100"), 3)
    mistake = InputFinding(
        "sign of psi", "psi has the opposite sign", ("psi",), (logged.runs[0].name,), True, 1.0, (), 1.0, 0.0,
        Correction(scale={"psi": -1.0}),
    )  # fmt: skip
    for found, sign in ((mistake, -1.0), (replace(mistake, instead=("sign of N_v",)), 1.0)):
        stub = InputCheck(findings=(found,))
        monkeypatch.setattr("bayesid.diagnosis.input.reading.check_trial", lambda *_, stub=stub: stub)
        read, checked = checked_and_read(logged, model)
        assert checked is stub
        np.testing.assert_allclose(
            read.runs[0].data["psi"], sign * as_read(logged, model).runs[0].data["psi"], atol=1e-12
        )
