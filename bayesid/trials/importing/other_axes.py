"""Mistakes of position and heading that would make track and heading agree in every recording.

Takes a draft. Gives words for the question that is asked; does not decide.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bayesid.trials.importing.agreement import track_misfit
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.words import and_list

MOST = 8  # recordings looked at
DOUBTFUL = 0.1  # share of the track that the heading leaves unexplained, above which others are tried
FITS, CLEAR = 0.1, 0.35  # share left by a mistake that is named, and over that of the axes as they are
_PLACES = (("x", "y"), ("north", "east"), ("latitude", "longitude"))


def axes_that_fit(draft: Draft) -> str:
    """What would make track and heading agree, with its mend; empty where nothing does or nothing has to."""
    now = unexplained(draft, draft.map)
    if not now > DOUBTFUL:
        return ""
    found = [
        (words, left, mend)
        for words, mend, changed in _mistakes(draft)
        if (left := unexplained(draft, changed)) < min(FITS, CLEAR * now)
    ]
    if not found:
        return ""
    fits = "; or ".join(f"{words} ({100 * left:.0f} % unexplained): {mend}" for words, left, mend in found)
    return f"they agree with {fits}"


def unexplained(draft: Draft, tried: LogMap) -> float:
    """Share of the track off the direction of the heading, mean over recordings; 0 where none tells."""
    found = [track_misfit(tried, recording) for recording in draft.recordings[:MOST]]
    told = [misfit + 2.0 * (1.0 - math.cos(turn)) for misfit, turn in found if (misfit, turn) != (1.0, 0.0)]
    return float(np.mean(told)) if told else 0.0


def _mistakes(draft: Draft) -> Iterator[tuple[str, str, LogMap]]:
    """Words, their mend, and the map with it."""
    for first, second in _PLACES:
        if not draft.has(first, second):
            continue
        channels = dict(draft.map.channels)
        channels[first], channels[second] = channels[second], channels[first]
        yield (
            f"{draft.column(first)} and {draft.column(second)} exchanged",
            "if that is so, exchange the two in the map",
            replace(draft.map, channels=channels),
        )
    for role in ("y", "east", "heading", "psi"):
        if draft.has(role):
            mend = "if that is so, write `scale = -1` in its line of the map"
            if role in ("heading", "psi"):
                mend += _turned_over(draft)
            turned = draft.change(role, scale=-draft.map.channels[role].scale)
            yield f"{draft.column(role)} of the other sign", mend, turned


def _turned_over(draft: Draft) -> str:
    """What is decided by the turns of the heading, and is the other way round with it."""
    told = ["`rudder_positive`"] if draft.has("delta_r") or draft.has("delta_r_cmd") else []
    told += ["`body`"] if draft.has("r") and not draft.body_stated else []
    return f" and turn over {and_list(told)}" if told else ""
