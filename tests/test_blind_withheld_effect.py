"""Withheld-effect checks on logs: what is taken away is gone from the bundle and stands in the committed
answer."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.benchmark.protocol.leak_check import check_pack
from bayesid.benchmark.protocol.withheld_effect import lag_behind, withhold
from bayesid.model.vehicles import load_vehicle, write_vehicle
from bayesid.trials import load_trial, write_trial

TAU, ZERO, COME, SPEED = 0.5, math.radians(1.0), 1.2, 6.0


def lagged(t, order, tau=TAU, zero=ZERO):
    out = np.empty_like(order)
    out[0] = order[0]
    for k, step in enumerate(np.diff(t)):
        out[k + 1] = order[k] + (out[k] - order[k]) * math.exp(-step / tau)
    return out + zero


@pytest.fixture
def bundle(tmp_path):
    """A log with wind, measured rudder, water track and columns that would tell."""
    model = model_of("remus100")
    trial = planted_trial(model, seed=1)
    runs = []
    for run in trial.runs:
        n, psi = run.t.size, run.data["psi"]
        north, east = 0.2, -0.1
        water = {"u_water": run.data["u"] - north * np.cos(psi) - east * np.sin(psi),
                 "v_water": run.data["v"] + north * np.sin(psi) - east * np.cos(psi)}  # fmt: skip
        runs.append(replace(
            run, data=dict(run.data) | water, notes="light wind",
            measured_inputs={"delta_r": lagged(run.t, run.commands["delta_r_cmd"])},
            exogenous={"wind_speed": np.full(n, SPEED), "wind_from": np.full(n, COME)},
            extra={"relative wind [kn]": np.arange(n, dtype=float), "rudder pump [A]": np.ones(n),
                   "battery [V]": np.ones(n)},
        ))  # fmt: skip
    path = tmp_path / "pond"
    write_trial(replace(trial, runs=tuple(runs)), path)
    write_vehicle(model.vehicle, path / "vehicle.toml")
    toml = path / "trial.toml"
    toml.write_text(re.sub("vehicle = .*", 'vehicle = "vehicle.toml"', toml.read_text()))
    return path


def taken(bundle, what):
    """Reduced trial, its vehicle, its answer, and all its text."""
    base = bundle.parent
    withhold(bundle, what, base / "pack", base / "answers")
    check_pack(base / "pack")
    reduced = load_trial(base / "pack" / "pond")
    answer = load_answers(base / "answers")["pond"]
    return reduced, load_vehicle(reduced.vehicle_ref), answer, base / "pack" / "pond"


def test_wind_is_gone_with_all_that_tells_of_it(bundle):
    reduced, _, answer, folder = taken(bundle, "wind")
    assert all(not run.exogenous for run in reduced.runs)
    assert all("wind" not in file.read_text() for file in folder.glob("*.csv"))
    assert "wind" not in (folder / "trial.toml").read_text()
    assert not any(run.extra or run.notes for run in reduced.runs)  # a fit reads neither
    assert answer.families == {"earth_force"}
    assert answer.causes[0].parameters == pytest.approx({"V_wind": SPEED, "from": COME})


def test_the_rudder_follows_its_order_again_and_lag_and_offset_stand_in_the_answer(bundle):
    reduced, _, answer, _ = taken(bundle, "rudder")
    assert all(not run.measured_inputs and "delta_r_cmd" in run.commands for run in reduced.runs)
    assert not any(run.extra for run in reduced.runs)
    values = {c.name: c.parameters for c in answer.causes}
    assert values["actuator_lag"]["tau"] == pytest.approx(TAU, abs=0.05)  # half a step of the grid
    assert values["rudder_offset"]["offset"] == pytest.approx(ZERO, abs=math.radians(0.1))


def test_the_current_is_the_difference_of_the_two_tracks(bundle):
    reduced, _, answer, _ = taken(bundle, "current")
    assert all("u" in run.data and "u_water" not in run.data for run in reduced.runs)
    assert answer.causes[0].parameters == pytest.approx({"V_north": 0.2, "V_east": -0.1}, abs=1e-9)


def test_a_rate_limit_goes_from_the_vehicle_and_not_while_the_log_shows_it(bundle, tmp_path):
    with pytest.raises(BlindError, match="take away rudder first"):
        taken(bundle, "rate_limit")
    withhold(bundle, "rudder", tmp_path / "first", tmp_path / "first answers")
    reduced, vehicle, answer, _ = taken(tmp_path / "first" / "pond", "rate_limit")
    rate = load_vehicle("remus100").rates["delta_r"]
    assert math.isinf(vehicle.rates["delta_r"])
    assert answer.causes[0].parameters["inverse_rate_excess"] == pytest.approx(1.0 / rate)
    assert reduced.runs


def test_what_is_kept_reads_as_before(bundle):
    before = load_trial(bundle)
    reduced, *_ = taken(bundle, "wind")
    for old, new in zip(before.runs, reduced.runs, strict=True):
        assert (old.name, old.role, old.manoeuvre) == (new.name, new.role, new.manoeuvre)
        np.testing.assert_array_equal(old.t, new.t)
        for channel, values in old.data.items():
            np.testing.assert_array_equal(values, new.data[channel])


def test_what_is_not_there_cannot_be_taken(bundle, tmp_path):
    bare = tmp_path / "bare"
    write_trial(replace(planted_trial(model_of("remus100"), seed=2), vehicle_ref="remus100"), bare)
    for what, said in (("wind", "no wind to take away"), ("rudder", "nothing would steer"),
                       ("current", "no current is known"), ("paint", "one of wind, rudder")):  # fmt: skip
        with pytest.raises(BlindError, match=said):
            withhold(bare, what, tmp_path / "pack", tmp_path / "answers")
    with pytest.raises(BlindError, match="folder of their own"):
        withhold(bundle, "wind", tmp_path / "pack", tmp_path / "pack" / "answers")
    assert not (tmp_path / "pack").exists()


def test_several_reduced_bundles_share_a_pack(bundle):
    base = bundle.parent
    withhold(bundle, "wind", base / "pack", base / "answers", name="one")
    withhold(bundle, "current", base / "pack", base / "answers", name="two")
    assert set(check_pack(base / "pack")["bundles"]) == {"one", "two"}
    assert json.loads((base / "answers" / "two.json").read_text())["removed"] == "current"
    with pytest.raises(BlindError, match="one: is in this pack already"):
        withhold(bundle, "wind", base / "pack", base / "answers", name="one")


@pytest.mark.parametrize("tau", [0.0, 0.3, 1.0])
def test_a_lag_is_read_off_order_and_answer(tau):
    t = np.arange(0.0, 60.0, 0.25)
    order = 0.2 * np.sign(np.sin(2 * np.pi * t / 15.0 + 0.1))
    measured = lagged(t, order, max(tau, 1e-9), -0.01)
    found, zero, left = lag_behind(t, order, measured)
    assert found == pytest.approx(tau, abs=0.06)  # the grid is 0.05 s
    assert zero == pytest.approx(-0.01, abs=2e-3) and left < 0.02


def test_the_covariance_of_an_identified_vehicle_goes_into_a_pack_that_solve_takes(bundle):
    ship = load_vehicle(bundle / "vehicle.toml")
    names = ("Y_v", "N_r")
    matrix = np.array([[4.0, -1.0], [-1.0, 9.0]]) * 1e-6
    ship = replace(ship, sources={"Y_v": "fit of the runs with measured wind"})
    write_vehicle(ship, bundle / "vehicle.toml", (names, matrix))
    assert (bundle / "vehicle.covariance.npz").exists()
    _, vehicle, _, folder = taken(bundle, "wind")  # check_pack refused the .npz here
    assert {p.suffix for p in folder.iterdir()} == {".toml", ".csv"}
    assert vehicle.prior.names[:2] == names
    np.testing.assert_array_equal(
        vehicle.prior.covariance, load_vehicle(bundle / "vehicle.toml").prior.covariance
    )
    assert "wind" not in (folder / "vehicle.toml").read_text()


@pytest.mark.parametrize("name", ["a\x07b", "a\u202eb", "../a", ".a"])
def test_a_name_that_is_none_is_refused(bundle, name):
    with pytest.raises(BlindError, match="is no name of a bundle"):
        withhold(bundle, "wind", bundle.parent / "pack", bundle.parent / "answers", name=name)
    assert not (bundle.parent / "pack").exists()
