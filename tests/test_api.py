"""The verbs for Python: tables in memory become a trial, results sum themselves up, draw and save."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas
import pytest

from bayesid.api.design import design
from bayesid.api.diagnose import diagnose
from bayesid.api.excite import excite
from bayesid.api.fit import fit
from bayesid.api.identify import identify
from bayesid.api.predict import predict
from bayesid.api.simulate import simulate
from bayesid.diagnosis.answer import answer
from bayesid.errors import BayesidError, FitError, ManoeuvreError, ModelError, TrialError
from bayesid.trials import Trial, load_trial, write_trial

ROOT = Path(__file__).parents[1]

NOISE = {"x": 0.2, "y": 0.2, "psi": 0.005, "u": 0.02, "v": 0.02, "r": 0.0005}


@pytest.fixture(scope="module")
def sailed() -> Trial:
    return simulate(
        "generic_sub", "zigzag:20/20", "zigzag:10/10", dt=2.0, change={"N_dr": -0.0045}, noise=NOISE, seed=1
    )


@pytest.fixture(scope="module")
def diagnosed():
    """The bundled example, diagnosed once."""
    return diagnose(load_trial("example"), next_manoeuvre=False)


def frames_of(trial: Trial, factor: float = 1.0) -> dict[str, pandas.DataFrame]:
    """Tables as a user would have them: degrees, starboard-positive rudder, own names."""
    deg = 180 / np.pi
    return {
        run.name: pandas.DataFrame({
            "Time": run.t, "x[m]": run.data["x"], "y[m]": run.data["y"], "psi[deg]": deg * run.data["psi"],
            "r[deg/s]": deg * run.data["r"], "u[m/s]": run.data["u"], "v[m/s]": run.data["v"],
            "rudder": -deg * run.commands["delta_r_cmd"], "n_cmd[rpm]": factor * run.commands["n_cmd"],
        })
        for run in trial.runs
    }  # fmt: skip


STATED = {
    "columns": {"t[s]": "Time", "delta_r_cmd[deg]": "rudder"},
    "noise": {"x": 0.2, "y": 0.2, "psi[deg]": np.degrees(0.005)},
    "rudder_positive": "starboard",
}


def test_frames_and_files_give_the_same_trial(sailed, tmp_path):
    read = load_trial(write_trial(sailed, tmp_path / "bundle").parent)
    made = Trial.from_frames(frames_of(sailed), "generic_sub", **STATED)
    for ours, theirs in zip(made.runs, read.runs, strict=True):
        for group in ("data", "commands"):
            assert set(getattr(ours, group)) == set(getattr(theirs, group))
            for name, values in getattr(ours, group).items():
                # degrees there and back: two roundings
                np.testing.assert_allclose(values, getattr(theirs, group)[name], rtol=1e-12, atol=1e-15)
    assert made.noise["psi"] == pytest.approx(0.005)


def test_dicts_of_arrays_do_as_well_as_frames(sailed):
    frames = {name: {c: f[c].to_numpy() for c in f} for name, f in frames_of(sailed).items()}
    assert Trial.from_frames(frames, "generic_sub", **STATED).runs[0].n_samples == sailed.runs[0].n_samples


def test_all_problems_of_frames_are_told_at_once(sailed):
    frames = frames_of(sailed)
    first, second = frames
    frames[first] = frames[first].drop(columns="rudder")
    frames[second] = frames[second].assign(**{"x[m]": "north"})
    with pytest.raises(TrialError) as told:
        Trial.from_frames(frames, "generic_sub", **STATED, holdout="run9")
    for part in (first, "rudder angle", second, "'north'", "run9"):
        assert part in str(told.value)


@pytest.mark.parametrize(
    ("frames", "why"),
    [
        ({}, "mapping of run names"),
        ({"a": [1, 2]}, "is list"),
        ({"a": {"t[s]": [0.0, 1.0], "x[m]": [0.0]}}, "1 to 2 samples"),
        ({"a": {"t[s]": []}}, "no samples"),
        ({"a": pandas.DataFrame({"t[s]": pandas.date_range("2026", periods=3)})}, "dates"),
    ],
)
def test_what_is_no_table_is_refused_in_words(frames, why):
    with pytest.raises(TrialError, match=why):
        Trial.from_frames(frames, "generic_sub")


def test_a_fit_from_frames_finds_the_planted_rudder(sailed):
    trial = Trial.from_frames(frames_of(sailed), "generic_sub", **STATED, holdout=["02_zigzag_10_10"])
    found = fit(trial, free="N_v,N_r,N_dr,Y_v,Y_r,Y_dr")
    row = found.to_dataframe().loc["N_dr"]
    assert abs(row["prime"] + 0.0045) < 4 * abs(row["prime"]) * row["sd [%]"] / 100
    assert found.success
    assert "02_zigzag_10_10" in found.summary()
    assert "N_dr" in found._repr_html_()
    assert found.figures()
    assert found.plot("estimates").axes


@pytest.mark.thorough
def test_results_save_what_they_plot(sailed, tmp_path):
    found = excite(sailed, "generic_sub", quick=True)
    assert found.save(tmp_path).read_text(encoding="utf-8").startswith("<!doctype html>")
    assert (tmp_path / "excitation.json").exists()
    for name in found.figures():
        assert (tmp_path / "figures" / f"{name}.png").exists()
    with pytest.raises(BayesidError, match="no figure"):
        found.plot("no such figure")


def test_identify_says_what_two_zigzags_leave_open(sailed):
    found = identify(sailed, "generic_sub", profile=False, quick=True)
    assert "Left open" in found.summary()
    assert len(found.to_dataframe()) == len(found.found.names)


@pytest.mark.thorough
def test_the_documentation_quotes_what_a_diagnosis_of_the_example_says(diagnosed):
    said = answer(diagnosed.found.result)
    for page in ("README.md", "docs/guide/diagnosis.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert said.headline in text and said.outcome in text, page


def test_a_diagnosis_names_the_effect_planted_in_the_example(diagnosed):
    assert diagnosed.effects


def test_two_goals_of_a_design_are_refused():
    with pytest.raises(FitError, match="one goal at a time"):
        design("generic_sub", gain=True, predict="turn:20")


def test_no_manoeuvre_of_the_rudder_is_designed_for_a_vehicle_without_one():
    with pytest.raises(ManoeuvreError, match="no rudder"):
        design("differential_boat", quick=True)


@pytest.mark.usefixtures("without_pictures")
def test_a_name_that_was_not_predicted_is_refused(diagnosed, tmp_path):
    diagnosed.save(tmp_path)
    p = predict("example", ["turn:10"], model=tmp_path, draws=20, dt=1.0)
    assert "turn:10" in p.summary()
    low, high = p["turn:10"].band()
    assert (low <= high).all()
    assert p.plot().axes
    with pytest.raises(ModelError, match=r"turn:10"):
        p["turn:15"]
