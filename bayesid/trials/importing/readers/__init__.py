"""Which reader a file takes, by its first bytes and its name; readers import their libraries only when
called."""

from __future__ import annotations

import hashlib
import importlib
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from bayesid.trials.equal_times import spread_equal_times
from bayesid.trials.importing.raw import ImportLogError, RawLog, Request, SourceOptions

# format -> (module, function, what else to install or "")
_READERS = {
    "csv": ("text", "read_text", ""),
    "parquet": ("parquet", "read_parquet", "parquet"),
    "mat": ("matlab", "read_mat", ""),
    "mat73": ("matlab", "read_mat73", ""),
    "netcdf": ("netcdf", "read_netcdf", ""),
    "rosbag": ("rosbag", "read_rosbag", "ros"),
    "mcap": ("rosbag", "read_rosbag", "ros"),
    "ardupilot_bin": ("ardupilot", "read_bin", "ardupilot"),
    "ardupilot_tlog": ("ardupilot", "read_tlog", "ardupilot"),
    "px4": ("px4", "read_ulog", "px4"),
}
_SUFFIX = {
    ".parquet": "parquet", ".pq": "parquet", ".mat": "mat", ".nc": "netcdf", ".nc4": "netcdf",
    ".cdf": "netcdf",
    ".bag": "rosbag", ".db3": "rosbag", ".mcap": "mcap", ".bin": "ardupilot_bin", ".tlog": "ardupilot_tlog",
    ".ulg": "px4",
}  # fmt: skip


def format_of(path: Path) -> str:
    """Name of the format of a file or of a folder that is a ROS 2 bag.

    Raises
    ------
    ImportLogError             the file cannot be opened or is empty
    """
    if path.is_dir():
        if (path / "metadata.yaml").is_file():
            return "rosbag"
        raise ImportLogError(
            f"{path}: is a folder, and no ROS 2 bag (it has no metadata.yaml); name the files in it, or give "
            f"the whole to: bayesid start {shlex.quote(str(path))}"
        )
    try:
        with open(path, "rb") as file:
            head = file.read(512)
    except OSError as error:
        raise ImportLogError(f"{path}: cannot be read: {error.strerror}") from None
    if not head.strip():
        raise ImportLogError(f"{path}: is empty")
    suffix = path.suffix.lower()
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.startswith(b"#ROSBAG"):
        return "rosbag"
    if head.startswith(b"\x89MCAP0\r\n"):
        return "mcap"
    if head.startswith(b"ULog"):
        return "px4"
    if head.startswith(b"MATLAB 5.0"):
        return "mat"
    if head.startswith(b"MATLAB 7.3"):
        return "mat73"
    if head.startswith(b"CDF"):
        return "netcdf"
    if head.startswith(b"\x89HDF\r\n"):
        return "mat73" if suffix == ".mat" else "netcdf"
    return _SUFFIX.get(suffix, "csv")


def read_log(path: Path, options: SourceOptions | None = None, request: Request | None = None) -> RawLog:
    """Read one file.

    Raises
    ------
    ImportLogError             one sentence: what is wrong with the file, or what to install to read it
    """
    options, request = options or SourceOptions(), request or Request()
    kind = format_of(path)
    module, function, extra = _READERS[kind]
    try:
        reader: Callable[[Path, SourceOptions, Request], RawLog]
        reader = getattr(importlib.import_module(f"bayesid.trials.importing.readers.{module}"), function)
        log = reader(path, options, request)
    except ModuleNotFoundError as error:
        if not extra:
            raise
        raise ImportLogError(
            f"{path}: reading this format needs {error.name}; install it with: pip install 'bayesid[{extra}]'"
        ) from None
    except (ImportLogError, MemoryError):
        raise
    except Exception as error:  # a damaged file makes its library raise anything
        said = " ".join(str(error).split())[:150]
        raise ImportLogError(
            f"{path}: is damaged or not a {kind} file ({type(error).__name__}{': ' + said if said else ''})"
        ) from None
    if not log.channels and request.wanted is not None:  # the caller says what there is instead
        return read_log(path, options, Request(most=1000))
    if not log.channels:
        raise ImportLogError(f"{path}: holds no series of numbers")
    start = log.start if log.start is not None else options.start
    if options.spread:
        log = replace(log, channels=tuple(replace(c, t=spread_equal_times(c.t)) for c in log.channels))
    return replace(log, start=start, digest=log.digest or digest_of(path))


def digest_of(path: Path) -> str:
    """SHA-256 of a file, or of the files of a folder in order of name."""
    hashed = hashlib.sha256()
    for file in sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]:
        with open(file, "rb") as stream:
            while block := stream.read(2**20):
                hashed.update(block)
    return hashed.hexdigest()
