"""How noisy is each channel, judged from the channel alone.

Takes a series and its times; a divided difference of order 4 or 6 removes a polynomial, noise is left.
Does not: see slow errors; filtered logs look less noisy than they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from bayesid.model.channels import channel
from bayesid.trials.trial import Floats, Run

_NORMAL = 0.6744897501960817  # median |z| of a unit normal


# Least noise of a sensor over the vehicle's size: 0.16 mm and 0.006 deg for an AUV of 1.6 m. Of 555 noise
# levels of logged and simulated trials the least is 5.9e-4. A reading without any noise makes the information
# of a run about 1e18 times the prior's, which no factorisation in double precision survives.
LEAST = 1e-4


def raised(noise: Mapping[str, float], length: float, speed: float) -> dict[str, float]:
    """Channels whose noise is below `LEAST` of the vehicle's size -> that least noise [SI].

    Parameters
    ----------
    noise : channel -> one sigma [SI]
    length, speed : of the vehicle [m, m/s]
    """
    size = {"m": length, "rad": 1.0, "m/s": speed, "rad/s": speed / length}
    least = {name: LEAST * size[channel(name).unit] for name in noise}
    return {name: value for name, value in least.items() if not noise[name] >= value}


def raised_words(least: Mapping[str, float]) -> str:
    """What was raised, for a reader."""
    values = ", ".join(f"{name} {value:.2g} {channel(name).unit}" for name, value in least.items())
    return (
        f"no noise to speak of in {', '.join(least)} (a simulated log?): taken as {LEAST:g} of the vehicle's "
        f"size ({values}); state what the sensors have under [noise], or simulate with --noise"
    )


def noise_of_readings(runs: Sequence[Run], names: Iterable[str]) -> dict[str, float]:
    """White noise per channel [SI], of third differences of its readings, which remove smooth motion.

    A channel slower than the rows has empty cells between its readings. One that no run reads more than a
    dozen times is left out; the median over the runs is taken."""
    out = {}
    for name in names:
        scatter = []
        for run in runs:
            if name in run.data:
                y = run.data[name][np.isfinite(run.data[name])]
                d = y[3:] - 3 * y[2:-1] + 3 * y[1:-2] - y[:-3]
                if d.size > 10:
                    scatter.append(1.4826 * np.median(np.abs(d)) / np.sqrt(20.0))
        if scatter:
            out[name] = float(np.median(scatter))
    return out


def not_stated_words(names: Iterable[str]) -> str:
    """Where the noise of these channels is from, for a reader."""
    return f"sensor noise of {', '.join(names)} is not stated; estimated from fast changes of the readings"


def rough_noise(t: Floats, values: Floats) -> float:
    """One sigma of white noise, robust against outliers; NaN with fewer than 12 usable stretches.

    Five (or seven) neighbouring samples give sum c_i x_i / |c| with c_i = 1 / prod(t_i - t_j): zero for any
    cubic (quintic), standard deviation one sigma for white noise, on any sampling. Motion faster than the
    sampling can follow makes it too large. For quantised data (steps larger than the noise) it is a bound."""
    good = np.isfinite(values)
    t, x = t[good], values[good]
    if x.size < 16:
        return float("nan")
    step = np.diff(t)
    short = step <= 3.0 * np.median(step)
    found = [difference_noise(t / np.median(step), x, short, order) for order in (4, 6)]
    return float(min(found))


def difference_noise(t: Floats, x: Floats, short: np.ndarray, order: int) -> float:
    size = x.size - order
    near = np.logical_and.reduce([short[k : short.size - order + 1 + k] for k in range(order)])
    if near.sum() < 12:
        return float("nan")
    knots = np.stack([t[k : size + k] for k in range(order + 1)])
    samples = np.stack([x[k : size + k] for k in range(order + 1)])
    weights = np.ones_like(knots)
    for i in range(order + 1):
        for j in range(order + 1):
            if i != j:
                weights[i] /= knots[i] - knots[j]
    resid = np.sum(weights * samples, axis=0) / np.sqrt(np.sum(weights**2, axis=0))
    return float(np.median(np.abs(resid[near]))) / _NORMAL


def spikes(t: Floats, values: Floats, sigma: float) -> np.ndarray:
    """Indices of lone samples off the curve through their neighbours.

    A sample counts if it lies more than 8 sigma off the cubic through two neighbours on either side, while
    those four agree with a quadratic three times better. Only where sampling is regular."""
    index = np.flatnonzero(np.isfinite(values))
    x = values[index]
    if x.size < 5 or not sigma >= 0.0:
        return np.zeros(0, dtype=int)
    step = np.diff(t[index])
    even = np.abs(step - np.median(step)) < 0.1 * np.median(step)
    away = np.abs(x[2:-2] - (4.0 * (x[1:-3] + x[3:-1]) - x[:-4] - x[4:]) / 6.0)
    apart = np.abs((x[4:] - x[:-4]) - 2.0 * (x[3:-1] - x[1:-3]))
    floor = max(8.0 * sigma, 1e-3 * float(np.percentile(x, 99) - np.percentile(x, 1)), 1e-12)
    # a kink (a yaw rate when the rudder is laid) continues the line on either side; a spike does neither
    left, right = np.abs(x[2:-2] - 2.0 * x[1:-3] + x[:-4]), np.abs(x[2:-2] - 2.0 * x[3:-1] + x[4:])
    far = (away > floor) & (away > 3.0 * apart) & (np.minimum(left, right) > 0.6 * away)
    return index[2:-2][far & even[:-3] & even[1:-2] & even[2:-1] & even[3:]]
