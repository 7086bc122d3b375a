"""What events say: evidence of a cause outside the hypotheses, and a verdict that knows of them.

Takes the `Event`s left out of a trial and the hypotheses, or the verdict, of the rest. Gives both with the
events counted. Does not look for events.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.form_stage import Compared
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.form_part import beyond
from bayesid.diagnosis.hypotheses.probabilities import probabilities
from bayesid.diagnosis.hypotheses.rules import (
    MOTION_EVENT,
    OTHER_DEPENDENCE,
    UNLISTED_AMONG,
    nobody_needs,
)
from bayesid.diagnosis.hypotheses.verdict import Verdict, decide, simplest


def with_events(
    candidates: HypothesisComparison, events: Sequence[Event], dependence: Dependence | None = None
) -> HypothesisComparison:
    """Candidates of the rest of the trial, with what events of motion, and a force that depends on more than
    the motion, say for a cause outside added."""
    gain = _motion_gain(events, candidates) + (dependence.alone if dependence is not None else 0.0)
    if gain <= max(candidates.evidence["outside"], 0.0):  # no motion says nothing
        return candidates
    evidence = candidates.evidence | {"outside": gain}
    weights = probabilities(evidence, candidates.refits, candidates.none, candidates.where)
    explained = simplest(candidates).log_evidence - candidates.none.log_evidence
    if explained > candidates.thresholds.named and (dependence is None or gain <= explained):
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

    Brief ones gained beside it, or more than it; actuators that stuck, in refits with it.
    """
    gross = sum(e.evidence for e in events if e.kind == "motion" and not e.brief)
    others = sum(e.evidence for e in events if e.unexplained and (e.brief or e.kind == "stuck"))
    return beyond(gross, rest.carried) + others


def verdict_with(
    verdict: Verdict,
    events: Sequence[Event],
    rest: HypothesisComparison,
    dependence: Dependence | None = None,
) -> Verdict:
    """Verdict that knows of events, and of a force that does not depend on the motion: what nothing explains
    is a gap, though it did not last.

    It is the greater part of the gap where it says more than the effects explain, which are then no more than
    possible; else it is what a named effect leaves. Other coefficients stand beside a brief event that says
    less, but not beside a gross one or an actuator that stuck for long, which was judged against any of them;
    a force that the equations lack is no cause and gives way.

    Parameters
    ----------
    rest : hypotheses of the trial without the events
    """
    if events:
        listed = [f"{e.run} {e.start:.1f} to {e.end:.1f} s ({e.channel}, {e.kind})" for e in events]
        verdict = replace(
            verdict,
            reasons=(*verdict.reasons, "left out as events, or with an order held: " + "; ".join(listed)),
        )
    motions, best = [e for e in events if e.unexplained], simplest(rest)
    unneeded = nobody_needs(verdict.word, verdict.rule)
    if dependence is not None and dependence.alone == 0.0 and unneeded:
        dependence = None  # told beside an effect that nobody needs, and not without it
    sure = verdict.word == "outside" and verdict.rule not in UNLISTED_AMONG  # what follows says more of that
    if sure or (dependence is None and not motions):
        return verdict
    moved, gain = _motion_gain(motions, rest), max(best.log_evidence - rest.none.log_evidence, 0.0)
    placed = dependence.alone if dependence is not None else 0.0
    rule = MOTION_EVENT if motions and moved >= placed else OTHER_DEPENDENCE
    moved += placed
    greater = moved > gain or any(not e.brief for e in motions)
    silent = unneeded or (verdict.word == "coefficients" and greater)
    if silent or verdict.set95 == ("outside",):
        return replace(verdict, word="outside", effects=(), set95=("outside",), rule=rule)
    told = [f"motions that nothing explains say +{moved - placed:.1f}"] if motions else []
    if dependence is not None:
        beside = f"+{dependence.evidence:.1f} beside the best explanation"
        told.append(f"a force with the place or a period says +{placed:.1f} without any effect and {beside}")
    said = f"{', '.join(told)}, the best explanation of the rest +{gain:.1f}"
    before = f"{said}; before they were counted the verdict was {verdict.word} ({verdict.rule})"
    reasons = (*verdict.reasons, before)
    possible = tuple(n for n in verdict.set95 if n not in ("none", "outside"))
    if moved > gain:
        return replace(
            verdict, word="outside", effects=(), set95=("outside", *possible), reasons=reasons, rule=rule
        )
    if verdict.word == "effect":
        return replace(verdict, word="effect_with_remainder", reasons=reasons)
    if verdict.word == "ambiguous" and dependence is not None and "outside" not in verdict.set95:
        verdict = replace(verdict, set95=(*verdict.set95, "outside"))
    return replace(verdict, reasons=reasons)


def verdict_of(compared: Compared) -> Verdict:
    """Verdict on compared hypotheses, events counted, before any run is left out or held out."""
    problem, candidates = compared.problem, compared.candidates
    decided = decide(problem, candidates, compared.over_motion)
    return verdict_with(decided, problem.events, candidates, compared.dependence)
