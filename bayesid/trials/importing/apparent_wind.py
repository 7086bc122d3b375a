"""A wind whose name says that it is the one on board, while a bundle holds the true one from north.

Asks in a `Draft` and proposes `[corrections]` that make it the true one. Does not: look at its numbers;
`trials.mistakes.wind` does, with a vehicle.
"""

from __future__ import annotations

import re
from dataclasses import replace

from bayesid.trials.correction import Correction
from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.names import APPARENT
from bayesid.trials.importing.tables import plain
from bayesid.trials.true_wind import APPARENT as ON_BOARD
from bayesid.trials.true_wind import APPARENT_BY_COMPASS, FROM_BOW
from bayesid.words import and_list

_FROM_NORTH = re.compile(r"\b(awd|compass|from north)\b")  # words of a wind that does not count from the bow
_ANGLE = re.compile(r"\b(twa|angle)\b")  # words of one that does
_OVER_GROUND = ("x", "north", "latitude", "u", "v_north", "speed_over_ground")


def ask_apparent_wind(draft: Draft) -> None:
    """Ask whether the wind is the apparent one, or counts from the bow, where its name says so."""
    columns = {role: draft.column(role) for role in ("wind_speed", "wind_from") if draft.has(role)}
    named = {role: plain(column) for role, column in columns.items()}
    from_north = _FROM_NORTH.search(named.get("wind_from", "")) is not None
    if any(APPARENT.search(name) for name in named.values()):
        which = APPARENT_BY_COMPASS if from_north else ON_BOARD
        told = len(columns) == 2 and draft.headed and any(draft.has(role) for role in _OVER_GROUND)
        line = f'`[corrections]` `wind = "{which}"`'
        if told:
            draft.map = replace(draft.map, corrections=Correction(wind=which))
        read = (
            f"read as it, and made the true one by {line} of the map; delete that line where it is the true "
            "wind"
            if told
            else f"read as the true one; else write {line} into the map, which needs wind_speed, wind_from, "
            "a heading and the motion over ground"
        )
        draft.ask(
            2,
            f"wind {and_list(list(columns.values()))} looks like the apparent one, past the moving vehicle; "
            f'is it? ({read}; "apparent" counts from the bow, "apparent by compass" from north)',
        )
    elif _ANGLE.search(named.get("wind_from", "")):
        draft.ask(
            2,
            f"wind {columns['wind_from']} is called an angle; does it count from the bow? (read as from "
            f'north; else write `[corrections]` `wind = "{FROM_BOW}"` into the map)',
        )
