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
from bayesid.trials import load_trial
from bayesid.trials.write import file_names, file_stem
from bayesid.words import did_you_mean, digits


def fit_that_moved(start, value, sd):
    fit = SimpleNamespace(
        n_params=1, names=("N_r",), start=np.array([start]), z=np.array([value]), sd=np.array([sd])
    )
    return SimpleNamespace(fit=fit)


@pytest.mark.parametrize(
    ("change", "sd", "words"),
    [
        (-3.412, 2.2, "N_r -341 ± 220 %"),
        (15.0, 9.96, "N_r +1500 ± 1000 %"),
        (0.903, 0.074, "N_r +90.3 ± 7.4 %"),
        (-1e-10, 1e-9, "N_r 0 ± less than 0.01 %"),
        (0.5, 11.0, "N_r +50 % (not determined)"),
    ],
)
def test_how_far_a_coefficient_moves_is_written_out(change, sd, words):
    assert moved(fit_that_moved(2.0, 2.0 * (1.0 + change), 2.0 * sd)) == words


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
