"""What a filter-error fit gives.

Holds numbers and where they were taken. Does not fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import GaussianPosterior, NormalEquations
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, forces, linearise_runs
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array, RunData


@dataclass(frozen=True, eq=False)
class FilterErrorFit:
    """Converged (or not) filter-error fit.

    Attributes
    ----------
    free : Free
    values : (k,) estimates [SI]
    posterior : Posterior of z = (value - mean)/sd
    par : full parameter vector
    noise_model : environment used
    points : one per run, where the next pass would begin
    model, logs, about : what was fitted, and where each run was linearised last
    held : its linearisations; empty once released, as they are most of what a fit takes in memory
    equations : one per run, columns in units of the prior sd, residual relative to the prior mean
    standard : per run (n, q) standardised innovations
    iterations, converged : Gauss-Newton passes and whether the last step was below `CONVERGED_STEP`
    posterior sd
    path_points, path_force_level, path_evidence : points of the most probable pass, its latent force over
        1/2 rho L^2 U^2 and its log evidence: a path that follows the data even where the model cannot
    """

    free: GaussianPrior
    values: Array
    posterior: GaussianPosterior
    par: Array
    noise_model: NoiseModel
    points: tuple[Trajectory, ...]
    model: Model
    logs: tuple[RunData, ...]
    about: tuple[Trajectory, ...]
    held: tuple[Linearisation, ...]
    equations: tuple[NormalEquations, ...]
    standard: tuple[Array, ...]
    iterations: int
    converged: bool
    path_points: tuple[Trajectory, ...]
    path_force_level: float
    path_evidence: float

    @property
    def log_evidence(self) -> float:
        return self.posterior.log_evidence

    @property
    def followed(self) -> tuple[Trajectory, ...]:
        """Where its runs follow the readings: its points, or those of its most probable pass before it has
        converged."""
        return self.points if self.converged else self.path_points

    @property
    def sd(self) -> Array:
        """Posterior standard deviations [SI]."""
        return np.sqrt(np.diag(self.posterior.covariance)) * self.free.sd

    @property
    def chi2(self) -> float:
        """Mean squared standardised innovation."""
        total = sum(float((s**2).sum()) for s in self.standard)
        return total / max(1, sum(int(log.valid.sum()) for log in self.logs))

    @property
    def paths(self) -> tuple[Linearisation, ...]:
        """Every run linearised, as held or made anew: the same numbers."""
        if self.held:
            return self.held
        return tuple(linearise_runs(self.model, self.logs, self.about, self.free.where, forces(self.model)))

    def released(self) -> FilterErrorFit:
        """The fit without its linearisations, which are made anew where they are asked for."""
        return replace(self, held=())
