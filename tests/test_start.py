"""`bayesid start`: from a folder of raw logs to a diagnosis, asking only what files cannot tell."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from bayesid.api.outlook import outlook
from bayesid.cli.main import run as bayesid
from bayesid.trials import Run, Trial, load_trial
from bayesid.trials.importing import read_map
from bayesid.trials.importing.finding import look_into
from tests.raw_logs import motion

# the picture of an import is rendered in test_trial_import
pytestmark = pytest.mark.usefixtures("without_pictures")

DEG = np.pi / 180.0
LAT, LON = 41.18, -8.70


def raw_log(path, truth, seed=1, **also):
    """A recorder's CSV: UTC, latitude and longitude, degrees, knots, rudder positive to starboard."""
    rng = np.random.default_rng(seed)
    begin = datetime(2026, 6, 3, 9, 30, tzinfo=UTC)
    rows = []
    for k, t in enumerate(truth["t"]):
        when = (begin + timedelta(seconds=float(t))).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]
        north, east = truth["x"][k] + 0.2 * rng.normal(), truth["y"][k] + 0.2 * rng.normal()
        cells = [
            when,
            f"{LAT + north / 111050.0:.7f}",
            f"{LON + east / (111320.0 * np.cos(LAT * DEG)):.7f}",
            f"{np.mod(truth['psi'][k] / DEG + 0.4 * rng.normal(), 360.0):.2f}",
            f"{truth['r'][k] / DEG + 0.1 * rng.normal():.3f}",
            f"{-truth['delta_r_cmd'][k] / DEG:.2f}",
            f"{truth['n_cmd'][k]:.0f}",
        ]
        rows.append(",".join([*cells, *(str(v) for v in also.values())]))
    head = "Timestamp UTC,GPS_Latitude,GPS_Longitude,Heading (deg),Yaw rate (deg/s),Rudder setpoint (deg)"
    head += ",RPM cmd"
    path.write_text(",".join([head, *also]) + "\n" + "\n".join(rows) + "\n")


@pytest.fixture
def dive(tmp_path):
    folder = tmp_path / "dive"
    folder.mkdir()
    # a straight run and two zig-zags: every run more is checked as long as these
    first = {k: v[:900] for k, v in motion(np.random.default_rng(4), dt=0.4).items()}
    raw_log(folder / "log.csv", first, **{"Battery (V)": 25.1})
    (folder / "README.txt").write_text("Logs of 3 June.\nAsk Maria.\n")
    return folder


@pytest.fixture
def diagnosed(monkeypatch):
    """Bundles given to `diagnose`, which is not carried out."""
    given = []
    module = importlib.import_module("bayesid.cli.diagnose")
    monkeypatch.setattr(
        module, "diagnose", lambda bundle, **rest: given.append((bundle, rest["vehicle"])) or 0
    )
    return given


def test_a_folder_is_searched_for_all_it_needs(dive, tmp_path):
    (dive / "sheet.toml").write_text("length = 1\ndiameter = 0.1\nmass = 6\nspeed = 1\n")
    (dive / "bayesid").mkdir()
    (dive / "bayesid" / "run.csv").write_text("t,psi\n0,1\n1,2\n")
    found = look_into(dive, dive / "bayesid")
    assert [p.name for p in found.logs] == ["log.csv"]
    assert [p.name for p, _ in found.skipped] == ["README.txt"]
    assert found.sheet is not None
    assert found.vehicles == ()
    assert found.bundle is None


def test_without_a_vehicle_it_asks_and_stops(dive, capsys, diagnosed):
    assert bayesid(["start", str(dive), "--yes"]) == 3
    said = capsys.readouterr().out
    assert "which vehicle" in said
    assert "--template" in said and "of a ship: --template --ship" in said
    assert not diagnosed


