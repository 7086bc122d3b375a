"""The side to which a velocity counts where its name says it: `dvl_port` and `dvl_up` are forward-left-up.

Works on a `Draft`. Does not: look at numbers; where those tell the axes, they do, in `deciding`.
"""

from __future__ import annotations

import re
from dataclasses import replace

from bayesid.trials.importing.draft import Draft
from bayesid.trials.importing.tables import plain
from bayesid.words import and_list

# word at the end of a name -> body axes, by role
_WORDS = {
    "v": {"port": "flu", "stbd": "frd", "starboard": "frd"},
    "w": {"up": "flu", "down": "frd"},
}
_SAYS = {"frd": {"v": "to starboard", "w": "down"}, "flu": {"v": "to port", "w": "up"}}
_NOUN = re.compile(r" (vel|velocity|speed)$")


def body_of_name(role: str, name: str) -> str | None:
    """frd or flu where the name of a velocity ends with the side it counts to; None where it does not."""
    last = _NOUN.sub("", plain(name)).rpartition(" ")[2]
    return _WORDS.get(role, {}).get(last)


def name_body(draft: Draft) -> None:
    """Takes the body axes from the names where no log states them."""
    if draft.body_stated:
        return
    told = _told(draft)
    if len(set(told.values())) == 1:
        draft.body_named = next(iter(told.values()))
        draft.map = replace(draft.map, body=draft.body_named)


def turn_named(draft: Draft) -> None:
    """Turns the sign of a velocity whose name contradicts the body axes that the other series tell."""
    if draft.body_stated or draft.map.body is None:
        return
    body = draft.map.body
    told = _told(draft)
    against = [role for role, said in told.items() if said != body]
    for role in against:
        draft.map = draft.change(role, scale=-draft.map.channels[role].scale)
        draft.remark(
            f"{draft.column(role)} counts positive {_SAYS[told[role]][role]}, as its name says, and the body "
            f"axes are {body}: its sign is turned (scale = {draft.map.channels[role].scale:g})"
        )
    if told and not against:
        verb = "says" if len(told) == 1 else "say"
        draft.remark(f"body axes {body}, as {and_list([draft.column(r) for r in told])} {verb}")


def _told(draft: Draft) -> dict[str, str]:
    found = {r: body_of_name(r, draft.map.channels[r].source) for r in _WORDS if draft.has(r)}
    return {role: said for role, said in found.items() if said is not None}
