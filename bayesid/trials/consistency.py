"""Do the channels of a run agree with one another: track with velocity and heading, heading with yaw rate,
turn with rudder?

Takes a `Run` (vehicle unknown); everything is compared over blocks of time, so noise and irregular sampling
average out. Does not: change the data; a wrong sign or unit is reported with the reading that would fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bayesid.trials.trial import Floats, Run

BLOCKS = 40  # blocks a run is cut into: long enough to beat position noise, short enough to see turns
_DEG = math.pi / 180.0


@dataclass(frozen=True)
class TrackCheck:
    """Track against the integral of body velocity turned by heading.

    scale, rotation : best fit of track = scale * exp(i rotation) * dead reckoning; (-, rad clockwise)
    scale_sd : one sigma of scale; also of rotation in rad
    misfit : share of the squared displacement left unexplained, 0 to 1
    better : reading of the columns that explains far more, or ""
    from_velocity : False if u, v are not logged and only the direction could be compared
    """

    scale: float
    rotation: float
    scale_sd: float
    misfit: float
    better: str
    from_velocity: bool


@dataclass(frozen=True)
class YawCheck:
    """Heading change against the integral of r: heading change = scale * integral + bias * time."""

    scale: float
    scale_sd: float
    bias: float
    explained: float


@dataclass(frozen=True)
class RudderCheck:
    """Sign of the response of yaw rate to rudder: slope / its standard error (negative = port-positive)."""

    slope: float
    t_value: float


class _Blocks:
    """Consecutive blocks of equal duration in which the wanted series are finite and no time is missing."""

    def __init__(self, t: Floats, series: list[Floats], count: int, at_least: int = 5) -> None:
        count = max(2, min(count, (t.size - 1) // at_least))
        edge = np.searchsorted(t, np.linspace(t[0], t[-1], count + 1))
        edge = np.unique(np.minimum(edge, t.size - 1))
        step = np.diff(t)
        finite = np.isfinite(series[0])
        for values in series[1:]:
            finite = finite & np.isfinite(values)
        lost = np.concatenate(([0], np.cumsum(step > 5.0 * np.median(step))))
        holes = np.concatenate(([0], np.cumsum(~finite)))
        first, last = edge[:-1], edge[1:]
        good = (holes[last + 1] == holes[first]) & (lost[last] == lost[first])
        self.first, self.last = first[good], last[good]
        self.t, self.step, self.finite = t, step, finite
        self.span = t[self.last] - t[self.first]

    def integral(self, values: Floats) -> Floats:
        filled = np.where(self.finite, values, 0.0)
        running = np.concatenate(([0.0], np.cumsum(0.5 * (filled[1:] + filled[:-1]) * self.step)))
        return running[self.last] - running[self.first]

    def change(self, values: Floats) -> Floats:
        return values[self.last] - values[self.first]


def check_track(run: Run) -> TrackCheck | None:
    """None if the run has no position and heading, hardly moves, or has too few blocks."""
    data = run.data
    if not {"x", "y", "psi"} <= set(data):
        return None
    with_speed = {"u", "v"} <= set(data)
    series = [data["x"], data["y"], data["psi"]] + ([data["u"], data["v"]] if with_speed else [])
    blocks = _Blocks(run.t, series, BLOCKS)
    if blocks.span.size < 4:
        return None
    moved = blocks.change(data["x"]) + 1j * blocks.change(data["y"])
    psi = data["psi"]
    level = _level_velocity(run) if with_speed else np.ones(run.n_samples, dtype=complex)

    def fit(heading: Floats, velocity: np.ndarray) -> tuple[complex, float, float]:
        turned = velocity * np.exp(1j * heading)
        reckoned = blocks.integral(turned.real) + 1j * blocks.integral(turned.imag)
        if not with_speed:
            reckoned = reckoned * (np.abs(moved) / np.maximum(blocks.span, 1e-300))
        power = float(np.sum(np.abs(reckoned) ** 2))
        total = float(np.sum(np.abs(moved) ** 2))
        if not (power > 0.0 and total > 0.0):
            return 0j, 1.0, math.inf
        gain = complex(np.sum(np.conj(reckoned) * moved)) / power
        left = float(np.sum(np.abs(moved - gain * reckoned) ** 2))
        return gain, left / total, math.sqrt(left / max(1, moved.size - 1) / power)

    gain, misfit, sd = fit(psi, level)
    if not math.isfinite(sd):
        return None
    better = ""
    if misfit > 0.05:
        flipped, mirrored, _ = fit(-psi, np.conj(level))
        swapped = abs(abs(np.angle(flipped)) - math.pi / 2) < math.pi / 4
        readings = {
            "heading in degrees labelled rad": fit(psi * _DEG, level)[1],
            "heading in radians labelled deg": fit(psi / _DEG, level)[1],
            "x and y swapped" if swapped else "heading (or y) with the opposite sign": mirrored,
        }
        name = min(readings, key=lambda key: readings[key])
        if readings[name] < 0.25 * misfit:
            better = name
    return TrackCheck(abs(gain), float(np.angle(gain)), sd, misfit, better, with_speed)


def _level_velocity(run: Run) -> np.ndarray:
    """Velocity in level axes turned by heading only, as u + i v; pitch and roll taken out where logged."""
    u, v = run.data["u"], run.data["v"]
    if not {"phi", "theta", "w"} <= set(run.data):
        return u + 1j * v
    phi, theta, w = (np.nan_to_num(run.data[name]) for name in ("phi", "theta", "w"))
    ahead = u * np.cos(theta) + np.sin(theta) * (v * np.sin(phi) + w * np.cos(phi))
    return ahead + 1j * (v * np.cos(phi) - w * np.sin(phi))


def check_yaw(run: Run) -> YawCheck | None:
    """None if heading or yaw rate is missing, or the vehicle hardly turns."""
    if not {"psi", "r"} <= set(run.data):
        return None
    psi, rate = run.data["psi"], run.data["r"]
    if {"phi", "theta", "q"} <= set(run.data):
        phi, theta, q = (np.nan_to_num(run.data[name]) for name in ("phi", "theta", "q"))
        rate = (q * np.sin(phi) + rate * np.cos(phi)) / np.maximum(np.cos(theta), 0.05)
    blocks = _Blocks(run.t, [psi, rate], BLOCKS)
    if blocks.span.size < 5:
        return None
    turned, reckoned = blocks.change(psi), blocks.integral(rate)
    if np.std(turned) == 0.0 or np.std(reckoned) == 0.0:
        return None
    design = np.column_stack((reckoned, blocks.span))
    (scale, bias), _, rank, _ = np.linalg.lstsq(design, turned, rcond=None)
    left = turned - design @ (scale, bias)
    explained = 1.0 - float(left @ left) / float(np.sum((turned - turned.mean()) ** 2))
    freedom = reckoned - blocks.span * (reckoned @ blocks.span) / (blocks.span @ blocks.span)
    sd = math.sqrt(float(left @ left) / max(1, turned.size - 2) / max(float(freedom @ freedom), 1e-300))
    return None if rank < 2 else YawCheck(float(scale), sd, float(bias), explained)


def check_rudder(run: Run, restored: bool = False) -> RudderCheck | None:
    """Fit r[k+1] = a r[k] + b delta + c over short blocks (a first-order turn) and return b and its t value.

    Parameters
    ----------
    restored : with a moment against the angle itself, as the weight has against pitch: it follows slow planes
        so closely that its rate alone would tell their sign the wrong way round

    None if rudder or heading is missing, the rudder hardly moves or the vehicle mostly goes astern."""
    rudder = run.input("delta_r")
    series = run.data.get("psi", run.data.get("r"))
    if rudder is None or series is None or np.ptp(rudder) < 2 * _DEG:
        return None
    ahead = run.data.get("u", np.ones(0))
    ahead = ahead[np.isfinite(ahead)]
    if ahead.size and np.median(ahead) <= 0.0:
        return None
    read = np.isfinite(series)  # beside faster channels every other heading may be empty
    if read.sum() < 2:
        return None
    series, rudder = series[read], rudder[read]
    blocks = _Blocks(run.t[read], [series], 150, at_least=3)
    if blocks.span.size < 12:
        return None
    rate = (blocks.change(series) if "psi" in run.data else blocks.integral(series)) / blocks.span
    held = blocks.integral(rudder) / blocks.span
    pairs = blocks.last[:-1] == blocks.first[1:]
    if pairs.sum() < 10:
        return None
    now, after = rate[:-1][pairs], rate[1:][pairs]
    deflection = 0.5 * (held[:-1] + held[1:])[pairs]
    design = np.column_stack((now, deflection, np.ones_like(now)))
    if restored:
        mean = blocks.integral(series) / blocks.span
        design = np.column_stack((design, 0.5 * (mean[:-1] + mean[1:])[pairs]))
    weights, _, rank, _ = np.linalg.lstsq(design, after, rcond=None)
    if rank < design.shape[1]:
        return None
    left = after - design @ weights
    variance = float(left @ left) / max(1, after.size - rank) * float(np.linalg.inv(design.T @ design)[1, 1])
    if not variance > 0.0:
        return None
    return RudderCheck(float(weights[1]), float(weights[1]) / math.sqrt(variance))
