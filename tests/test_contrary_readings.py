"""A reading that is the mirror image of its own order is told; what only lags, or rests, is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from bayesid.diagnosis.input import check_trial
from bayesid.trials import Run
from bayesid.trials.mistakes import check_input
from bayesid.trials.mistakes.contrary import SURE, follows
from tests.test_log_mistakes import weave
from tests.test_named_rudders import model_of, zigzags  # noqa: F401


def followed(run: Run, name: str, order: np.ndarray, sign: float = 1.0, seed: int = 0) -> Run:
    """The run with an order, and a reading that follows it within a second with noise of 0.1 degrees."""
    share = 1.0 - math.exp(-float(run.t[1] - run.t[0]) / 1.0)
    read = lfilter([share], [1.0, share - 1.0], order, zi=[(1.0 - share) * order[0]])[0]
    noise = 0.0017 * np.random.default_rng(seed).standard_normal(order.size)
    return replace(
        run,
        commands={**run.commands, f"{name}_cmd": order},
        measured_inputs={**run.measured_inputs, name: sign * (read + noise)},
    )


def of_rudder(sign: float, order_sign: float = 1.0) -> list[Run]:
    runs = [
        followed(w, "delta_r", w.commands["delta_r_cmd"], sign, k) for k, w in enumerate(map(weave, (1, 2)))
    ]
    return [
        replace(r, commands={**r.commands, "delta_r_cmd": order_sign * r.commands["delta_r_cmd"]})
        for r in runs
    ]


def test_a_rudder_that_follows_its_order_has_no_mistake():
    assert check_input(of_rudder(1.0)).findings == ()


@pytest.mark.thorough
def test_of_a_reading_and_an_order_that_contradict_the_turn_tells_the_wrong_one():
    (reading,) = check_input(of_rudder(-1.0)).findings
    assert reading.correction.scale == {"delta_r": -1.0} and reading.also == ()
    (order,) = check_input(of_rudder(1.0, -1.0)).findings
    assert order.correction.scale == {"delta_r_cmd": -1.0} and order.also == ()
    (both,) = check_input(of_rudder(-1.0, -1.0)).findings  # they agree, and the turn is against both
    assert both.name == "sign of delta_r"


@pytest.mark.thorough
@pytest.mark.parametrize("right", [1, 2])
def test_a_reading_reversed_in_some_runs_is_told_of_these_alone(right):
    good = [
        followed(w, "delta_r", w.commands["delta_r_cmd"], 1.0, k) for k, w in enumerate(map(weave, (3, 4)))
    ]
    spoilt = [replace(r, name=f"spoilt{k}") for k, r in enumerate(of_rudder(-1.0))][: 3 - right]
    (found,) = check_input([*good[:right], *spoilt]).findings
    assert found.correction.scale == {"delta_r": -1.0}
    assert set(found.correction.runs) == {run.name for run in spoilt}


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["n_port", "bucket_1", "delta_b"])
def test_where_no_turn_tells_either_may_be_wrong(name):
    order = {"n_port": 600.0, "bucket_1": 0.8, "delta_b": 0.2}[name] * np.sign(np.sin(0.2 * weave(1).t + 0.1))
    (found,) = check_input([followed(weave(1), name, order, -1.0)]).findings
    assert {found.name, *found.also} == {f"sign of {name} as measured", f"sign of {name} as ordered"}
    assert found.together > 0.95 > found.probability
    assert check_input([followed(weave(1), name, order)]).findings == ()


@pytest.mark.parametrize("angle", [0.0, 0.3, -2.0])
def test_an_angle_that_stays_where_it_is_has_no_mirror_image(angle):
    # a reading on the other side of an order that rests is an offset
    run = weave(1)
    order = np.full(run.t.size, math.radians(angle))
    assert follows(followed(run, "delta_s", order, -1.0), "delta_s") == 0.0
    assert follows(followed(run, "delta_s", order + 0.1 * np.sign(np.sin(run.t)), -1.0), "delta_s") == -SURE


def test_a_slow_rudder_and_a_stuck_one_are_no_mirror_image():
    t = np.arange(0.0, 200.0, 0.1)
    order = 0.35 * np.sign(np.sin(2 * np.pi * t / 60.0))
    slow = np.zeros(t.size)
    for k in range(1, t.size):  # 2.3 degrees a second, as of a ship
        slow[k] = slow[k - 1] + np.clip(order[k] - slow[k - 1], -0.004, 0.004)
    run = Run("ship", "", "identify", t, {"psi": 0.1 * t}, {"delta_1_cmd": order}, {"delta_1": slow})
    assert follows(run, "delta_1") == SURE
    assert follows(replace(run, measured_inputs={"delta_1": -slow}), "delta_1") == -SURE
    assert follows(replace(run, measured_inputs={"delta_1": 0.0 * slow + 0.2}), "delta_1") == 0.0


def test_an_azimuth_read_beyond_half_a_turn_is_its_order_and_not_the_mirror_image():
    t = np.arange(0.0, 60.0, 0.1)
    order = math.pi + 0.3 * np.sign(np.sin(0.5 * t))
    run = Run(
        "pod",
        "",
        "identify",
        t,
        {"psi": 0.1 * t},
        {"azimuth_1_cmd": order},
        {"azimuth_1": order - 2 * math.pi},
    )
    assert follows(run, "azimuth_1") == SURE
    assert follows(replace(run, measured_inputs={"azimuth_1": -order}), "azimuth_1") == -SURE


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("readings", "orders", "name"),
    [
        ((-1.0, 1.0), (1.0, 1.0), "sign of delta_1 as measured"),
        ((1.0, 1.0), (1.0, -1.0), "sign of delta_2 as ordered"),
        ((-1.0, -1.0), (1.0, 1.0), "sign of delta_1, delta_2 as measured"),
        ((1.0, 1.0), (1.0, 1.0), ""),
    ],
)
def test_one_of_two_rudders_is_told_by_its_own_order_and_the_turn(zigzags, readings, orders, name):  # noqa: F811
    runs = []
    for run in zigzags.runs:
        angle = run.commands["delta_1_cmd"]
        for k in (0, 1):
            run = followed(run, f"delta_{k + 1}", angle, readings[k], k)
        turned = {f"delta_{k + 1}_cmd": orders[k] * angle for k in (0, 1)}
        runs.append(replace(run, commands={**run.commands, **turned}))
    found = check_trial(replace(zigzags, runs=tuple(runs)), model_of(zigzags)).findings
    assert [f.name for f in found] == ([name] if name else [])
    assert all(f.also == () and f.probability > 0.95 for f in found)
