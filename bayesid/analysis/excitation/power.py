"""What a record is too short to say: how far forces of white noise reach, and what would have been noticed.

Takes rows of the weak form of the balance or their triangular factor. Does not select terms.
"""

from __future__ import annotations

import numpy as np

from bayesid.analysis.excitation.row_selection import COLUMN_PENALTY, EXACT_RESIDUAL, MARGIN, block_scatter

Array = np.ndarray
NEIGHBOURS = 4  # rows of the weak form that share a window
WHITE_FORCES, FALSE_ALARM = 200, 0.01  # forces drawn, and the share of them that may ask for a term


def white_reach(
    theta: Array, weight: Array, block: Array, offered: list[int], rng: np.random.Generator
) -> float:
    """Factor on the variance of a row, 1 at least, with which a force of white noise asks for a term in
    `FALSE_ALARM` of the cases.

    A short run leaves a library of twenty columns few rows to estimate the noise from, and an estimate from
    few rows is often far too small. How far depends on the columns; so forces that have nothing to do with
    the motion are regressed on them.
    """
    if not offered:
        return 1.0
    white = rng.standard_normal((len(theta) + NEIGHBOURS - 1, WHITE_FORCES))
    total = np.vstack([np.zeros(WHITE_FORCES), np.cumsum(white, axis=0)])
    root = np.sqrt(weight / weight.mean())[:, None]
    force = (total[NEIGHBOURS:] - total[:-NEIGHBOURS]) * root
    x = theta[:, offered] * root
    size = np.maximum((x**2).sum(axis=0), 1e-300)
    left = force - x @ np.linalg.lstsq(x, force, rcond=None)[0]
    count = max(len(x) - len(offered), 1)
    variance = np.maximum((left**2).sum(axis=0) / count, EXACT_RESIDUAL**2 * np.mean(force**2))
    numbers = np.unique(block)
    scores = np.stack([x[block == n].T @ left[block == n] for n in numbers])
    inflation = np.maximum(block_scatter(scores, size, variance), 1.0)
    gain = ((x.T @ force) ** 2 / size[:, None]).max(axis=0) / (2 * variance * inflation)
    return max(float(np.quantile(gain, 1 - FALSE_ALARM)) / COLUMN_PENALTY, 1.0)


def noticed(root: Array, variance: float, best: list[int], group: list[int], asked: Array) -> bool:
    """Whether every member of a group would have been found, had it had the force `asked` of it.

    Absence of evidence: beside columns that can take its place, or under much noise, a term is not kept
    whether it acts or not.
    """
    for k in group:
        others = [i for i in {*best, *group} if i != k]
        x = root[:, k]
        alone = x - root[:, others] @ np.linalg.lstsq(root[:, others], x, rcond=None)[0] if others else x
        gain = asked[k] ** 2 * float(alone @ alone) / (2 * variance)
        if gain < COLUMN_PENALTY + MARGIN:
            return False
    return True
