"""Orders of one run that are late against its motion are told, with the time; what all runs share is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.api.simulate import simulate
from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.mistakes import check_input, late_run
from bayesid.trials.mistakes.turn_equation import answering, turn_equations, unexplained
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
def test_of_two_runs_alone_the_one_that_would_answer_before_its_orders_is_not_told(runs):
    # that the other is early would have its vehicle answer a second before it is told to
    found = check_input(with_late(runs[:2], 0, 1.0), travel=TRAVEL).findings
    assert [f.runs for f in found] == [(runs[0].name,)] and not found[0].also


@pytest.mark.thorough
def test_times_of_several_lengths_are_told_and_longer_ones_not_as_another(runs):
    # 5 s were told as 2.9 s early: half a period of the zig-zag away
    (found,) = check_input(with_late(runs, 0, 5.0), travel=TRAVEL).findings
    assert found.correction.late["delta_r_cmd"] == pytest.approx(5.0, abs=STEP)
    assert check_input(with_late(runs, 0, 9.0), travel=TRAVEL).findings == ()


@pytest.mark.thorough
def test_of_two_late_runs_among_four_no_right_one_is_told():
    orders = [f"zigzag:{text},duration=60" for text in ("10/10", "13/13", "5/5", "13/20")]
    four = simulate("remus100", *orders, dt=STEP, noise=NOISE, seed=0).runs
    late = [logged_late(run, 1.0)[0] for run in four[:2]]
    assert check_input([*late, *four[2:]], travel=TRAVEL).findings == ()


@pytest.mark.thorough
def test_of_two_late_runs_the_one_right_zigzag_is_not_told(runs):
    # the vehicle would answer a second before its orders in both others; the turn tells nothing of their time
    late = [logged_late(run, 1.0)[0] for run in runs[:2]]
    assert check_input([*late, *runs[2:]], travel=TRAVEL).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("lag", [0.2, 0.4])
def test_a_measured_angle_in_one_run_beside_orders_in_others_is_no_late_run(lag):
    # an angle lags behind its order: its run was told late by 0.3 s, or another one early
    slow = {"actuator_lag.tau": lag}
    made = simulate("remus100", *ORDERS, dt=STEP, noise=NOISE, change=slow, seed=1).runs
    order, angle = made[0].commands["delta_r_cmd"], np.zeros(made[0].n_samples)
    for k in range(1, angle.size):
        angle[k] = angle[k - 1] + (order[k - 1] - angle[k - 1]) * (1.0 - np.exp(-STEP / lag))
    angle += np.random.default_rng(0).normal(0.0, 0.002, angle.size)
    mixed = replace(made[0], measured_inputs={"delta_r": angle})
    assert check_input([mixed, *made[1:]], travel=TRAVEL).findings == ()


@pytest.mark.thorough
@pytest.mark.parametrize("rpm", [300.0, 420.0])
def test_a_run_at_another_speed_beside_a_meander_is_no_late_run(rpm):
    # at one frequency a delay is a phase: the meander was told to be 3.4 to 4.1 s early
    travel, vehicle = 7.556, "esso_osaka_mmg"
    noise = {"x": 0.09, "y": 0.09, "psi": 0.005, "r": 0.0003, "u": 0.01, "v": 0.01}
    kinds = {"zigzag:10/10": rpm, "meander:10": 600.0, "zigzag:20/20": 600.0, "turn:20": 600.0}
    made = [
        replace(
            simulate(
                vehicle, f"{text},duration={60 * travel:.4g}", dof=3, dt=1.0, rpm=speed, noise=noise, seed=k
            ).runs[0],
            name=text,
        )
        for k, (text, speed) in enumerate(kinds.items())
    ]
    assert check_input(made, travel=travel).findings == ()


def test_coefficients_of_a_run_of_its_own_leave_no_more_than_those_of_all():
    """Meanders tell nothing of what large turns have besides: coefficients of its own left a large zig-zag
    three times as much as those of all did, and a bulk carrier was told one with early orders."""
    orders = ("zigzag:2/2,duration=60", "zigzag:2/3,duration=60", "zigzag:13/20,duration=60")
    found = simulate("remus100", *orders, dt=STEP, noise=NOISE, seed=2).runs
    turns = turn_equations(found, TRAVEL)
    every = sum(turn.products for turn in turns.values())
    same = unexplained(every[:, slice(*answering())]).min()
    for turn in turns.values():
        assert late_run._coefficients_of_its_own(every - turn.products, turn) <= same * (1 + 1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_a_play_that_swallows_small_orders_is_no_late_run(seed):
    # of 2 degrees before orders of 3, beside orders of 20: 2.3 s late
    travel, loose = 0.674, {"actuator_backlash.half_width": np.radians(2.0)}
    orders = [f"zigzag:{text},duration={60 * travel:.4g}" for text in ("3/3", "20/20")]
    found = simulate("lauv", *orders, dt=0.1, noise=NOISE | {"r": 0.003}, change=loose, seed=seed)
    assert check_input(found.runs, travel=travel).findings == ()


@pytest.mark.thorough
def test_a_rudder_of_the_other_sign_in_one_run_is_not_told_as_late(runs):
    turned = apply(Correction(scale={"delta_r_cmd": -1.0}), runs[0])
    found = check_input([turned, *runs[1:]], travel=TRAVEL).findings
    assert [(f.name, f.runs) for f in found] == [("sign of delta_r in some runs", (runs[0].name,))]
