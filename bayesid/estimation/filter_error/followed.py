"""A run followed by a model whose parameters are given, as far as the run was read.

Takes a `Model`, one run and parameters. Gives the `FilterErrorFit` of its path. Estimates no parameter.
"""

from __future__ import annotations

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.run_data import Array, RunData


def followed(
    model: Model, log: RunData, par: Array, noise_model: NoiseModel, iterations: int
) -> FilterErrorFit:
    """The path of a model along the readings, under the real environment.

    Slopes of noisy positions can give the first path a sway that no pass at the real environment finds back
    from: the start it ends on has the vehicle sail sideways, and every simulation from it diverges. Where the
    passes do not arrive, the path is taken anew under a free force that is lowered pass by pass.

    Raises
    ------
    ModelError
        if the run cannot be followed
    """
    start = [Trajectory(par, log.path, np.zeros((log.n - 1, len(noise_model.force))))]
    try:
        found = fit(
            model, [log], NO_PARAMETERS, noise_model, start, initial_noise_scale=0.0, iterations=iterations
        )
        if found.converged:
            return found
        found = found.released()
    except ModelError:
        found = None
    try:
        freed = fit(model, [log], NO_PARAMETERS, noise_model, start)
    except ModelError:
        if found is None:
            raise
        return found
    return freed if freed.converged or found is None else found
