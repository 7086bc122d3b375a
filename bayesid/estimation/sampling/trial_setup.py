"""From a problem and an estimate to a density ready to be sampled, with its Laplace approximation.

Takes a `FitProblem`, the unknowns of a fit and `SamplingSettings`. Does not fit or sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.output_error import FitProblem, beyond_chance, memory
from bayesid.estimation.sampling.density import Laplace
from bayesid.estimation.sampling.likelihood_adjustment import likelihood_adjustment
from bayesid.estimation.sampling.priors import NoisePrior
from bayesid.estimation.sampling.residual_sums import ChannelResiduals, neighbours
from bayesid.estimation.sampling.settings import SamplingSettings
from bayesid.estimation.sampling.trial_posterior import TrialDensity, width

Array = np.ndarray
ROUNDING = 1e-12  # scaled precisions of an initial state, least over largest
_NOT_YET = Laplace(np.zeros(0), np.zeros((0, 0)))


def trial_density(
    problem: FitProblem,
    z: Array,
    settings: SamplingSettings | None = None,
    stated: Mapping[str, float] | None = None,
    honest: tuple[Array, Array] | None = None,
) -> TrialDensity:
    """Density of a problem about an estimate.

    Parameters
    ----------
    z : (nz,) all unknowns of the problem, as `Fit.z`; near the mode
    stated : channel -> noise the prior of the noise is centred on [SI]; by default the problem's
    honest : mean (k,) and covariance (k, k) of the parameters [SI] that allow for what white noise does not;
        the likelihood is adjusted to them. Noise is fixed and memory ignored then

    Raises
    ------
    SampleError
        settings that exclude each other, or an estimate at which the vehicle diverges
    """
    choice = settings or SamplingSettings()
    if honest is not None and (choice.noise != "fixed" or choice.memory != "ignore"):
        raise SampleError('a likelihood adjusted to a covariance takes noise "fixed" and memory "ignore"')
    z = np.asarray(z, dtype=float)
    channels = tuple(dict.fromkeys(c for run in problem.runs for c in run.channels))
    if not np.isfinite(problem.cost(z)):
        raise SampleError("the simulated vehicle diverges at the estimate; fit again before sampling")
    resid, jac = problem.jacobian(z)
    data, squares, counts = [], dict.fromkeys(channels, 0.0), dict.fromkeys(channels, 0.0)
    row, column = 0, len(problem.params.names)
    for run in problem.runs:
        (n, c), m = run.readings.shape, len(run.initial)
        here = resid[row : row + n * c].reshape(n, c) * run.sigma
        slopes = jac[row : row + n * c, column : column + m].reshape(n, c, m)
        slopes = slopes * np.asarray(run.sigma)[None, :, None]
        row, column = row + n * c, column + m
        found = []
        for j, name in enumerate(run.channels):
            finite = np.isfinite(run.readings[:, j])
            tau = memory(here[finite, j]) if choice.memory == "inflate" else 1.0
            tau = beyond_chance(tau, int(finite.sum()))
            kept = slopes[:, j] if choice.initial == "marginal" else slopes[:, j, :0]
            found.append(
                ChannelResiduals(
                    run.readings[:, j], bool(run.circular[j]), np.ascontiguousarray(kept),
                    neighbours(run.plan.t, finite), tau,
                )
            )  # fmt: skip
            squares[name] += float(np.sum(here[:, j] ** 2)) / tau
            counts[name] += float(finite.sum()) / tau
        data.append(tuple(found))
    scale = np.array([_stated(problem, c, stated or {}) for c in channels])
    prior = NoisePrior(choice.noise_prior, scale, choice.noise_weight, choice.noise_reach)
    density = TrialDensity(problem, choice, z, channels, tuple(data), prior, _NOT_YET)
    if honest is not None:
        found_map = likelihood_adjustment(problem, z, *honest, choice.initial == "fixed")
        density = replace(density, adjustment=found_map)
    total, number = (np.array([d[c] for c in channels]) for d in (squares, counts))
    level = scale if choice.noise == "fixed" else prior.mode_of(total, number)
    _check_starts(density, level)
    return replace(density, laplace=_laplace(density, level, number))


def _check_starts(density: TrialDensity, level: Array) -> None:
    """Refuse a vehicle so unstable on a run that integrating its start out drowns in rounding."""
    for run, row in zip(density.problem.runs, density.data, strict=True):
        if not row[0].slopes.shape[1]:
            continue
        with np.errstate(all="ignore"):
            bent = np.diag(1.0 / run.initial_sd**2)
            for name, c in zip(run.channels, row, strict=True):
                bent = bent + c.gram / (level[density.channels.index(name)] ** 2 * c.tau)
            size = np.sqrt(np.diag(bent))
            values = (
                np.linalg.eigvalsh(bent / np.outer(size, size)) if np.isfinite(bent).all() else np.zeros(1)
            )
        if values[0] <= ROUNDING * values[-1]:
            most = max(float(np.abs(c.slopes).max()) for c in row)
            growth = f"{most:.1g} times" if np.isfinite(most) else "beyond all bounds"
            raise SampleError(
                f"{run.name}: with these coefficients a small change of the start grows {growth}; "
                "the vehicle is unstable on this run and its start cannot be integrated out. Cut the runs "
                "into shorter pieces (bayesid sample --pieces), or fix the initial states"
            )


def _stated(problem: FitProblem, channel: str, stated: Mapping[str, float]) -> float:
    value = stated.get(channel)
    if value:
        return float(value)
    found = [float(r.sigma[r.channels.index(channel)]) for r in problem.runs if channel in r.channels]
    return float(np.median(found))


def _laplace(density: TrialDensity, level: Array, counts: Array) -> Laplace:
    """Gauss-Newton curvature with the noise at its own mode; noise and correlation apart from the rest."""
    choice, k, k_all = density.choice, density.k, density._phi.stop
    phi = _first_correlation(density) if choice.memory == "ar1" else np.zeros(len(density.channels))
    runs = []
    for run, row in zip(density.problem.runs, density.data, strict=True):
        factor = {}
        for name, channel in zip(run.channels, row, strict=True):
            i = density.channels.index(name)
            own = level[i] if choice.noise != "fixed" else float(run.sigma[run.channels.index(name)])
            factor[name] = own * np.sqrt(channel.tau * (1 + phi[i]) / (1 - phi[i]))
        runs.append(run.with_sigma(factor))
    scaled = replace(density.problem, runs=tuple(runs))
    _, jac = scaled.compressed(density.z)
    scale = scaled.scale
    if density.adjustment is not None:
        readings = jac.shape[0] - scaled.prior(density.z)[0].size
        jac[:readings, :k] = jac[:readings, :k] @ density.adjustment.matrix
    if choice.initial == "fixed":
        jac, scale = jac[:, :k], scale[:k]
    room = (scaled.high - scaled.low)[: scale.size] / scale
    curvature = (jac * scale).T @ (jac * scale) + np.diag(np.where(np.isfinite(room), 12.0 / room**2, 0.0))
    values, vectors = np.linalg.eigh(curvature)
    inverse = (vectors / np.maximum(values, 1e-14 * values.max())) @ vectors.T
    covariance = (inverse * np.outer(scale, scale))[: density._initial.stop, : density._initial.stop]
    mode, whole = np.zeros(k_all), np.zeros((k_all, k_all))
    mode[: density._initial.stop] = density.z[: density._initial.stop]
    whole[: density._initial.stop, : density._initial.stop] = covariance
    if width(density._sigma):
        mode[density._sigma] = np.log(level)
        whole[density._sigma, density._sigma] = np.diag(1.0 / (2 * counts + choice.noise_weight))
    if width(density._phi):
        mode[density._phi] = np.log(phi / (1 - phi))
        spread = (1 - phi**2) / (np.maximum(counts, 1) * (phi * (1 - phi)) ** 2)
        whole[density._phi, density._phi] = np.diag(spread)
    low, high = np.full(k_all, -np.inf), np.full(k_all, np.inf)
    low[:k], high[:k] = density.unknowns.low[:k], density.unknowns.high[:k]
    return Laplace(mode, whole, low, high)


def _first_correlation(density: TrialDensity) -> Array:
    """(c,) correlation of neighbouring residuals at the estimate, within 0.05 and 0.98."""
    readings = density.problem.readings(density.z)
    top, bottom = np.zeros(len(density.channels)), np.zeros(len(density.channels))
    for run, row, simulated in zip(density.problem.runs, density.data, readings, strict=True):
        for j, (name, channel) in enumerate(zip(run.channels, row, strict=True)):
            resid = channel.residuals(simulated[None, :, j].copy())[0]
            i = density.channels.index(name)
            top[i] += float(resid[channel.links[0]] @ resid[channel.links[1]])
            bottom[i] += float(resid @ resid)
    return np.clip(top / np.maximum(bottom, 1e-300), 0.05, 0.98)
