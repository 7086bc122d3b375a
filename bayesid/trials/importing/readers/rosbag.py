"""ROS 1 and ROS 2 bags and MCAP files, by rosbags; a message type is read by the definition the bag holds.

Takes a `.bag`, `.db3` or `.mcap` file or the folder of a ROS 2 bag. Axes follow REP 103 (east-north-up,
forward-left-
up) unless a frame says ned or frd.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.trials.importing.raw import ImportLogError, RawLog, Request, SourceOptions
from bayesid.trials.importing.series import Collected

LONGEST = 16  # elements of an array that are read as channels
# field path inside a message of that type -> role, unit
_POSE = {
    "position.x": ("x", "m"), "position.y": ("y", "m"), "position.z": ("z", "m"),
    "orientation.w": ("qw", ""), "orientation.x": ("qx", ""), "orientation.y": ("qy", ""),
    "orientation.z": ("qz", ""),
}  # fmt: skip
_TWIST = {
    "linear.x": ("u", "m/s"), "linear.y": ("v", "m/s"), "linear.z": ("w", "m/s"),
    "angular.x": ("p", "rad/s"), "angular.y": ("q", "rad/s"), "angular.z": ("r", "rad/s"),
}  # fmt: skip


def _under(prefix: str, table: dict[str, tuple[str, str]]) -> dict[str, tuple[str, str]]:
    return {f"{prefix}.{key}": value for key, value in table.items()}


KNOWN = {
    "nav_msgs/msg/Odometry": {**_under("pose.pose", _POSE), **_under("twist.twist", _TWIST)},
    "geometry_msgs/msg/PoseStamped": _under("pose", _POSE),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _under("pose.pose", _POSE),
    "sensor_msgs/msg/Imu": {
        **{k: v for k, v in _POSE.items() if k.startswith("orientation")},
        "angular_velocity.x": ("p", "rad/s"), "angular_velocity.y": ("q", "rad/s"),
        "angular_velocity.z": ("r", "rad/s"),
    },
    "sensor_msgs/msg/NavSatFix": {
        "latitude": ("latitude", "deg"), "longitude": ("longitude", "deg"), "altitude": ("height", "m"),
    },
}  # fmt: skip
_SKIP = re.compile(r"covariance|header|__msgtype__|_seq$")


def read_rosbag(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """Every number of every message, named topic.field; stamped by its header, else by the bag."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    collected = Collected(request)
    roles: dict[str, str] = {}
    units: dict[str, str] = {}
    frames: set[str] = set()
    notices: list[str] = []
    topics = None
    if request.wanted is not None:
        topics = {name.split(".")[0] for name in request.wanted}
    opened = path
    if path.suffix == ".db3" and (path.parent / "metadata.yaml").is_file():
        opened = path.parent
    with AnyReader([opened], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        bad: dict[str, int] = {}
        use = [c for c in reader.connections if topics is None or c.topic in topics]
        collected.kinds = {c.topic: c.msgtype for c in use}
        for connection, stamp, raw in reader.messages(connections=use):
            try:
                message = reader.deserialize(raw, connection.msgtype)
            except Exception:
                bad[connection.topic] = bad.get(connection.topic, 0) + 1
                continue
            fields: dict[str, float] = {}
            _flatten(connection.topic, message, fields, 0)
            own = _stamp(message)
            frames |= _frames(message)
            for key, (role, unit) in KNOWN.get(connection.msgtype, {}).items():
                full = f"{connection.topic}.{key}"
                roles[full] = role
                units[full] = unit
            if fields:
                collected.add(connection.topic, own or stamp, fields)
        for topic, count in bad.items():
            notices.append(f"{count} messages of {topic} cannot be decoded and are left out")
    first = collected.first()
    zero = first - first % 10**9
    channels = collected.channels(zero, roles, {k: u for k, u in units.items() if u}, {})
    if not channels:
        raise ImportLogError(f"{path}: holds no messages with numbers{'; ' + notices[0] if notices else ''}")
    text = " ".join(sorted(frames)).lower()
    return RawLog(
        str(path), "rosbag", "", tuple(channels), zero * 1e-9, "ROS time, UTC",
        world="ned" if "ned" in text else "enu", body="frd" if re.search("ned|frd", text) else "flu",
        notices=tuple(notices), text=text, doubts=_frame_doubt(text),
    )  # fmt: skip


def _frame_doubt(text: str) -> tuple[str, ...]:
    if re.search("ned|frd", text) and re.search("enu|flu", text):
        return (f"the frames of the bag ({text}) name both conventions; check world and body",)
    return ()


def _stamp(message: Any) -> int:
    header = getattr(message, "header", None)
    stamp = getattr(header, "stamp", None)
    return 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _frames(message: Any) -> set[str]:
    names = {
        getattr(getattr(message, "header", None), "frame_id", ""),
        getattr(message, "child_frame_id", ""),
    }
    return {name for name in names if name}


def _flatten(name: str, value: Any, out: dict[str, float], depth: int) -> None:
    if isinstance(value, bool | int | float | np.number):
        out[name] = float(value)
    elif isinstance(value, np.ndarray | list | tuple):
        if 0 < len(value) <= LONGEST:
            for k, item in enumerate(value):
                _flatten(f"{name}[{k}]", item, out, depth + 1)
    elif depth < 8 and hasattr(value, "__dataclass_fields__"):
        for key in value.__dataclass_fields__:
            if not _SKIP.search(key):
                _flatten(f"{name}.{key}", getattr(value, key), out, depth + 1)
