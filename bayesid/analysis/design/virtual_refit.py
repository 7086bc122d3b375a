"""What a run really tells: a virtual trial of a vehicle that differs, its refit, and the posterior there.

Takes a `Model`, `Knowledge`, a true vehicle and runs. Gives the Laplace posterior at the refit. The posterior
of record is the sampler's (`bayesid.estimation.sampling`); this one costs milliseconds and can be had by the
hundred.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.information import PlannedRun, runs_information
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.estimation.run_data import RunData
from bayesid.simulation import observe, simulate

Array = np.ndarray
LEAST_GAIN = (
    3e-3  # half chi-square a further step may still promise: less moves no estimate by a tenth of its sd
)


@dataclass(frozen=True, eq=False)
class Refit:
    """Laplace posterior.

    Attributes
    ----------
    values : (k,) coefficients where the posterior is highest [SI]
    covariance : (k, k) of xi there, in units of what was known; initial states marginalised
    unknowns : (nz,) coefficients and initial states as the problem orders them
    cost : half the sum of squared residuals
    converged : whether a further step would lower the cost by less than `LEAST_GAIN`
    """

    values: Array
    covariance: Array
    unknowns: Array
    cost: float
    converged: bool

    def contraction(self, knowledge: Knowledge) -> Array:
        """(k,) 1 - posterior sd / prior sd."""
        return 1.0 - knowledge.spread(self.covariance) / knowledge.sd

    @property
    def gain(self) -> float:
        """Half the log determinant of posterior over prior information [nats]."""
        return -0.5 * float(np.linalg.slogdet(self.covariance)[1])


def logged(
    model: Model,
    par: Array,
    execution: PlannedRun,
    rng: np.random.Generator,
    noise: CampaignNoise | None = None,
) -> RunData:
    """A run as its sensors give it, with the noise they are stated to have or that of a campaign."""
    run = execution.run
    dt = float(np.median(np.diff(run.plan.t)))
    if noise is not None:
        run = noise.as_logged(run, dt)
    states = simulate(model, par, run.plan, run.x0).states
    picked = [model.kernel.channels.index(c) for c in run.channels]
    readings = observe(model, par, run.plan, states)[:, picked]
    if noise is None:
        return replace(run, readings=readings + rng.standard_normal(readings.shape) * run.sigma)
    readings = np.where(run.valid, readings + noise.errors(run, dt, rng) * run.sigma, np.nan)
    return replace(run, readings=readings)


def problem_of(model: Model, knowledge: Knowledge, runs: Sequence[RunData]) -> FitProblem:
    """The problem of identifying the coefficients from runs, with what is known as prior."""
    return FitProblem(model, knowledge.parameters(), tuple(runs), np.array(model.nominal))


def refit(
    problem: FitProblem, knowledge: Knowledge, iterations: int = 40, start: Array | None = None
) -> Refit:
    """Highest posterior and its curvature there.

    Levenberg-Marquardt, first with the noise raised towards the misfit: the prior then keeps the search out
    of the curved valleys that exact readings of a long run make (a fit without it still stood at ten times
    the least cost after 40 passes).

    Raises
    ------
    ModelError
        if the vehicle diverges at the start values
    """
    z = np.array(problem.start if start is None else start, dtype=float)
    cost = problem.cost(z)
    if not np.isfinite(cost):
        raise ModelError("the simulated vehicle diverges at the start values; nothing can be refitted")
    scale = np.concatenate([knowledge.sd, problem.scale[len(knowledge.names) :]])
    for factor in (30.0, 5.0):
        if cost > 0.5 * factor**2 * problem.n_readings:
            noisy = tuple(replace(run, sigma=run.sigma * factor) for run in problem.runs)
            z, _, _ = _descend(replace(problem, runs=noisy), z, scale, iterations // 2)
    z, jac, converged = _descend(problem, z, scale, iterations)
    k = len(knowledge.names)
    inner = np.linalg.solve(knowledge.root, np.diag(knowledge.sd))
    whole = marginal(jac * scale, k)
    return Refit(z[:k], inner @ whole @ inner.T, z, problem.cost(z), converged)


def _descend(problem: FitProblem, z: Array, scale: Array, iterations: int) -> tuple[Array, Array, bool]:
    """Levenberg-Marquardt: unknowns, Jacobian there, whether a further step would gain less than
    `LEAST_GAIN`."""
    cost, damping = problem.cost(z), 0.0
    resid, jac = problem.compressed(z)
    for _ in range(iterations):
        a = jac * scale
        size = np.maximum(np.linalg.norm(a, axis=0), 1e-300)
        # by least squares, not normal equations: in an unstable vehicle the start is felt e^20 times
        rows = np.vstack([a / size, np.sqrt(damping) * np.eye(a.shape[1])])
        step = np.linalg.lstsq(rows, np.concatenate([-resid, np.zeros(a.shape[1])]), rcond=1e-14)[0] / size
        expected = -0.5 * float((a.T @ resid) @ step)
        if expected < LEAST_GAIN and damping < 1e-3:
            return z, jac, True
        new = problem.cost(z + scale * step)
        if new < cost:
            z, cost = z + scale * step, new
            damping = 0.0 if damping < 1e-6 else damping / 4
            resid, jac = problem.compressed(z)
        else:
            damping = max(8 * damping, 1e-5)
            if damping > 1e8:
                break
    return z, jac, False


def marginal(jac: Array, k: int) -> Array:
    """Covariance of the first k unknowns of a whitened Jacobian, the others marginalised; by QR."""
    size = np.maximum(np.linalg.norm(jac, axis=0), 1e-300)
    order = np.concatenate([np.arange(k, jac.shape[1]), np.arange(k)])
    triangle = np.asarray(np.linalg.qr((jac / size)[:, order], mode="r"))
    last = np.linalg.inv(triangle[-k:, -k:]) / size[:k, None]
    return np.asarray(last @ last.T)


def refitted(
    model: Model,
    knowledge: Knowledge,
    executions: Sequence[PlannedRun],
    par: Array,
    seed: int,
    noise: CampaignNoise | None = None,
) -> Refit:
    """Virtual trial of runs of a true vehicle, and its refit; the seed fixes the noise.

    Under the noise of a campaign its errors remember, the coefficients of every run differ from the
    vehicle's as those of the campaign did, and readings weigh what they carry there.
    """
    rng = np.random.default_rng(seed)
    if noise is None:
        runs = [logged(model, par, execution, rng) for execution in executions]
        return refit(problem_of(model, knowledge, runs), knowledge)
    runs = []
    for execution in executions:
        own = np.array(par)
        differ = noise.parts.run_spread * noise.deviation @ rng.standard_normal(len(knowledge.names))
        own[knowledge.where] += knowledge.root @ differ
        runs.append(logged(model, own, execution, rng, noise))
    weighed = [replace(run, sigma=run.sigma / np.sqrt(noise.parts.share)) for run in runs]
    found = refit(problem_of(model, knowledge, weighed), knowledge)
    there = np.array(par)
    there[knowledge.where] = found.values
    told = runs_information(model, knowledge, there, runs, noise)
    return replace(found, covariance=np.linalg.inv(told + np.eye(len(told))))


def prediction_error(
    model: Model, knowledge: Knowledge, values: Array, par: Array, execution: PlannedRun
) -> float:
    """Rms error over sensor noise of a replayed run: coefficients `values` against the true vehicle.

    inf if the vehicle diverges with them.
    """
    guess = np.array(par)
    guess[knowledge.where] = values
    run = execution.run
    picked = [model.states.index(c) for c in run.channels]
    try:
        true = simulate(model, par, run.plan, run.x0).states[:, picked]
        found = simulate(model, guess, run.plan, run.x0).states[:, picked]
    except ModelError:
        return float("inf")
    return float(np.sqrt(np.mean(((found - true) / run.sigma) ** 2)))
