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
            for k in range(m):
                total = 0.0
                for b in range(nx):
                    total += phi[i, a, b] * p[b, k]
                for b in range(nf):
                    total += gamma[i, a, b] * p[nx + b, k]
                tp[a, k] = total
        for a in range(nf):
            for k in range(c):
                turned[nx + a, k] = decay_f[i, a] * mean[nx + a, k]
            for k in range(m):
                tp[nx + a, k] = decay_f[i, a] * p[nx + a, k]
        for a in range(nd):
            for k in range(c):
                turned[nx + nf + a, k] = decay_d[i, a] * mean[nx + nf + a, k]
            for k in range(m):
                tp[nx + nf + a, k] = decay_d[i, a] * p[nx + nf + a, k]
        for a in range(m):
            for b in range(nx):
                total = 0.0
                for k in range(nx):
                    total += tp[a, k] * phi[i, b, k]
                for k in range(nf):
                    total += tp[a, nx + k] * gamma[i, b, k]
                p[a, b] = total
            for b in range(nf):
                p[a, nx + b] = tp[a, nx + b] * decay_f[i, b]
            for b in range(nd):
                p[a, nx + nf + b] = tp[a, nx + nf + b] * decay_d[i, b]
        for a in range(nf):
            p[nx + a, nx + a] += variance_f[a] * (1.0 - decay_f[i, a] ** 2)
        for a in range(nd):
            p[nx + nf + a, nx + nf + a] += variance_d[a] * (1.0 - decay_d[i, a] ** 2)
        for a in range(m):
            for b in range(a):
                mid = 0.5 * (p[a, b] + p[b, a])
                p[a, b] = mid
                p[b, a] = mid
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
    mean_out, var_out : (n, nx + nf + nd) filled with smoothed means and variances
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
    covariance = np.zeros((n, m, m))
    gains = np.zeros((n, q, m))
    innovation = np.zeros((n, q))
    spread = np.zeros((n, q))
    rows = np.zeros((n, q, m))
    f = np.zeros((m, m))
    for i in range(n):
        predicted[i] = mean
        covariance[i] = p
        for j in range(q):
            standard[i, j] = 0.0
            alone[i, j] = 0.0
            if not valid[i, j]:
                continue
            h = rows[i, j]
            h[:nx] = slope[i, j]
            h[nx + nf :] = drift[j]
            g = p @ h
            s = variance[j] + h @ g
            e = resid[i, j] - h @ mean
            gains[i, j] = g / s
            innovation[i, j] = e
            spread[i, j] = s
            standard[i, j] = e / np.sqrt(s)
            mean = mean + g / s * e
            p = p - np.outer(g, g) / s
        filtered[i] = mean
        if i < n - 1:
            f[:] = 0.0
            f[:nx, :nx] = phi[i]
            f[:nx, nx : nx + nf] = gamma[i]
            for a in range(nf):
                f[nx + a, nx + a] = decay_f[i, a]
            for a in range(nd):
                f[nx + nf + a, nx + nf + a] = decay_d[i, a]
            mean = f @ mean
            mean[:nx] += drive[i]
            p = f @ p @ f.T
            for a in range(nf):
                p[nx + a, nx + a] += variance_f[a] * (1.0 - decay_f[i, a] ** 2)
            for a in range(nd):
                p[nx + nf + a, nx + nf + a] += variance_d[a] * (1.0 - decay_d[i, a] ** 2)
            p = 0.5 * (p + p.T)
    lam = np.zeros(m)
    big = np.zeros((m, m))
    for i in range(n - 1, -1, -1):
        if i < n - 1:
            f[:] = 0.0
            f[:nx, :nx] = phi[i]
            f[:nx, nx : nx + nf] = gamma[i]
            for a in range(nf):
                f[nx + a, nx + a] = decay_f[i, a]
            for a in range(nd):
                f[nx + nf + a, nx + nf + a] = decay_d[i, a]
            lam = f.T @ lam
            big = f.T @ big @ f
            # the update below contracts a symmetric matrix only; rounding would grow with an unstable hull
            big = 0.5 * (big + big.T)
        for j in range(q - 1, -1, -1):
            if not valid[i, j]:
                continue
            h = rows[i, j]
            k = gains[i, j]
            bk = big @ k
            pull = k @ lam + innovation[i, j] / spread[i, j]
            alone[i, j] = pull / np.sqrt(k @ bk + 1.0 / spread[i, j])
            lam = lam - h * pull
            big = big - np.outer(h, bk) - np.outer(bk, h) + np.outer(h, h) * (k @ bk + 1.0 / spread[i, j])
        mean_out[i] = predicted[i] - covariance[i] @ lam
        for a in range(m):
            var_out[i, a] = covariance[i, a, a] - covariance[i, a] @ big @ covariance[i, a]


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
