"""Each reader on files made by that format's own writer library, and on damaged ones."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from bayesid.trials.importing.raw import ImportLogError, Request, SourceOptions
from bayesid.trials.importing.readers import read_log

T = np.arange(0.0, 20.0, 0.1)
HEADING = np.mod(300.0 + 5.0 * T, 360.0)
EPOCH = 1714557600.0


def series(log, name):
    return log.by_name[name]


@pytest.mark.parametrize("mark", [",", ";", "\t", "|"])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_a_text_table_of_any_dialect_gives_the_same_numbers(tmp_path, mark, decimal, encoding):
    if decimal == "," and mark == ",":
        pytest.skip("no such dialect")
    lines = ["# pond, 3 m model", mark.join(("Time [s]", "Kurs (°)", "Ruder_deg", "note"))]
    for k, (t, psi) in enumerate(zip(T, HEADING, strict=True)):
        cells = (f"{t:.1f}", "" if k == 7 else f"{psi:.3f}", f"{k % 3 - 1}", "ok")
        lines.append(mark.join(c.replace(".", decimal) for c in cells))
    path = tmp_path / "log.csv"
    path.write_bytes("\r\n".join(lines).encode(encoding))
    log = read_log(path)
    assert log.start is None
    np.testing.assert_allclose(series(log, "Ruder_deg").t, T, atol=1e-9)
    found = series(log, "Kurs (°)")
    assert found.unit == "deg"
    assert np.isnan(found.values[7])
    np.testing.assert_allclose(np.delete(found.values, 7), np.delete(HEADING, 7), atol=6e-4)
    assert "note" not in log.by_name


def test_a_second_header_row_holds_the_units(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text(
        "t\tu\tpsi\ns\tkn\tdeg\n" + "".join(f"{t:.1f}\t3\t{p:.1f}\n" for t, p in zip(T, HEADING, strict=True))
    )
    log = read_log(path)
    assert (series(log, "u").unit, series(log, "psi").unit) == ("kn", "deg")
    assert series(log, "u").values.size == T.size


def test_a_table_without_a_header_takes_its_names_from_the_map(tmp_path):
    path = tmp_path / "Z.dat"
    rows = "".join(f"   {t:.9f}   {p:.9f}  -.5\n" for t, p in zip(T, HEADING, strict=True))
    path.write_text(" TANK\n MODEL 7\n Time series\n" + rows)
    log = read_log(path, SourceOptions(columns=("t", "psi[deg]", "delta[deg]"), time=("t",)))
    np.testing.assert_allclose(series(log, "psi[deg]").values, HEADING, atol=1e-8)
    with pytest.raises(ImportLogError, match="names 2 columns, the table has 3"):
        read_log(path, SourceOptions(columns=("t", "psi")))


@pytest.mark.parametrize(
    ("header", "stamp", "start"),
    [
        ("UTC", lambda t: f"{np.datetime64(int(EPOCH * 1000) + round(t * 1000), 'ms')}Z", EPOCH),
        ("unix time [s]", lambda t: f"{EPOCH + t:.3f}", EPOCH),
        ("stamp_ns", lambda t: str(int(EPOCH) * 10**9 + round(t * 1e9)), EPOCH),
        ("week,tow", lambda t: f"2312,{(EPOCH - 315964800 + 18) % 604800 + t:.3f}", EPOCH),  # GPS - UTC: 18 s
        ("t_ms", lambda t: f"{t * 1000:.0f}", None),
        ("date,time", lambda t: f"2024-05-01,10:00:{t:06.3f}", EPOCH),
    ],
)  # fmt: skip
def test_every_clock_gives_the_same_seconds(tmp_path, header, stamp, start):
    path = tmp_path / "log.csv"
    path.write_text(
        f"{header},psi[deg]\n" + "".join(f"{stamp(t)},{p:.6f}\n" for t, p in zip(T, HEADING, strict=True))
    )
    log = read_log(path)
    assert log.start == start
    np.testing.assert_allclose(series(log, "psi[deg]").t, T, atol=1e-3 if header == "date" else 2e-6)
    np.testing.assert_allclose(series(log, "psi[deg]").values, HEADING, atol=1e-6)


def test_parquet_keeps_nanoseconds_and_units_of_its_fields(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    stamps = pa.array((int(EPOCH * 1e9) + np.round(T * 1e9)).astype(np.int64), pa.timestamp("ns", tz="UTC"))
    field = pa.field("hdg", pa.float32(), metadata={"unit": "deg"})
    table = pa.Table.from_arrays(
        [stamps, pa.array(HEADING, pa.float32())], schema=pa.schema([pa.field("time", stamps.type), field])
    )
    pq.write_table(table, tmp_path / "log.parquet")
    log = read_log(tmp_path / "log.parquet")
    assert log.start == EPOCH
    assert series(log, "hdg").unit == "deg"
    np.testing.assert_allclose(series(log, "hdg").t, T, atol=1e-9)


def test_mat_5_structs_and_matrices_are_told_apart_by_their_own_times(tmp_path):
    from scipy.io import savemat

    slow = T[::5]
    nav = {"time": slow, "lat_deg": 59.0 + slow * 1e-6, "note": "fix"}
    savemat(
        tmp_path / "log.mat",
        {"nav": nav, "t": T, "yaw_deg": HEADING, "nu": np.column_stack((T, 2 * T, 3 * T))},
    )
    log = read_log(tmp_path / "log.mat")
    np.testing.assert_allclose(series(log, "nav.lat_deg").t, slow)
    np.testing.assert_allclose(series(log, "yaw_deg").t, T)
    np.testing.assert_allclose(series(log, "nu(:,3)").values, 3 * T)


def test_mat_73_reads_as_mat_5_does(tmp_path):
    import h5py

    path = tmp_path / "log.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", T), ("psi_deg", HEADING)):
            item = file.create_dataset(f"imu/{name}", data=values[None, :])  # 1 x n in MATLAB's order
            item.attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))
    log = read_log(path)
    np.testing.assert_allclose(series(log, "imu.psi_deg").values, HEADING)
    np.testing.assert_allclose(series(log, "imu.psi_deg").t, T)


@pytest.mark.parametrize("version", [3, 4])
def test_netcdf_goes_by_standard_names_units_and_fill_values(tmp_path, version):
    path = tmp_path / "dive.nc"
    packed = np.round(HEADING / 0.01).astype(np.int32)
    packed[3] = -1
    attrs = {
        "standard_name": "platform_orientation",
        "units": "degree",
        "scale_factor": 0.01,
        "_FillValue": packed.dtype.type(-1),
    }
    if version == 4:
        import h5netcdf

        with h5netcdf.File(path, "w") as file:
            file.dimensions = {"time": T.size}
            file.create_variable("time", ("time",), float, data=T / 3600.0).attrs["units"] = (
                "hours since 2024-05-01 12:00:00 +2:00"
            )
            item = file.create_variable(
                "hd", ("time",), packed.dtype, data=packed, fillvalue=attrs.pop("_FillValue")
            )
            for key, value in attrs.items():
                item.attrs[key] = value
    else:
        from scipy.io import netcdf_file

        with netcdf_file(path, "w") as file:
            file.createDimension("time", T.size)
            when = file.createVariable("time", "d", ("time",))
            when[:], when.units = T / 3600.0, "hours since 2024-05-01 12:00:00 +2:00"
            item = file.createVariable("hd", "i", ("time",))
            item[:] = packed
            for key, value in attrs.items():
                setattr(item, key, value)
    log = read_log(path)
    found = series(log, "hd")
    assert (found.role, found.unit, log.start) == ("heading", "deg", EPOCH)
    np.testing.assert_allclose(found.t, T, atol=1e-6)
    assert np.isnan(found.values[3])
    np.testing.assert_allclose(np.delete(found.values, 3), np.delete(HEADING, 3), atol=0.0051)


def _write_bag(path, version):
    """Odometry at 10 Hz, and an actuator message of a type that is defined in the bag alone."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    store.register(
        get_types_from_msg("std_msgs/Header header\nfloat64 rudder_deg\nfloat64[2] rpm", "pond_msgs/msg/Fins")
    )
    types = store.types
    if version == 1:
        from rosbags.rosbag1 import Writer

        bag, encode = Writer(path), store.serialize_ros1
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if version == "mcap" else StoragePlugin.SQLITE3
        bag, encode = Writer(path, version=9, storage_plugin=plugin), store.serialize_cdr

    def header(t, frame):
        stamp = types["builtin_interfaces/msg/Time"](
            sec=int(EPOCH + t), nanosec=round((t % 1.0) * 1e9) % 10**9
        )
        extra = {"seq": 0} if version == 1 else {}
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra)

    def vector(x, y, z):
        return types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    with bag:
        odom = bag.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        fins = bag.add_connection("/fins", "pond_msgs/msg/Fins", typestore=store)
        for k, t in enumerate(np.arange(0.0, 10.0, 0.125)):
            pose = types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](x=1.0 * t, y=2.0 * t, z=-3.0),
                orientation=types["geometry_msgs/msg/Quaternion"](
                    x=0.0, y=0.0, z=np.sin(0.25), w=np.cos(0.25)
                ),
            )
            twist = types["geometry_msgs/msg/Twist"](
                linear=vector(1.5, 0.1, 0.0), angular=vector(0.0, 0.0, 0.2)
            )
            message = types["nav_msgs/msg/Odometry"](
                header=header(t, "odom"), child_frame_id="base_link",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36)),
            )  # fmt: skip
            late = int((EPOCH + t + 0.3) * 1e9)  # the bag's own stamp; the header's counts
            bag.write(odom, late, encode(message, "nav_msgs/msg/Odometry"))
            if k % 4 == 0:
                fin = types["pond_msgs/msg/Fins"](
                    header=header(t, ""), rudder_deg=5.0 - k, rpm=np.array([900.0, 901.0])
                )
                bag.write(fins, late, encode(fin, "pond_msgs/msg/Fins"))


