"""Posterior of an explanation's unknowns along the noise scale of the environment.

Takes the linearised paths of a fit. Gives `NoiseScalePosterior`: mean, precision and evidence of the chosen
unknowns at any logarithm of an amplitude over its level. Does not sample.

The grid reaches as far as a walker goes: outward from the level until the density has fallen by `MOST_DROP`
nats below its best. Where the best lies far from the level, paths are linearised anew there. Between nodes
stand cubic splines, and `error` is what they miss half way. (A fixed grid of -0.6 to 0.6 was extrapolated:
in a clean lake draws went to -1.6, three times past its end.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.errors import ModelError, SampleError
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit, stacked_equations
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import NoiseModel

Array = np.ndarray
Node = tuple[Array, Array, float]
SCALED_AMPLITUDES = ("force", "drift")
MOST_DROP = 12.0  # of two Gaussian unknowns six in a million lie farther out
NODE_STEP = 0.6
MOST_LOG_SCALE = 4.2  # logarithm: a factor 67 either way
NODE_COUNTS = (5, 17)
NODE_CHANGE = 0.1  # nats between nodes that call for more of them, or for a path of that noise scale
SETTLED_NODES, NODE_ITERATIONS = 3, 3


@dataclass(frozen=True, eq=False)
class NoiseScalePosterior:
    """Posterior of k unknowns on a grid of log amplitudes.

    Attributes
    ----------
    names : of the amplitudes that are free
    nodes : of force and drift; a single 0 where that amplitude is not free
    mean, factor, evidence : (i, j, k), (i, j, k, k) Cholesky of the precision with the logarithm of its
        diagonal, (i, j)
    middle : (k,) mean at the level itself
    best : (n_names,) node of highest density
    error : largest error of the log density half way between nodes about the best, and of the paths there
        [nats]
    """

    names: tuple[str, ...]
    nodes: tuple[Array, Array]
    mean: Array
    factor: Array
    evidence: Array
    middle: Array
    best: Array
    error: float

    @cached_property
    def _cardinal(self) -> tuple[Callable[[Array], Array], ...]:
        """Weights of the nodes at any point of an axis."""
        return tuple(
            CubicSpline(x, np.eye(x.size)) if x.size > 1 else (lambda a: np.ones((a.size, 1)))
            for x in self.nodes
        )

    @cached_property
    def _table(self) -> Array:
        nodes = self.evidence.size
        return np.concatenate([v.reshape(nodes, -1) for v in (self.mean, self.factor, self.evidence)], axis=1)

    @property
    def reach(self) -> dict[str, tuple[float, float]]:
        """Free amplitude -> ends of its grid."""
        ends = {n: (float(x[0]), float(x[-1])) for n, x in zip(SCALED_AMPLITUDES, self.nodes, strict=True)}
        return {n: ends[n] for n in self.names}

    def holds(self, log_factors: Array) -> Array:
        """(b,) whether (b, n_names) points lie on the grid."""
        ends = np.array(list(self.reach.values())).reshape(-1, 2)
        return np.all((log_factors >= ends[:, 0]) & (log_factors <= ends[:, 1]), axis=1)

    def at(self, log_factors: Array) -> tuple[Array, Array, Array]:
        """Mean, factor and evidence at (b, n_names) points; beyond the grid those of its end."""
        both = np.zeros((log_factors.shape[0], 2))
        for i, name in enumerate(self.names):
            both[:, SCALED_AMPLITUDES.index(name)] = np.clip(log_factors[:, i], *self.reach[name])
        one, two = (f(both[:, a]) for a, f in enumerate(self._cardinal))
        weights = (one[:, :, None] * two[:, None, :]).reshape(len(both), -1)
        k = self.middle.size
        mean, factor, evidence = np.split(weights @ self._table, [k, k + k * k], axis=1)
        return mean, factor.reshape(-1, k, k), evidence[:, 0]


def noise_scale_posterior(
    problem: DiagnosisProblem, fitted: FilterErrorFit, chosen: Array, names: tuple[str, ...], spread: float
) -> NoiseScalePosterior:
    """Tables for the chosen unknowns of a fit.

    Parameters
    ----------
    chosen : (k,) positions among the fit's free parameters; all others are integrated out
    names : amplitudes that are free, of `SCALED_AMPLITUDES`
    spread : prior sd of the logarithm of an amplitude

    Raises
    ------
    SampleError
        if the linear model leaves the finite numbers at a noise scale inside the grid
    """
    paths, middle = tuple(fitted.paths), _reduced(sum(fitted.equations[1:], fitted.equations[0]), chosen)
    if middle is None:
        raise SampleError("the linear model of the fit is not finite: no posterior")
    free, off = [SCALED_AMPLITUDES.index(n) for n in names], 0.0
    for _ in range(SETTLED_NODES):
        node = _Nodes(problem, fitted, chosen, paths)
        ends, best = _reach(node, free, spread)
        again = _settled(problem, fitted, best) if np.abs(best).max() > 0.5 * NODE_STEP else None
        if again is None:
            break
        old, new = node(*best), _Nodes(problem, fitted, chosen, again)(*best)
        off = np.inf if old is None or new is None else abs(old[2] - new[2]) + _divergence(new, *old[:2])
        if not NODE_CHANGE < off < np.inf:
            break
        paths = again
    count = [max(NODE_COUNTS[0], int(np.ceil(np.ptp(e) / NODE_STEP)) + 1) if i in free else 1
             for i, e in enumerate(ends)]  # fmt: skip
    while True:
        force, drift = (np.linspace(e[0], e[1], n) for e, n in zip(ends, count, strict=True))
        table = [v for a in force for b in drift if (v := node(a, b)) is not None]
        if len(table) < force.size * drift.size:
            raise SampleError("the linear model is not finite at every scale of the process noise")
        mean, factor, evidence = (
            np.array([v[i] for v in table]).reshape(force.size, drift.size, *np.shape(table[0][i]))
            for i in range(3)
        )
        made = NoiseScalePosterior(names, (force, drift), mean, factor, evidence, middle[0], best[free], 0.0)
        made = replace(made, error=max(off, _error(made, node, best, free)))
        if made.error < max(NODE_CHANGE, 1.01 * off) or max(count) >= NODE_COUNTS[1]:
            return made
        count = [2 * n - 1 if n > 1 else 1 for n in count]


class _Nodes:
    """Posterior of the chosen unknowns along given paths at any noise scale, each computed once."""

    def __init__(
        self,
        problem: DiagnosisProblem,
        fitted: FilterErrorFit,
        chosen: Array,
        paths: tuple[Linearisation, ...],
    ) -> None:
        self.problem, self.fitted, self.chosen, self.paths = problem, fitted, chosen, paths
        self.seen: dict[tuple[float, float], Node | None] = {}

    def __call__(self, force: float, drift: float) -> Node | None:
        key = (round(float(force), 9), round(float(drift), 9))
        if key not in self.seen:
            rescaled = _rescaled(self.problem.environment.noise_model, *key)
            equations = stacked_equations(self.problem.model, self.paths, self.fitted.free, rescaled)
            self.seen[key] = _reduced(sum(equations[1:], equations[0]), self.chosen)
        return self.seen[key]


def _settled(
    problem: DiagnosisProblem, fitted: FilterErrorFit, log_factors: Array
) -> tuple[Linearisation, ...] | None:
    """Paths linearised anew at another noise scale; None where the model leaves the finite numbers."""
    rescaled = _rescaled(problem.environment.noise_model, *log_factors)
    try:
        again = fit(
            problem.model,
            problem.logs,
            fitted.free,
            rescaled,
            start=list(fitted.points),
            initial_noise_scale=0.0,
            iterations=NODE_ITERATIONS,
        )
    except ModelError:
        return None
    return tuple(again.paths)


def _reach(node: _Nodes, free: list[int], spread: float) -> tuple[Array, Array]:
    """(2, 2) ends of the grid and (2,) its best point: outward along each amplitude in turn, twice."""

    def density(point: Array) -> float:
        found = node(*point)
        return -np.inf if found is None else found[2] - 0.5 * float(point @ point) / spread**2

    best, ends = np.zeros(2), np.zeros((2, 2))
    top = density(best)
    for axis in free * (2 if len(free) > 1 else 1):
        line = best.copy()
        for side, sign in enumerate((-1.0, 1.0)):
            point = line.copy()
            while abs(point[axis]) < MOST_LOG_SCALE - 1e-9:
                point[axis] += sign * NODE_STEP
                value = density(point)
                if not np.isfinite(value):
                    break
                outer = min if side == 0 else max
                ends[axis, side] = outer(ends[axis, side], point[axis])
                if value > top:
                    top, best = value, point.copy()
                elif value < top - MOST_DROP:
                    break
    return ends, best


def _error(made: NoiseScalePosterior, node: _Nodes, best: Array, free: list[int]) -> float:
    """Largest error of evidence and of the Gaussian half way between nodes on either side of the best."""
    worst = 0.0
    for axis in free:
        x = made.nodes[axis]
        at = int(np.argmin(np.abs(x - best[axis])))
        for left in {max(at - 1, 0), min(at, x.size - 2)}:
            point = best.copy()
            point[axis] = 0.5 * (x[left] + x[left + 1])
            exact = node(*point)
            if exact is None:
                return np.inf
            mean, factor, evidence = (v[0] for v in made.at(point[free][None]))
            worst = max(worst, abs(float(evidence) - exact[2]) + _divergence(exact, mean, factor))
    return worst


def _divergence(exact: Node, mean: Array, factor: Array) -> float:
    """Kullback-Leibler divergence of an interpolated Gaussian from the exact one [nats]."""
    true, near = _lower(exact[1]), _lower(factor)
    ratio = np.linalg.solve(true, near).T  # of the roots of the precisions
    shift = near.T @ (mean - exact[0])
    turn = float(np.linalg.slogdet(ratio)[1])
    return 0.5 * (float((ratio**2).sum()) - mean.size + float(shift @ shift)) - turn


def _lower(factor: Array) -> Array:
    out = np.tril(factor)
    out[np.diag_indices(out.shape[0])] = np.exp(np.diag(factor))
    return out


def _rescaled(noise_model: NoiseModel, force: float, drift: float) -> NoiseModel:
    rescaled = float(np.exp(drift))
    return replace(
        noise_model,
        force=tuple(f * np.exp(force) for f in noise_model.force),
        drift=noise_model.drift * rescaled,
        depth=None if noise_model.depth is None else noise_model.depth * rescaled,
    )


def _reduced(g: NormalEquations, chosen: Array) -> Node | None:
    """Posterior of the chosen unknowns, all others integrated out: mean, factored precision, evidence. None
    where it is not finite."""
    if not (np.isfinite(g.ss).all() and np.isfinite(g.se).all() and np.isfinite(g.ee)):
        return None
    h = np.eye(g.se.size) + g.ss
    solved = np.linalg.solve(h, g.se)
    cov = np.linalg.inv(h)[np.ix_(chosen, chosen)]
    # lower triangle L of the precision, L L' = P; the logarithm of its diagonal keeps it one in between
    try:
        lower = np.linalg.cholesky(np.linalg.inv(0.5 * (cov + cov.T)))
    except np.linalg.LinAlgError:
        return None
    lower[np.diag_indices(chosen.size)] = np.log(np.diag(lower))
    evidence = -0.5 * (g.ee - float(g.se @ solved)) - 0.5 * g.logdet - 0.5 * float(np.linalg.slogdet(h)[1])
    return solved[chosen], lower, evidence - 0.5 * g.used * np.log(2 * np.pi)