def test_of_two_vehicle_files_it_asks_for_one_and_what_a_fit_wrote_is_none(dive, capsys, diagnosed):
    text = (files("bayesid.model.vehicles") / "builtin" / "remus100.toml").read_text()
    for name in ("boat.toml", "boat_old.toml"):
        (dive / name).write_text(text)
    assert bayesid(["start", str(dive), "--yes"]) == 3
    said = capsys.readouterr().out
    assert "boat.toml" in said and "boat_old.toml" in said and "--vehicle" in said and not diagnosed
    (dive / "boat_old.toml").unlink()
    (dive / "fit").mkdir()
    (dive / "fit" / "vehicle.toml").write_text(text)
    assert look_into(dive).vehicles == (dive / "boat.toml",)


@pytest.mark.thorough
def test_it_goes_from_the_log_to_the_diagnosis_and_keeps_the_commands(dive, capsys, diagnosed):
    assert bayesid(["start", str(dive), "--vehicle", "remus100", "--yes"]) == 0
    out = dive / "bayesid"
    assert diagnosed == [(out, None)]
    lines = [line for line in (out / "steps.sh").read_text().splitlines() if not line.startswith("#")]
    steps = [line.removesuffix(" || test $? -eq 4").rpartition(" || ")[2] for line in lines]
    assert [line.split()[1] for line in steps] == ["trial", "trial", "diagnose"]
    said = capsys.readouterr().out
    assert all(f"$ {line}" in said for line in steps)
    assert "README.txt is left out" in said
    trial = load_trial(out)
    assert trial.name == "dive"
    assert trial.rudder_positive == "starboard"
    assert bayesid(["start", str(dive), "--yes"]) == 0  # goes on where it stands: nothing is imported again
    assert len(diagnosed) == 2
    assert "trial import" not in capsys.readouterr().out


@pytest.mark.thorough
def test_it_says_before_it_begins_what_is_read_how_long_it_takes_and_what_it_is_judged_by(
    dive, capsys, diagnosed
):
    assert bayesid(["start", str(dive), "--vehicle", "remus100", "--yes", "--quick"]) == 0
    said = capsys.readouterr().out.partition("$ bayesid diagnose")[0]
    trial = load_trial(dive / "bayesid")
    assert f"{trial.holdout[0].name} is held out to judge by, as the last run that is not straight" in said
    count = sum(run.n_samples for run in trial.identify)
    assert f"The runs to identify hold {count} readings, 0.4 s apart: 2.2 per length travelled" in said
    assert "averaged" not in said and "on an idle machine" in said
    (held,) = trial.holdout
    assert f"{held.name} ({held.manoeuvre}) is held out" in said
    assert f'`role = "holdout"` or "identify" of the runs in {dive / "bayesid" / "trial.toml"}' in said
    # another run is held out by what was said
    path = dive / "bayesid" / "trial.toml"
    text = path.read_text().replace('role = "holdout"', 'role = "identify"')
    path.write_text(text.replace('role = "identify"', 'role = "holdout"', 1))
    assert bayesid(["start", str(dive), "--vehicle", "remus100", "--yes"]) == 0
    assert f"{trial.runs[0].name} ({trial.runs[0].manoeuvre}) is held out" in capsys.readouterr().out
    path.write_text(text)
    assert bayesid(["start", str(dive), "--vehicle", "remus100", "--yes"]) == 0
    assert "No run is held out" in capsys.readouterr().out


def test_a_fast_log_is_said_to_be_averaged_and_one_that_cannot_be_has_a_command_to_thin_it():
    trial = Trial("fast", Path("."), "nps_auv2", 3, (sailed("r1"), sailed("r2", role="holdout")), {})
    ahead = outlook(trial)
    assert ahead.readings == 12000 and ahead.used < 0.2 * 12000 and ahead.coarser is None
    assert f"averaged to {ahead.used}, {ahead.used_spacing:.3g} s apart" in ahead.sentences()[0]
    # orders that change with every reading are averaged as well
    assert outlook(replace(trial, runs=(sailed("r1", busy=True),))).used <= 1000
    # of runs read at two rates one noise does not hold: they keep every reading
    unlike = outlook(replace(trial, runs=(sailed("r1"), sailed("r2", every=2))))
    assert unlike.used == unlike.readings == 18000 and unlike.held_out == ()
    assert unlike.coarser == pytest.approx(0.1 * 5.3 / 1.8, rel=0.2)  # a tenth of length over speed
    assert unlike.seconds[0] > ahead.seconds[0] and ahead.seconds[1] > outlook(trial, quick=True).seconds[1]


