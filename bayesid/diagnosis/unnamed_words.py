"""What the explanation of a diagnosis has beside the effects that are named, and why those are not.

Takes a `Result`. The reason is the one the verdict was decided with, not the probability told beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR
from bayesid.diagnosis.hypotheses.facts import Unnamed
from bayesid.diagnosis.hypotheses.rules import NO_SIZE_BESIDE_FORM
from bayesid.diagnosis.plain_words import in_words, probability
from bayesid.diagnosis.result import Result
from bayesid.diagnosis.threshold_table import EVEN_ODDS, NAMING_PROBABILITY
from bayesid.words import and_list

WHY: dict[Unnamed, str] = {
    "range": "its size is out of the range in which it is one",
    "size": "its size, as wide as runs and explanations differ about it, is not told from none",
    "leeway": "the leeway of a constant side force reads the same",
    "form": "it is no more than what the force the equations lack may leave",
    "remainder": "what is left unexplained is a large part of what it explains",
    "probability": f"a name asks for {NAMING_PROBABILITY:.2f}",
}


def unnamed_words(result: Result, names: Sequence[str]) -> str:
    """A sentence on these effects of the explanation; empty without one."""
    told = []
    for name in names:
        p = result.acting.get(name, 0.0)
        why = result.unnamed.get(name, "probability" if p < NAMING_PROBABILITY else None)
        told.append(
            f"{in_words(name)} ({probability(p)} that it acts), not named"
            + (f": {WHY[why]}" if why is not None else "")
        )
    return f"The explanation also has {'; '.join(told)}." if told else ""


def beside_a_form(result: Result) -> str:
    """What probably acts beside a force the equations lack, and why it is no name; that nothing can be told
    beside it where nothing is that probable.
    """
    none = ("none", "outside", "model_form", COEFFICIENT_ERROR)
    likely = {n: result.acting.get(n, 0.0) for n in result.set95 if n not in none}
    told = {n: p for n, p in likely.items() if p >= EVEN_ODDS}
    if not told:
        return "no cause beside it can be told"
    usual: Unnamed = "size" if result.rule == NO_SIZE_BESIDE_FORM else "form"
    why = {n: WHY[result.unnamed.get(n, usual)] for n in told}
    said = and_list(f"{in_words(n)} ({probability(p)})" for n, p in told.items())
    if len(set(why.values())) == 1:
        of = "of each, " if len(told) > 1 else ""
        return f"{said} may act beside it, not named: {of}{next(iter(why.values()))}"
    return f"{said} may act beside it, not named: " + "; ".join(
        f"of {in_words(n)}, {w}" for n, w in why.items()
    )
