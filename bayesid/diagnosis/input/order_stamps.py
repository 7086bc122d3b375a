"""Orders that change between two stamps of the log: found by a diagnosis, and read as much earlier.

Takes trials and a diagnosis. Gives trials and words. Fits two hypotheses beside the best of the diagnosis.

A logger writes the order that stands when it writes. One that changed since the stamp before has acted for up
to a step by then; read as if it changed at its stamp, the vehicle answers before it is told to. On an AUV
logged at 5 Hz that is 1200 nats for a rudder that acts 0.13 s too early, and fits that make the inertia
negative to follow. In the mean it is half a step where orders change at any time, less where they change at
steps of their own.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bayesid.diagnosis.hypotheses.facts import simplest
from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.hypotheses.refit import refit
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.model.effects import Effect
from bayesid.trials import Trial
from bayesid.trials.correction import CORRECTED, MOSTLY, UNEVEN, Correction, apply

if TYPE_CHECKING:
    from bayesid.diagnosis.run import Diagnosis


def step_of(logged: Trial) -> float | None:
    """Time between two rows of the log [s]; None where runs differ, or rows of one, or where it is said when
    orders act."""
    if any(
        text.startswith(CORRECTED) and "late" in text and any(name in text for name in run.commands)
        for run in logged.runs
        for text in run.provenance
    ):
        return None
    steps = [float(np.median(np.diff(run.t))) for run in logged.identify]
    even = all(
        np.mean(np.abs(np.diff(run.t) - steps[0]) < UNEVEN * steps[0]) > MOSTLY for run in logged.identify
    )
    return steps[0] if even else None


def acts_before_its_stamp(found: Diagnosis) -> float:
    """Time [s] by which an order acts clearly before it is logged, in a refit that is better than none by
    more than refits scatter, or else beside the best explanation; 0 where none does, NaN where one does that
    did not arrive, whose size is none.

    There what has a rudder follow late, or not at all, is taken out before: a lag explains much of what an
    order does that is known at the stamps only.
    """
    return _in_refits(found) or _beside_the_best(found)


def _in_refits(found: Diagnosis) -> float:
    candidates, effects = found.candidates, found.model.effects
    least, early = candidates.none.fit.log_evidence + LINEARISATION_SCATTER, 0.0
    for c in candidates.refits:
        told = dict(zip(c.fit.free.names, zip(c.fit.values, c.fit.sd, strict=True), strict=True))
        for effect in (effects[n] for n in c.effects if n in effects):
            delays = [told[key] for key in _delays(effect) if key in told]
            clear = [-value for value, sd in delays if value + TWO_SIDED_95 * sd < 0.0]
            if clear and c.fit.log_evidence > least:
                least, early = c.fit.log_evidence, max(clear) if c.fit.converged else math.nan
    return float(early)


def _delays(effect: Effect) -> list[str]:
    """Parameters that are delays of orders."""
    return [effect.key(stage.delay) for stage in effect.stages if stage.delay is not None]


def _beside_the_best(found: Diagnosis) -> float:
    effects = found.model.effects
    there = [effects[n] for n in simplest(found.candidates).effects if n in effects]
    kept = tuple(e for e in there if e.smooth or e.port != "input")
    base, early = _fitted(found, kept), 0.0
    for effect in effects.values() if base is not None else ():
        delays = _delays(effect)
        more = _fitted(found, (*kept, effect)) if delays and effect not in kept else None
        if base is None or more is None or not more.converged:
            continue
        at = more.free.names.index(delays[0])
        clear = more.values[at] + TWO_SIDED_95 * more.sd[at] < 0.0
        if clear and more.log_evidence > base.log_evidence + LINEARISATION_SCATTER:
            early = max(early, -float(more.values[at]))
    return early


def _fitted(found: Diagnosis, effects: tuple[Effect, ...]) -> FilterErrorFit | None:
    """The fit of some effects, made anew where the diagnosis has none; None where it cannot be made."""
    names, candidates = {e.name for e in effects}, found.candidates
    known = [c for c in (candidates.none, *candidates.refits) if set(c.effects) == names]
    known = known or refit(found.problem, effects, lambda text: None)
    return max((c.fit for c in known), key=lambda f: (f.converged, f.log_evidence), default=None)


def between_stamps(logged: Trial, step: float, early: float) -> tuple[Trial, str]:
    """The log with all orders earlier by as much as one acts, at most a step, half a step where that is not
    known (NaN), and the line for `trial.toml` that says so."""
    names = sorted({name for run in logged.runs for name in run.commands})
    sooner = float(f"{earlier_by(step, early):.3g}")
    late = Correction(late=dict.fromkeys(names, sooner))
    runs = tuple(
        apply(replace(late, late={n: s for n, s in late.late.items() if n in run.commands}), run)
        for run in logged.runs
    )
    lines = "; ".join(late.lines())
    text = (
        f"the vehicle answers before its orders are logged: they change between stamps, {step:.3g} s apart, "
        f"and are read {sooner:g} s earlier ([corrections] {lines} in trial.toml says so for good, to "
        "predictions as well)"
    )
    return replace(logged, runs=runs), text


def earlier_by(step: float, early: float) -> float:
    """Time [s] by which orders are read earlier: as one acts, at most a step; half a step for NaN."""
    return 0.5 * step if math.isnan(early) else min(early, step)


def same_readings(one: Trial, other: Trial) -> bool:
    """Whether two trials hold as many readings of each channel, so that evidence of both compares."""

    def counts(trial: Trial) -> list[dict[str, int]]:
        return [{n: int(np.isfinite(v).sum()) for n, v in run.data.items()} for run in trial.identify]

    return counts(one) == counts(other)


def better(one: Diagnosis, other: Diagnosis) -> bool:
    """Whether the best explanation of the second is better by more than refits scatter, or no worse than that
    by fewer effects: that a log holds orders at its stamps only is nothing to explain. A second that calls
    for something outside the list has to be better."""
    before, after = (
        max(c.log_evidence for c in (d.candidates.none, *d.candidates.refits)) for d in (one, other)
    )
    fewer = len(simplest(other.candidates).effects) < len(simplest(one.candidates).effects)
    tie = fewer and other.verdict.word != "outside"
    return after > before + (-LINEARISATION_SCATTER if tie else LINEARISATION_SCATTER)
