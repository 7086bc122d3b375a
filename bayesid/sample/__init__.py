"""Posteriors by ensemble sampling: densities over whole trials, emcee with a convergence gate, resumable."""

from bayesid.sample.density import Density, Laplace, Unknowns
from bayesid.sample.ensembles import Options, sample
from bayesid.sample.gate import Gate, Limits, judge
from bayesid.sample.moves import WEIGHTS, GaussianMove, Reference, make_moves
from bayesid.sample.posterior import Posterior, load_posterior
from bayesid.sample.settings import Settings
from bayesid.sample.setup import trial_density
from bayesid.sample.trial import TrialDensity

__all__ = [
    "WEIGHTS",
    "Density",
    "Gate",
    "GaussianMove",
    "Laplace",
    "Limits",
    "Options",
    "Posterior",
    "Reference",
    "Settings",
    "TrialDensity",
    "Unknowns",
    "judge",
    "load_posterior",
    "make_moves",
    "sample",
    "trial_density",
]
