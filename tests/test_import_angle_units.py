"""A heading whose header states the wrong unit: asked about by its unit, and nothing else is blamed."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.trials.importing import propose
from tests.raw_logs import DEG, motion
from tests.test_trial_import import _table

pytestmark = pytest.mark.thorough


def found_in(tmp_path, label, size, placed=True, name="heading"):
    truth, rng = motion(np.random.default_rng(7)), np.random.default_rng(3)
    noise = 0.05 * rng.standard_normal((2, truth["t"].size))
    place = {"north [m]": truth["x"] + noise[0], "east [m]": truth["y"] + noise[1]}
    columns = {"t [s]": truth["t"]} | (place if placed else {})
    columns |= {f"{name} [{label}]": np.mod(truth["psi"], 2 * np.pi) * size, "r [deg/s]": truth["r"] / DEG}
    columns |= {"u [m/s]": truth["u"], "v [m/s]": truth["v"]}
    columns |= {"rudder order [deg]": truth["delta_r_cmd"] / DEG, "rpm order": truth["n_cmd"]}
    return propose([_table(tmp_path, truth, columns)]).map


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize(("label", "size", "unit"), [("deg", 1.0, "rad"), ("rad", 1.0 / DEG, "deg")])
def test_a_heading_of_the_other_unit_is_asked_about_alone(tmp_path, label, size, unit, placed):
    found = found_in(tmp_path, label, size, placed)
    (asked,) = found.questions
    assert f"labelled {label}" in asked and f'`unit = "{unit}"` is set' in asked
    assert ("track follows" if placed else "yaw rate") in asked
    assert found.channels["heading"].unit == unit


@pytest.mark.parametrize("placed", [True, False])
@pytest.mark.parametrize(("label", "size"), [("deg", 1.0 / DEG), ("rad", 1.0)])
def test_a_heading_of_the_unit_it_states_is_not(tmp_path, label, size, placed):
    found = found_in(tmp_path, label, size, placed)
    assert not any("labelled" in text for text in found.questions)
    assert found.channels["heading"].unit == label


@pytest.mark.parametrize("label", ["deg", "rad"])
def test_a_weave_of_twenty_degrees_is_enough(tmp_path, label):
    """So small a heading leaves only a tenth of the track unexplained in the wrong unit."""
    t = 0.1 * np.arange(1800)
    psi = np.radians(20.0) * np.sin(2 * np.pi * t / 30.0) + 0.5
    rng, way = np.random.default_rng(4), np.cumsum(1.5 * np.exp(1j * psi)) * 0.1
    columns = {
        "t [s]": t, "north [m]": way.real + 0.05 * rng.standard_normal(t.size),
        "east [m]": way.imag + 0.05 * rng.standard_normal(t.size), f"heading [{label}]": psi,
        "rudder order [deg]": -10.0 * np.sign(np.cos(2 * np.pi * t / 30.0)), "rpm order": 900.0 + 0.0 * t,
    }  # fmt: skip
    found = propose([_table(tmp_path, {"t": t}, columns)]).map
    labelled = [text for text in found.questions if "labelled" in text]
    assert len(labelled) == (label == "deg") and found.channels["heading"].unit == "rad"
