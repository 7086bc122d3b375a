"""A run that lacks an order which other runs log is told and not simulated as if the order were 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from thruster_plants import BOAT

import bayesid
from bayesid.api.check import check
from bayesid.diagnosis.input import missing_orders
from bayesid.errors import TrialError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial, load_trial, resample, window, write_trial
from bayesid.trials.frames import trial_from_frames

T = np.arange(0.0, 60.0, 0.5)
SWING = np.where((T // 10) % 2 == 0, 1.0, -1.0)


def table(**columns):
    psi = 0.1 * np.sin(T / 10)
    return {
        "t[s]": T, "x[m]": T, "y[m]": 0.1 * T, "psi[rad]": psi,
        "n_port_cmd[rpm]": 700 + 100 * SWING, "n_stbd_cmd[rpm]": 700 - 100 * SWING, **columns,
    }  # fmt: skip


def trial(holdout="c", **changed):
    frames = {name: table(**changed.get(name, {})) for name in "abc"}
    return trial_from_frames(frames, BOAT, holdout=holdout)


def of_ship(*commands):
    """Runs of a vehicle with rudder and shaft."""
    data = {"x": T, "y": 0.1 * T, "psi": 0.1 * np.sin(T / 10)}
    runs = (Run(f"r{k}", "", "identify", T, data, orders) for k, orders in enumerate(commands))
    return Trial("ship", BOAT, "", 3, tuple(runs))


def without_port(run):
    return trial(**{run: {"n_port_cmd[rpm]": np.full(T.size, np.nan)}})


@pytest.mark.parametrize("run", ["b", "c"])
def test_an_order_that_is_lost_in_one_run_stops_a_fit(run, tmp_path):
    lost = without_port(run)
    (told,) = missing_orders(lost, load_vehicle(BOAT)).values()
    for part in (
        f"{run} has no n_port_cmd",
        "100 % missing",
        "[[runs]] table of",
        "simulated, it would be 0",
    ):
        assert part in told
    verbs = (
        bayesid.fit,
        bayesid.identify,
        lambda t, quick: bayesid.sample(t, out=tmp_path / "s", quick=quick),
    )
    for verb in verbs:
        with pytest.raises(TrialError, match=f"{run} has no n_port_cmd"):
            verb(lost, quick=True)
    assert missing_orders(trial(), load_vehicle(BOAT)) == {}


@pytest.mark.thorough
def test_an_order_that_is_lost_in_one_run_is_told_by_check_and_stops_a_diagnosis():
    lost = without_port("b")
    (told,) = missing_orders(lost, load_vehicle(BOAT)).values()
    assert told in check(lost).lacking
    found = bayesid.diagnose(lost)
    assert (found.verdict, found.effects) == ("not_enough", ()) and told[1:] in found.summary()


def test_an_order_that_is_unknown_for_long_at_the_beginning_is_told_with_the_window_to_read(tmp_path):
    late = 700 + np.where(T < 20.0, np.nan, 100 * SWING)
    boat, lost = load_vehicle(BOAT), trial(b={"n_port_cmd[rpm]": late})
    (told,) = missing_orders(lost, boat).values()
    assert "b has no n_port_cmd before t = 20 s (34 % of it)" in told and "window = [20, 59.5]" in told
    again = load_trial(write_trial(lost, tmp_path / "bundle"))
    thinned = replace(lost, runs=tuple(resample(run, 1.0) for run in lost.runs))
    assert list(missing_orders(again, boat).values()) == [told]
    assert list(missing_orders(thinned, boat)) == ["b"]
    parts = replace(lost, runs=tuple(window(run, 20.0, 60.0) for run in lost.runs))
    assert missing_orders(parts, boat) == {}
    raw = replace(lost.runs[1], commands={**lost.runs[1].commands, "n_port_cmd": late}, known_from={})
    assert list(missing_orders(replace(lost, runs=(lost.runs[0], raw)), boat)) == ["b"]


def test_a_logger_that_starts_a_moment_late_and_orders_logged_on_change_are_right():
    moment = np.where(T < 3.0, np.nan, 700 + 100 * SWING)
    seldom = np.where(np.r_[True, np.diff(SWING) != 0], 700 + 100 * SWING, np.nan)
    both = trial(a={"n_port_cmd[rpm]": moment}, b={"n_port_cmd[rpm]": seldom})
    assert missing_orders(both, load_vehicle(BOAT)) == {}


def test_positions_in_place_of_orders_and_common_orders_in_place_of_named_ones_are_right():
    boat, whole = load_vehicle(BOAT), trial()
    a, b, c = whole.runs
    orders = dict(b.commands)
    measured = replace(
        b, commands={"n_stbd_cmd": orders["n_stbd_cmd"]}, measured_inputs={"n_port": orders["n_port_cmd"]}
    )
    common = replace(c, commands={"n_cmd": orders["n_port_cmd"]})
    assert missing_orders(replace(whole, runs=(a, measured, common)), boat) == {}
    half = replace(b, commands={"n_stbd_cmd": orders["n_stbd_cmd"]})
    assert list(missing_orders(replace(whole, runs=(a, half, common)), boat)) == ["b"]


def test_a_shaft_in_no_run_is_held_and_one_in_some_runs_is_asked_for():
    ship = load_vehicle("generic_sub")
    rudder, shaft = {"delta_r_cmd": 0.1 * SWING}, {"n_cmd": np.full(T.size, 60.0)}
    assert missing_orders(of_ship(rudder, rudder), ship) == {}
    (told,) = missing_orders(of_ship({**rudder, **shaft}, rudder), ship).values()
    assert "r1 has no n_cmd" in told
    still = {**rudder, "delta_s_cmd": np.zeros(T.size)}  # 0 is what stands in for it
    assert missing_orders(replace(of_ship({**still, **shaft}, {**rudder, **shaft}), dof=6), ship) == {}
    dived = {**still, "delta_s_cmd": 0.1 * SWING}
    assert list(missing_orders(replace(of_ship(dived, rudder), dof=6), ship)) == ["r1"]
    assert missing_orders(of_ship(dived, rudder), ship) == {}  # in the plane nothing reads it


def test_the_rudder_of_a_ship_by_mmg_is_asked_for():
    ship, shaft = load_vehicle("esso_osaka_mmg"), {"n_cmd": np.full(T.size, 60.0)}
    assert list(missing_orders(of_ship({**shaft, "delta_r_cmd": 0.1 * SWING}, shaft), ship)) == ["r1"]
