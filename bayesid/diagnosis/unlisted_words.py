"""The sentence of a verdict that something acts which is not in the list of effects.

Takes a `Result`. Does not compute or draw.
"""

from __future__ import annotations

from bayesid.diagnosis.cannot_tell import MOST_RIVALS
from bayesid.diagnosis.event_words import rudder_off, unexplained
from bayesid.diagnosis.failed_checks import explanation
from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, OUTSIDE_SAID, UNLISTED_AMONG
from bayesid.diagnosis.plain_words import in_words, probability
from bayesid.diagnosis.result import Result
from bayesid.words import first_few

PLACES = {
    "X": "the force ahead", "Y": "the side force", "N": "the turning moment", "Z": "the vertical force",
    "M": "the pitching moment", "K": "the heeling moment", "Y+N": "side force and turning moment",
    "X+Y+N": "all forces", "rudder": "the rudder's angle", "current": "moving water",
    "rpm": "the propeller's revolutions", "psi": "the heading reading", "r": "the yaw-rate reading",
    "u,v": "the velocity reading", "x,y": "the position reading",
}  # fmt: skip


def unlisted(result: Result) -> str:
    """What acts that is not among the known effects, where and when."""
    if result.rule in OUTSIDE_SAID:
        known = [in_words(n) for n in result.set95 if n not in ("none", "outside", "model_form")]
        also = f" What may act beside it: {first_few(known, MOST_RIVALS)}." if known else ""
        return unexplained(result).strip() + also
    place = result.where.channel
    if result.rule in UNLISTED_AMONG:  # of what the others leave
        place = next(iter(result.where.after), place)
    stretch = _stretch(result) if place == result.where.channel else ""  # it is of the search without effects
    where = f"{f', in {PLACES.get(place, place)}' if place is not None else ''}{stretch}"
    if result.rule != LEFT_OUT_WORSE:
        sure = f" (probability {probability(result.acting.get('outside', 1.0))})"
        return f"Something acts that is not among the known effects{sure}{where}." + unexplained(result)
    best = " + ".join(in_words(n) for n in explanation(result))
    return (
        f"No known effect explains these runs, alone or with another{where}. The best explanation, "
        f"{best}, predicts each run, left out of the estimate, worse than the simulator as given does, "
        "and the runs disagree about its size." + unexplained(result)
    )


def _stretch(result: Result) -> str:
    """In which run and when something acts that has one, and by how much a rudder is then off."""
    place, found = result.where.channel, result.where.stretch
    if found is None or place != next(iter(result.where.evidence), None):
        return ""
    when = f", only in {found.run} from {found.start:.0f} to {found.end:.0f} s"
    if place != "rudder" or found.value is None or found.sd is None:
        return when
    return f"{when}, {rudder_off('it', found.value, found.sd)}"
