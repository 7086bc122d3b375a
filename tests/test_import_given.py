"""Runs held out by the names of their files, and the vehicle of a map that is not there."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.cli.main import run as bayesid
from bayesid.trials import load_trial
from bayesid.trials.importing import propose
from tests.raw_logs import DEG, motion
from tests.test_trial_import import _table

pytestmark = pytest.mark.thorough


def logs(tmp_path, *names):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": np.mod(truth["psi"] / DEG, 360.0), "rudder order [deg]": truth["delta_r_cmd"] / DEG,
        "rpm order": truth["n_cmd"],
    }  # fmt: skip
    return [_table(tmp_path, truth, columns, f"{name}.csv") for name in names]


@pytest.mark.parametrize(
    ("names", "held_out", "why"),
    [
        (("threshold_a", "b", "household_outing", "d"), {3}, "as the last run"),  # other words
        (("r1_holdout", "r2", "r3", "r4_Hold-Out", "r5"), {0, 3}, "as the names of the files say"),
        (("r1", "r2", "r3", "r4", "r5"), {4}, "as the last run"),
        (("holdout_1", "holdout_2", "holdout_3", "holdout_4"), {3}, "as the last run"),  # nothing to fit else
    ],
)
def test_files_called_holdout_are_held_out(tmp_path, names, held_out, why):
    found = propose(logs(tmp_path, *names))
    assert {k for k, run in enumerate(found.map.runs) if run.role == "holdout"} == held_out
    (said,) = [text for text in found.remarks if "held out" in text]
    assert why in said and all(found.map.runs[k].name in said for k in held_out)


def map_of(tmp_path, vehicle):
    folder = tmp_path / "maps"
    folder.mkdir()
    lines = ["format = 1", f'vehicle = "{vehicle}"', "[sources.log]", 'files = ["r1.csv"]', "[channels]"]
    lines += ['north = "north [m]"', 'east = "east [m]"', 'heading = "heading [deg]"']
    lines += ['delta_r_cmd = "rudder order [deg]"', 'n_cmd = { from = "rpm order", unit = "rpm" }']
    (folder / "map.toml").write_text("\n".join(lines) + "\n")
    return folder / "map.toml"


@pytest.mark.parametrize(
    ("of_map", "given", "read", "words"),
    [
        ("auv.toml", "own.toml", "vehicle.toml", "as given by --vehicle"),
        ("own.toml", "own.toml", "vehicle.toml", "as given by --vehicle"),  # of another folder than the map's
        ("", "own.toml", "vehicle.toml", "is not named"),
        ("auv.toml", "lauv", "lauv", "as given by --vehicle"),
        ("remus100", "own.toml", "remus100", "which is read, and not"),
    ],
)
def test_the_vehicle_given_is_read_where_that_of_the_map_is_not_there(
    tmp_path, capsys, monkeypatch, of_map, given, read, words
):
    (log,) = logs(tmp_path, "r1")
    if given.endswith(".toml"):
        monkeypatch.chdir(tmp_path)
        assert bayesid(["vehicle", "new", given, "--like", "remus100"]) == 0
    out = tmp_path / "bundle"
    code = bayesid(["trial", "import", str(log), "--map", str(map_of(tmp_path, of_map)), "--vehicle", given,
                    "--out", str(out)])  # fmt: skip
    assert code == 0 and words in capsys.readouterr().out
    assert load_trial(out).vehicle_ref.endswith(read)
    assert (out / "vehicle.toml").exists() is read.endswith("vehicle.toml")
