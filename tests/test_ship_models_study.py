"""Errors of the study of ship models, on motions in closed form."""

import numpy as np
import pytest

from studies.ship_models.errors import circle, filled, overshoots, whole_turn


def test_overshoots_are_what_the_heading_gains_after_each_reversal():
    """A triangle of heading that turns back 3 degrees after every reversal of the rudder, to either side."""
    t = np.arange(0.0, 81.0)
    psi = np.radians(10.0) * np.abs((t / 20.0) % 2 - 1)  # falls for 20 s, rises for 20 s
    rudder = np.where(((t + 6.0) / 20.0) % 2 < 1, 0.2, -0.2)  # orders 6 s before the heading turns: 3 degrees
    found = np.degrees(overshoots(t, psi, rudder))
    assert found == pytest.approx([3.0, 3.0, 3.0], abs=1e-9)


def test_a_circle_has_its_diameter_and_drift_and_its_last_turn_is_whole():
    t = np.arange(0.0, 400.0)
    rate, speed, beta = 0.03, 0.5, np.radians(12.0)
    run = {"psi": rate * t, "u": np.full(400, speed * np.cos(beta)), "v": np.full(400, -speed * np.sin(beta))}
    last = whole_turn(run["psi"])
    assert run["psi"][last[-1]] - run["psi"][last[0]] == pytest.approx(2 * np.pi, abs=rate)
    assert circle(t, run, last) == pytest.approx((2 * speed / rate, beta))
    assert whole_turn(run["psi"][:100]).size == 0  # less than a turn says nothing of a circle


def test_missing_samples_are_interpolated():
    values = np.array([0.0, np.nan, 2.0])
    assert filled(np.arange(3.0), values) == pytest.approx([0.0, 1.0, 2.0])