@pytest.mark.parametrize("version", [1, 2, "mcap"])
def test_a_bag_gives_odometry_and_messages_defined_in_it_alone(tmp_path, version):
    pytest.importorskip("rosbags")
    path = tmp_path / ("log.bag" if version == 1 else "log")
    _write_bag(path, version)
    if version == "mcap":
        path = next(path.glob("*.mcap"))
    log = read_log(path)
    assert (log.world, log.body, log.start) == ("enu", "flu", EPOCH)
    x = series(log, "/odom.pose.pose.position.x")
    assert (x.role, x.unit) == ("x", "m")
    np.testing.assert_allclose(x.t, np.arange(0.0, 10.0, 0.125), atol=1e-8)
    np.testing.assert_allclose(x.values, x.t, atol=1e-8)
    fin = series(log, "/fins.rudder_deg")
    np.testing.assert_allclose(fin.values, 5.0 - fin.t * 8.0, atol=1e-6)
    assert series(log, "/fins.rpm[1]").values[0] == 901.0
    only = read_log(path, request=Request(wanted=frozenset({"/fins.rudder_deg"})))
    assert set(only.by_name) == {"/fins.rudder_deg"}


def test_a_telemetry_log_comes_in_si_units_and_its_own_axes(tmp_path):
    pytest.importorskip("pymavlink")
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    link = mavlink.MAVLink(None, srcSystem=1)
    path = tmp_path / "run.tlog"
    with open(path, "wb") as file:
        for t in np.arange(0.0, 10.0, 0.2):
            for message in (
                link.attitude_encode(int(t * 1000), 0.01, -0.02, 0.5, 0.0, 0.0, 0.03),
                link.global_position_int_encode(
                    int(t * 1000), 594300000 + int(t * 10), 104700000, 1000, 0, 120, -40, 0, 9000
                ),
                link.servo_output_raw_encode(int(t * 1e6), 0, 1500, 1600, 1700, 0, 0, 0, 0, 0),
            ):
                file.write(struct.pack(">Q", int((EPOCH + t) * 1e6)) + message.pack(link))
    log = read_log(path)
    assert (log.world, log.body, log.start) == ("ned", "frd", EPOCH)
    assert series(log, "GLOBAL_POSITION_INT.vx").values[0] == pytest.approx(1.2)
    assert series(log, "GLOBAL_POSITION_INT.lat").values[0] == pytest.approx(59.43)
    yaw = series(log, "ATTITUDE.yaw")
    assert (yaw.role, yaw.unit) == ("heading", "rad")
    np.testing.assert_allclose(yaw.t, np.arange(0.0, 10.0, 0.2), atol=1e-5)
    assert series(log, "SERVO_OUTPUT_RAW.servo2_raw").role is None  # a pulse width is no angle


