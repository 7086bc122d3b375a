"""Raw logs of random shape from one motion: names, units, clocks, axes, files and formats drawn at random.

Knows nothing of bayesid: the motion is a first-order turn with sideslip, and what it writes is what it says
in
`Shape`. `truth` is north-east-down, forward-starboard-down, rudder positive to port, SI, rpm.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

EPOCH = 1714557600.0  # 2024-05-01T10:00:00Z
LAT, LON = 59.43, 10.47
DEG = np.pi / 180.0


def motion(rng: np.random.Generator, dt: float = 0.1) -> dict[str, np.ndarray]:
    """A log of a straight run, two zig-zags, a turn each side and random orders."""
    length, speed = rng.uniform(2.0, 8.0), rng.uniform(0.8, 2.5)
    time_constant, gain = 1.2 * length / speed, 0.9 * speed / length
    orders: list[tuple[float, float]] = []
    t, psi, r, delta = 0.0, rng.uniform(-3, 3), 0.0, 0.0
    rows = []
    side, base = 1.0, psi
    between = ("straight", 40.0)
    plan = [("straight", 60.0), ("zz", 20.0), between, ("zz", 10.0), between, ("turn", 15.0), between]
    plan += [("turn", -15.0), between, ("prbs", 90.0)]
    x, y = 0.0, 0.0
    for kind, value in plan:
        begun, base, flips, switch = t, psi, 0, t
        while True:
            if kind == "straight":
                order = 0.0
                done = t - begun > value
            elif kind == "zz":
                order = side * value * DEG
                if side * -(psi - base) > value * DEG:
                    side, flips = -side, flips + 1
                done = flips > 5
            elif kind == "turn":
                order = value * DEG
                done = abs(psi - base) > 2.2 * np.pi
            else:
                if t >= switch:
                    orders.append((t, 0.0))
                    prbs, switch = rng.choice([-18.0, -9.0, 6.0, 15.0]) * DEG, t + rng.uniform(3, 12)
                order = prbs
                done = t - begun > value
            if done:
                break
            delta = order
            r += dt * (-gain * delta - r) / time_constant
            psi += dt * r
            u = speed * (1.0 - 0.15 * abs(r) * length / speed)
            v = -0.25 * length * r
            x += dt * (u * np.cos(psi) - v * np.sin(psi))
            y += dt * (u * np.sin(psi) + v * np.cos(psi))
            rows.append((t, x, y, psi, u, v, r, delta))
            t += dt
    names = ("t", "x", "y", "psi", "u", "v", "r", "delta_r_cmd")
    out = dict(zip(names, np.array(rows).T, strict=True))
    out["n_cmd"] = np.where(out["t"] < 30.0, 700.0, 900.0)
    return out


@dataclass
class Shape:
    """What was drawn; `ambiguous` if the log does not hold what its axes are, `late` seconds one clock is
    off."""

    words: dict[str, str] = field(default_factory=dict)
    ambiguous: bool = False
    late: float = 0.0
    files: list[Path] = field(default_factory=list)


NAMES = {
    "lat": ["Latitude", "lat", "GPS_Lat", "latitude_deg"], "lon": ["Longitude", "lon", "GPS_Lon",
    "longitude_deg"],
    "north": ["North", "Northing", "pos_n", "position_north"], "east": ["East", "Easting", "pos_e",
    "position_east"],
    "x": ["x", "pos_x", "X_position", "px"], "y": ["y", "pos_y", "Y_position", "py"],
    "heading": ["Heading", "HDG", "heading_true", "Kurs", "compass"], "yaw": ["yaw", "Yaw_angle", "psi",
    "yaw"],
    "u": ["u", "surge", "vx", "surge_speed"], "v": ["v", "sway", "vy", "sway_speed"],
    "vn": ["v_north", "vel_n", "VN", "VelocityNorth"], "ve": ["v_east", "vel_e", "VE", "VelocityEast"],
    "r": ["r", "yaw_rate", "RateOfTurn", "gyro_z"],
    "rudder": ["rudder_cmd", "RudderOrder", "delta_r_cmd", "Ruder_soll", "rudder_setpoint"],
    "n": ["rpm_cmd", "PropellerOrder", "shaft_speed_set", "n_cmd"],
    "time": ["time", "Time", "t", "timestamp"],
}  # fmt: skip


def draw(rng: np.random.Generator, folder: Path) -> tuple[Shape, dict[str, np.ndarray]]:
    """Write one log of random shape; its truth."""
    truth = motion(rng)
    shape = Shape()
    style = int(rng.integers(4))

    def name(key: str) -> str:
        return (
            NAMES[key][min(style, len(NAMES[key]) - 1)] if rng.random() < 0.5 else str(rng.choice(NAMES[key]))
        )

    def pick(key: str, *options: str) -> str:
        shape.words[key] = str(rng.choice(options))
        return shape.words[key]

    noise = {k: rng.normal(size=truth["t"].size) for k in ("x", "y", "psi", "u", "v", "r")}
    x, y = truth["x"] + 0.05 * noise["x"], truth["y"] + 0.05 * noise["y"]
    psi, r = truth["psi"] + 0.004 * noise["psi"], truth["r"] + 0.002 * noise["r"]
    u, v = truth["u"] + 0.01 * noise["u"], truth["v"] + 0.01 * noise["v"]
    columns: dict[str, tuple[str, str, np.ndarray]] = {}  # key -> (name, unit, values)
    place = pick("place", "latlon", "latlon", "north_east", "ned", "enu")
    attitude = pick("attitude", "heading", "heading", "heading", "yaw_enu", "yaw_ned")
    if place == "latlon":
        normal = 6378137.0 / np.sqrt(1 - 0.00669437999014 * np.sin(LAT * DEG) ** 2)
        meridian = normal * (1 - 0.00669437999014) / (1 - 0.00669437999014 * np.sin(LAT * DEG) ** 2)
        columns["lat"] = (name("lat"), "deg", LAT + x / meridian / DEG)
        columns["lon"] = (name("lon"), "deg", LON + y / (normal * np.cos(LAT * DEG)) / DEG)
    elif place == "north_east":
        columns["north"], columns["east"] = (name("north"), "m", x), (name("east"), "m", y)
    else:
        a, b = (x, y) if place == "ned" else (y, x)
        columns["x"], columns["y"] = (name("x"), "m", a), (name("y"), "m", b)
    unit = pick("angle", "deg", "rad")
    factor = 1.0 if unit == "rad" else 1.0 / DEG
    if attitude == "heading":
        columns["psi"] = (name("heading"), "deg", np.mod(psi, 2 * np.pi) / DEG)
    else:
        yaw = psi if attitude == "yaw_ned" else np.pi / 2 - psi
        columns["psi"] = (name("yaw"), unit, (np.mod(yaw + np.pi, 2 * np.pi) - np.pi) * factor)
    shape.ambiguous = place in ("ned", "enu") and attitude != "heading"
    body = pick("body", "frd", "frd", "flu")
    sign = -1.0 if body == "flu" else 1.0
    speeds = pick("speeds", "uv", "uv", "kn", "earth", "none")
    if speeds in ("uv", "kn"):
        per = 1.0 if speeds == "uv" else 1.0 / 0.514444
        columns["u"] = (name("u"), "m/s" if speeds == "uv" else "kn", u * per)
        columns["v"] = (name("v"), "m/s" if speeds == "uv" else "kn", sign * v * per)
    elif speeds == "earth":
        columns["vn"] = (name("vn"), "m/s", u * np.cos(psi) - v * np.sin(psi))
        columns["ve"] = (name("ve"), "m/s", u * np.sin(psi) + v * np.cos(psi))
    if rng.random() < 0.8:
        rate = pick("rate", "deg/s", "rad/s")
        columns["r"] = (name("r"), rate, sign * r / (DEG if rate == "deg/s" else 1.0))
    side = pick("rudder", "port", "starboard")
    columns["rudder"] = (
        name("rudder"),
        unit,
        (1.0 if side == "port" else -1.0) * truth["delta_r_cmd"] * factor,
    )
    per_minute = pick("n", "rpm", "rpm", "rps")
    columns["n"] = (name("n"), per_minute, truth["n_cmd"] / (1.0 if per_minute == "rpm" else 60.0))
    shown = pick("units", "bracket", "bracket", "parenthesis", "suffix", "row", "none")
    split = pick("files", "one", "one", "three")
    clock = pick(
        "clock", *(("unix", "iso", "week") if split == "three" else ("relative", "ms", "unix", "iso", "week"))
    )
    if split == "three":
        groups = [
            ["lat", "lon", "north", "east", "x", "y", "vn", "ve"],
            ["psi", "r", "u", "v"],
            ["rudder", "n"],
        ]
    else:
        groups = [list(columns)]
    late = float(rng.choice([0.0, 0.0, 0.0, 18.0, rng.uniform(2.0, 30.0)])) if split == "three" else 0.0
    shape.late, off = late, int(rng.integers(3))
    taken: set[str] = set()
    for k, group in enumerate(groups):
        its = {key: columns[key] for key in group if key in columns}
        step = 1 if k == 1 or split == "one" else int(rng.choice([2, 5]))
        t = truth["t"][::step] + (late if k == off else 0.0)
        its = {key: (n, w, values[::step]) for key, (n, w, values) in its.items()}
        its["battery"] = (
            ["Battery", "V_batt", "volt", "U_bat"][style],
            "V",
            24.0 + 0.1 * rng.normal(size=t.size),
        )
        stem = "log" if split == "one" else ("nav", "imu", "act")[k]
        taken.add(stem)
        shape.files.append(_write(rng, folder, stem, t, its, shown, clock, name("time"), shape))
    return shape, truth


def _header(name: str, unit: str, shown: str) -> str:
    suffix = {"deg": "deg", "rad": "rad", "m": "m", "m/s": "mps", "kn": "kn", "deg/s": "deg_s",
        "rad/s": "rad_s",
              "rpm": "rpm", "rps": "rps", "V": "V", "s": "s", "ms": "ms"}  # fmt: skip
    if shown == "bracket":
        return f"{name} [{unit}]"
    if shown == "parenthesis":
        return f"{name} ({unit})"
    if shown == "suffix" and not name.lower().endswith(suffix[unit]):
        return f"{name}_{suffix[unit]}"
    return name


def _write(rng, folder, stem, t, its, shown, clock, time_name, shape) -> Path:  # type: ignore[no-untyped-def]
    kind = str(rng.choice(["csv", "csv", "semicolon", "tab", "parquet", "mat", "netcdf"]))
    shape.words[f"kind {stem}"] = kind
    if (clock == "week" and kind in ("netcdf", "mat")) or (clock == "iso" and kind in ("mat", "netcdf")):
        kind = "csv"
    if kind in ("parquet", "mat", "netcdf") and shown == "row":
        shown = "bracket" if kind == "parquet" else "none"
    if kind == "mat" and shown != "none":
        shown = "suffix"
    times: dict[str, tuple[str, np.ndarray]] = {}
    if clock == "relative":
        times[_header(time_name, "s", shown)] = ("s", t)
    elif clock == "ms":
        times[_header(time_name, "ms", shown)] = ("ms", np.round(t * 1000.0))
    elif clock == "unix":
        times[_header(time_name, "s", shown)] = ("s", EPOCH + t)
    elif clock == "iso":
        texts = [
            datetime.fromtimestamp(EPOCH + v, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z" for v in t
        ]
        times["UTC"] = ("", np.array(texts, dtype=object))
    else:
        total = EPOCH - 315964800.0 + 18.0 + t
        times["gps_week"] = ("", np.floor(total / 604800.0))
        times["tow"] = ("s", np.mod(total, 604800.0))
    table = {n: v for n, (_, v) in times.items()}
    table |= {_header(n, w, shown): v for n, w, v in its.values()}
    units = [w for w, _ in times.values()] + [w for _, w, _ in its.values()]
    if kind == "parquet":
        import pandas

        path = folder / f"{stem}.parquet"
        pandas.DataFrame(table).to_parquet(path)
    elif kind == "mat":
        from scipy.io import savemat

        path = folder / f"{stem}.mat"
        savemat(path, {k.replace(" ", "_"): v for k, v in table.items()})
    elif kind == "netcdf":
        import h5netcdf

        path = folder / f"{stem}.nc"
        with h5netcdf.File(path, "w") as file:
            file.dimensions = {"time": t.size}
            for (label, values), unit in zip(table.items(), units, strict=True):
                variable = file.create_variable(label.replace("/", " per "), ("time",), float)
                variable[:] = values
                variable.attrs["units"] = (
                    "seconds since 2024-05-01 10:00:00" if unit == "s" and clock == "unix" else unit
                )
                if unit == "s" and clock == "unix":
                    variable[:] = t
    else:
        mark = {"csv": ",", "semicolon": ";", "tab": "\t"}[kind]
        path = folder / f"{stem}.{'txt' if kind == 'tab' else 'csv'}"
        lines = [mark.join(table)]
        if shown == "row":
            lines.append(mark.join(units))
        for row in zip(*table.values(), strict=True):
            cells = [v if isinstance(v, str) else f"{v:.10g}" if abs(v) < 1e6 else f"{v:.3f}" for v in row]
            line = mark.join(cells)
            lines.append(line.replace(".", ",") if kind == "semicolon" and clock != "iso" else line)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8-sig" if kind == "semicolon" else "utf-8")
    return path
