"""What a trial holds and whether its parts agree, as plain data for `bayesid trial check` and for reports.

Takes a `Trial`.
Does not: print, or read anything but the trial.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bayesid.model.channels import channel
from bayesid.model.vehicles.orders import gathered, has_rudder, rudders_together
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.trials.consistency import check_rudder, check_track, check_yaw
from bayesid.trials.gaps import gaps_of
from bayesid.trials.noise import rough_noise, spikes
from bayesid.trials.noise_stated import seen_noise, stated_wrongly
from bayesid.trials.trial import Floats, Run, Trial, channels_of
from bayesid.words import counted

_DEG = math.pi / 180.0
LEAST_PIECE, PIECES = 1.0, 50  # [s] and number of pieces, between which a track's speed is taken


def trial_summary(trial: Trial, vehicle: Vehicle | None = None) -> dict[str, Any]:
    """Plain data: numbers, texts, lists and dicts only (JSON-ready; angles in degrees where the key says so).

    Parameters
    ----------
    vehicle : whose named rudders or fins count as one, at their mean angle; None where it is not known

    Notes
    -----
    Keys: name, digest, vehicle, dof, runs (list), noise (per channel: stated, estimated, ratio), warnings.
    Per run: samples, duration, dt (median, least, greatest), gaps (of `channels`, of all where these are
    empty), missing (share per channel), spikes,
    ranges, rudder_of (inputs of which `rudder_deg` is the mean), checks (track, yaw, rudder). `noise` is the
    median over runs; estimated from the high-frequency rest, so a filtered log shows less and a fast vehicle
    sampled slowly shows more than its sensor noise."""
    runs, estimates = [], []
    for run in trial.runs:
        with np.errstate(all="ignore"):
            noise = {name: rough_noise(run.t, values) for name, values in run.data.items()}
            runs.append(_run(run, noise, vehicle))
        estimates.append(noise)
    warnings = list(trial.warnings)
    seen = seen_noise(trial.identify or trial.runs, trial.noise)
    if (wrong := stated_wrongly(seen)) is not None:
        warnings.append(wrong)
    told = {one.name for one in seen}
    noise_rows = {}
    for name in channels_of(trial.runs):
        found = [noise[name] for noise in estimates if math.isfinite(noise.get(name, math.nan))]
        estimated = float(np.median(found)) if found else None
        stated = trial.noise.get(name)
        ratio = estimated / stated if estimated is not None and stated else None
        noise_rows[name] = {
            "unit": channel(name).unit,
            "stated": stated,
            "estimated": estimated,
            "ratio": ratio,
        }
        if name not in told and ratio is not None and not 0.5 < ratio < 3.0:
            warnings.append(
                f"noise of {name}: {estimated:.3g} {channel(name).unit} seen against {stated:.3g} stated"
                + (
                    " (filtered log, or the statement is too large)"
                    if ratio < 1
                    else " (or motion faster than sampled)"
                )
            )
    for name in noise_rows:
        counts = {row["name"]: row["n_spikes"][name] for row in runs if row["n_spikes"].get(name)}
        if counts:
            worst = max(counts, key=lambda run: counts[run])
            first = next(row["spikes"][name][0] for row in runs if row["name"] == worst)
            warnings.append(
                f"{name}: {counted(sum(counts.values()), 'lone outlier')} in {len(counts)} of "
                f"{counted(len(runs), 'run')}, "
                f"most in {worst} ({counts[worst]}, the first at t = {first:.6g} s)"
            )
    return {
        "name": trial.name,
        "digest": trial.digest,
        "vehicle": trial.vehicle_ref,
        "dof": trial.dof,
        "identify": [run.name for run in trial.identify],
        "holdout": [run.name for run in trial.holdout],
        "rudder_positive_in_log": trial.rudder_positive,
        "measured_point": list(trial.measured_point),
        "environment": None if trial.environment is None else dataclasses.asdict(trial.environment),
        "attribution": trial.attribution,
        "noise": noise_rows,
        "runs": runs,
        "warnings": warnings,
    }


def _run(run: Run, noise: dict[str, float], vehicle: Vehicle | None) -> dict[str, Any]:
    step = np.diff(run.t)
    usual = float(np.median(step))
    gaps = gaps_of(run)
    found = {name: spikes(run.t, values, noise[name]) for name, values in run.data.items()}
    steered, rudder_of = _steered(run, vehicle)
    track, yaw, rudder = check_track(run), check_yaw(run), check_rudder(steered)
    return {
        "name": run.name,
        "manoeuvre": run.manoeuvre,
        "role": run.role,
        "digest": run.digest,
        "samples": run.n_samples,
        "duration": run.duration,
        "dt": {"median": usual, "least": float(step.min()), "greatest": float(step.max())},
        "gaps": [{"after": g.first, "length": g.length, "channels": list(g.channels)} for g in gaps[:20]],
        "n_gaps": len(gaps),
        "missing": {name: float(np.isnan(values).mean()) for name, values in run.data.items()},
        "spikes": {name: run.t[k[:20]].tolist() for name, k in found.items() if k.size},
        "n_spikes": {name: int(k.size) for name, k in found.items() if k.size},
        "speed": _range(_speed(run)),
        "heading_turned_deg": _range(run.data.get("psi"), _DEG),
        "yaw_rate_deg_s": _range(run.data.get("r"), _DEG),
        "rudder_deg": _range(None if not rudder_of else steered.input("delta_r"), _DEG),
        "rudder_of": rudder_of,
        "rpm": _range(steered.input(_widest(steered, "n", "n_"))),
        "wind_speed": _range(run.exogenous.get("wind_speed")),
        "channels": list(run.data),
        "inputs": [*run.commands, *run.measured_inputs],
        "extra": list(run.extra),
        "provenance": list(run.provenance),
        "checks": {
            "track": None if track is None else dataclasses.asdict(track),
            "yaw": None if yaw is None else dataclasses.asdict(yaw),
            "rudder": None if rudder is None else dataclasses.asdict(rudder),
        },
        "warnings": list(run.warnings),
    }


def _speed(run: Run) -> Floats | None:
    """Speed through the water where logged, else over ground, from the track where no velocity is [m/s]."""
    for names in (("u_water", "v_water"), ("u", "v")):
        if set(names) <= set(run.data):
            return np.hypot(run.data[names[0]], run.data[names[1]])
    for along in ("u_water", "u"):
        if along in run.data:
            return np.abs(run.data[along])
    return _speed_of_track(run)


def _speed_of_track(run: Run) -> Floats | None:
    """Distance over time between mean positions of `PIECES` pieces, at least a second long; None of few."""
    if not {"x", "y"} <= set(run.data):
        return None
    read = np.isfinite(run.data["x"]) & np.isfinite(run.data["y"])
    t, x, y = run.t[read], run.data["x"][read], run.data["y"][read]
    if t.size < 3:
        return None
    edges = np.arange(t[0], t[-1], max(LEAST_PIECE, (t[-1] - t[0]) / PIECES))
    piece = np.searchsorted(edges, t, side="right") - 1
    count = np.bincount(piece, minlength=edges.size)
    means = [np.bincount(piece, values, edges.size)[count > 0] / count[count > 0] for values in (t, x, y)]
    if means[0].size < 3:
        return None
    span, ahead, aside = (np.diff(m) for m in means)
    return np.hypot(ahead, aside) / span


def _steered(run: Run, vehicle: Vehicle | None) -> tuple[Run, list[str]]:
    """A run with `delta_r`, and the inputs this is of: itself, those that steer the vehicle together, or of
    named ones the one that moves most; none where nothing is logged that may be a rudder."""
    if vehicle is not None:
        run = dataclasses.replace(
            run,
            commands=gathered(vehicle, run.commands),
            measured_inputs=gathered(vehicle, run.measured_inputs, ""),
        )
        together = [name for name in rudders_together(vehicle) if run.input(name) is not None]
        if together and run.input("delta_r") is not None:
            return run, together
        if not has_rudder(vehicle):  # what dives, or one fin of an X, is no rudder
            return run, []
    one = _widest(run, "delta_r", "delta_", ("delta_s", "delta_b"))
    values = run.input(one)
    if values is None or one == "delta_r":
        return run, [] if values is None else [one]
    return dataclasses.replace(run, measured_inputs={**run.measured_inputs, "delta_r": values}), [one]


def _widest(run: Run, name: str, named: str, but: Sequence[str] = ()) -> str:
    """Input that is the rudder or shaft of a run; of those with names but `but`, the one that moves most."""
    inputs = {k.removesuffix("_cmd") for k in (*run.commands, *run.measured_inputs)}
    there = {
        k: x for k in sorted(inputs - set(but)) if k.startswith(named) and (x := run.input(k)) is not None
    }
    if name in inputs or not there:
        return name
    return max(there, key=lambda k: float(np.nanmax(there[k]) - np.nanmin(there[k])))


def _range(values: Floats | None, unit: float = 1.0) -> list[float] | None:
    if values is None or not np.isfinite(values).any():
        return None
    return [float(np.nanmin(values)) / unit, float(np.nanmax(values)) / unit]