def _dataflash(path, messages):
    """A dataflash log as ArduPilot writes it: FMT messages that describe the others, then these."""

    def fmt(kind, length, name, form, columns):
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, form, columns)

    att = struct.Struct("<BBBQfff")
    content = fmt(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    content += fmt(129, att.size, b"ATT", b"Qfff", b"TimeUS,Roll,Pitch,Yaw")
    for t, yaw in messages:
        content += att.pack(0xA3, 0x95, 129, int(t * 1e6), 1.0, -2.0, yaw)
    path.write_bytes(content)


def test_a_dataflash_log_is_read_by_its_own_format_messages(tmp_path):
    pytest.importorskip("pymavlink")
    _dataflash(tmp_path / "1.bin", zip(T + 12.0, HEADING, strict=True))
    log = read_log(tmp_path / "1.bin")
    yaw = series(log, "ATT.Yaw")
    assert (yaw.role, yaw.unit, log.start) == ("heading", "deg", None)
    np.testing.assert_allclose(yaw.t - yaw.t[0], T, atol=1e-5)
    np.testing.assert_allclose(yaw.values, HEADING, atol=1e-4)


def _ulog(path, times, x):
    """The least a ULog may hold: header, one format, one subscription, its data (PX4's file format, version
    1)."""

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    content = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 0)
    content += message("B", bytes(40))
    content += message("F", b"vehicle_local_position:uint64_t timestamp;float x;float y;")
    content += message("A", struct.pack("<BH", 0, 7) + b"vehicle_local_position")
    for t, value in zip(times, x, strict=True):
        content += message("D", struct.pack("<HQff", 7, int(t * 1e6), value, -value))
    path.write_bytes(content)


