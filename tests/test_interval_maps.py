"""Interval maps: slopes against differences and whole-run sensitivities, composition, latent forces."""

from dataclasses import replace
from functools import lru_cache
from importlib import import_module

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.linearise import Trajectory, latent_inputs, linearise, with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel, whitened
from bayesid.estimation.run_data import RunData
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import (
    chain_of,
    inertia_ratio,
    interval_maps,
    observe_sensitivity,
    plan_run,
    readings_on,
    sensitivities,
    simulate,
    steady_start,
)

maps_module = import_module("bayesid.simulation.interval_maps")  # the package has the function by that name
VEHICLES = ("remus100", "generic_sub")
# Central differences: truncation h^2 and cancellation 1e-16/h leave 1e-6 of a column, kinks some more.
CLOSE = 3e-6
DELAYS = ("position_latency.delay", "velocity_latency.delay")
LATE = (*DELAYS, "ground_velocity_latency.delay")
# A command that comes to lie in another step leaves a kink; `test_sensitivities` moves it within one step.
KINKED = ("actuator_dead_time.delay",)
BLANK = (
    "wind.area_coefficients",
    "wind.front",
    "wind.centre",
    "wind.centre_moves",
)  # no wind blows: columns of rounding


@lru_cache
def case(name, samples=60):
    """A zig-zag of 15 hull lengths with some smooth effects on; no sensor is late."""
    model = build_model(load_vehicle(name), 3)
    s, rpm = model.scales, model.vehicle.rpm_ref
    t = 0.25 * s["L"] / s["U"] * np.arange(samples)
    rudder = 0.17 * np.sign(np.sin(2 * np.pi * np.arange(samples) / 24 + 0.1))
    inputs = {"delta_r_cmd": rudder, "n_cmd": np.full(samples, rpm)}
    par = model.nominal.copy()
    on = "ocean_current", "fluid_memory", "rudder_effectiveness", "gyro_scale", "heading_bias", "steady_force"
    for effect in on:
        for p in model.effects[effect].parameters:
            par[model.index[f"{effect}.{p.name}"]] += 0.3 * model.prior_sd(f"{effect}.{p.name}")
    return model, par, plan_run(model, t, inputs), inputs


def free_of(model):
    """Coefficients and the parameters of every smooth effect."""
    names = [*model.coefficients]
    names += [e.key(p.name) for e in model.effects.values() if e.smooth for p in e.parameters]
    return names, model.positions(names)


@lru_cache
def rough_path(name):
    """States that do not obey the equations: a simulated track with a different wobble at every sample."""
    model, par, plan, _ = case(name)
    track = simulate(model, par, plan, steady_start(model), full=True).states
    rng = np.random.default_rng(3)
    size = np.array([0.1, 0.1, 0.05, 0.05, 0.05, 0.02])
    unit = {"x": "L", "y": "L"}
    scale = np.array([model.scales[unit[n]] if n in unit else 1.0 for n in model.kernel.full.states[:6]])
    scale[3:5] = model.scales["U"]
    scale[5] = model.scales["U"] / model.scales["L"]
    states = track.copy()
    states[:, :6] += size * scale * rng.standard_normal((track.shape[0], 6))
    return states


def same(analytic, difference):
    """Largest disagreement over the size of the column; a column of nothing but rounding agrees."""
    return np.abs(analytic - difference).max() / max(np.abs(difference).max(), np.abs(analytic).max(), 1e-15)


@pytest.mark.parametrize("name", VEHICLES)
def test_maps_by_state_are_central_differences_of_the_interval_ends(name):
    model, par, plan, _ = case(name)
    states, nothing = rough_path(name), np.zeros(0, dtype=np.int64)
    maps = interval_maps(model, par, plan, states, (), nothing)
    for k, label in enumerate(model.kernel.full.states):
        h = 1e-5 * max(np.ptp(states[:, k]), 1e-3)
        step = h * np.eye(states.shape[1])[k]
        ends = [interval_maps(model, par, plan, states + d, (), nothing).ends for d in (step, -step)]
        assert same(maps.phi[:, :, k], (ends[0] - ends[1]) / (2 * h)) < CLOSE, label


