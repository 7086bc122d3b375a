"""Runs simulated with the coefficients that the other runs give: which of two estimates predicts better.

Takes a `FitProblem`, its unknowns and a posterior about them. Gives a misfit per run, and a judgement of two
such rows. Does not fit: what the other runs say is of first order about an estimate that has read all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import t as student_t

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.composite import LEAST_RUNS
from bayesid.estimation.likelihood.posterior import LEFT_OUT_P, CoefficientPosterior, groups
from bayesid.estimation.likelihood.score_step import with_settled_starts
from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
# Logarithm of a ratio that stands for any larger one: a run that diverges in one of two is one run of many.
MOST_RATIO = 7.0
# Misfits outside count as these: of readings without noise, and of runs that diverge.
LEAST_MISFIT, MOST_MISFIT = 1e-100, 1e100


def left_out_misfits(problem: FitProblem, z: Array, posterior: CoefficientPosterior) -> Array:
    """(runs,) half the sum of squared residuals of every run, simulated from the first state that suits it
    with what the other runs say; inf where it diverges, empty for a single run."""
    k = len(problem.params.names)
    ends = k + np.cumsum([len(run.initial) for run in problem.runs])
    starts = [z[b - len(run.initial) : b] for run, b in zip(problem.runs, ends, strict=True)]
    names = groups([run.name for run in problem.runs])
    out = []
    for name in posterior.left_out:
        own = [i for i, n in enumerate(names) if n == name]
        alone = replace(problem, runs=tuple(problem.runs[i] for i in own))
        values = np.clip(posterior.left_out[name].mean, posterior.low, posterior.high)
        try:
            there = with_settled_starts(alone, np.concatenate([values, *(starts[i] for i in own)]))
            block = alone.run_blocks(there)
            resids = [block(i)[0] for i in range(len(own))]
        except ModelError:
            out.append(np.inf)
            continue
        out.append(0.5 * sum(float(resid @ resid) for resid in resids))
    return np.array(out)


def predicts_worse(one: Array, other: Array) -> bool:
    """Whether misfits (runs,) are larger than others by more than chance makes it: the mean of the logarithm
    of their ratio by Student's t over runs, or all of them; simply larger where runs are too few to tell.
    """
    logs = [np.log(np.clip(misfits, LEAST_MISFIT, MOST_MISFIT)) for misfits in (one, other)]
    ratio = np.clip(logs[0] - logs[1], -MOST_RATIO, MOST_RATIO)
    mean = float(ratio.mean())
    if ratio.size < LEAST_RUNS:
        return mean > 0.0
    error = float(ratio.std(ddof=1)) / np.sqrt(ratio.size)
    return bool(np.all(ratio > 0.0)) or mean > student_t.isf(LEFT_OUT_P, ratio.size - 1) * error
