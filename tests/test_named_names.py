"""Effects of actuators that a vehicle file names are told from others by their names."""

import pytest

from bayesid.equations.model import build_model
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.named import of_named_actuator
from bayesid.model.vehicles import builtin_names, load_vehicle


@pytest.mark.parametrize("name", [n for n in builtin_names() if load_vehicle(n).actuators])
def test_every_effect_of_a_vehicle_is_of_the_catalogue_or_of_its_actuators(name):
    vehicle = load_vehicle(name)
    own = {e.name for e in build_model(vehicle, 3 if vehicle.planar_only else 6).causes}
    listed = {e.name for e in CATALOGUE}
    assert own - listed and all(of_named_actuator(n) for n in own - listed)
    assert not any(map(of_named_actuator, listed))


@pytest.mark.parametrize(
    ("name", "named"),
    [
        ("azimuths_port_stbd_offset", True), ("nozzles_1_2_3_lag", True), ("azimuth_bow_backlash", True),
        ("nozzle_offset", False), ("azimuths_left_right_offset", False), ("twin_azimuths_1_2_lag", False),
    ],
)  # fmt: skip
def test_common_effects_of_steering_are_of_named_actuators(name, named):
    assert of_named_actuator(name) == named