@pytest.mark.parametrize("name", VEHICLES)
def test_maps_by_latent_inputs_are_central_differences_of_the_interval_ends(name):
    model, par, plan, inputs = case(name)
    # a measured position takes the place of the command, so that a shift of it is a shift of the actuator
    plan = plan_run(model, plan.t, {}, measured={k.removesuffix("_cmd"): v for k, v in inputs.items()})
    states, nothing = rough_path(name), np.zeros(0, dtype=np.int64)
    names = latent_inputs(model)
    maps = interval_maps(model, par, plan, states, names, nothing)
    s = model.scales
    size = {"delta_r": 0.1, "n": model.vehicle.rpm_ref, "flow_north": s["U"], "flow_east": s["U"]}
    base = 0.01 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
    for k, label in enumerate(names):
        h = 1e-5 * size.get(label, base * (s["L"] if label[-1] == "N" else 1.0))
        ends = []
        for d in (h, -h):
            if label in model.kernel.actuators:
                levels = plan.levels.copy()
                levels[:, model.kernel.actuators.index(label)] += d
                moved = replace(plan, levels=levels)
            else:
                exogenous = plan.exogenous.copy()
                exogenous[:, model.kernel.exogenous.index(label)] += d
                moved = replace(plan, exogenous=exogenous)
            ends.append(interval_maps(model, par, moved, states, (), nothing).ends)
        difference = (ends[0] - ends[1]) / (2 * h)
        assert np.abs(difference).max() > 0, label
        assert same(maps.gamma[:, :, k], difference) < CLOSE, label


@pytest.mark.parametrize("name", VEHICLES)
def test_maps_and_readings_by_parameters_are_central_differences(name):
    model, par, plan, _ = case(name)
    states, nothing = rough_path(name), np.zeros(0, dtype=np.int64)
    names, free = free_of(model)
    maps = interval_maps(model, par, plan, states, (), free)
    readings = readings_on(model, par, plan, states, maps, free)
    worst = {}
    for k, label in enumerate(names):
        if label in LATE + KINKED + BLANK:
            continue
        found = []
        for part in (
            1e-4,
            1e-3,
        ):  # a small step rounds (1.3e-5 with e_X, 1e-7 with a larger one), a large one bends
            h = part * (model.prior_sd(label) if "." in label else abs(par[free[k]]))
            ends, values = [], []
            for d in (h, -h):
                moved = par.copy()
                moved[free[k]] += d
                there = interval_maps(model, moved, plan, states, (), nothing)
                ends.append(there.ends)
                values.append(readings_on(model, moved, plan, states, there, nothing).values)
            found.append(
                max(
                    same(maps.psi[:, :, k], (ends[0] - ends[1]) / (2 * h)),
                    same(readings.by_parameter[:, :, k], (values[0] - values[1]) / (2 * h)),
                )
            )
        worst[label] = min(found)
    bad = {k: v for k, v in worst.items() if not v < 1e-5}
    assert not bad


@pytest.mark.parametrize("name", VEHICLES)
def test_readings_by_state_are_central_differences_when_no_sensor_is_late(name):
    model, par, plan, _ = case(name)
    states, nothing = rough_path(name), np.zeros(0, dtype=np.int64)
    maps = interval_maps(model, par, plan, states, (), nothing)
    slope = readings_on(model, par, plan, states, maps, nothing).by_state
    for k in range(states.shape[1]):
        h = 1e-5 * max(np.ptp(states[:, k]), 1e-3)
        step = h * np.eye(states.shape[1])[k]
        value = [readings_on(model, par, plan, states + d, maps, nothing).values for d in (step, -step)]
        assert same(slope[:, :, k], (value[0] - value[1]) / (2 * h)) < CLOSE


