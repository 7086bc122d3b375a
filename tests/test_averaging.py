"""Dense readings of long logs are averaged without moving what they say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gap_trials import model_of, noise_of

from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.noise_identification import no_process_noise
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import coefficient_prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Channels, Run, Trial, thin
from bayesid.trials.averaging import MOST_LEFT, WHOLE, averaged
from bayesid.trials.condensing import condensed

L_U = 20.0  # s
NOISE = {"psi": 0.01, "u": 0.05}


def trial_of(runs, noise=NOISE):
    return Trial("dense", Path("."), "", 3, tuple(runs), noise)


def run_of(t, psi, u, command, name="r1", role="identify"):
    return Run(name, "", role, t, Channels(psi=psi, u=u), {"delta_r_cmd": command})


def straight(n=4000, spacing=0.1, jitter=0.0, seed=0):
    rng = np.random.default_rng(seed)
    t = 5.0 + spacing * (np.arange(n) + jitter * rng.uniform(-0.4, 0.4, n))
    return run_of(t, 0.3 + 0.002 * t, 2.0 - 0.001 * t, np.where(t < 151.23, 0.0, 0.2))


def test_motion_without_bend_is_kept_exactly_whatever_the_stamps():
    for jitter in (0.0, 1.0):
        run = averaged(trial_of([straight(jitter=jitter)]), L_U, 500).runs[0]
        good = np.isfinite(run.data["psi"])
        assert good.sum() == pytest.approx(400, abs=5)
        np.testing.assert_allclose(run.data["psi"][good], 0.3 + 0.002 * run.t[good], atol=1e-12)
        np.testing.assert_allclose(run.data["u"][good], 2.0 - 0.001 * run.t[good], atol=1e-12)


def test_a_command_switches_when_it_did():
    was = straight()
    run = averaged(trial_of([was]), L_U, 500).runs[0]
    switched = was.t[np.argmax(was.commands["delta_r_cmd"] > 0)]
    assert run.t[np.argmax(run.commands["delta_r_cmd"] > 0)] == pytest.approx(switched, abs=1e-9)


@pytest.mark.parametrize("began", [None, -30.0])
def test_a_run_began_when_it_did(began):
    """From there effects that change with time count, not from the middle of the first block."""
    was = replace(straight(), began=began)
    run = averaged(trial_of([was]), L_U, 500).runs[0]
    assert run.t[0] > was.t[0] and run.began == (was.t[0] if began is None else began)


def test_inputs_measured_in_every_row_are_averaged_with_the_readings():
    """A rudder that is logged where it acts, and the air: the mean of a ramp is the ramp."""
    was = straight()
    ramp, gust = 1e-3 * was.t, 3.0 + 0.02 * was.t
    run = averaged(
        trial_of([replace(was, measured_inputs={"delta_r": ramp}, exogenous={"wind_north": gust})]), L_U, 500
    ).runs[0]
    assert run.n_samples < 0.2 * was.n_samples
    inside = slice(1, -1)
    np.testing.assert_allclose(run.measured_inputs["delta_r"][inside], 1e-3 * run.t[inside], atol=1e-12)
    np.testing.assert_allclose(run.exogenous["wind_north"][inside], 3.0 + 0.02 * run.t[inside], atol=1e-12)


def test_an_order_that_changes_with_every_sample_is_held_at_its_mean():
    """An autopilot's: to every sample it has pushed for as long and as much as the one logged."""
    was = straight()
    order = 0.1 * np.sin(was.t) + 0.01 * np.random.default_rng(0).standard_normal(was.t.size)
    run = averaged(trial_of([replace(was, commands={"delta_r_cmd": order})]), L_U, 500).runs[0]
    assert run.n_samples < 0.2 * was.n_samples
    pushed = np.concatenate([[0.0], np.cumsum(order[:-1] * np.diff(was.t))])
    held = np.cumsum(run.commands["delta_r_cmd"][:-1] * np.diff(run.t))
    expected = np.interp(run.t[1:], was.t, pushed) - np.interp(run.t[0], was.t, pushed)
    np.testing.assert_allclose(held, expected, atol=1e-9)
    # control: the order at the sample, held to the next one, has pushed otherwise
    lone = np.cumsum(order[np.searchsorted(was.t, run.t[:-1])] * np.diff(run.t))
    assert np.abs(lone - expected).max() > 0.01


