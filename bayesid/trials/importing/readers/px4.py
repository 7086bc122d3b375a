"""PX4 logs (`.ulg`), by pyulog.

Actuator outputs are normalised or pulse widths; what angle they are, the log does not say.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayesid.trials.importing.raw import RawChannel, RawLog, Request, SourceOptions, thin_rows

# topic.field -> role, unit, factor; axes by definition of the messages
KNOWN = {
    "vehicle_local_position.x": ("north", "m", 1.0), "vehicle_local_position.y": ("east", "m", 1.0),
    "vehicle_local_position.z": ("z", "m", 1.0), "vehicle_local_position.vx": ("v_north", "m/s", 1.0),
    "vehicle_local_position.vy": ("v_east", "m/s", 1.0), "vehicle_local_position.vz": ("v_down", "m/s", 1.0),
    "vehicle_attitude.q[0]": ("qw", "", 1.0), "vehicle_attitude.q[1]": ("qx", "", 1.0),
    "vehicle_attitude.q[2]": ("qy", "", 1.0), "vehicle_attitude.q[3]": ("qz", "", 1.0),
    "vehicle_angular_velocity.xyz[0]": ("p", "rad/s", 1.0), "vehicle_angular_velocity.xyz[1]": ("q",
    "rad/s", 1.0),
    "vehicle_angular_velocity.xyz[2]": ("r", "rad/s", 1.0),
    "vehicle_gps_position.lat": ("latitude", "deg", 1e-7), "vehicle_gps_position.lon": ("longitude",
    "deg", 1e-7),
    "vehicle_gps_position.alt": ("height", "m", 1e-3),
    "vehicle_gps_position.latitude_deg": ("latitude", "deg", 1.0),
    "vehicle_gps_position.longitude_deg": ("longitude", "deg", 1.0),
    "rpm.indicated_frequency_rpm": ("n", "rpm", 1.0), "rpm.rpm_estimate": ("n", "rpm", 1.0),
}  # fmt: skip


def read_ulog(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """Every topic of the log; a further instance of a topic is named topic[1]."""
    from pyulog import ULog

    topics = None
    if request.wanted is not None:
        topics = sorted({name.split(".")[0].split("[")[0] for name in request.wanted})
    with open(path, "rb") as file:
        log = ULog(file, topics)
    channels = []
    start = None
    for data in log.data_list:
        if data.name == "vehicle_gps_position" and start is None:
            utc = data.data.get("time_utc_usec")
            if utc is not None and (utc > 0).any():
                k = int(np.argmax(utc > 0))
                start = float(utc[k] - data.data["timestamp"][k]) * 1e-6
    notices = [] if not log.dropouts else [f"{len(log.dropouts)} dropouts of the logger"]
    for data in log.data_list:
        topic = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
        t = data.data["timestamp"].astype(np.int64) * 1e-6
        rows = np.arange(t.size)
        if request.step is not None and t.size:
            switching = [v for k, v in data.data.items() if f"{topic}.{k}" in request.switching]
            rows = np.flatnonzero(thin_rows(t, switching, request.step))
        if request.most is not None and rows.size > request.most:
            rows = rows[:: int(np.ceil(rows.size / request.most))]
        for key, values in data.data.items():
            name = f"{topic}.{key}"
            if key.startswith("timestamp") or not request.wants(name) or values.dtype.kind not in "iufb":
                continue
            role, unit, factor = KNOWN.get(name, (None, None, 1.0))
            channels.append(
                RawChannel(
                    name,
                    t[rows],
                    values[rows].astype(float) * factor,
                    unit or None,
                    role,
                    f"topic {topic}: {key}",
                )
            )
    return RawLog(
        str(path), "px4", "", tuple(channels), start, "time since boot" if start is None else "UTC by GPS",
        world="ned", body="frd", notices=tuple(notices),
    )  # fmt: skip
