"""What the study is compared with: truth under other equations, and what white noise gives by linear theory.

Takes a `Setting`, a `Condition` and what was fitted. Gives coefficients, and shares of intervals. Does not
judge.

Where the equations are right the true value of an interval is the coefficient of the vehicle. Where they are
not, a row of the fit takes what it can of the forces it lacks (a strip integral over the hull is in part
Y_v|v| and N_r|r|), and more readings lead the fit there and not to the vehicle's number: to the coefficients
of least error (White 1982, Econometrica 50(1)), here of the runs without noise. Combinations that no run
shows have no such value; there it is the vehicle's own.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from bayesid.errors import BayesidError
from bayesid.estimation.likelihood.composite import inverse
from bayesid.estimation.likelihood.residual_noise import ResidualNoise
from bayesid.estimation.likelihood.run_information import run_information
from bayesid.estimation.output_error import FitOptions, FitProblem, fit
from bayesid.model.params import ParameterSet, Prior
from studies.coverage.campaigns import Condition, Setting, campaign, drawn_truth, problem_of

Array = np.ndarray
LEVEL = 1.6448536269514722  # sd of a 90 % interval
FAINT = 1 / 30  # noise of the readings the projected truth is found from, over the stated one
CAMPAIGNS = 4  # about which the theory is linear


def projected_truth(
    s: Setting, condition: Condition, truth: Array, fitted: FitProblem, real: Setting
) -> Array | None:
    """(k,) coefficients of the fitted equations that come nearest to the motion without noise.

    Parameters
    ----------
    fitted : the problem that was fitted, rows of a model form among its unknowns if it had any

    Returns
    -------
    None where the fit of these runs does not converge
    """
    known = dict(zip(s.params.names, truth, strict=True))
    entries = tuple(
        replace(p, start=known[p.name], prior=Prior("normal", known[p.name], p.prior.sd))
        if p.name in known and p.prior is not None
        else replace(p, start=0.0)
        for p in fitted.params.entries
    )
    try:
        clean = campaign(s, condition, truth, np.random.default_rng(0), real, noise_scale=0.0)
        problem = problem_of(s, clean, condition.piece).with_params(ParameterSet(entries))
        faint = {c: FAINT * sigma for c, sigma in s.noise.items()}
        found = fit(problem.with_sigma(faint), FitOptions(profile=False, starts=1))
    except BayesidError:
        return None
    return np.array(found.z[: truth.size]) if found.converged else None


def white_by_theory(s: Setting, condition: Condition) -> float:
    """Share of 90 % intervals that hold the truth, white noise assumed of a first-order autoregression.

    With information H, prior precision P and score covariance B, all about the truth, the interval has the
    covariance (H + P)^-1 and the error (H + P)^-1 (B + P) (H + P)^-1.
    """
    keep = math.exp(-1.0 / condition.memory)
    shares = []
    for seed in range(CAMPAIGNS):
        rng = np.random.default_rng(seed)
        truth = drawn_truth(s, rng)
        problem = problem_of(s, campaign(s, Condition(), truth, rng), condition.piece)
        problem = problem.with_params(problem.params.started_at(truth))
        k = truth.size
        h, b = np.zeros((k, k)), np.zeros((k, k))
        for info in run_information(problem, problem.start):
            channels = np.eye(info.columns.shape[1])
            noise = ResidualNoise(np.array([channels, keep * channels]), keep * channels[None])
            h += info.information
            b += noise.of_score(info.columns) + info.start.T @ info.start
        p = np.diag((problem.scale[:k] / problem.params.prior_sd) ** 2)
        claimed = inverse(h + p)
        ratio = np.sqrt(np.diag(claimed @ (b + p) @ claimed) / np.diag(claimed))
        shares.append(np.mean(2.0 * norm.cdf(LEVEL / ratio) - 1.0))
    return float(np.mean(shares))
