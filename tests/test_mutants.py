"""Small changes of rules, facts, weighing, search and comparison are noticed by their tests.

Run by `make slow`, some minutes. Prints what was not noticed.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TESTS = {
    "rules": ["test_diagnose_rules.py"],
    "facts": ["test_diagnose_facts.py", "test_diagnose_verdict.py"],
    "search": ["test_diagnose_search.py", "test_diagnose_selection.py"],
    "comparison": ["test_diagnose_comparison.py"],
    "probabilities": ["test_diagnose_weigh.py", "test_diagnose_cross_validation.py"],
}
SHARE = 0.95


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks a process per mutant")
@pytest.mark.parametrize("module", TESTS)
def test_nearly_every_mutant_is_noticed(module):
    files = [str(HERE / name) for name in TESTS[module]]
    done = subprocess.run(
        [sys.executable, str(HERE / "mutants.py"), f"bayesid.diagnosis.hypotheses.{module}", *files],
        capture_output=True, text=True, cwd=HERE.parent, check=True,
    )  # fmt: skip
    print(done.stderr, done.stdout)
    share = float(done.stdout.rsplit("(", 1)[1].rstrip("%)\n")) / 100
    assert share >= SHARE, done.stderr
