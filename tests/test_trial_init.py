"""`bayesid trial init`: tables read where they lie are what an import of them is, or nothing is written."""

from __future__ import annotations

import shlex

import numpy as np
import pytest

from bayesid.cli.main import run as bayesid
from bayesid.trials import load_trial
from bayesid.trials.importing.in_place import _differs
from bayesid.trials.trial import Run
from tests.raw_logs import motion

# the picture of an import is rendered in test_trial_import
pytestmark = pytest.mark.usefixtures("without_pictures")

DEG = np.pi / 180.0


def tables(folder, columns_of, count=2):
    """One run of 60 s per file, from different motions."""
    folder.mkdir()
    for k in range(count):
        truth = motion(np.random.default_rng(k + 1))
        columns = columns_of({name: values[600:1400] for name, values in truth.items()})
        lines = [",".join(columns)] + [
            ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
        ]
        (folder / f"run{k + 1}.csv").write_text("\n".join(lines) + "\n")
    return folder


def mirrored(truth):
    """East-north-up, forward-left-up, knots, a rudder from its potentiometer, times from 12 s on."""
    return {
        "time (s)": truth["t"] + 12.0, "east_ish": truth["y"], "north_ish": truth["x"],
        "yaw": np.pi / 2 - truth["psi"], "wz": -truth["r"] / DEG, "vx": truth["u"] / 0.514444,
        "vy": -truth["v"] / 0.514444, "pot": 512.0 - 8.0 * truth["delta_r_cmd"] / DEG,
        "shaft": truth["n_cmd"],
    }  # fmt: skip


MAP = """format = 1
vehicle = "remus100"
world = "enu"
body = "flu"
rudder_positive = "starboard"
[sources.log]
files = ["run1.csv", "run2.csv"]
time = "time (s)"
clock = "relative"
[channels]
x = { from = "east_ish", unit = "m" }
y = { from = "north_ish", unit = "m" }
psi = { from = "yaw", unit = "rad", offset = 0.01 }
r = { from = "wz", unit = "deg/s" }
u = { from = "vx", unit = "kn" }
v = { from = "vy", unit = "kn" }
delta_r_cmd = { from = "pot", unit = "deg", scale = 0.125, offset = -64.0 }
n_cmd = { from = "shaft", unit = "rpm" }
"""


def test_tables_read_in_place_are_what_an_import_makes_of_them(tmp_path):
    folder = tables(tmp_path / "dive", mirrored)
    (tmp_path / "map.toml").write_text(MAP)
    given = ["--map", str(tmp_path / "map.toml")]
    logs = [str(folder / f"run{k}.csv") for k in (1, 2)]
    assert bayesid(["trial", "import", *logs, *given, "--out", str(tmp_path / "bundle")]) == 0
    assert bayesid(["trial", "init", str(folder), *given]) == 0
    here, there = load_trial(folder), load_trial(tmp_path / "bundle")
    assert here.vehicle_ref == there.vehicle_ref == "remus100"
    assert len(here.runs) == len(there.runs) == 2
    for mine, its in zip(here.runs, there.runs, strict=True):
        assert set(mine.data) == set(its.data) == {"x", "y", "psi", "r", "u", "v"}
        np.testing.assert_allclose(mine.t - mine.t[0], its.t - its.t[0], atol=1e-6)
        for name in its.data:
            off = mine.data[name] - its.data[name]
            np.testing.assert_allclose(np.sin(off) if name == "psi" else off, 0.0, atol=1e-8, err_msg=name)
        for name in its.commands:
            np.testing.assert_allclose(mine.commands[name], its.commands[name], atol=1e-8)
    truth = motion(np.random.default_rng(1))
    np.testing.assert_allclose(
        here.runs[0].commands["delta_r_cmd"], truth["delta_r_cmd"][600:1400], atol=1e-6
    )
    np.testing.assert_allclose(here.runs[0].data["v"], truth["v"][600:1400], atol=1e-6)


@pytest.mark.thorough
def test_a_mistake_of_the_log_is_mended_before_anything_is_diagnosed(tmp_path, capsys):
    """The lines that the import prints, written into trial.toml, leave a log without the mistake."""
    folder, bundle = tables(tmp_path / "dive", mirrored), tmp_path / "bundle"
    logs = [str(folder / f"run{k}.csv") for k in (1, 2)]
    turned = MAP.replace('"wz", unit = "deg/s"', '"wz", unit = "deg/s", scale = -1.0')
    (tmp_path / "map.toml").write_text(turned)
    given = ["--map", str(tmp_path / "map.toml"), "--out", str(bundle)]
    assert bayesid(["trial", "import", *logs, *given]) == 0
    said = capsys.readouterr().out
    assert "1 mistake in the log:" in said and "scale = { r = -1 }" in said and "bayesid diagnose" not in said
    asked, then = said[said.index("Next: ") :].splitlines()[:-1], said.splitlines()[-1]
    assert asked[0] == f"Next: mend the mistake in {bundle / 'trial.toml'}:"
    assert asked[1].strip() == "[corrections]"
    assert then == f"Then: bayesid trial check {bundle}"
    with (bundle / "trial.toml").open("a") as file:
        file.write("\n" + "\n".join(asked[1:]) + "\n")
    assert bayesid(shlex.split(then.removeprefix("Then: bayesid "))) == 0
    assert "mistake" not in capsys.readouterr().out


