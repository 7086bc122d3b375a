"""Output-error estimation: likelihood without process noise, its exact gradient, and maximum-likelihood
fits by SLSQP.

Takes a model, run data and a parameter set. Process noise is the business of `filter_error`, posteriors of
`sampling`.
"""

from bayesid.estimation.output_error.batch_readings import readings_batch
from bayesid.estimation.output_error.fit_result import Fit, load_fit
from bayesid.estimation.output_error.flat_directions import Direction, flat_directions, rank, singular_values
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.read_run import initial_state, output_error_run
from bayesid.estimation.output_error.residual_correlation import beyond_chance, memory
from bayesid.estimation.output_error.search import FitOptions, fit, start_points
from bayesid.estimation.output_error.trial_setup import measured_base, trial_problem, unweighted
from bayesid.estimation.parameters import coefficient_set

__all__ = [
    "Direction",
    "Fit",
    "FitOptions",
    "FitProblem",
    "beyond_chance",
    "coefficient_set",
    "fit",
    "flat_directions",
    "initial_state",
    "load_fit",
    "measured_base",
    "memory",
    "rank",
    "readings_batch",
    "output_error_run",
    "singular_values",
    "start_points",
    "trial_problem",
    "unweighted",
]
