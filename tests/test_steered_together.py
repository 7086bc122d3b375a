"""Azimuth thrusters and nozzles that are turned alike have common effects of their steering."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from actuator_plants import AZIMUTH, WATERJET
from plain_kernel import uncompiled

from bayesid.diagnosis.plain_words import sentence
from bayesid.diagnosis.result_parts import Effect as Told
from bayesid.diagnosis.result_parts import Value
from bayesid.equations.generate import module_source
from bayesid.equations.model import build_model
from bayesid.model.actuators import Azimuth
from bayesid.model.effects import CATALOGUE
from bayesid.model.effects.named import named_effects, of_named_actuator
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate

#: kind of an effect -> its size, and a value that is seen in the motion
SIZES = {
    "offset": ("offset", 0.05), "lag": ("tau", 0.7), "dead_time": ("delay", 0.7),
    "rate_limit": ("inverse_rate_excess", 4.0), "backlash": ("half_width", 0.05),
}  # fmt: skip
PORT = Azimuth(
    "port", (-1.8, -0.7, 0.0), (1.0, 0.0, 0.0), T_nn=1.1e-4, turn_max_deg=35.0, turn_rate_deg_s=15.0
)
STBD = replace(PORT, name="stbd", at=(-1.8, 0.7, 0.0), T_nn=1.05e-4)


def common(*actuators):
    """Names of the common effects of steering, without their kinds."""
    names = [e.name for e in named_effects(actuators) if e.name.startswith(("azimuths_", "nozzles_"))]
    assert all(map(of_named_actuator, names))
    found = {}
    for name in names:
        kind = next(k for k in SIZES if name.endswith(f"_{k}"))
        found.setdefault(name.removesuffix(f"_{kind}"), set()).add(kind)
    return found


def test_azimuths_beside_each_other_have_every_effect_of_their_steering_in_common():
    assert common(PORT, STBD) == {"azimuths_port_stbd": set(SIZES)}  # their curves differ
    middle = replace(PORT, name="1", at=(-1.8, 0.0, 0.0))
    assert common(PORT, middle, STBD) == {"azimuths_port_1_stbd": set(SIZES)}
    toed = replace(PORT, direction=(0.8, 0.6, 0.0)), replace(STBD, direction=(0.8, -0.6, 0.0))
    assert common(*toed) == {"azimuths_port_stbd": set(SIZES)}


def test_azimuths_turned_unlike_have_nothing_in_common():
    assert common(PORT) == {}
    for unlike in ({"turn_max_deg": 30.0}, {"turn_rate_deg_s": 12.0}, {"turn_lag": 0.2}):
        assert common(PORT, replace(STBD, **unlike)) == {}


def test_azimuths_of_one_type_apart_are_late_and_slow_alike_without_a_common_zero():
    fore = replace(PORT, name="bow", at=(1.5, 0.0, 0.0))
    servo = {"lag", "dead_time", "rate_limit"}
    assert common(PORT, fore) == {"azimuths_port_bow": servo}
    assert common(PORT, STBD, fore) == {"azimuths_port_stbd": set(SIZES), "azimuths_port_stbd_bow": servo}


def test_a_common_offset_is_told_of_all_that_turn():
    offset = next(e for e in named_effects([PORT, STBD]) if e.name == "azimuths_port_stbd_offset")
    told = Told(offset.name, 1.0, {"offset": Value(np.radians(2.0), 0.001, "rad")}, {}, "", offset.says)
    assert sentence(told).startswith("The thrusters port and stbd turn 2")


def _two(text):
    """The boat with a pod, with a pod on each side instead."""
    pod = text[text.index("[actuators.stern]") : text.index("[actuators.bow]")]
    sides = "".join(
        pod.replace("stern", name).replace("-0.8, 0.0", f"-0.8, {y}")
        for name, y in (("port", -0.3), ("stbd", 0.3))
    )
    return text.replace(pod, sides)


@pytest.mark.thorough
@pytest.mark.parametrize(("text", "angle"), [(_two(AZIMUTH), "azimuth"), (WATERJET, "nozzle")])
def test_a_common_effect_of_steering_moves_a_boat_as_those_of_each_by_one_size(text, angle, tmp_path):
    (tmp_path / "boat.toml").write_text(text)
    model = build_model(load_vehicle(tmp_path / "boat.toml"))
    declared = tuple(d.effect for d in model.kernel.declared)
    model = uncompiled(model, module_source(model.kernel.spec, (*CATALOGUE, *declared)))
    assert common(*model.vehicle.actuators) == {f"{angle}s_port_stbd": set(SIZES)}
    t = np.arange(0.0, 12.0, 1.0)
    level = {"n": 900.0, angle: 0.4}
    orders = {
        f"{word}_{side}_cmd": value * np.sin(0.9 * t + i)
        for word, value in level.items()
        for i, side in enumerate(("port", "stbd"))
    }
    if angle == "nozzle":
        orders |= {f"bucket_{side}_cmd": np.ones(t.size) for side in ("port", "stbd")}
    else:
        orders |= {"n_bow_cmd": np.zeros(t.size)}
    plan = plan_run(model, t, orders, max_step=0.5)

    def motion(**values):
        par = model.with_values({k.replace("__", "."): v for k, v in values.items()})
        return simulate(model, par, plan, np.zeros(6), full=True).states[:, :6]

    bare = motion()
    for kind, (size, value) in SIZES.items():
        together = motion(**{f"{angle}s_port_stbd_{kind}__{size}": value})
        each = motion(**{f"{angle}_{side}_{kind}__{size}": value for side in ("port", "stbd")})
        np.testing.assert_allclose(together, each, atol=1e-9)
        assert np.abs(together - bare).max() > 1e-3, kind