def test_a_px4_log_gives_north_east_down(tmp_path):
    pytest.importorskip("pyulog")
    _ulog(tmp_path / "log.ulg", T + 3.0, 2.0 * T)
    log = read_log(tmp_path / "log.ulg")
    east = series(log, "vehicle_local_position.y")
    assert (east.role, log.world, log.body) == ("east", "ned", "frd")
    np.testing.assert_allclose(east.values, -2.0 * T, atol=1e-5)
    np.testing.assert_allclose(east.t, T + 3.0, atol=1e-6)


def _whole(kind, folder):
    """A file of each format, whole."""
    if kind == "mat":
        from scipy.io import savemat

        path = folder / "log.mat"
        savemat(path, {"t": T, "psi": HEADING})
    elif kind == "mat73":
        test_mat_73_reads_as_mat_5_does(folder)
        path = folder / "log.mat"
    elif kind == "nc":
        test_netcdf_goes_by_standard_names_units_and_fill_values(folder, 4)
        path = folder / "dive.nc"
    elif kind == "parquet":
        pytest.importorskip("pyarrow")
        test_parquet_keeps_nanoseconds_and_units_of_its_fields(folder)
        path = folder / "log.parquet"
    elif kind in ("bag", "mcap"):
        pytest.importorskip("rosbags")
        _write_bag(folder / ("log.bag" if kind == "bag" else "log"), 1 if kind == "bag" else "mcap")
        path = folder / "log.bag" if kind == "bag" else next((folder / "log").glob("*.mcap"))
    elif kind == "bin":
        pytest.importorskip("pymavlink")
        path = folder / "1.bin"
        _dataflash(path, zip(T, HEADING, strict=True))
    else:
        pytest.importorskip("pyulog")
        path = folder / "log.ulg"
        _ulog(path, T, T)
    return path


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnraisableExceptionWarning"
)  # pymavlink leaves the file open
@pytest.mark.parametrize("kind", ["mat", "mat73", "nc", "parquet", "bag", "mcap", "bin", "ulg"])
@pytest.mark.parametrize("damage", ["cut", "noise", "text"])
def test_a_damaged_file_is_one_sentence_or_what_is_left_of_it(tmp_path, kind, damage, capfd):
    path = _whole(kind, tmp_path)
    raw = bytearray(path.read_bytes())
    if damage == "cut":
        raw = raw[: len(raw) // 3]
    elif damage == "noise":
        rng = np.random.default_rng(3)
        at = rng.integers(64, len(raw), len(raw) // 8)
        raw[:] = bytes(raw)
        for k in at:
            raw[k] = int(rng.integers(256))
    else:
        raw = bytearray(b"this is no log at all\n" * 20)
    path = tmp_path / f"damaged{path.suffix}"
    path.write_bytes(bytes(raw))
    try:
        log = read_log(path)
    except ImportLogError as error:
        assert str(path) in str(error)
        assert "\n" not in str(error)
        assert len(str(error)) < len(str(path)) + 300
    else:
        assert log.channels  # loggers that lose power leave files whose first part is good


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"  \n\n", "is empty"),
        (b"t,psi\n", "no samples|no table"),
        (b"t,psi\n1,2\n\0\0\0\n", "NUL"),
        (b"a story\nof words\n", "no table of numbers"),
        (b"psi,r\n3,4\n1,2\n3,1\n", "no column can be the time"),
    ],
)
def test_a_text_that_is_no_log_is_refused_in_one_sentence(tmp_path, content, words):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(ImportLogError, match=words) as caught:
        read_log(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("at", "before"), [(1, "4"), (3, "4.0"), (4, "4.0,"), (9, "4.0,10.00")])
