"""Series that rest: left out where they tell nothing, and no angle to judge a unit by.

Works on a `Draft`. Does not: decide a unit; `deciding` does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesid.trials.importing.draft import Draft
from bayesid.words import and_list

UPRIGHT = (
    "z", "depth", "height", "phi", "theta", "w", "p", "q",
    "delta_s", "delta_s_cmd", "delta_b", "delta_b_cmd",
)  # fmt: skip
# rad; an order held beyond it for all of a log is that of a turn, and its unit matters
HELD = 0.2
WHITE = 0.5  # share of the variance that half the squared steps of white noise exceed, and motion does not


def drop_constant(draft: Draft) -> None:
    """Series of the vertical plane that never change tell nothing and would make the trial one of 6 degrees
    of freedom."""
    still = [r for r in UPRIGHT if draft.has(r) and (raw := draft.raw(r)).size and float(np.ptp(raw)) == 0.0]
    if still:
        channels = {role: entry for role, entry in draft.map.channels.items() if role not in still}
        draft.resting |= {role: float(draft.raw(role)[0]) for role in still}
        draft.map = replace(draft.map, channels=channels)
        many = len(still) > 1
        draft.remark(f"{and_list(still)} never {'change and are' if many else 'changes and is'} left out")


def rests(draft: Draft, role: str) -> bool:
    """Whether an angle is only the noise of an actuator at rest: nothing is ordered, and its reading is
    white; without an order, white about zero and small in either unit."""
    order = f"{role.removesuffix('_cmd')}_cmd"
    ordered = draft.raw(order) if draft.has(order) else None
    if order in draft.resting:
        ordered = np.array([draft.resting[order]])
    if ordered is not None and not _held(ordered):
        return False
    each = [draft.raw(role, recording) for recording in draft.recordings]
    return all(
        _is_white(values) if ordered is not None else _is_white(values) and _about_zero(values)
        for values in each
        if values.size and (role != order or not _held(values))
    )


def _held(ordered: np.ndarray) -> bool:
    return bool(ordered.size) and float(np.ptp(ordered)) == 0.0 and abs(float(ordered[0])) <= HELD


def _is_white(values: np.ndarray) -> bool:
    if values.size and not float(np.ptp(values)):
        return True
    return values.size >= 10 and 0.5 * float(np.mean(np.diff(values) ** 2)) > WHITE * float(np.var(values))


def _about_zero(values: np.ndarray) -> bool:
    return abs(float(np.mean(values))) < float(np.std(values)) <= 0.5 * HELD