def test_a_right_log_is_diagnosed_next(tmp_path, capsys):
    folder, bundle = tables(tmp_path / "dive", mirrored), tmp_path / "bundle"
    (tmp_path / "map.toml").write_text(MAP)
    logs = [str(folder / f"run{k}.csv") for k in (1, 2)]
    given = ["--map", str(tmp_path / "map.toml"), "--out", str(bundle)]
    assert bayesid(["trial", "import", *logs, *given]) == 0
    said = capsys.readouterr().out
    assert "mistake" not in said
    assert said.splitlines()[-1] == f"Next: bayesid diagnose {bundle} --out {bundle / 'gap'}"


def test_it_asks_what_the_import_asks(tmp_path, capsys):
    def plain(truth):
        return {"t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "yaw [rad]": truth["psi"],
                "rudder_cmd [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"]}  # fmt: skip

    folder = tables(tmp_path / "dive", plain)
    assert bayesid(["trial", "init", str(folder)]) == 3
    mine = capsys.readouterr().out
    logs = [str(folder / f"run{k}.csv") for k in (1, 2)]
    assert bayesid(["trial", "import", *logs, "--out", str(tmp_path / "bundle")]) == 3
    its = capsys.readouterr().out

    def asked(text):
        return text[text.index("Questions") : text.index("Taken for granted")]

    assert asked(mine) == asked(its)
    assert "which axes?" in asked(mine)
    assert not (folder / "trial.toml").exists()


@pytest.mark.parametrize(
    ("columns_of", "words"),
    [
        (
            lambda truth: {
                "t [s]": truth["t"], "lat": 59.0 + truth["x"] / 111_000.0,
                "lon": 10.0 + truth["y"] / 57_000.0, "heading [deg]": np.mod(truth["psi"] / DEG, 360.0),
                "rudder_cmd [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
            },
            "local metres",
        ),
        (
            lambda truth: {
                "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
                "heading [deg]": np.mod(truth["psi"] / DEG, 360.0),
                "rudder_cmd [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
                "v_north [m/s]": np.gradient(truth["x"], 0.1), "v_east [m/s]": np.gradient(truth["y"], 0.1),
            },
            "turned by the heading",
        ),
    ],
)  # fmt: skip
def test_what_a_trial_file_cannot_say_is_left_to_the_import_and_nothing_is_written(
    tmp_path, capsys, columns_of, words
):
    folder = tables(tmp_path / "sea trial", columns_of)
    assert bayesid(["trial", "init", str(folder)]) == 2
    shown = capsys.readouterr()
    said = shown.err
    assert words in said
    rows = [row.split() for row in shown.out.splitlines()]
    assert any(row[:3] == ["latitude", "lat", "deg"] for row in rows) is (words == "local metres")
    line = next(row for row in said.splitlines() if "bayesid trial import" in row)
    assert not (folder / "trial.toml").exists()
    assert bayesid(shlex.split(line[line.index("bayesid ") :])[1:]) == 0  # the line it prints does it
    assert load_trial(folder / "bundle").runs


def bundle_headers(truth):
    names = {"t[s]": "t", "x[m]": "x", "y[m]": "y", "psi[rad]": "psi", "u[m/s]": "u",
             "delta_r_cmd[rad]": "delta_r_cmd", "n_cmd[rpm]": "n_cmd"}  # fmt: skip
    return {head: truth[name] for head, name in names.items()}


BARE_MAP = """format = 1
[sources.log]
files = ["run1.csv", "run2.csv"]
time = "t[s]"
clock = "relative"
[channels]
x = { from = "x[m]", unit = "m" }
y = { from = "y[m]", unit = "m" }
psi = { from = "psi[rad]", unit = "rad" }
delta_r_cmd = { from = "delta_r_cmd[rad]", unit = "rad" }
n_cmd = { from = "n_cmd[rpm]", unit = "rpm" }
"""


@pytest.mark.parametrize("struck", [True, False])
def test_a_column_struck_from_the_map_is_not_read_in_place_by_its_header(tmp_path, capsys, struck):
    folder = tables(tmp_path / "dive", bundle_headers)
    more = "" if struck else 'u = { from = "u[m/s]", unit = "m/s" }\n'
    (tmp_path / "map.toml").write_text(BARE_MAP + more)
    code = bayesid(["trial", "init", str(folder), "--map", str(tmp_path / "map.toml")])
    said = capsys.readouterr().err
    assert code == (2 if struck else 0), said
    assert (folder / "trial.toml").exists() is not struck
    assert ("header of u is" in said) is struck


def test_cells_an_import_leaves_empty_are_compared(tmp_path):
    t = np.arange(30.0)

    def run(y):
        return Run("a", "", "identify", t, {"y": y})

    holes = np.where(t == 7.0, np.nan, t)
    assert _differs(run(t), run(holes)) == ["y"] == _differs(run(holes), run(t))
    assert _differs(run(holes), run(holes)) == []


def test_what_needs_an_import_is_said_before_its_questions(tmp_path, capsys):
    def plain(truth):
        return {"t [s]": truth["t"], "lat": 59.0 + truth["x"] / 111_000.0,
                "lon": 10.0 + truth["y"] / 57_000.0, "rpm": truth["n_cmd"],
                "heading [deg]": np.mod(truth["psi"] / DEG, 360.0)}  # fmt: skip

    folder = tables(tmp_path / "dive", plain)
    assert bayesid(["trial", "init", str(folder)]) == 3
    said = capsys.readouterr().out
    assert said.index("local metres") < said.index("no rudder found")
    words = shlex.split(said.splitlines()[-1])
    assert words[:3] == ["bayesid", "trial", "import"] and words[-2:] == ["--out", str(folder / "bundle")]
    assert bayesid(["trial", "init", "--help"]) == 0
    assert "BUNDLE" not in capsys.readouterr().out
