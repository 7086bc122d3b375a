"""How the columns of a measured wind were read: mends in trial.toml, and what the motion of a ship tells."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.api.inputs import model_of
from bayesid.diagnosis.input import check_trial, measured_wind, mended
from bayesid.diagnosis.input.measured_wind import check_wind
from bayesid.equations.model import build_model
from bayesid.errors import ModelError, TrialError
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from bayesid.trials import Run, Trial
from bayesid.trials.correction import Correction, apply, join
from bayesid.trials.importing import propose
from bayesid.trials.measured_wind import in_measured_wind
from bayesid.trials.mistakes.wind import WIND_MISTAKES
from bayesid.trials.true_wind import READINGS, TRUE, as_read, true_wind

SHIP = "esso_osaka_mmg"
NOISE = {"x": 0.01, "y": 0.01, "psi": 0.003, "u": 0.004, "v": 0.004, "r": 0.002}


def circles(seed: int, gain: float = 1.0, calm: bool = False) -> Trial:
    """Two turning circles of the ship in a gusty wind from 57 degrees that is measured."""
    rng, runs = np.random.default_rng(seed), []
    ship = load_vehicle(SHIP)
    for side in (1.0, -1.0):
        t = np.arange(0.0, 160.0, 1.0)
        speed = 2.0 + 0.5 * np.sin(t / 7.0) + 0.3 * np.sin(t / 2.3)
        wind = {"wind_speed": speed, "wind_from": 1.0 + 0.1 * np.sin(t / 11.0)}
        run = Run(f"turn{side:+.0f}", "turning circle 20", "identify", t, {}, exogenous={} if calm else wind)
        model = build_model(in_measured_wind(ship, Trial("t", Path("."), SHIP, 3, (run,), noise=NOISE)), 3)
        commands = {"delta_r_cmd": np.where(t > 10, side * 0.35, 0.0), "n_cmd": np.full(t.size, ship.rpm_ref)}
        plan = plan_run(model, t, commands, exogenous=run.exogenous)
        par = model.nominal if calm else model.with_values({"wind.gain": gain})
        track = simulate(model, par, plan, steady_start(model), full=True)
        data = {n: track.states[:, model.states.index(n)] for n in NOISE}
        data = {n: x + rng.normal(0.0, NOISE[n], t.size) for n, x in data.items()}
        runs.append(replace(run, data=data, commands=commands))
    return Trial("circles", Path("."), SHIP, 3, tuple(runs), noise=NOISE)


def misread(trial: Trial, name: str) -> Trial:
    """The trial as it is logged with a mistake of the table."""
    mistake = next(m for m in WIND_MISTAKES if m.name == name)
    runs = []
    for run in trial.runs:
        c, series = mistake.correction, {**run.data, **run.exogenous}
        wind = dict(zip(("wind_speed", "wind_from"), as_read(c.wind, run.t, series), strict=True))
        wind = {k: (x - c.offset.get(k, 0.0)) / c.scale.get(k, 1.0) for k, x in wind.items()}
        runs.append(replace(run, exogenous=wind))
    return replace(trial, runs=tuple(runs))


@pytest.mark.parametrize("reading", READINGS)
def test_what_is_read_on_board_becomes_the_true_wind_again(reading):
    t = np.linspace(0.0, 60.0, 200)
    series = {
        "wind_speed": 4.0 + np.sin(t), "wind_from": 1.0 + 0.2 * np.cos(t), "psi": 0.05 * t,
        "u": 2.0 + 0.1 * np.sin(0.1 * t), "v": -0.3 + 0.0 * t,
    }  # fmt: skip
    speed, come = as_read(reading, t, series)
    again = true_wind(reading, t, {**series, "wind_speed": speed, "wind_from": come})
    assert again[0] == pytest.approx(series["wind_speed"])
    assert np.exp(1j * again[1]) == pytest.approx(np.exp(1j * series["wind_from"]))


def test_in_still_air_the_apparent_wind_is_the_way_of_the_ship():
    """On any heading; by the velocities where they are logged, else by the track."""
    t = np.linspace(0.0, 100.0, 101)
    for psi in (0.0, 2.0):
        read = {
            "wind_speed": np.full(t.size, 5.0),
            "wind_from": np.zeros(t.size),
            "psi": np.full(t.size, psi),
        }
        moving = {"u": np.full(t.size, 5.0)}
        track = {"x": 5.0 * np.cos(psi) * t, "y": 5.0 * np.sin(psi) * t}
        for known in (moving, track):
            assert true_wind("apparent", t, {**read, **known})[0] == pytest.approx(0.0, abs=1e-6)


def test_an_apparent_wind_is_made_a_true_one_by_a_line_of_trial_toml(tmp_path):
    header = "t[s],x[m],y[m],psi[rad],delta_r_cmd[rad],n_cmd[rpm],wind_speed[m/s],wind_from[rad]\n"
    rows = [f"{k},{2.0 * k},0,0,0,100,5,{0.0}\n" for k in range(30)]
    (tmp_path / "a.csv").write_text(header + "".join(rows))
    text = f'format = 1\nvehicle = "{SHIP}"\n[[runs]]\nfile = "a.csv"\n[corrections]\nwind = "apparent"\n'
    (tmp_path / "trial.toml").write_text(text)
    from bayesid.trials import load_trial

    (run,) = load_trial(tmp_path).runs
    assert run.exogenous["wind_speed"] == pytest.approx(3.0, abs=1e-3)
    assert "corrected" in run.provenance[-1]
    (tmp_path / "trial.toml").write_text(text.replace('"apparent"', '"relative"'))
    with pytest.raises(TrialError, match="one of true, from the bow, apparent"):
        load_trial(tmp_path)


def test_a_wind_from_the_bow_needs_the_heading():
    t = np.arange(5.0)
    run = Run("a", "", "identify", t, {}, exogenous={"wind_speed": t, "wind_from": t})
    with pytest.raises(TrialError, match="needs the heading psi"):
        apply(Correction(wind="from the bow"), run)


def test_no_wind_no_question():
    trial = circles(0, calm=True)
    assert not check_wind(trial, model_of(trial)).asked


@pytest.mark.thorough
def test_a_wind_that_is_read_rightly_is_in_order():
    for seed in range(3):
        trial = circles(seed)
        found = check_wind(trial, model_of(trial))
        assert found.asked and found.in_order and found.finding is None and found.remark is None


TURNED = ("wind_from: where it blows to", "wind_from: from the bow", "apparent wind", "wind_from: from east")


@pytest.mark.thorough
@pytest.mark.parametrize("name", TURNED)
def test_a_direction_read_wrongly_is_told_by_the_motion(name):
    trial = misread(circles(1), name)
    check = check_trial(trial, model_of(trial))
    (finding,) = check.findings
    assert name in (finding.name, *finding.also)
    assert max(finding.probability, finding.together) > 0.95
    assert finding.correction is not None


@pytest.mark.thorough
def test_a_speed_in_another_unit_is_left_to_the_anemometer_or_the_unit():
    trial = misread(circles(2), "wind_speed: knots read as m/s")
    found = check_wind(trial, model_of(trial))
    said = found.remark or (found.finding and found.finding.says)
    assert said is not None and "knots" in said


@pytest.mark.thorough
def test_of_a_calm_that_is_measured_no_direction_is_in_order():
    """Every reading of no wind is the same: the motion says nothing of its direction."""
    still = [replace(r, exogenous={**r.exogenous, "wind_speed": 0.0 * r.t}) for r in circles(1).runs]
    trial = replace(circles(1), runs=tuple(still))
    found = check_wind(trial, model_of(trial))
    assert found.asked and not found.in_order and found.finding is None and found.remark is None


def test_in_calm_air_the_noise_of_an_anemometer_is_not_held_against_the_motion():
    """It proposed to read the wind from the bow, or from where it blows to."""
    trial, model = circles(1), model_of(circles(1))
    rng = np.random.default_rng(2)
    noise = {}
    for run in trial.runs:
        read = 0.3 * model.scales["U"] * (rng.standard_normal((2, run.t.size)).T @ [1.0, 1.0j])
        noise[run.name] = {"wind_speed": np.abs(read), "wind_from": np.angle(read)}
    calm = [replace(r, exogenous={**r.exogenous, **noise[r.name]}) for r in trial.runs]
    found = check_wind(replace(trial, runs=tuple(calm)), model)
    assert found.asked and not found.in_order and found.finding is None and found.remark is None


@pytest.mark.thorough
def test_an_anemometer_that_stands_high_is_no_mistake():
    trial = circles(3, gain=0.8)
    found = check_wind(trial, model_of(trial))
    assert found.finding is None and found.remark is None


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [3, 5, 6])
def test_a_reading_that_cannot_be_tested_is_not_ruled_out(seed):
    """Of heading and yaw rate alone an apparent wind cannot be made a true one: what stands in for it is not
    named alone, and a right one is not in order."""
    right = circles(seed)

    def few(trial: Trial) -> Trial:
        runs = [replace(r, data={k: r.data[k] for k in ("psi", "r")}) for r in trial.runs]
        return replace(trial, runs=tuple(runs))

    found = check_wind(few(misread(right, "apparent wind")), model_of(right))
    if found.finding is not None:
        assert found.finding.probability < 0.95 and "apparent wind" in found.finding.also
    assert not found.in_order and "apparent wind" in found.untested
    of_right = check_trial(few(right), model_of(right))
    assert not of_right.findings and not any("wind" in text for text in of_right.in_order)
    assert any("needs the track, or u and v" in text for text in of_right.unseen)


@pytest.mark.thorough
def test_runs_that_contradict_one_another_are_told_and_nothing_is_mended():
    right, wrong = circles(1), misread(circles(1), "wind_from: where it blows to")
    mixed = replace(right, runs=(right.runs[0], wrong.runs[1]))
    found = check_wind(mixed, model_of(mixed))
    assert found.finding is None and not found.in_order
    first, second = (run.name for run in mixed.runs)
    assert found.remark is not None and found.remark.index(second) < found.remark.index(f"{first} worse")


@pytest.mark.thorough
def test_runs_that_contradict_along_one_path_alone_do_not_keep_a_mistake_from_being_named():
    """Of the heading alone one of two runs, both read wrongly, speaks against it along the header's path."""
    wrong = misread(circles(1), "wind_from: where it blows to")
    runs = tuple(replace(r, data={"psi": r.data["psi"]}) for r in wrong.runs)
    found = check_wind(replace(wrong, runs=runs), model_of(wrong))
    assert found.remark is None and found.finding is not None
    assert "wind_from: where it blows to" in (found.finding.name, *found.finding.also)


