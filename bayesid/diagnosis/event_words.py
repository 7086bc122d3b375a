"""What an event is in words: when, and what it looks like.

Takes a `Result` or its events. Gives text. Does not compute.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.failed_checks import MOST_RUNS
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.result import Result
from bayesid.words import first_few


def unexplained(result: Result) -> str:
    """When the vehicle moved as nothing known explains, and as if what; empty where it never did."""
    motions = [e for e in result.events if e.kind == "motion"]
    if not motions:
        return ""
    times = [f"in {e.run} from {e.start:.1f} to {e.end:.1f} s" for e in motions]
    alike = [f" In {e.run} it moves then {said}." for e in motions[:MOST_RUNS] if (said := _as_if(e))]
    return f" No known effect explains how the vehicle moves {first_few(times, MOST_RUNS)}." + "".join(alike)


def _as_if(event: Event) -> str:
    """What an event of motion looks like; empty where that is not known."""
    if event.value is None or event.sd is None:
        return ""
    if event.stuck is None and event.channel == "rpm":
        side = "faster" if event.value > 0.0 else "slower"
        return f"as if the shaft turned {number(abs(event.value))} ± {event.sd:.2g} rpm {side} than ordered"
    if event.stuck is None:
        return rudder_off("the rudder", event.value, event.sd) if event.channel == "rudder" else ""
    if event.stuck == "n":
        return f"as if the shaft stayed at {number(event.value)} ± {event.sd:.2g} rpm, whatever is ordered"
    names = {"delta_r": "rudder", "delta_s": "stern planes", "delta_b": "bow planes"}
    angle, sd = math.degrees(event.value), math.degrees(event.sd)
    sided = event.stuck == "delta_r" and abs(angle) > sd
    side = "" if not sided else " to port" if angle > 0.0 else " to starboard"
    said = f"{number(abs(angle) if sided else angle)} ± {sd:.2g} degrees{side}"
    return f"as if the {names.get(event.stuck, event.stuck)} stuck at {said}, whatever is ordered"


def rudder_off(rudder: str, value: float, sd: float) -> str:
    """By how much a rudder seems off [rad]."""
    side = "port" if value > 0.0 else "starboard"
    size, error = (f"{math.degrees(abs(x)):.2g}" for x in (value, sd))
    return f"as if {rudder} stood {size} ± {error} degrees further to {side} on average"
