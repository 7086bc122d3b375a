"""How long residuals remember: an integrated correlation time, and when it is more than chance.

Takes one series of residuals. Does not model where the memory comes from.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def memory(resid: Array) -> float:
    """Integrated autocorrelation time [samples] of a residual series: 1 if white, more if errors persist."""
    x = resid - np.mean(resid) if resid.size else resid
    if x.size < 8 or not np.any(x):
        return 1.0
    power = np.abs(np.fft.rfft(resid, 2 * resid.size)) ** 2  # an offset is an error that persists: keep it
    correlation = np.fft.irfft(power)[: resid.size]
    tau = 2 * np.cumsum(correlation / correlation[0]) - 1
    window = np.arange(resid.size) > 5 * tau  # Sokal's window
    return float(np.clip(tau[np.argmax(window)] if window.any() else tau[-1], 1.0, resid.size))


def beyond_chance(tau: float, count: int) -> float:
    """A correlation time, or 1 where white noise of so many samples would show the same (two standard
    errors, Sokal 1997)."""
    return tau if tau > 1.0 + 2.0 * np.sqrt(22.0 / max(count, 1)) else 1.0
