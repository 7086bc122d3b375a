"""How large the environment is: latent forces, sensor drift, and the filter settings they mean.

Takes amplitudes and correlation times. Gives whitened stacks of all runs. Does not estimate (see
`noise_identification`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.kalman import whiten
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.regressor_columns import known, regressor_columns
from bayesid.estimation.filter_error.smoother import BLOCK, smooth_filtered
from bayesid.estimation.run_data import Array


@dataclass(frozen=True)
class NoiseModel:
    """Stationary standard deviations and correlation times of the environment.

    Attributes
    ----------
    force : one per force axis [N, N m]
    force_tau : [s]
    drift : slow error of x and y, one standard deviation [m]
    drift_tau : [s]
    arms : moment per force of each pair of `COUPLED_AXES` axes the model has [m]; empty stands for zeros
    depth : slow error of z, one standard deviation [m]; None stands for that of x and y. Depth comes from
        the pressure, another instrument than the position's
    """

    force: tuple[float, ...]
    force_tau: float
    drift: float
    drift_tau: float
    arms: tuple[float, ...] = ()
    depth: float | None = None

    def scaled(self, factor: float) -> NoiseModel:
        """All amplitudes times a factor."""
        return replace(
            self,
            force=tuple(f * factor for f in self.force),
            drift=self.drift * factor,
            depth=None if self.depth is None else self.depth * factor,
        )

    def slow(self, channel: str) -> float:
        """Slow error of a measured channel, one standard deviation [m]; zero where it has none."""
        if channel == "z" and self.depth is not None:
            return self.depth
        return self.drift if channel in ("x", "y", "z") else 0.0


# Moments that come with a lateral or vertical disturbance: it acts at some place along the hull, and the
# true inertia turns a side force into yaw otherwise than the nominal one does.
COUPLED_AXES = (("Y", "N"), ("Z", "M"), ("Y", "K"))


def pairs(model: Model) -> tuple[tuple[int, int], ...]:
    """Positions (moment, force) of the `COUPLED_AXES` axes the model has, among its force axes."""
    axes = [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]
    return tuple((axes.index(m), axes.index(f)) for f, m in COUPLED_AXES if f in axes and m in axes)


def mixing(model: Model, noise_model: NoiseModel) -> Array:
    """(nf, nf) matrix that turns the independent latent signals into forces of the axes."""
    out = np.eye(len(noise_model.force))
    for (moment, force), arm in zip(pairs(model), noise_model.arms, strict=False):
        out[moment, force] = arm
    return out


@dataclass(frozen=True)
class LatentInputs:
    """A generic latent signal put into named inputs or channels.

    Attributes
    ----------
    inputs : names of latent inputs (see `linearise.latent_inputs`)
    channels : names of measured channels
    sd : one standard deviation per input and channel [SI]
    tau : correlation time [s]
    masks : per run, (n,) bool where it may act; None everywhere
    """

    inputs: tuple[str, ...]
    channels: tuple[str, ...]
    sd: tuple[float, ...]
    tau: float
    masks: tuple[Array, ...] | None = None


def force_unit(model: Model) -> Array:
    """1/2 rho L^2 U^2 for forces and 1/2 rho L^3 U^2 for moments, per force axis."""
    s = model.scales
    base = 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
    names = [n for n in model.kernel.exogenous if n.startswith("force_")]
    return np.array([base * (1.0 if n[-1] in "XYZ" else s["L"]) for n in names])


@dataclass(frozen=True, eq=False)
class Filter:
    """Arguments of `kalman.whiten` and `smoother.smooth` for one run."""

    variance: Array
    gamma: Array
    decay_f: Array
    variance_f: Array
    drift: Array
    decay_d: Array
    variance_d: Array
    start: Array


def filter_settings(
    model: Model,
    path: Linearisation,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
    run: int = 0,
) -> Filter:
    """Filter settings of one run under an environment and, if given, a generic latent signal.

    Latent inputs in order: environment, latent signal, jumps of the state after events.
    """
    log = path.log
    gaps = np.diff(log.plan.t)
    names = log.channels
    gamma = [path.gamma[:, :, : len(noise_model.force)]]
    if any(noise_model.arms):
        gamma[0] = gamma[0].copy()
        for (moment, force), arm in zip(pairs(model), noise_model.arms, strict=False):
            gamma[0][:, :, force] += arm * path.gamma[:, :, moment]
    keep = [np.exp(-gaps / noise_model.force_tau)] * len(noise_model.force)
    variance = [f**2 for f in noise_model.force]
    seen = [j for j, c in enumerate(names) if c in ("x", "y", "z")]
    keep_d = [np.exp(-gaps / noise_model.drift_tau)] * len(seen)
    variance_d = [noise_model.slow(names[j]) ** 2 for j in seen]
    if latent is not None:
        where = [path.inputs.index(n) for n in latent.inputs]
        sd = dict(zip((*latent.inputs, *latent.channels), latent.sd, strict=True))
        faded = np.exp(-gaps / latent.tau)
        extra = path.gamma[:, :, where]
        if latent.masks is not None:
            extra = extra * latent.masks[run][:-1, None, None]
        gamma.append(extra)
        keep += [faded] * len(where)
        variance += [sd[n] ** 2 for n in latent.inputs]
        more = [names.index(c) for c in latent.channels if c in names]
        seen += more
        keep_d += [faded] * len(more)
        variance_d += [sd[names[j]] ** 2 for j in more]
    if log.jumps is not None:
        at, states = np.nonzero(log.jumps)
        jumps = np.zeros((log.jumps.shape[0], log.jumps.shape[1], log.jumps.shape[1]))
        jumps[at, states, states] = log.jumps[at, states]
        jumped = np.unique(states)
        gamma.append(jumps[:, :, jumped])
        keep += [np.zeros(gaps.size)] * jumped.size
        variance += [1.0] * jumped.size
    drift = np.zeros((len(names), len(seen)))
    drift[seen, np.arange(len(seen))] = 1.0
    return Filter(
        log.sigma**2,
        np.ascontiguousarray(gamma[0] if len(gamma) == 1 else np.concatenate(gamma, axis=2)),
        _beside(keep, gaps.size),
        np.array(variance, dtype=float),
        drift,
        _beside(keep_d, gaps.size),
        np.array(variance_d, dtype=float),
        log.initial_sd**2,
    )


def _beside(columns: Sequence[Array], size: int) -> Array:
    """(size, k) of k columns."""
    out = np.empty((size, len(columns)))
    for k, column in enumerate(columns):
        out[:, k] = column
    return out


def active_inputs(f: Filter) -> tuple[Filter, Array]:
    """Settings without latent inputs and drifts of no variance, and (nf + nd,) bool which were kept.

    They stay zero whatever the data say; still water has no others.
    """
    force, drift = f.variance_f > 0.0, f.variance_d > 0.0
    kept = np.concatenate([force, drift])
    if kept.all():
        return f, kept
    some = replace(
        f,
        gamma=np.ascontiguousarray(f.gamma[:, :, force]),
        decay_f=np.ascontiguousarray(f.decay_f[:, force]),
        variance_f=f.variance_f[force],
        drift=np.ascontiguousarray(f.drift[:, drift]),
        decay_d=np.ascontiguousarray(f.decay_d[:, drift]),
        variance_d=f.variance_d[drift],
    )
    return some, kept


@dataclass(frozen=True, eq=False)
class White:
    """Whitened residual and columns of one run; `logdet` of its covariance, `used` readings."""

    resid: Array
    columns: Array
    logdet: float
    used: int


def whitened(
    model: Model,
    path: Linearisation,
    step: Array,
    scale: Array,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
    run: int = 0,
    extra: tuple[Array, Array] | None = None,
) -> White:
    """Whitened residual (n*q,) and columns (n*q, k) of one run.

    Parameters
    ----------
    step : (p,) where the residual is taken, as a move from the path's parameters
    scale : (p,) unit of each column [SI]
    extra : further columns, direct (n, q, k) and drive (n-1, nx, k), e.g. secants
    """
    f, _ = active_inputs(filter_settings(model, path, noise_model, latent, run))
    stack = regressor_columns(path, step, scale, extra)
    out = np.empty((stack.columns.shape[0] * stack.columns.shape[1], stack.columns.shape[2]))
    logdet, used = whiten(
        stack.columns,
        stack.drive,
        stack.first,
        path.log.valid,
        path.slope,
        f.variance,
        path.phi,
        f.gamma,
        f.decay_f,
        f.variance_f,
        f.drift,
        f.decay_d,
        f.variance_d,
        f.start,
        out,
    )
    return White(out[:, 0], out[:, 1:], logdet, used)


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed deviation of one run: state, latent inputs and drifts with variances.

    `filtered` are means given the readings up to each sample, `standard` innovations and `alone` the misfit
    of each reading given all others, over their deviations.
    """

    mean: Array
    variance: Array
    standard: Array
    alone: Array
    filtered: Array


