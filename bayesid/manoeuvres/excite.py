"""Rich inputs for identification: PRBS, chirp, multisine, random rudder, rudder and planes together.

Takes: amplitudes [rad] (port-positive), band [Hz] or clock [s], rpm, explicit seeds.
Does not: judge the excitation; that needs the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres import signals
from bayesid.manoeuvres.core import ClosedLoop, OpenLoop, grid
from bayesid.manoeuvres.laws import DepthLaw


def _rpm_history(t: np.ndarray, rpm: float, factors: Sequence[float]) -> np.ndarray:
    """Rpm times each factor in turn, in equal shares of the run."""
    slot = np.floor((t - t[0]) / (t[-1] - t[0]) * len(factors) + 1e-9).astype(int)
    return rpm * np.asarray(factors, float)[np.clip(slot, 0, len(factors) - 1)]


def prbs(
    amplitude: float,
    clock: float,
    rpm: float,
    duration: float,
    dt: float,
    seed: int,
    rpm_factors: Sequence[float] = (1.0,),
) -> OpenLoop:
    """Pseudo-random binary rudder: a maximum-length sequence of +-amplitude [rad], each bit `clock` [s] long.

    The sequence is the shortest that does not repeat within the run; its band ends near 0.44/clock [Hz].
    """
    if not (clock >= dt > 0):
        raise ManoeuvreError(f"PRBS: clock of {clock:g} s must be at least the step of {dt:g} s")
    t = grid(duration, dt)
    order = max(2, min(int(np.ceil(np.log2(duration / clock + 1))), max(signals.TAPS)))
    bits = signals.maximum_length_sequence(order, seed)
    return OpenLoop(
        "PRBS",
        t,
        {
            "delta_r_cmd": amplitude * signals.held_levels(t, bits, clock),
            "n_cmd": _rpm_history(t, rpm, rpm_factors),
        },
        {
            "amplitude": amplitude,
            "clock": clock,
            "order": order,
            "rpm": rpm,
            "seed": seed,
            "rpm_factors": tuple(rpm_factors),
        },
    )


def chirp(
    amplitude: float,
    f0: float,
    f1: float,
    rpm: float,
    duration: float,
    dt: float,
    rpm_factors: Sequence[float] = (1.0,),
) -> OpenLoop:
    """Rudder sine swept logarithmically from f0 to f1 [Hz]; rpm in steps of `rpm_factors` times rpm."""
    t = grid(duration, dt)
    return OpenLoop(
        "chirp",
        t,
        {"delta_r_cmd": amplitude * signals.chirp(t, f0, f1), "n_cmd": _rpm_history(t, rpm, rpm_factors)},
        {"amplitude": amplitude, "f0": f0, "f1": f1, "rpm": rpm, "rpm_factors": tuple(rpm_factors)},
    )


def _band(
    f0: float, f1: float, duration: float, dt: float, count: int, offset: int = 0, stride: int = 1
) -> np.ndarray:
    """At most `count` harmonics of 1/duration, spread evenly over the logarithm of the band f0..f1 [Hz]."""
    if not 0 < f0 < f1 <= 0.5 / dt:
        raise ManoeuvreError(
            f"band {f0:g} to {f1:g} Hz: need 0 < f0 < f1 <= {0.5 / dt:g} Hz, half the sampling rate"
        )
    low, high = max(1, round(f0 * duration)), max(1, round(f1 * duration))
    every = np.arange(low, high + 1)
    every = every[(every - low) % stride == offset]
    if every.size == 0:
        raise ManoeuvreError(
            f"band {f0:g} to {f1:g} Hz holds no harmonic of {1 / duration:g} Hz; lengthen the run"
        )
    target = np.geomspace(every[0], every[-1], count)
    return np.unique(every[np.abs(every[None, :] - target[:, None]).argmin(axis=1)])


def multisine(
    amplitude: float,
    f0: float,
    f1: float,
    rpm: float,
    duration: float,
    dt: float,
    seed: int,
    count: int = 16,
    rpm_factors: Sequence[float] = (1.0,),
) -> OpenLoop:
    """Rudder as a low-crest sum of at most `count` sines between f0 and f1 [Hz], peak `amplitude` [rad]."""
    t = grid(duration, dt)
    k = _band(f0, f1, duration, dt, count)
    wave = signals.multisine(t, k, duration, seed)
    return OpenLoop(
        "multisine",
        t,
        {"delta_r_cmd": amplitude * wave, "n_cmd": _rpm_history(t, rpm, rpm_factors)},
        {
            "amplitude": amplitude,
            "f0": f0,
            "f1": f1,
            "harmonics": tuple(int(i) for i in k),
            "rpm": rpm,
            "seed": seed,
            "crest": signals.crest_factor(wave),
            "rpm_factors": tuple(rpm_factors),
        },
    )


def random_rudder(
    amplitude: float, shortest: float, longest: float, rpm: float, duration: float, dt: float, seed: int
) -> OpenLoop:
    """Rudder levels uniform in +-amplitude [rad], each held for a random time in [shortest, longest] [s]."""
    t = grid(duration, dt)
    return OpenLoop(
        "random rudder",
        t,
        {
            "delta_r_cmd": amplitude * signals.random_steps(t, shortest, longest, seed),
            "n_cmd": np.full(t.size, rpm),
        },
        {"amplitude": amplitude, "shortest": shortest, "longest": longest, "rpm": rpm, "seed": seed},
    )


def combined(
    rudder: float,
    plane: float,
    f0: float,
    f1: float,
    rpm: float,
    duration: float,
    dt: float,
    seed: int,
    count: int = 10,
    rpm_swing: float = 0.0,
) -> OpenLoop:
    """Rudder, stern planes and rpm at once, each a multisine on harmonics of its own; 6-DOF, open loop.

    The three share no frequency, hence are exactly uncorrelated over the run. `rpm_swing` is relative.
    A vehicle that is unstable in pitch should run `combined_held` instead.
    """
    t = grid(duration, dt)
    waves = [
        signals.multisine(t, _band(f0, f1, duration, dt, count, i, 3), duration, seed + i) for i in range(3)
    ]
    return OpenLoop(
        "combined meander",
        t,
        {
            "delta_r_cmd": rudder * waves[0],
            "delta_s_cmd": plane * waves[1],
            "n_cmd": rpm * (1.0 + rpm_swing * waves[2]),
        },
        {
            "rudder": rudder,
            "plane": plane,
            "f0": f0,
            "f1": f1,
            "rpm": rpm,
            "seed": seed,
            "rpm_swing": rpm_swing,
        },
    )


def combined_held(
    rudder: float,
    plane: float,
    f0: float,
    f1: float,
    rpm: float,
    duration: float,
    dt: float,
    seed: int,
    lookahead: float,
    max_pitch: float,
    max_plane: float,
    k_theta: float = 0.5,
    k_q: float = 0.0,
    count: int = 10,
    rpm_swing: float = 0.0,
) -> ClosedLoop:
    """`combined`, with a planesman who holds depth and pitch loosely underneath (see `DepthLaw`); 6-DOF."""
    extra = combined(rudder, plane, f0, f1, rpm, duration, dt, seed, count, rpm_swing)
    around = {c: (v - rpm if c == "n_cmd" else v) for c, v in extra.commands.items()}
    law = DepthLaw(
        (),
        lookahead,
        max_pitch,
        max_plane,
        k_theta,
        k_q,
        (("delta_r_cmd", 0.0), ("n_cmd", rpm)),
        replace(extra, commands=around),
    )
    return ClosedLoop(
        "combined meander, depth held",
        duration,
        dt,
        {"delta_r_cmd": 0.0, "delta_s_cmd": 0.0, "n_cmd": rpm},
        law,
        dict(extra.parameters),
    )
