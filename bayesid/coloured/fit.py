"""Gauss-Newton fit of coefficients, effect parameters, initial states and latent forces to all runs at once.

Takes logs, free parameters with Gaussian priors and an environment. Gives a frozen `ColouredFit`: estimates,
log evidence, paths about the optimum. Does not choose effects or judge.

Each pass linearises about the current path, solves for the parameters with initial states and latent forces
integrated out exactly, then smooths those. The environment is lowered from loud to its real level over the
first passes, so that the path follows the data while the parameters are still wrong (full-length replays do
not converge otherwise).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.coloured.colours import Colours, force_unit, mixing, smoothed
from bayesid.coloured.evidence import Gram, Posterior, posterior
from bayesid.coloured.log import Array, Log
from bayesid.coloured.path import Path, Point, first_point
from bayesid.coloured.shared import fresh, linear
from bayesid.coloured.unknowns import NOTHING, Free, stack
from bayesid.errors import ModelError
from bayesid.model import Model

__all__ = ["NOTHING", "ColouredFit", "Free", "fit", "stack"]

# A step this long in posterior standard deviations changes the evidence by about 0.02.
SETTLED = 0.2
# Longest step of one pass, in prior standard deviations.
LONGEST = 3.0
# Change of the objective that counts as none where noise bends the valley and steps stay of one size.
FLAT = 0.3
WARM = 2
# Movement of the readings in the last pass, in sensor standard deviations, that counts as none.
JOINED = 0.05
# Passes at the real level after which a model that explains far less than a free force is given up.
HOPELESS = 6
# Latent force over 1/2 rho L^2 U^2 that no longer moves a track by as much as a sensor sees.
QUIET = 3e-6


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
    passes, converged : Gauss-Newton passes and whether the last step was below `SETTLED` posterior sd
    follow, follow_level, follow_evidence : points of the most probable pass, its latent force over
        1/2 rho L^2 U^2 and its log evidence: a path that follows the data even where the model cannot
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
    passes: int
    converged: bool
    follow: tuple[Point, ...]
    follow_level: float
    follow_evidence: float

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


def fit(
    model: Model,
    logs: Sequence[Log],
    free: Free,
    colours: Colours,
    start: Sequence[Point] | None = None,
    loud: float = 0.03,
    passes: int = 25,
) -> ColouredFit:
    """Fit all runs at once.

    Parameters
    ----------
    colours : the environment's real level
    start : points to begin from (default: prior mean along the readings' own path)
    loud : latent force of the first pass over 1/2 rho L^2 U^2, lowered to half of what the path still needs
    each
        pass until the real level is reached; 0 starts at the real level
    passes : at most this many
    """
    unit = force_unit(model)
    base = model.nominal.copy()
    base[free.where] = free.mean
    points = list(start) if start is not None else [first_point(model, log, base) for log in logs]
    values = points[0].par[free.where].copy()
    best: _Best | None = None
    standards: list[Array] = []
    converged, level, settled, real, flat = False, loud, 0, 0, 0
    follow: tuple[float, tuple[Point, ...], float] = (-np.inf, tuple(points), loud)
    k = 0
    for k in range(passes):
        now = _level(model, colours, level)
        try:
            if k <= WARM and loud > 0 and free.names:
                paths, grams = linear(model, logs, points, free, now)
            else:
                paths, grams = fresh(model, logs, points, free, now)
            total = sum(grams[1:], grams[0])
            post = posterior(total)
        except ModelError:
            if best is None:
                raise
            best.shorten()
            points, standards, values = best.again(model, free)
            continue
        if post.log_evidence > follow[0]:
            follow = (post.log_evidence, tuple(points), level if now is not colours else 0.0)
        z = (values - free.mean) / free.sd
        merit = -0.5 * (total.ee - 2 * total.se @ z + z @ total.ss @ z + z @ z + total.logdet)
        if best is not None and best.refused(merit, now, colours):
            best.shorten()
            points, standards, values = best.again(model, free)
            continue
        same = best is not None and best.colours is colours and abs(merit - best.merit) < FLAT
        flat = flat + 1 if same else 0
        step = post.mean - z
        biggest = float(np.abs(step).max()) if step.size else 0.0
        share = min(1.0, LONGEST / biggest) if biggest > 0 else 1.0
        if k < WARM and loud > 0:
            # Only let the path settle: slopes along raw readings are biased by their noise.
            share = 0.0
        best = _Best(merit, paths, values, step * free.sd, now, share, any(colours.force))
        points, standards, proposal = best.again(model, free)
        done = (proposal - values) / free.sd
        length = float(np.sqrt(done @ done + done @ total.ss @ done)) if done.size else 0.0
        values = proposal
        if k < WARM and loud > 0:
            continue
        if now is colours:
            settled = settled + 1 if length < SETTLED else 0
            real += 1
            if real >= HOPELESS and post.log_evidence < follow[0] - 1e3:
                break
            if (settled or flat >= 3) and _joined(paths, points):
                converged = True
                break
        else:
            need = max(float(np.sqrt(np.mean(p.force**2, axis=0) / unit**2).max()) for p in points)
            level = min(0.5 * need, 0.5 * level)
    return ColouredFit(
        free,
        values,
        post,
        points[0].par,
        now,
        tuple(points),
        tuple(paths),
        tuple(grams),
        tuple(standards),
        k + 1,
        converged,
        follow[1],
        follow[2],
        follow[0],
    )


def _moved(
    model: Model,
    paths: Sequence[Path],
    free: Free,
    values: Array,
    colours: Colours,
    noisy: bool,
    stride: float,
) -> tuple[list[Point], list[Array]]:
    """Points at new parameter values with smoothed states and forces, and the standardised innovations.

    Slopes are later taken along the filtered path where the environment is `noisy`; in still water the
    smoothed path is the vehicle's own answer, and better known.
    """
    n_force = len(colours.force)
    points, standards = [], []
    for i, path in enumerate(paths):
        par = path.point.par.copy()
        par[free.where] = values
        sm = smoothed(model, path, values - path.point.par[free.where], colours, run=i, variances=False)
        nx = path.point.states.shape[1]
        force = sm.mean[:-1, nx : nx + n_force] @ mixing(model, colours).T
        force = np.ascontiguousarray(path.point.force + stride * (force - path.point.force))
        before = path.point.states + sm.filtered[:, :nx] if noisy else None
        points.append(Point(par, path.point.states + stride * sm.mean[:, :nx], force, before))
        standards.append(sm.standard)
    return points, standards


def _joined(paths: Sequence[Path], points: Sequence[Point]) -> bool:
    """Whether the last pass moved no state by more than a fraction of what the sensors see."""
    for path, point in zip(paths, points, strict=True):
        moved = np.einsum("iqx,ix->iq", path.slope, point.states - path.point.states)
        if np.sqrt(np.mean((moved / path.log.sigma) ** 2)) > JOINED:
            return False
    return True


def _level(model: Model, real: Colours, level: float) -> Colours:
    """The environment of one pass: `level` of latent force while that is louder than the real one."""
    unit = force_unit(model)
    if np.all(level * unit <= np.maximum(real.force, QUIET * unit)):
        return real
    usual = 2.0 * model.scales["L"] / model.scales["U"]
    return replace(
        real, force=tuple(np.maximum(real.force, level * unit)), force_tau=max(real.force_tau, usual)
    )


@dataclass
class _Best:
    """Best point so far and the step tried from it."""

    merit: float
    paths: Sequence[Path]
    values: Array
    step: Array
    colours: Colours
    share: float
    noisy: bool
    stride: float = 1.0

    def shorten(self) -> None:
        """Shorter step of the parameters and of the path: along the old path defects are small by design."""
        self.share *= 0.3
        self.stride *= 0.3

    def refused(self, merit: float, now: Colours, real: Colours) -> bool:
        """Whether a try at the real level came out worse and a shorter step is worth it."""
        return now is real and self.colours is real and merit < self.merit - 0.5 and self.share > 0.02

    def again(self, model: Model, free: Free) -> tuple[list[Point], list[Array], Array]:
        """Points, innovations and values a share of the step away, the path smoothed for those values."""
        values = np.maximum(self.values + self.share * self.step, free.low)
        points, standards = _moved(model, self.paths, free, values, self.colours, self.noisy, self.stride)
        return points, standards, values