def smoothed(
    model: Model,
    path: Linearisation,
    step: Array,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
    run: int = 0,
    variances: bool = True,
) -> Smoothed:
    """Posterior deviation from the path along one run, its parameters moved by `step`.

    Without `variances` neither they nor `alone` are there (empty), which is three times quicker.
    """
    f, kept = active_inputs(filter_settings(model, path, noise_model, latent, run))
    resid, drive, first = known(path, step)
    n, q = resid.shape
    m = first.size + f.variance_f.size + f.variance_d.size
    mean, var, filtered = np.empty((n, m)), np.empty((n if variances else 0, m)), np.empty((n, m))
    standard, alone = np.empty((n, q)), np.empty((n if variances else 0, q))
    smooth_filtered(
        np.where(path.log.valid, resid, 0.0),
        drive,
        first,
        path.log.valid,
        path.slope,
        f.variance,
        path.phi,
        f.gamma,
        f.decay_f,
        f.variance_f,
        f.drift,
        f.decay_d,
        f.variance_d,
        f.start,
        mean,
        var,
        standard,
        alone,
        filtered,
        BLOCK,
    )
    if not kept.all():
        at = np.flatnonzero(np.concatenate([np.ones(first.size, dtype=bool), kept]))
        mean, var, filtered = (_spread(x, at, first.size + kept.size) for x in (mean, var, filtered))
    return Smoothed(mean, var, standard, alone, filtered)


def _spread(values: Array, at: Array, size: int) -> Array:
    """(n, size) with the columns of `values` at positions `at`, zero elsewhere."""
    out = np.zeros((values.shape[0], size))
    out[:, at] = values
    return out
