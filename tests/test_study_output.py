"""Studies leave the clone clean: they write into out/, and only `make reports` into what git tracks."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from bayesid.cli.main import run as bayesid

ROOT = Path(__file__).resolve().parents[1]
STUDIES = sorted((ROOT / "studies").glob("*/run.py"))


@pytest.mark.parametrize("study", STUDIES, ids=lambda path: path.parent.name)
def test_a_study_writes_into_out_unless_told_otherwise(study):
    (folder,) = re.findall(r'add_argument\(\s*"--out",[^)]*?default=Path\("([^"]+)"\)', study.read_text())
    assert folder.split("/")[0] == "out"


@pytest.mark.parametrize("study", STUDIES, ids=lambda path: path.parent.name)
def test_help_of_a_study_names_the_command_that_runs_it_and_its_report_is_named_once(study):
    """`bayesid study` names the reports below --out; a study that does too names it twice."""
    text = study.read_text()
    assert re.findall(r'ArgumentParser\(\s*prog="bayesid study (\w+)"', text) == [study.parent.name]
    assert "report: {" not in text


def test_the_usage_line_of_a_study_can_be_typed(capsys):
    assert bayesid(["study", "sampling_rate", "-h"]) == 0
    assert capsys.readouterr().out.startswith("usage: bayesid study sampling_rate [-h] [--out OUT]")


def commands(*words):
    if shutil.which("make") is None:
        pytest.skip("no make here")
    told = subprocess.run(["make", "-n", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return [line for line in told.stdout.splitlines() if " study " in line and "--out" in line]


@pytest.mark.parametrize("words", [("study",), ("study", "DATA=logs"), ("paper",), ("study", "QUICK=1")])
def test_make_study_and_paper_write_into_out(words):
    found = commands(*words)
    assert found and all("--out out/" in line and "reports/" not in line for line in found)


def test_make_reports_writes_every_study_into_reports_but_those_made_once_and_committed():
    found = commands("reports", "DATA=logs")
    names = {re.search(r" study (\w+)", line)[1] for line in found}
    once = ("withheld", "blind")  # committed before the answers were opened
    assert names == {path.parent.name for path in STUDIES if not path.parent.name.startswith(once)}
    assert all(re.search(r" study (\w+).* --out reports/\1\b", line) for line in found)


@pytest.mark.parametrize(
    "words, said", [(("QUICK=1", "DATA=logs"), "leave QUICK out"), ((), "give DATA=folder")]
)
def test_make_reports_refuses_runs_that_would_lose_something(words, said):
    if shutil.which("make") is None:
        pytest.skip("no make here")
    told = subprocess.run(["make", "whole", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert told.returncode != 0 and said in told.stdout
