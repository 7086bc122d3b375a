"""What looks wrong in a run, one sentence each: gaps, holes, stuck or clipped sensors, odd units and signs.

Takes a `Run`, or all runs of a trial.
Does not: stop anything; these are warnings. What makes a log unusable is an error of the reader.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import numpy as np

from bayesid.model.channels import ACTUATORS, channel
from bayesid.trials.consistency import RudderCheck, check_rudder, check_track, check_yaw
from bayesid.trials.gaps import channel_gaps, gap_words, row_gaps
from bayesid.trials.kinematics.evidence import weigh
from bayesid.trials.kinematics.relations import relations
from bayesid.trials.rudder_sides import other_side
from bayesid.trials.trial import Floats, Run
from bayesid.words import and_list, counted

_DEG = math.pi / 180.0
JITTER = 0.5  # of the usual step, between the 15th and 85th per cent of steps
WHOLE, MOSTLY = 0.1, 0.9  # steps so near a multiple of the usual one are readings left out
# A turn with the rudder amidships: largest angle, fewest headings, least turn, sd of its rate
AMIDSHIPS, FEWEST_HEADINGS, LEAST_TURN, TURNS = 0.5 * _DEG, 10, 2.0 * _DEG, 5.0
# A heading that stands while the vehicle turns: equal readings, s; a receiver that drops out for 1.3 s, as
# that of the tanker in the pond does, leaves outliers
STALE, STALE_SECONDS = 8, 2.0
# A track follows what is labelled through the water: residual over size, sd of the current over speed
HOLDS, LEAST_CURRENT = 0.1, 0.03
_LIMITS = {"phi": 1.6, "theta": 1.6, "p": 6.0, "q": 3.0, "r": 3.0, "u": 30.0, "v": 15.0, "w": 15.0}
# track length over integrated velocity -> the mislabelling that gives it
_SCALES = {
    "speed in kn labelled m/s": 0.514444,
    "speed in m/s labelled kn": 1.943844,
    "speed in ft/s labelled m/s or position in m labelled ft": 0.3048,
    "position in ft labelled m": 3.28084,
    "time in ms labelled s": 1e-3,
    "time in minutes labelled s": 60.0,
}


def check_run(run: Run) -> list[str]:
    """Warnings about one run, most basic first."""
    notices = _sampling(run)
    holes = [(name, 100 * float(np.isnan(values).mean())) for name, values in run.data.items()]
    if any(share > 0.0 for _, share in holes):
        notices.append(
            "missing samples: " + ", ".join(f"{n} {share:.1f} %" for n, share in holes if share > 0.0)
        )
    notices += _missing(run)
    notices += _stuck(run)
    notices += _stale_heading(run)
    notices += _magnitudes(run)
    notices += _agreement(run)
    return notices


def check_runs(runs: Sequence[Run]) -> list[str]:
    """Warnings that need all runs: the sign of the rudder, a turn with the rudder amidships, a current that
    the track does not show."""
    found = [check for check in map(check_rudder, runs) if check is not None]
    return rudder_notice(found) + _other_side(runs) + _amidships(runs) + _ground_as_water(runs)


def _other_side(runs: Sequence[Run]) -> list[str]:
    """A warning if the rudder of some runs turns the vehicle to the other side than that of all others."""
    other = other_side(runs)
    if not other:
        return []
    named = {name for run in runs if run.name in other for name in (*run.commands, *run.measured_inputs)}
    scale = ", ".join(f"{name} = -1" for name in ("delta_r", "delta_r_cmd") if name in named)
    return [
        f"rudder sign: in {and_list(other)} positive rudder turns the vehicle to the other side than in all "
        "other runs that tell; if it was logged with the other sign there, scale = "
        f"{{ {scale} }} and runs = [{', '.join(json.dumps(name) for name in other)}] under [corrections] in "
        "trial.toml"
    ]


def _amidships(runs: Sequence[Run]) -> list[str]:
    """A warning if all runs turn to one side before their first order."""
    turning, asked = one_sided_turns(runs)
    if not turning:
        return []
    rate = float(np.median(turning))
    return [
        f"with the rudder amidships the vehicle turns to {'starboard' if rate > 0 else 'port'} by "
        f"{abs(rate) / _DEG:.2g} degrees a second in {len(turning)} of {asked} runs before the first "
        "order; no coefficient of a symmetric hull does that: look for an offset of the rudder, wind, a side "
        "force of the propeller; a current begins such a turn where a run begins, and only a vehicle that is "
        "unstable on course keeps it up"
    ]


def one_sided_turns(runs: Sequence[Run]) -> tuple[tuple[float, ...], int]:
    """Rates of the heading [rad/s] before the first orders, where two runs or more turn and all to one side,
    else nothing; and of how many runs this can be asked.
    """
    rates = [rate for rate in map(turn_before_order, runs) if rate is not None]
    turning = tuple(rate for rate, sd in rates if abs(rate) > TURNS * sd)
    one_side = len({rate > 0 for rate in turning}) == 1
    return turning if 1 < len(turning) == len(rates) and one_side else (), len(rates)


def _ground_as_water(runs: Sequence[Run]) -> list[str]:
    """A warning if the tracks follow the velocities labelled through the water with no current at all."""
    estimates, speeds = [], []
    for run in runs:
        if "u" in run.data or "u_water" not in run.data:
            continue
        track = relations(run, only=("track",)).get("track")
        if track is None or (held := weigh(track)).level > HOLDS:
            continue
        estimates.append([held.estimate[name] for name in ("drift_north", "drift_east")])
        speeds.append(float(np.nanmedian(np.abs(run.data["u_water"]))))
    if not estimates:
        return []
    value, sd = np.moveaxis(np.array(estimates), 2, 0)
    spread = 1.0 / np.sqrt(np.sum(sd**-2, axis=0))
    mean = np.sum(value / sd**2, axis=0) * spread**2
    if (spread > LEAST_CURRENT * np.median(speeds)).any() or (np.abs(mean) > 2.0 * spread).any():
        return []
    return [
        "u_water and v_water say speed through the water, but the track follows them with no current "
        f"(north {mean[0]:.2g} +- {spread[0]:.1g}, east {mean[1]:.2g} +- {spread[1]:.1g} m/s): in water that "
        'may move, make sure they are not over ground; if they are, rename = { u_water = "u", '
        'v_water = "v" } under [corrections] in trial.toml'
    ]


def turn_before_order(run: Run) -> tuple[float, float] | None:
    """Rate of the heading and its sd [rad/s] in the later half of the time before the rudder first moves.

    None where there is no such time, or too few headings to tell a rate; the sd is of a straight line, at
    least as large as a change of `LEAST_TURN` over that half needs."""
    rudder, psi = run.input("delta_r"), run.data.get("psi")
    if (
        rudder is None
        or psi is None
        or np.abs(rudder[0]) > AMIDSHIPS
        or not np.any(np.abs(rudder) > AMIDSHIPS)
    ):
        return None
    last = int(np.argmax(np.abs(rudder) > AMIDSHIPS))
    at = np.arange(last // 2, last)
    at = at[np.isfinite(psi[at])]
    if at.size < FEWEST_HEADINGS:
        return None
    t = run.t[at] - run.t[at].mean()
    rate = float(t @ psi[at] / (t @ t))
    left = psi[at] - psi[at].mean() - rate * t
    sd = math.sqrt(float(left @ left) / (at.size - 2) / float(t @ t))
    return rate, max(sd, LEAST_TURN / TURNS / float(np.ptp(t)))


def rudder_notice(found: Sequence[RudderCheck]) -> list[str]:
    """A warning if the runs taken together turn the wrong way, pooled over their t values."""
    if not found:
        return []
    pooled = sum(check.t_value for check in found) / math.sqrt(len(found))
    wrong = sum(check.slope > 0 for check in found)
    if pooled > 6.0 and wrong > 0.8 * len(found):
        return [
            f"rudder sign: in {wrong} of {len(found)} runs positive rudder turns the vehicle to starboard; "
            'if the log counts starboard rudder positive, say rudder_positive = "starboard" in trial.toml'
        ]
    return []


def uneven_steps(step: Floats) -> tuple[float, float] | None:
    """15th and 85th per cent of steps of time above zero where they jitter, s; None where they are even or
    multiples of the usual one."""
    if step.size <= 50:
        return None
    usual = float(np.median(step))
    low, high = (float(q) for q in np.percentile(step, (15, 85)))
    ratio = step / usual
    multiples = float(np.mean(np.abs(ratio - np.maximum(1.0, np.round(ratio))) < WHOLE)) > MOSTLY
    return (low, high) if high - low > JITTER * usual and not multiples else None


def _sampling(run: Run) -> list[str]:
    notices = []
    step = np.diff(run.t)
    usual = float(np.median(step))
    if gaps := row_gaps(run.t):
        worst = max(gaps, key=lambda gap: gap.length)
        word = "gap" if len(gaps) == 1 else "gaps, the longest"
        text = f"{len(gaps)} {word} of {worst.length:.3g} s after t = {worst.first:.6g} s"
        notices.append(f"{text} (usual step {usual:.3g} s)")
    notices += gap_words(channel_gaps(run))
    uneven = uneven_steps(step)
    joined = any(np.isnan(values).any() for values in run.data.values())  # channels of several rates
    if uneven is not None and not joined:
        low, high = uneven
        notices.append(
            f"the time between samples varies, 15 % below {low:.2g} s and 15 % above {high:.2g} s (usually "
            f"{usual:.2g} s); stamps of writing are late by as much"
        )
    if run.n_samples < 20:
        notices.append(f"only {run.n_samples} samples")
    psi = run.data.get("psi")
    if psi is not None:
        turn = np.abs(np.diff(psi[np.isfinite(psi)]))
        if turn.size and float(np.percentile(turn, 98)) > 0.5:
            worst_turn = float(np.percentile(turn, 98)) / _DEG
            notices.append(
                f"psi changes by {worst_turn:.0f} deg from sample to sample: sampled too coarsely "
                f"(every {usual:.3g} s) to follow the vehicle, or psi has another unit"
            )
    return notices


def _missing(run: Run) -> list[str]:
    notices = []
    absent = [name for name in ("x", "y", "psi") if name not in run.data]
    if absent:
        notices.append(f"{', '.join(absent)} not logged; only the other channels can be compared")
    if all(run.input(name) is None for name in ACTUATORS if name == "n" or name.startswith("n_")):
        notices.append("neither n_cmd nor n is logged; the propeller speed is unknown")
    return notices


def _longest_flat(values: Floats) -> tuple[int, int]:
    """First and last index of the longest stretch of equal values."""
    change = np.flatnonzero(np.concatenate(([True], np.diff(values) != 0.0, [True])))
    k = int(np.argmax(np.diff(change)))
    return int(change[k]), int(change[k + 1] - 1)


def _clipped(x: Floats) -> str:
    """Words if many neighbouring samples sit at an extreme exactly while the others do not repeat."""
    for edge, word in ((float(x.max()), "maximum"), (float(x.min()), "minimum")):
        at_edge = x == edge
        count = int(at_edge.sum())
        if count < max(6, 0.01 * x.size) or int((at_edge[1:] & at_edge[:-1]).sum()) < 0.6 * count:
            continue
        low, high = float(x.min()), float(x.max())
        free = (x > low) & (x < high)
        pairs = free[1:] & free[:-1]
        if pairs.sum() >= 10 and float((np.diff(x)[pairs] != 0.0).mean()) > 0.9:
            return f"{count} samples at its {word} exactly"
    return ""


def _stuck(run: Run) -> list[str]:
    notices = []
    inputs = [values for name in ACTUATORS if (values := run.input(name)) is not None]
    moving = sum((np.diff(values) != 0.0).astype(int) for values in run.data.values())
    for name, values in run.data.items():
        good = np.flatnonzero(np.isfinite(values))
        if good.size < 10:
            continue
        x = values[good]
        row = channel(name)
        first, last = _longest_flat(x)
        k0, k1 = int(good[first]), int(good[last])
        shown = (
            f"{x[first] / (_DEG if row.unit.startswith('rad') else 1.0):.6g} {row.unit.replace('rad', 'deg')}"
        )
        if first == 0 and last == x.size - 1:
            if row.vertical:
                notices.append(f"{name} never changes ({shown}); if the vehicle is kept level, say dof = 3")
            elif any(np.ptp(values) > 0.0 for values in inputs):
                notices.append(f"{name} never changes ({shown}); is the sensor stuck?")
            continue
        clipped = _clipped(x) if row.unit != "m" and not row.circular else ""  # a track or a heading crests
        if clipped:
            notices.append(f"{name} seems clipped: {clipped}")
            continue
        length = last - first + 1
        stirred = any(np.ptp(values[k0 : k1 + 1]) > 0.0 for values in inputs)
        others = int((moving[k0:k1] > 0).sum())
        usual = x.size / max(1, int((np.diff(x) != 0.0).sum()))
        if length >= max(20, 0.03 * x.size, 20 * usual) and stirred and others > 0.5 * (k1 - k0):
            notices.append(
                f"{name} is stuck at {shown} from t = {run.t[k0]:.6g} to {run.t[k1]:.6g} s while others move"
            )
    for name in ACTUATORS:
        ordered, done = run.commands.get(f"{name}_cmd"), run.measured_inputs.get(name)
        if ordered is not None and done is not None and np.ptp(ordered) > 0.0 and np.ptp(done) == 0.0:
            notices.append(f"{name} (measured) never changes although {name}_cmd does; is it stuck?")
    return notices


def _stale_heading(run: Run) -> list[str]:
    """A warning where the heading repeats one reading to the last bit while the yaw rate turns the vehicle.

    Without readings of the yaw rate the step out of the stretch says what it turned meanwhile. Other columns
    may stand too: rows that are written again while the receiver is silent.
    """
    psi, rate = run.data.get("psi"), run.data.get("r")
    if psi is None:
        return []
    good = np.flatnonzero(np.isfinite(psi))
    if good.size < 4 * STALE:
        return []
    x = psi[good]
    change = np.flatnonzero(np.concatenate(([True], np.diff(x) != 0.0, [True])))
    usual = float(np.median(np.abs(np.diff(np.unwrap(x)))))
    if not usual > 0.0:
        return []  # a coarse compass repeats itself
    found = []
    for a, b in zip(change[:-1], change[1:] - 1, strict=True):
        first, last = int(good[a]), int(good[b])
        if b - a + 1 < STALE or run.t[last] - run.t[first] < STALE_SECONDS:
            continue
        turned = abs(math.remainder(float(x[b + 1] - x[b]), math.tau)) if b + 1 < x.size else 0.0
        if rate is not None:
            known = np.flatnonzero(np.isfinite(rate[first : last + 1])) + first
            if known.size > 1:
                turned = abs(float(np.trapezoid(rate[known], run.t[known])))
        if turned > max(LEAST_TURN, TURNS * usual):
            found.append((run.t[first], run.t[last], turned / _DEG))
    if not found:
        return []
    start, end, turned = max(found, key=lambda f: f[2])
    more = f", and in {counted(len(found) - 1, 'other stretch', 'other stretches')}" if len(found) > 1 else ""
    return [
        f"psi repeats one reading from t = {start:.6g} to {end:.6g} s while the vehicle turns by "
        f"{turned:.2g} degrees{more}: old readings written again; leave them out by "
        'skip_repeats = ["psi"] under [corrections] in trial.toml'
    ]


def _magnitudes(run: Run) -> list[str]:
    notices = []
    for name, limit in _LIMITS.items():
        values = run.data.get(name)
        if values is None or not np.isfinite(values).any():
            continue
        size = float(np.nanmax(np.abs(values)))
        if size > limit:  # a handful of outliers is another matter
            size = float(np.nanpercentile(np.abs(values), 95))
        if size > limit:
            angle = channel(name).unit.startswith("rad")
            shown = f"{size / _DEG:.4g} deg" + ("/s" if name in "pqr" else "") if angle else f"{size:.4g} m/s"
            hint = "; degrees labelled as radians?" if angle else ""
            notices.append(f"{name} reaches {shown}, which no vehicle of this kind does{hint}")
    for group in (run.commands, run.measured_inputs):
        for name, values in group.items():
            if channel(name).unit != "rad" or channel(name).circular:
                continue
            size = float(np.abs(values).max())
            if size > 1.6:
                notices.append(f"{name} reaches {size / _DEG:.4g} deg; degrees labelled as radians?")
            elif 0.0 < size <= 0.7 * _DEG and channel(name).rudder and _weaves(run, values):
                notices.append(f"{name} stays within {size / _DEG:.2g} deg; radians labelled as degrees?")
    return notices


def _weaves(run: Run, rudder: Floats) -> bool:
    """True if the heading swings by more than 60 degrees while the rudder moves: not a straight run."""
    psi = run.data.get("psi")
    return (
        psi is not None and float(np.ptp(rudder)) > 0.0 and float(np.nanmax(psi) - np.nanmin(psi)) > 60 * _DEG
    )


def _agreement(run: Run) -> list[str]:
    notices = []
    track = check_track(run)
    if track is not None:
        if track.better:
            notices.append(
                f"the track fits the logged motion far better with {track.better} "
                f"(unexplained share {track.misfit:.2g} as labelled)"
            )
        elif track.from_velocity and track.misfit < 0.2:
            off = abs(track.scale - 1.0)
            if off > 0.05 + 4 * track.scale_sd:
                near = min(_SCALES, key=lambda key: abs(track.scale / _SCALES[key] - 1.0))
                hint = f"; {near}?" if abs(track.scale / _SCALES[near] - 1.0) < 0.06 else ""
                notices.append(f"the track is {track.scale:.3f} times as long as u, v say{hint}")
            if abs(track.rotation) > 5 * _DEG + 4 * track.scale_sd:
                notices.append(
                    f"the track runs {track.rotation / _DEG:+.1f} deg (clockwise) off heading and velocity: "
                    "position and heading use different norths, or psi, u or v is biased"
                )
    yaw = check_yaw(run)
    if yaw is not None and yaw.explained > 0.8:
        if abs(yaw.scale + 1.0) < 0.3:
            notices.append("psi turns against r: one of them has the opposite sign")
        elif abs(math.log(abs(yaw.scale) * _DEG)) < 0.2:
            notices.append(
                "psi changes 57 times as much as r says: r in radians labelled deg, or psi in degrees"
            )
        elif abs(math.log(abs(yaw.scale) / _DEG)) < 0.2:
            notices.append("psi changes 1/57 as much as r says: r in degrees labelled rad, or psi in radians")
        elif abs(yaw.scale - 1.0) > 0.1 + 4 * yaw.scale_sd:
            notices.append(f"psi changes {yaw.scale:.3f} times as much as the integral of r")
    return notices
