"""Smooth the latent inputs and states of one run.

Takes what `kalman.whiten` takes, with a residual in place of columns. Gives means, variances and the misfit
of every reading, in place. Does not choose amplitudes.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from bayesid.estimation.filter_error.kalman_step import carry, entries, opening, take

# Samples whose covariances are held at once: 10 MB for a planar vehicle.
BLOCK = 4096


@njit(cache=True, nogil=True, error_model="numpy")
def _transition(
    full: np.ndarray, i: int, phi: np.ndarray, gamma: np.ndarray, decay_f: np.ndarray, decay_d: np.ndarray
) -> None:
    """Map of [dx, f, d] over the interval after sample `i`, written into `full` (m, m), zero elsewhere."""
    nx, nf, nd = phi.shape[1], gamma.shape[2], decay_d.shape[1]
    for a in range(nx):
        for b in range(nx):
            full[a, b] = phi[i, a, b]
        for b in range(nf):
            full[a, nx + b] = gamma[i, a, b]
    for a in range(nf):
        full[nx + a, nx + a] = decay_f[i, a]
    for a in range(nd):
        full[nx + nf + a, nx + nf + a] = decay_d[i, a]


@njit(cache=True, nogil=True, error_model="numpy")
def _even(p: np.ndarray) -> None:
    """Make a matrix symmetric in place."""
    for a in range(p.shape[0]):
        for b in range(a):
            mid = 0.5 * (p[a, b] + p[b, a])
            p[a, b] = mid
            p[b, a] = mid


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def smooth_filtered(
    resid: np.ndarray,
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
    mean_out: np.ndarray,
    var_out: np.ndarray,
    standard: np.ndarray,
    alone: np.ndarray,
    filtered: np.ndarray,
    most: int,
) -> None:
    """Smoothed deviation of one run (Bryson-Frazier form, no inverse of a covariance).

    Parameters
    ----------
    resid, drive, first : (n, q), (n-1, nx), (nx,) residual of the readings and known deviation; rest as in
        `kalman.whiten`
    mean_out, var_out : (n, nx + nf + nd) filled with smoothed means and variances; an empty var_out is left
    standard : (n, q) filled with innovations over their predicted standard deviation, 0 where missing
    alone : (n, q) the same of each reading given all others, earlier and later (de Jong and Penzer 1998); an
        empty one is left, and without either no second moment is carried backward
    filtered : (n, nx + nf + nd) filled with means given the readings up to each sample
    most : samples whose covariances are held at once, e.g. BLOCK; a longer run is filtered twice, to the same
        numbers
    """
    n, q = resid.shape
    nx, nf, nd = phi.shape[1], gamma.shape[2], drift.shape[1]
    m = nx + nf + nd
    columns = np.ascontiguousarray(resid).reshape((n, q, 1))
    drives = np.ascontiguousarray(drive).reshape((n - 1, nx, 1))
    joint = opening(np.ascontiguousarray(first).reshape((nx, 1)), start, variance_f, variance_d)
    width = joint.shape[1]
    reads = entries(slope, drift.reshape((1, q, nd)), nf)
    moves = entries(phi, gamma, 0)
    lines, part, weight = np.empty((q, width)), np.empty(q), np.empty(m)
    present = np.empty(q, dtype=np.int64)
    step, moved = np.zeros(moves.shape), np.empty((nx, width))
    size = min(n, most)
    blocks = (n + size - 1) // size
    covariance, gains, parts = np.empty((size, m, m)), np.empty((size, q, m)), np.empty((size, q))
    opened = np.empty((blocks, m, width))
    # forward once to where every block begins, then block by block from the last one; the last of the first
    # pass is the first of the second
    block, forth = 0, True
    lam, big = np.zeros(m), np.zeros((m, m))
    while block >= 0:
        begin, end = block * size, min(n, (block + 1) * size)
        if forth:
            opened[block] = joint
        else:
            joint[:] = opened[block]
        for i in range(begin, end):
            for a in range(m):
                mean_out[i, a] = joint[a, 0]
                for b in range(m):
                    covariance[i - begin, a, b] = joint[a, 1 + b]
            _, count = take(
                joint, 1, i, columns, valid, slope, drift, variance, reads, lines, part, present, weight
            )
            for j in range(q):
                parts[i - begin, j] = part[j]
                if not valid[i, j]:
                    standard[i, j] = 0.0
                    for a in range(m):
                        gains[i - begin, j, a] = 0.0
            for b in range(count):
                standard[i, present[b]] = -lines[b, 0]
                for a in range(m):
                    gains[i - begin, present[b], a] = lines[b, 1 + a]
            for a in range(m):
                filtered[i, a] = joint[a, 0]
            if i < n - 1:
                carry(
                    joint, 1, i, drives, phi, gamma, decay_f, variance_f, decay_d, variance_d, moves, step,
                    moved,
                )  # fmt: skip
        if forth and block < blocks - 1:
            block += 1
            continue
        forth = False
        _backward(
            begin, end, valid, slope, phi, gamma, decay_f, decay_d, drift, mean_out, var_out, standard, alone,
            covariance, gains, parts, lam, big,
        )  # fmt: skip
        block -= 1


@njit(cache=True, nogil=True, error_model="numpy")
def _backward(
    begin: int,
    end: int,
    valid: np.ndarray,
    slope: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    decay_d: np.ndarray,
    drift: np.ndarray,
    mean_out: np.ndarray,
    var_out: np.ndarray,
    standard: np.ndarray,
    alone: np.ndarray,
    covariance: np.ndarray,
    gains: np.ndarray,
    parts: np.ndarray,
    lam: np.ndarray,
    big: np.ndarray,
) -> None:
    """Smooth samples `begin` to `end` - 1, the last first; `covariance`, `gains` and `parts` are theirs.

    lam, big : (m,) and (m, m) adjoint mean and second moment after sample `end` - 1, left before `begin`
    """
    n, q = valid.shape
    nx, nf, nd = phi.shape[1], gamma.shape[2], drift.shape[1]
    m = nx + nf + nd
    second = alone.size > 0 or var_out.size > 0
    line, bk, h = np.empty(m), np.empty(m), np.empty(m)
    work, full, left = np.empty((m, m)), np.zeros((m, m)), np.empty((m, m))
    for i in range(end - 1, begin - 1, -1):
        if i < n - 1:
            _transition(full, i, phi, gamma, decay_f, decay_d)
            for a in range(m):
                line[a] = 0.0
            for a in range(m):
                for b in range(m):
                    line[b] += full[a, b] * lam[a]
            for a in range(m):
                lam[a] = line[a]
            if second:
                np.dot(big, full, work)
                np.dot(full.T, work, big)
                # the updates contract a symmetric matrix only; rounding would grow with an unstable hull
                _even(big)
        for j in range(q - 1, -1, -1):
            if not valid[i, j]:
                if alone.size > 0:
                    alone[i, j] = 0.0
                continue
            for a in range(nx):
                h[a] = slope[i, j, a]
            for a in range(nf):
                h[nx + a] = 0.0
            for a in range(nd):
                h[nx + nf + a] = drift[j, a]
            pull = standard[i, j]
            for a in range(m):
                pull += gains[i - begin, j, a] * lam[a]
            pull *= parts[i - begin, j]
            if second:
                for a in range(m):
                    bk[a] = 0.0
                for a in range(m):
                    k = gains[i - begin, j, a] * parts[i - begin, j]
                    for b in range(m):
                        bk[b] += big[a, b] * k
                more = parts[i - begin, j] ** 2
                for a in range(m):
                    more += gains[i - begin, j, a] * parts[i - begin, j] * bk[a]
                if alone.size > 0:
                    alone[i, j] = pull / np.sqrt(more)
                for a in range(m):
                    for b in range(m):
                        big[a, b] += h[a] * h[b] * more - h[a] * bk[b] - bk[a] * h[b]
            for a in range(m):
                lam[a] -= h[a] * pull
        for b in range(m):
            for a in range(m):
                mean_out[i, a] -= covariance[i - begin, b, a] * lam[b]
        if var_out.size > 0:
            np.dot(covariance[i - begin], big, left)
            for a in range(m):
                total = covariance[i - begin, a, a]
                for b in range(m):
                    total -= left[a, b] * covariance[i - begin, b, a]
                var_out[i, a] = total


def smooth(
    resid: np.ndarray,
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
    mean_out: np.ndarray,
    var_out: np.ndarray,
    standard: np.ndarray,
    alone: np.ndarray,
) -> None:
    """`smooth_filtered` where the filtered means are of no use."""
    smooth_filtered(
        resid, drive, first, valid, slope, variance, phi, gamma, decay_f, variance_f, drift, decay_d,
        variance_d, start, mean_out, var_out, standard, alone, np.empty_like(mean_out), BLOCK,
    )  # fmt: skip
