"""NetCDF by the CF conventions: variables along a time axis, read by standard_name and units.

Version 3 by scipy, version 4 by h5netcdf. Does not: follow grids or trajectories of more than one dimension.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.trials.importing.raw import ImportLogError, RawChannel, RawLog, Request, SourceOptions
from bayesid.trials.importing.tables import Columns, channels_of, choose_time
from bayesid.trials.importing.unit_words import plain_unit

# CF standard names (table 85) of what a vehicle logs; a name that counts the other way is left to the user
CF_ROLES = {
    "latitude": "latitude", "longitude": "longitude", "depth": "depth", "altitude": "height",
    "height_above_reference_ellipsoid": "height", "height_above_mean_sea_level": "height",
    "platform_orientation": "heading", "platform_azimuth_angle": "heading", "platform_yaw_angle": "heading",
    "platform_yaw_fore_starboard": "heading", "platform_yaw": "heading",
    "platform_pitch_angle": "theta", "platform_pitch_fore_up": "theta", "platform_pitch": "theta",
    "platform_roll_angle": "phi", "platform_roll_starboard_down": "phi", "platform_roll": "phi",
    "platform_yaw_rate_fore_starboard": "r", "platform_yaw_rate": "r", "platform_pitch_rate_fore_up": "q",
    "platform_roll_rate_starboard_down": "p", "platform_speed_wrt_ground": "speed_over_ground",
    "platform_course": "course", "platform_speed_wrt_sea_water": "speed_through_water",
    "platform_speed_wrt_air": "", "wind_speed": "wind_speed", "wind_from_direction": "wind_from",
    "projection_x_coordinate": "east", "projection_y_coordinate": "north", "time": "t",
}  # fmt: skip
_SINCE = re.compile(r"(\w+)\s+since\s+(.+)", re.IGNORECASE)


def read_netcdf(path: Path, options: SourceOptions, request: Request) -> RawLog:
    """Every variable of one dimension that has a time along it."""
    with open(path, "rb") as file:
        variables = _version3(path) if file.read(3) == b"CDF" else _version4(path)
    groups: dict[str, dict[str, tuple[np.ndarray, dict[str, str]]]] = {}
    for name, (dims, values, attrs) in variables.items():
        if len(dims) == 1 and values.dtype.kind in "iuf":
            groups.setdefault(dims[0], {})[name] = (values, attrs)
    channels: list[RawChannel] = []
    notices: list[str] = []
    start: float | None = None
    words, names = "", ()  # type: str, tuple[str, ...]
    failed: ImportLogError | None = None
    for dim, group in groups.items():
        data = {n: v for n, (v, _) in group.items()}
        units = {n: plain_unit(a.get("units")) for n, (_, a) in group.items()}
        roles = {n: CF_ROLES.get(a.get("standard_name", ""), "") for n, (_, a) in group.items()}
        for n, (_, attrs) in group.items():
            if found := _SINCE.fullmatch(attrs.get("units", "").strip()):
                data[n], roles[n], units[n] = _dates(data[n], found[1], found[2]), "t", None
        columns = Columns(data, units, {n: r for n, r in roles.items() if r})
        try:
            choice = choose_time(columns, options, str(path))
        except ImportLogError as error:
            failed = failed or error
            notices.append(f"dimension {dim!r} has no time; {', '.join(list(data)[:3])} left out")
            continue
        more, zero, words = channels_of(columns, choice, request, str(path))
        shift = 0.0 if start is None or zero is None else zero - start
        start = zero if start is None else start
        channels += [
            RawChannel(c.name, c.t + shift, c.values, c.unit, c.role, f"variable {c.name!r}") for c in more
        ]
        names = (*names, *choice.names)
    if not channels and failed is not None:
        raise failed
    return RawLog(
        str(path), "netcdf", "", tuple(channels), start, words, time_names=names, notices=tuple(notices)
    )


def _dates(values: np.ndarray, unit: str, since: str) -> np.ndarray:
    """datetime64[ns] of CF time (the standard calendar; a zone other than UTC is honoured)."""
    import pandas

    epoch = pandas.Timestamp(since.strip())
    if epoch.tzinfo is not None:
        epoch = epoch.tz_convert("UTC").tz_localize(None)
    per = {"d": 86400.0, "h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    factor = per[str(plain_unit(unit))]
    out = np.full(values.shape, np.datetime64("NaT", "ns"))
    good = np.isfinite(values) if values.dtype.kind == "f" else np.ones(values.shape, bool)
    first = float(values[good][0]) if good.any() else 0.0
    whole = int(np.floor(first * factor))
    rest = (values[good].astype(float) - whole / factor) * factor
    out[good] = (
        epoch.to_datetime64().astype("datetime64[ns]")
        + np.timedelta64(whole, "s")
        + (np.round(rest * 1e9).astype("timedelta64[ns]"))
    )
    return out


def _scaled(values: np.ndarray, attrs: dict[str, Any]) -> np.ndarray:
    fill = [attrs[k] for k in ("_FillValue", "missing_value") if k in attrs]
    out = values
    if fill or "scale_factor" in attrs or "add_offset" in attrs:
        out = values.astype(float)
        for mark in fill:
            out[values == np.asarray(mark).ravel()[0]] = np.nan
        out = out * float(np.ravel(attrs.get("scale_factor", 1.0))[0]) + float(
            np.ravel(attrs.get("add_offset", 0.0))[0]
        )
    return out


def _texts(attrs: dict[str, Any]) -> dict[str, str]:
    return {k: v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for k, v in attrs.items()}


def _version3(path: Path) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
    from scipy.io import netcdf_file

    out = {}
    with netcdf_file(str(path), "r", mmap=False) as file:
        for name, variable in file.variables.items():
            attrs = dict(variable._attributes)
            values = np.array(variable.data)
            values = values.astype(values.dtype.newbyteorder("="))
            out[name] = (tuple(variable.dimensions), _scaled(values, attrs), _texts(attrs))
    return out


def _version4(path: Path) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
    import h5netcdf

    out = {}
    with h5netcdf.File(path, "r") as file:
        for name, variable in file.variables.items():
            if (
                variable.dtype is str
                or np.dtype(variable.dtype).kind not in "iuf"
                or len(variable.dimensions) != 1
            ):
                continue
            attrs = dict(variable.attrs)
            out[name] = (tuple(variable.dimensions), _scaled(np.asarray(variable[...]), attrs), _texts(attrs))
    return out
