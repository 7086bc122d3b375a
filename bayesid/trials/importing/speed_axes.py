"""Mistakes of u and v that would make them agree with a track and a heading that agree by themselves.

Takes a draft whose axes are chosen. Asks; does not change the map.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from bayesid.trials.importing.agreement import speed_fit, speed_fit_of_all, track_misfit
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.words import and_list, first_few

MOST = 8  # recordings looked at
STRAIGHT = 0.6  # rad between track and heading up to which they point the same way
AGREES = 0.3  # share of the track left unexplained by a heading that agrees
DOUBTFUL, FITS, CLEAR = (
    0.2,
    0.1,
    0.35,
)  # shares left by the speeds as they are, and by a mistake that is named


def blames_the_heading(draft: Draft, rotation: float) -> bool:
    """Whether the speeds say that the track runs off the heading by `rotation` although it does not: a
    heading and a track that run along one another are right, and the speeds are not."""
    alone = [track_misfit(draft.map, recording) for recording in draft.recordings[:MOST]]
    turns = [turn for misfit, turn in alone if misfit < AGREES]
    along = bool(turns) and abs(float(np.median(turns))) < STRAIGHT
    return along and abs(rotation) > STRAIGHT


def ask_speed_axes(draft: Draft) -> bool:
    """Asks where u, v exchanged or reversed would explain what they do not; True where it asks."""
    if not draft.has("u", "v"):
        return False
    now, off = _unexplained(draft, draft.map)
    along = blames_the_heading(draft, math.pi)
    if not (now > DOUBTFUL and along):
        return False
    left = {words: (_unexplained(draft, tried)[0], mend, n) for words, mend, n, tried in _mistakes(draft)}
    fits = {words: pair for words, pair in left.items() if pair[0] < min(FITS, CLEAR * now)}
    best = min((share for share, *_ in fits.values()), default=0.0)
    close = {words: pair for words, pair in fits.items() if CLEAR * pair[0] <= max(best, 1e-3)}
    if not close and abs(off) < STRAIGHT:
        return False
    told = "; or with ".join(
        f"{words} ({100.0 * share:.1f} % unexplained): if that is so, {mend}"
        for words, (share, mend, _) in sorted(close.items(), key=lambda item: (item[1][2], item[1][0]))
    )
    columns = f"{draft.column('u')} and {draft.column('v')}"
    how = f"run {math.degrees(off):+.0f} deg off them" if abs(off) >= STRAIGHT else "do not follow them"
    rest = (
        f"they agree with {told}" if told else "are these the speeds ahead and to the side? else delete both"
    )
    draft.ask(0, f"track and heading agree by themselves, and the speeds {columns} {how}; {rest}")
    return True


def axes_by_speeds(
    draft: Draft, options: Sequence[tuple[str, LogMap]]
) -> dict[str, tuple[float, float]] | None:
    """Axes -> (share of the track that u, v and the heading leave unexplained, its rotation [rad]), for a
    vehicle that does not go where it heads, as one that is driven sideways; None where they tell no axes."""
    if not draft.has("u", "v"):
        return None
    found: dict[str, tuple[float, float]] = {}
    for key, tried in options:
        for body in ("frd", "flu"):  # the sign of v is not decided yet
            fit = speed_fit_of_all(replace(tried, body=body), draft.recordings[:MOST])
            if fit is not None and fit[1] < found.get(key, (1.0, 0.0))[0]:
                found[key] = fit[1:]
    return found if found and min(share for share, _ in found.values()) < AGREES else None


def why_not_the_track(draft: Draft) -> str:
    """The question about a speed ahead that does not integrate to the track: first what it lacks for that."""
    speed = f"speed {draft.column('u')}"
    spare = f" (series not used: {first_few(map(repr, draft.unused), 8)})" if draft.unused else ""
    if not draft.headed:
        return (
            f"{speed} cannot be held against the track, as no heading is read: add heading, psi or qw, qx, "
            f"qy, qz to [channels]{spare}; if none is logged, delete this line"
        )
    if not draft.has("v"):
        return (
            f"{speed} alone does not integrate to the track, and no speed to the side is read: add `v` to "
            f"[channels]{spare}; if none is logged: right column, axes, clock? else delete `u`"
        )
    return f"{speed} does not integrate to the track; right column, axes, clock? else delete `u`, `v`"


def _unexplained(draft: Draft, tried: LogMap) -> tuple[float, float]:
    """(share of the track off what the speeds say, direction included; its rotation [rad]), of recordings."""
    found = [fit for recording in draft.recordings[:MOST] if (fit := speed_fit(tried, recording)) is not None]
    if not found:
        return 0.0, 0.0
    share = float(np.mean([misfit + 2.0 * (1.0 - math.cos(turn)) for _, misfit, turn in found]))
    return share, float(np.angle(np.sum([np.exp(1j * turn) for *_, turn in found])))


def _mistakes(draft: Draft) -> Iterator[tuple[str, str, int, LogMap]]:
    """Words, their mend, of how many changes, and the map with it; v alone of the other sign is decided
    elsewhere."""
    for exchanged in (False, True):
        for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
            if not exchanged and signs[0] > 0.0:
                continue
            channels = dict(draft.map.channels)
            pair = (channels["v"], channels["u"]) if exchanged else (channels["u"], channels["v"])
            columns = [draft.column(role) for role in (("v", "u") if exchanged else ("u", "v"))]
            for role, entry, sign in zip(("u", "v"), pair, signs, strict=True):
                channels[role] = replace(entry, scale=sign * entry.scale)
            turned = [c for c, sign in zip(columns, signs, strict=True) if sign < 0.0]
            words = [f"{draft.column('u')} and {draft.column('v')} exchanged"] if exchanged else []
            words += [f"{and_list(turned)} of the other sign"] if turned else []
            mends = ["exchange the two in the map"] if exchanged else []
            mends += [f"write `scale = -1` in the line of {and_list(turned)}"] if turned else []
            changes = exchanged + len(turned)
            yield and_list(words), and_list(mends), changes, replace(draft.map, channels=channels)
