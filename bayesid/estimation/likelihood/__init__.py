"""How sure an output-error estimate is when its residuals are not white: composite likelihood of runs.

Answers: posterior of the parameters, which parts the noise is made of, whether the runs agree. Takes a
`FitProblem` and an estimate. Does not search; `output_error` does.
"""

from bayesid.estimation.likelihood.checks import HalvesCheck
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import CoefficientPosterior, coefficient_posterior

__all__ = ["CoefficientPosterior", "HalvesCheck", "NoiseParts", "coefficient_posterior"]
