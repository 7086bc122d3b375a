"""Posteriors by ensemble sampling: densities over whole trials, emcee with a convergence check, resumable."""

from bayesid.estimation.sampling.convergence import ConvergenceCheck, ConvergenceLimits, check_convergence
from bayesid.estimation.sampling.density import Density, Laplace, Unknowns
from bayesid.estimation.sampling.ensembles import SamplerOptions, sample
from bayesid.estimation.sampling.moves import WEIGHTS, GaussianMove, Reference, make_moves
from bayesid.estimation.sampling.posterior import Posterior, load_posterior
from bayesid.estimation.sampling.settings import SamplingSettings
from bayesid.estimation.sampling.trial_posterior import TrialDensity
from bayesid.estimation.sampling.trial_setup import trial_density

__all__ = [
    "WEIGHTS",
    "Density",
    "ConvergenceCheck",
    "GaussianMove",
    "Laplace",
    "ConvergenceLimits",
    "SamplerOptions",
    "Posterior",
    "Reference",
    "SamplingSettings",
    "TrialDensity",
    "Unknowns",
    "check_convergence",
    "load_posterior",
    "make_moves",
    "sample",
    "trial_density",
]
