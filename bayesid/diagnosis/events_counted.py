"""What events say: evidence of a cause outside the hypotheses, and a verdict that knows of them.

Takes the `Event`s left out of a trial and the hypotheses, or the verdict, of the rest. Gives both with the
events counted. Does not look for events.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.form_part import beyond
from bayesid.diagnosis.hypotheses.probabilities import probabilities
from bayesid.diagnosis.hypotheses.rules import MOTION_EVENT
from bayesid.diagnosis.hypotheses.verdict import Verdict, decide, simplest


def with_events(candidates: HypothesisComparison, events: Sequence[Event]) -> HypothesisComparison:
    """Candidates of the rest of the trial, with what events of motion say for a cause outside added."""
    gain = _motion_gain(events, candidates)
    if gain <= max(candidates.evidence["outside"], 0.0):  # no motion says nothing
        return candidates
    evidence = candidates.evidence | {"outside": gain}
    weights = probabilities(evidence, candidates.refits, candidates.none, candidates.where)
    if simplest(candidates).log_evidence > candidates.none.log_evidence + candidates.thresholds.named:
        # an effect stands on the rest of the trial; the event is a second cause and takes nothing from it
        return replace(candidates, evidence=evidence)
    return replace(
        candidates,
        evidence=evidence,
        probabilities=weights.shared,
        inside=weights.inside,
        sets=weights.sets,
    )


def _motion_gain(events: Sequence[Event], rest: HypothesisComparison) -> float:
    """What events of motion say for a cause outside, beyond what a model form carries [nats].

    Brief ones gained beside it, or more than it.
    """
    motions = [e for e in events if e.kind == "motion"]
    gross = sum(e.evidence for e in motions if not e.brief)
    return beyond(gross, rest.carried) + sum(e.evidence for e in motions if e.brief)


def verdict_with(verdict: Verdict, events: Sequence[Event], rest: HypothesisComparison) -> Verdict:
    """Verdict that knows of events: a motion nothing explains is a gap, though it did not last.

    It is the greater part of the gap where it says more than the effects explain, which are then no more than
    possible; else it is what a named effect leaves. Other coefficients stand beside a brief one that says
    less; a force that the equations lack is no cause and gives way.

    Parameters
    ----------
    rest : hypotheses of the trial without the events
    """
    if not events:
        return verdict
    listed = [f"{e.run} {e.start:.1f} to {e.end:.1f} s ({e.channel}, {e.kind})" for e in events]
    reasons = (*verdict.reasons, "left out as events: " + "; ".join(listed))
    motions, best = [e for e in events if e.kind == "motion"], simplest(rest)
    moved, gain = _motion_gain(motions, rest), max(best.log_evidence - rest.none.log_evidence, 0.0)
    greater = moved > gain or any(not e.brief for e in motions)
    silent = verdict.word in ("none", "model_form") or (verdict.word == "coefficients" and greater)
    if not motions or verdict.word == "outside":
        return replace(verdict, reasons=reasons)
    if silent or verdict.set95 == ("outside",):
        return replace(
            verdict, word="outside", effects=(), set95=("outside",), reasons=reasons, rule=MOTION_EVENT
        )
    said = f"motions that nothing explains say +{moved:.1f}, the best explanation of the rest +{gain:.1f}"
    reasons = (*reasons, f"{said}; before they were counted the verdict was {verdict.word} ({verdict.rule})")
    if moved > gain:
        possible = (n for n in verdict.set95 if n not in ("none", "outside"))
        return replace(
            verdict, word="outside", effects=(), set95=("outside", *possible), reasons=reasons,
            rule=MOTION_EVENT,
        )  # fmt: skip
    if verdict.word == "effect":
        return replace(verdict, word="effect_with_remainder", reasons=reasons)
    return replace(verdict, reasons=reasons)


def verdict_of(compared: Compared) -> Verdict:
    """Verdict on compared hypotheses, events counted, before any run is left out or held out."""
    problem, candidates = compared.problem, compared.candidates
    return verdict_with(decide(problem, candidates), problem.events, candidates)
