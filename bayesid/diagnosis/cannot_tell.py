"""The answer of a diagnosis whose runs cannot tell: what is possible, one of several or several at once.

Takes a `Result`. Gives sentences. Does not decide.
"""

from __future__ import annotations

from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR
from bayesid.diagnosis.hypotheses.rules import (
    CAUSE_OR_FORM,
    LACKS_PROBABILITY,
    LEEWAY,
    REFUTED,
    TURNS_BY_ITSELF,
)
from bayesid.diagnosis.plain_words import in_words, lowered, probability, sentence, size_words
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.result_parts import Effect
from bayesid.diagnosis.threshold_table import EVEN_ODDS, NAMING_PROBABILITY
from bayesid.diagnosis.unnamed_words import WHY
from bayesid.model.effects import CATALOGUE
from bayesid.places import Places
from bayesid.words import and_list

# Possible causes that are told, and the probability of two together from which they are told so.
MOST_RIVALS, POSSIBLE = 4, 0.05
# Hypotheses from this probability on are named as what else it could be.
WORTH_A_WORD = 0.01
SIZELESS = ("size", "range")  # why an effect is not named, of those whose size may as well be none


def cannot_tell(result: Result) -> str:
    """First sentence of a diagnosis that is ambiguous."""
    chances = _chances(result)
    listed = ", ".join(_sized(result, n, p) for n, p in chances)
    nothing = "none" in result.set95
    if not chances:
        return "These runs cannot tell whether anything acts."
    if result.rule == CAUSE_OR_FORM:
        known = [_outside(n) for n, _ in chances if n != "outside"]
        also = f" What may act beside it: {', '.join(known)}." if known else ""
        return (
            "Something acts that is not among the known effects, or the equations lack a force that depends "
            f"on the motion: these runs cannot tell.{also}"
        )
    if told := withdrawn(result):
        said = and_list(f"{lowered(sentence(e).rstrip('.'))} ({probability(e.probability)})" for e in told)
        it = "it is" if len(told) == 1 else "they are"
        return (
            f"By the identification runs, {said}, but held-out runs are predicted worse so than with "
            f"re-tuned coefficients: {it} not named."
        )
    if result.rule == TURNS_BY_ITSELF:  # probabilities know nothing of that
        seeming = [e.name for e in result.effects[:1]]
        others = ", ".join(_outside(n) for n, _ in chances if n not in (*seeming, "outside"))
        return (
            "Every run turns to one side with the rudder amidships, which "
            f"{' and '.join(map(in_words, seeming)) or 'the best explanation'} does not explain: "
            f"{others + ' or ' if others else ''}something else may be behind both."
        )
    alone = f", or nothing at all ({probability(result.probabilities.get('none', 0.0))})" if nothing else ""
    if "model_form" in result.set95:
        alone = ", or only a force that depends on the motion and that the equations lack " + (
            f"({probability(result.probabilities.get('model_form', 0.0))})"
        )
    pairs = "; two of them may act together" if len(chances) > 1 and result.together > POSSIBLE else ""
    if (
        result.rule == LEEWAY
        and (compass := next((e for e in result.effects if e.parameters), None)) is not None
    ):
        return (
            f"Either {lowered(sentence(compass).rstrip('.'))}, or a constant side force pushes the vehicle "
            "aside: without a reading of the velocity across (v) both look the same."
        )
    if (first := leading_cause(result)) is not None:
        said = f"{lowered(sentence(first).rstrip('.'))} ({probability(chances[0][1])})"
        others = ", ".join(_sized(result, n, p) for n, p in chances[1:])
        rest = others + (alone if others else alone.removeprefix(", or "))
        return f"More likely than not {said}; these runs do not exclude {rest}{pairs}."
    if len(chances) == 1:
        return f"These runs cannot tell whether it is {listed}{alone or ' or something else'}."
    if held_back(result):
        return _act_unnamed(result, chances, alone)
    if result.together > EVEN_ODDS and (first := only_sized(result)) is not None:
        others = and_list(_outside(n) for n, _ in chances if n != first.name)
        said = f"{lowered(sentence(first).rstrip('.'))} ({probability(dict(chances)[first.name])})"
        beside = f"what acts beside it is not told: the size of {others} may be none"
        return f"More likely than not {said}; {beside}{alone}."
    if result.together > EVEN_ODDS:
        return f"Several things act together and these runs cannot tell which: {listed}{alone}."
    return f"These runs cannot tell which it is: {listed}{alone}{pairs}."


def withdrawn(result: Result) -> list[Effect]:
    """What was named before held-out runs were read and is predicted worse with; nothing elsewhere."""
    return [e for e in result.effects if e.parameters] if result.rule == REFUTED else []


