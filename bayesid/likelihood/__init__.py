"""The likelihood: residuals with exact Jacobians, priors, and which directions data leave open."""

from bayesid.likelihood.batch import readings_batch
from bayesid.likelihood.directions import Direction, flat_directions, rank, singular_values
from bayesid.likelihood.memory import beyond_chance, memory
from bayesid.likelihood.problem import Problem
from bayesid.likelihood.runs import RunData, initial_state, run_data
from bayesid.likelihood.setup import coefficient_set, measured_base, trial_problem, unweighted

__all__ = [
    "Direction",
    "Problem",
    "RunData",
    "beyond_chance",
    "coefficient_set",
    "flat_directions",
    "initial_state",
    "measured_base",
    "memory",
    "rank",
    "readings_batch",
    "run_data",
    "singular_values",
    "trial_problem",
    "unweighted",
]
