"""Maximum-likelihood fits by SLSQP with exact gradients."""

from bayesid.fit.result import Fit, load_fit
from bayesid.fit.run import Options, fit, start_points
from bayesid.fit.trial import RunOutcome, TrialFit, fit_trial

__all__ = ["Fit", "Options", "RunOutcome", "TrialFit", "fit", "fit_trial", "load_fit", "start_points"]
