"""ArduPilot logs: the dataflash `.bin` and the telemetry `.tlog`, by pymavlink.

Servo outputs are pulse widths; what angle a pulse is, the log does not say.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bayesid.trials.importing.raw import ImportLogError, RawLog, Request, SourceOptions
from bayesid.trials.importing.series import Collected

# message.field -> role, unit, factor; axes ned and frd by definition of ArduPilot
BIN = {
    "ATT.Roll": ("phi", "deg", 1.0), "ATT.Pitch": ("theta", "deg", 1.0), "ATT.Yaw": ("heading", "deg", 1.0),
    "XKF1.PN": ("north", "m", 1.0), "XKF1.PE": ("east", "m", 1.0), "XKF1.PD": ("z", "m", 1.0),
    "XKF1.VN": ("v_north", "m/s", 1.0), "XKF1.VE": ("v_east", "m/s", 1.0), "XKF1.VD": ("v_down", "m/s", 1.0),
    "NKF1.PN": ("north", "m", 1.0), "NKF1.PE": ("east", "m", 1.0), "NKF1.PD": ("z", "m", 1.0),
    "NKF1.VN": ("v_north", "m/s", 1.0), "NKF1.VE": ("v_east", "m/s", 1.0), "NKF1.VD": ("v_down", "m/s", 1.0),
    "IMU.GyrX": ("p", "rad/s", 1.0), "IMU.GyrY": ("q", "rad/s", 1.0), "IMU.GyrZ": ("r", "rad/s", 1.0),
    "GPS.Lat": ("latitude", "deg", 1.0), "GPS.Lng": ("longitude", "deg", 1.0), "GPS.Alt": ("height",
    "m", 1.0),
    "GPS.Spd": ("speed_over_ground", "m/s", 1.0), "GPS.GCrs": ("course", "deg", 1.0),
    "RPM.rpm1": ("n", "rpm", 1.0), "ESC.RPM": ("n", "rpm", 1.0),
}  # fmt: skip
TLOG = {
    "ATTITUDE.roll": ("phi", "rad", 1.0), "ATTITUDE.pitch": ("theta", "rad", 1.0),
    "ATTITUDE.yaw": ("heading", "rad", 1.0),
    "ATTITUDE.rollspeed": ("p", "rad/s", 1.0), "ATTITUDE.pitchspeed": ("q", "rad/s", 1.0),
    "ATTITUDE.yawspeed": ("r", "rad/s", 1.0),
    "GLOBAL_POSITION_INT.lat": ("latitude", "deg", 1e-7), "GLOBAL_POSITION_INT.lon": ("longitude",
    "deg", 1e-7),
    "GLOBAL_POSITION_INT.alt": ("height", "m", 1e-3), "GLOBAL_POSITION_INT.vx": ("v_north", "m/s", 1e-2),
    "GLOBAL_POSITION_INT.vy": ("v_east", "m/s", 1e-2), "GLOBAL_POSITION_INT.vz": ("v_down", "m/s", 1e-2),
    "LOCAL_POSITION_NED.x": ("north", "m", 1.0), "LOCAL_POSITION_NED.y": ("east", "m", 1.0),
    "LOCAL_POSITION_NED.z": ("z", "m", 1.0), "LOCAL_POSITION_NED.vx": ("v_north", "m/s", 1.0),
    "LOCAL_POSITION_NED.vy": ("v_east", "m/s", 1.0), "LOCAL_POSITION_NED.vz": ("v_down", "m/s", 1.0),
}  # fmt: skip
_BOOKKEEPING = {
    "FMT",
    "FMTU",
    "UNIT",
    "MULT",
    "PARM",
    "MSG",
    "BAD_DATA",
    "PARAM_VALUE",
    "STATUSTEXT",
    "HEARTBEAT",
}
_TIMES = {"TimeUS", "TimeMS", "time_boot_ms", "time_usec", "mavpackettype", "I", "C"}


def read_bin(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """A dataflash log; instance 0 of a sensor keeps the plain name, others are IMU[1], GPS[1]."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(str(path), zero_time_base=False)
    try:
        return _read(path, log, BIN, "ardupilot_bin", request)
    finally:
        log.data_map.close()
        log.filehandle.close()


def read_tlog(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """A telemetry log, stamped by the ground station."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    try:
        return _read(path, log, TLOG, "ardupilot_tlog", request)
    finally:
        log.close()


def _read(
    path: Path, log: Any, known: dict[str, tuple[str, str, float]], kind: str, request: Request
) -> RawLog:
    collected = Collected(request)
    roles: dict[str, str] = {}
    units: dict[str, str] = {}
    factors: dict[str, float] = {}
    counted = 0
    wanted = None if request.wanted is None else {n.split(".")[0].split("[")[0] for n in request.wanted}
    while (message := log.recv_match(type=sorted(wanted) if wanted else None)) is not None:
        name = message.get_type()
        if name in _BOOKKEEPING:
            continue
        counted += 1
        content = message.to_dict()
        instance = content.get("I", content.get("C", 0)) if kind == "ardupilot_bin" else 0
        topic = name if not isinstance(instance, int) or instance == 0 else f"{name}[{instance}]"
        stamp = content.get("TimeUS")
        when = float(getattr(message, "_timestamp", 0.0))
        at = round(when * 1e6) * 1000 if stamp is None or when > 1e9 else int(stamp) * 1000
        fields = {
            f"{topic}.{key}": float(value)
            for key, value in content.items()
            if key not in _TIMES and isinstance(value, int | float) and not isinstance(value, bool)
        }
        for key in fields:
            field = key.split(".", 1)[1]
            if f"{name}.{field}" in known and topic == name:
                roles[key], units[key], factors[key] = known[f"{name}.{field}"]
        if fields:
            collected.add(topic, at, fields)
    first = collected.first()
    absolute = first > 10**18
    zero = first - first % 10**9 if absolute else 0
    channels = collected.channels(zero, roles, units, factors)
    if not channels:
        raise ImportLogError(f"{path}: holds no messages with numbers; it is damaged, or no ArduPilot log")
    return RawLog(
        str(path), kind, "", tuple(channels), zero * 1e-9 if absolute else None,
        "UTC by GPS or ground station" if absolute else "time since boot", world="ned", body="frd",
    )  # fmt: skip
