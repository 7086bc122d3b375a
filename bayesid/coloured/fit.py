"""Gauss-Newton fit of coefficients, effect parameters, initial states and latent forces to all runs at once.

Takes logs, free parameters with Gaussian priors and an environment. Gives a frozen `ColouredFit`: estimates, log
evidence, paths about the optimum. Does not choose effects or judge.

Each pass linearises about the current path, solves for the parameters with initial states and latent forces integrated
out exactly, then smooths those. The environment is lowered from loud to its real level over the first passes, so that
the path follows the data while the parameters are still wrong (full-length replays do not converge otherwise).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.coloured.colours import Colours, force_unit, smoothed, whitened
from bayesid.coloured.evidence import Gram, Posterior, gram, posterior
from bayesid.coloured.path import Array, Log, Path, Point, linearise
from bayesid.errors import ModelError
from bayesid.model import Model

OUTLIER = 5.0
# A step this long in posterior standard deviations changes the evidence by about 0.02.
SETTLED = 0.2


@dataclass(frozen=True, eq=False)
class Free:
    """Free parameters with Gaussian priors, all in SI and in the order of `names`."""

    names: tuple[str, ...]
    where: Array
    mean: Array
    sd: Array
    low: Array

    def __add__(self, other: Free) -> Free:
        return Free(
            (*self.names, *other.names),
            np.concatenate([self.where, other.where]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.sd, other.sd]),
            np.concatenate([self.low, other.low]),
        )


@dataclass(frozen=True, eq=False)
class ColouredFit:
    """Converged (or not) coloured fit.

    Attributes
    ----------
    free : Free
    values : (k,) estimates [SI]
    posterior : Posterior of z = (value - mean)/sd
    par : full parameter vector
    colours : environment used
    points, paths : one per run
    grams : one per run, columns in units of the prior sd, residual relative to the prior mean
    standard : per run (n, q) standardised innovations
    outliers : per run, number of readings set aside
    passes, converged : Gauss-Newton passes and whether the last step was below `SETTLED` posterior sd
    """

    free: Free
    values: Array
    posterior: Posterior
    par: Array
    colours: Colours
    points: tuple[Point, ...]
    paths: tuple[Path, ...]
    grams: tuple[Gram, ...]
    standard: tuple[Array, ...]
    outliers: tuple[int, ...]
    passes: int
    converged: bool

    @property
    def log_evidence(self) -> float:
        return self.posterior.log_evidence

    @property
    def sd(self) -> Array:
        """Posterior standard deviations [SI]."""
        return np.sqrt(np.diag(self.posterior.covariance)) * self.free.sd

    @property
    def chi2(self) -> float:
        """Mean squared standardised innovation."""
        total = sum(float((s**2).sum()) for s in self.standard)
        return total / max(1, sum(int(p.log.valid.sum()) for p in self.paths))


def shifted_resid(path: Path, mean_par: Array, where: Array, start: Array) -> Array:
    """Residual of the readings against the linear model at the prior mean (parameters, initial state, no forces)."""
    log, point = path.log, path.point
    n, nx = path.states.shape
    offset = np.zeros(nx)
    offset[: start.size] = point.x0 - start
    out = path.resid.copy()
    nf = point.force.shape[1]
    moved = np.empty((n, nx))
    moved[0] = offset
    for i in range(n - 1):
        moved[i + 1] = path.phi[i] @ moved[i] + path.gamma[i, :, :nf] @ point.force[i]
    out += np.einsum("iqx,ix->iq", path.slope, moved)
    out += path.columns @ (point.par[where] - mean_par)
    return np.where(log.valid, out, 0.0)


def stack(model: Model, paths: Sequence[Path], free: Free, colours: Colours) -> list[Gram]:
    """Whitened Gram matrix of every run."""
    out = []
    for k, path in enumerate(paths):
        resid = shifted_resid(path, free.mean, free.where, path.log.start)
        w = whitened(model, path, resid, path.columns * free.sd, colours, run=k)
        out.append(gram(w.resid, w.columns, w.logdet, w.used))
    return out


def fit(
    model: Model,
    logs: Sequence[Log],
    free: Free,
    colours: Colours,
    start: Sequence[Point] | None = None,
    loud: float = 0.02,
    passes: int = 14,
    full: bool = True,
    find_outliers: bool = True,
) -> ColouredFit:
    """Fit all runs at once.

    Parameters
    ----------
    colours : the environment's real level
    start : points to begin from (default: prior mean, first readings, no forces)
    loud : latent force of the first pass over 1/2 rho L^2 U^2; lowered by 20 each pass until the real level
    passes : at most this many
    """
    unit = force_unit(model)
    base = model.nominal.copy()
    base[free.where] = free.mean
    points = (
        list(start)
        if start is not None
        else [Point(base, log.start, np.zeros((log.n - 1, unit.size))) for log in logs]
    )
    logs = list(logs)
    original = [log.valid for log in logs]
    values = points[0].par[free.where].copy()
    best: tuple[float, list[Point], Array] | None = None
    standards: list[Array] = []
    converged, halvings, k = False, 0, 0
    paths: list[Path] = []
    for k in range(passes):
        now = _level(model, colours, loud * 0.05**k)
        try:
            paths = [linearise(model, log, p, free.where, full) for log, p in zip(logs, points, strict=True)]
        except ModelError:
            if best is None:
                raise
            points, values = _between(best[1], points, 0.3), best[2] + 0.3 * (values - best[2])
            continue
        grams = stack(model, paths, free, now)
        total = sum(grams[1:], grams[0])
        post = posterior(total)
        z = (values - free.mean) / free.sd
        merit = -0.5 * (total.ee - 2 * total.se @ z + z @ total.ss @ z + z @ z + total.logdet)
        if now is colours:
            if best is not None and merit < best[0] - 0.5 and halvings < 4:
                halvings += 1
                points, values = _between(best[1], points, 0.4), best[2] + 0.4 * (values - best[2])
                continue
            if best is None or merit > best[0]:
                best = (merit, points, values)
            halvings = 0
        else:
            best = (-np.inf, points, values)
        step = post.mean - z
        biggest = float(np.abs(step).max()) if step.size else 0.0
        factor = min(1.0, (3.0 if k < 3 else 1.5) / biggest) if biggest > 0 else 1.0
        proposal = np.maximum(values + factor * step * free.sd, free.low)
        solved = (proposal - free.mean) / free.sd
        new_points, standards = [], []
        for i, (path, log) in enumerate(zip(paths, logs, strict=True)):
            resid = shifted_resid(path, free.mean, free.where, log.start) - (path.columns * free.sd) @ solved
            sm = smoothed(model, path, resid, now)
            nx = path.states.shape[1]
            par = path.point.par.copy()
            par[free.where] = proposal
            force = sm.mean[:-1, nx : nx + unit.size] if any(now.force) else np.zeros((log.n - 1, unit.size))
            new_points.append(Point(par, log.start + sm.mean[0, : log.start.size], np.ascontiguousarray(force)))
            standards.append(sm.standard)
            if find_outliers and k >= 2 and halvings == 0:
                bad = np.abs(sm.standard) > OUTLIER * max(1.0, _robust_scale(sm.standard))
                if bad.sum() < 0.05 * original[i].sum():
                    logs[i] = replace(log, valid=original[i] & ~bad)
        done = solved - z
        length = float(np.sqrt(done @ done + done @ total.ss @ done)) if done.size else 0.0
        points, values = new_points, proposal
        if now is colours and length < SETTLED and k >= 3:
            converged = True
            break
    return ColouredFit(
        free, values, post, points[0].par, now, tuple(points), tuple(paths), tuple(grams), tuple(standards),
        tuple(int((o & ~log.valid).sum()) for o, log in zip(original, logs, strict=True)), k + 1, converged,
    )  # fmt: skip


def _level(model: Model, real: Colours, level: float) -> Colours:
    """The environment of one pass: `level` of latent force while that is louder than the real one."""
    unit = force_unit(model)
    if np.all(level * unit <= np.maximum(real.force, 1e-7 * unit)):
        return real
    usual = 2.0 * model.scales["L"] / model.scales["U"]
    return replace(real, force=tuple(np.maximum(real.force, level * unit)), force_tau=max(real.force_tau, usual))


def _between(a: Sequence[Point], b: Sequence[Point], share: float) -> list[Point]:
    """Points a share of the way from a to b."""
    return [
        Point(p.par + share * (q.par - p.par), p.x0 + share * (q.x0 - p.x0), p.force + share * (q.force - p.force))
        for p, q in zip(a, b, strict=True)
    ]


def _robust_scale(standard: Array) -> float:
    x = np.abs(standard[standard != 0.0])
    return float(np.median(x) / 0.6745) if x.size else 1.0

