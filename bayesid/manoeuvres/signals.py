"""Test signals for excitation: maximum-length sequence, chirp, low-crest multisine, random steps.

Takes: times [s], frequencies [Hz], seeds; returns arrays of amplitude one.
Does not: know a rudder or a vehicle.
"""

from __future__ import annotations

import numpy as np

from bayesid.errors import ManoeuvreError

# Feedback taps of primitive polynomials over GF(2), one per register length (Golomb 1967; any one will do).
TAPS = {
    2: (2, 1),
    3: (3, 2),
    4: (4, 3),
    5: (5, 3),
    6: (6, 5),
    7: (7, 6),
    8: (8, 6, 5, 4),
    9: (9, 5),
    10: (10, 7),
    11: (11, 9),
    12: (12, 11, 10, 4),
    13: (13, 12, 11, 8),
    14: (14, 13, 12, 2),
    15: (15, 14),
}


def maximum_length_sequence(order: int, seed: int = 0) -> np.ndarray:
    """One period, 2^order - 1 values of +1 or -1, of a shift-register sequence.

    The seed picks the starting point only: every seed has the same spectrum, flat but for the mean of
    1/period.
    """
    if order not in TAPS:
        raise ManoeuvreError(f"no shift register of length {order}; use {min(TAPS)} to {max(TAPS)}")
    length = 2**order - 1
    register = int(np.random.default_rng(seed).integers(1, length + 1))
    out = np.empty(length)
    for k in range(length):
        out[k] = 1.0 if register & 1 else -1.0
        bit = 0
        for tap in TAPS[order]:
            bit ^= register >> (order - tap)
        register = (register >> 1) | ((bit & 1) << (order - 1))
    return out


def held_levels(t: np.ndarray, levels: np.ndarray, clock: float) -> np.ndarray:
    """Levels held for `clock` [s] each, repeated as long as t [s] lasts."""
    # the small advance keeps a step at k*clock from slipping by one sample through rounding
    return np.asarray(levels)[np.floor(t / clock + 1e-9).astype(int) % len(levels)]


def chirp(t: np.ndarray, f0: float, f1: float, logarithmic: bool = True) -> np.ndarray:
    """Sine whose frequency runs from f0 to f1 [Hz] over the span of t [s]; starts at zero."""
    if not (f0 > 0 and f1 > 0):
        raise ManoeuvreError(f"chirp from {f0:g} to {f1:g} Hz: both frequencies must be positive")
    tau, span = t - t[0], t[-1] - t[0]
    if logarithmic and f0 != f1:
        rate = np.log(f1 / f0) / span
        phase = f0 * np.expm1(rate * tau) / rate
    else:
        phase = f0 * tau + 0.5 * (f1 - f0) / span * tau**2
    return np.sin(2 * np.pi * phase)


def crest_factor(signal: np.ndarray) -> float:
    """Peak over root mean square; sqrt(2) for one sine."""
    return float(np.abs(signal).max() / np.sqrt(np.mean(np.square(signal))))


def multisine(
    t: np.ndarray, harmonics: np.ndarray, period: float, seed: int = 0, rounds: int = 300
) -> np.ndarray:
    """Equal-amplitude sum of harmonics k/period [Hz] with phases chosen for a low peak; peak 1 over t [s].

    Random phases from the seed are improved by clipping in time and restoring the amplitudes in frequency
    (van der Ouderaa, Schoukens & Renneboog 1988); the best round wins. `rounds=0` keeps the random phases.
    """
    k = np.unique(np.asarray(harmonics, int))
    if k.size == 0 or k[0] < 1:
        raise ManoeuvreError("a multisine needs at least one harmonic, counted from 1")
    if not (np.isfinite(period) and period > 0):
        raise ManoeuvreError(f"a multisine of period {period} s; the period must be positive")
    size = 8 * int(k[-1]) + 8
    rounds = min(rounds, 30_000_000 // size)  # seconds at most, however wide the band
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, k.size)
    best, best_crest = phase, np.inf
    for step in range(rounds + 1):
        spectrum = np.zeros(size // 2 + 1, complex)
        spectrum[k] = np.exp(1j * phase)
        wave = np.fft.irfft(spectrum, size)
        if (crest := crest_factor(wave)) < best_crest:
            best, best_crest = phase, crest
        limit = np.abs(wave).max() * (0.75 + 0.2 * step / max(rounds, 1))
        phase = np.angle(np.fft.rfft(np.clip(wave, -limit, limit)))[k]
    tau = t - t[0]
    out = np.zeros(tau.size)
    for harmonic, angle in zip(k, best, strict=True):
        out += np.cos(2 * np.pi / period * harmonic * tau + angle)
    return out / np.abs(out).max()


def random_steps(t: np.ndarray, shortest: float, longest: float, seed: int) -> np.ndarray:
    """Levels uniform in [-1, 1] held for a time uniform in [shortest, longest] [s]."""
    if not 0 < shortest <= longest:
        raise ManoeuvreError(f"holds from {shortest:g} to {longest:g} s: need 0 < shortest <= longest")
    rng = np.random.default_rng(seed)
    span = float(t[-1] - t[0])
    edges, levels = [0.0], [rng.uniform(-1, 1)]
    while edges[-1] <= span:
        edges.append(edges[-1] + rng.uniform(shortest, longest))
        levels.append(rng.uniform(-1, 1))
    return np.asarray(levels)[np.searchsorted(edges, t - t[0], side="right") - 1]
