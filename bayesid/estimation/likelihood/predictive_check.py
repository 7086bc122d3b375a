"""Posterior predictive p per channel and kind of motion: are residuals as large as the errors assumed?

Takes a `FitProblem`, its estimate and posterior. Gives plain numbers. Does not simulate draws: readings are
linear in the parameters about the estimate.

The discrepancy is the sum of squares of a channel's errors over all runs of one kind, at parameters drawn
from the posterior (Gelman, Meng and Stern 1996). That of replicated errors has mean and variance of the noise
with its memory; it is drawn from the gamma distribution with both. Noise with memory has the size of the
residuals of all runs, so then p tells one kind of motion from the others; white noise has the size stated.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from bayesid.estimation.likelihood.mixed_rates import ChannelGroup, mixed_rate_noise
from bayesid.estimation.likelihood.posterior import PIECE, CoefficientPosterior
from bayesid.estimation.likelihood.residual_noise import MOST_ORDER
from bayesid.estimation.likelihood.run_information import run_information
from bayesid.estimation.output_error.problem import FitProblem

Array = np.ndarray
DRAWS = 2000
# p below which a channel counts as missed.
MISSED = 0.01


def kind_of(manoeuvre: str) -> str:
    """Kind of motion of a manoeuvre: its name without numbers."""
    return re.split(r"[\d(+-]*\d", manoeuvre)[0].strip(" ,:;(/") or manoeuvre


def predictive_p(
    problem: FitProblem,
    z: Array,
    posterior: CoefficientPosterior,
    kinds: Mapping[str, str] | None = None,
    seed: int = 0,
) -> dict[str, dict[str, float]]:
    """Kind of motion -> channel -> probability of errors at least as large as those of the readings.

    Parameters
    ----------
    z : unknowns of the problem at the estimate
    kinds : run -> kind of its motion; without, all are "all runs"

    Raises
    ------
    ModelError
        if the simulated vehicle diverges at z
    """
    infos = tuple(run_information(problem, z))
    resids, valid = [i.resid for i in infos], [i.valid for i in infos]
    white = posterior.parts.order == 0 and not posterior.parts.disturbance
    noise = mixed_rate_noise(resids, valid, 0 if white else MOST_ORDER).for_unknowns(z.size)
    channels = list(dict.fromkeys(c for run in problem.runs for c in run.channels))
    scale = problem.scale[: posterior.sd.size]
    spread = (posterior.run_sd / scale) ** 2
    rng = np.random.default_rng(seed)
    step = (posterior.draws(DRAWS, rng) - posterior.estimate) / scale
    out: dict[str, dict[str, float]] = {}
    for kind in dict.fromkeys(_kind(i.name, kinds) for i in infos):
        chosen = [i for i in infos if _kind(i.name, kinds) == kind]
        for group in noise.groups:
            for j in group.channels:
                gram, slope, square = np.zeros((scale.size, scale.size)), np.zeros(scale.size), 0.0
                mean = variance = 0.0
                for info in chosen:
                    rows = info.valid[:, j]
                    columns, resid = info.columns[rows, j], info.resid[rows, j]
                    own = columns.T @ columns
                    gram, slope = gram + own, slope + columns.T @ resid
                    square += float(resid @ resid)
                    first, second = _of_noise(group, j, info.valid)
                    if white:  # noise with memory holds how runs differ
                        own = own * np.sqrt(np.outer(spread, spread))
                        first += np.trace(own)
                        second += 2.0 * np.sum(own * own) + 4.0 * np.trace(own)
                    mean, variance = mean + first, variance + second
                if mean <= 0:
                    continue
                seen = square + 2.0 * step @ slope + np.einsum("dk,kl,dl->d", step, gram, step, optimize=True)
                again = rng.gamma(mean**2 / variance, variance / mean, DRAWS)
                p = (1 + int(np.sum(again >= seen))) / (1 + DRAWS)
                out.setdefault(kind, {})[channels[j]] = p
    return out


def missed(found: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Those whose p is below `MISSED`."""
    low = {kind: {c: p for c, p in each.items() if p < MISSED} for kind, each in found.items()}
    return {kind: each for kind, each in low.items() if each}


def _kind(name: str, kinds: Mapping[str, str] | None) -> str:
    if kinds is None:
        return "all runs"
    return kinds.get(name) or kinds.get(PIECE.sub("", name)) or "all runs"


def _of_noise(group: ChannelGroup, j: int, valid: Array) -> tuple[float, float]:
    """Mean and variance of the sum of squares of one channel's noise over the readings of a run."""
    read = valid[group.rows(valid), j].astype(float)
    count = float(read.sum())
    if group.noise.order == 0:  # as stated
        return count, 2.0 * count
    n = read.size
    lags = group.noise.covariance(n)[:, group.channels.index(j), group.channels.index(j)]
    size = 1 << (2 * n - 1).bit_length()
    pairs = np.fft.irfft(np.abs(np.fft.rfft(read, size)) ** 2, size)[:n]
    return count * float(lags[0]), 2.0 * float(
        pairs[0] * lags[0] ** 2 + 2.0 * np.sum(pairs[1:] * lags[1:] ** 2)
    )