def only_sized(result: Result) -> Effect | None:
    """Of several causes that act together the only one whose size is told from none, where it is more
    probable than not."""
    chances = dict(_chances(result))
    sized = [n for n in chances if result.unnamed.get(n) not in SIZELESS]
    if len(sized) != 1 or len(chances) < 2 or not chances[sized[0]] > EVEN_ODDS:
        return None
    return next((e for e in result.effects if e.name == sized[0] and e.parameters), None)


def held_back(result: Result) -> bool:
    """Whether several causes act and some have the probability of a name, yet none for another reason."""
    reasons = (result.unnamed.get(n) for n, p in _chances(result) if p >= NAMING_PROBABILITY)
    return result.together > EVEN_ODDS and any(why not in (None, "probability") for why in reasons)


def _act_unnamed(result: Result, chances: list[tuple[str, float]], alone: str) -> str:
    """That causes act together by their probabilities, and why each is not named nevertheless."""
    acting = [(n, p) for n, p in chances if p > EVEN_ODDS]
    others = [_sized(result, n, p) for n, p in chances if p <= EVEN_ODDS]
    by_reason: dict[str, list[str]] = {}
    for name, p in acting:
        why = result.unnamed.get(name, "probability" if p < NAMING_PROBABILITY else None)
        if why is not None:
            by_reason.setdefault(WHY[why], []).append(_outside(name))
    one = len(by_reason) == 1 and len(acting) == sum(map(len, by_reason.values())) > 1
    reasons = "; ".join(
        f"of {'each' if one else and_list(names)}, {words}" for words, names in by_reason.items()
    )
    none = {1: "it is not", 2: "neither is"}.get(len(acting), "none of them is")
    also = f" Beside them may act: {', '.join(others)}." if others else ""
    return (
        f"By their probabilities {and_list(_sized(result, n, p) for n, p in acting)} "
        f"act{'s' if len(acting) == 1 else ' together'}{alone}, but {none} named as a cause: {reasons}.{also}"
    )


def to_tell_apart(result: Result, places: Places) -> str:
    """Where no manoeuvre is proposed, the command that plans one to tell the possible causes apart; else
    empty."""
    known = {e.name for e in CATALOGUE}
    names = [n for n, _ in _chances(result) if n not in ("outside", COEFFICIENT_ERROR)]
    own = bool(places.effects) and not known.issuperset(names)  # `design` takes no file of effects
    if result.verdict != "ambiguous" or result.next_manoeuvre or len(names) < 2 or own:
        return ""
    if not result.trial.steers:
        return (
            f"To tell {and_list(map(in_words, names))} apart, order actuators by tables of your own, each "
            "alone and against the others, at several revolutions: manoeuvres are designed for rudders only."
        )
    command = f"`bayesid design {places.fitted} --tell {','.join(names)}`"
    why = (
        "No manoeuvre of the library was found that tells these causes apart"
        if result.next_asked
        else "No manoeuvre was planned, as `--quick` asks"
    )
    return f"{why}: {command} looks for one that tells {and_list(map(in_words, names))} apart."


def leading_cause(result: Result) -> Effect | None:
    """The first of several possible causes where it is more probable than all else together, has a size,
    lacks probability alone, and two causes at once are less probable than one."""
    chances = _chances(result)
    name = chances[0][0] if chances else ""
    sure = result.probabilities.get(name, 0.0) > EVEN_ODDS >= result.together
    if result.rule not in LACKS_PROBABILITY or not sure:
        return None
    rest = len(chances) > 1 or {"none", "model_form"} & set(result.set95)
    return next((e for e in result.effects if rest and e.name == name and e.parameters), None)


def _chances(result: Result) -> list[tuple[str, float]]:
    """Possible causes of the 95 % set, most probable first: their shares, or where several may act together
    the probability that each acts."""
    causes = [n for n in result.set95 if n not in ("none", "model_form")]
    told = result.acting if result.together > POSSIBLE else result.probabilities
    # what stands for a coefficient beside another cause has a sentence of its own
    apart = {s.effect.name for s in result.in_place_of if s.certain}
    apart |= {COEFFICIENT_ERROR} if apart else set()
    causes = [n for n in causes if n not in apart or told.get(n, 0.0) >= WORTH_A_WORD]
    return sorted(((n, told.get(n, 0.0)) for n in causes), key=lambda c: -c[1])[:MOST_RIVALS]


def _sized(result: Result, name: str, p: float) -> str:
    """ "actuator lag (0.45; 0.21 seconds)": a possible cause, how probable, and its size unless several act
    together (it is that of a cause that acts alone)."""
    effect = next((e for e in result.effects if e.name == name and e.parameters), None)
    size = size_words(effect) if effect is not None and result.together <= EVEN_ODDS else ""
    return f"{_outside(name)} ({probability(p)}{f'; {size}' if size else ''})"


def _outside(name: str) -> str:
    return "something not on the list" if name == "outside" else in_words(name)
