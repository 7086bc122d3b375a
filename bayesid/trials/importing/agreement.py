"""Does a map make the series of a log agree: track with heading and speed, heading with yaw rate, turn with
rudder?

Takes a map and a recording; every hypothesis about units, signs and axes is a map of its own.
Does not: choose; that is `deciding`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.errors import BayesidError
from bayesid.model.channels import channel, is_channel
from bayesid.trials.assemble import unwrap
from bayesid.trials.consistency import check_rudder, check_track, check_yaw
from bayesid.trials.importing.converting import Recording, at_times, convert
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.trial import Floats, Run

GAP = 5.0  # usual steps of a series, from which nothing is known between two readings
MOST = 20_000  # samples of the common time base
_ANGLES = ("psi", "phi", "theta")


def common_run(
    found: LogMap, recording: Recording, without: tuple[str, ...] = (), bridged: bool = True
) -> Run | None:
    """All series of a recording on one time base, or None where they do not overlap.

    Parameters
    ----------
    bridged : whether a series goes on straight through a gap of its readings; else it holds nothing there
    """
    try:
        series, _, _ = convert(found, recording)
    except BayesidError:
        return None
    series = {k: s for k, s in series.items() if k not in without and np.isfinite(s[1]).sum() > 3}
    moving = {k: s for k, s in series.items() if k in ("x", "y", "psi", "u", "v", "r")}
    if not moving:
        return None
    low = max(float(np.min(s[0])) for s in moving.values())
    high = min(float(np.max(s[0])) for s in moving.values())
    if not high > low:
        return None
    dense = max(moving.values(), key=lambda s: s[0].size)[0]
    t = np.unique(dense[(dense >= low) & (dense <= high)])
    t = t[:: max(1, t.size // MOST)]
    if t.size < 20:
        return None
    data: dict[str, Floats] = {}
    inputs: dict[str, Floats] = {}
    for name, one in series.items():
        if name.endswith("_cmd"):
            inputs[name] = held(one, t)
        elif is_channel(name) and channel(name).kind == "actuator":
            inputs[name] = _filled(at_times(one, t))
        else:
            data[name] = at_times(one, t, name in _ANGLES)
            if not bridged:
                data[name] = np.where(in_gaps(one, t), np.nan, data[name])
    data = {
        k: unwrap(v) if k in _ANGLES else v
        for k, v in data.items()
        if k not in ("thrust", "torque", "wind_speed", "wind_from")
    }
    return Run(
        "look", "", "identify", t, data,
        commands={k: v for k, v in inputs.items() if k.endswith("_cmd")},
        measured_inputs={k: v for k, v in inputs.items() if not k.endswith("_cmd")},
    )  # fmt: skip


def in_gaps(series: tuple[Floats, Floats], t: Floats) -> np.ndarray:
    """Times between two readings much farther apart than most of the series are."""
    own = np.sort(series[0][np.isfinite(series[1])])
    if own.size < 3:
        return np.zeros(t.shape, dtype=bool)
    step = np.diff(own)
    usual = max(float(np.median(step)), float(np.quantile(step, 0.9)))  # readings may come in bursts
    at = np.clip(np.searchsorted(own, t, side="right") - 1, 0, own.size - 2)
    return (step[at] > GAP * usual) & (t > own[at]) & (t < own[at + 1])


def held(series: tuple[Floats, Floats], t: Floats) -> Floats:
    """A command at other times: the last one given, the first before it."""
    good = np.isfinite(series[1])
    own, values = series[0][good], series[1][good]
    return values[np.clip(np.searchsorted(own, t + 1e-9, side="right") - 1, 0, own.size - 1)]


def _filled(values: Floats) -> Floats:
    good = np.flatnonzero(np.isfinite(values))
    return values if good.size in (0, values.size) else np.interp(np.arange(values.size), good, values[good])


def track_misfit(found: LogMap, recording: Recording) -> tuple[float, float]:
    """(share of the track that the direction of the heading leaves unexplained, its rotation [rad])."""
    run = common_run(found, recording, ("u", "v", "w", "u_water", "v_water"), bridged=False)
    check = None if run is None else check_track(run)
    return (1.0, 0.0) if check is None else (check.misfit, check.rotation)


def speed_fit(found: LogMap, recording: Recording) -> tuple[float, float, float] | None:
    """(track length over integrated velocity, misfit, rotation [rad]); v is taken as zero where it is
    missing."""
    run = common_run(found, recording, bridged=False)
    if run is None or "u" not in run.data:
        return None
    if "v" not in run.data:
        data = {**run.data, "v": np.zeros(run.t.shape)}
        run = Run("look", "", "identify", run.t, data)
    check = check_track(run)
    return None if check is None else (check.scale, check.misfit, check.rotation)


def speed_fit_of_all(found: LogMap, recordings: Sequence[Recording]) -> tuple[float, float, float] | None:
    """`speed_fit` of several recordings, each with the weight of the square of its extent: one that turns on
    the spot tells more of the noise of its position than of the speeds. The misfit holds the rotation too."""
    found_of_each = []
    for recording in recordings:
        fit, run = speed_fit(found, recording), common_run(found, recording, bridged=False)
        if fit is not None and run is not None and fit[0] > 0.0:
            extent = sum(float(np.nanmax(run.data[k]) - np.nanmin(run.data[k])) ** 2 for k in ("x", "y"))
            found_of_each.append((extent, *fit))
    if not found_of_each:
        return None
    weight, size, misfit, turn = np.array(found_of_each).T
    if not weight.sum() > 0.0:
        return None
    weight = weight / weight.sum()
    share = float(weight @ np.minimum(misfit + 2.0 * (1.0 - np.cos(turn)), 1.0))
    rotation = float(np.angle(weight @ np.exp(1j * turn)))
    return float(np.exp(weight @ np.log(size))), share, rotation


def drift(found: LogMap, recording: Recording) -> tuple[float, float, float] | None:
    """(steady drift of the track off what u and v say, its sd, mean speed), m/s; None without u, v.

    A current moves the track but not a speed through the water; over ground there is no such drift.
    """
    run = common_run(found, recording, bridged=False)
    if run is None or not {"x", "y", "psi", "u", "v"} <= set(run.data):
        return None
    t, data = run.t, run.data
    good = np.all([np.isfinite(data[k]) for k in ("x", "y", "psi", "u", "v")], axis=0)
    if good.sum() < 80:
        return None
    t, (x, y, psi, u, v) = t[good], (data[k][good] for k in ("x", "y", "psi", "u", "v"))
    velocity = (u + 1j * v) * np.exp(1j * psi)
    whole = np.diff(t) <= GAP * np.median(np.diff(t))
    way = np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t))))
    knots = np.unique(np.linspace(0, t.size - 1, 41).astype(int))
    told = np.diff(np.concatenate(([0], np.cumsum(~whole)))[knots]) == 0
    moved, reckoned, span = (np.diff(a[knots])[told] for a in (x + 1j * y, way, t))
    design = np.column_stack((reckoned, span))
    weights, _, rank, _ = np.linalg.lstsq(design, moved, rcond=None)
    if rank < 2:
        return None
    left = moved - design @ weights
    freedom = max(1, moved.size - 2)
    spread = float(np.linalg.inv(np.conj(design).T @ design)[1, 1].real)
    sd = float(np.sqrt(np.sum(np.abs(left) ** 2) / freedom * abs(spread)))
    return float(abs(weights[1])), sd, float(np.mean(np.abs(velocity)))


def yaw_fit(found: LogMap, recording: Recording) -> tuple[float, float] | None:
    """(heading change over the integral of r, share explained)."""
    run = common_run(found, recording, bridged=False)
    check = None if run is None else check_yaw(run)
    return None if check is None else (check.scale, check.explained)


def rudder_t(found: LogMap, recording: Recording) -> float | None:
    """t value of the turn that follows the rudder; negative if positive rudder turns to port."""
    run = common_run(found, recording, bridged=False)
    check = None if run is None else check_rudder(run)
    return None if check is None else check.t_value


def lag_of(
    first: tuple[Floats, Floats], second: tuple[Floats, Floats], longest: float = 60.0
) -> tuple[float, float] | None:
    """(seconds by which the second series is late, correlation there minus that at zero) of two yaw rates."""
    low, high = max(first[0][0], second[0][0]), min(first[0][-1], second[0][-1])
    step = max(0.02, float(np.median(np.diff(first[0]))), float(np.median(np.diff(second[0]))))
    if high - low < 4 * step or (high - low) / step > 500_000:
        step = max(step, (high - low) / 500_000)
    n = int((high - low) / step)
    if n < 50:
        return None
    grid = low + step * np.arange(n)
    a, b = (np.where(in_gaps(s, grid), np.nan, at_times(s, grid)) for s in (first, second))
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < 50:
        return None
    a, b = (np.where(np.isfinite(x), x - x[known].mean(), 0.0) for x in (a, b))
    if a.std() == 0 or b.std() == 0:
        return None
    size = 1 << (2 * n - 1).bit_length()
    full = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    most = min(int(longest / step), n // 3)
    shifts = np.concatenate([np.arange(0, most + 1), np.arange(-most, 0)])
    values = np.concatenate([full[: most + 1], full[-most:]]) if most else full[:1]
    best = int(np.argmax(np.abs(values)))
    norm = float(np.sqrt(a @ a) * np.sqrt(b @ b))
    return float(shifts[best] * step), float((abs(values[best]) - abs(full[0])) / norm)