@pytest.mark.parametrize("name", VEHICLES)
def test_a_simulated_track_has_no_defects(name):
    model, par, plan, _ = case(name)
    track = simulate(model, par, plan, steady_start(model), full=True).states
    ends = interval_maps(model, par, plan, track, (), np.zeros(0, dtype=np.int64)).ends
    np.testing.assert_allclose(ends, track[1:], rtol=1e-12, atol=1e-12 * np.abs(track).max())


@pytest.mark.parametrize("name", VEHICLES)
def test_interval_maps_compose_to_the_sensitivities_of_the_whole_run(name):
    model, par, plan, _ = case(name)
    _, free = free_of(model)
    whole = sensitivities(model, par, plan, steady_start(model), free, full=True)
    maps = interval_maps(model, par, plan, whole.track.states, (), free)
    moved = whole.jacobian[0]
    for i in range(plan.t.size - 1):
        moved = maps.phi[i] @ moved
        moved[:, : free.size] += maps.psi[i]
    expected = whole.jacobian[-1]
    size = np.maximum(np.abs(expected).max(axis=0), 1e-300)
    assert (np.abs(moved - expected).max(axis=0) / size).max() < 1e-9


@lru_cache
def late(name, share):
    """Readings and total slopes of a turn, sensors late by a share of L/U, both ways.

    Errors are over the largest entry of a column in any channel; lengths over L, velocities over U.
    """
    model, base, _, inputs = case(name)
    s = model.scales
    t = 0.05 * s["L"] / s["U"] * np.arange(60)
    plan = plan_run(model, t, {"n_cmd": inputs["n_cmd"], "delta_r_cmd": np.full(60, 0.1)})
    par = base.copy()
    par[model.positions(DELAYS)] = share * s["L"] / s["U"]
    names, free = free_of(model)
    whole = sensitivities(model, par, plan, steady_start(model), free, full=True, rates=True)
    expected_values, expected = observe_sensitivity(model, par, plan, whole, free)
    maps = interval_maps(model, par, plan, whole.track.states, (), free)
    readings = readings_on(model, par, plan, whole.track.states, maps, free)
    total = np.einsum("icx,ixk->ick", readings.by_state, whole.jacobian)
    total[:, :, : free.size] += readings.by_parameter
    unit = {"x": "L", "y": "L", "u": "U", "v": "U", "u_water": "U", "v_water": "U"}
    scale = np.array([s[unit[c]] if c in unit else 1.0 for c in model.kernel.channels])
    scale[model.kernel.channels.index("r")] = s["U"] / s["L"]
    # before the first sample there is nothing to interpolate; the last sample has one-sided rates
    inside = slice(10, -1)
    off = np.abs(readings.values - expected_values)[inside] / scale
    size = (np.abs(expected[inside]) / scale[:, None]).max(axis=(0, 1))
    wrong = (np.abs(total - expected)[inside] / scale[:, None]).max(axis=(0, 1))
    wrong[[names.index(n) for n in BLANK]] = 0.0
    return off.max(), dict(zip([*names, *model.states], wrong / np.maximum(size, 1e-300), strict=True))


@pytest.mark.parametrize("name", VEHICLES)
def test_late_readings_are_those_of_a_cubic_through_the_track_to_third_order(name):
    full, half = late(name, 0.2)[0], late(name, 0.1)[0]
    assert full < 3e-3
    assert full > 6.0 * half  # 8 by theory


@pytest.mark.parametrize("name", VEHICLES)
def test_slopes_of_late_readings_by_start_and_parameters_are_those_of_whole_runs(name):
    prompt, full = late(name, 0.0)[1], late(name, 0.2)[1]
    # the delay itself is a difference of rates at samples 0.05 L/U apart, all others are exact without delay
    assert max(v for k, v in prompt.items() if k not in LATE) < 1e-9
    assert max(prompt[k] for k in LATE) < 5e-3
    assert {k: v for k, v in full.items() if not v < (0.15 if k in LATE else 0.05)} == {}


