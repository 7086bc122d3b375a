"""Each recipe of docs/importing.md on a small file of that structure, made by the format's own writer where
there is one."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from bayesid.trials import load_trial
from bayesid.trials.importing import apply_map, propose, read_map, write_bundle
from tests.raw_logs import motion

PAGE = (Path(__file__).parents[1] / "docs" / "importing.md").read_text("utf-8")
RECIPES = dict(re.findall(r"^### ([^\n]+)\n.*?```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL))
DEG, EPOCH, LAT, LON = np.pi / 180.0, 1714557600.0, 36.8, -121.8
TRUTH = {k: v[:900:2] for k, v in motion(np.random.default_rng(6)).items()}
ROWS = range(TRUTH["t"].size)
HEADING = np.mod(TRUTH["psi"] / DEG, 360.0)


def delphin2(folder):
    rosbags = pytest.importorskip("rosbags")
    assert rosbags
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kinds = {
        "compass": "float32 heading\nfloat32 pitch\nfloat32 roll\nfloat32 temperature",
        "position": "float32 X\nfloat32 Y\nfloat32 Z\nfloat32 forward_vel\nfloat32 sway_vel\nfloat64 lat\n"
        "float64 long",
        "tail_feedback": "float32 b_sp\nfloat32 d_sp\nint32 prop_sp\nfloat32 prop_rps",
    }
    for name, text in kinds.items():
        store.register(get_types_from_msg(text, f"hardware_interfaces/msg/{name}"))

    def message(name, **values):
        kind = f"hardware_interfaces/msg/{name}"
        return kind, store.serialize_ros1(store.types[kind](**values), kind)

    with Writer(folder / "log.bag") as bag:
        topics = {"compass": "/compass_out", "position": "/position_dead", "tail_feedback": "/tail_output"}
        places = {
            name: bag.add_connection(topic, f"hardware_interfaces/msg/{name}", typestore=store)
            for name, topic in topics.items()
        }
        for k in ROWS:
            when = int((EPOCH + TRUTH["t"][k]) * 1e9)
            rudder = TRUTH["delta_r_cmd"][k] / DEG
            for name, values in (
                ("compass", {"heading": HEADING[k], "pitch": 0.0, "roll": 0.0, "temperature": 12.0}),
                ("position", {"X": TRUTH["y"][k], "Y": TRUTH["x"][k], "Z": 1.0, "forward_vel": TRUTH["u"][k],
                              "sway_vel": TRUTH["v"][k], "lat": 50.9, "long": -1.4}),
                ("tail_feedback", {"b_sp": -rudder, "d_sp": rudder, "prop_sp": 22,
                                   "prop_rps": TRUTH["n_cmd"][k] / 60.0}),
            ):  # fmt: skip
                bag.write(places[name], when, message(name, **values)[1])
    return [folder / "log.bag"]


def lat_lon():
    s2 = np.sin(LAT * DEG) ** 2
    meridian = 6378137.0 * (1 - 0.00669437999014) / (1 - 0.00669437999014 * s2) ** 1.5
    normal = 6378137.0 / np.sqrt(1 - 0.00669437999014 * s2)
    return LAT * DEG + TRUTH["x"] / meridian, LON * DEG + TRUTH["y"] / (normal * np.cos(LAT * DEG))


def lrauv(folder):
    import h5netcdf

    lat, lon = lat_lon()
    with h5netcdf.File(folder / "dive.nc", "w") as file:
        file.dimensions = {"time": TRUTH["t"].size}
        for name, values, units, standard in (
            ("time", EPOCH + TRUTH["t"], "seconds since 1970-01-01T00:00:00Z", "time"),
            ("latitude", lat, "radian", "latitude"),
            ("longitude", lon, "radian", "longitude"),
            ("platform_orientation", np.mod(TRUTH["psi"], 2 * np.pi), "radian", "platform_orientation"),
            ("platform_rudder_angle_cmd", TRUTH["delta_r_cmd"], "radian", ""),
            ("platform_propeller_rotation_rate", TRUTH["n_cmd"] * np.pi / 30.0, "radian/second", ""),
        ):
            item = file.create_variable(name, ("time",), float, data=values)
            item.attrs["units"] = units
            if standard:
                item.attrs["standard_name"] = standard
    return [folder / "dive.nc"]


def ardupilot(folder):
    pytest.importorskip("pymavlink")

    def fmt(kind, length, name, form, columns):
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, columns)

    att, ekf, out = struct.Struct("<BBBQf"), struct.Struct("<BBBQff"), struct.Struct("<BBBQHH")
    content = fmt(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    content += fmt(129, att.size, b"ATT", b"Qf", b"TimeUS,Yaw")
    content += fmt(130, ekf.size, b"XKF1", b"Qff", b"TimeUS,PN,PE")
    content += fmt(131, out.size, b"RCOU", b"QHH", b"TimeUS,C1,C3")
    for k in ROWS:
        stamp = round((TRUTH["t"][k] + 20.0) * 1e6)
        content += att.pack(0xA3, 0x95, 129, stamp, HEADING[k])
        content += ekf.pack(0xA3, 0x95, 130, stamp, TRUTH["x"][k], TRUTH["y"][k])
        servo = round(1500 - 10 * TRUTH["delta_r_cmd"][k] / DEG)
        content += out.pack(0xA3, 0x95, 131, stamp, servo, round((TRUTH["n_cmd"][k] + 3300) / 3))
    (folder / "00000012.bin").write_bytes(content)
    return [folder / "00000012.bin"]


def px4(folder):
    pytest.importorskip("pyulog")

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    content = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    content += message("F", b"vehicle_local_position:uint64_t timestamp;float x;float y;float heading;")
    content += message("F", b"actuator_servos:uint64_t timestamp;float control;")
    content += message("F", b"actuator_motors:uint64_t timestamp;float control;")
    for k, name in enumerate((b"vehicle_local_position", b"actuator_servos", b"actuator_motors")):
        content += message("A", struct.pack("<BH", 0, k) + name)
    for k in ROWS:
        stamp = round(TRUTH["t"][k] * 1e6)
        yaw = (TRUTH["psi"][k] + np.pi) % (2 * np.pi) - np.pi
        content += message("D", struct.pack("<HQfff", 0, stamp, TRUTH["x"][k], TRUTH["y"][k], yaw))
        content += message("D", struct.pack("<HQf", 1, stamp, -TRUTH["delta_r_cmd"][k] / DEG / 30.0))
        content += message("D", struct.pack("<HQf", 2, stamp, TRUTH["n_cmd"][k] / 1500.0))
    (folder / "log.ulg").write_bytes(content)
    return [folder / "log.ulg"]


def lauv(folder):
    head = "timestamp (seconds since 01/01/1970),system,entity"
    stamp = [f"{EPOCH + t:.3f},lauv-xplore-1" for t in TRUTH["t"]]
    state = [f"{head},lat,lon,height,x,y,z,phi,theta,psi,u,v,w,p,q,r"]
    rudder, shaft = [f"{head},value"], [f"{head},value"]
    for k in ROWS:
        yaw = (TRUTH["psi"][k] + np.pi) % (2 * np.pi) - np.pi
        numbers = [0.72, -0.15, 0.0, TRUTH["x"][k], TRUTH["y"][k], 2.0, 0.0, 0.0, yaw, TRUTH["u"][k],
                   TRUTH["v"][k], 0.0, 0.0, 0.0, TRUTH["r"][k]]  # fmt: skip
        state.append(f"{stamp[k]},Navigation," + ",".join(f"{v:.6f}" for v in numbers))
        rudder.append(f"{stamp[k]},Autopilot,{-TRUTH['delta_r_cmd'][k]:.7f}")
        shaft.append(f"{stamp[k]},Motor,{TRUTH['n_cmd'][k]:.0f}")
    paths = []
    for name, lines in (("EstimatedState.csv", state), ("rudder.csv", rudder), ("Rpm.csv", shaft)):
        (folder / name).write_text("\n".join(lines) + "\n")
        paths.append(folder / name)
    return paths


def basin(folder):
    from scipy.io import savemat

    run = {
        "time": TRUTH["t"], "X": TRUTH["x"], "Y": TRUTH["y"], "psi": TRUTH["psi"] / DEG,
        "yawrate": TRUTH["r"] / DEG, "delta": TRUTH["delta_r_cmd"] / DEG, "n": TRUTH["n_cmd"] / 60.0,
    }  # fmt: skip
    savemat(folder / "zigzag.mat", {"run": run, "scale": 45.7})
    return [folder / "zigzag.mat"]


FILES = {
    "Delphin2 (ROS 1 bag)": delphin2,
    "LRAUV, Dorado (NetCDF)": lrauv,
    "ArduSub, ArduPilot Rover (dataflash .bin)": ardupilot,
    "PX4 boat (.ulg)": px4,
    "LAUV (CSV export of Neptus)": lauv,
    "Towing tank or basin (MAT)": basin,
}


def test_every_recipe_of_the_page_is_run():
    assert list(RECIPES) == list(FILES)


def test_what_a_file_is_called_tells_what_its_value_is(tmp_path):
    """Neptus exports servo and shaft as files of one structure with a column `value`, at the same time."""
    found = propose(lauv(tmp_path)).map
    assert found.channels["delta_r_cmd"].source == "rudder:value"
    assert {found.channels[role].source for role in found.channels if role in ("n", "n_cmd")} == {"Rpm:value"}


def test_fields_of_a_struct_are_known_by_their_own_names(tmp_path):
    channels = propose(basin(tmp_path)).map.channels
    assert channels["x"].source == "run.X"
    assert channels["y"].source == "run.Y"


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)  # pymavlink leaves its file open
@pytest.mark.parametrize("name", FILES)
def test_a_recipe_reads_what_the_vehicle_did(tmp_path, name):
    """Position to a centimetre or the digits of the format, angles to what a pulse width resolves."""
    paths = FILES[name](tmp_path)
    (tmp_path / "map.toml").write_text(RECIPES[name])
    found = read_map(tmp_path / "map.toml")
    runs, origin = apply_map(found, paths)
    write_bundle(found, runs, origin, tmp_path / "bundle", tmp_path / "map.toml")
    (run,) = load_trial(tmp_path / "bundle").runs
    assert run.t.size == TRUTH["t"].size
    for axis in ("x", "y"):
        moved = run.data[axis] - run.data[axis][0]
        np.testing.assert_allclose(moved, TRUTH[axis] - TRUTH[axis][0], atol=0.02)
    np.testing.assert_allclose(np.sin(run.data["psi"] - TRUTH["psi"]), 0.0, atol=1e-3)
    rudder = run.commands.get("delta_r_cmd", run.measured_inputs.get("delta_r"))
    np.testing.assert_allclose(rudder, TRUTH["delta_r_cmd"], atol=0.05 * DEG)
    shaft = run.commands.get("n_cmd", run.measured_inputs.get("n"))
    np.testing.assert_allclose(shaft, TRUTH["n_cmd"], atol=1.6)
    for rate in ("u", "v", "r"):
        if rate in run.data:
            np.testing.assert_allclose(run.data[rate], TRUTH[rate], atol=1e-5)
