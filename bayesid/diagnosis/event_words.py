"""What an event is in words: when, and what it looks like; and what a force that is left depends on.

Takes a `Result` or its events. Gives text. Does not compute.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.failed_checks import MOST_RUNS
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.result import Result
from bayesid.words import first_few

NOTHING = "no known effect and no force of the motion explains it"
# Periods up to which the sea swells [s].
OF_A_SWELL = 30.0


def unexplained(result: Result) -> str:
    """When the vehicle moved as nothing known explains, and as if what, and what a force that is left depends
    on; empty where there is neither."""
    motions = [e for e in result.events if e.unexplained]
    said = f" {depends(result.dependence)}" if result.dependence is not None else ""
    if not motions:
        return said
    times = [f"in {e.run} from {e.start:.1f} to {e.end:.1f} s" for e in motions]
    alike = [f" In {e.run} it moves then {look}." for e in motions[:MOST_RUNS] if (look := _as_if(e))]
    first = f" No known effect explains how the vehicle moves {first_few(times, MOST_RUNS)}."
    opening = [e.run for e in motions if e.opens and e.stuck is None]
    begun = (
        f" {first_few(opening, MOST_RUNS)} {'begins' if len(opening) == 1 else 'begin'} with it: a run is "
        "simulated as if its first orders had long been followed; where they were given just as the log "
        "begins, that alone looks like this, and a log should begin some seconds earlier."
    )
    return first + "".join(alike) + (begun if opening else "") + said


def depends(found: Dependence) -> str:
    """What a force that is left depends on, as a sentence; a force of the motion, of any shape, is taken
    first, so that the size is the least it is."""
    size = f"at least {found.size:.0%}" if found.acts == "hull" else f"at least {_newton(found.size)}"
    if found.on == "period":
        swings = "a swell" if found.scale < OF_A_SWELL else "water that swings slowly"
        return (
            f"A force with a period of {found.scale:.3g} s acts, {size} (rms), as {swings} would give; "
            f"{NOTHING}."
        )
    over = f"over about {number(found.scale)} m"
    if found.acts == "hull":
        return (
            f"The hull's forces change from place to place by {size} (rms), {over}, as over an uneven "
            f"bottom; {NOTHING}."
        )
    return (
        f"A force of {size} (rms), whatever the heading, changes from place to place, {over}, as in a "
        f"current that differs; {NOTHING}."
    )


def where_to_look(found: Dependence) -> str:
    """What to do next about it."""
    own = "; a cause of your own is declared in a file and tried with `--effects FILE`"
    if found.on == "period":
        return f"See whether the sea or the basin had that period, or something aboard has it{own}."
    return (
        f"Compare with the depth, the banks and the current along the tracks, or repeat a run elsewhere{own}."
    )


def _newton(force: float) -> str:
    """A force as people say it."""
    power = next((p for p in (6, 3) if force >= 10.0**p), 0)
    return f"{number(force / 10.0**power)} {({6: 'MN', 3: 'kN', 0: 'N'})[power]}"


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
