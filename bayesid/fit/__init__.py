"""Maximum-likelihood fits by SLSQP with exact gradients."""

from bayesid.fit.result import Fit, load_fit
from bayesid.fit.run import Options, fit, start_points

__all__ = ["Fit", "Options", "fit", "load_fit", "start_points"]
