"""Result files are whole or absent, and JSON holds neither NaN literals nor folders of this machine."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from bayesid import files
from bayesid.api.inputs import declared_effects
from bayesid.errors import BayesidError
from bayesid.files import to_plain, write_atomic, write_json
from bayesid.manoeuvres.table import read_table


def test_interrupted_write_leaves_the_old_file_and_no_debris(tmp_path, monkeypatch):
    target = write_atomic(tmp_path / "results.json", "old")

    def broken(source, destination):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(OSError, match="No space left"):
        write_atomic(target, "new")
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]


def test_a_written_file_has_the_permissions_of_any_new_file(tmp_path):
    plain = tmp_path / "plain"
    plain.write_text("x")
    assert write_atomic(tmp_path / "atomic", "x").stat().st_mode == plain.stat().st_mode


def test_parent_folders_are_made(tmp_path):
    assert write_atomic(tmp_path / "a" / "b" / "c.txt", b"\x00").read_bytes() == b"\x00"


@dataclass(frozen=True)
class _Fit:
    par: np.ndarray
    source: Path


def test_json_holds_no_folder_of_this_machine(tmp_path):
    here = os.getcwd()
    record = {"fit": _Fit(np.arange(2.0), Path(here) / "run1.csv"), "log": f"{here}/runs/a.csv", 3: "x"}
    text = write_json(tmp_path / "r.json", record).read_text()
    assert here not in text
    fit = {"par": [0.0, 1.0], "source": "run1.csv"}
    assert json.loads(text) == {"fit": fit, "log": "./runs/a.csv", "3": "x"}


@pytest.mark.parametrize(
    "value, plain",
    [
        (float("nan"), None),
        (np.array([np.inf, -np.inf]), ["inf", "-inf"]),
        (np.bool_(True), True),
        (np.int32(7), 7),
        ({"b", "a"}, ["a", "b"]),
        (((1, 2), ()), [[1, 2], []]),
    ],
)
def test_numbers_that_json_lacks_become_null_or_words(value, plain):
    assert to_plain(value) == plain


def test_floats_survive_the_round_trip_to_the_last_bit(tmp_path):
    values = np.random.default_rng(7).standard_normal(200) * 10.0 ** np.arange(-100, 100)
    stored = json.loads(write_json(tmp_path / "r.json", {"v": values}).read_text())["v"]
    assert stored == values.tolist()


def test_a_value_without_json_form_is_named():
    with pytest.raises(TypeError, match="complex"):
        to_plain({"a": 1j})


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("reader", [declared_effects, read_table], ids=["--effects", "table:"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "huge"])
def test_no_reader_waits_for_a_pipe_or_swallows_a_device(kind, reader, tmp_path):
    path = tmp_path / "given"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path = Path("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    else:
        with path.open("wb") as file:
            file.truncate(2**30)  # takes no room on the disk
    with pytest.raises(BayesidError, match="the limit is" if kind == "huge" else "not a regular file"):
        reader(path)


def test_a_file_that_grows_while_it_is_read_stays_within_the_limit(tmp_path, monkeypatch):
    path = tmp_path / "log"
    path.write_bytes(b"x" * 100)
    monkeypatch.setattr(files, "_check_regular", lambda info, limit: None)  # as if measured before it grew
    with pytest.raises(files.UnreadableError, match="is larger than"):
        files.read_regular(path, 99)
    assert files.read_regular(path, 100) == b"x" * 100


def test_a_full_disk_is_told_with_the_file_it_struck(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_atomic(tmp_path / "fit.json", "{}")
    assert caught.value.filename == str(tmp_path / "fit.json") and not list(tmp_path.iterdir())
