"""`bayesid trial import`: conversions against closed forms and other implementations, maps, proposals,
bundles."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.signal

from bayesid.cli.main import run as bayesid
from bayesid.report.import_figure import draw_runs
from bayesid.trials import load_trial
from bayesid.trials.importing import (
    ImportLogError,
    apply_map,
    axes,
    check_bundle,
    clocks,
    cutting,
    geodesy,
    map_text,
    propose,
    read_map,
    write_bundle,
)
from bayesid.trials.importing.joining import join
from bayesid.trials.importing.named_actuators import Steering
from bayesid.trials.importing.names import guess_role
from bayesid.trials.importing.raw import RawChannel
from bayesid.trials.importing.run_list import _as_a_whole
from bayesid.trials.importing.unit_words import positive_side, split_unit
from tests.raw_logs import draw, motion

DEG = np.pi / 180.0


def imported(tmp_path, text, *paths, name="map.toml"):
    (tmp_path / name).write_text("format = 1\n" + text)
    found = read_map(tmp_path / name)
    runs, origin = apply_map(found, list(paths))
    write_bundle(found, runs, origin, tmp_path / "bundle", tmp_path / name, overwrite=True)
    check_bundle(tmp_path / "bundle")
    return load_trial(tmp_path / "bundle")


# --- conversions


def test_euler_angles_are_those_of_scipy_and_scale_does_not_matter():
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(1)
    turns = Rotation.random(200, random_state=rng)
    x, y, z, w = turns.as_quat().T * 1.7
    yaw, pitch, roll = turns.as_euler("ZYX").T
    found = axes.euler(w, x, y, z)
    for angle, wanted in zip(found, (roll, pitch, yaw), strict=True):
        np.testing.assert_allclose(np.cos(angle - wanted), 1.0, atol=1e-12)


def test_east_north_up_attitude_becomes_north_east_down_as_by_rotation_matrices():
    """Against matrices: C(ned<-frd) = swap C(enu<-flu) flip, with the textbook swap and flip."""
    from scipy.spatial.transform import Rotation

    swap, flip = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), np.diag([1.0, -1.0, -1.0])
    turns = Rotation.from_euler("ZYX", np.random.default_rng(2).uniform(-1.3, 1.3, (100, 3)))
    x, y, z, w = turns.as_quat().T
    roll, pitch, yaw = axes.euler(w, x, y, z)
    found = Rotation.from_euler(
        "ZYX", np.column_stack((axes.heading_of(yaw, "enu"), axes.body_of("theta", pitch, "flu"), roll))
    )
    np.testing.assert_allclose(found.as_matrix(), swap @ turns.as_matrix() @ flip, atol=1e-12)


def test_local_metres_follow_meridian_arc_and_parallel():
    """Closed forms: the arc of the meridian by its radius of curvature, a parallel by its circle; 1 mm in 200
    m."""
    lat0, lon0 = 59.43 * DEG, 10.47 * DEG
    s2 = np.sin(lat0) ** 2
    meridian = geodesy.A * (1 - geodesy.E2) / (1 - geodesy.E2 * s2) ** 1.5
    normal = geodesy.A / np.sqrt(1 - geodesy.E2 * s2)
    north, east, down = geodesy.local_metres(
        np.array([lat0 + 200.0 / meridian, lat0]), np.array([lon0, lon0 + 200.0 / (normal * np.cos(lat0))]),
        np.array([5.0, 5.0]), (lat0, lon0, 5.0),
    )  # fmt: skip
    np.testing.assert_allclose(north[0], 200.0, atol=1e-3)
    np.testing.assert_allclose(east[1], 200.0, atol=1e-3)
    np.testing.assert_allclose([east[0], down[0], down[1]], 0.0, atol=4e-3)  # the earth falls off by 3 mm


def test_gps_time_counts_the_leap_seconds_of_its_day():
    assert clocks.gps_to_utc([1398592818.0])[0] == 1714557600.0  # 2024-05-01, 18 s (IERS Bulletin C)
    assert clocks.gps_to_utc([1025136000.0])[0] == 1025136000 + 315964800 - 15  # 2012-06-30, before the leap


def test_a_stamp_of_nanoseconds_keeps_its_digits():
    ns = 1714557600 * 10**9 + np.array([123456789, 123457789])
    assert clocks.from_numbers(ns, "unix", "ns").t[1] - clocks.from_numbers(ns, "unix", "ns").t[
        0
    ] == pytest.approx(1e-6, rel=1e-9)


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("psi[deg]", "psi", "deg"), ("Heading (°)", "Heading", "deg"), ("yaw_rate_deg_s", "yaw_rate",
            "deg/s"),
        ("speed_kn", "speed", "kn"), ("delta_s", "delta_s", None), ("time_ms", "time", "ms"),
        ("HDG (deg true)", "HDG", "deg"), ("Ruder soll [° Bb+]", "Ruder soll", "deg"),
        ("Kurs [Grad]", "Kurs", "deg"), ("Drehrate [Grad/s]", "Drehrate", "deg/s"),
        ("Kurs [grader]", "Kurs", "deg"), ("Fart [knop]", "Fart", "kn"),
        ("Helm (deg, stbd +)", "Helm", "deg"), ("Rudder [deg port+]", "Rudder", "deg"),
        ("Rudder order [deg] (+ = stbd)", "Rudder order", "deg"), ("Helm (port +) [rad]", "Helm", "rad"),
        ("n thruster (port) [rpm]", "n thruster (port)", "rpm"),
        ("vel, m/s", "vel", "m/s"), ("torque [kNm]", "torque", "kNm"), ("u_mps", "u", "m/s"), ("rpm",
            "rpm", None),
    ],
)  # fmt: skip
def test_a_header_gives_its_unit_however_it_is_written(header, name, unit):
    assert split_unit(header) == (name, unit)


@pytest.mark.parametrize(
    ("header", "side"),
    [
        ("Helm (deg, stbd +)", "starboard"), ("Rudder [deg, port +]", "port"), ("rudder (+ to starboard)",
            "starboard"),
        ("Rudder (deg, port -, stbd +)", "starboard"), ("rudder (stbd negative)", "port"),
        ("Ruder soll [° Bb+]", "port"), ("Ruder [°, Stb +]", "starboard"), ("barre (deg, babord +)", "port"),
        ("rudder port +/- (deg)", None), ("rudder_port (deg)", None), ("port +, stbd +", None),
    ],
)  # fmt: skip
def test_a_header_tells_its_positive_side(header, side):
    assert positive_side(header) == side


@pytest.mark.parametrize(
    ("header", "role"),
    [
        ("Eng rpm", "n"), ("engine_rpm", "n"), ("Engine RPM [rpm]", "n"), ("Motordrehzahl", "n"),
        ("Nord (m)", "north"), ("Ost (m)", "east"), ("Hochwert [m]", "north"), ("V Nord (m/s)", "v_north"),
        ("HDG (deg true)", "heading"), ("Speed thru water (kn)", "speed_through_water"),
        ("FdW [kn]", "speed_through_water"), ("Fahrt über Grund [kn]", "speed_over_ground"),
        ("Fahrt [kn]", "u"), ("Øst [m]", "east"), ("Svingrate [grader/s]", "r"), ("Turtall [o/min]", "n"),
        ("TWD (deg)", "wind_from"), ("Windrichtung [Grad]", "wind_from"), ("wind_vel [m/s]", "wind_speed"),
        ("dvl_fwd_mps", "u"), ("dvl_stbd_mps", "v"), ("dvl_down_mps", "w"), ("BT vel forward (m/s)", "u"),
        ("dvl_temp", None), ("dvl_port_mps", "v"), ("dvl_up_kn", "w"), ("sway_port [m/s]", "v"),
        ("ahrs_yaw_enu_deg", "psi"), ("yaw_ned", "psi"), ("vel_ned_y", None), ("port_rpm", None),
        ("Engine", None), ("Engine temp", None), ("engine_hours", None), ("gearbox_oil_rpm", None),
        ("gyro_roll_dps", "p"), ("gyro_pitch_dps", "q"), ("gyro_yaw_dps", "r"), ("gyro_yaw_deg", "psi"),
    ],
)  # fmt: skip
def test_a_header_gives_its_role(header, role):
    values = np.arange(5.0)
    guess = guess_role(RawChannel(header, values, values, split_unit(header)[1]))
    assert (None if guess is None else guess.role) == role


def test_a_norwegian_log_with_dates_under_a_name_nobody_knows_is_read(tmp_path):
    """Decimal commas, Latin-1, heading wrapped: by the values a column of dates is the time."""
    truth = motion(np.random.default_rng(7))
    head = "Klokkeslett;Nord [m];Øst [m];Kurs [grader];Rorvinkel ordre [grader];Turtall [o/min]"
    start, rows = np.datetime64("2026-05-03T09:12:00.000"), [head]
    for t, x, y, psi, rudder, n in zip(
        *(truth[c] for c in ("t", "x", "y", "psi", "delta_r_cmd", "n_cmd")), strict=True
    ):
        when = (start + np.timedelta64(round(1000 * t), "ms")).astype(object)
        numbers = (x, y, psi / DEG % 360.0, rudder / DEG, n)
        rows.append(
            f"{when:%d.%m.%Y %H:%M:%S},{when.microsecond // 1000:03d};"
            + ";".join(f"{v:.3f}".replace(".", ",") for v in numbers)
        )
    log = tmp_path / "dykk.csv"
    log.write_text("\n".join(rows) + "\n", encoding="latin-1")
    found = propose([log]).map
    assert set(found.channels) >= {"north", "east", "heading", "delta_r_cmd", "n_cmd"}
    assert found.channels["heading"].unit == "deg"
    assert not found.questions


@pytest.mark.parametrize("side", ["stbd", "port"])
def test_the_side_a_header_says_is_held_against_the_turns(tmp_path, side):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, f'"Helm (deg, {side} +)"': -truth["delta_r_cmd"] / DEG,
        "rpm": truth["n_cmd"],
    }  # fmt: skip
    found = propose([_table(tmp_path, truth, columns)]).map
    assert (found.channels["delta_r_cmd"].unit, found.rudder_positive) == ("deg", "starboard")
    assert any("says that positive is port" in text for text in found.questions) is (side == "port")
    straight = {name: values[:500] for name, values in columns.items()}
    still = propose([_table(tmp_path, truth, straight, "straight.csv")]).map
    assert still.rudder_positive == {"stbd": "starboard", "port": "port"}[side]
    assert not any(text.startswith("rudder_positive") for text in still.questions)


def test_joined_series_keep_their_own_times_and_a_command_holds_into_a_window():
    fast, slow = np.arange(0.0, 10.0, 0.1), np.arange(0.0, 10.0, 0.7) + 0.05
    series = {
        "psi": (fast, np.sin(fast)),
        "x": (slow, slow),
        "delta_r_cmd": (np.array([0.0, 6.0]), np.array([0.1, 0.2])),
    }
    t, data = join(series, (3.0, 8.0))
    inside = slow[(slow >= 3.0) & (slow <= 8.0)]
    np.testing.assert_array_equal(t[np.isfinite(data["x"])], inside)
    np.testing.assert_array_equal(data["x"][np.isfinite(data["x"])], inside)
    assert t[0] == pytest.approx(3.0)
    assert data["delta_r_cmd"][0] == 0.1  # given at 0 s
    assert np.isfinite(data["delta_r_cmd"]).sum() == 2


# --- published structures, by a map


def test_a_towing_tank_table_without_header_in_degrees_and_revolutions_per_second(tmp_path):
    """The structure of the published KVLCC2 files: four lines of words, earth velocities, no header."""
    truth = motion(np.random.default_rng(4))
    t, psi = truth["t"], truth["psi"]
    east = truth["u"] * np.sin(psi) + truth["v"] * np.cos(psi)
    north = truth["u"] * np.cos(psi) - truth["v"] * np.sin(psi)
    r, delta, n = truth["r"] / DEG, truth["delta_r_cmd"] / DEG, truth["n_cmd"] / 60.0
    table = np.column_stack((t, truth["x"], truth["y"], psi / DEG, north, east, r, delta, n))
    path = tmp_path / "Z_20_20.dat"
    np.savetxt(path, table, fmt="%18.9f", header=" TANK\n SHIP\n Z20/20\n Time series", comments="")
    trial = imported(
        tmp_path,
        """
        [sources.tank]
        files = "*.dat"
        columns = ["t", "x", "y", "psi", "vx", "vy", "r", "delta", "n"]
        time = "t"
        [channels]
        x = "x"
        y = "y"
        psi = { from = "psi", unit = "deg" }
        v_north = "vx"
        v_east = "vy"
        r = { from = "r", unit = "deg/s" }
        delta_r = { from = "delta", unit = "deg" }
        n = { from = "n", unit = "rps" }
        """,
        path,
    )
    run = trial.runs[0]
    for name in ("x", "y", "psi", "u", "v", "r"):
        np.testing.assert_allclose(run.data[name], truth[name], atol=2e-8)
    np.testing.assert_allclose(run.measured_inputs["n"], truth["n_cmd"], atol=1e-6)
    np.testing.assert_allclose(run.measured_inputs["delta_r"], truth["delta_r_cmd"], atol=2e-9)


def test_three_files_of_other_rates_axes_and_clocks_become_one_run(tmp_path):
    truth = motion(np.random.default_rng(5))
    t = truth["t"]
    nav, act = slice(None, None, 10), slice(None, None, 4)
    epoch = 1714557600.0
    (tmp_path / "nav.csv").write_text(
        "utc;E;N\n"
        + "".join(
            f"{epoch + a:.3f};{b:.6f};{c:.6f}\n"
            for a, b, c in zip(t[nav], truth["y"][nav], truth["x"][nav], strict=True)
        )
    )
    yaw = np.mod(90.0 - truth["psi"] / DEG + 180.0, 360.0) - 180.0
    (tmp_path / "imu.csv").write_text(
        "boot_ms,yaw,gz\n"
        + "".join(f"{1000 * a:.1f},{b:.7f},{c:.9f}\n" for a, b, c in zip(t, yaw, -truth["r"], strict=True))
    )
    (tmp_path / "fins.csv").write_text(
        "utc,pwm\n"
        + "".join(
            f"{epoch + a + 2.5:.3f},{1500 - 10 * b / DEG:.6f}\n"
            for a, b in zip(t[act], truth["delta_r_cmd"][act], strict=True)
        )
    )
    trial = imported(
        tmp_path,
        """
        world = "enu"
        body = "flu"
        rudder_positive = "starboard"
        [sources.nav]
        files = ["nav.csv"]
        [sources.imu]
        files = ["imu.csv"]
        time = "boot_ms"
        start = "2024-05-01T10:00:00Z"
        [sources.fins]
        files = ["fins.csv"]
        clock_offset = -2.5
        [channels]
        x = "nav:E"
        y = "nav:N"
        psi = { from = "imu:yaw", unit = "deg" }
        r = { from = "imu:gz", unit = "rad/s" }
        delta_r_cmd = { from = "fins:pwm", scale = 0.1, offset = -150.0, unit = "deg" }
        """,
        *(tmp_path / f"{n}.csv" for n in ("nav", "imu", "fins")),
    )  # fmt: skip
    run = trial.runs[0]
    assert run.t.size == t.size
    np.testing.assert_allclose(
        run.data["psi"] - run.data["psi"][0], truth["psi"] - truth["psi"][0], atol=1e-8
    )
    np.testing.assert_allclose(np.sin(run.data["psi"] - truth["psi"]), 0.0, atol=1e-8)
    np.testing.assert_allclose(run.data["r"], truth["r"], atol=1e-8)
    assert np.isfinite(run.data["x"]).sum() == t[nav].size  # its own rate; the other cells are empty
    np.testing.assert_allclose(run.data["x"][::10], truth["x"][::10], atol=1e-6)
    np.testing.assert_allclose(run.data["y"][::10], truth["y"][::10], atol=1e-6)
    np.testing.assert_allclose(run.commands["delta_r_cmd"][::4], truth["delta_r_cmd"][::4], atol=1e-8)
    said = json.loads((tmp_path / "bundle" / "provenance.json").read_text())["runs"][0]
    assert said["start_utc"] == "2024-05-01T10:00:00+00:00"
    assert set(said["sources"]) == {"nav.csv", "imu.csv", "fins.csv"}
    assert said["channels"]["x"]["from"] == ["nav:N"]
    assert said["channels"]["x"]["readings"] == t[nav].size


# --- proposals


def _error(trial, truth):
    """Largest median error over runs, in units of what is tolerated; rudder as the share of wrong orders."""
    worst = 0.0
    for run in trial.runs:
        for name, tolerated in {"psi": 0.03, "u": 0.06, "v": 0.06, "r": 0.012, "x": 0.5, "y": 0.5}.items():
            if name not in run.data:
                continue
            off = run.data[name] - np.interp(run.t, truth["t"], truth[name])
            off = off[np.isfinite(off)]
            off = np.sin(off) if name == "psi" else off - np.median(off) if name in "xy" else off
            worst = max(worst, float(np.median(np.abs(off))) / tolerated)
        last = np.clip(np.searchsorted(truth["t"], run.t + 1e-9, side="right") - 1, 0, None)
        worst = max(
            worst, float(np.mean(np.abs(run.input("delta_r") - truth["delta_r_cmd"][last]) > 0.01)) / 0.15
        )
        worst = max(worst, float(np.mean(np.abs(run.input("n") - truth["n_cmd"][last]) > 1.0)) / 0.15)
    return worst


@pytest.mark.thorough
@pytest.mark.parametrize("seeds", [range(14), pytest.param(range(14, 60), marks=pytest.mark.slow)])
def test_logs_of_random_shape_are_read_rightly_or_asked_about_and_never_wrongly(tmp_path, seeds):
    """A log that holds what its axes, units and clocks are must need no map in four of
    five."""
    pytest.importorskip("pyarrow")
    told, right, wrong = 0, 0, []
    for seed in seeds:
        folder = tmp_path / str(seed)
        folder.mkdir()
        shape, truth = draw(np.random.default_rng(seed), folder)
        tells = not shape.ambiguous and not shape.late and shape.words["units"] != "none"
        told += tells
        found = propose(shape.files, "remus100").map
        if found.questions:
            continue
        assert not shape.ambiguous and not shape.late
        whole = replace(found, runs=())
        runs, origin = apply_map(whole, shape.files)
        write_bundle(whole, runs, origin, folder / "bundle", None)
        off = _error(load_trial(folder / "bundle"), truth)
        right += tells and off < 1.0
        if off >= 1.0:
            wrong.append((seed, off, shape.words))
    assert not wrong
    assert told > len(seeds) / 4
    assert right >= 0.8 * told


def test_a_proposed_map_reads_back_as_it_is(tmp_path):
    shape, _ = draw(np.random.default_rng(3), tmp_path)
    proposal = propose(shape.files, "remus100", "pond")
    (tmp_path / "map.toml").write_text(map_text(proposal.map, proposal.remarks, proposal.unused))
    assert read_map(tmp_path / "map.toml") == proposal.map


def _table(tmp_path, truth, columns, name="log.csv"):
    lines = [",".join(columns)] + [
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)
    ]
    (tmp_path / name).write_text("\n".join(lines) + "\n")
    return tmp_path / name


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "which axes"),  # x, y and yaw alone fit their mirror image
        ({"rudder [deg]": None}, "no rudder found"),
        ({"yaw [deg]": None, "r [deg/s]": None}, "no heading found"),
        ({"r [deg/s]": lambda c: c * DEG}, "integral of"),  # rad/s labelled deg/s
        ({"rudder [deg]": lambda c: c * DEG}, "radians"),
        ({"yaw [deg]": lambda c: c + 25.0}, "off the heading"),
        ({"u [m/s]": lambda c: c / 0.514444}, "times as long"),
        ({"x [m]": lambda c: c + 0.02 * np.arange(c.size)}, "through the water"),  # a current of 0.2 m/s
    ],
)
def test_what_is_doubtful_is_asked(tmp_path, change, words):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "yaw [deg]": truth["psi"] / DEG,
        "u [m/s]": truth["u"], "v [m/s]": truth["v"], "r [deg/s]": truth["r"] / DEG,
        "rudder [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    for key, what in change.items():
        value = columns.pop(key)
        if what is not None:
            columns[key] = what(value)
    asked = propose([_table(tmp_path, truth, columns)]).map.questions
    assert any(words in text for text in asked), asked


def test_the_orders_of_thrusters_are_asked_for_by_the_names_of_the_vehicle(tmp_path):
    truth = motion(np.random.default_rng(7))
    pose = {"t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "yaw [deg]": truth["psi"] / DEG}
    twins = Steering(("n_port", "n_stbd"))
    named = {"Thruster port (rpm)": truth["n_cmd"], "Thruster stbd (rpm)": truth["n_cmd"]}
    read = propose([_table(tmp_path, truth, pose | named)], steering=twins).map
    assert {"n_port_cmd", "n_stbd_cmd"} <= set(read.channels)
    assert not any("n_port" in q for q in read.questions)
    # names that do not say which
    log = _table(
        tmp_path, truth, pose | {"Thruster A (rpm)": truth["n_cmd"], "Thruster B (rpm)": truth["n_cmd"]}
    )
    asked = propose([log], steering=twins).map.questions
    assert any("n_port_cmd" in q and "n_stbd_cmd" in q and "Thruster A (rpm)" in q for q in asked)
    assert not any("no rudder found" in q for q in asked)
    assert any("no rudder found" in q for q in propose([log]).map.questions)


@pytest.mark.parametrize("heading", [0.0, 45.0, 170.0])
def test_a_straight_run_tells_no_drift_of_its_track(tmp_path, heading):
    """Along a straight line a drift and a wrong speed are one: the drift has no size, on whatever heading."""
    t, rng = np.arange(0.0, 200.0, 0.5), np.random.default_rng(3)
    along = 1.6 * t
    columns = {
        "t [s]": t,
        "north [m]": along * np.cos(heading * DEG) + 0.05 * rng.standard_normal(t.size),
        "east [m]": along * np.sin(heading * DEG) + 0.05 * rng.standard_normal(t.size),
        "heading [deg]": heading + 0.3 * rng.standard_normal(t.size),
        "u [m/s]": 1.6 + 0.02 * rng.standard_normal(t.size), "v [m/s]": 0.02 * rng.standard_normal(t.size),
        "rudder [deg]": np.zeros(t.size), "rpm": np.full(t.size, 900.0),
    }  # fmt: skip
    asked = propose([_table(tmp_path, {}, columns)]).map.questions
    assert not any("drifts" in q for q in asked), asked


def test_noise_about_north_makes_no_run_the_liveliest(tmp_path):
    """Heading 359.9 and 0.1 degrees are no turn: the yaw rate is held against the run that turns."""
    truth, rng = motion(np.random.default_rng(7)), np.random.default_rng(4)
    n = truth["t"].size
    turns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": np.mod(truth["psi"] / DEG, 360.0), "r [deg/s]": truth["r"] / DEG,
        "rudder [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    north = turns | {
        "north [m]": 1.5 * truth["t"], "east [m]": np.zeros(n),
        "heading [deg]": np.mod(0.3 * rng.standard_normal(n), 360.0),
        "r [deg/s]": 0.02 * rng.standard_normal(n),
        "rudder [deg]": np.zeros(n),
    }  # fmt: skip
    files = [_table(tmp_path, {}, north, "a_north.csv"), _table(tmp_path, {}, turns, "b_turn.csv")]
    asked = propose(files).map.questions
    assert not any("yaw rate" in q for q in asked), asked


def test_a_coordinate_of_the_other_sign_is_named_in_the_question_and_mended_by_its_answer(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = {"t [s]": truth["t"]} | {
        f"{role}[{unit}]": truth[role]
        for role, unit in (("x", "m"), ("y", "m"), ("psi", "rad"), ("u", "m/s"), ("v", "m/s"), ("r", "rad/s"))
    }
    columns |= {"delta_r_cmd[rad]": truth["delta_r_cmd"], "n_cmd[rpm]": truth["n_cmd"], "y[m]": -truth["y"]}
    found = propose([_table(tmp_path, truth, columns)]).map
    (asked,) = [text for text in found.questions if "track and heading" in text]
    assert "they agree with 'y[m]' of the other sign" in asked and "scale = -1" in asked
    columns["y[m]"] = truth["y"][::-1]  # of another run: no sign mends it
    other = propose([_table(tmp_path, truth, columns)]).map.questions
    assert any("on one clock?" in text for text in other) and not any("other sign" in text for text in other)


@pytest.mark.parametrize("at_a_step", [True, False])
def test_an_order_that_cannot_be_read_is_asked_about_first_where_it_may_have_changed(tmp_path, at_a_step):
    """Beside a cell in the middle of a held order, which hides nothing and is a remark."""
    truth = motion(np.random.default_rng(7))
    order = [f"{v:.3f}" for v in truth["delta_r_cmd"] / DEG]
    step = int(np.flatnonzero(np.diff(truth["delta_r_cmd"]))[2])
    order[step + 1 if at_a_step else 20] = "Err:502"
    rows = zip(truth["t"], truth["x"], truth["y"], truth["psi"] / DEG, order, truth["n_cmd"], strict=True)
    lines = [f"{t:.1f},{x:.3f},{y:.3f},{p:.3f},{o},{n}" for t, x, y, p, o, n in rows]
    (tmp_path / "log.csv").write_text("t [s],North [m],East [m],Heading [deg],rudder order [deg],rpm_cmd\n"
                                      + "\n".join(lines))  # fmt: skip
    proposal = propose([tmp_path / "log.csv"])
    asked = [text for text in proposal.map.questions if "1 cell is no number" in text]
    if at_a_step:
        assert asked == list(proposal.map.questions[:1])
        assert f"at {truth['t'][step + 1]:.1f} s" in asked[0]
    else:
        assert not asked
        assert any("1 cell is no number" in text for text in proposal.remarks)


def test_what_never_moves_is_not_said_to_move(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "North [m]": truth["x"], "East [m]": truth["y"],
        "Heading [deg]": truth["psi"] / DEG, "rudder [deg]": truth["delta_r_cmd"] / DEG,
        "propeller [rpm]": np.full(truth["t"].shape, 900.0),
    }  # fmt: skip
    remarks = propose([_table(tmp_path, truth, columns)]).remarks
    assert any(
        "'rudder [deg]' is read as delta_r_cmd, ordered: it moves in steps" in text for text in remarks
    )
    said = [text for text in remarks if "propeller" in text]
    assert said and all("stays at 900" in text and "moves" not in text for text in said), said
    slower = columns | {"propeller [rpm]": np.full(truth["t"].shape, 700.0)}
    files = [_table(tmp_path, truth, columns, "a.csv"), _table(tmp_path, truth, slower, "b.csv")]
    said = [text for text in propose(files).remarks if "propeller" in text]
    assert said and not any("stays at" in text for text in said), said


def test_runs_are_cut_by_their_commands():
    truth = motion(np.random.default_rng(8))
    pieces = cutting.cut(truth["t"], truth["delta_r_cmd"], truth["psi"], truth["u"])
    kinds = [p.kind for p in pieces if p.kind != "straight"]
    assert kinds == ["zigzag", "zigzag", "turn", "turn", "random"]
    words = [p.words.removeprefix("zigzag ").split("/") for p in pieces if p.kind == "zigzag"]
    np.testing.assert_allclose(
        np.array(words, dtype=float), [[20, 20], [10, 10]], atol=2.5
    )  # it turns 2 deg in a sample
    for a, b in zip(pieces[:-1], pieces[1:], strict=True):
        assert a.end <= b.start + 1e-9


def zigzag_log(rudder, switch, rate, latency, step=0.1, seconds=160.0):
    """Time, rudder as measured and heading [deg] of a first-order turn; an infinite rate gives the orders."""
    t = np.arange(0.0, seconds, step)
    order, angle, heading, turning = rudder, 0.0, 0.0, 0.0
    asked = [0.0] * round(latency / step)
    seen, psi = [], []
    for now in t:
        if heading * np.sign(order) <= -switch:
            order = -order
        asked.append(order if now >= 5.0 else 0.0)
        angle += np.clip(asked.pop(0) - angle, -rate * step, rate * step)
        turning += step * (-0.15 * angle - turning) / 4.0
        heading += step * turning
        seen.append(angle)
        psi.append(heading)
    return t, np.array(seen) * DEG, np.array(psi) * DEG


@pytest.mark.parametrize("rudder, switch", [(20, 10), (20, 5), (15, 1), (20, 20), (10, 10), (12, 7)])
@pytest.mark.parametrize("rate, latency", [(np.inf, 0.0), (16.0, 0.2)])
def test_a_zigzag_is_named_by_what_was_ordered_and_not_by_where_the_rudder_is_seen_to_move(
    rudder, switch, rate, latency
):
    t, angle, psi = zigzag_log(rudder, switch, rate, latency)
    assert cutting.classify(t, angle, psi) == ("zigzag", f"zigzag {rudder}/{switch}")


@pytest.mark.parametrize("rudder, said", [(0.0, "vertical zigzag 12/7"), (0.2, "turning circle 11")])
def test_what_the_planes_do_is_told_where_the_rudder_does_nothing(rudder, said):
    t, angle, pitch = zigzag_log(12, 7, np.inf, 0.0)
    commands = {"delta_r_cmd": np.full(t.shape, rudder), "delta_s_cmd": angle}
    data = {"theta": pitch, "psi": 2.0 * rudder * t}
    assert _as_a_whole(SimpleNamespace(t=t, commands=commands, measured_inputs={}, data=data), {}) == said
    commands["delta_s_cmd"] = np.zeros(t.shape)
    still = _as_a_whole(SimpleNamespace(t=t, commands=commands, measured_inputs={}, data=data), {})
    assert still == ("straight" if rudder == 0.0 else said)


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("rudder, switch", [(10, 10), (20, 20), (15, 15), (10, 5), (20, 10), (8, 8)])
def test_a_heading_that_moves_degrees_between_samples_makes_no_zigzag_of_another_name(rudder, switch, step):
    """20/20 read every half second was named 20/22: the switch falls anywhere between two samples."""
    t, angle, psi = zigzag_log(rudder, switch, np.inf, 0.0, step, seconds=300.0)
    named = cutting.classify(t, angle, psi)[1]
    right = f"zigzag {rudder}/{switch}"
    assert named == right or (step > 1.0 and named == f"zigzag {rudder}")


@pytest.mark.parametrize(
    ("seconds", "still", "word"),
    [
        ([60, 60], 0, "turns 12"), ([60, 60, 60], 0, "turns 12"), ([60, 60, 60, 60], 0, "turns 12"),
        ([60, 60, 60], 15, "turns 12"),  # back amidships in between
        ([90, 4, 4, 4], 0, "random orders"),  # a turn that is checked
        ([60], 0, "turning circle 12"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("step", [0.1, 1.0])
def test_turns_to_either_side_are_no_zigzag(seconds, still, word, step):
    """They were named zigzag 12/225; a zig-zag weaves about a course."""
    orders = [0.0]
    for k, hold in enumerate(seconds):
        orders += [12.0 * (-1) ** k] * round(hold / step) + [0.0] * round(still / step)
    rudder = np.array([0.0] * round(5.0 / step) + orders) * DEG
    t = step * np.arange(rudder.size)
    turning = scipy.signal.lfilter([step / 3.0], [1.0, step / 3.0 - 1.0], -rudder)  # 3 s to its rate
    psi = np.cumsum(turning) * step
    assert max(np.ptp(psi[(t > 5.0) & (t < 5.0 + seconds[0])]), 0.0) > 1.5 * np.pi
    kind, words = cutting.classify(t, rudder, psi)
    assert words == word and kind == ("random" if word == "random orders" else "turn")


def test_a_rudder_steered_by_hand_is_no_turn_at_its_smallest_angle():
    """As before a zig-zag of the Esso Osaka: 19 degrees in passing, then some 4 degrees for a while."""
    t = np.arange(0.0, 40.0, 0.1)
    angle = np.interp(t, [0, 3, 8, 20, 29, 30, 31, 40], [0, -19, 0, 0, 4, 4, 2.4, 1.2]) * DEG
    assert cutting.classify(t, angle, 0.02 * np.sin(t / 10))[0] == "random"
    held = np.where(t < 5.0, 0.0, 4.0) * DEG
    assert cutting.classify(t, held, 0.02 * t)[0] == "turn"


@pytest.mark.parametrize(
    "value, side, asked",
    [(4.8, "starboard", True), (-4.1, "port", True), (1.0, "port", True), (7.0, "starboard", False)],
)
def test_a_side_of_the_rudder_that_is_not_sure_is_asked_with_the_likelier_one_set(
    tmp_path, monkeypatch, value, side, asked
):
    truth = motion(np.random.default_rng(7))
    monkeypatch.setattr("bayesid.trials.importing.deciding.rudder_t", lambda *_: value)
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, "rudder [deg]": truth["delta_r_cmd"] / DEG,
        "rpm": truth["n_cmd"],
    }  # fmt: skip
    found = propose([_table(tmp_path, truth, columns)]).map
    assert found.rudder_positive == side
    assert any(text.startswith("rudder_positive") for text in found.questions) == asked


def test_a_staircase_of_orders_is_a_spiral_and_a_stop_is_rest():
    levels = [0, 15, 10, 5, 0, -5, -10, -15, -10, -5, 0, 5, 10, 15, 0]
    t = np.arange(0.0, 40.0 * len(levels), 0.5)
    rudder = np.array(levels)[(t // 40).astype(int)] * DEG
    pieces = cutting.cut(t, rudder, np.cumsum(-rudder) * 0.02, np.ones(t.size))
    assert "spiral" in [p.kind for p in pieces]
    speed = np.where(t < 300.0, 1.0, 0.0)
    assert cutting.cut(t, np.zeros(t.size), np.zeros(t.size), speed)[-1].kind == "rest"


# --- the command


@pytest.mark.thorough
def test_the_command_asks_first_and_imports_the_answered_map(tmp_path, capsys):
    truth = motion(np.random.default_rng(9))
    columns = {
        "t [s]": truth["t"], "x [m]": truth["y"], "y [m]": truth["x"], "yaw [rad]": np.pi / 2 - truth["psi"],
        "rudder_cmd [deg]": -truth["delta_r_cmd"] / DEG, "rpm_cmd": truth["n_cmd"],
    }  # fmt: skip
    path, out = _table(tmp_path, truth, columns), tmp_path / "bundle"
    assert bayesid(["trial", "import", str(path), "--out", str(out), "--vehicle", "remus100"]) == 3
    assert not (out / "trial.toml").exists()
    assert (out / "runs_1.png").stat().st_size > 10_000
    assert "which axes?" in capsys.readouterr().out
    again = ["trial", "import", str(path), "--map", str(out / "map.toml"), "--out", str(out)]
    assert bayesid(again) == 2  # the question is still open
    text = (out / "map.toml").read_text()
    asked = text[text.index("questions = [") : text.index("]\n", text.index("questions = [")) + 2]
    assert 'rudder_positive = \\"starboard\\"' in asked  # what the mirror image needs is said
    text = text.replace(asked, "").replace('world = "ned"', 'world = "enu"')
    text = text.replace('rudder_positive = "port"', 'rudder_positive = "starboard"')
    (out / "map.toml").write_text(text)
    assert bayesid(again) == 0
    trial = load_trial(out)
    assert len(trial.runs) >= 5
    assert [run.role for run in trial.runs].count("holdout") == 1
    run = next(r for r in trial.runs if r.manoeuvre.startswith("zigzag 2"))
    start = float(run.notes.rpartition(", ")[2].split(" to ")[0])
    at = np.argmin(np.abs(truth["t"] - start))
    np.testing.assert_allclose(np.sin(run.data["psi"][0] - truth["psi"][at]), 0.0, atol=0.02)
    assert run.data["psi"][-1] - run.data["psi"][0] == pytest.approx(
        np.interp(start + run.duration, truth["t"], truth["psi"]) - truth["psi"][at], abs=0.05
    )
    assert np.sign(run.commands["delta_r_cmd"][np.argmax(run.commands["delta_r_cmd"] != 0)]) == 1.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[sources.log]\nfiles = 'log.csv'\n[channels]\npsy = 'yaw'", "did you mean 'psi'"),
        (  # the column of another channel was suggested: fin 4 in place of fin 3
            "[sources.log]\nfiles = 'log.csv'\n[channels]\npsi = 'yaw'\ntheta = 'jaw'",
            "has no series 'jaw' for theta; it has",
        ),
        (
            "[sources.log]\nfiles = 'log.csv'\n[channels]\npsi = { from = 'yaw', unit = 'kn' }",
            "unit of speed",
        ),
        (
            "[sources.log]\nfiles = 'log.csv'\n[channels]\npsi = 'jaw'",
            "has no series 'jaw' for psi; did you mean 'yaw'",
        ),
        ("[sources.log]\nfiles = 'other.csv'\n[channels]\npsi = 'yaw'", "matches no"),
        ("[sources.log]\nfiles = 'log.csv'\n[channels]\nwind_dir = 'yaw'", "did you mean 'wind_from'"),
        ("wordl = 'ned'\n[sources.log]\nfiles = 'log.csv'", "did you mean 'world'"),
        ("questions = ['which?']\n[sources.log]\nfiles = 'log.csv'", "1 question of the map is open"),
        ("[sources.log]\nfiles = 'log.csv'\n[[runs]]\nfiles = ['no.csv']", "none of the runs"),
    ],
)
def test_a_map_that_does_not_fit_says_where(tmp_path, text, words):
    (tmp_path / "log.csv").write_text("t,yaw\n0,1\n1,2\n2,3\n3,4\n")
    with pytest.raises(ImportLogError, match=words):
        imported(tmp_path, text, tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        # the unit alone makes them alike: delta_r_cmd[deg] was suggested
        ("psi[deg],delta_r_cmd[deg]", "for wind_from; it has delta_r_cmd[deg], psi[deg]"),
        ("psi[deg],delta_r_cmd[deg],TWD [deg]", "for wind_from; did you mean 'TWD [deg]'?"),
        ("psi[deg],delta_r_cmd[deg],wind_form[deg]", "for wind_from; did you mean 'wind_form[deg]'?"),
    ],
)
def test_a_series_that_is_not_there_is_not_taken_for_one_of_the_same_unit(tmp_path, columns, words):
    rows = "\n".join(f"{k},{','.join('1' * (columns.count(',') + 1))}" for k in range(5))
    (tmp_path / "log.csv").write_text(f"t[s],{columns}\n{rows}\n")
    text = "[sources.log]\nfiles = 'log.csv'\n[channels]\nwind_from = 'wind_from[deg]'\npsi = 'psi[deg]'"
    with pytest.raises(ImportLogError, match=re.escape(words)):
        imported(tmp_path, text, tmp_path / "log.csv")


def test_the_noise_of_a_channel_at_half_the_rate_of_the_rows_is_that_of_its_readings():
    """Joined files of other rates leave empty cells; a diagnosis once found no noise in them."""

    from bayesid.trials.noise import noise_of_readings

    readings = np.random.default_rng(1).normal(scale=0.2, size=400)
    rows = np.full(800, np.nan)
    rows[::2] = readings
    dense, sparse = (noise_of_readings((SimpleNamespace(data={"x": v}),), ["x"]) for v in (readings, rows))
    assert sparse == dense
    assert sparse["x"] == pytest.approx(0.2, rel=0.2)


@pytest.mark.parametrize(
    ("vehicle", "words"), [("remus_100", "did you mean remus100"), ("mine.toml", "no such vehicle file")]
)
def test_a_vehicle_that_is_not_there_is_refused_before_anything_is_written(tmp_path, capsys, vehicle, words):
    truth = motion(np.random.default_rng(7))
    log = _table(tmp_path, truth, {"t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"]})
    given = ["--out", str(tmp_path / "bundle"), "--vehicle", vehicle]
    assert bayesid(["trial", "import", str(log), *given]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "bundle").exists()


def test_a_speed_over_ground_that_nothing_is_made_of_is_said(tmp_path, capsys):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "psi [rad]": truth["psi"],
        "SOG [m/s]": truth["u"], "rudder [rad]": truth["delta_r_cmd"],
    }  # fmt: skip
    log = _table(tmp_path, truth, columns)
    head = 'format = 1\n[sources.log]\nfiles = "log.csv"\n[channels]\nx = "x [m]"\ny = "y [m]"\n'
    rudder = 'psi = "psi [rad]"\ndelta_r_cmd = "rudder [rad]"\n'
    for k, more in enumerate(("", 'speed_over_ground = "SOG [m/s]"\n')):
        (tmp_path / "map.toml").write_text(head + rudder + more)
        given = ["--map", str(tmp_path / "map.toml"), "--out", str(tmp_path / f"bundle{k}")]
        assert bayesid(["trial", "import", str(log), *given]) == 0
        assert ("speed_over_ground ('SOG [m/s]') is not used" in capsys.readouterr().out) is bool(more)


@pytest.mark.thorough
def test_a_proposed_map_says_that_the_position_tells_what_a_speed_over_ground_would(tmp_path, capsys):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "psi [rad]": truth["psi"],
        "SOG [m/s]": truth["u"], "rudder [rad]": truth["delta_r_cmd"],
    }  # fmt: skip
    bayesid(["trial", "import", str(_table(tmp_path, truth, columns)), "--out", str(tmp_path / "bundle")])
    assert "speed_over_ground ('SOG [m/s]') is left out: the position" in capsys.readouterr().out


def test_of_a_record_of_few_samples_its_length_is_said_and_no_column_asked_for(tmp_path, capsys):
    truth = {k: v[:3] for k, v in motion(np.random.default_rng(7)).items()}
    columns = {"t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "psi [rad]": truth["psi"]}
    log = _table(tmp_path, truth, columns)
    assert bayesid(["trial", "import", str(log), "--out", str(tmp_path / "bundle")]) == 3
    said = capsys.readouterr().out
    assert "no column of 'log.csv' has more than 3 samples: too few to be a run" in said
    assert "no position found" not in said
    truth = {k: v[:5] for k, v in motion(np.random.default_rng(7)).items()}
    columns = {
        "t [s]": truth["t"], "x [m]": truth["x"], "y [m]": truth["y"], "heading [deg]": truth["psi"] / DEG,
        "rudder [deg]": truth["delta_r_cmd"] / DEG, "RPM_port": truth["n_cmd"], "RPM_stbd": truth["n_cmd"],
    }  # fmt: skip
    asked = propose([_table(tmp_path, truth, columns)]).map.questions
    assert len(asked) == 1 and "5 samples" in asked[0]  # the rest is of columns that five do not tell


def test_a_run_without_rudder_and_heading_is_drawn_without_a_warning(tmp_path, recwarn):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"], "rpm": truth["n_cmd"]
    }  # fmt: skip
    assert draw_runs(propose([_table(tmp_path, truth, columns)]), tmp_path)
    assert not [str(w.message) for w in recwarn]


@pytest.mark.thorough
def test_an_import_carried_out_again_has_pictures_of_the_runs_it_made(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, "r [deg/s]": truth["r"] / DEG,
        "rudder (+ stbd) [deg]": -truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    log, out = _table(tmp_path, truth, columns), tmp_path / "bundle"
    assert bayesid(["trial", "import", str(log), "--out", str(out)]) == 0
    proposed = {path.name: path.read_bytes() for path in out.glob("runs*.png")}
    (out / "runs_9.png").write_bytes(proposed["runs_1.png"])  # of an import of more runs
    own = out / "map.toml"
    own.write_text(own.read_text("utf-8").replace('role = "identify"', 'role = "holdout"'), "utf-8")
    assert bayesid(["trial", "import", str(log), "--map", str(own), "--out", str(out)]) == 0
    again = {path.name: path.read_bytes() for path in out.glob("runs*.png")}
    assert set(again) == set(proposed) == {"runs_1.png", "runs_2.png"}
    assert all(again[name] != drawn for name, drawn in proposed.items())


def test_a_course_that_moves_with_the_turns_is_no_rudder_and_a_column_of_no_name_is_offered(tmp_path):
    truth = motion(np.random.default_rng(7))
    early = np.gradient(np.roll(truth["psi"], -3), truth["t"]) / DEG
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    course = propose([_table(tmp_path, truth, {**columns, "COG [deg]": early})]).map.questions
    (asked,) = [text for text in course if "no rudder found" in text]
    assert "as a rudder does" not in asked and "series not used: 'COG [deg]'" in asked
    servo = propose([_table(tmp_path, truth, {**columns, "servo 4": early})]).map.questions
    assert any("'servo 4' moves before the turns as a rudder does" in text for text in servo)


def test_a_yaw_rate_without_a_heading_is_not_said_to_be_missing(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"], "r [deg/s]": truth["r"] / DEG,
        "rudder [deg]": truth["delta_r_cmd"] / DEG, "rpm": truth["n_cmd"],
    }  # fmt: skip
    asked = propose([_table(tmp_path, truth, columns)]).map.questions
    (body,) = [text for text in asked if text.startswith("body: ")]
    assert "yaw rate 'r [deg/s]' is read without a heading" in body


@pytest.mark.parametrize("apart", [0.0, 0.01])
def test_of_two_shafts_the_question_says_how_far_they_differ_and_what_may_be_done(tmp_path, apart):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, "rudder [deg]": truth["delta_r_cmd"] / DEG,
        "RPM_port": truth["n_cmd"], "RPM_stbd": truth["n_cmd"] * (1.0 + apart),
    }  # fmt: skip
    asked = propose([_table(tmp_path, truth, columns)]).map.questions
    (shafts,) = [text for text in asked if "would fit as well" in text]
    assert f"they differ by {100.0 * apart:.2g} % (rms)" in shafts
    assert "column of their mean" in shafts and "[actuators.NAME]" in shafts


def test_a_folder_of_tables_names_the_command_that_takes_it(tmp_path, capsys):
    truth = motion(np.random.default_rng(7))
    _table(tmp_path, truth, {"t [s]": truth["t"]})
    assert bayesid(["trial", "import", str(tmp_path), "--out", str(tmp_path / "bundle")]) == 2
    assert f"bayesid start {tmp_path}" in capsys.readouterr().err


def test_runs_that_an_autopilot_steers_are_not_called_straight_and_keeping_a_course_is(tmp_path):
    """Its rudder stands nowhere for long, and its turns are brief."""
    t = np.arange(0.0, 170.0, 0.2)
    turns = sum(
        18.0 * side * ((t > at) & (t < at + 8)) * np.minimum(1.0, (at + 8 - t) / 4.0)
        for at, side in ((32, -1), (68, 1), (103, 1), (140, -1))
    )
    helm = 0.8 * np.sin(t / 3.0)
    for name, rudder, expected in (("steered", turns + helm, False), ("kept", helm, True)):
        heading = np.cumsum(0.6 * rudder * 0.2)
        north, east = (np.cumsum(0.3 * f(np.radians(heading))) for f in (np.cos, np.sin))
        table = np.column_stack([t, north, east, heading, rudder, np.full(t.size, 900.0)])
        for k in range(4):
            head = "t [s],north [m],east [m],heading [deg],rudder order [deg],rpm"
            np.savetxt(
                tmp_path / f"{name}{k}.csv", table, fmt="%.4f", delimiter=",", header=head, comments=""
            )
        found = propose(sorted(tmp_path.glob(f"{name}*.csv"))).map.runs
        assert {run.manoeuvre == "straight" for run in found} == {expected}


def test_speeds_named_by_their_direction_are_read(tmp_path):
    truth = motion(np.random.default_rng(7))
    columns = {
        "t [s]": truth["t"], "north [m]": truth["x"], "east [m]": truth["y"],
        "heading [deg]": truth["psi"] / DEG, "rudder order [deg]": truth["delta_r_cmd"] / DEG,
        "rpm": truth["n_cmd"], "Speed fwd (m/s)": truth["u"], "Speed stbd (m/s)": truth["v"],
    }  # fmt: skip
    found = propose([_table(tmp_path, truth, columns)]).map.channels
    assert {"u", "v"} <= set(found) and found["v"].source == "Speed stbd (m/s)"
