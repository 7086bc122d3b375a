"""Commands killed at random times and run again give the files of the unbroken one, but for times."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from studies.robustness.same_files import different

ROOT = Path(__file__).resolve().parents[1]
# A process of its own: it forks, which one with the threads of a test runner should not.
SCRIPT = """
import json, sys
from pathlib import Path
import bayesid.cli.main
from studies.robustness.commands import commands
from studies.robustness.kills import kill_and_resume, rows_of
work = Path(sys.argv[1])
(command,) = [c for c in commands(work / "bundles") if c.name == sys.argv[2]]
print(json.dumps(rows_of(kill_and_resume(command, work, 1, 20))))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", [
    "fit", "diagnose", "sample, emcee", "sample, NUTS", "blind solve", "blind solve, two workers",
    "blind solve of six, two workers killed", "study calibration",
])  # fmt: skip
def test_a_killed_command_run_again_gives_the_files_of_the_unbroken_one(name, tmp_path):
    if name == "sample, NUTS":
        pytest.importorskip("nutpie")
    found = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", SCRIPT, str(tmp_path), name], cwd=ROOT, capture_output=True,
        text=True, timeout=1800, check=False,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr[-2000:]
    rows = json.loads(found.stdout.splitlines()[-1])
    assert len(rows) >= (1 if "killed" in name else 3) and all(row["sent"] for row in rows)
    for row in rows:
        assert (row["same"], row["wrong"]) == (row["finished"], []), row


def test_files_that_differ_by_more_than_times_are_told(tmp_path):
    for place, value, seconds in (("a", 1.0, 3.0), ("b", 1.0, 4.0), ("c", 1.0 + 1e-15, 3.0)):
        (tmp_path / place).mkdir()
        (tmp_path / place / "fit.json").write_text(json.dumps({"z": [value], "seconds": seconds}))
    assert different(tmp_path / "a", tmp_path / "b", ("fit.json",)) == []
    assert different(tmp_path / "a", tmp_path / "c", ("fit.json",)) == ["fit.json: differs"]
    assert different(tmp_path / "a", tmp_path / "b", ("*.nc",)) == ["*.nc: not written"]


def test_a_report_may_differ_in_when_and_how_long_only(tmp_path):
    for place, share, took, when in (("a", 81, 5, 1), ("b", 81, 6, 2), ("c", 82, 5, 1)):
        (tmp_path / place).mkdir()
        text = f"{share} % hold. Processor time: {took} s.\n\nWritten 2026-11-2{when}T10:00:00Z\n"
        (tmp_path / place / "report.md").write_text(text)
    assert different(tmp_path / "a", tmp_path / "b", ("*.md",)) == []
    assert different(tmp_path / "a", tmp_path / "c", ("*.md",)) == ["report.md: differs"]


def test_texts_of_an_array_are_compared_as_texts(tmp_path):
    import h5py

    for place, words in (("a", ["one", "two"]), ("b", ["one", "two"]), ("c", ["one", "six"])):
        (tmp_path / place).mkdir()
        with h5py.File(tmp_path / place / "posterior.nc", "w") as file:
            file.create_dataset("parameter", data=words, dtype=h5py.string_dtype())
    assert different(tmp_path / "a", tmp_path / "b", ("*.nc",)) == []
    assert different(tmp_path / "a", tmp_path / "c", ("*.nc",)) == ["posterior.nc: differs"]
