"""Posterior density of an explanation: effects' parameters, coefficients that could hide them, noise scale.

Takes a `DiagnosisProblem` and a converged `FilterErrorFit`. Gives an `EffectDensity` a sampler can walk and
its Laplace approximation. Does not sample.

Three parts, each exact where it matters. (1) First states, latent forces and all coefficients but a few are
integrated out of the whitened linear model. (2) That is done on a grid of environments that reaches as far as
a walker goes (`noise_scale_posterior`). (3) What the linear model gets wrong when an effect's
parameter moves is measured by linearising anew at nodes about the optimum, coefficients free; a polynomial
carries it in between. `roughness` is what that polynomial leaves.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.effect_draws import DensityCheck
from bayesid.diagnosis.evidence.noise_scale import NoiseScalePosterior, noise_scale_posterior
from bayesid.errors import ModelError, SampleError
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.noise_identification import MANOEUVRE_NOISE_SPREAD
from bayesid.estimation.sampling import Laplace, Unknowns

Array = np.ndarray
Notify = Callable[[str], None]
COEFFICIENTS_SHOWN = 6  # shown beside the effects' parameters
KNOWN_REACH = 4.5  # posterior sd of an effect's parameter within which the density is known
AXIS_NODES, CORNER_NODE = (1.5, 3.0), 1.3
MOST_ITERATIONS = 3
# Drop of log evidence one posterior sd away (0.5 where the linear model holds) that calls for closer nodes.
STEEP_DROP, MOST_NARROWINGS = 3.0, 4


@dataclass(frozen=True, eq=False)
class EvidenceSurface:
    """What the linear model misses along the effects' parameters: log evidence and shift of coefficients.

    Attributes
    ----------
    nodes : (m, e) in posterior sd about the optimum
    missed : (m,) log evidence, exact less linear
    weights, shifts : of the polynomial terms, (t,) and (t, c)
    roughness : rms of what the polynomial leaves of `missed` [nats]
    """

    nodes: Array
    missed: Array
    weights: Array
    shifts: Array
    roughness: float


@dataclass(frozen=True, eq=False)
class EffectDensity:
    """Density in sampling coordinates: effects' parameters and coefficients in prior sd from their prior
    mean, then logarithms of amplitudes over their measured values.

    Attributes
    ----------
    noise_scale : the linear model along the amplitudes
    where_effects : positions of the effects' parameters among the k
    root : (e, e) whitened effects' parameters -> prior sd
    amplitude_sd : prior sd of their logarithms
    one_sided : logarithm of what bounds take from the prior's mass (ln 2 for a parameter from zero up)
    """

    unknowns: Unknowns
    noise_scale: NoiseScalePosterior
    where_effects: Array
    where_coefficients: Array
    centre: Array
    root: Array
    surface: EvidenceSurface
    amplitude_sd: float
    scale: Array
    offset: Array
    one_sided: float

    @property
    def scaled_amplitudes(self) -> tuple[str, ...]:
        """Names of the amplitudes sampled, "force" and "drift"."""
        return self.noise_scale.names

    @property
    def count(self) -> int:
        """Unknowns that are no amplitudes."""
        return int(self.noise_scale.middle.size)

    @property
    def digest(self) -> str:
        table, surface = self.noise_scale, self.surface
        parts = (*table.nodes, table.mean, table.factor, table.evidence, surface.weights, surface.shifts)
        return hashlib.sha256(b"".join(np.ascontiguousarray(p).tobytes() for p in parts)).hexdigest()

    def log_prob(self, q: Array) -> Array:
        """Log of likelihood times prior: its integral is the evidence."""
        k = self.count
        z = q[:, :k]
        mean, factor, evidence = self.noise_scale.at(q[:, k:])
        w = (z[:, self.where_effects] - self.centre) @ np.linalg.inv(self.root).T
        terms = _terms(w)
        moved = z - mean
        moved[:, self.where_coefficients] -= terms @ self.surface.shifts
        diagonal = np.einsum("bii->bi", factor)
        scaled = np.einsum("bij,bi->bj", np.tril(factor, -1), moved) + np.exp(diagonal) * moved
        out = evidence + diagonal.sum(axis=1) - 0.5 * (scaled**2).sum(axis=1) - 0.5 * k * np.log(2 * np.pi)
        out = out + terms @ self.surface.weights + self.one_sided
        if self.scaled_amplitudes:
            a = q[:, k:] / self.amplitude_sd
            out -= 0.5 * (a**2).sum(axis=1) + len(self.scaled_amplitudes) * np.log(
                self.amplitude_sd * np.sqrt(2 * np.pi)
            )
        natural = self.natural(q)
        inside = np.all((natural >= self.unknowns.low) & (natural <= self.unknowns.high), axis=1)
        inside &= (np.abs(w) <= KNOWN_REACH).all(axis=1) & self.noise_scale.holds(q[:, k:])
        return np.where(inside & np.isfinite(out), out, -np.inf)

    def natural(self, q: Array) -> Array:
        """Points in SI; amplitudes as logarithms."""
        return q * self.scale + self.offset


def effect_density(
    problem: DiagnosisProblem,
    fitted: FilterErrorFit,
    notify: Notify = lambda text: None,
    coefficients: int = COEFFICIENTS_SHOWN,
    sample_noise_scale: bool = True,
) -> tuple[EffectDensity, Laplace]:
    """Density of a fit with effects, and the Laplace approximation of the linear model.

    Parameters
    ----------
    coefficients : so many of those that lie closest to the effects in the posterior are sampled too
    sample_noise_scale : sample the environment's amplitudes too, where they are not stated

    Raises
    ------
    SampleError
        the fit has no effect, or did not converge: its quadratic means nothing
    """
    free = fitted.free
    n_coef = len(problem.coefficients.names)
    effects = np.arange(n_coef, len(free.names))
    if effects.size == 0 or not fitted.converged:
        raise SampleError("a posterior of effects needs a converged fit with at least one effect")
    cov = fitted.posterior.covariance
    sd = np.sqrt(np.diag(cov))
    near = np.abs(cov[np.ix_(effects, np.arange(n_coef))] / np.outer(sd[effects], sd[:n_coef])).max(axis=0)
    shown = np.argsort(-near)[:coefficients]
    chosen = np.concatenate([effects, shown])
    amplitudes = _amplitudes(problem) if sample_noise_scale else ()
    spread = (
        MANOEUVRE_NOISE_SPREAD
        if problem.environment.source == "measured"
        else problem.environment.spread or 1.0
    )
    along = noise_scale_posterior(problem, fitted, chosen, amplitudes, spread)
    e = effects.size
    centre = along.middle[:e]
    narrow = _narrowed(problem, fitted, effects, centre, sd[effects])
    root = narrow[:, None] * np.linalg.cholesky(cov[np.ix_(effects, effects)])
    notify(f"posterior: the model linearised anew at {_nodes(e).shape[0]} nodes")
    surface = _surface(problem, fitted, effects, shown, centre, root)
    unit, middle = free.sd[chosen], free.mean[chosen]
    names = (*(free.names[i] for i in chosen), *(f"log {a}" for a in amplitudes))
    extra = len(amplitudes)
    unknowns = Unknowns(
        names,
        chosen.size,
        np.concatenate([free.low[chosen], np.full(extra, -np.inf)]),
        np.concatenate([free.high[chosen], np.full(extra, np.inf)]),
        np.concatenate([middle, np.zeros(extra)]),
        np.concatenate([unit, np.full(extra, spread)]),
        np.ones(chosen.size + extra),
    )
    density = EffectDensity(
        unknowns,
        along,
        np.arange(e),
        np.arange(e, chosen.size),
        centre,
        root,
        surface,
        spread,
        np.concatenate([unit, np.ones(extra)]),
        np.concatenate([middle, np.zeros(extra)]),
        # of a parameter that ends on one side only
        -float(
            log_ndtr((middle - free.low[chosen]) / unit).sum()
            + log_ndtr((free.high[chosen] - middle) / unit).sum()
        ),
    )
    return density, _laplace(density, cov[np.ix_(chosen, chosen)], narrow)


def _laplace(density: EffectDensity, cov: Array, narrow: Array) -> Laplace:
    k, extra = cov.shape[0], len(density.scaled_amplitudes)
    scale = np.ones(k)
    scale[density.where_effects] = narrow
    cov = cov * np.outer(scale, scale)
    whole = np.zeros((k + extra, k + extra))
    whole[:k, :k] = cov
    ends = np.array(list(density.noise_scale.reach.values())).reshape(extra, 2)
    whole[k:, k:] = np.diag((np.ptp(ends, axis=1) / 12.0) ** 2)
    low = (density.unknowns.low - density.offset) / density.scale
    high = (density.unknowns.high - density.offset) / density.scale
    mode = np.concatenate([density.noise_scale.middle, density.noise_scale.best])
    return Laplace(np.clip(mode, low, high), whole, low, high)


def _narrowed(
    problem: DiagnosisProblem, fitted: FilterErrorFit, effects: Array, centre: Array, sd: Array
) -> Array:
    """(e,) how much narrower the real density is than the linear model says, per effect parameter.

    Far below 1 where a parameter has no slope at its optimum, as a lag of nothing.
    """
    total = sum(fitted.equations[1:], fitted.equations[0])
    rest = np.arange(effects[0])
    out = np.ones(effects.size)

    def exact(zeta: Array) -> float:
        start = _given(total, rest, effects, zeta)[1] if (out == 1.0).all() else fitted.posterior.mean[rest]
        try:
            return exact_evidence(problem, fitted, effects, zeta, start)[0]
        except ModelError:
            return -np.inf

    low = (fitted.free.low[effects] - fitted.free.mean[effects]) / fitted.free.sd[effects]
    here = np.maximum(centre, low)
    top = exact(here)
    for i in range(effects.size):
        for _ in range(MOST_NARROWINGS):
            step = out[i] * sd[i] * np.eye(effects.size)[i]
            drop = top - max(
                exact(here + step), exact(np.maximum(here - step, low)) if here[i] > low[i] else -np.inf
            )
            if not drop > STEEP_DROP:
                break
            out[i] *= max(1.0 / np.sqrt(2.0 * drop), 0.1)
    return out


def _amplitudes(problem: DiagnosisProblem) -> tuple[str, ...]:
    noise_model = problem.environment.noise_model
    if problem.environment.source == "stated":
        return ()
    out = ("force",) if any(noise_model.force) else ()
    return (*out, "drift") if noise_model.drift > 0 else out


def _nodes(e: int) -> Array:
    """(m, e) nodes in posterior sd: the optimum, the axes, and corners of every pair."""
    rows = [np.zeros(e)]
    for i in range(e):
        for size in AXIS_NODES if e > 1 else (1.0, 2.0, 3.0, 4.0):
            rows += [size * np.eye(e)[i], -size * np.eye(e)[i]]
        for j in range(i):
            signs = ((1, 1), (1, -1), (-1, 1), (-1, -1)) if e < 4 else ((1, 1),)
            rows += [CORNER_NODE * (a * np.eye(e)[i] + b * np.eye(e)[j]) for a, b in signs]
    return np.array(rows)


def _terms(w: Array) -> Array:
    """(b, t) polynomial terms without the constant: all to second order, cubes and fourth powers of each."""
    e = w.shape[1]
    columns = [w, w**2, w**3]
    if e == 1:
        columns.append(w**4)
    columns += [w[:, [i]] * w[:, [j]] for i in range(e) for j in range(i)]
    return np.concatenate(columns, axis=1)


def _surface(
    problem: DiagnosisProblem,
    fitted: FilterErrorFit,
    effects: Array,
    shown: Array,
    centre: Array,
    root: Array,
) -> EvidenceSurface:
    """Exact less linear log evidence and coefficients at the nodes, and polynomials through them."""
    free = fitted.free
    low = (free.low[effects] - free.mean[effects]) / free.sd[effects]
    points = np.maximum(centre + _nodes(effects.size) @ root.T, low)
    points = np.unique(np.round(points, 12), axis=0)
    total = sum(fitted.equations[1:], fitted.equations[0])
    rest = np.arange(effects[0])
    nodes, missed, shifts = [], [], []
    for zeta in points:
        linear, expected = _given(total, rest, effects, zeta)
        try:
            exact, found = exact_evidence(problem, fitted, effects, zeta, expected)
        except ModelError:
            continue
        nodes.append(np.linalg.solve(root, zeta - centre))
        missed.append(exact - linear)
        shifts.append((found - expected)[shown])
    w, y, s = np.array(nodes), np.array(missed), np.array(shifts)
    if w.shape[0] < 3:
        raise SampleError("the model cannot be linearised about the fitted effects: no posterior")
    start = int(np.argmin((w**2).sum(axis=1)))
    terms = _terms(w)
    # the prior of the polynomial: none of its terms, so that few nodes do not overfit
    ridge = 1e-6 * np.eye(terms.shape[1])
    near = 1.0 / (1.0 + (w**2).sum(axis=1))
    left = terms.T @ (near[:, None] * terms) + ridge
    weights = np.linalg.solve(left, terms.T @ (near * (y - y[start])))
    moves = np.linalg.solve(left, terms.T @ (near[:, None] * (s - s[start])))
    rough = float(np.sqrt(np.mean((terms @ weights - (y - y[start])) ** 2)))
    return EvidenceSurface(w, y, weights, moves, rough)


def _given(g: NormalEquations, rest: Array, effects: Array, zeta: Array) -> tuple[float, Array]:
    """Log evidence (coefficients integrated out) and their mean at fixed effects, linear model, prior of the
    effects included."""
    se = g.se[rest] - g.ss[np.ix_(rest, effects)] @ zeta
    ee = g.ee - 2 * float(g.se[effects] @ zeta) + float(zeta @ g.ss[np.ix_(effects, effects)] @ zeta)
    h = np.eye(rest.size) + g.ss[np.ix_(rest, rest)]
    mean = np.linalg.solve(h, se)
    value = -0.5 * (ee - float(se @ mean) + g.logdet + float(np.linalg.slogdet(h)[1]))
    value -= 0.5 * g.used * np.log(2 * np.pi) + 0.5 * float(zeta @ zeta) + 0.5 * zeta.size * np.log(2 * np.pi)
    return value, mean


def exact_evidence(
    problem: DiagnosisProblem, fitted: FilterErrorFit, effects: Array, zeta: Array, start: Array
) -> tuple[float, Array]:
    """The same at the real model: linearised anew with the effects held at `zeta` [prior sd].

    Parameters
    ----------
    start : coefficients to begin from, prior sd

    Raises
    ------
    ModelError
        the model cannot be linearised there
    """
    free, base = fitted.free, problem.coefficients
    par = fitted.par.copy()
    par[free.where[effects]] = free.mean[effects] + zeta * free.sd[effects]
    par[base.where] = base.mean + start * base.sd
    points = [replace(p, par=par) for p in fitted.points]
    done = fit(
        problem.model,
        problem.logs,
        base,
        problem.environment.noise_model,
        start=points,
        initial_noise_scale=0.0,
        iterations=MOST_ITERATIONS,
    )
    prior = -0.5 * float(zeta @ zeta) - 0.5 * zeta.size * np.log(2 * np.pi)
    return done.log_evidence + prior, done.posterior.mean


def density_check(density: EffectDensity) -> DensityCheck:
    """How the surface was linearised anew, in numbers."""
    surface, scale = density.surface, density.noise_scale
    return DensityCheck(
        int(surface.nodes.shape[0]),
        tuple(float(v) for v in surface.missed - surface.missed.min()),
        float(surface.roughness),
        float(scale.error),
        {n: tuple(float(v) for v in np.exp(e)) for n, e in scale.reach.items()},
    )