@pytest.mark.parametrize("name", VEHICLES)
def test_inertia_ratio_is_one_at_nominal_and_its_slope_a_central_difference(name):
    model, _, _, _ = case(name)
    names = [n for n in model.coefficients if n.endswith("dot")]
    free = model.positions(names)
    ratio, slope = inertia_ratio(model, model.nominal, free)
    np.testing.assert_allclose(ratio, np.eye(3), atol=1e-12)
    for k, n in enumerate(names):
        value = model.nominal[free[k]]
        h = 1e-2 * max(abs(value), 1e-3)
        moved = [inertia_ratio(model, model.with_values({n: value + d}), free)[0] for d in (h, -h)]
        size = np.abs(slope[k]).max()
        # the mass matrix is linear in its coefficients: any step gives the slope
        np.testing.assert_allclose(slope[k], (moved[0] - moved[1]) / (2 * h), atol=1e-6 * size, err_msg=n)
        row = "XYN".index(n[0])
        assert np.abs(slope[k][row]).max() == size, n


def log_of(model, plan, states, par):
    """Readings of a track without noise, all channels."""
    count = len(model.kernel.channels)
    maps = interval_maps(model, par, plan, states, (), np.zeros(0, dtype=np.int64))
    data = readings_on(model, par, plan, states, maps, np.zeros(0, dtype=np.int64)).values
    return RunData(
        "a", plan, model.kernel.channels, data, np.full(count, 0.1), states[0], model.kernel.full.states,
        np.full(states.shape[1], 1.0), "zig-zag", path=states,
    )  # fmt: skip


@pytest.mark.parametrize("name", VEHICLES)
def test_the_acceleration_of_a_latent_moment_does_not_depend_on_the_inertia(name):
    model, _, plan, _ = case(name)
    states, free = rough_path(name), model.positions(["N_rdot", "Y_vdot"])
    force = np.zeros((plan.t.size - 1, 3))
    force[:, 2] = 1e-4 * model.scales["rho"] * model.scales["L"] ** 3 * model.scales["U"] ** 2
    r = list(model.kernel.full.states).index("r")
    nothing = np.zeros(0, dtype=np.int64)

    def gain(factor, scaled=True):
        """Rate gained over one interval by the latent moment, inertia times a factor."""
        par = model.with_values({"N_rdot": factor * model.nominal[free[0]]})
        ratio = inertia_ratio(model, par, free)[0] if scaled else np.eye(3)
        pushed = with_forces(model, plan, force @ ratio.T)
        ends = [interval_maps(model, par, p, states, (), nothing).ends for p in (pushed, plan)]
        return (ends[0] - ends[1])[:, r]

    # what is left is damping within the interval of 0.25 L/U, which more inertia slows
    assert same(gain(1.5), gain(1.0)) < 0.1
    assert same(gain(1.5, scaled=False), gain(1.0)) > 0.13


@pytest.mark.parametrize("name", VEHICLES)
def test_a_path_with_latent_forces_has_the_slope_of_its_own_defects(name):
    # by parameters the force is held at fixed acceleration: the slope must count that, too
    model, _, plan, _ = case(name)
    states, names = rough_path(name), ["N_rdot", "Y_vdot", "X_udot", "N_r", "Y_v"]
    names = [n for n in names if n in model.index and model.nominal[model.index[n]] != 0]
    free = model.positions(names)
    rng = np.random.default_rng(1)
    s = model.scales
    unit = 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2 * np.array([1.0, 1.0, s["L"]])
    force = 3e-3 * unit * rng.standard_normal((plan.t.size - 1, 3))
    log = log_of(model, plan, states, model.nominal)
    path = linearise(model, log, Trajectory(model.nominal, states, force), free)
    for k, n in enumerate(names):
        h = 1e-3 * abs(model.nominal[free[k]])
        defect = []
        for d in (h, -h):
            par = model.with_values({n: model.nominal[free[k]] + d})
            defect.append(linearise(model, log, Trajectory(par, states, force), free).defect)
        assert same(path.psi[:, :, k], (defect[0] - defect[1]) / (2 * h)) < 1e-5, n
    for j in range(3):
        h = 1e-6 * unit[j]
        step = h * np.eye(3)[j]
        defect = [
            linearise(model, log, Trajectory(model.nominal, states, force + d), free).defect
            for d in (step, -step)
        ]
        assert same(path.gamma[:, :, j], (defect[0] - defect[1]) / (2 * h)) < 1e-5