@pytest.mark.thorough
def test_a_fit_that_fails_in_asking_whether_runs_agree_ends_the_check_alone(monkeypatch):
    def fails(*_):
        raise ModelError("the vehicle diverges")

    monkeypatch.setattr(measured_wind._Split, "words", fails)
    wrong = misread(circles(1), "wind_from: where it blows to")
    found = check_wind(wrong, model_of(wrong))
    assert found.asked and found.finding is None and not found.in_order


@pytest.mark.thorough
def test_a_held_out_run_that_lacks_the_heading_does_not_keep_a_mistake_from_being_told():
    wrong = misread(circles(1), "wind_from: from the bow")
    run = wrong.runs[0]
    data = {name: run.data[name] for name in ("x", "y")}
    held = replace(run, name="held", role="holdout", data=data)
    trial = replace(wrong, runs=(*wrong.runs, held))
    check = check_trial(trial, model_of(trial))
    assert check.findings
    *_, left = mended(trial, check).runs
    assert not left.exogenous and any("its wind is left out" in text for text in left.warnings)


def test_the_air_past_the_vehicle_is_had_of_the_track_where_no_drift_is_logged():
    t = np.linspace(0.0, 120.0, 121)
    psi, drift = 0.03 * t, -0.2
    over = 4.0 * np.exp(1j * (psi + drift))
    track = np.concatenate([[0.0], np.cumsum(0.5 * (over[1:] + over[:-1]))])
    read = {"wind_speed": np.full(t.size, 4.0), "wind_from": np.full(t.size, drift), "psi": psi}
    ahead = np.full(t.size, 4.0 * np.cos(drift))
    still = true_wind("apparent", t, {**read, "u": ahead, "x": track.real, "y": track.imag})
    assert still[0][5:-5] == pytest.approx(0.0, abs=0.01)
    assert true_wind("apparent", t, {**read, "u": ahead})[0] == pytest.approx(4.0 * abs(np.sin(drift)))


