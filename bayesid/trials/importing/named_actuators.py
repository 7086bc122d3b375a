"""Which actuator of a vehicle a series is of, by the place or the number in its name.

Takes what the vehicle is steered by. Does not: read a series whose name fits two of them, or none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from bayesid.model.vehicles.orders import has_rudder, missing_actuators, thrusters_turning, together
from bayesid.model.vehicles.vehicle import Vehicle
from bayesid.trials.importing.names import Guess, guess_role
from bayesid.trials.importing.raw import RawChannel

SIDES = {
    "port": frozenset({"port", "ps", "bb", "left", "backbord", "babord", "prt"}),
    "stbd": frozenset({"stbd", "starboard", "stb", "sb", "right", "steuerbord", "tribord", "strb"}),
    "bow": frozenset({"bow", "bug"}),
    "stern": frozenset({"stern", "aft", "heck"}),
    "upper": frozenset({"upper", "top", "oben"}),
    "lower": frozenset({"lower", "bottom", "unten"}),
}
_PLACE_OF = {word: place for place, words in SIDES.items() for word in words}
_KINDS = {"delta_r": "delta", "n": "n"}  # role of a name without its actuator -> first word of an input
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_UNIT = re.compile(r"\s*[\[(][^\[\]()]*[\])]\s*$")
_FIN = re.compile(
    r"\b(?:(?:x )?(?:rudder|ruder|fin|hydroplane|plane|flap)|(?:control )?surface|(?P<letter>x))s?\b"
)
_ASIDE = 0.1  # of the extent of the fins at one end, within which one stands in the middle


@dataclass(frozen=True)
class Steering:
    """What a vehicle without a rudder is steered by.

    Attributes
    ----------
    inputs : as "n_port", "delta_1"
    sides : input whose name is a number -> "port" or "stbd", where one alone is on that side
    absent : "delta_r" and "n", where the vehicle has none
    together : "delta_r" and "n" -> the inputs one order of it moves, with the sign to which each then turns
    places : input of a fin -> where it stands, as {"upper", "port", "stern"}
    turning : as `thrusters_turning`
    """

    inputs: tuple[str, ...] = ()
    sides: Mapping[str, str] = field(default_factory=dict)
    absent: frozenset[str] = frozenset()
    together: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    places: Mapping[str, frozenset[str]] = field(default_factory=dict)
    turning: Mapping[str, float] = field(default_factory=dict)


def steering_of(ship: Vehicle) -> Steering:
    """What steers a vehicle without a rudder; nothing of its own for one that has a rudder."""
    if has_rudder(ship):
        return Steering()
    across = {signal: float(a.at[1]) for a in ship.actuators for signal in a.signals}
    places = fin_places({signal: fin.at for fin in ship.fins for signal in fin.signals})
    absent = frozenset(missing_actuators(ship))
    turning = thrusters_turning(ship)
    return Steering(tuple(across), sides_across(across), absent, together(ship), places, turning)


def sides_across(across: Mapping[str, float]) -> dict[str, str]:
    """Input -> its side, from where it stands across the vehicle [m]; of each kind one on a side."""
    found: dict[str, str] = {}
    for name, y in across.items():
        kind, _, own = name.partition("_")
        beside = [o for o, other in across.items() if o.partition("_")[0] == kind and other * y > 0.0]
        if own.isdigit() and y != 0.0 and beside == [name]:
            found[name] = "port" if y < 0.0 else "stbd"
    return found


def fin_places(at: Mapping[str, Sequence[float]]) -> dict[str, frozenset[str]]:
    """Input of a fin -> words of where it stands among the fins at its end of the vehicle.

    Parameters
    ----------
    at : input -> x ahead, y to starboard, z down [m]
    """
    found: dict[str, frozenset[str]] = {}
    for name, (x, y, z) in at.items():
        beside = [other for other in at.values() if other[0] * x > 0.0]
        heights = [other[2] for other in beside]
        near = _ASIDE * max((max(abs(other[1]), abs(other[2])) for other in beside), default=0.0)
        down = z - 0.5 * (max(heights) + min(heights)) if heights else 0.0
        words = {"stern" if x < 0.0 else "bow"} if x else set()
        words |= {"port" if y < 0.0 else "stbd"} if abs(y) > near else set()
        words |= {"upper" if down < 0.0 else "lower"} if abs(down) > near else set()
        found[name] = frozenset(words)
    return found


def named_guess(channel: RawChannel, steering: Steering) -> Guess | None:
    """The input of the vehicle a series is by its name; None if none, or more than one."""
    bare = _UNIT.sub("", channel.name)
    words = [word.lower() for word in _WORDS.findall(bare)]
    found: list[Guess] = []
    for name in steering.inputs:
        kind, _, own = name.partition("_")
        its = {own, steering.sides.get(name, own), *steering.places.get(name, ())}
        rest = [word for word in words if word != own and _PLACE_OF.get(word) not in its]
        if len(rest) == len(words) or any(word in _PLACE_OF for word in rest):
            continue
        guess = _guess_of(kind, replace(channel, name=" ".join(rest)))
        if guess is not None:
            found.append(replace(guess, role=name))
    return found[0] if len(found) == 1 else None


def _guess_of(kind: str, channel: RawChannel) -> Guess | None:
    """What the name of an actuator without its place says, where that is of the kind of an input."""
    fin = _FIN.search(channel.name) if kind == "delta" else None
    name = channel.name if fin is None else _FIN.sub("rudder", channel.name, count=1)
    guess = guess_role(replace(channel, name=name))
    if guess is None or guess.score < 2.0 or _KINDS.get(guess.role) != kind:
        return None
    # a bare X may be many things: an angle is one of a fin, without a unit it is asked
    sure = fin is None or not fin["letter"] or channel.unit is not None
    return Guess(guess.role, 2.0 if sure else 0.9, guess.ordered)


def all_of_one_kind(role: str, steering: Steering) -> list[str]:
    """The inputs that one order, without the name of an actuator, moves together; none where it moves some of
    them the other way round."""
    signs = steering.together.get(role.removesuffix("_cmd"), {})
    return [] if any(sign < 0.0 for sign in signs.values()) else list(signs)
