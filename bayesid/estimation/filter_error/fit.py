"""Gauss-Newton fit of coefficients, effect parameters, initial states and latent forces to all runs at once.

Takes logs, free parameters with Gaussian priors and an environment. Gives a frozen `FilterErrorFit`:
estimates, log evidence, paths about the optimum. Does not choose effects or judge.

Each pass linearises about the current path, solves for the parameters with initial states and latent forces
integrated out exactly, then smooths those. The environment is lowered to its real level over the first
passes, so that the path follows the data while the parameters are still wrong (full-length replays do not
converge otherwise).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import GaussianPosterior, NormalEquations, posterior
from bayesid.estimation.filter_error.fit_journal import current_journal
from bayesid.estimation.filter_error.fit_result import FilterErrorFit
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, first_trajectory, released
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, mixing, smoothed
from bayesid.estimation.filter_error.normal_equations import of_all_runs, stacked_equations
from bayesid.estimation.filter_error.shared_linearisations import fresh, linear
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array, RunData
from bayesid.threads import each

__all__ = ["FilterErrorFit", "fit", "stacked_equations", "within_bounds"]

# A step this long in posterior standard deviations changes the evidence by about 0.02.
CONVERGED_STEP = 0.2
# A step of up to so many posterior standard deviations stays where the evidence takes the model for linear.
SHORT_STEP = 2.0
# A step is short enough to stop only where the whole one that it is a share of is no longer than this.
WHOLE_STEP = 1.0
# Longest step of one pass, in prior standard deviations.
MOST_STEP = 3.0
# What a step is shortened to where it is refused, and the most the next one may be longer again.
SHORTEN = 0.3
# Passes for which a try that came out worse is followed before it is refused.
WATCHED_PASSES = 5
# Least share of a step that is taken where steps swing.
LEAST_SHARE = 0.1
# Change of the objective that counts as none where noise bends the valley and steps stay of one size.
FLAT_CHANGE = 0.3
WARM_ITERATIONS = 2
# Movement of the readings in the last pass, in sensor standard deviations, that counts as none.
LEAST_READING_CHANGE = 0.05
# Passes at the real level after which a model that explains far less than a free force is given up.
GIVE_UP_ITERATIONS = 6
# Bytes of linearisations a fit keeps for whoever goes on from it.
MOST_HELD = 48_000_000
# Latent force over 1/2 rho L^2 U^2 that no longer moves a track by as much as a sensor sees.
NEGLIGIBLE_FORCE = 3e-6


def fit(
    model: Model,
    logs: Sequence[RunData],
    free: GaussianPrior,
    noise_model: NoiseModel,
    start: Sequence[Trajectory] | None = None,
    initial_noise_scale: float = 0.03,
    iterations: int = 25,
) -> FilterErrorFit:
    """Fit all runs at once.

    Parameters
    ----------
    noise_model : the environment's real level
    start : points to begin from (default: prior mean along the readings' own path)
    initial_noise_scale : latent force of the first pass over 1/2 rho L^2 U^2, lowered to half of what the
    path still needs
    each
        pass until the real level is reached; 0 starts at the real level
    iterations : at most this many
    """
    base = model.nominal.copy()
    base[free.where] = free.mean
    points = list(start) if start is not None else [first_trajectory(model, log, base) for log in logs]
    journal = current_journal()
    if journal is None:
        return _light(_fit(model, logs, free, noise_model, points, initial_noise_scale, iterations))
    key = journal.key(model, logs, free, noise_model, points, initial_noise_scale, iterations)
    found = journal.read(key, model, logs, free, noise_model)
    if found is None:
        found = _light(_fit(model, logs, free, noise_model, points, initial_noise_scale, iterations))
        journal.write(key, found)
    return found


def _light(found: FilterErrorFit) -> FilterErrorFit:
    """The fit, of long runs without its linearisations: whoever asks has them made anew, the same numbers."""
    return found if sum(path.size for path in found.held) <= MOST_HELD else found.released()


def _fit(
    model: Model,
    logs: Sequence[RunData],
    free: GaussianPrior,
    noise_model: NoiseModel,
    points: list[Trajectory],
    initial_noise_scale: float,
    iterations: int,
) -> FilterErrorFit:
    """The fit itself, from points."""
    unit = force_unit(model)
    values = points[0].par[free.where].copy()
    best: _Best | None = None
    held: _Best | None = None  # what is gone back to where passes after it come out worse
    watched = 0
    paths: Sequence[Linearisation] = ()
    standardised: list[Array] = []
    converged, level, settled, real, flat = False, initial_noise_scale, 0, 0, 0
    path_points: tuple[float, tuple[Trajectory, ...], float] = (-np.inf, tuple(points), initial_noise_scale)
    k = 0
    for k in range(iterations):
        now = _level(model, noise_model, level)
        if best is not None:
            # by far the most memory of a pass, and asked for again only where the next one is refused
            tried, paths = paths, _let_go(model, paths, free)
            best.paths = paths if best.paths is tried else _let_go(model, best.paths, free)
            if held is not None:
                held.paths = _let_go(model, held.paths, free)
        try:
            if k <= WARM_ITERATIONS and initial_noise_scale > 0 and free.names:
                paths, equations = linear(model, logs, points, free, now)
            else:
                paths, equations = fresh(model, logs, points, free, now)
            total = of_all_runs(equations, free)
            post = posterior(total)
        except ModelError:
            if best is None:
                raise
            best, held = held or best, None
            best.shorten()
            points, standardised, values = best.again(model, free)
            continue
        if post.log_evidence > path_points[0]:
            path_points = (post.log_evidence, tuple(points), level if now is not noise_model else 0.0)
        z = (values - free.mean) / free.sd
        merit = -0.5 * (total.ee - 2 * total.se @ z + z @ total.ss @ z + z @ z + total.logdet)
        step = within_bounds(total, post.mean, *free.standard_bounds) - z
        correction = _length(step, total)
        against = held or best  # the last at which no pass after it came out worse
        if against is None or not against.refused(merit, correction, now, noise_model):
            watched = watched if held is None and best is not None and best.stride < 1.0 else 0
            held = None
        elif watched < WATCHED_PASSES:
            held, watched = against, watched + 1
        else:
            best, held = against, None
            best.shorten()
            points, standardised, values = best.again(model, free)
            continue
        same = best is not None and best.noise_model is noise_model and abs(merit - best.merit) < FLAT_CHANGE
        flat = flat + 1 if same else 0
        biggest = float(np.abs(step).max()) if step.size else 0.0
        share = min(1.0, MOST_STEP / biggest) if biggest > 0 else 1.0
        stride = 1.0
        if best is not None and best.moves and best.stride < 1.0:  # it was shortened
            share, stride = min(share, best.share / SHORTEN), min(1.0, best.stride / SHORTEN)
        elif best is not None and best.moves and now is noise_model and best.noise_model is noise_model:
            share = min(share, _relaxation(best.share, best.step / free.sd, step, total))
        if k < WARM_ITERATIONS and initial_noise_scale > 0:
            # Only let the path settle: slopes along raw readings are biased by their noise.
            share = 0.0
        noisy = any(noise_model.force)
        best = _Best(
            merit, paths, values, step * free.sd, now, share, noisy, correction, equations, post, stride
        )
        points, standardised, proposal = best.again(model, free)
        length = _length((proposal - values) / free.sd, total)
        values = proposal
        if k < WARM_ITERATIONS and initial_noise_scale > 0:
            continue
        if now is noise_model:
            settled = settled + 1 if length < CONVERGED_STEP and correction < WHOLE_STEP else 0
            real += held is None
            if real >= GIVE_UP_ITERATIONS and post.log_evidence < path_points[0] - 1e3:
                break
            if held is None and (settled or flat >= 3) and _joined(paths, points):
                converged = True
                break
        else:
            need = max(float(np.sqrt(np.mean(p.force**2, axis=0) / unit**2).max()) for p in points)
            level = min(0.5 * need, 0.5 * level)
    if held is not None:
        best = held
        points, standardised, values = best.again(model, free)
    # the last pass that was taken stands, where no pass was left for a shorter step
    assert best is not None
    return FilterErrorFit(
        free,
        values,
        best.posterior,
        points[0].par,
        best.noise_model,
        tuple(points),
        model,
        tuple(logs),
        tuple(p.point for p in best.paths),
        tuple(best.paths),
        tuple(best.equations),
        tuple(standardised),
        k + 1,
        converged,
        path_points[1],
        path_points[2],
        path_points[0],
    )


def _let_go(model: Model, paths: Sequence[Linearisation], free: GaussianPrior) -> list[Linearisation]:
    """Paths whose slopes by parameters are no longer held, where they are large."""
    if sum(path.size for path in paths) <= MOST_HELD:
        return list(paths)
    return [released(model, path, free.where) for path in paths]


def _length(step: Array, total: NormalEquations) -> float:
    """Length of a step in prior standard deviations, counted in those of the posterior."""
    return float(np.sqrt(step @ step + step @ total.ss @ step)) if step.size else 0.0


def _relaxation(last: float, before: Array, step: Array, total: NormalEquations) -> float:
    """Share of a step that brings steps which swing to rest (Irons and Tuck 1969), at most the whole.

    Slopes by the parameters are taken along a path that follows the parameters, so that a whole step may
    overshoot by as much as it corrects, where the runs say little.

    Parameters
    ----------
    last : share taken of the whole step `before`
    """
    change = step - before
    bent = total.ss @ change + change
    along = float(change @ bent)
    if along <= 0.0:
        return 1.0
    return float(np.clip(-last * float(before @ bent) / along, LEAST_SHARE, 1.0))


def within_bounds(total: NormalEquations, mean: Array, low: Array, high: Array) -> Array:
    """Optimum of the quadratic within bounds; `mean` is the one without them."""
    if np.all((mean >= low) & (mean <= high)):
        return mean
    # of the triangle `posterior` has factored: rounding may leave the other one indefinite
    root = cholesky(total.ss + np.eye(mean.size), lower=True).T
    found = lsq_linear(root, solve_triangular(root, total.se, trans="T"), (low, high), method="bvls")
    return np.asarray(found.x)


def _moved(
    model: Model,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    values: Array,
    noise_model: NoiseModel,
    noisy: bool,
    stride: float,
) -> tuple[list[Trajectory], list[Array]]:
    """Points at new parameter values with smoothed states and forces, and the standardised innovations.

    Slopes are later taken along the filtered path where the environment is `noisy`; in still water the
    smoothed path is the vehicle's own answer, and better known.
    """
    n_force = len(noise_model.force)

    def of_run(path: Linearisation, i: int) -> tuple[Trajectory, Array]:
        par = path.point.par.copy()
        par[free.where] = values
        sm = smoothed(model, path, values - path.point.par[free.where], noise_model, run=i, variances=False)
        nx = path.point.states.shape[1]
        force = sm.mean[:-1, nx : nx + n_force] @ mixing(model, noise_model).T
        force = np.ascontiguousarray(path.point.force + stride * (force - path.point.force))
        before = path.point.states + sm.filtered[:, :nx] if noisy else None
        return Trajectory(par, path.point.states + stride * sm.mean[:, :nx], force, before), sm.standard

    moved = each(of_run, paths, range(len(paths)))
    return [point for point, _ in moved], [standard for _, standard in moved]


def _joined(paths: Sequence[Linearisation], points: Sequence[Trajectory]) -> bool:
    """Whether the last pass moved no state by more than a fraction of what the sensors see."""
    for path, point in zip(paths, points, strict=True):
        with np.errstate(over="ignore", invalid="ignore"):  # a step that diverges is no small one
            moved = np.einsum("iqx,ix->iq", path.slope, point.states - path.point.states)
            change = np.sqrt(np.mean((moved / path.log.sigma) ** 2))
        if not change <= LEAST_READING_CHANGE:
            return False
    return True


def _level(model: Model, real: NoiseModel, level: float) -> NoiseModel:
    """The environment of one pass: `level` of latent force while that is larger than the real one."""
    unit = force_unit(model)
    if np.all(level * unit <= np.maximum(real.force, NEGLIGIBLE_FORCE * unit)):
        return real
    usual = 2.0 * model.scales["L"] / model.scales["U"]
    return replace(
        real, force=tuple(np.maximum(real.force, level * unit)), force_tau=max(real.force_tau, usual)
    )


@dataclass
class _Best:
    """Point taken last and the step tried from it; `correction` is the length of the whole step."""

    merit: float
    paths: Sequence[Linearisation]
    values: Array
    step: Array
    noise_model: NoiseModel
    share: float
    noisy: bool
    correction: float
    equations: list[NormalEquations]
    posterior: GaussianPosterior
    stride: float = 1.0

    @property
    def moves(self) -> bool:
        """Whether the parameters moved: in warm passes the path alone does."""
        return self.share > 0.0

    def shorten(self) -> None:
        """Shorter step of the parameters and of the path: along the old path defects are small by design."""
        self.share *= SHORTEN
        self.stride *= SHORTEN

    def refused(self, merit: float, correction: float, now: NoiseModel, real: NoiseModel) -> bool:
        """Whether a try at the real level came out worse and a shorter step is worth it.

        Merits are compared along two paths, and one that has not settled has the better of it. So a short
        step is never refused, nor a try from which the next step is shorter (restricted monotonicity;
        Deuflhard 2011, 3.3). The path settles only after the parameters have moved, so that a try is followed
        for some passes before it is refused (watchdog; Chamberlain et al. 1982).
        """
        if now is not real or self.noise_model is not real or merit >= self.merit - 0.5:
            return False
        longer = correction > (1.0 - 0.25 * self.share) * self.correction
        return longer and self.share * self.correction > SHORT_STEP and self.share > 0.02

    def again(self, model: Model, free: GaussianPrior) -> tuple[list[Trajectory], list[Array], Array]:
        """Points, innovations and values a share of the step away, the path smoothed for those values."""
        values = np.clip(self.values + self.share * self.step, free.low, free.high)
        points, standardised = _moved(
            model, self.paths, free, values, self.noise_model, self.noisy, self.stride
        )
        return points, standardised, values
