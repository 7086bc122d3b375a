"""What data and prior each know about the free parameters, at one point and in one set of units.

Takes a `FitProblem` and unknowns. Gives `Information`: whitened sensitivities with the initial states taken
out, the prior beside them, the posterior covariance the two make (Laplace), and shares of data and prior in
it. Does not name directions or judge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesid.errors import FitError
from bayesid.estimation.output_error import FitProblem
from bayesid.model.params import Prior

Array = np.ndarray
LEVEL = 0.5  # prior sd assumed where none is stated, in sizes of the parameter


@dataclass(frozen=True, eq=False)
class Information:
    """Local knowledge of k parameters, in units of their prior standard deviations.

    Attributes
    ----------
    names : (k,)
    z : (k,) the point [SI]
    unit : (k,) prior sd [SI], marginal
    scale : (k,) size of each parameter [SI], for relative changes
    stated : (k,) whether the prior was stated; elsewhere `LEVEL` sizes are assumed
    data : (k, k) triangular: residual change per unit, initial states free; data^T data is the information
    prior : (p, k) whitened prior per unit
    """

    names: tuple[str, ...]
    z: Array
    unit: Array
    scale: Array
    stated: Array
    data: Array
    prior: Array

    @cached_property
    def root(self) -> Array:
        """(k, k) matrix A with A A^T = covariance, in units: the inverse of a triangular factor, so that flat
        directions beside stiff ones keep their digits.
        """
        return _inverse_root(np.vstack([self.data, self.prior]))

    @cached_property
    def covariance(self) -> Array:
        """(k, k) posterior covariance in units squared, Laplace."""
        return self.root @ self.root.T

    @property
    def sd(self) -> Array:
        """(k,) posterior sd [SI]."""
        return np.sqrt(np.diag(self.covariance)) * self.unit

    @cached_property
    def prior_covariance(self) -> Array:
        """(k, k) in units squared: ones on the diagonal."""
        return np.asarray(np.linalg.pinv(self.prior.T @ self.prior, hermitian=True))

    @cached_property
    def data_share(self) -> Array:
        """(k,) share of the data in each posterior variance, 0 to 1: the identifiability index.

        With H the information of the data, P that of the prior and C = (H + P)^-1, it is (C H C)_ii / C_ii.
        Raising the likelihood to a power a changes log C_ii by -share da, raising the prior by -(1 - share)
        da: the power-scaling sensitivity (Kallioinen et al. 2024) in closed form. A coefficient that shares a
        flat direction keeps an index near 0 even where the priors of all its partners narrow it together.
        """
        return np.sum((self.data @ self.covariance) ** 2, axis=0) / np.diag(self.covariance)

    @property
    def contraction(self) -> Array:
        """(k,) 1 - posterior over prior variance."""
        return 1.0 - np.diag(self.covariance) / np.diag(self.prior_covariance)

    @property
    def reach(self) -> Array:
        """(k,) residual change when one parameter moves by its prior sd, the others known."""
        return np.linalg.norm(self.data, axis=0)

    @property
    def correlation(self) -> Array:
        """(k, k) posterior correlation."""
        sd = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(sd, sd)

    def draws(self, count: int, rng: np.random.Generator, prior: bool = False) -> Array:
        """(count, k) normal draws [SI] about the point, of the posterior (Laplace) or of the prior."""
        root = _inverse_root(self.prior) if prior else self.root
        return self.z + rng.standard_normal((count, self.z.size)) @ root.T * self.unit

    def share_along(self, direction: Array) -> float:
        """Share of the data in what is known along a direction (k,), in units: 1 fixed by them, 0 open."""
        seen = float(np.sum((self.data @ direction) ** 2))
        held = float(np.sum((self.prior @ direction) ** 2))
        return seen / max(seen + held, 1e-300)

    def relative(self, direction: Array) -> Array:
        """A direction in units as unit vector of relative changes."""
        out = direction * self.unit / self.scale
        return out / np.linalg.norm(out)


def _inverse_root(rows: Array) -> Array:
    """A with A A^T = (rows^T rows)^-1."""
    triangle = np.asarray(np.linalg.qr(rows, mode="r"))
    return np.linalg.solve(triangle, np.eye(triangle.shape[0]))


def with_assumed_priors(problem: FitProblem, level: float = LEVEL) -> FitProblem:
    """The problem with a normal prior of `level` sizes wherever none is stated."""
    params = problem.params
    for p, stated in zip(params.free, states_prior(problem), strict=True):
        if not stated:
            params = params.changed([p.name], prior=Prior("normal", p.start, level * p.scale))
    return problem.with_params(params)


def as_if_read(problem: FitProblem, z: Array) -> FitProblem:
    """The problem with readings the model itself would give at `z`, without noise, and the prior centred
    there.

    What the runs can tell is then asked at a point that is the best one by construction; gaps stay gaps.
    """
    k = len(problem.params.names)
    _, starts = problem.split(z)
    runs = []
    for run, simulated, x0 in zip(problem.runs, problem.readings(z), starts, strict=True):
        readings = np.where(np.isfinite(run.readings), simulated, np.nan)
        runs.append(replace(run, readings=readings, x0=x0))
    params = problem.params.started_at(z[:k])
    for p, value in zip(params.free, z[:k], strict=True):
        if p.prior is not None and p.prior.kind != "uniform":
            params = params.changed([p.name], prior=replace(p.prior, centre=float(value)))
    if params.joint is not None:
        where = [params.names.index(n) for n in params.joint.names]
        params = replace(params, joint=replace(params.joint, mean=z[where]))
    return replace(problem, params=params, runs=tuple(runs))


def information(problem: FitProblem, z: Array | None = None, stated: Array | None = None) -> Information:
    """Information about the parameters of a problem at unknowns `z`, by default its start.

    Parameters
    ----------
    stated : (k,) which priors are not assumed; all by default

    Raises
    ------
    FitError
        a parameter without a prior (see `with_assumed_priors`), or a model that diverges at `z`
    """
    z = problem.start if z is None else z
    k = len(problem.params.names)
    resid, jac = problem.compressed(z)
    if not (np.isfinite(resid).all() and np.isfinite(jac).all()):
        raise FitError("sensitivities are not finite at this point; the simulated vehicle diverges")
    _, slopes = problem.params.prior_residuals(z[:k])
    bare = [n for n, column in zip(problem.params.names, slopes.T, strict=True) if not np.any(column)]
    if bare:
        raise FitError(f"no prior for {', '.join(bare)}; use with_assumed_priors first")
    precision = slopes.T @ slopes
    size = 1.0 / np.sqrt(np.diag(precision))
    unit = size * np.sqrt(np.diag(np.linalg.pinv(precision * np.outer(size, size), hermitian=True)))
    n_data = resid.size - problem.prior(z)[0].size
    seen = np.delete(jac, np.s_[n_data : n_data + slopes.shape[0]], axis=0)  # initial states keep their prior
    ordered = np.hstack([seen[:, k:] * problem.scale[k:], seen[:, :k] * unit])
    triangle = np.asarray(np.linalg.qr(ordered, mode="r"))
    data = np.zeros((k, k))
    rest = triangle[z.size - k :, z.size - k :]
    data[: rest.shape[0]] = rest
    given = np.ones(k, dtype=bool) if stated is None else stated
    return Information(problem.params.names, z[:k], unit, problem.scale[:k], given, data, slopes * unit)


def states_prior(problem: FitProblem) -> Array:
    """(k,) whether each free parameter has a prior of its own or a joint one."""
    joint = set(problem.params.joint.names) if problem.params.joint is not None else set()
    return np.array(
        [p.name in joint or (p.prior is not None and p.prior.kind != "uniform") for p in problem.params.free]
    )
