"""One sample of a Kalman filter for many columns at once: take its readings in, carry on to the next sample.

Works in place on `joint`, (m, width): c columns of deviations of the unknowns [dx, f, d], then their
covariance, which all columns share, then zeros up to a whole number of vector registers. The readings of one
sample enter one at a time, but joint changes only once, after the last.

What is zero at every sample, most of a transition and of a reading's slope, is never multiplied: `entries`
lists the rest. Products are loops over whole rows, several terms a pass, inlined into the loop over samples:
on matrices of 14 by 40 a call of BLAS costs more than the product (1.65 times quicker with 26 and with 48
columns, measured). Arrays are passed whole with the sample's number, as making a view of one costs as much
as a reading.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# Numbers in a vector register, and terms of a sum that are added in one pass over a row.
LANES, TERMS = 8, 8


@njit(cache=True, nogil=True, error_model="numpy")
def opening(
    first: np.ndarray, start: np.ndarray, variance_f: np.ndarray, variance_d: np.ndarray
) -> np.ndarray:
    """`joint` before the first reading; `first` (nx, c) known deviations, then prior variances."""
    nx, nf, nd, c = start.size, variance_f.size, variance_d.size, first.shape[1]
    m = nx + nf + nd
    joint = np.zeros((m, (c + m + LANES - 1) // LANES * LANES))
    for i in range(nx):
        for k in range(c):
            joint[i, k] = first[i, k]
        joint[i, c + i] = start[i]
    for i in range(nf):
        joint[nx + i, c + nx + i] = variance_f[i]
    for i in range(nd):
        joint[nx + nf + i, c + nx + nf + i] = variance_d[i]
    return joint


@njit(cache=True, nogil=True, error_model="numpy")
def entries(left: np.ndarray, right: np.ndarray, skipped: int) -> np.ndarray:
    """Which entries of (n, r, p) and (m, r, s) matrices side by side are not zero at every sample.

    Parameters
    ----------
    skipped : unknowns between those of the left and those of the right columns

    Returns
    -------
    (r, 1 + at least `TERMS`) how many, then the unknowns they belong to, then zeros
    """
    rows, p, s = left.shape[1], left.shape[2], right.shape[2]
    out = np.zeros((rows, 1 + max(p + s, TERMS)), dtype=np.int64)
    for a in range(rows):
        for b in range(p + s):
            found = False
            if b < p:
                for i in range(left.shape[0]):
                    if left[i, a, b] != 0.0:
                        found = True
                        break
            else:
                for i in range(right.shape[0]):
                    if right[i, a, b - p] != 0.0:
                        found = True
                        break
            if found:
                out[a, 0] += 1
                out[a, out[a, 0]] = b if b < p else b + skipped
    return out


@njit(inline="always", nogil=True, error_model="numpy", fastmath={"contract"})
def take(
    joint: np.ndarray,
    c: int,
    i: int,
    columns: np.ndarray,
    valid: np.ndarray,
    slope: np.ndarray,
    drift: np.ndarray,
    variance: np.ndarray,
    reads: np.ndarray,
    lines: np.ndarray,
    part: np.ndarray,
    present: np.ndarray,
    weight: np.ndarray,
) -> tuple[float, int]:
    """Take in the readings of sample `i`.

    Parameters
    ----------
    columns, valid, slope, drift, variance : as in `kalman.whiten`
    reads : `entries` of the slopes and drifts of all samples
    lines : (q, width), the first rows filled with whitened columns, of the other sign, and gains h'P over the
        innovation's deviation, a row for each reading that is there
    part : (q,) filled with one over the innovation's deviation, zero where missing
    present : (q,) int, the first of them filled with the channels those rows belong to
    weight : (m,), overwritten

    Returns
    -------
    log determinant of the sample's innovations, number of readings used
    """
    q, nx, m, width = valid.shape[1], slope.shape[2], joint.shape[0], joint.shape[1]
    before = m - drift.shape[1]
    logdet, used = 0.0, 0
    for j in range(q):
        part[j] = 0.0
        if not valid[i, j]:
            continue
        count = reads[j, 0]
        for k in range(width):
            lines[used, k] = 0.0
        for b in range(count):
            at = reads[j, 1 + b]
            h = slope[i, j, at] if at < nx else drift[j, at - before]
            weight[b] = h
            for k in range(width):
                lines[used, k] += h * joint[at, k]
        for k in range(c):
            lines[used, k] -= columns[i, j, k]
        for other in range(used):
            shared = 0.0
            for b in range(count):
                shared += weight[b] * lines[other, c + reads[j, 1 + b]]
            if shared != 0.0:
                for k in range(width):
                    lines[used, k] -= shared * lines[other, k]
        s = variance[j]
        for b in range(count):
            s += weight[b] * lines[used, c + reads[j, 1 + b]]
        scale = 1.0 / np.sqrt(s)
        part[j] = scale
        for k in range(width):
            lines[used, k] *= scale
        logdet += np.log(s)
        present[used] = j
        used += 1
    for a in range(m):
        b = 0
        while b + 6 <= used:
            g0, g1, g2 = lines[b, c + a], lines[b + 1, c + a], lines[b + 2, c + a]
            g3, g4, g5 = lines[b + 3, c + a], lines[b + 4, c + a], lines[b + 5, c + a]
            for k in range(width):
                joint[a, k] -= (
                    g0 * lines[b, k] + g1 * lines[b + 1, k] + g2 * lines[b + 2, k]
                    + g3 * lines[b + 3, k] + g4 * lines[b + 4, k] + g5 * lines[b + 5, k]
                )  # fmt: skip
            b += 6
        while b < used:
            g0 = lines[b, c + a]
            for k in range(width):
                joint[a, k] -= g0 * lines[b, k]
            b += 1
    return logdet, used


@njit(inline="always", nogil=True, error_model="numpy", fastmath={"contract"})
def carry(
    joint: np.ndarray,
    c: int,
    i: int,
    drive: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    variance_f: np.ndarray,
    decay_d: np.ndarray,
    variance_d: np.ndarray,
    moves: np.ndarray,
    step: np.ndarray,
    moved: np.ndarray,
) -> None:
    """Carry `joint` over the interval after sample `i`; its covariance ends exactly symmetric.

    Parameters
    ----------
    drive, phi, gamma, decay_f, variance_f, decay_d, variance_d : as in `kalman.whiten`
    moves : `entries` of phi and gamma of all intervals
    step, moved : zeros of the shape of `moves`, and (nx, width), overwritten
    """
    nx, nf, nd, width = phi.shape[1], gamma.shape[2], decay_d.shape[1], joint.shape[1]
    known, m = nx + nf, nx + nf + nd
    for a in range(nx):
        count = moves[a, 0]
        for b in range(count):
            at = moves[a, 1 + b]
            step[a, b] = phi[i, a, at] if at < nx else gamma[i, a, at - nx]
        # unused terms are zero times the first row
        r0, r1, r2, r3 = moves[a, 1], moves[a, 2], moves[a, 3], moves[a, 4]
        r4, r5, r6, r7 = moves[a, 5], moves[a, 6], moves[a, 7], moves[a, 8]
        g0, g1, g2, g3 = step[a, 0], step[a, 1], step[a, 2], step[a, 3]
        g4, g5, g6, g7 = step[a, 4], step[a, 5], step[a, 6], step[a, 7]
        for k in range(width):
            moved[a, k] = (
                g0 * joint[r0, k] + g1 * joint[r1, k] + g2 * joint[r2, k] + g3 * joint[r3, k]
                + g4 * joint[r4, k] + g5 * joint[r5, k] + g6 * joint[r6, k] + g7 * joint[r7, k]
            )  # fmt: skip
        for b in range(TERMS, count):
            r0, g0 = moves[a, 1 + b], step[a, b]
            for k in range(width):
                moved[a, k] += g0 * joint[r0, k]
    for a in range(nx):
        for b in range(c):
            joint[a, b] = moved[a, b] + drive[i, a, b]
        for b in range(a + 1):
            spread = 0.0
            for k in range(moves[b, 0]):
                spread += moved[a, c + moves[b, 1 + k]] * step[b, k]
            joint[a, c + b] = spread
            joint[b, c + a] = spread
    for a in range(nx, m):
        decay = decay_f[i, a - nx] if a < known else decay_d[i, a - known]
        for b in range(c):
            joint[a, b] *= decay
        for b in range(nx):
            across = moved[b, c + a] * decay
            joint[a, c + b] = across
            joint[b, c + a] = across
        for b in range(nx, a):
            across = joint[a, c + b] * decay * (decay_f[i, b - nx] if b < known else decay_d[i, b - known])
            joint[a, c + b] = across
            joint[b, c + a] = across
        fresh = (variance_f[a - nx] if a < known else variance_d[a - known]) * (1.0 - decay**2)
        joint[a, c + a] = joint[a, c + a] * decay**2 + fresh
