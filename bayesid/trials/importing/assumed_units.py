"""Units that no header states and no other series settles: which are taken, asked or remarked.

Does not: decide one; `deciding` has done that.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.names import MEASURED, ORDERED, OTHER, guess_role
from bayesid.trials.importing.raw import RawChannel
from bayesid.trials.importing.roles import QUATERNION, ROLES
from bayesid.trials.importing.unit_words import suffix_unit
from bayesid.words import and_list

_LAST = re.compile(r"(?P<head>.*[^_.\s])[_.\s]+(?P<word>[^\W\d_][^_.\s]*)")
_SAID = re.compile("states no unit|states a unit|taken as|pulse width")  # questions that name the unit
_SIDES = frozenset({"port", "stbd", "stb", "starboard", "bb", "fore", "aft", "bow", "stern", "true", "mag"})
_WORDS = {"deg": "degrees", "rad": "radians", "m": "metres"}
# told by the other series, or asked and remarked with their unit by `deciding`
_DECIDED = frozenset({
    *QUATERNION, "psi", "heading", "course", "phi", "theta", "wind_from", "r", "u", "v", "w", "n", "n_cmd",
    "latitude", "longitude",
})  # fmt: skip


def unknown_unit(channel: RawChannel, others: Iterable[str]) -> str | None:
    """The last word of a name, where other headers have their unit and this one has none that is known.

    Only where the name without it is the whole name of the channel: `Rudder_cmd_xyz` beside `Compass_deg`.
    """
    found = _LAST.fullmatch(channel.name.strip())
    if channel.unit is not None or found is None or not any(suffix_unit(o) for o in others):
        return None
    word = found["word"].lower()
    if word in _SIDES or any(pattern.fullmatch(word) for pattern in (ORDERED, MEASURED, OTHER)):
        return None
    whole, short = guess_role(channel), guess_role(replace(channel, name=found["head"]))
    if whole is None or short is None or whole.role != short.role:
        return None
    return found["word"] if short.score >= 2.0 > whole.score else None


def ask_assumed_units(draft: Draft) -> None:
    """Asks whether a series read by a part of its name is that, and in which unit; remarks other defaults."""
    for source, word in draft.by_part.items():
        role = next((k for k, entry in draft.map.channels.items() if entry.source == source), None)
        if role is None:
            continue
        shown = draft.column(role)
        taken = "" if draft.stated.get(role, False) else _taken(draft, role)
        if taken and word is not None:
            draft.ask(
                1,
                f"{shown} is read as {role}; {word!r}, where other headers have their unit, is no unit known "
                f"here, and its numbers are taken as {taken}: are they?",
            )
        else:
            also = f", its numbers taken as {taken}" if taken else ""
            draft.ask(4, f"{shown} is read as {role} by a part of its name{also}; is it?")
    silent: dict[str, list[str]] = {}
    for role in draft.map.channels:
        shown = draft.column(role)
        if role in _DECIDED or draft.stated.get(role, True) or not (taken := _taken(draft, role)):
            continue
        if not any(shown in text for _, text in draft.asked if _SAID.search(text)):
            silent.setdefault(taken, []).append(shown)
    for taken, names in silent.items():
        verb, be = ("states", "is") if len(names) == 1 else ("state", "are")
        draft.remark(f"{and_list(names)} {verb} no unit and {be} taken as {taken}")


def _taken(draft: Draft, role: str) -> str:
    unit = draft.map.channels[role].unit or ROLES[role].unit
    return _WORDS.get(unit, unit)
