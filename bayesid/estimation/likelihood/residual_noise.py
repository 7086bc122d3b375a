"""Noise of residuals that remember: a vector autoregression, and the covariance it gives a score.

Takes residuals of several runs. Output error weighs readings as if their errors were independent; where
they are not, its estimate stands and its covariance does not (Maine and Iliff 1981; Morelli and Klein 1997,
J. Aircraft 34(2), who take the autocovariance of the residuals; here it comes from an autoregression, which
also reaches lags a short record shows badly; Lütkepohl 2005, ch. 3 and 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
MOST_ORDER = 8


@dataclass(frozen=True, eq=False)
class ResidualNoise:
    """Stationary noise of c channels in units of the stated noise.

    Attributes
    ----------
    lags : (p + 1, c, c) covariance at lags 0 to p, E[e(t + h) e(t)^T]
    coefficients : (p, c, c) of the autoregression; p = 0 is white
    """

    lags: Array
    coefficients: Array

    @property
    def order(self) -> int:
        return int(self.coefficients.shape[0])

    def correlation_time(self, count: int) -> float:
        """Integrated correlation time [samples] within records of so many, root mean square over channels."""
        lags = self.covariance(count)
        variance = np.maximum(np.einsum("hcc->hc", lags)[0], 1e-300)
        taper = 1.0 - np.arange(1, count) / count
        times = 1.0 + 2.0 * np.einsum("h,hc->c", taper, np.einsum("hcc->hc", lags)[1:] / variance)
        return float(np.sqrt(np.mean(np.maximum(times, 1.0) ** 2)))

    def covariance(self, count: int) -> Array:
        """(count, c, c) covariance at lags 0 to count - 1."""
        p, c = self.order, self.lags.shape[1]
        out = np.zeros((count, c, c))
        known = min(count, p + 1)
        out[:known] = self.lags[:known]
        if p:
            beside = np.hstack(list(self.coefficients))
            for h in range(p + 1, count):
                out[h] = beside @ out[h - p : h][::-1].reshape(p * c, c)
        return out

    def at_step(self, count: int, step: float) -> Array:
        """(count, c, c) covariance at lags 0, step, 2 step, ..., between lags in a straight line."""
        if step == 1.0:
            return self.covariance(count)
        lag = step * np.arange(count)
        whole = np.floor(lag).astype(int)
        known, part = self.covariance(int(whole[-1]) + 2), (lag - whole)[:, None, None]
        return (1.0 - part) * known[whole] + part * known[whole + 1]

    def spectrum(self, count: int, step: float = 1.0) -> Array:
        """(size // 2 + 1, c, c) spectral density of its covariance at lags up to `count` - 1, `step` apart,
        laid round a circle of a power of two that is at least twice as long.
        """
        lags = self.at_step(count, step)
        size, c = 1 << (2 * count - 1).bit_length(), lags.shape[1]
        two_sided = np.zeros((size, c, c))
        two_sided[:count] = lags
        two_sided[size - count + 1 :] = lags[1:][::-1].transpose(0, 2, 1)
        return np.asarray(np.fft.rfft(two_sided, axis=0))

    def draw(self, count: int, rng: np.random.Generator, step: float = 1.0) -> Array:
        """(count, c) errors of this noise, `step` lags apart (circulant embedding; Chan and Wood 1999)."""
        density = self.spectrum(count, step)
        size, c = 2 * (len(density) - 1), density.shape[1]
        values, vectors = np.linalg.eigh(0.5 * (density + density.conj().transpose(0, 2, 1)))
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        white = np.fft.rfft(rng.standard_normal((size, c)), axis=0)
        return np.fft.irfft(np.einsum("fab,fb->fa", root, white), size, axis=0)[:count]

    def of_score(self, columns: Array, step: float = 1.0) -> Array:
        """(k, k) covariance of sum over samples of columns^T e for (n, c, k) columns, `step` lags apart."""
        n = columns.shape[0]
        spectrum = self.spectrum(n, step)
        size = 2 * (len(spectrum) - 1)
        moved = np.fft.rfft(columns, size, axis=0)
        smeared = np.fft.irfft(np.einsum("fab,fbk->fak", spectrum, moved), size, axis=0)[:n]
        out = np.einsum("nak,nal->kl", columns, smeared)
        return 0.5 * (out + out.T)


def autocovariance(resids: Sequence[Array], valid: Sequence[Array], count: int) -> Array:
    """(count, c, c) covariance at lags 0 to count - 1 over all runs; missing readings count as none.

    Divided by the number of readings of both channels, as a geometric mean, so that the sequence is positive
    semidefinite.
    """
    c = resids[0].shape[1]
    out = np.zeros((count, c, c))
    used = np.zeros(c)
    for resid, ok in zip(resids, valid, strict=True):
        n = resid.shape[0]
        size = 1 << (2 * n - 1).bit_length()
        f = np.fft.rfft(np.where(ok, resid, 0.0), size, axis=0)
        found = np.fft.irfft(f[:, :, None] * f.conj()[:, None, :], size, axis=0)
        used += ok.sum(axis=0)
        m = min(count, n)
        out[:m] += found[:m]
    root = np.sqrt(np.maximum(used, 1.0))
    return out / np.outer(root, root)


def residual_noise(resids: Sequence[Array], valid: Sequence[Array], most: int = MOST_ORDER) -> ResidualNoise:
    """Autoregression of the residuals of several runs, of order 0 to `most`.

    Whether they have memory BIC says: some order must beat 0 by it. How long it is says the corrected AIC,
    efficient where no finite order is the true one (Shibata 1980, Ann. Statist. 8(1)): a slow force under
    white noise is of infinite order, and the order of least BIC gives its slow errors too little.
    """
    count = sum(int(ok.any(axis=1).sum()) for ok in valid)
    c = resids[0].shape[1]
    shortest = min(r.shape[0] for r in resids)
    most = max(0, min(most, shortest // 3, count // (5 * c)))
    lags = autocovariance(resids, valid, most + 1)
    lags[0] += 1e-9 * np.diag(np.maximum(np.diag(lags[0]), 1e-12))
    tried: list[tuple[float, float, ResidualNoise]] = []
    for p in range(most + 1):
        coefficients, left = yule_walker(lags, p)
        sign, logdet = np.linalg.slogdet(left)
        if sign <= 0:
            break
        misfit, unknowns = count * logdet, p * c * c
        bic = misfit + np.log(max(count, 2)) * unknowns
        aic = misfit + 2.0 * unknowns * count * c / max(count * c - unknowns - 1, 1)
        tried.append((aic, bic, ResidualNoise(lags[: p + 1], coefficients)))
    if not tried or min(tried, key=lambda one: one[1]) is tried[0]:
        return ResidualNoise(lags[:1], np.zeros((0, c, c)))
    return min(tried[1:], key=lambda one: one[0])[2]


def yule_walker(lags: Array, order: int) -> tuple[Array, Array]:
    """Coefficients (p, c, c) and innovation covariance (c, c) from autocovariances."""
    c = lags.shape[1]
    if order == 0:
        return np.zeros((0, c, c)), lags[0]

    def at(h: int) -> Array:
        return lags[h] if h >= 0 else lags[-h].T

    matrix = np.block([[at(j - i) for j in range(order)] for i in range(order)])
    right = np.hstack([lags[h] for h in range(1, order + 1)])
    found = np.linalg.solve(matrix.T, right.T).T
    coefficients = found.reshape(c, order, c).transpose(1, 0, 2)
    left = lags[0] - sum(coefficients[i] @ lags[i + 1].T for i in range(order))
    return coefficients, 0.5 * (left + left.T)
