"""The catalogue of effects: names as agreed, absent when off, alive when on, generated for users."""

import tomllib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from golden_kernel import PUSH
from plain_kernel import EVERY, uncompiled

from bayesid.equations import runtime
from bayesid.equations.generate import module_source
from bayesid.equations.layout import KernelSpec
from bayesid.equations.model import build_model, without_effects
from bayesid.errors import ModelError
from bayesid.model.effects import CATALOGUE, PORTS
from bayesid.model.terms import term
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import (
    interval_maps,
    observe,
    plan_run,
    plan_trial_run,
    readings_on,
    simulate,
    steady_start,
)
from bayesid.trials import Run, window

AGREED = tomllib.loads((Path(__file__).parent / "data" / "effect_names.toml").read_text("utf-8"))["effect"]
BY_NAME = {e.name: e for e in CATALOGUE}
# what no kernel holds: a coefficient that is wrong is a parameter of its own
ELSEWHERE = {"coefficient_error"}
# the kernel's unknowns are cartesian, which keeps them differentiable at no wind; reports speak of V and from
OTHER_PARAMETERS = {
    "wind": ["blowing_north", "blowing_east", "area_coefficients", "front", "centre", "centre_moves"]
}


@pytest.mark.parametrize("agreed", [a for a in AGREED if a["name"] not in ELSEWHERE], ids=lambda a: a["name"])
def test_names_and_places_are_those_agreed(agreed):
    effect = BY_NAME[agreed["name"]]
    assert effect.family == agreed["family"]
    assert effect.port == agreed["port"]
    assert list(effect.where) == agreed["where"]
    assert list(effect.aliases) == agreed.get("aliases", [])
    expected = OTHER_PARAMETERS.get(effect.name, agreed["parameters"])
    assert [p.name for p in effect.parameters] == expected


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda e: e.name)
def test_declarations_are_complete(effect):
    assert effect.port in PORTS
    assert effect.source
    assert effect.form.endswith("."), "say what was chosen where the source leaves a choice"
    assert effect.magnitude
    for p in effect.parameters:
        assert p.about, p.name
        assert p.unit, p.name
        assert p.sd > 0


@lru_cache
def lively(dof):
    """Both sides of the rudder, wind, changing shaft speed; in six degrees near the surface."""
    model = build_model(load_vehicle("generic_sub"), dof)
    if dof == 6:
        model = uncompiled(model)
    k = np.arange(9)
    t = 0.25 * k * model.scales["L"] / model.scales["U"]
    rpm = model.vehicle.rpm_ref
    inputs = {"delta_r_cmd": 0.2 * np.sin(2.0 * k + 0.5), "n_cmd": rpm * (1 + 0.1 * np.cos(k))}
    inputs |= {"delta_s_cmd": 0.05 * np.cos(k), "delta_b_cmd": 0.03 * np.sin(k)}
    wind = {"wind_speed": 4.0 + 0.1 * k, "wind_from": 0.3 + 0.1 * k}
    x0 = steady_start(model)
    x0[model.states.index("v")] = 0.05 * model.scales["U"]
    return model, plan_run(model, t, inputs, exogenous=wind), x0


@lru_cache
def readings(dof, changes=(), full=True):
    model, plan, x0 = lively(dof)
    par = model.with_values(dict(changes))
    track = simulate(model, par, plan, x0, full=full)
    return observe(model, par, plan, track.states, full=full)


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda e: e.name)
def test_turning_an_effect_on_changes_the_readings(effect):
    """By more than 1e-6 of the run, at one prior width; its off value changes nothing (see below)."""
    dof = max(effect.dof, 3)
    model, *_ = lively(dof)
    values = {
        effect.key(p.name): 0.0 if p.dated else p.mean + model.prior_sd(effect.key(p.name))
        for p in effect.parameters
    }
    on, off = readings(dof, tuple(values.items())), readings(dof)
    assert np.abs((on - off) / np.maximum(np.abs(off).max(axis=0), 1e-9)).max() > 1e-6


