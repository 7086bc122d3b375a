"""A run that lacks an order which other runs log is told and not simulated as if the order were 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from thruster_plants import BOAT

import bayesid
from bayesid.api.check import check
from bayesid.diagnosis.input import checked_and_read, missing_orders
from bayesid.equations.model import build_model
from bayesid.errors import TrialError
from bayesid.model.actuators import Fin
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial, load_trial, resample, window, write_trial
from bayesid.trials.correction import Correction, apply
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


def an_x():
    """Four fins that obey rudder and planes together."""
    sub = load_vehicle("lauv")
    coef = {n: v for n, v in sub.coef.items() if "dr" not in n and "ds" not in n}
    fins = tuple(
        Fin(str(k), (-0.5, 0.06 * y, 0.06 * z), (0.0, -0.7071 * z, 0.7071 * y), F_uu=6.0)
        for k, (y, z) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)], start=1)
    )
    return replace(sub, coef=coef, fins=fins)


def test_of_an_x_each_of_two_common_orders_is_asked_for():
    both = {"delta_r_cmd": 0.1 * SWING, "delta_s_cmd": 0.1 * np.sin(T), "n_cmd": np.full(T.size, 1000.0)}
    rudder = {name: values for name, values in both.items() if name != "delta_s_cmd"}
    late = {**both, "delta_s_cmd": np.where(T < 30.0, np.nan, 0.1)}
    ship = an_x()
    assert missing_orders(replace(of_ship(both, both), dof=6), ship) == {}
    (told,) = missing_orders(replace(of_ship(both, rudder), dof=6), ship).values()
    assert "run r1 has no delta_s_cmd (100 % missing), which r0 logs" in told
    (told,) = missing_orders(replace(of_ship(both, late), dof=6), ship).values()
    assert "run r1 has no delta_s_cmd before t = 30 s" in told
    assert missing_orders(of_ship(both, rudder), ship) == {}  # in the plane nothing reads it


def test_a_measurement_that_begins_late_beside_its_order_is_to_be_left_out():
    whole = trial()
    late = np.where(T < 20.0, np.nan, 700.0)
    runs = (whole.runs[0], replace(whole.runs[1], measured_inputs={"n_port": late}), whole.runs[2])
    (told,) = missing_orders(replace(whole, runs=runs), load_vehicle(BOAT)).values()
    assert 'The order is logged: leave the measurement out, drop = ["n_port"] in [corrections]' in told


def test_a_prediction_on_its_own_and_a_pack_stop_as_a_diagnosis_does():
    lost = without_port("b")
    with pytest.raises(TrialError, match="run b has no n_port_cmd"):
        bayesid.predict(lost, "a")
    with pytest.raises(TrialError, match="run b has no n_port_cmd"):
        checked_and_read(lost, build_model(load_vehicle(BOAT), 3))


@pytest.mark.parametrize(
    ("correction", "known"),
    [
        (Correction(exchange=(("n_port_cmd", "n_stbd_cmd"),)), {"n_stbd_cmd": 20.0}),
        (Correction(rename={"n_port_cmd": "n_1_cmd"}), {"n_1_cmd": 20.0}),
        (Correction(drop=("n_port_cmd",)), {}),
        (Correction(late={"n_port_cmd": 5.0}), {"n_port_cmd": 15.0}),
        (Correction(time_scale=2.0), {"n_port_cmd": 40.0}),
    ],
)
def test_when_an_order_is_known_goes_with_a_correction_of_its_column(correction, known):
    run = trial(b={"n_port_cmd[rpm]": np.where(T < 20.0, np.nan, 700.0)}).runs[1]
    assert dict(run.known_from) == {"n_port_cmd": 20.0}
    assert dict(apply(correction, run).known_from) == known
