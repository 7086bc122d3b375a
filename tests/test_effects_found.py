"""What is told of a named effect: its sizes, not those the log says nothing of."""

from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.diagnosis.effects_found import unseen
from bayesid.diagnosis.size_names import in_sentence
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.of_ships import SHIP_EFFECTS


def declared(name, of=CATALOGUE):
    return next(e for e in of if e.name == name)


@pytest.mark.parametrize(
    ("name", "of", "kept"),
    [
        ("wind", CATALOGUE, {"blowing_north", "blowing_east"}),
        ("wind", SHIP_EFFECTS, {"blowing_north", "blowing_east"}),
        ("ocean_current", CATALOGUE, {"V_north", "V_east"}),
        ("actuator_rate_limit", CATALOGUE, {"inverse_rate_excess"}),
        ("rudder_offset", CATALOGUE, {"offset"}),
    ],
)
def test_what_a_sentence_tells_is_told_whatever_the_log_says_of_it(name, of, kept):
    assert in_sentence(declared(name, of)) >= kept


def test_the_areas_of_a_wind_that_is_nowhere_measured_are_not_told():
    names = ["N_r", "wind.blowing_north", "wind.blowing_east", "wind.area_coefficients"]
    prior = np.array([1e-3, 2.0, 2.0, 0.7])
    fitted = SimpleNamespace(
        free=SimpleNamespace(names=names, sd=prior), sd=prior * np.array([0.2, 0.05, 0.05, 1.0])
    )
    assert unseen(fitted) == {"wind.area_coefficients"}
    assert "area_coefficients" not in in_sentence(declared("wind"))
