"""What a person reads of a fit: numbers without powers of ten, names of any script, tracks not covered."""

from __future__ import annotations

import io
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.cli.main import run
from bayesid.errors import FitError
from bayesid.progress import Progress
from bayesid.report.fit_figures import overlay
from bayesid.report.fit_first_screen import moved
from bayesid.report.prediction_error import (
    NO_FIT,
    fit_percent,
    no_fit_note,
    prediction_numbers,
    prediction_rows,
)
from bayesid.report.writer.text import table_text
from bayesid.trials import load_trial
from bayesid.trials.write import file_names, file_stem
from bayesid.words import did_you_mean, digits


def fit_that_moved(changes, sds):
    names = tuple(f"N_{i}" for i in range(len(changes)))
    start, change, sd = np.full(len(names), 2.0), np.array(changes), np.array(sds)
    return SimpleNamespace(fit=fit_of(names, start, start * (1 + change), start * sd))


def fit_of(names, start, z, sd):
    values = {"start": np.array(start), "z": np.array(z), "sd": np.array(sd)}
    return SimpleNamespace(n_params=len(names), names=names, uncertainty={}, **values)


@pytest.mark.parametrize(
    ("change", "sd", "words"),
    [
        (-3.412, 1.5, "N_0 -341 ± 150 %."),
        (25.0, 9.96, "N_0 +2500 ± 1000 %."),
        (0.903, 0.074, "N_0 +90.3 ± 7.4 %."),
        (0.5, 0.0, "N_0 +50 ± less than 0.01 %."),
    ],
)
def test_how_far_a_coefficient_moves_is_written_out(change, sd, words):
    assert moved(fit_that_moved([change], [sd])) == f"Moved, the surest first (with one sd): {words}"


@pytest.mark.parametrize(("change", "sd"), [(0.5, 0.26), (0.5, np.inf), (-1e-10, 1e-12), (0.0, 0.0)])
def test_what_moves_by_less_than_is_known_is_not_told(change, sd):
    assert (
        moved(fit_that_moved([change], [sd])) == "No coefficient moved by more than two standard deviations."
    )


def test_the_surest_move_comes_first_and_not_the_largest():
    told = moved(fit_that_moved([5.0, 0.1, -0.3, 0.0], [2.0, 0.002, 0.1, 0.1]))
    assert "N_1 +10 ± 0.2 %, N_2 -30 ± 10 %, N_0 +500 ± 200 %; no other of 4 by more than two sd." in told
    six = moved(fit_that_moved([0.1 * k for k in range(1, 7)], [0.01] * 6))
    assert six.index("N_5") < six.index("N_2") and six.endswith(", and 2 more.") and "N_1" not in six
    assert moved(fit_that_moved([], [])) == ""


def test_a_coefficient_that_was_nought_is_told_by_its_value():
    told = moved(SimpleNamespace(fit=fit_of(("Y_0", "N_r"), [0.0, -2.0], [5.0, -2.1], [0.1, 1.0])))
    first = "Moved, the surest first (with one sd): "
    assert told == f"{first}Y_0 from 0 to 5 ± 0.1; no other of 2 by more than two sd."
    told = moved(SimpleNamespace(fit=fit_of(("N_r",), [-2.0], [-2.5], [0.1])))
    assert told == f"{first}N_r +25 ± 5 %."


def test_digits_write_out_what_is_large():
    told = [digits(x, 2) for x in (220.0, 1549.0, 0.031, 7.0, 1e-9, 3e8)]
    assert told == ["220", "1500", "0.031", "7", "1e-09", "3e+08"]


def test_a_coefficient_given_without_its_bars_is_found():
    there = ("N_r", "N_r|r|", "N_v|r|", "Y_v")
    assert did_you_mean(["N_rr"], there) == "; did you mean N_r|r|?"
    assert did_you_mean(["n_vr"], there) == "; did you mean N_v|r|?"
    assert did_you_mean(["N_q"], there) == "; did you mean N_r?"


