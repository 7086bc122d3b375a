"""Whiten residuals and sensitivity columns of one run.

Takes step maps of a linearised run. The unknown deviation [dx, f, d] holds the state, Ornstein-Uhlenbeck
latent inputs f held over each sample interval, and Ornstein-Uhlenbeck sensor drifts d. Because the filter is
linear in the data, one pass with the residual's gains whitens any number of further columns. Does not choose
amplitudes.

The innovations form of the likelihood is exact for this model (Schweppe 1965); readings enter one at a time,
so no matrix is inverted.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bayesid.estimation.filter_error.kalman_step import carry, entries, opening, take

# Products and sums are contracted (`fastmath`): 10 % quicker, and unlike its other flags exact about NaN.


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def whiten(
    columns: np.ndarray,
    drive: np.ndarray,
    first: np.ndarray,
    valid: np.ndarray,
    slope: np.ndarray,
    variance: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    variance_f: np.ndarray,
    drift: np.ndarray,
    decay_d: np.ndarray,
    variance_d: np.ndarray,
    start: np.ndarray,
    out: np.ndarray,
) -> tuple[float, int]:
    """Whitened columns of one run.

    Parameters
    ----------
    columns : (n, q, c) residual and sensitivity columns by sample and channel
    drive : (n-1, nx, c) known change of the state deviation over each interval, per column
    first : (nx, c) known initial deviation, per column
    valid : (n, q) bool, readings present
    slope : (n, q, nx) derivative of each reading by the state
    variance : (q,) white sensor variance
    phi, gamma : (n-1, nx, nx) and (n-1, nx, nf) maps over a sample interval
    decay_f, variance_f : (n-1, nf) and (nf,) decay factor per interval and stationary variance of the latent
    inputs
    drift : (q, nd) which drift enters which channel
    decay_d, variance_d : (n-1, nd) and (nd,)
    start : (nx,) prior variance of the initial deviation
    out : (n*q, c) filled with whitened columns, rows of missing readings zero

    Returns
    -------
    log determinant of the residual's covariance, number of readings used
    """
    joint = opening(first, start, variance_f, variance_d)
    return whiten_on(
        joint, columns, drive, valid, slope, variance, phi, gamma, decay_f, variance_f, drift, decay_d,
        variance_d, out,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def whiten_on(
    joint: np.ndarray,
    columns: np.ndarray,
    drive: np.ndarray,
    valid: np.ndarray,
    slope: np.ndarray,
    variance: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    variance_f: np.ndarray,
    drift: np.ndarray,
    decay_d: np.ndarray,
    variance_d: np.ndarray,
    out: np.ndarray,
) -> tuple[float, int]:
    """`whiten` of the next samples of a run: `joint` is as the samples before left it, and is carried on.

    There is one interval less than samples at the end of a run, and as many before.
    """
    n, q, c = columns.shape
    nx, nf, m, width = phi.shape[1], gamma.shape[2], joint.shape[0], joint.shape[1]
    reads = entries(slope, drift.reshape((1, q, drift.shape[1])), nf)
    moves = entries(phi, gamma, 0)
    lines, part, weight = np.empty((q, width)), np.empty(q), np.empty(m)
    present = np.empty(q, dtype=np.int64)
    step, moved = np.zeros(moves.shape), np.empty((nx, width))
    logdet, used = 0.0, 0
    for i in range(n):
        more, count = take(
            joint, c, i, columns, valid, slope, drift, variance, reads, lines, part, present, weight
        )
        logdet += more
        used += count
        for j in range(q):
            if not valid[i, j]:
                for k in range(c):
                    out[i * q + j, k] = 0.0
        for b in range(count):
            for k in range(c):
                out[i * q + present[b], k] = -lines[b, k]
        if i < drive.shape[0]:
            carry(
                joint, c, i, drive, phi, gamma, decay_f, variance_f, decay_d, variance_d, moves, step, moved
            )
    return logdet, used
