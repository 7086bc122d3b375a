"""A heading that repeats one reading while the vehicle turns is told of, whatever else stands with it."""

import re

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.health import check_run

T = 0.1 * np.arange(600)
RNG = np.random.default_rng(3)
NOISE = {c: RNG.standard_normal(T.size) for c in ("psi", "r", "u")}


def told(rate=0.03, stands=(200, 225), also=(), with_rate=True, grain=0.0, wrapped=False, silent=None):
    data = {
        "psi": rate * T + 2e-3 * NOISE["psi"],
        "r": rate + 1e-3 * NOISE["r"],
        "u": 0.3 + 4e-3 * NOISE["u"],
    }
    if grain:
        data["psi"] = grain * np.round(data["psi"] / grain)
    for name in ("psi", *also):
        data[name][slice(*stands)] = data[name][stands[0]]
    if wrapped:
        data["psi"] = np.remainder(data["psi"], 2 * np.pi)
    if silent is not None:
        data["r"][slice(*silent)] = np.nan
    if not with_rate:
        del data["r"]
    run = Run("turn", "turn", "identify", T, data, {"delta_r_cmd": np.full(T.size, 0.6)})
    return [words for words in check_run(run) if "repeats one reading" in words]


@pytest.mark.parametrize("also", [(), ("r",), ("r", "u")])
@pytest.mark.parametrize("with_rate", [True, False])
def test_a_heading_that_stands_in_a_turn_is_told_with_its_time_and_the_turn(also, with_rate):
    (words,) = told(also=also if with_rate else (), with_rate=with_rate)
    assert "from t = 20 to 22.4 s" in words and "skip_repeats" in words
    (turned,) = re.findall(r"turns by (\S+) degrees", words)
    assert abs(float(turned) - np.degrees(0.03 * 2.45)) < 0.5


def test_a_steady_course_a_short_drop_out_and_a_coarse_compass_are_not():
    assert not told(rate=0.0)
    assert not told(stands=(200, 213))
    assert not told(grain=np.radians(5.0), stands=(0, 1))
    assert told(grain=np.radians(0.01))


@pytest.mark.parametrize("with_rate", [True, False])
def test_a_steady_course_across_north_does_not_turn_by_a_whole_turn(with_rate):
    for first in range(200, 240):
        assert not told(rate=0.0, stands=(first, first + 25), wrapped=True, with_rate=with_rate)


def test_a_yaw_rate_without_a_reading_leaves_the_step_to_tell_the_turn():
    (words,) = told(silent=(195, 230))
    (turned,) = re.findall(r"turns by (\S+) degrees", words)
    assert abs(float(turned) - np.degrees(0.03 * 2.45)) < 0.5
