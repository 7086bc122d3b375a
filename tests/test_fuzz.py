"""A bounded share of `make fuzz`: every kind of input, mutated, ends in a result or in words."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "fuzz"))
from fuzz_inputs import Counted, fuzz, try_input


@pytest.mark.thorough
def test_no_mutated_input_of_any_kind_escapes():
    found = fuzz(seconds=60.0, seed=20261123, rounds=12)
    assert all(c.tried >= 48 and c.hung == 0 for c in found.values())
    assert {kind: c.escaped[:1] for kind, c in found.items() if c.escaped} == {}
    # the seeds are good and the mutations bad enough; of a log of iterates the good lines are taken
    assert all(0 < c.refused < c.tried for kind, c in found.items() if kind != "iterates.jsonl")


@pytest.mark.parametrize("fault", [KeyError("x"), UserWarning("x")])
def test_what_escapes_is_counted(fault):
    def read(data):
        raise fault

    counted = Counted()
    try_input(read, b"x", counted)
    assert len(counted.escaped) == 1 and counted.refused == 0