def test_what_is_refused_is_not_told_as_stopped_first(tmp_path, capsys):
    log = io.StringIO()
    with pytest.raises(FitError), Progress(stream=log).stage("fit"):
        raise FitError("no such parameter")
    assert log.getvalue() == ""
    with pytest.raises(FitError), Progress(stream=log).stage("fit") as stage:
        stage.step()
        raise FitError("diverged")
    assert "stopped 1 in" in log.getvalue()
    pond = str(tmp_path / "pond")
    assert run(["simulate", "remus100", "turn:10,duration=20", "--dt", "1", "--out", pond]) == 0
    capsys.readouterr()
    assert run(["fit", pond, "--free", "N_rr"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "did you mean N_r|r|? (a shell wants quotes around the bars)" in told


def test_names_of_any_script_stay_readable_in_files():
    assert file_names(["Übung Kiel", "試験航走", "übung kiel", "a/b", "..."]) == [
        "Übung_Kiel.csv", "試験航走.csv", "übung_kiel_2.csv", "a_b.csv", "run.csv",
    ]  # fmt: skip
    assert file_stem("Ma\u0308rz") == "März"  # as a file system may take it apart
    assert len(file_stem("航" * 200).encode()) <= 200


@pytest.mark.filterwarnings("default:Glyph")
@pytest.mark.parametrize("name", ["Übung Kiel März", "試験航走"])
def test_a_log_with_letters_of_another_script_is_imported_under_its_name(tmp_path, name, capsys):
    t = np.arange(0.0, 60.0, 0.5)
    track = zip(t, t, np.sin(t / 5), np.degrees(np.cos(t / 5) / 5), 10 * np.sign(np.sin(t / 5)), strict=True)
    rows = "".join(",".join(f"{float(x)!r}" for x in row) + "\n" for row in track)
    log, out = tmp_path / f"{name}.csv", tmp_path / "bundle"
    log.write_text(f"t [s],x [m],y [m],yaw [deg],rudder [deg]\n{rows}", encoding="utf-8")
    line = ["trial", "import", str(log), "--out", str(out), "--vehicle", "remus100"]
    if run(line) == 3:
        text = (out / "map.toml").read_text(encoding="utf-8")
        tomllib.loads(text)
        head, _, rest = text.partition("questions = [")
        (out / "map.toml").write_text(head + rest.partition("\n]\n")[2], encoding="utf-8")
        assert run([*line[:-2], "--map", str(out / "map.toml")]) == 0
    assert [r.name for r in load_trial(out).runs] == [name.replace(" ", "_")]
    assert "Glyph" not in capsys.readouterr().err


def test_the_legend_of_a_track_lies_above_it():
    t = np.linspace(0.0, 100.0, 200)
    states = np.stack([np.sin(t / 10), np.cos(t / 10), t / 10], axis=1)
    figure = overlay(t, ("x", "y", "psi"), states, states, states)
    figure.canvas.draw()
    plans = [axes for axes in figure.axes if axes.get_legend() is not None]
    assert plans
    for axes in plans:
        assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0


def an_outcome(depth, sigma=0.02):
    """A run of which depth and heading are read; the depth is missed by 1.9 m."""
    readings = np.column_stack([depth, np.linspace(0.0, 2.0, depth.size)])
    rms = np.array([1.9, 0.1])
    return SimpleNamespace(
        name="r7", manoeuvre="turn", role="holdout", channels=("z", "psi"), readings=readings,
        sigma=np.array([sigma, 0.01]), rms_nominal=rms, rms_fitted=rms, t=0.5 * np.arange(depth.size),
    )  # fmt: skip


def test_a_channel_that_moves_no_more_than_its_noise_has_a_dash_and_a_note_for_its_fit():
    """A depth that an autopilot held had a fit of -8282 %."""
    rng = np.random.default_rng(0)
    held = an_outcome(3.0 + 0.02 * rng.standard_normal(400))
    ((*_, of_depth), (*_, of_heading)) = prediction_rows([held])
    assert np.isnan(of_depth) and of_heading == pytest.approx(100.0 * (1.0 - 0.1 / (1.0 / 3**0.5)), rel=0.01)
    assert no_fit_note([held]) == NO_FIT and "–" in table_text("abcdefg", prediction_rows([held]))
    numbers = prediction_numbers([held])[0]["channels"]
    assert np.isnan(numbers["z"]["fit_percent"]) and numbers["z"]["rms_fitted"] == 1.9
    dives = an_outcome(np.linspace(3.0, 4.0, 400))  # control: missed by more than it moves, and it moves
    assert prediction_rows([dives])[0][-1] == pytest.approx(-558, abs=5) and no_fit_note([dives]) == ""
    # a noise that is not stated is the error of the model: it makes no channel still that moves
    badly = an_outcome(3.0 + np.sin(np.linspace(0.0, 12.0, 400)) + 0.02 * rng.standard_normal(400), sigma=1.9)
    assert prediction_rows([badly])[0][-1] == pytest.approx(-170, abs=10) and no_fit_note([badly]) == ""
    assert np.isnan(fit_percent(0.1, np.arange(9.0), np.ones(9), 0.0))
