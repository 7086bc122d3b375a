"""[corrections] of an import: of its map, or written by hand into its trial.toml, and never lost unsaid."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from bayesid.cli.main import run
from bayesid.trials import load_trial
from bayesid.trials.correction import Correction
from bayesid.trials.importing import map_text, propose, read_map
from bayesid.trials.importing.raw import ImportLogError

MAP = """format = 1
[sources.log]
files = ["log.csv"]
time = "t [s]"
clock = "relative"
[channels]
north = { from = "north [m]", unit = "m" }
east = { from = "east [m]", unit = "m" }
heading = { from = "heading [deg]", unit = "deg" }
delta_r_cmd = { from = "rudder order [deg]", unit = "deg" }
wind_speed = { from = "AWS [m/s]", unit = "m/s" }
wind_from = { from = "AWA [deg]", unit = "deg" }
"""
APPARENT = '[corrections]\nwind = "apparent"\n'


@pytest.fixture
def log(tmp_path):
    """A table whose wind is the way of the vehicle at 2 m/s: apparent from ahead, in still air."""
    t = np.arange(0.0, 60.0, 0.5)
    psi = 0.4 * np.sin(0.2 * t)
    track = np.cumsum(2.0 * 0.5 * np.stack([np.cos(psi), np.sin(psi)]), axis=1)
    order = 6.0 * np.sign(np.cos(0.2 * t))
    columns = (t, *track, np.degrees(psi), order, 2.0 + 0.0 * t, 0.0 * t)
    head = "t [s],north [m],east [m],heading [deg],rudder order [deg],AWS [m/s],AWA [deg]\n"
    path = tmp_path / "log.csv"
    rows = zip(*columns, strict=True)
    path.write_text(head + "".join(",".join(f"{x:.5f}" for x in row) + "\n" for row in rows))
    return path


def imported(log, text, out):
    out.mkdir(exist_ok=True)
    (out / "map.toml").write_text(text)
    return run(["trial", "import", str(log), "--map", str(out / "map.toml"), "--out", str(out)])


def wind(out):
    return float(np.nanmax(load_trial(out).runs[0].exogenous["wind_speed"]))


def lines(path):
    return tomllib.loads(path.read_text()).get("corrections")


def test_the_corrections_of_a_map_are_those_of_the_bundle(log, tmp_path):
    for text, most in ((MAP, 2.0), (MAP + APPARENT, 0.3)):
        out = tmp_path / f"b{len(text)}"
        assert imported(log, text, out) == 0
        assert lines(out / "trial.toml") == ({"wind": "apparent"} if most < 2.0 else None)
        assert wind(out) == pytest.approx(most, abs=1e-6) if most == 2.0 else wind(out) < most


def test_what_a_map_corrects_is_checked_and_written_as_it_was_read(tmp_path):
    path = tmp_path / "map.toml"
    table = 'wind = "apparent"\nscale = { psi = -1.0 }\nruns = ["log"]\n'
    path.write_text(f"{MAP}[corrections]\n{table}")
    found = read_map(path)
    assert found.corrections == Correction(wind="apparent", scale={"psi": -1.0}, runs=("log",))
    path.write_text(map_text(found))
    assert read_map(path).corrections == found.corrections
    assert "wind read on board (apparent)" in path.read_text() and "true wind speed" not in path.read_text()
    path.write_text(MAP + '[corrections]\nwinds = "apparent"\nscale = { q_heading = 2 }\n')
    with pytest.raises(ImportLogError) as error:
        read_map(path)
    assert "'winds' is not known; one of drop" in str(error.value) and "'q_heading' is no" in str(error.value)
    assert read_map_without(path).corrections is None


def read_map_without(path):
    path.write_text(MAP)
    return read_map(path)


def test_corrections_by_hand_outlive_an_import_again_and_it_says_so(log, tmp_path, capsys):
    out = tmp_path / "bundle"
    assert imported(log, MAP, out) == 0
    trial = out / "trial.toml"
    trial.write_text(trial.read_text().replace("[[runs]]", APPARENT + "\n[[runs]]"))
    capsys.readouterr()
    for _ in range(2):  # the second time trial.toml is as the import wrote it
        assert imported(log, MAP + "[noise]\npsi = 0.01\n", out) == 0
        assert 'keeps the [corrections] it had, wind = "apparent"' in capsys.readouterr().out
        assert lines(trial) == {"wind": "apparent"} and wind(out) < 0.3
    assert imported(log, f"{MAP}[corrections]\n", out) == 0
    assert 'no more those it had, wind = "apparent"' in capsys.readouterr().out
    assert lines(trial) is None


def test_where_corrections_by_hand_no_longer_fit_the_way_out_is_told(log, tmp_path, capsys):
    out = tmp_path / "bundle"
    assert imported(log, MAP, out) == 0
    trial = out / "trial.toml"
    trial.write_text(trial.read_text().replace("[[runs]]", APPARENT + "\n[[runs]]"))
    mine = trial.read_bytes()
    turns = MAP.replace("heading = ", "r = ").replace('unit = "deg" }\ndelta', 'unit = "deg/s" }\ndelta')
    for more, code in (("", 2), ("[corrections]\n", 0)):
        capsys.readouterr()
        assert imported(log, turns + more, out) == code
        said = capsys.readouterr().err
        assert ("needs the heading" in said and "an empty table [corrections] in the map" in said) is (
            code == 2
        )
        assert (trial.read_bytes() == mine) is (code == 2)


def test_corrections_taken_out_of_the_map_leave_the_bundle(log, tmp_path, capsys):
    out = tmp_path / "bundle"
    assert imported(log, MAP + APPARENT, out) == 0
    capsys.readouterr()
    assert imported(log, MAP, out) == 0
    assert lines(out / "trial.toml") is None and "it had" not in capsys.readouterr().out


def test_a_wind_called_apparent_is_proposed_as_such_and_asked_about(log, tmp_path, capsys):
    found = propose([log])
    (asked,) = [text for text in found.map.questions if text.startswith("wind")]
    assert found.map.corrections == Correction(wind="apparent")
    assert 'made the true one by `[corrections]` `wind = "apparent"` of the map' in asked
    alone = tmp_path / "alone.csv"
    rows = [row.split(",") for row in log.read_text().splitlines()]
    alone.write_text("\n".join(",".join([row[0], *row[4:]]) for row in rows) + "\n")  # without a heading
    unknown = propose([alone])
    (asked,) = [text for text in unknown.map.questions if text.startswith("wind")]
    assert unknown.map.corrections is None and "read as the true one; else write" in asked


def test_a_trial_in_place_has_the_corrections_of_its_map(log, capsys):
    (log.parent / "map.toml").write_text(MAP + APPARENT)
    order = ["trial", "init", str(log), "--map", str(log.parent / "map.toml")]
    assert run(order) == 0
    assert lines(log.parent / "trial.toml") == {"wind": "apparent"} and wind(log.parent) < 0.3
    (log.parent / "trial.toml").unlink()
    times = '[corrections]\nleave_out = [{ run = "log", channels = ["psi"], from = 3, to = 6 }]\n'
    (log.parent / "map.toml").write_text(MAP + times)
    capsys.readouterr()
    assert run(order) == 2
    assert "[corrections] name times" in capsys.readouterr().err
