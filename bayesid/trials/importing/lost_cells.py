"""Cells that hold no number: an order that cannot be read is asked about, a reading is left out.

Takes a `Draft` whose channels are named. Does not: mend cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayesid.trials.importing.converting import resolve
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.names import WITH_ORDER
from bayesid.trials.importing.raw import RawChannel

FEW = 3  # cells in a row that may be lost where the order before and after is the same
MANY = 0.1  # share of lost readings from which a measured channel is asked about, too


def ask_lost_cells(draft: Draft) -> None:
    """An order holds until the next one that can be read. That is wrong where the lost cells held another
    order, so they are asked about, first of all where the orders around them differ; a reading left out is
    a gap and no more."""
    used: set[tuple[str, str]] = set()
    for role in draft.map.channels:
        label, name = resolve(draft.map, role)
        used.add((label, name))
        its = [r.logs[label].by_name[name] for r in draft.recordings
               if label in r.logs and name in r.logs[label].by_name]  # fmt: skip
        lost = sum(c.lost for c in its)
        if not lost:
            continue
        thinned = any(r.logs[label].thinned > 1 for r in draft.recordings if label in r.logs)
        if role.endswith("_cmd") or (role in WITH_ORDER and not draft.has(f"{role}_cmd")):
            _ask_order(draft, role, name, its, lost, thinned)
        elif lost > MANY * sum(c.t.size for c in its) and not thinned:
            draft.ask(3, f"{role} {name!r}: {lost} cells are no numbers and are left out; is it the right "
                         f"column, read rightly?")  # fmt: skip
        else:
            draft.remark(f"{role} {name!r}: {lost} cells are no numbers and are left out")
    for recording in draft.recordings:
        for label, log in recording.logs.items():
            for c in log.channels:
                if c.lost and (label, c.name) not in used:
                    draft.remark(f"{c.place}, which is not used: {c.lost} cells are no numbers")


def _ask_order(draft: Draft, role: str, name: str, its: list[RawChannel], lost: int, thinned: bool) -> None:
    cells = "1 cell is no number" if lost == 1 else f"{lost} cells are no numbers"
    stretches = [stretch for c in its for stretch in _stretches(c)]
    doubtful = [s for s in stretches if s.before != s.behind or s.cells > FEW]
    after = (
        "; correct the file, cut that time out by `window`, or delete this question to hold the order before"
    )
    if doubtful:
        worst = max(doubtful, key=lambda s: (s.before != s.behind, s.cells))
        if np.isnan(worst.before) or np.isnan(worst.behind):
            change = f"the log {'begins' if np.isnan(worst.before) else 'ends'} with them"
        elif worst.before != worst.behind:
            change = f"the order changes there from {worst.before:.4g} to {worst.behind:.4g}"
        else:
            change = f"{worst.cells} of them in a row"
        draft.ask(
            0 if worst.before != worst.behind else 1,
            f"{role} {name!r}: {cells}, and {change} (at {worst.start:.1f} s of the log): what was ordered "
            f"there is not known{after}",
        )
    elif thinned:
        draft.ask(1, f"{role} {name!r}: {cells}; what was ordered there is not known{after}")
    else:
        draft.remark(f"{role} {name!r}: {cells}; the order before and after is the same and is held")


@dataclass(frozen=True)
class _Stretch:
    """Cells without a number from `start` [s]; the orders around them, NaN where the log begins or ends."""

    start: float
    cells: int
    before: float
    behind: float


def _stretches(found: RawChannel) -> list[_Stretch]:
    if not found.lost:
        return []
    gone = ~np.isfinite(found.values)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], gone.astype(int), [0]))))
    orders = np.concatenate(([np.nan], found.values, [np.nan]))
    return [
        _Stretch(float(found.t[a]), int(b - a), float(orders[a]), float(orders[b + 1]))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