@pytest.mark.parametrize("name", VEHICLES)
def test_a_row_of_the_balance_may_not_shrink_together_with_its_noise(name):
    """All of the yaw balance times one factor, inertia too: the same track, and the same likelihood."""
    model, _, plan, _ = case(name)
    assert model.nominal[model.index["x_G"]] == 0.0  # no rigid-body moment but Izz rdot
    states = simulate(model, model.nominal, plan, steady_start(model), full=True).states
    s, nothing = model.scales, np.zeros(0, dtype=np.int64)
    unit = 1e-3 * 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
    rng = np.random.default_rng(2)
    log = log_of(model, plan, states, model.nominal)
    log = replace(log, readings=log.readings + 0.1 * rng.standard_normal(log.readings.shape))

    def cost(factor, moment=1.0):
        row = ["Izz", *(n for n in model.coefficients if n.startswith("N_"))]
        par = model.with_values({n: factor * model.nominal[model.index[n]] for n in row})
        path = linearise(model, log, Trajectory(par, states, np.zeros((plan.t.size - 1, 3))), nothing)
        assert np.abs(path.defect).max() < 1e-9 * np.abs(states).max()
        noise_model = NoiseModel(
            (unit, unit, moment * unit * s["L"]), s["L"] / s["U"], 0.1, 20 * s["L"] / s["U"]
        )
        w = whitened(model, path, np.zeros(0), np.zeros(0), noise_model)
        return w.resid @ w.resid + w.logdet

    nominal = cost(1.0)
    assert abs(cost(0.6) - nominal) < 1e-6 * abs(nominal)
    # control: noise that did not shrink with the row would be worth this much
    assert abs(cost(1.0, moment=1 / 0.6) - nominal) > 1.0


@pytest.mark.thorough
@pytest.mark.parametrize("name", [pytest.param("nps_auv2", marks=pytest.mark.slow), "generic_sub"])
def test_maps_are_numbers_where_there_is_no_cross_flow_at_all(name):
    model = build_model(load_vehicle(name), 6)
    states = model.kernel.full.states
    plan = plan_run(model, np.arange(3) * 0.5, {"n_cmd": np.full(3, model.vehicle.rpm_ref or 100.0)})
    found = []
    for aside in (0.0, 1e-7):
        at = np.zeros((3, len(states)))
        at[:, states.index("u")], at[:, states.index("v")] = model.scales["U"], aside
        found.append(interval_maps(model, model.nominal, plan, at, (), np.arange(20)))
    for part in ("ends", "phi", "psi"):
        still, near = (getattr(maps, part) for maps in found)
        assert np.isfinite(still).all()
        np.testing.assert_allclose(still, near, rtol=1e-5, atol=1e-5 * np.abs(near).max())


def test_actuator_motions_that_a_run_keeps_are_few_and_small_in_all(monkeypatch):
    model, par, plan, _ = case("generic_sub")
    plan = replace(plan)  # nothing kept yet
    lag = model.index["actuator_lag.tau"]
    free = np.array([lag])

    def kept(share):
        moved = par.copy()
        moved[lag] = share * model.scales["L"] / model.scales["U"]
        chain = chain_of(model, moved, plan, free)
        return chain, list(plan.kept["chains"][1].values())

    first, _ = kept(0.1)
    assert kept(0.1)[0] is first
    chains = [kept(share)[1] for share in (0.2, 0.3, 0.4)][-1]
    assert len(chains) == maps_module.MOST_CHAINS and first not in chains
    size = chains[-1].act.nbytes + chains[-1].dact.nbytes
    monkeypatch.setattr(maps_module, "MOST_BYTES", int(2.5 * size))
    assert len(kept(0.5)[1]) == 2
    monkeypatch.setattr(maps_module, "MOST_BYTES", size // 2)
    made, chains = kept(0.6)
    assert made not in chains
