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
    grows by less than half a turn over it.
    """
    out = np.array(errors, dtype=float)
    for j, name in enumerate(channels):
        if channel(name).circular:
            known = np.flatnonzero(np.isfinite(out[:, j]))
            if known.size:
                angle = np.unwrap(out[known, j])
                out[known, j] = angle - 2 * np.pi * np.round(angle[0] / (2 * np.pi))
    return out


def turns_note(rms: Iterable[float]) -> str:
    """How angles are counted, a sentence with a space before it, where an rms [rad] is large; else empty."""
    if not any(SAID_FROM < value < np.inf for value in rms):
        return ""
    return (
        " Headings count on through whole turns: one circle behind its log, a simulation misses by 360 "
        "degrees."
    )
