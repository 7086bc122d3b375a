"""A current turns the course of a slow vehicle more than that of a fast one: no channel is wrong for that."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.kinematics.evidence import FLOOR, weigh
from bayesid.trials.kinematics.relations import relations
from bayesid.trials.mistakes import check_input

CURRENT = 0.1j  # to the east [m/s]


def run(
    name: str, swing: float, speeds: tuple[float, float], seed: int, noise: float = 0.002, bends: float = 0.0
) -> Run:
    """x, y, psi and r of a vehicle that swings about north by `swing` [rad], from one speed to another, in a
    current, without a velocity log; its heading creeps by `bends` [rad] while it gathers speed."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(600)
    gathered = 1.0 - np.exp(-t / 20.0)
    psi = swing * np.sin(0.3 * t) + bends * gathered
    r = 0.3 * swing * np.cos(0.3 * t) + bends * np.exp(-t / 20.0) / 20.0
    rudder = -swing * np.cos(0.3 * t + 0.9)
    speed = speeds[0] + (speeds[1] - speeds[0]) * gathered
    w = speed * np.exp(1j * psi) + CURRENT
    place = np.concatenate(([0j], np.cumsum(0.5 * (w[1:] + w[:-1]) * 0.1)))
    data = {
        "x": place.real + noise * rng.standard_normal(t.size),
        "y": place.imag + noise * rng.standard_normal(t.size),
        "psi": psi + 0.001 * rng.standard_normal(t.size),
        "r": r + 0.0014 * rng.standard_normal(t.size),
    }
    return Run(name, "", "identify", t, data, {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, 500.0)})


def campaign(seed: int) -> list[Run]:
    return [
        run("accelerates", 0.001, (0.75, 1.4), seed, bends=0.012),
        run("weaves", 0.3, (1.4, 1.4), seed + 100),
        run("weaves_slowly", 0.2, (0.8, 0.8), seed + 200),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_a_run_that_gathers_speed_across_a_current_has_no_mistake(seed):
    # "y has the opposite sign" was told of the first: its course falls off while its heading creeps up
    assert check_input(campaign(seed)).findings == ()


def test_the_course_follows_from_a_current_over_the_speed():
    one = run("accelerates", 0.003, (0.75, 1.4), 0, noise=0.0)
    held = weigh(relations(one, only=("course",))["course"])
    assert held.level < 4 * FLOOR
    east, sd = held.estimate["drift_east"]
    speed = np.hypot(*(np.gradient(one.data[k], one.t) for k in "xy"))
    assert math.isclose(east, abs(CURRENT) / float(np.median(speed)), rel_tol=0.1) and sd < 0.5 * east


@pytest.mark.parametrize("seed", range(2))
def test_a_mirrored_y_is_still_told_in_a_current(seed):
    spoilt = [apply(Correction(scale={"y": -1.0}), one) for one in campaign(seed)]
    (found,) = check_input(spoilt).findings[:1]
    assert {found.name, *found.also} & {"sign of y", "sign of psi"}