def test_a_row_cut_in_two_by_a_carriage_return_is_said(tmp_path, at, before):
    rows = [f"{k:.1f},10.00{k % 7},{k % 5}.5" for k in range(80)]
    rows[4] = rows[4][:at] + "\r" + rows[4][at:]
    path = tmp_path / "my log.csv"
    path.write_bytes("\r\n".join(["t,psi,r", *rows]).encode())
    with pytest.raises(ImportLogError) as caught:
        read_log(path)
    assert str(caught.value) == (
        f"{path}: row 6 is cut in two by a stray carriage return (CR) after {before!r}; remove it: "
        f"tr -d '\\r' < '{path}' > mended.csv"
    )
    path.write_bytes("\r\n".join(row.replace("\r", "") + "\r,AUTO" for row in rows).encode())
    with pytest.raises(ImportLogError, match=r"row 1 is cut in two .*, and \d+ more rows; remove it"):
        read_log(path)


@pytest.mark.parametrize("ending", ["\r", "\r\r\n", "\r\n"])
def test_a_carriage_return_that_ends_a_row_cuts_nothing(tmp_path, ending):
    path = tmp_path / "log.csv"
    path.write_bytes(ending.join(["t,psi,r", *(f"{k},10.{k},0.5" for k in range(80)), ""]).encode())
    assert series(read_log(path), "psi").t.size == 80


def test_a_column_of_words_may_have_an_empty_cell(tmp_path):
    words = ["" if k == 6 else "AUTO" for k in range(80)]
    rows = [f"{k}.0,10.{k},{word},0.5" for k, word in enumerate(words)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["t,psi,mode,r", *rows]) + "\n")
    log = read_log(path)
    assert series(log, "psi").lost == 0 and series(log, "r").t.size == 80


def test_a_reader_that_is_not_installed_is_named_with_its_install_line(tmp_path, monkeypatch):
    import builtins

    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name.split(".")[0] == "pyulog":
            raise ModuleNotFoundError("No module named 'pyulog'", name="pyulog")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    (tmp_path / "log.ulg").write_bytes(b"ULog\x01\x12\x35")
    with pytest.raises(ImportLogError, match=r"needs pyulog; install it with: pip install 'bayesid\[px4\]'"):
        read_log(tmp_path / "log.ulg")


def test_cells_that_are_no_numbers_are_counted_and_left_out(tmp_path):
    rows = [
        f"{t:.1f},{'err' if k % 10 == 4 else p}\n" for k, (t, p) in enumerate(zip(T, HEADING, strict=True))
    ]
    (tmp_path / "log.csv").write_text("t,psi\n" + "".join(rows))
    found = series(read_log(tmp_path / "log.csv"), "psi")
    assert found.lost == T.size // 10
    assert np.isnan(found.values).sum() == T.size // 10


def test_a_step_keeps_one_sample_per_step_and_every_change_of_a_command(tmp_path):
    t = np.arange(0.0, 100.0, 0.01)
    order = np.where((t > 30.004) & (t < 30.055), 1.0, 0.0)
    lines = "".join(f"{a:.2f},{b:.4f},{c:g}\n" for a, b, c in zip(t, np.sin(t), order, strict=True))
    (tmp_path / "log.csv").write_text("t,psi,cmd\n" + lines)
    request = Request(frozenset({"psi", "cmd"}), None, 0.5, frozenset({"cmd"}))
    log = read_log(tmp_path / "log.csv", SourceOptions(time=("t",)), request)
    found = series(log, "cmd")
    assert 200 <= found.t.size <= 204
    changes = found.t[1:][np.diff(found.values) != 0]
    np.testing.assert_allclose(changes, [30.01, 30.06], atol=1e-9)
