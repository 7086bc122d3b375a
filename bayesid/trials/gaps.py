"""Where a run has no samples, or none of one channel, for much longer than usual.

Takes a `Run`. Gives stretches of time, and a sentence on those of a channel.
Does not: fill them, or judge whether they matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.model.channels import channel
from bayesid.trials.trial import Floats, Run
from bayesid.words import and_list, counted

ROWS, ROWS_SPREAD = 5.0, 2.0  # times the usual step, and the step that one in ten exceeds
READINGS, READINGS_SPREAD = 10.0, 3.0  # the same of one channel, whose readings may be lost here and there
FEWEST = 8  # readings of a channel that tell how often it is usually read


@dataclass(frozen=True)
class Gap:
    """A stretch without samples, of `channels`; of all where these are empty.

    Attributes
    ----------
    first, last : last sample before it and first after it, or the ends of the run [s]
    usual : time between samples [s]
    """

    first: float
    last: float
    usual: float
    channels: tuple[str, ...] = ()

    @property
    def length(self) -> float:
        return self.last - self.first


def row_gaps(t: Floats) -> list[Gap]:
    """Stretches without any sample."""
    step = np.diff(t)
    usual = float(np.median(step))
    long = step > max(ROWS * usual, ROWS_SPREAD * float(np.percentile(step, 90)))
    return [Gap(float(t[k]), float(t[k + 1]), usual) for k in np.flatnonzero(long)]


def channel_gaps(run: Run) -> list[Gap]:
    """Stretches without a reading of a channel of the pose that is read otherwise, beyond those without any
    sample; channels that are lost together are one."""
    of_rows = row_gaps(run.t)
    found: dict[tuple[float, float], Gap] = {}
    for name, values in run.data.items():
        if channel(name).kind != "pose":
            continue
        for gap in _lost(run.t, values):
            inside = sum(row.length for row in of_rows if gap.first <= row.first and row.last <= gap.last)
            if gap.length - inside < READINGS * gap.usual:
                continue
            key = gap.first, gap.last
            if (other := found.get(key)) is not None:
                gap = replace(gap, usual=max(gap.usual, other.usual))
            found[key] = replace(gap, channels=(*(other.channels if other else ()), name))
    return sorted(found.values(), key=lambda gap: gap.first)


def gaps_of(run: Run) -> list[Gap]:
    """Those of all channels and of single ones, in time; those of single ones that overlap are one."""
    out: list[Gap] = []
    for gap in sorted(channel_gaps(run), key=lambda one: (one.first, one.last)):
        if out and gap.first < out[-1].last:
            whole = out.pop()
            names = tuple(dict.fromkeys((*whole.channels, *gap.channels)))
            gap = Gap(whole.first, max(whole.last, gap.last), whole.usual, names)
        out.append(gap)
    return sorted([*row_gaps(run.t), *out], key=lambda one: (one.first, one.last))


def gap_words(gaps: Sequence[Gap]) -> list[str]:
    """A sentence per group of channels that are lost together."""
    by_channels: dict[tuple[str, ...], list[Gap]] = {}
    for gap in gaps:
        by_channels.setdefault(gap.channels, []).append(gap)
    out = []
    for names, lost in by_channels.items():
        worst = max(lost, key=lambda gap: gap.length)
        more = f"; {counted(len(lost) - 1, 'more gap')} of {and_list(list(names))}" if len(lost) > 1 else ""
        out.append(
            f"{and_list(list(names))} missing from t = {worst.first:.6g} to {worst.last:.6g} s "
            f"({worst.length:.3g} s; usually every {worst.usual:.3g} s){more}"
        )
    return out


def _lost(t: Floats, values: Floats) -> list[Gap]:
    read = t[np.isfinite(values)]
    if read.size < FEWEST or read.size == t.size:
        return []
    step = np.diff(read)
    usual = float(np.median(step))
    least = max(READINGS * usual, READINGS_SPREAD * float(np.percentile(step, 90)))
    edges = np.concatenate((t[:1], read, t[-1:]))
    long = np.flatnonzero(np.diff(edges) > least)
    return [Gap(float(edges[k]), float(edges[k + 1]), usual) for k in long]
