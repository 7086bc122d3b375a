"""The posterior density of a trial with its gradient, for samplers that follow slopes.

Takes a `TrialDensity`. Gives the same density with `log_prob_slope`. First-order autoregressive residuals
have no slope here: use memory "inflate".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bayesid.errors import ModelError, SampleError
from bayesid.estimation.output_error.reading_gradient import reading_gradient
from bayesid.estimation.sampling.density import Laplace, Unknowns
from bayesid.estimation.sampling.priors import LOG_2PI
from bayesid.estimation.sampling.residual_sums import ChannelResiduals
from bayesid.estimation.sampling.trial_posterior import TrialDensity, width

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class GradientTrialDensity:
    """A trial's density and its gradient by the sampling coordinates.

    Raises
    ------
    SampleError
        residuals are modelled as an autoregression, or noise is integrated out
    """

    density: TrialDensity

    def __post_init__(self) -> None:
        choice = self.density.choice
        if choice.memory == "ar1" or choice.noise == "marginal":
            raise SampleError(
                'the gradient sampler takes memory "inflate" or "ignore" and noise "sampled" or "fixed"; '
                "use the ensembles for the other settings"
            )

    @property
    def unknowns(self) -> Unknowns:
        return self.density.unknowns

    @property
    def digest(self) -> str:
        return self.density.digest

    @property
    def laplace(self) -> Laplace:
        return self.density.laplace

    @property
    def settings(self) -> dict[str, Any]:
        return self.density.settings

    def natural(self, q: Array) -> Array:
        return self.density.natural(q)

    def coordinates(self, v: Array) -> Array:
        return self.density.coordinates(v)

    def log_prob(self, q: Array) -> Array:
        return self.density.log_prob(q)

    def log_prior(self, v: Array) -> Array:
        return self.density.log_prior(v)

    def log_prob_slope(self, q: Array) -> tuple[float, Array]:
        """Log density of one point (k,), up to the constant of `log_prob`, and its gradient by q."""
        d = self.density
        v = d.natural(q)
        value = float(d.log_prior(v[None])[0] + np.log(v[d._sigma]).sum())
        if not np.isfinite(value):
            return -np.inf, np.zeros(q.size)
        work = _Runs(d, v)
        try:
            by_z = reading_gradient(d.problem, work.z, work)
        except ModelError:
            return -np.inf, np.zeros(q.size)
        out = self._prior_slope(v)
        if d.adjustment is not None:
            by_z[: d.k] = d.adjustment.matrix.T @ by_z[: d.k] + d.adjustment.tilt
            value += float(d.adjustment.added(v[: d.k]))
        out[: d._initial.stop] += by_z[: d._initial.stop]
        out[d._sigma] += work.by_log_sigma[: width(d._sigma)]
        return value + work.value, out

    def _prior_slope(self, v: Array) -> Array:
        d, out = self.density, np.zeros(v.size)
        params = d.problem.params
        resid, slopes = params.prior_residuals(v[: d.k])
        out[: d.k] = -slopes.T @ resid
        for i, p in enumerate(params.free):
            if p.prior is not None and p.prior.kind == "lognormal":
                out[i] -= 1.0 / v[i]
        at = d._initial
        out[at] -= (v[at] - d.unknowns.prior_mean[at]) / d.unknowns.prior_sd[at] ** 2
        if width(d._sigma):
            sigma, prior = v[d._sigma], d.noise_prior
            if prior.kind == "half_normal":
                by_log = -((sigma / (prior.reach * prior.scale)) ** 2)
            else:
                by_log = prior.weight * prior.scale**2 / sigma**2 - prior.weight - 1.0
            out[d._sigma] = by_log + 1.0  # the last by the change to logarithms
        return out


class _Runs:
    """Log likelihood of one point, collected run by run while its slopes by the readings are handed out."""

    def __init__(self, density: TrialDensity, v: Array) -> None:
        self.density, self.v = density, v
        self.value = 0.0
        self.by_log_sigma = np.zeros(len(density.channels))
        self.z = density.z.copy()
        self.z[: density._initial.stop] = v[: density._initial.stop]
        if density.adjustment is not None:
            self.z[: density.k] = density.adjustment.argument(v[: density.k])
        problem = density.problem
        widths = [len(r.initial) for r in problem.runs]
        self.first = density.k + np.concatenate([[0], np.cumsum(widths)]).astype(int)

    def __call__(self, number: int, readings: Array) -> Array:
        d = self.density
        run, row = d.problem.runs[number], d.data[number]
        levels = [float(d._level(self.v[None], run, name)[0]) for name in run.channels]
        resid = [c.residuals(readings[None, :, j].copy())[0] for j, c in enumerate(row)]
        if d.choice.student is not None:
            return self._student(run.channels, row, levels, resid)
        weights = [1.0 / (s * s * c.tau) for s, c in zip(levels, row, strict=True)]
        shift, spread = self._initial_state(run, number, row, weights, resid)
        out = np.empty_like(readings)
        for j, (name, c) in enumerate(zip(run.channels, row, strict=True)):
            squares, count, w = float(resid[j] @ resid[j]), c.count / c.tau, weights[j]
            self.value -= 0.5 * squares * w + count * (np.log(levels[j]) + 0.5 * LOG_2PI)
            by_log = squares * w - count
            if shift is not None:
                moved = c.slopes @ shift
                by_log += w * float(moved @ (moved - 2.0 * resid[j]) + (spread * c.gram).sum())
                out[:, j] = w * (moved - resid[j])
            else:
                out[:, j] = -w * resid[j]
            self.by_log_sigma[d.channels.index(name)] += by_log
        return out

    def _initial_state(
        self,
        run: Any,
        number: int,
        row: tuple[ChannelResiduals, ...],
        weights: list[float],
        resid: list[Array],
    ) -> tuple[Array | None, Array]:
        """Best change of an integrated initial state (m,), and its covariance (m, m)."""
        d = self.density
        m = row[0].slopes.shape[1]
        if not m:
            return None, np.zeros((0, 0))
        precision = 1.0 / run.initial_sd**2
        at = self.first[number]
        offset = d.problem.start[at : at + m] - d.z[at : at + m]
        right = -precision * offset
        bent = np.diag(precision)
        for c, w, r in zip(row, weights, resid, strict=True):
            right = right + w * (r @ c.slopes)
            bent = bent + w * c.gram
        spread = np.linalg.inv(bent)
        shift = spread @ right
        self.value += 0.5 * float(right @ shift) - 0.5 * float(np.sum(precision * offset**2))
        self.value += 0.5 * float(np.sum(np.log(precision[precision > 0])))
        self.value -= float(np.log(np.diag(np.linalg.cholesky(bent))).sum())
        return shift, spread

    def _student(
        self,
        names: tuple[str, ...],
        row: tuple[ChannelResiduals, ...],
        levels: list[float],
        resid: list[Array],
    ) -> Array:
        from scipy.special import gammaln

        d = self.density
        nu = float(d.choice.student or 1.0)
        const = gammaln(0.5 * (nu + 1)) - gammaln(0.5 * nu) - 0.5 * np.log(nu * np.pi)
        columns = []
        for name, c, s, r in zip(names, row, levels, resid, strict=True):
            ratio = (r / s) ** 2
            logs = 0.5 * (nu + 1) * float(np.sum(np.log1p(ratio / nu)))
            self.value += float(c.count * (const - np.log(s)) - logs) / c.tau
            pull = (nu + 1) / (nu + ratio)
            columns.append(-pull * r / (s * s * c.tau))
            by_log = (float(np.sum(pull * ratio)) - c.count) / c.tau
            self.by_log_sigma[d.channels.index(name)] += by_log
        return np.stack(columns, axis=1)
