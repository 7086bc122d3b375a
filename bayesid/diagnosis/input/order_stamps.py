"""Orders that change between two stamps of the log: found by a diagnosis, and read half a step earlier.

Takes trials and a diagnosis. Gives trials and words. Fits nothing.

A logger writes the order that stands when it writes. One that changed since the stamp before has acted for up
to a step by then, half a step in the mean; read as if it changed at its stamp, the vehicle answers before it
is told to. On an AUV logged at 5 Hz that is 1200 nats for a rudder that acts 0.13 s too early, and fits that
make the inertia negative to follow.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.threshold_table import LINEARISATION_SCATTER
from bayesid.trials import Trial
from bayesid.trials.correction import Correction, apply

if TYPE_CHECKING:
    from bayesid.diagnosis.run import Diagnosis


# Part of a step by which rows may lie off it, and part of the rows that may not.
UNEVEN, MOSTLY = 0.1, 0.9


def step_of(logged: Trial) -> float | None:
    """Time between two rows of the log [s]; None where runs differ, or rows of one."""
    steps = [float(np.median(np.diff(run.t))) for run in logged.identify]
    even = all(
        np.mean(np.abs(np.diff(run.t) - steps[0]) < UNEVEN * steps[0]) > MOSTLY for run in logged.identify
    )
    return steps[0] if even else None


def acts_before_its_stamp(found: Diagnosis) -> bool:
    """Whether an order acts clearly before it is logged, in an explanation that is better than none by more
    than refits scatter."""
    candidates, effects = found.candidates, found.model.effects
    least = candidates.none.log_evidence + LINEARISATION_SCATTER
    for c in candidates.refits:
        fit = c.fit
        latest = dict(zip(fit.free.names, fit.values + TWO_SIDED_95 * fit.sd, strict=True))
        for effect in (effects[n] for n in c.effects if n in effects):
            delays = [stage.delay for stage in effect.stages if stage.delay is not None]
            if c.log_evidence > least and any(latest.get(effect.key(d), 0.0) < 0.0 for d in delays):
                return True
    return False


def between_stamps(logged: Trial, step: float) -> tuple[Trial, str]:
    """The log with all orders half a step earlier, and the line for `trial.toml` that says so."""
    names = sorted({name for run in logged.runs for name in run.commands})
    late = Correction(late=dict.fromkeys(names, float(f"{0.5 * step:.3g}")))
    runs = tuple(
        apply(replace(late, late={n: s for n, s in late.late.items() if n in run.commands}), run)
        for run in logged.runs
    )
    lines = "; ".join(late.lines())
    text = (
        f"the vehicle answers before its orders are logged: they change between stamps, {step:.3g} s apart, "
        f"and are read half of that earlier ([corrections] {lines} in trial.toml says so for "
        "good, to predictions as well)"
    )
    return replace(logged, runs=runs), text


def same_readings(one: Trial, other: Trial) -> bool:
    """Whether two trials hold as many readings of each channel, so that evidence of both compares."""

    def counts(trial: Trial) -> list[dict[str, int]]:
        return [{n: int(np.isfinite(v).sum()) for n, v in run.data.items()} for run in trial.identify]

    return counts(one) == counts(other)


def better(one: Diagnosis, other: Diagnosis) -> bool:
    """Whether the best explanation of the second is better by more than refits scatter."""
    before, after = (
        max(c.log_evidence for c in (d.candidates.none, *d.candidates.refits)) for d in (one, other)
    )
    return after > before + LINEARISATION_SCATTER
