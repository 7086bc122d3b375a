"""What a record is too short to say, on columns whose answer is known."""

from __future__ import annotations

import numpy as np

from bayesid.analysis.excitation.power import noticed, white_reach
from bayesid.analysis.excitation.row_selection import COLUMN_PENALTY, MARGIN


def reach(rows: int, columns: int, seed: int = 0) -> float:
    rng = np.random.default_rng(seed)
    theta = np.cumsum(rng.standard_normal((rows, columns)), axis=0)
    theta /= np.sqrt(np.mean(theta**2, axis=0))
    block = np.arange(rows) // 8
    return white_reach(theta, np.ones(rows), block, list(range(columns)), rng)


def test_few_rows_for_many_columns_raise_the_price_and_many_rows_do_not():
    """Rows share windows: forty rows are some fifteen, and twenty columns leave nothing of them for noise."""
    assert reach(40, 20) > 5 * reach(1200, 4)
    assert 1.0 <= reach(1200, 4) < 2.0
    assert white_reach(np.zeros((5, 0)), np.ones(5), np.zeros(5), [], np.random.default_rng(0)) == 1.0


def test_a_term_is_noticed_from_the_evidence_its_force_would_bring():
    """An orthogonal column of 100 rows brings 100 f^2 / 2 nats at a variance of 1."""
    root = np.diag([10.0, 10.0, 5.0])
    enough = np.sqrt(2 * (COLUMN_PENALTY + MARGIN) / 100)
    assert noticed(root, 1.0, [1], [0], np.full(2, 1.01 * enough))
    assert not noticed(root, 1.0, [1], [0], np.full(2, 0.99 * enough))


def test_beside_its_twin_no_term_is_noticed_however_strong():
    root = np.array([[10.0, 10.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1.0]])
    assert not noticed(root, 1.0, [0], [1], np.full(2, 100.0))
    assert not noticed(root, 1.0, [], [0, 1], np.full(2, 100.0))
