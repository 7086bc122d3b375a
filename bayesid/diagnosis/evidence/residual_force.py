"""The force that, added to a simulator along one run, leads it along the log.

Takes a `DiagnosisProblem`, one run and the parameters of a model. Gives the smoothed force per sample. Its
size and correlation time are those of the best evidence over a grid. Names no cause and changes no verdict.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.localisation import SIGNAL_AMPLITUDES, SIGNAL_TAUS
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, forces, linearise
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, mixing, smoothed
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData

SHOWN_AXES = ("X", "Y", "N")
PASSES = 8
LARGE = 0.01  # of 1/2 rho L^2 U^2: amplitudes are fractions of it


def residual_force(problem: DiagnosisProblem, log: RunData, par: Array) -> Array:
    """Smoothed residual force of a model along a run.

    Parameters
    ----------
    par : (n_par,) parameters of the model [SI]

    Returns
    -------
    (n, 3) array               X, Y [N] and N [N m] in body axes, the last interval's repeated at the end

    Raises
    ------
    BayesidError               if the model cannot be linearised along the readings
    """
    model, noise_model = problem.model, problem.environment.noise_model
    names = forces(model)
    begin = Trajectory(par, log.path, np.zeros((log.n - 1, len(names))))
    along = fit(model, [log], NO_PARAMETERS, noise_model, start=[begin], iterations=PASSES)
    path = linearise(model, log, along.path_points[0], NO_PARAMETERS.where)
    best = max(_louder(problem), key=lambda noise: _evidence(problem, path, noise))
    sm = smoothed(model, path, np.zeros(0), best, variances=False)
    nx = path.point.states.shape[1]
    force = sm.mean[:-1, nx : nx + len(names)] @ mixing(model, best).T
    shown = force[:, [names.index(f"force_{a}") for a in SHOWN_AXES]]
    return np.vstack([shown, shown[-1:]])


def _louder(problem: DiagnosisProblem) -> list[NoiseModel]:
    """The environment, and the environment with a free force of every size and correlation time."""
    model, real = problem.model, problem.environment.noise_model
    unit, time = LARGE * force_unit(model), model.scales["L"] / model.scales["U"]
    own = np.zeros(unit.size) if not real.force else np.asarray(real.force)
    return [
        replace(real, force=tuple(np.hypot(own, a * unit)), force_tau=tau * time)
        for a in SIGNAL_AMPLITUDES
        for tau in SIGNAL_TAUS
    ]


def _evidence(problem: DiagnosisProblem, path: Linearisation, noise: NoiseModel) -> float:
    return posterior(run_equations(problem.model, path, NO_PARAMETERS, noise)).log_evidence
