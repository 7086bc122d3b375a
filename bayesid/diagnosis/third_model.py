"""What the third model of an answer is: the explanation, or what predicts in its place and why.

Takes a `Result`. Gives labels and sentences. Does not choose the model (`evidence.explained_model` does).
"""

from __future__ import annotations

import math

from bayesid.diagnosis.failed_checks import explanation
from bayesid.diagnosis.hypotheses.rules import NAMING
from bayesid.diagnosis.moved_words import retuned
from bayesid.diagnosis.plain_words import in_words
from bayesid.diagnosis.result import Result

AS_GIVEN = "as given, nothing added"  # the third model where it is the first one
RE_TUNED = "re-tuned, nothing added"  # and where it is the second


def in_its_place(result: Result) -> str:
    """Label of what predicts in place of the explanation; empty where that predicts."""
    if coefficients_alone(result):
        return RE_TUNED
    return AS_GIVEN if as_given(result) else ""


def coefficients_alone(result: Result) -> bool:
    """Whether the third model is the re-tuned one, without the effects of the explanation."""
    return result.retuning is not None and result.retuning.alone


def explained_words(result: Result) -> str:
    """What the third model is: with what is named, or with the best explanation, which may be another."""
    return " ".join([_explained(result), *_as_stated(result)])


def _as_stated(result: Result) -> list[str]:
    """That the third model has the coefficients as given, and why; nothing where they are re-tuned."""
    if result.retuning is None:
        return []
    if result.retuning.alone:
        return [_better_alone(result.retuning.alone_gain or 0.0, result.retuning.alone_error or 0.0)]
    if retuned(result):
        return []
    if result.retuning.as_given:
        return [_worse_left_out(result.retuning.given_gain or 0.0, result.retuning.given_error or 0.0)]
    gain, error = result.retuning.gain or 0.0, result.retuning.error or 0.0
    if not error:  # the most that is counted of a ratio: in every run beyond it, or diverging
        return ["Its coefficients are as given: runs left out are lost with re-tuned ones."]
    low, times, high = (math.exp(x - gain) for x in (-error, 0.0, error))
    return [
        "Its coefficients are as given: that re-tuned ones predict runs left out better is not sure "
        f"(errors {times:.2g} times as large, one standard error {low:.2g} to {high:.2g})."
    ]


def _worse_left_out(gain: float, error: float) -> str:
    """Why an explanation does not predict."""
    if not error:
        return "With it runs left out are lost."
    times, least, most = (math.exp(x - gain) for x in (0.0, -error, error))
    worse = gain < -error
    said = "It predicts runs left out worse" if worse else "That it predicts runs left out better is not sure"
    return f"{said} (errors {times:.2g} times as large, one standard error {least:.2g} to {most:.2g})."


def _better_alone(gain: float, error: float) -> str:
    """Why re-tuned coefficients predict, and no explanation."""
    if not error:
        return "With coefficients as given runs left out are lost."
    times, least, most = (math.exp(x - gain) for x in (0.0, -error, error))
    return (
        "They predict runs left out better than what has them as given, with it or without (errors "
        f"{times:.2g} times as large, one standard error {least:.2g} to {most:.2g})."
    )


def as_given(result: Result) -> bool:
    """Whether the third model is the one as given: no effect or coefficients alone, not re-tuned, or an
    explanation that does not predict runs left out better."""
    if result.retuning is None or retuned(result):
        return False
    used = explanation(result)
    return result.retuning.as_given or all(n.startswith("coefficient_error") for n in used)


def _explained(result: Result) -> str:
    used = explanation(result)
    if result.model_form is not None and result.verdict == "model_form" and not used and retuned(result):
        return "Re-tuned and explained are one: with the force that the equations lack, no cause beside it."
    if not used:
        without = " nor the force that the equations lack" if result.verdict == "model_form" else ""
        return f"Explained: {'as re-tuned' if retuned(result) else 'as given'}, no effect{without} is in it."
    words = " + ".join(in_words(n) for n in used)
    if coefficients_alone(result):
        return f"Explained: coefficients re-tuned alone; the best explanation, {words}, is not in it."
    if as_given(result):
        return f"Explained: the simulator as given; the best explanation, {words}, is not in it."
    if result.verdict == "model_form":
        return f"Explained: with {words}, which may stand for the force that the equations lack."
    if result.verdict in NAMING and set(used) == {e.name for e in result.effects}:
        return f"Explained: with {words}."
    return f"Explained: with {words}, the best explanation."