def test_effects_fixed_to_the_earth_are_told_from_those_of_the_vehicle():
    around = {"steady_force", "wind", "ocean_current", "ocean_current_varying", "heave_current"}
    assert {e.name for e in CATALOGUE if e.fixed_to_earth} == around


@pytest.mark.parametrize("dof", [3, 6])
def test_off_values_reproduce_the_bare_model(dof):
    """With every effect at its off value, and without any: 1e-12 of each channel's range."""
    on, off = readings(dof, full=True), readings(dof, full=False)
    assert np.abs((on - off) / np.maximum(np.abs(off).max(axis=0), 1e-9)).max() < 1e-12


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda e: e.name)
def test_shape_parameters_alone_change_nothing(effect):
    """Whatever a decay, a lag or a place is, the effect is off by its amplitude; an amplitude alone is on."""
    dof = max(effect.dof, 3)
    model, *_ = lively(dof)

    def changed(parameter):
        key = effect.key(parameter.name)
        value = 1.3 * parameter.off or parameter.mean + model.prior_sd(key)
        return not np.allclose(readings(dof, ((key, value),)), readings(dof), rtol=1e-12, atol=1e-12)

    on = {p.name: changed(p) for p in effect.parameters}
    assert on == {p.name: p.off == 0.0 and not p.shape for p in effect.parameters}


def test_ballast_carries_its_own_weight():
    """Neutral water added anywhere leaves a resting, trimmed vehicle at rest."""
    model, plan, _ = lively(6)
    model = build_model(load_vehicle("generic_sub"), 6)
    model = uncompiled(model)
    still = plan_run(model, plan.t, {})
    par = model.with_values({"ballast_mass.mass_fraction": 0.06, "ballast_mass.x": 0.2 * model.scales["L"]})
    par[model.index["x_G"]] = par[model.index["x_B"]] = 0.0
    par[model.index["y_G"]] = par[model.index["y_B"]] = 0.0
    track = simulate(model, par, still, np.zeros(12))
    assert np.abs(track.states).max() < 1e-9


def test_a_biased_compass_does_not_turn_the_lever_arm():
    """Readings of x with both effects: those with the lever arm alone."""
    arm = (("position_lever_arm.l_x", 3.0),)
    x = lively(3)[0].kernel.channels.index("x")
    both = readings(3, (*arm, ("heading_bias.bias", 0.3)))
    assert np.array_equal(both[:, x], readings(3, arm)[:, x])


def test_wind_blows_to_where_its_parameters_point():
    """Air from the north (blowing to the south) pushes a vehicle that heads north back: X < 0."""
    model, plan, x0 = lively(3)
    x0 = steady_start(model)
    t = np.array([0.0, 1.0])
    plan = plan_run(model, t, {"n_cmd": np.full(2, model.vehicle.rpm_ref)})
    calm = simulate(model, model.nominal, plan, x0, full=True)
    V, blows_from = 10.0, 0.0
    towards = {"wind.blowing_north": -V * np.cos(blows_from), "wind.blowing_east": -V * np.sin(blows_from)}
    windy = simulate(model, model.with_values(towards), plan, x0)
    assert windy["u"][-1] < calm["u"][-1]


def test_every_row_of_the_table_is_in_some_kernel():
    from bayesid.equations.layout import rows_of
    from bayesid.model.terms import TERMS

    carried = {row.name for spec in EVERY for row in rows_of(spec)}
    assert carried == {row.name for row in TERMS}
    assert term("Y_v").name in carried


# ---- effects of a user ----------------------------------------------------------------------------------
def test_a_declared_effect_acts_as_its_equation_says(tmp_path, monkeypatch):
    """Printed into the cache beside the others; v after a short push is F / (m - Y_vdot) t."""
    monkeypatch.setenv("BAYESID_CACHE", str(tmp_path))
    runtime.load_kernel.cache_clear()
    model = build_model(load_vehicle("generic_sub"), 3, declared=[PUSH])
    (path,) = tmp_path.rglob("*.py")
    model = uncompiled(model, path.read_text("utf-8"))
    plan = plan_run(model, np.array([0.0, 0.1]), {"n_cmd": np.full(2, 60.0)}, max_step=0.1)
    x0 = steady_start(model)
    pushed = simulate(model, model.with_values({"push.F": 1e5}), plan, x0)
    mass = model.nominal[model.index["m"]] - model.nominal[model.index["Y_vdot"]]
    assert pushed["v"][-1] == pytest.approx(1e5 / mass * 0.1, rel=0.1)
    assert simulate(model, model.nominal, plan, x0)["v"][-1] == pytest.approx(0.0, abs=1e-12)


