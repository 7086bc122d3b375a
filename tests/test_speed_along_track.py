"""A speed along the track that is read as u, along the hull, is told where the vehicle drifts in turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.trials import Run
from bayesid.trials.importing import propose
from bayesid.trials.mistakes import check_input
from bayesid.trials.mistakes.along_track import share_of_hull
from tests.test_trial_import import DEG, _table, motion

NAME = "speed along the track as u"


def circle(share: float, drift: float = 0.2, seed: int = 0, current: float = 0.0, arm: float = 0.0) -> Run:
    """Turns to either side after an approach; u is `share` of the way from along the track to along the hull.

    Parameters
    ----------
    drift : angle in the turn [rad]
    current : to the north [m/s], in the track and not in u
    arm : of the antenna ahead of the hull's origin, over the speed in a second
    """
    rng = np.random.default_rng(seed)
    dt, n = 0.1, 1500
    t = dt * np.arange(n)
    rate = np.convolve(np.where(t < 10, 0.0, np.where(t < 80, 0.15, -0.15)), np.ones(30) / 30, "full")[:n]
    speed = 1.4 - 0.3 * np.abs(rate) / 0.15
    slip = drift * rate / 0.15
    velocity = speed * np.exp(-1j * slip)
    seen = velocity + 1j * arm * rate
    psi = np.cumsum(rate) * dt
    place = np.cumsum(seen * np.exp(1j * psi) + current) * dt
    u = (1.0 - share) * np.abs(seen) + share * velocity.real
    noise = lambda sd: sd * rng.standard_normal(n)  # noqa: E731
    data = {
        "x": place.real + noise(0.003), "y": place.imag + noise(0.003), "psi": psi + noise(0.002),
        "u": u + noise(0.008),
    }  # fmt: skip
    rudder = -0.3 * np.sign(rate) * (np.abs(rate) > 0.01)
    return Run(f"turns{seed}", "", "identify", t, data, {"delta_r_cmd": rudder})


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_share_of_the_hull_is_the_one_that_was_made(share):
    found, sd = share_of_hull(circle(share))
    assert abs(found - share) < 4 * sd and sd < 0.1


@pytest.mark.parametrize("arm", [0.0, -1.0])
def test_a_speed_along_the_track_is_told_with_the_line_that_mends_it(arm):
    (found,) = check_input([circle(0.0, seed=k, arm=arm) for k in (0, 1)]).findings
    assert found.name == NAME and found.mend == ("[corrections]", 'drop = ["u"]')
    assert found.probability > 0.95


@pytest.mark.thorough
@pytest.mark.parametrize(
    "given",
    [
        {"share": 1.0},
        {"share": 1.0, "arm": -1.0},
        {"share": 0.0, "arm": 1.45},  # an antenna at the pivot point, which does not drift
        {"share": 0.6},
        {"share": 0.0, "drift": 0.01},  # no drift: the two are one
        {"share": 1.0, "current": 0.15},
    ],
)
def test_a_speed_along_the_hull_is_none(given):
    found = check_input([circle(seed=k, **given) for k in (0, 1)]).findings
    assert NAME not in [f.name for f in found]


def test_nothing_is_asked_where_the_sway_is_logged():
    run = circle(0.0)
    assert share_of_hull(run) is not None
    assert share_of_hull(replace(run, data={**run.data, "v": 0.0 * run.t})) is None


@pytest.mark.parametrize(("name", "said"), [("Speed [kn]", True), ("Surge speed [kn]", False)])
def test_a_speed_taken_as_u_is_said_where_its_name_has_no_axis(tmp_path, name, said):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], name: truth["u"] / 0.5144, "sway [m/s]": truth["v"],
        "Heading [deg]": truth["psi"] / DEG, "Yaw rate [deg/s]": truth["r"] / DEG,
        "Rudder order [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    found = propose([_table(tmp_path, truth, columns)])
    assert found.map.channels["u"].source == name
    assert any("is taken as u, along the hull" in text for text in found.remarks) == said