def test_an_order_that_changes_all_the_time_jumps_when_it_did():
    """A spiral: the rudder goes hard over at once, then back bit by bit."""
    was = straight()
    order = np.where(was.t < 61.23, 0.0, -0.35 + 0.0004 * (was.t - 61.23))
    run = averaged(trial_of([replace(was, commands={"delta_r_cmd": order})]), L_U, 500).runs[0]
    at = was.t[np.argmax(order < -0.3)]
    switched = np.searchsorted(run.t, at - 1e-9)
    assert run.t[switched] == pytest.approx(at, abs=1e-9) and run.t.size < 600
    held = run.commands["delta_r_cmd"]
    assert held[switched - 1] == 0.0 and held[switched] == pytest.approx(-0.35, abs=1e-3)


def test_an_order_that_jumps_all_the_time_is_held_at_its_mean():
    """Steps of a controller that switches, in the noise of a measured pulse width."""
    was, rng = straight(), np.random.default_rng(1)
    order = np.where(rng.random(was.t.size) < 0.3, 0.2, 0.0) + 0.001 * rng.standard_normal(was.t.size)
    run = averaged(trial_of([replace(was, commands={"delta_r_cmd": order})]), L_U, 500).runs[0]
    assert run.t.size < 450


def test_averages_know_what_a_single_reading_is_worth_whether_or_not_its_noise_is_stated():
    out = averaged(trial_of([straight()], {"psi": 0.01}), L_U, 500)
    single = out.of_single_readings({"psi": out.noise["psi"], "u": 1.0, "z": 1.0})
    assert single["psi"] == pytest.approx(0.01) and single["u"] == pytest.approx(np.sqrt(10), rel=0.02)
    assert single["z"] == 1.0


def test_revolutions_that_change_with_every_sample_are_held_at_those_of_their_thrust():
    """A thruster that holds a depth goes ahead and astern; the mean of its revolutions is another thrust."""
    was = straight()
    order = 300.0 * np.sin(0.9 * was.t) + 40.0 * np.random.default_rng(0).standard_normal(was.t.size)
    out = averaged(trial_of([replace(was, commands={"n_5_cmd": order})]), L_U, 500)
    run = out.runs[0]
    assert "n_5_cmd held at means" in out.warnings[-1]
    pushed = np.concatenate([[0.0], np.cumsum((order * np.abs(order))[:-1] * np.diff(was.t))])
    n = run.commands["n_5_cmd"][:-1]
    expected = np.diff(np.interp(run.t, was.t, pushed)) / np.diff(run.t)
    np.testing.assert_allclose(n * np.abs(n), expected, atol=1e-6)


@pytest.mark.parametrize("every", [2, 4])
def test_an_average_beside_the_middle_of_its_readings_has_the_noise_it_states(every):
    """Blocks about readings of a seldom channel: a line through two readings is worth one at the second."""
    t, rng = 5.0 + 0.1 * np.arange(24000), np.random.default_rng(5)
    seldom = np.where(np.arange(t.size) % every == 0, 2.0 + 0.05 * rng.standard_normal(t.size), np.nan)
    run = run_of(t, 0.3 + 0.01 * rng.standard_normal(t.size), seldom, np.zeros(t.size))
    for most in (1000, 20000):  # with and without need to lose weight
        out = averaged(trial_of([run]), 0.8 * every, most)
        psi = out.runs[0].data["psi"]
        z = (psi[np.isfinite(psi)] - 0.3) / out.noise["psi"]
        assert np.mean(z**2) == pytest.approx(1.0, abs=5 * np.sqrt(2 / z.size))
        weight = np.isfinite(psi).sum() / out.noise["psi"] ** 2 / (t.size / NOISE["psi"] ** 2)
        assert weight > (WHOLE if most == 20000 else 0.45)


