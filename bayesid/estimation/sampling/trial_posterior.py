"""The posterior density of a trial: priors, all runs, noise, initial states and the memory of the residuals.

Takes a `FitProblem`, an estimate and `SamplingSettings`; `trial_setup.trial_density` puts them together.
Does not fit or sample. Model error of any other form than persistent residuals is not in it: see
`bayesid.estimation.filter_error` and `bayesid diagnose`.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import gammaln

from bayesid.estimation.output_error import FitProblem, readings_batch
from bayesid.estimation.sampling.density import Laplace, Unknowns
from bayesid.estimation.sampling.likelihood_adjustment import LikelihoodAdjustment
from bayesid.estimation.sampling.priors import LOG_2PI, NoisePrior, ParameterPrior, draw_params, prior_moments
from bayesid.estimation.sampling.residual_sums import ChannelResiduals, ResidualSums
from bayesid.estimation.sampling.settings import SamplingSettings

Array = np.ndarray
WIDEST = 1e6  # a noise level further from its prior's centre than by this factor is impossible


@dataclass(frozen=True, eq=False)
class TrialDensity:
    """Posterior density of a problem's unknowns (a `Density`).

    Sampling coordinates: parameters and initial states as they are, logarithms of noise levels, logits of
    correlations.

    Attributes
    ----------
    z : (nz,) all unknowns of the problem at the estimate
    data : per run and channel
    noise_prior : of the channels in `channels`
    laplace : Gaussian approximation about the estimate
    threads : at work on batches of 128 points and more; does not change a number
    adjustment : of the likelihood by the parameters; None leaves it
    """

    problem: FitProblem
    choice: SamplingSettings
    z: Array
    channels: tuple[str, ...]
    data: tuple[tuple[ChannelResiduals, ...], ...]
    noise_prior: NoisePrior
    laplace: Laplace
    threads: int = 2
    adjustment: LikelihoodAdjustment | None = None

    # ---- layout ----
    @property
    def k(self) -> int:
        return len(self.problem.params.names)

    @cached_property
    def _prior(self) -> ParameterPrior:
        return ParameterPrior(self.problem.params)

    @cached_property
    def _estimated(self) -> list[Array]:
        """Initial states at the estimate."""
        return self.problem.split(self.z)[1]

    @cached_property
    def _initial(self) -> slice:
        """Initial states among the unknowns."""
        return slice(self.k, self.k + (self.problem.n_initial if self.choice.initial == "sampled" else 0))

    @cached_property
    def _sigma(self) -> slice:
        count = len(self.channels) if self.choice.noise == "sampled" else 0
        return slice(self._initial.stop, self._initial.stop + count)

    @cached_property
    def _phi(self) -> slice:
        count = len(self.channels) if self.choice.memory == "ar1" else 0
        return slice(self._sigma.stop, self._sigma.stop + count)

    @cached_property
    def unknowns(self) -> Unknowns:
        p, k, size = self.problem, self.k, self._phi.stop
        names = p.names[: self._initial.stop]
        names += tuple(f"sigma:{c}" for c in self.channels[: self._sigma.stop - self._sigma.start])
        names += tuple(f"phi:{c}" for c in self.channels[: self._phi.stop - self._phi.start])
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        low[:k], high[:k] = p.params.vector("low"), p.params.vector("high")
        low[self._sigma], low[self._phi], high[self._phi] = 0.0, 0.0, 1.0
        mean, sd = np.zeros(size), np.full(size, np.inf)
        mean[:k], sd[:k] = prior_moments(p.params)
        mean[self._initial] = p.start[self._initial]
        spread = np.concatenate([np.zeros(0), *(r.initial_sd for r in p.runs)])
        sd[self._initial] = spread[: width(self._initial)]
        if width(self._sigma):
            mean[self._sigma], sd[self._sigma] = self.noise_prior.moments()
        mean[self._phi], sd[self._phi] = 0.5, 1 / np.sqrt(12.0)
        scale = np.ones(size)
        scale[:k] = p.params.vector("file_scale")
        return Unknowns(names, k, low, high, mean, sd, scale)

    @cached_property
    def digest(self) -> str:
        text = f"{self.problem.digest}|{self.choice}|{self.channels}|{self.noise_prior.scale.tolist()}"
        hashed = hashlib.sha256(text.encode())
        hashed.update(np.ascontiguousarray(self.z).tobytes())
        if self.adjustment is not None:
            for part in (self.adjustment.centre, self.adjustment.matrix, self.adjustment.tilt):
                hashed.update(np.ascontiguousarray(part).tobytes())
        return hashed.hexdigest()[:16]

    @property
    def settings(self) -> dict[str, Any]:
        """What a result should say about this density."""
        weights = {
            f"{run.name}:{name}": c.tau
            for run, row in zip(self.problem.runs, self.data, strict=True)
            for name, c in zip(run.channels, row, strict=True)
        }
        adjusted = self.adjustment is not None
        return {"density": asdict(self.choice), "correlation_times": weights, "adjusted": adjusted}

    def natural(self, q: Array) -> Array:
        out = np.array(q, dtype=float)
        out[..., self._sigma] = np.exp(out[..., self._sigma])
        out[..., self._phi] = 1.0 / (1.0 + np.exp(-out[..., self._phi]))
        return out

    def coordinates(self, v: Array) -> Array:
        """Sampling coordinates (..., k) of points in natural units: the inverse of `natural`."""
        out = np.array(v, dtype=float)
        out[..., self._sigma] = np.log(out[..., self._sigma])
        out[..., self._phi] = np.log(out[..., self._phi] / (1.0 - out[..., self._phi]))
        return out

    # ---- density ----
    def log_prob(self, q: Array) -> Array:
        """(b,) log posterior density by q, up to a constant.

        Parameters
        ----------
        q : (b, k) sampling coordinates

        Returns
        -------
        -inf outside the bounds, nan where a run diverges
        """
        v = self.natural(q)
        out = self.log_prior(v)
        sigma, phi = v[:, self._sigma], v[:, self._phi]
        with np.errstate(divide="ignore"):
            out += np.log(sigma).sum(axis=1) + np.log(phi * (1 - phi)).sum(axis=1)
        inside = np.isfinite(out)
        if inside.any():
            out[inside] += self.log_likelihood(v[inside])
        return out

    def log_prior(self, v: Array) -> Array:
        """(b,) log prior density of (b, k) points in natural units, by them; -inf outside the bounds."""
        out = self._prior.log(v[:, : self.k])
        if width(self._initial):
            at = self._initial
            distance = (v[:, at] - self.unknowns.prior_mean[at]) / self.unknowns.prior_sd[at]
            out -= 0.5 * np.sum(distance**2, axis=1) + np.sum(np.log(self.unknowns.prior_sd[at]))
        if width(self._sigma):
            sigma = v[:, self._sigma]
            ratio = sigma / self.noise_prior.scale
            good = np.all((ratio > 1 / WIDEST) & (ratio < WIDEST), axis=1)
            out[~good] = -np.inf
            out[good] += self.noise_prior.log(sigma[good])
        phi = v[:, self._phi]
        out[~np.all((phi > 0) & (phi < 1), axis=1)] = -np.inf
        return out

    def log_likelihood(self, v: Array) -> Array:
        """(b,) log likelihood of (b, k) points in natural units; nan where a run diverges."""
        v = np.atleast_2d(v)
        asked, added = v[:, : self.k], np.zeros(v.shape[0])
        if self.adjustment is not None:
            added, asked = self.adjustment.added(asked), self.adjustment.argument(asked)
        with np.errstate(all="ignore"):
            readings = readings_batch(self.problem, asked, self._starts(v), self.threads)
            if self.choice.student is not None:
                return added + self._student(v, readings)
            return added + self._gaussian(v, readings)

    def _starts(self, v: Array) -> list[Array]:
        starts = self._estimated
        if not width(self._initial):
            return starts
        at, found = self.k, []
        for run, x0 in zip(self.problem.runs, starts, strict=True):
            own = np.repeat(x0[None], v.shape[0], axis=0)
            where = [self.problem.model.states.index(s) for s in run.initial]
            own[:, where] = v[:, at : at + len(where)]
            at += len(where)
            found.append(own)
        return found

    def _level(self, v: Array, run: Any, name: str) -> Array:
        """(b,) noise of a channel."""
        if width(self._sigma):
            return np.asarray(v[:, self._sigma.start + self.channels.index(name)])
        return np.full(v.shape[0], float(run.sigma[run.channels.index(name)]))

    def _gaussian(self, v: Array, readings: list[list[Array]]) -> Array:
        b, ar1 = v.shape[0], self.choice.memory == "ar1"
        marginal = self.choice.noise == "marginal"
        out = np.zeros(b)
        pooled = {c: np.zeros(b) for c in self.channels}
        counts = dict.fromkeys(self.channels, 0.0)
        at = self.k
        for run, row, simulated in zip(self.problem.runs, self.data, readings, strict=True):
            m = row[0].slopes.shape[1]
            mixed, bent = np.zeros((b, m)), np.zeros((1, m, m))
            for name, channel, one in zip(run.channels, row, simulated, strict=True):
                sums = ResidualSums.of(channel, channel.residuals(one), ar1)
                phi = v[:, self._phi.start + self.channels.index(name)] if ar1 else None
                squares, mix, slopes = sums.at(phi)
                count = channel.count / channel.tau
                if phi is not None:
                    out -= 0.5 * channel.links.shape[1] * np.log(1 - phi * phi)
                if marginal:
                    pooled[name] += squares / channel.tau
                    counts[name] += count
                    continue
                sigma = self._level(v, run, name)
                weight = 1.0 / (sigma * sigma * channel.tau)
                out -= 0.5 * squares * weight + count * (np.log(sigma) + 0.5 * LOG_2PI)
                mixed = mixed + mix * weight[:, None]
                bent = bent + slopes * weight[:, None, None]
            if m:
                out += self._integrated(run, at, mixed, bent)
            at += len(run.initial)
        if marginal:
            a = 0.5 * self.noise_prior.weight
            for i, c in enumerate(self.channels):
                total, number = pooled[c], counts[c]
                rest = a * self.noise_prior.scale[i] ** 2
                out -= (a + 0.5 * number) * np.log(rest + 0.5 * total)
                out += gammaln(a + 0.5 * number) - gammaln(a) + a * np.log(rest) - 0.5 * number * LOG_2PI
        return out

    def _integrated(self, run: Any, at: int, mixed: Array, bent: Array) -> Array:
        """(b,) what integrating over a run's initial state adds, linear in it about the estimate.

        With r(s) = r + J d, d = s - estimate, and prior precision P about the estimate + offset: the exponent
        is r'r/2 + d'J'r + d'(J'J + P)d/2 - d'P offset + offset'P offset/2.
        """
        precision = 1.0 / run.initial_sd**2
        offset = self.problem.start[at : at + precision.size] - self.z[at : at + precision.size]
        root = np.linalg.cholesky(bent + np.diag(precision))
        right = mixed - precision * offset
        root = np.broadcast_to(root, (right.shape[0], *root.shape[1:]))
        solved = np.linalg.solve(root, right[:, :, None])[:, :, 0]
        known = precision[precision > 0]
        return np.asarray(
            0.5 * np.sum(solved**2, axis=1)
            - 0.5 * np.sum(precision * offset**2)
            - np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
            + 0.5 * np.sum(np.log(known))
        )

    def _student(self, v: Array, readings: list[list[Array]]) -> Array:
        nu = float(self.choice.student or 1.0)
        const = gammaln(0.5 * (nu + 1)) - gammaln(0.5 * nu) - 0.5 * np.log(nu * np.pi)
        out = np.zeros(v.shape[0])
        for run, row, simulated in zip(self.problem.runs, self.data, readings, strict=True):
            for name, channel, one in zip(run.channels, row, simulated, strict=True):
                sigma = self._level(v, run, name)
                ratio = channel.residuals(one) / sigma[:, None]
                logs = 0.5 * (nu + 1) * np.sum(np.log1p(ratio * ratio / nu), axis=1)
                out += (channel.count * (const - np.log(sigma)) - logs) / channel.tau
        return out

    # ---- draws ----
    def prior_draws(self, count: int, rng: np.random.Generator) -> Array:
        """(count, k) draws from the prior, natural units.

        Raises
        ------
        SampleError
            a prior that is not proper
        """
        out = np.empty((count, self._phi.stop))
        out[:, : self.k] = draw_params(self.problem.params, count, rng)
        at = self._initial
        spread = rng.standard_normal((count, width(at))) * self.unknowns.prior_sd[at]
        out[:, at] = self.unknowns.prior_mean[at] + spread
        if width(self._sigma):
            out[:, self._sigma] = self.noise_prior.draw(count, rng)
        out[:, self._phi] = rng.uniform(size=(count, width(self._phi)))
        return out


def width(part: slice) -> int:
    """Length of a slice."""
    return int(part.stop - part.start)
