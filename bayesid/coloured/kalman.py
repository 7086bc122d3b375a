"""Whiten residuals and sensitivity columns of one run, and smooth its latent inputs.

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


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(
    p: np.ndarray,
    work: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    variance_f: np.ndarray,
    decay_d: np.ndarray,
    variance_d: np.ndarray,
) -> None:
    """Covariance `p` (m, m) of [dx, f, d] one interval later, in place; `work` (m, m) is overwritten."""
    nx, nf, nd, m = phi.shape[0], gamma.shape[1], decay_d.size, p.shape[0]
    for a in range(nx):
        for k in range(m):
            total = 0.0
            for b in range(nx):
                total += phi[a, b] * p[b, k]
            for b in range(nf):
                total += gamma[a, b] * p[nx + b, k]
            work[a, k] = total
    for a in range(nf):
        for k in range(m):
            work[nx + a, k] = decay_f[a] * p[nx + a, k]
    for a in range(nd):
        for k in range(m):
            work[nx + nf + a, k] = decay_d[a] * p[nx + nf + a, k]
    for a in range(m):
        for b in range(nx):
            total = 0.0
            for k in range(nx):
                total += work[a, k] * phi[b, k]
            for k in range(nf):
                total += work[a, nx + k] * gamma[b, k]
            p[a, b] = total
        for b in range(nf):
            p[a, nx + b] = work[a, nx + b] * decay_f[b]
        for b in range(nd):
            p[a, nx + nf + b] = work[a, nx + nf + b] * decay_d[b]
    for a in range(nf):
        p[nx + a, nx + a] += variance_f[a] * (1.0 - decay_f[a] ** 2)
    for a in range(nd):
        p[nx + nf + a, nx + nf + a] += variance_d[a] * (1.0 - decay_d[a] ** 2)
    _even(p)


@njit(cache=True, nogil=True, error_model="numpy")
def _even(p: np.ndarray) -> None:
    """Make a matrix symmetric in place."""
    for a in range(p.shape[0]):
        for b in range(a):
            mid = 0.5 * (p[a, b] + p[b, a])
            p[a, b] = mid
            p[b, a] = mid


@njit(cache=True, nogil=True, error_model="numpy")
def _back(
    lam: np.ndarray,
    big: np.ndarray,
    work: np.ndarray,
    line: np.ndarray,
    phi: np.ndarray,
    gamma: np.ndarray,
    decay_f: np.ndarray,
    decay_d: np.ndarray,
) -> None:
    """F' lam and F' big F for the map F of one interval, in place; `work` (m, m), `line` (m,) overwritten."""
    nx, nf, nd, m = phi.shape[0], gamma.shape[1], decay_d.size, lam.size
    for k in range(nx):
        total = 0.0
        for a in range(nx):
            total += phi[a, k] * lam[a]
        line[k] = total
    for k in range(nf):
        total = decay_f[k] * lam[nx + k]
        for a in range(nx):
            total += gamma[a, k] * lam[a]
        line[nx + k] = total
    for k in range(nd):
        line[nx + nf + k] = decay_d[k] * lam[nx + nf + k]
    for k in range(m):
        lam[k] = line[k]
    for a in range(m):
        for k in range(nx):
            total = 0.0
            for b in range(nx):
                total += big[a, b] * phi[b, k]
            work[a, k] = total
        for k in range(nf):
            total = big[a, nx + k] * decay_f[k]
            for b in range(nx):
                total += big[a, b] * gamma[b, k]
            work[a, nx + k] = total
        for k in range(nd):
            work[a, nx + nf + k] = big[a, nx + nf + k] * decay_d[k]
    for k in range(m):
        for a in range(nx):
            total = 0.0
            for b in range(nx):
                total += phi[b, a] * work[b, k]
            big[a, k] = total
        for a in range(nf):
            total = decay_f[a] * work[nx + a, k]
            for b in range(nx):
                total += gamma[b, a] * work[b, k]
            big[nx + a, k] = total
        for a in range(nd):
            big[nx + nf + a, k] = decay_d[a] * work[nx + nf + a, k]
    # the updates contract a symmetric matrix only; rounding would grow with an unstable hull
    _even(big)


@njit(cache=True, nogil=True, error_model="numpy")
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
    n, q, c = columns.shape
    nx = phi.shape[1]
    nf = gamma.shape[2]
    nd = drift.shape[1]
    m = nx + nf + nd
    p = np.zeros((m, m))
    for i in range(nx):
        p[i, i] = start[i]
    for i in range(nf):
        p[nx + i, nx + i] = variance_f[i]
    for i in range(nd):
        p[nx + nf + i, nx + nf + i] = variance_d[i]
    mean = np.zeros((m, c))
    for i in range(nx):
        for k in range(c):
            mean[i, k] = first[i, k]
    turned = np.zeros((m, c))
    tp = np.zeros((m, m))
    h = np.zeros(m)
    gain = np.zeros(m)
    logdet = 0.0
    used = 0
    for i in range(n):
        for j in range(q):
            row = i * q + j
            if not valid[i, j]:
                for k in range(c):
                    out[row, k] = 0.0
                continue
            for k in range(nx):
                h[k] = slope[i, j, k]
            for k in range(nf):
                h[nx + k] = 0.0
            for k in range(nd):
                h[nx + nf + k] = drift[j, k]
            s = variance[j]
            for a in range(m):
                total = 0.0
                for b in range(m):
                    total += p[a, b] * h[b]
                gain[a] = total
            for a in range(m):
                s += h[a] * gain[a]
            root = np.sqrt(s)
            logdet += np.log(s)
            used += 1
            for k in range(c):
                out[row, k] = columns[i, j, k]
            for a in range(m):
                ha = h[a]
                if ha != 0.0:
                    for k in range(c):
                        out[row, k] -= ha * mean[a, k]
            for a in range(m):
                ga = gain[a] / s
                for k in range(c):
                    mean[a, k] += ga * out[row, k]
                for b in range(m):
                    p[a, b] -= ga * gain[b]
            for k in range(c):
                out[row, k] /= root
        if i == n - 1:
            break
        for a in range(nx):
            for k in range(c):
                turned[a, k] = drive[i, a, k]
            for b in range(nx):
                f = phi[i, a, b]
                for k in range(c):
                    turned[a, k] += f * mean[b, k]
            for b in range(nf):
                f = gamma[i, a, b]
                for k in range(c):
                    turned[a, k] += f * mean[nx + b, k]
        for a in range(nf):
            for k in range(c):
                turned[nx + a, k] = decay_f[i, a] * mean[nx + a, k]
        for a in range(nd):
            for k in range(c):
                turned[nx + nf + a, k] = decay_d[i, a] * mean[nx + nf + a, k]
        _spread(p, tp, phi[i], gamma[i], decay_f[i], variance_f, decay_d[i], variance_d)
        for a in range(m):
            for k in range(c):
                mean[a, k] = turned[a, k]
    return logdet, used


@njit(cache=True, nogil=True, error_model="numpy")
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
) -> None:
    """Smoothed deviation of one run (Bryson-Frazier form, no inverse of a covariance).

    Parameters
    ----------
    resid, drive, first : (n, q), (n-1, nx), (nx,) residual of the readings and known deviation; rest as in
    `whiten`
    mean_out, var_out : (n, nx + nf + nd) filled with smoothed means and variances; an empty var_out is left
    standard : (n, q) filled with innovations over their predicted standard deviation, 0 where missing
    alone : (n, q) the same of each reading given all others, earlier and later (de Jong and Penzer 1998)
    filtered : (n, nx + nf + nd) filled with means given the readings up to each sample
    """
    n, q = resid.shape
    nx = phi.shape[1]
    nf = gamma.shape[2]
    nd = drift.shape[1]
    m = nx + nf + nd
    p = np.zeros((m, m))
    for i in range(nx):
        p[i, i] = start[i]
    for i in range(nf):
        p[nx + i, nx + i] = variance_f[i]
    for i in range(nd):
        p[nx + nf + i, nx + nf + i] = variance_d[i]
    mean = np.zeros(m)
    mean[:nx] = first
    predicted = np.zeros((n, m))
    covariance = np.empty((n, m, m))
    gains = np.zeros((n, q, m))
    innovation = np.zeros((n, q))
    spread = np.zeros((n, q))
    rows = np.zeros((n, q, m))
    work, line, bk = np.empty((m, m)), np.empty(m), np.empty(m)
    for i in range(n):
        for a in range(m):
            predicted[i, a] = mean[a]
            for b in range(m):
                covariance[i, a, b] = p[a, b]
        for j in range(q):
            standard[i, j] = 0.0
            alone[i, j] = 0.0
            if not valid[i, j]:
                continue
            h = rows[i, j]
            for a in range(nx):
                h[a] = slope[i, j, a]
            for a in range(nd):
                h[nx + nf + a] = drift[j, a]
            s = variance[j]
            e = resid[i, j]
            for a in range(m):
                total = 0.0
                for b in range(m):
                    total += p[a, b] * h[b]
                line[a] = total
            for a in range(m):
                s += h[a] * line[a]
                e -= h[a] * mean[a]
            innovation[i, j] = e
            spread[i, j] = s
            standard[i, j] = e / np.sqrt(s)
            for a in range(m):
                ga = line[a] / s
                gains[i, j, a] = ga
                mean[a] += ga * e
                for b in range(m):
                    p[a, b] -= ga * line[b]
        for a in range(m):
            filtered[i, a] = mean[a]
        if i < n - 1:
            for a in range(nx):
                total = drive[i, a]
                for b in range(nx):
                    total += phi[i, a, b] * mean[b]
                for b in range(nf):
                    total += gamma[i, a, b] * mean[nx + b]
                line[a] = total
            for a in range(nf):
                line[nx + a] = decay_f[i, a] * mean[nx + a]
            for a in range(nd):
                line[nx + nf + a] = decay_d[i, a] * mean[nx + nf + a]
            for a in range(m):
                mean[a] = line[a]
            _spread(p, work, phi[i], gamma[i], decay_f[i], variance_f, decay_d[i], variance_d)
    lam = np.zeros(m)
    big = np.zeros((m, m))
    for i in range(n - 1, -1, -1):
        if i < n - 1:
            _back(lam, big, work, line, phi[i], gamma[i], decay_f[i], decay_d[i])
        for j in range(q - 1, -1, -1):
            if not valid[i, j]:
                continue
            h = rows[i, j]
            k = gains[i, j]
            pull = innovation[i, j] / spread[i, j]
            more = 1.0 / spread[i, j]
            for a in range(m):
                total = 0.0
                for b in range(m):
                    total += big[a, b] * k[b]
                bk[a] = total
                pull += k[a] * lam[a]
            for a in range(m):
                more += k[a] * bk[a]
            alone[i, j] = pull / np.sqrt(more)
            for a in range(m):
                lam[a] -= h[a] * pull
                for b in range(m):
                    big[a, b] += h[a] * h[b] * more - h[a] * bk[b] - bk[a] * h[b]
        for a in range(m):
            total = predicted[i, a]
            for b in range(m):
                total -= covariance[i, a, b] * lam[b]
            mean_out[i, a] = total
        if var_out.size > 0:
            for a in range(m):
                left = covariance[i, a, a]
                for b in range(m):
                    total = 0.0
                    for c in range(m):
                        total += big[b, c] * covariance[i, a, c]
                    left -= covariance[i, a, b] * total
                var_out[i, a] = left


@njit(cache=True, nogil=True, error_model="numpy")
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
        variance_d, start, mean_out, var_out, standard, alone, np.empty_like(mean_out),
    )  # fmt: skip
