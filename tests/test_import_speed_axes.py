"""Speeds exchanged or reversed: they are blamed, not a heading that agrees with the track by itself."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from tests.raw_logs import DEG, motion
from tests.test_trial_import import _table

pytestmark = pytest.mark.thorough


def asked_of(tmp_path, ahead="u", side="v", signs=(1.0, 1.0), turned=0.0):
    truth, rng = motion(np.random.default_rng(7)), np.random.default_rng(3)
    noise = 0.05 * rng.standard_normal((2, truth["t"].size))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"] + noise[0], "east [m]": truth["y"] + noise[1],
        "heading [deg]": np.mod(truth["psi"] / DEG + turned, 360.0), "r [deg/s]": truth["r"] / DEG,
        "u [m/s]": signs[0] * truth[ahead], "v [m/s]": signs[1] * truth[side],
        "rudder order [deg]": truth["delta_r_cmd"] / DEG, "rpm order": truth["n_cmd"],
    }  # fmt: skip
    return propose([_table(tmp_path, truth, columns)]).map.questions


@pytest.mark.parametrize(
    ("planted", "words"),
    [
        ({"ahead": "v", "side": "u"}, "'u [m/s]' and 'v [m/s]' exchanged ("),
        ({"signs": (-1.0, 1.0)}, "'u [m/s]' of the other sign ("),
        ({"signs": (-1.0, -1.0)}, "'u [m/s]' and 'v [m/s]' of the other sign ("),
        ({"ahead": "v", "side": "u", "signs": (1.0, -1.0)}, "exchanged and 'v [m/s]' of the other sign ("),
    ],
)  # fmt: skip
def test_speeds_that_a_mistake_explains_are_asked_about_alone(tmp_path, planted, words):
    (asked,) = asked_of(tmp_path, **planted)
    assert "agree by themselves" in asked and asked.split("they agree with ")[1].split("; or")[0].count(words)


def test_right_speeds_and_a_heading_from_another_north_are_not_taken_for_it(tmp_path):
    assert asked_of(tmp_path) == ()
    turned = asked_of(tmp_path, turned=90.0)
    assert any("different norths" in text for text in turned)
    assert not any("agree by themselves" in text for text in turned)
