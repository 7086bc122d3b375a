"""Evidence of effects whose size is not known to an order of magnitude.

Takes normal equations in units of the prior standard deviations. Gives log evidence over that with the usual
size alone, and the same of many draws. Pure linear algebra.

The prior standard deviation of an effect is its usual size. A fault that shows clearly may be a hundredth of
it: half of the probability goes to the usual size, half to smaller ones, every half decade alike, down to the
smallest that these runs would most likely show (three in four of them) and no further than a hundredth. With
the usual size alone an effect of two parameters pays twice for being small: a bent fin a fiftieth of the
usual, 5.5 nats for each rival that has one, and was told as the side force of a propeller by 3.7 nats.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.threshold_table import SHOWN_NONCENTRALITY, USUAL_SIZE_PROBABILITY
from bayesid.estimation.filter_error.evidence import NormalEquations, without
from bayesid.estimation.run_data import Array
from bayesid.model.effects import Effect

# Standard deviations of smaller sizes, over the usual one.
SMALLER = (10**-0.5, 1e-1, 10**-1.5, 1e-2)


def sizes_of_effect(effect: Effect) -> tuple[int, ...]:
    """Positions of the parameters of an effect that are nought when it is off: not shapes, not times."""
    return tuple(i for i, p in enumerate(effect.parameters) if p.off == 0.0 and not (p.dated or p.shape))


def over_usual_size(total: NormalEquations, effects: Sequence[Sequence[int] | Array]) -> float:
    """What other sizes than the usual add to the log evidence of effects [nats]; nothing where rounding
    leaves no equations of the sizes alone.

    Parameters
    ----------
    total : equations of everything free
    effects : columns of the sizes of each effect
    """
    columns = np.concatenate([np.asarray(e, dtype=int) for e in effects]) if effects else np.zeros(0, int)
    if columns.size == 0:
        return 0.0
    others = np.setdiff1d(np.arange(total.se.size), columns)
    try:
        own = without(total.pick(np.concatenate([columns, others])), columns.size)
    except np.linalg.LinAlgError:
        return 0.0
    ends = np.cumsum([0, *(len(e) for e in effects)])
    blocks = [np.arange(a, b) for a, b in zip(ends, ends[1:], strict=False)]
    scale, weight = _scales(own.ss, blocks)
    value = _log_evidence(own.ss, own.se[None], scale)[0]
    out = float(logsumexp(value + weight) - value[0])
    return out if np.isfinite(out) else 0.0


def gains_of_draws(information: Array, scores: Array, sizes: Sequence[int] | Array) -> Array:
    """(draws,) log evidence of one effect over none, of many scores.

    Parameters
    ----------
    information : (k, k) of the effect's parameters, everything else integrated out
    scores : (draws, k)
    sizes : which of the parameters are sizes
    """
    scale, weight = _scales(information, [np.asarray(sizes, dtype=int)] if len(sizes) else [])
    return np.asarray(logsumexp(_log_evidence(information, scores, scale) + weight, axis=1))


def _scales(information: Array, blocks: Sequence[Array]) -> tuple[Array, Array]:
    """(m, k) scale of every parameter and (m,) logarithm of its probability, the usual one first."""
    choices = []
    for block in blocks:
        shown = float(np.trace(information[np.ix_(block, block)])) / max(block.size, 1)
        least = np.sqrt(SHOWN_NONCENTRALITY / shown) if shown > 0.0 else np.inf
        smaller = [s for s in SMALLER if s >= least]
        rest = (1.0 - USUAL_SIZE_PROBABILITY) / len(smaller) if smaller else 0.0
        choices.append([(1.0, 1.0 - rest * len(smaller)), *((s, rest) for s in smaller)])
    rows = list(product(*choices))
    scale, weight = np.ones((len(rows), information.shape[0])), np.zeros(len(rows))
    for i, row in enumerate(rows):
        for block, (size, chance) in zip(blocks, row, strict=True):
            scale[i, block] = size
            weight[i] += np.log(chance)
    return scale, weight


def _log_evidence(information: Array, scores: Array, scale: Array) -> Array:
    """(draws, m) log evidence over none with prior standard deviations of these scales."""
    scaled = information * scale[:, :, None] * scale[:, None, :] + np.eye(information.shape[0])
    inverse = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
    logdet = np.linalg.slogdet(scaled)[1]
    return 0.5 * (np.einsum("dk,mkl,dl->dm", scores, inverse, scores, optimize=True) - logdet)
