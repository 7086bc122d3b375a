"""A velocity log that loses the bottom for a stretch is told with begin, end and size; nothing else is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bayesid.report.input import finding_sentence
from bayesid.trials import Run
from bayesid.trials.correction import apply
from bayesid.trials.kinematics.dead_reckoning import difference
from bayesid.trials.kinematics.drifting_stretch import Stretch, drifting_stretch, walk_beside
from bayesid.trials.mistakes import InputFinding, check_input
from bayesid.trials.mistakes.judge import base_of, named
from bayesid.trials.mistakes.lost_bottom import LEAST_WALK, is_clear, lost_bottom

SPEED, FIX, CURRENT = 1.6, 0.3, 0.16 * np.exp(1j * math.radians(70.0))  # m/s, m, m/s
FROM, TO = 31.0, 62.0  # s


def survey(seed: int = 0, name: str = "zz", dt: float = 0.2, n: int = 480) -> Run:
    """An AUV that weaves, fixes at 1 Hz and all else at 5 Hz; track and velocities from one integral."""
    rng = np.random.default_rng(seed)
    t = dt * np.arange(n)
    r = 0.12 * np.sin(0.3 * t + seed)
    psi = 1.9 + np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * dt)))
    body = SPEED - 0.05 * np.sin(0.1 * t) ** 2 - 0.4j * r
    velocity = body * np.exp(1j * psi)
    place = np.concatenate(([0j], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * dt)))
    noise = lambda s: s * rng.standard_normal(n)  # noqa: E731
    fixes = place + noise(FIX) + 1j * noise(FIX)
    fixes[np.arange(n) % 5 != 0] = np.nan
    data = {
        "x": fixes.real, "y": fixes.imag, "psi": psi + noise(0.005), "r": r + noise(0.003),
        "u": body.real + noise(0.015), "v": body.imag + noise(0.015),
    }  # fmt: skip
    return Run(name, "", "identify", t, data, {})


def with_velocity(run: Run, wrong: np.ndarray) -> Run:
    """The log reads velocities that are off by this, north + i east, at each sample."""
    body = wrong * np.exp(-1j * run.data["psi"])
    return replace(run, data={**run.data, "u": run.data["u"] + body.real, "v": run.data["v"] + body.imag})


def lost(run: Run, begin: float = FROM, end: float = TO, current: complex = CURRENT) -> Run:
    """Speed through the water between two times."""
    return with_velocity(run, -current * ((run.t >= begin) & (run.t < end)))


def found(run: Run) -> Stretch:
    d = difference(run)
    assert d is not None
    one = drifting_stretch(d, max(walk_beside(d), LEAST_WALK * d.speed**2))
    assert one is not None
    return one


def told(run: Run) -> bool:
    """Whether the check says it of a trial of this run alone."""
    return bool(lost_bottom([base_of(run)]))


def test_a_lost_bottom_is_told_with_its_begin_end_size_and_direction():
    one = found(lost(survey()))
    assert is_clear(one, SPEED)
    assert one.begin == pytest.approx(FROM, abs=4.0) and one.end == pytest.approx(TO, abs=4.0)
    assert abs(one.velocity - CURRENT) < 0.03
    assert one.noise == pytest.approx(FIX, rel=0.15)


@pytest.mark.parametrize("seed", range(4))
def test_a_clean_run_has_none(seed):
    assert not told(survey(seed))


def test_the_check_names_the_run_and_its_mend_leaves_the_stretch_out():
    run = lost(survey(2, "b"))
    (one,) = check_input([run]).findings
    assert one.name == "bottom lock lost" and one.runs == ("b",) and one.channels == ("u", "v")
    words = finding_sentence(one)
    assert "s of b the fixes move on by 0.1" in words and "(bottom lock lost)" in words
    assert 'leave_out = [{ run = "b", channels = ["u", "v"], from = ' in words
    assert one.correction is not None and not told(apply(one.correction, run))


def test_two_runs_are_one_mistake_with_two_stretches():
    runs = [survey(1, "a"), lost(survey(2, "b")), lost(survey(3, "c"), 20.0, 55.0)]
    (one,) = lost_bottom([base_of(run) for run in runs])
    assert one.mistake.correction is not None and one.mistake.correction.names_runs == ("b", "c")
    assert one.odds[0] == 0.0 and (one.odds[1:] > 20.0).all()
    finding = named([one], ["a", "b", "c"])
    assert finding is not None and finding.runs == ("b", "c") and not finding.all_runs
    assert " in b and c (" not in finding_sentence(finding)


def test_a_loss_of_two_percent_of_the_speed_is_within_the_noise():
    assert not told(lost(survey(), current=0.2 * CURRENT))


def test_fixes_that_jump_are_no_lost_bottom():
    for size, end in ((2.0, 200.0), (8.0, 200.0), (3.0, 55.0), (30.0, 44.0)):
        run = survey(3)
        away = size * ((run.t > 33.3) & (run.t < end))
        assert not told(replace(run, data={**run.data, "x": run.data["x"] + away}))


def test_outliers_and_a_gap_of_fixes_or_velocities_are_none():
    run = survey(4)
    x, u = run.data["x"].copy(), run.data["u"].copy()
    x[150:165:5] += 25.0
    assert not told(replace(run, data={**run.data, "x": x}))
    x[200:300] = np.nan
    assert not told(replace(run, data={**run.data, "x": x}))
    u[200:300] = np.nan
    assert not told(replace(run, data={**run.data, "u": u}))


@pytest.mark.parametrize("current", [0.1, 0.3])
def test_a_constant_current_all_through_is_none(current):
    run = survey(5)
    assert not told(with_velocity(run, current * np.exp(1j) * np.ones(run.n_samples)))


def test_a_current_that_changes_evenly_is_none():
    run = survey(5)
    assert not told(with_velocity(run, CURRENT * run.t / run.t[-1]))


def test_what_sensors_honestly_do_is_none():
    run = survey(6)
    data, turned = run.data, np.exp(1j * run.data["psi"])
    w = (data["u"] + 1j * data["v"]) * 1.05 * np.exp(0.05j)
    assert not told(replace(run, data={**data, "u": w.real, "v": w.imag}))
    arm = (0.6 + 0.2j) * turned
    assert not told(replace(run, data={**data, "x": data["x"] + arm.real, "y": data["y"] + arm.imag}))
    late = {k: np.interp(run.t - 0.6, run.t, data[k]) for k in ("u", "v")}
    assert not told(replace(run, data={**data, **late}))
    assert not told(replace(run, data={**data, "psi": data["psi"] + 0.04 * np.sin(data["psi"])}))


def test_a_speed_through_the_water_is_not_asked():
    run = lost(survey())
    water = {"u": "u_water", "v": "v_water"}
    assert not told(replace(run, data={water.get(k, k): v for k, v in run.data.items()}))


def test_velocities_made_from_the_track_are_not_asked():
    rng, run = np.random.default_rng(1), survey(dt=0.1, n=1500)
    velocity = (SPEED - 0.4j * run.data["r"]) * np.exp(1j * run.data["psi"])
    place = np.cumsum(velocity * 0.1) + 0.02 * (rng.standard_normal(1500) + 1j * rng.standard_normal(1500))
    body = np.convolve(np.gradient(place, 0.1), np.full(20, 0.05), mode="same") * np.exp(
        -1j * run.data["psi"]
    )
    data = {**run.data, "x": place.real, "y": place.imag, "u": body.real, "v": body.imag}
    spoilt = lost(replace(run, data=data), 60.0, 110.0)
    assert is_clear(found(spoilt), SPEED)  # the control: nothing but its origin keeps it silent
    assert not told(spoilt)


def test_a_run_that_logs_depth_but_not_heave_is_not_asked():
    run = lost(survey())
    assert difference(replace(run, data={**run.data, "z": 0.0 * run.t})) is None
    level = dict.fromkeys(("z", "phi", "theta", "w"), 0.0 * run.t)
    assert difference(replace(run, data={**run.data, **level})) is not None


def test_a_finding_of_other_mistakes_still_names_its_runs():
    finding = InputFinding("n", "the sign", ("psi",), ("a",), False, 0.99, ("yaw",), 0.5, 0.1, None)
    assert " in a (" in finding_sentence(finding)