def sailed(name, role="identify", busy=False, every=1):
    """12000 readings 0.02 s apart, with noise that nobody states, or every so many of them."""
    rng, t = np.random.default_rng(5), 0.02 * np.arange(12000)
    order = np.where(t < 100.0, 0.0, 0.1) + (0.01 * rng.standard_normal(t.size) if busy else 0.0)
    data = {
        "psi": 0.002 * t + 0.01 * rng.standard_normal(t.size),
        "u": 1.8 + 0.05 * rng.standard_normal(t.size),
    }
    data = {name: values[::every] for name, values in data.items()}
    return Run(name, "turn 6", role, t[::every], data, {"delta_r_cmd": order[::every]})


def test_a_data_sheet_beside_the_logs_becomes_the_vehicle(dive, diagnosed):
    (dive / "sheet.toml").write_text("length = 1.6\ndiameter = 0.19\nmass = 35\nspeed = 1.5\nrpm = 900\n")
    assert bayesid(["start", str(dive), "--yes"]) == 0
    assert "vehicle new" in (dive / "bayesid" / "steps.sh").read_text()
    assert load_trial(dive / "bayesid").vehicle_ref == str(dive / "bayesid" / "vehicle.toml")


@pytest.mark.thorough
def test_questions_of_the_map_stop_it_and_answers_let_it_go_on(tmp_path, capsys, diagnosed, monkeypatch):
    truth = motion(np.random.default_rng(4), dt=0.4)
    folder = tmp_path / "pond"
    folder.mkdir()
    columns = {
        "t [s]": "t",
        "x [m]": "x",
        "y [m]": "y",
        "yaw [deg]": "psi",
        "rudder_cmd [deg]": "delta_r_cmd",
    }
    values = {k: truth[v] / (DEG if "deg" in k else 1.0) for k, v in columns.items()}
    lines = [",".join(f"{v:.4f}" for v in row) for row in zip(*values.values(), strict=True)]
    (folder / "log.csv").write_text(",".join(values) + "\n" + "\n".join(lines) + "\n")
    order = ["start", str(folder), "--vehicle", "remus100"]
    assert bayesid([*order, "--yes"]) == 3
    path = folder / "bayesid" / "map.toml"
    said = capsys.readouterr().out
    assert said.count("which axes?") == 1 and said.count("delete each question") == 1
    assert str(path) in said
    questions = read_map(path).questions
    assert questions and all(said.count(text) == 1 for text in questions)
    assert "import" not in (folder / "bayesid" / "steps.sh").read_text()
    assert bayesid([*order, "--yes"]) == 3  # still open
    # at a terminal, what holds as it stands is taken
    import typer

    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    asked = []
    monkeypatch.setattr(typer, "confirm", lambda text, default: asked.append(text) or True)
    assert bayesid(order) == 0
    assert len(asked) >= 1
    assert read_map(path).questions == ()
    assert diagnosed


@pytest.mark.thorough
def test_what_the_check_has_said_of_the_log_is_not_said_by_the_import_too(dive, capsys, diagnosed):
    order = ["start", str(dive), "--vehicle", "remus100", "--yes"]
    log = dive / "log.csv"
    rows = log.read_text().splitlines()
    log.write_text("\n".join([rows[0], *rows[1:400], *rows[460:]]) + "\n")  # a gap: 24 s without readings
    assert bayesid(order) == 3  # which order acted in the gap
    map_file = dive / "bayesid" / "map.toml"
    map_file.write_text(re.sub(r"(?ms)^questions = \[.*?^\]\n", "", map_file.read_text()))
    capsys.readouterr()
    assert bayesid(order) == 0
    said = capsys.readouterr().out
    remarks = said.partition("$ bayesid trial check")[2].partition("remark")[2]
    first = next(line.strip() for line in remarks.splitlines() if line.startswith("  - "))
    assert said.count(first) == 1
    assert "Next: " not in said  # the next step is taken
    # an import given by itself says it, and what to do next
    (dive / "alone").mkdir()
    assert bayesid(["trial", "import", str(log), "--map", str(map_file), "--out", str(dive / "alone")]) == 0
    said = capsys.readouterr().out
    assert first in said and "Next: " in said