@pytest.mark.thorough
def test_of_many_readings_of_a_track_its_velocity_is_had_of_their_means():
    t = np.linspace(0.0, 1200.0, 24_001)
    rng = np.random.default_rng(2)
    x = 40.0 * np.sin(t / 40.0)
    read = {"wind_speed": np.abs(np.cos(t / 40.0)), "wind_from": np.where(np.cos(t / 40.0) > 0, 0.0, np.pi)}
    noisy = {"x": x + rng.normal(0.0, 0.05, t.size), "y": rng.normal(0.0, 0.05, t.size)}
    assert np.median(true_wind("apparent by compass", t, {**read, **noisy})[0]) < 0.05


def test_the_wind_is_made_of_the_heading_and_the_clock_as_they_are_mended():
    """A table of corrections mends the time first: the way of the ship is had of the mended one."""
    t = np.linspace(0.0, 60.0, 121)
    wind = {"wind_speed": np.full(t.size, 2.0), "wind_from": np.zeros(t.size)}
    run = Run("a", "", "identify", t, {"x": 4.0 * t, "y": 0.0 * t, "psi": 0.0 * t}, exogenous=wind)
    slow = apply(Correction(time_scale=2.0, wind="apparent"), run)
    assert slow.exogenous["wind_speed"] == pytest.approx(0.0, abs=1e-6)
    one_by_one = apply(Correction(wind="apparent"), apply(Correction(time_scale=2.0), run))
    assert slow.exogenous["wind_speed"] == pytest.approx(one_by_one.exogenous["wind_speed"])
    assert join([Correction(wind="apparent"), Correction(time_scale=2.0)]) is None
    assert join([Correction(time_scale=2.0), Correction(wind="apparent")]) is not None


