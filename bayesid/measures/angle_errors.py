"""Errors of simulated readings whose angles count on through whole turns.

Takes readings minus what a model gives, channel by channel. Gives the same errors, an angle that falls behind
by more than half a turn further behind. Does not weigh: a likelihood compares angles by the shortest way.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from bayesid.model.channels import channel

# Rms error of an angle [rad] from which a table says how it is counted: below, no reader asks.
SAID_FROM = 0.5 * np.pi
# A step of an angle's error that no model makes between two samples [rad], and how many bad readings in a row
# are told from a turn.
LARGE, MOST_BAD = 1.0, 5


def counted_on(errors: np.ndarray, channels: Sequence[str]) -> np.ndarray:
    """Errors with angles continuous from the first one known.

    Parameters
    ----------
    errors : (n, q) reading minus simulation or the reverse, at successive samples [SI]; nan where none
    channels : (q,) names of the columns

    Returns
    -------
    (n, q) errors [SI]. The first of an angle lies within half a turn of zero; each later one within half a
    turn of the one before, so a log may be wrapped, and a gap in it changes nothing as long as the error
    grows by less than half a turn over it. Up to `MOST_BAD` readings far off, after which the error is back
    where it was, count no turn.
    """
    out = np.array(errors, dtype=float)
    for j, name in enumerate(channels):
        if channel(name).circular:
            known = np.flatnonzero(np.isfinite(out[:, j]))
            if known.size:
                out[known, j] = _continuous(out[known, j])
    return out


def _continuous(angle: np.ndarray) -> np.ndarray:
    """(n,) unwrapped from zero, without the turns that bad readings would make."""
    from_zero = np.concatenate(([0.0], angle))
    step = _shortest(np.diff(from_zero))
    large = np.abs(step) > LARGE
    for k in np.flatnonzero(large & ~np.concatenate(([False], large[:-1]))):
        across = _shortest(from_zero[k : k + 2 + MOST_BAD] - from_zero[k])
        for m in range(2, across.size):
            calm = k + m == step.size or not large[k + m]
            if calm and abs(across[m]) < LARGE:
                if abs(step[k : k + m].sum() - across[m]) > np.pi:
                    step[k : k + m] = np.diff(across[: m + 1])
                break
    return angle + 2 * np.pi * np.round((np.cumsum(step) - angle) / (2 * np.pi))


def _shortest(angle: np.ndarray) -> np.ndarray:
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def turns_note(rms: Iterable[float]) -> str:
    """How angles are counted, a sentence with a space before it, where an rms [rad] is large; else empty."""
    if not any(SAID_FROM < value < np.inf for value in rms):
        return ""
    return (
        " Headings count on through whole turns: one circle behind its log, a simulation misses by 360 "
        "degrees."
    )