@pytest.mark.thorough
def test_a_damaged_vehicle_file_and_unused_columns_are_told(dive, capsys, diagnosed):
    (dive / "vehicle.toml").write_text("[vehicle]\nname = \n")
    assert bayesid(["start", str(dive), "--yes"]) == 3
    said = capsys.readouterr().out
    assert "vehicle.toml is left out: not valid TOML: Invalid value (at line 2" in said
    assert bayesid(["start", str(dive), "--yes", "--vehicle", "remus100"]) == 0
    granted = capsys.readouterr().out.partition("Taken for granted:")[2]
    assert "not used: 'Battery (V)'" in granted


@pytest.mark.thorough
def test_the_steps_can_be_run_again(dive, diagnosed):
    (dive / "sheet.toml").write_text("length = 1.6\ndiameter = 0.19\nmass = 35\nspeed = 1.5\nrpm = 900\n")
    assert bayesid(["start", str(dive), "--yes"]) == 0
    steps = (dive / "bayesid" / "steps.sh").read_text()
    assert "vehicle new" in steps and "trial import" in steps
    own = f'bayesid() {{ test "$1" = diagnose || {shlex.quote(sys.executable)} -m bayesid "$@"; }}\n'
    again = subprocess.run(["sh", "-ec", own + steps], capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["trial.toml", "steps.sh"])
@pytest.mark.parametrize("content", [b"vehicle = [", b"\xff\xfe\x00\x81"])
def test_a_damaged_file_of_its_own_is_one_sentence(dive, capsys, diagnosed, name, content):
    (dive / "bayesid").mkdir()
    (dive / "bayesid" / name).write_bytes(content)
    code = bayesid(["start", str(dive), "--vehicle", "remus100", "--yes"])
    said = capsys.readouterr().err
    if name == "steps.sh" and content.isascii():
        assert code == 0  # text that a user may have written
    else:
        assert code == 2 and f"bayesid/{name}: " in said and "fault of bayesid" not in said
        assert not diagnosed


@pytest.mark.parametrize(
    ("files", "words"), [({}, "holds no log"), ({"a.csv": "a story\nof words\n"}, "no table of numbers")]
)
def test_a_folder_without_logs_is_one_sentence(tmp_path, capsys, files, words):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert bayesid(["start", str(tmp_path), "--yes"]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_a_newcomers_logs_give_the_planted_cause(tmp_path):
    """Five CSV files in knots, UTC, latitude and longitude from a simulated LAUV whose rudder stands 1.72
    degrees off; nothing but the vehicle's name is given."""
    import pandas as pd

    sim, folder = tmp_path / "sim", tmp_path / "dive"
    folder.mkdir()
    orders = ["straight", "zigzag:10/10", "zigzag:20/20", "turn:15", "turn:12,side=starboard"]
    noise = ["x=0.3", "y=0.3", "psi=0.01", "u=0.02", "v=0.02", "r=0.003"]
    words = ["--dt", "0.2", "--set", "rudder_offset.offset=0.03", "--seed", "3", "--out", str(sim)]
    assert bayesid(["simulate", "lauv", *orders, *words, *(w for n in noise for w in ("--noise", n))]) == 0
    for k, file in enumerate(sorted(sim.glob("*.csv"))):
        d = pd.read_csv(file)
        truth = {c.partition("[")[0]: d[c].to_numpy() for c in d}
        raw_log(folder / f"run_{k}.csv", truth, seed=k)
    assert bayesid(["start", str(folder), "--vehicle", "lauv", "--yes", "--quick"]) == 0
    found = json.loads((folder / "bayesid" / "gap" / "diagnosis.json").read_text())
    assert found["verdict"] == "effect"
    assert [effect["name"] for effect in found["effects"]] == ["rudder_offset"]