def test_seldom_readings_are_put_into_the_middles_of_blocks():
    """So that they need no samples of their own, also where their stamps are not exact."""
    was, rng = straight(), np.random.default_rng(1)
    slow = np.where(np.arange(4000) % 10 == 7, was.data["u"], np.nan)
    t = was.t + 0.002 * rng.uniform(-1.0, 1.0, was.n_samples)
    data = {"psi": 0.3 + 0.002 * t, "u": np.where(np.isfinite(slow), 2.0 - 0.001 * t, np.nan)}
    out = averaged(trial_of([replace(was, t=t, data=data)]), L_U, 500)
    run = out.runs[0]
    assert np.isfinite(run.data["u"]).sum() >= 398 and run.n_samples <= 402  # the last may be beyond it
    good = np.isfinite(run.data["u"])
    np.testing.assert_allclose(run.data["u"][good], 2.0 - 0.001 * run.t[good], atol=1e-12)
    assert out.noise["u"] == NOISE["u"]


def test_the_noise_stated_of_an_average_is_the_one_it_has():
    was, rng = straight(), np.random.default_rng(3)
    noisy = replace(was, data={c: v + NOISE[c] * rng.standard_normal(v.size) for c, v in was.data.items()})
    out = averaged(trial_of([noisy]), L_U, 500)
    run = out.runs[0]
    z = (run.data["psi"] - 0.3 - 0.002 * run.t) / out.noise["psi"]
    z = z[np.isfinite(z)]
    assert out.noise["psi"] == pytest.approx(NOISE["psi"] / np.sqrt(10))
    # 400 unit normals: the mean square is within 4 sd of 1
    assert np.mean(z**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / z.size))


def test_an_imported_log_without_stated_noise_is_averaged_by_the_noise_its_readings_show():
    was, rng, vehicle = straight(12000, spacing=0.02), np.random.default_rng(4), load_vehicle("nps_auv2")
    noisy = replace(was, data={c: v + NOISE[c] * rng.standard_normal(v.size) for c, v in was.data.items()})
    stated = condensed(trial_of([noisy]), vehicle, 5000)
    seen = condensed(trial_of([noisy], {}), vehicle, 5000, as_seen=True)
    assert seen.runs[0].n_samples == stated.runs[0].n_samples < 0.2 * was.n_samples
    for name in NOISE:
        np.testing.assert_array_equal(seen.runs[0].data[name], stated.runs[0].data[name])
        # 12000 third differences tell a noise within about 1 %
        assert seen.noise[name] == pytest.approx(stated.noise[name], rel=0.04)
    assert any("psi, u is not stated" in text for text in seen.warnings)
    # a channel that stands still has no noise to weigh it by: that of the least sensor is taken, not zero
    still = replace(noisy, data={**noisy.data, "u": np.full(was.n_samples, 2.0)})
    least = condensed(trial_of([still], {}), vehicle, 5000, as_seen=True)
    assert least.runs[0].n_samples == stated.runs[0].n_samples and least.noise["u"] > 0.0
    # control: where nobody may see to the noise, nothing is averaged
    bare = trial_of([noisy], {})
    assert condensed(bare, vehicle, 5000) is bare


def test_blocks_are_halved_until_what_the_motion_bends_is_small_beside_the_noise():
    t = 0.1 * np.arange(8000)
    swing = 0.5 * np.sin(2 * np.pi * t / 8.0)
    trial = trial_of([run_of(t, swing, np.full(t.size, 2.0), np.zeros(t.size))], {"psi": 0.004, "u": 0.05})
    out = averaged(trial, L_U, 500).runs[0]
    good = np.isfinite(out.data["psi"])
    width = float(np.median(np.diff(out.t[good])))
    assert 0.15 < width < 0.9  # shorter than the 1.0 s of a calm run
    error = out.data["psi"][good] - 0.5 * np.sin(2 * np.pi * out.t[good] / 8.0)
    assert np.sqrt(np.mean(error**2)) < MOST_LEFT / 3.0 * 0.004 / np.sqrt(width / 0.1)