def test_an_equation_with_an_unknown_name_is_refused_with_the_effects_name():
    from dataclasses import replace

    with pytest.raises(ModelError, match=r"effect 'push'.*unknown name 'G'"):
        module_source(KernelSpec(3), (*CATALOGUE, replace(PUSH, force={"Y": "F*G"})))


@pytest.mark.parametrize("wrong", [{"smooth": True}, {"parameters": BY_NAME["drag_step"].parameters[::-1]}])
def test_a_time_that_a_screen_would_not_try_is_refused(wrong):
    """Taken for smooth it had a slope of nought at every time, and was never found."""
    with pytest.raises(
        ModelError, match="'drag_step': one dated parameter, behind the size, and smooth=False"
    ):
        replace(BY_NAME["drag_step"], **wrong)


def test_an_effect_left_out_leaves_the_parameters_alone():
    model = build_model(load_vehicle("remus100"), 3)
    fewer = without_effects(model, ("wind", "ocean_current"))
    assert set(model.effects) - set(fewer.effects) == {"wind", "ocean_current"}
    assert fewer.kernel.parameters == model.kernel.parameters
    assert np.array_equal(fewer.nominal, model.nominal) and fewer.digest == model.digest
    with pytest.raises(ModelError, match="did you mean ocean_current"):
        without_effects(model, ("ocean_curent",))


def simulate_readings(model, par, plan, x0):
    track = simulate(model, par, plan, x0, full=True)
    return observe(model, par, plan, track.states, full=True), track.states[:, : len(model.states)]


def map_readings(model, par, plan, x0):
    """Readings by the maps of single intervals, along the simulated path."""
    states = simulate(model, par, plan, x0, full=True).states
    none = np.zeros(0, dtype=int)
    maps = interval_maps(model, par, plan, states, (), none)
    ends = np.abs(maps.ends - states[1:]).max()
    assert ends < 1e-6, ends
    return readings_on(model, par, plan, states, maps, none).values, states[:, : len(model.states)]


@pytest.mark.parametrize("read", [simulate_readings, map_readings], ids=["simulation", "interval maps"])
def test_a_part_of_a_run_goes_on_with_what_changes_with_time(read):
    """Begun from the whole run's state, it reads what the whole run reads there."""
    model = build_model(load_vehicle("remus100"), 3)
    t = np.arange(0.0, 60.0, 0.5)
    commands = {"delta_r_cmd": 0.1 * np.sign(np.sin(0.4 * t)), "n_cmd": np.full(t.size, 1500.0)}
    run = Run("a", "zigzag", "identify", t, {"u": np.ones(t.size)}, commands)
    par = model.with_values(
        {
            "thrust_decay.loss_per_600s": 2.0, "heading_drift.drift_per_600s": 1.0,
            "ocean_current_varying.dV_north": 2.0, "drag_step.extra_drag": 1.0, "drag_step.onset": 20.0,
        }
    )  # fmt: skip
    whole, states = read(model, par, plan_trial_run(model, run), steady_start(model))
    at = np.flatnonzero((t >= 30.0) & (t <= 45.0))
    part, _ = read(model, par, plan_trial_run(model, window(run, 30.0, 45.0)), states[at[0]])
    np.testing.assert_allclose(part, whole[at], rtol=0, atol=1e-9 * np.abs(whole).max())
    twice = plan_trial_run(model, window(window(run, 20.0, 50.0), 30.0, 45.0))
    np.testing.assert_allclose(read(model, par, twice, states[at[0]])[0], part, rtol=0, atol=1e-12)
    anew, _ = read(model, par, plan_trial_run(model, replace(run, began=20.0)), states[0])
    assert np.abs(anew - whole).max() > 0.1  # the control: the time does count