def test_every_mistake_of_the_wind_has_a_mend_of_the_wind_alone():
    for mistake in WIND_MISTAKES:
        assert set(mistake.channels) <= {"wind_speed", "wind_from"} and mistake.correction is not None
    assert {m.correction.wind for m in WIND_MISTAKES} == set(READINGS) | {TRUE}


HEADS = (
    ("AWS [m/s]", "AWA [deg]", 'wind = "apparent"'),
    ("App wind speed", "App wind angle", 'wind = "apparent"'),
    ("AWS [m/s]", "AWD [deg]", 'wind = "apparent by compass"'),
    ("Wind speed [m/s]", "Rel wind direction [deg]", 'wind = "apparent"'),
    ("TWS [m/s]", "TWA [deg]", 'wind = "from the bow"'),
    ("True wind speed", "True wind angle", 'wind = "from the bow"'),
    ("TWS [m/s]", "TWD", None),
)


@pytest.mark.parametrize(("speed", "come", "mend"), HEADS)
def test_a_wind_that_is_called_apparent_or_an_angle_is_asked_about(tmp_path, speed, come, mend):
    t = np.arange(0.0, 60.0, 0.5)
    psi = 0.4 * np.sin(0.2 * t)
    north, east = np.cumsum(np.cos(psi)), np.cumsum(np.sin(psi))
    rows = zip(t, north, east, psi, 0.1 * np.cos(0.2 * t), 3.0 + 0.0 * t, 90.0 + 40.0 * psi, strict=True)
    head = f"t [s],North [m],East [m],Heading [rad],Rudder order [rad],{speed},{come}\n"
    (tmp_path / "a.csv").write_text(head + "".join(",".join(f"{x:.5f}" for x in row) + "\n" for row in rows))
    found = propose([tmp_path / "a.csv"])
    assert {"wind_speed", "wind_from"} <= set(found.map.channels)
    asked = [text for text in found.map.questions if "[corrections]" in text and text.startswith("wind")]
    assert [mend in text for text in asked] == ([] if mend is None else [True])
