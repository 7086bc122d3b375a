"""Orders of one run that are late against its motion are told, with the time; what all runs share is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.api.simulate import simulate
from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.mistakes import check_input
from studies.log_mistakes.one_run_late import logged_late

ORDERS = (
    "zigzag:10/10,duration=60",
    "zigzag:13/20,duration=60",
    "zigzag:5/10,duration=60",
    "turn:12,duration=60",
)
NOISE = {"x": 0.1, "y": 0.1, "psi": 0.005, "r": 0.002, "u": 0.01, "v": 0.01}
TRAVEL, STEP = 1.03, 0.2


@pytest.fixture(scope="module")
def runs() -> tuple[Run, ...]:
    return simulate("remus100", *ORDERS, dt=STEP, noise=NOISE, seed=4).runs


def with_late(runs: tuple[Run, ...], which: int, late: float) -> list[Run]:
    return [logged_late(run, late)[0] if i == which else run for i, run in enumerate(runs)]


@pytest.mark.thorough
@pytest.mark.parametrize(("which", "late"), [(0, 1.0), (1, -0.8), (2, 2.0)])
def test_a_run_whose_orders_are_late_or_early_is_told_with_the_time(runs, which, late):
    (found,) = check_input(with_late(runs, which, late), travel=TRAVEL).findings
    assert found.correction is not None and found.probability > 0.95
    assert found.runs == found.correction.runs == (runs[which].name,)
    assert found.correction.late == pytest.approx({"delta_r_cmd": late, "n_cmd": late}, abs=STEP)
    assert ("later" if late > 0 else "earlier") in found.says


@pytest.mark.thorough
def test_the_mend_brings_the_orders_back_to_within_a_row(runs):
    spoilt = with_late(runs, 0, 1.0)
    (found,) = check_input(spoilt, travel=TRAVEL).findings
    mended = apply(found.correction, spoilt[0])
    order, true = mended.commands["delta_r_cmd"], runs[0].commands["delta_r_cmd"]
    assert np.mean(order != true) < 0.1 < np.mean(spoilt[0].commands["delta_r_cmd"] != true)
    assert check_input([mended, *spoilt[1:]], travel=TRAVEL).findings == ()


def test_nothing_is_told_of_runs_that_are_right_or_all_late_alike(runs):
    assert check_input(runs, travel=TRAVEL).findings == ()
    assert check_input([logged_late(run, 1.0)[0] for run in runs], travel=TRAVEL).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_a_slow_rudder_that_follows_large_orders_later_is_no_late_run(seed):
    # told as a run with late orders while the rate was not asked: 6 degrees are over in .8 s, 26 in 3.7
    orders = (
        "zigzag:3/5,duration=60",
        "zigzag:3/3,duration=60",
        "zigzag:13/30,duration=60",
        "zigzag:5/5,duration=60",
    )
    slow = {"actuator_rate_limit.inverse_rate_excess": 8.0}
    found = simulate("remus100", *orders, dt=STEP, noise=NOISE, change=slow, seed=seed)
    assert check_input(found.runs, travel=TRAVEL).findings == ()


@pytest.mark.thorough
def test_heading_alone_tells_it_too(runs):
    bare = [replace(run, data={k: run.data[k] for k in ("x", "y", "psi")}) for run in with_late(runs, 1, 1.0)]
    (found,) = check_input(bare, travel=TRAVEL).findings
    assert found.runs == (runs[1].name,)
    assert found.correction.late["delta_r_cmd"] == pytest.approx(1.0, abs=2 * STEP)


@pytest.mark.thorough
def test_of_two_runs_alone_the_early_vehicle_is_ruled_out_and_nothing_else(runs):
    # that the other is early would have its vehicle answer a second before it is told to
    late = check_input(with_late(runs[:2], 0, 1.0), travel=TRAVEL).findings
    assert [f.runs for f in late] == [(runs[0].name,)]
    early = check_input(with_late(runs[:2], 0, -0.5), travel=TRAVEL).findings
    assert not early or set(early[0].also) or early[0].runs == (runs[0].name,)


@pytest.mark.thorough
def test_a_rudder_of_the_other_sign_in_one_run_is_not_told_as_late(runs):
    turned = apply(Correction(scale={"delta_r_cmd": -1.0}), runs[0])
    found = check_input([turned, *runs[1:]], travel=TRAVEL).findings
    assert [(f.name, f.runs) for f in found] == [("sign of delta_r in some runs", (runs[0].name,))]
