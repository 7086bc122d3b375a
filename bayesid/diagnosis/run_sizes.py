"""Sizes of the best explanation run by run: by how much they differ, and whether a run may be without it.

Takes a problem and a refit. Gives frozen `RunSizes`. Fits nothing: the normal equations of the runs tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.cross_validation import between_runs, of_single_runs
from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.result_parts import Estimate
from bayesid.diagnosis.schema import About

Array = np.ndarray
EXCLUDED = 3.0  # own standard deviations of a run from which on it excludes the size of all


@dataclass(frozen=True)
class RunSizes:
    """Sizes of one effect, run by run."""

    sizes: Annotated[
        Mapping[str, Mapping[str, Estimate]],
        About("Parameter -> run that tells of it -> its size there [SI], all else common to the runs."),
    ]
    scatter: Annotated[
        Mapping[str, float],
        About("Parameter -> by how much runs differ beyond what the readings of each allow, one sd [SI]."),
    ]
    share: Annotated[float, About("The same of all parameters together over the size common to the runs.")]
    may_be_absent: Annotated[
        bool,
        About(
            "Whether a run without the effect would be no surprise: runs differ by more than half of every "
            "size, or the own size of one is none and excludes that of all."
        ),
    ]


def run_sizes(problem: DiagnosisProblem, best: RefittedHypothesis) -> dict[str, RunSizes]:
    """Sizes of every effect that has one: what is nought where it is off. Empty for a single run."""
    fitted, names = best.fit, best.fit.free.names
    runs = [log.name for log in problem.logs]
    if len(fitted.equations) < 2 or len(runs) != len(fitted.equations):
        return {}
    out = {}
    for effect in (problem.model.effects[n] for n in best.effects):
        keys = [effect.key(p.name) for p in effect.parameters if p.off == 0.0 and not p.shape]
        columns = [names.index(key) for key in keys if key in names]
        try:
            told = [of_single_runs(fitted.equations, c) for c in columns]
        except np.linalg.LinAlgError:
            continue
        if told:
            unit = fitted.free.sd[columns]
            middle, common = fitted.free.mean[columns] / unit, fitted.values[columns] / unit
            told = [(size + m, covariance) for (size, covariance), m in zip(told, middle, strict=True)]
            out[effect.name] = _sizes(told, common, [names[c] for c in columns], unit, runs)
    return out


def _sizes(
    told: Sequence[tuple[Array, Array]],
    common: Array,
    names: Sequence[str],
    unit: Array,
    runs: Sequence[str],
) -> RunSizes:
    """Sizes of one effect; those told and common are in prior standard deviations, `unit` [SI]."""
    spread = np.array([between_runs(size, covariance) for size, covariance in told])
    own = np.array([size for size, _ in told])
    sd = np.sqrt(np.array([np.diag(covariance) for _, covariance in told]))
    none = np.all(np.abs(own) < TWO_SIDED_95 * sd, axis=0)
    other = np.any(np.abs(own - common[:, None]) > EXCLUDED * sd, axis=0)
    everywhere = spread > np.abs(common) / TWO_SIDED_95
    return RunSizes(
        {
            name: {
                run: Estimate(float(u * v), float(u * s))
                for run, v, s in zip(runs, size, deviation, strict=True)
                if np.isfinite(s)
            }
            for name, u, size, deviation in zip(names, unit, own, sd, strict=True)
        },
        {name: float(u * s) for name, u, s in zip(names, unit, spread, strict=True)},
        float(np.linalg.norm(spread)) / max(float(np.linalg.norm(common)), 1e-300),
        bool(everywhere.all() or np.any(none & other)),
    )
