"""Degrees or radians: of angles that state no unit, and of a heading that states the wrong one.

Works on a `Draft`. Does not: decide the unit of a rudder or of a rate.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bayesid.trials.importing.agreement import track_misfit, yaw_fit
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.log_map import LogMap
from bayesid.trials.importing.roles import WORLDS

CLEAR = 0.35  # a hypothesis must leave less than this share of the next one's misfit
AGREES = 0.3  # misfit of a direction that agrees
LEAST = 0.02  # misfit a labelled heading must leave; a weave of 20 deg leaves 0.09 in the wrong unit
NEAR = 0.2  # of a factor, as a logarithm, within which it is that of degrees and radians
FOLLOWS = 0.7  # share of a heading that its yaw rate must explain
_WORDS = {"deg": "degrees", "rad": "radians"}


def decide_angle_units(draft: Draft) -> None:
    """Degrees or radians of angles whose header states neither; a heading is held against the track although
    its header does."""
    for role in ("psi", "heading", "course", "phi", "theta", "wind_from"):
        if draft.has(role) and draft.stated[role] and role in ("psi", "heading"):
            _ask_labelled(draft, role)
        if not draft.has(role) or draft.stated[role]:
            continue
        raw = draft.raw(role)
        top = float(np.max(np.abs(raw))) if raw.size else 0.0
        span = float(np.ptp(raw)) if raw.size else 0.0
        unit = "deg" if top > 2 * math.pi + 0.3 else "rad"
        draft.map = draft.change(role, unit=unit)
        if role in ("psi", "heading") and unit == "rad":
            other = draft.change(role, unit="deg")
            as_rad, as_deg = (track_misfit(m, draft.liveliest)[0] for m in (draft.map, other))
            if as_deg < CLEAR * as_rad:
                draft.map = other
            elif not as_rad < AGREES and span < 1.0:
                draft.ask(
                    2,
                    f"heading {draft.column(role)} states no unit and stays within {span:.2g}; rad or deg? "
                    f"(read as rad)",
                )
        elif role in ("phi", "theta") and unit == "rad":
            if top > 1.4:
                draft.map = draft.change(role, unit="deg")
            else:
                draft.ask(
                    6,
                    f"{role} {draft.column(role)} states no unit and stays within {top:.2g}; rad or deg? "
                    f"(read as rad)",
                )
        elif role == "wind_from" and unit == "rad" and span < 3.0:
            draft.ask(6, f"wind direction {draft.column(role)} states no unit; rad or deg? (read as rad)")


def _ask_labelled(draft: Draft, role: str) -> None:
    """Asks whether a heading labelled in one unit is in the other, where track or yaw rate follow that; it is
    set, so that nothing else is blamed."""
    unit = draft.map.channels[role].unit
    if unit not in _WORDS:
        return
    other = "rad" if unit == "deg" else "deg"
    changed = draft.change(role, unit=other)
    as_said, as_other = _misfit(draft, draft.map), _misfit(draft, changed)
    if as_other < min(AGREES, CLEAR * as_said) and as_said > LEAST:
        why = (
            f"the track follows it as {_WORDS[other]} ({100 * as_other:.2g} % unexplained) and not as "
            f"{_WORDS[unit]} ({100 * as_said:.2g} %)"
        )
    elif as_said > AGREES and _turns_as(draft, changed):
        why = f"the yaw rate {draft.column('r')} is that of {_WORDS[other]}"
    else:
        return
    raw = draft.raw(role)
    draft.map = changed
    draft.ask(
        0,
        f"heading {draft.column(role)} is labelled {unit}, and {why}; it runs from {raw.min():.4g} to "
        f'{raw.max():.4g}. `unit = "{other}"` is set; is that right?',
    )


def _misfit(draft: Draft, tried: LogMap) -> float:
    """Share of the track off the direction of the heading, in the axes that fit best; 1 if nothing tells."""
    worlds = [tried.world] if draft.axes_stated or draft.has("heading") else WORLDS
    return min(track_misfit(replace(tried, world=world), draft.liveliest)[0] for world in worlds)


def _turns_as(draft: Draft, tried: LogMap) -> bool:
    """Whether the heading turns as much as a yaw rate of a stated unit says."""
    if not draft.has("r") or not draft.stated["r"]:
        return False
    fit = yaw_fit(tried, draft.liveliest)
    return fit is not None and fit[1] > FOLLOWS and abs(math.log(abs(fit[0]))) < NEAR
