"""Which actuator of a vehicle a series is of, by the side or the number in its name.

Takes what the vehicle is steered by. Does not: read a series whose name fits two of them, or none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from bayesid.trials.importing.names import Guess, guess_role
from bayesid.trials.importing.raw import RawChannel

SIDES = {
    "port": frozenset({"port", "ps", "bb", "left", "backbord", "babord", "prt"}),
    "stbd": frozenset({"stbd", "starboard", "stb", "sb", "right", "steuerbord", "tribord", "strb"}),
    "bow": frozenset({"bow", "bug"}),
    "stern": frozenset({"stern", "aft", "heck"}),
}
_KINDS = {"delta_r": "delta", "n": "n"}  # role of a name without its actuator -> first word of an input
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_UNIT = re.compile(r"\s*[\[(][^\[\]()]*[\])]\s*$")


@dataclass(frozen=True)
class Steering:
    """What a vehicle without a rudder is steered by.

    Attributes
    ----------
    inputs : as "n_port", "delta_1"
    sides : input whose name is a number -> "port" or "stbd", where one alone is on that side
    absent : "delta_r" and "n", where the vehicle has none
    together : "delta_r" and "n" -> the inputs one order of it moves, with the sign to which each then turns
    """

    inputs: tuple[str, ...] = ()
    sides: Mapping[str, str] = field(default_factory=dict)
    absent: frozenset[str] = frozenset()
    together: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def sides_across(across: Mapping[str, float]) -> dict[str, str]:
    """Input -> its side, from where it stands across the vehicle [m]; of each kind one on a side."""
    found: dict[str, str] = {}
    for name, y in across.items():
        kind, _, own = name.partition("_")
        beside = [o for o, other in across.items() if o.partition("_")[0] == kind and other * y > 0.0]
        if own.isdigit() and y != 0.0 and beside == [name]:
            found[name] = "port" if y < 0.0 else "stbd"
    return found


def named_guess(channel: RawChannel, steering: Steering) -> Guess | None:
    """The input of the vehicle a series is by its name; None if none, or more than one."""
    bare = _UNIT.sub("", channel.name)
    words = [word.lower() for word in _WORDS.findall(bare)]
    found: list[Guess] = []
    for name in steering.inputs:
        kind, _, own = name.partition("_")
        mine = {own} | SIDES.get(own, frozenset()) | SIDES.get(steering.sides.get(name, ""), frozenset())
        rest = [word for word in words if word not in mine]
        if len(rest) != len(words) - 1 or not rest:
            continue
        guess = guess_role(replace(channel, name=" ".join(rest)))
        if guess is not None and guess.score >= 2.0 and _KINDS.get(guess.role) == kind:
            found.append(Guess(name, 2.0, guess.ordered))
    return found[0] if len(found) == 1 else None


def all_of_one_kind(role: str, steering: Steering) -> list[str]:
    """The inputs that one order, without the name of an actuator, moves together; none where it moves some of
    them the other way round."""
    signs = steering.together.get(role.removesuffix("_cmd"), {})
    return [] if any(sign < 0.0 for sign in signs.values()) else list(signs)
