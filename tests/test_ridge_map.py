"""Which manoeuvre closes which ridge, against information known in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.analysis.design.ridge_map import per_minute, ridge_map


def informed(rows, minutes):
    matrix = np.asarray(rows).T @ np.asarray(rows)
    return SimpleNamespace(matrices=np.stack([matrix, matrix]), duration=60.0 * minutes)


def test_a_steady_turn_knows_a_sum_and_a_zigzag_its_parts():
    """Information 1e4 along a unit vector leaves 1/sqrt(1 + 1e4) of the prior."""
    known = Knowledge(("Y_v", "Y_r"), np.arange(2), np.zeros(2), np.diag([2.0, 30.0]), ())
    both = np.array([1.0, 1.0]) / np.sqrt(2)
    infos = {
        "turn": informed([100 * both], 10),
        "zigzag": informed(100 * np.eye(2), 5),
        "straight": informed(np.zeros((1, 2)), 10),
    }
    found = ridge_map(known, infos)
    assert found.families == ("v/r of Y",) and found.members == (("Y_v", "Y_r"),)
    assert found.fixed[0] == pytest.approx([0.01, 0.01, 1.0], rel=1e-3)
    assert found.left[0] == pytest.approx([1.0, 0.01, 1.0], rel=1e-3)
    assert found.best[0][0] == "0.71 Y_r + 0.71 Y_v" or found.best[0][0] == "0.71 Y_v + 0.71 Y_r"
    rate = per_minute(infos)
    one = 0.5 * np.log(1 + 1e4)  # nats of one direction
    assert rate[:, 1] == pytest.approx([one / 10, 2 * one / 5, 0.0])
    assert np.all(np.diff(rate, axis=1) == 0)  # both vehicles alike
