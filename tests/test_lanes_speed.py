"""Vectorisation of the lane kernels fails silently; only time tells."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))


@pytest.mark.slow
@pytest.mark.parametrize("full", [False, True], ids=["bare", "all effects"])
def test_sixteen_lanes_cost_less_than_four_tenths_of_a_scalar_run_each(full):
    """Vectorised: 0.25-0.30; not vectorised: 0.8 and more. Paired: load does not matter."""
    from bench_simulation import lanes_run, scalar_run
    from setting import LANES, paired, setting

    s = setting(3, full)
    _, _, ratio = paired(scalar_run(s), lanes_run(s, s.vectors(LANES))[0])
    assert ratio / LANES < 0.4