def test_short_logs_sparse_ones_and_unlike_rates_stay_as_they_are():
    trial = trial_of([straight(400)])
    assert averaged(trial, L_U, 500) is trial
    sparse = trial_of([straight(4000, spacing=8.0)])
    assert averaged(sparse, L_U, 500) is sparse
    unlike = trial_of([straight(), replace(straight(4000, spacing=0.2), name="r2")])
    assert averaged(unlike, L_U, 500) is unlike


def test_a_channel_slower_than_the_rows_keeps_its_own_readings_and_noise():
    was = straight()
    slow = np.where(np.arange(4000) % 25 == 7, was.data["u"], np.nan)
    out = averaged(trial_of([replace(was, data={"psi": was.data["psi"], "u": slow})]), L_U, 500)
    run = out.runs[0]
    good = np.isfinite(run.data["u"])
    kept = was.t[np.isfinite(slow)]
    kept = kept[(kept >= run.t[0]) & (kept <= run.t[-1])]
    np.testing.assert_allclose(run.t[good], kept, atol=1e-9)
    np.testing.assert_allclose(run.data["u"][good], 2.0 - 0.001 * kept, rtol=1e-12)
    assert out.noise["u"] == NOISE["u"]


@pytest.mark.parametrize("n", [4000, 3995, 3998, 55])
@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_bend_is_taken_off_to_the_ends_and_whatever_the_readings_of_a_block(n, every):
    """A parabola, whose averages a bend moves by a 24th of its second difference at most."""
    t = 0.1 * np.arange(n)
    data = np.where((np.arange(n) % every == 0) & (np.abs(t - 150.0) > 20.0), 0.01 * t**2, np.nan)
    busy = np.full(n, 2.0)
    out = averaged(trial_of([run_of(t, data, busy, np.zeros(n))]), L_U, n // 8).runs[0]
    good = np.isfinite(out.data["psi"])
    width = float(np.median(np.diff(out.t[good])))
    error = out.data["psi"][good] - 0.01 * out.t[good] ** 2
    assert good.sum() > 4 and np.abs(error).max() < 0.1 * 0.02 * width**2 / 24.0


@pytest.mark.parametrize("more", [0, 1, 2, 3, 5])
def test_a_sample_more_in_one_run_does_not_keep_a_trial_from_being_averaged(more):
    runs = []
    for name, n in (("r1", 3000), ("r2", 4000 + more)):
        was = straight(n)
        slow = np.where(np.arange(n) % 2 == more % 2, was.data["u"], np.nan)
        runs.append(replace(was, name=name, data={"psi": was.data["psi"], "u": slow}))
    out = averaged(trial_of(runs), 10.0, 1000)
    assert sum(run.n_samples for run in out.runs) < 1010


@pytest.mark.parametrize("n", [2, 5, 12])
def test_a_run_shorter_than_two_blocks_becomes_one_average_and_stops_no_other(n):
    """It ended in an IndexError."""
    short = straight(n)
    out = averaged(trial_of([straight(), replace(short, name="short")]), L_U, 500)
    assert out.runs[0].n_samples < 0.2 * 4000 and out.noise["psi"] == pytest.approx(
        NOISE["psi"] / np.sqrt(10)
    )
    run = out.runs[1]
    good = np.isfinite(run.data["psi"])
    assert run.n_samples == 3 and good.sum() == 1
    assert run.t[0] == short.t[0] and run.t[-1] == pytest.approx(short.t[-1])
    np.testing.assert_allclose(run.data["psi"][good], 0.3 + 0.002 * run.t[good], atol=1e-12)


def test_a_fit_finds_the_same_under_an_autopilot_and_with_sensors_of_different_rates():
    # an order that changes with every sample; fixes read every 20th, speeds every 4th
    model = model_of("remus100")
    s, rng, n = model.scales, np.random.default_rng(5), 400
    unit = s["L"] / s["U"]
    t = 0.05 * unit * np.arange(n)
    order = 0.15 * np.sin(0.6 * t / unit) + 0.05 * np.sin(2.3 * t / unit) + 0.02 * rng.standard_normal(n)
    commands = {"n_cmd": np.full(n, model.vehicle.rpm_ref), "delta_r_cmd": order}
    states = simulate(
        model, model.nominal, plan_run(model, t, commands), steady_start(model), full=True
    ).states
    noise = {c: 3.0 * v for c, v in noise_of(model).items()}
    data = {}
    for c, sd in noise.items():
        read = states[:, model.kernel.full.states.index(c)] + sd * rng.standard_normal(n)
        every = {"x": 20, "y": 20, "u": 4, "v": 4}.get(c, 1)
        data[c] = np.where(np.arange(n) % every == min(1, every - 1), read, np.nan)
    trial = trial_of([Run("auto", "", "identify", t, data, commands)], noise)
    few = averaged(trial, unit, 200)
    assert few.runs[0].n_samples <= 200
    free, found = coefficient_prior(model), []
    for one in (trial, few):
        log = filter_error_run(model, one.runs[0], one.noise, tuple(noise))
        found.append(fit(model, [log], free, no_process_noise(model), initial_noise_scale=0.0))
    whole, part = found
    assert whole.converged and part.converged
    assert np.abs((part.values - whole.values) / whole.sd).max() < 0.6
    np.testing.assert_allclose(part.sd, whole.sd, rtol=0.05)


def test_a_fit_to_averages_finds_what_a_fit_to_all_readings_finds():
    # a vehicle with another yaw damping and rudder, read every 0.01 L/U
    model = model_of("remus100")
    s, rng = model.scales, np.random.default_rng(5)
    unit = s["L"] / s["U"]
    n = 2000
    t = 0.01 * unit * np.arange(n)
    commands = {
        "n_cmd": np.full(n, model.vehicle.rpm_ref),
        "delta_r_cmd": 0.2 * np.sign(np.sin(0.6 * t / unit)),
    }
    true = model.with_values({k: 1.1 * model.nominal[model.index[k]] for k in ("N_r", "N_dr")})
    states = simulate(model, true, plan_run(model, t, commands), steady_start(model), full=True).states
    noise = {c: 3.0 * v for c, v in noise_of(model).items()}
    at = {c: model.kernel.full.states.index(c) for c in noise}
    data = {c: states[:, at[c]] + sd * rng.standard_normal(n) for c, sd in noise.items()}
    trial = trial_of([Run("zz", "zigzag", "identify", t, data, commands)], noise)
    few = averaged(trial, unit, 450)
    assert np.isfinite(few.runs[0].data["psi"]).sum() == pytest.approx(n / 5, abs=2)
    free = coefficient_prior(model)
    found = []
    for one in (trial, few):
        log = filter_error_run(model, one.runs[0], one.noise, tuple(noise))
        found.append(fit(model, [log], free, no_process_noise(model), initial_noise_scale=0.0))
    whole, part = found
    assert whole.converged and part.converged
    # an average loses only what motion does within it and the last readings of a run
    assert np.abs((part.values - whole.values) / whole.sd).max() < 0.3
    np.testing.assert_allclose(part.sd, whole.sd, rtol=0.05)
    # control: single readings every fifth know less
    lone = thin(trial.runs[0], 0.05 * unit)
    log = filter_error_run(model, lone, trial.noise, tuple(noise))
    alone = fit(model, [log], free, no_process_noise(model), initial_noise_scale=0.0)
    tightest = np.argmin(whole.sd / free.sd)
    assert alone.sd[tightest] > 1.2 * whole.sd[tightest]
