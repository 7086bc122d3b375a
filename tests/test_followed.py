"""A run whose sway nobody measured, its positions noisy, is followed from the start it had."""

import numpy as np
import pytest
from gap_trials import model_of

from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.followed import followed
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.simulation import observe, plan_run, simulate, steady_start
from bayesid.trials import Run

SIGMA = {"x": 1.0, "y": 1.0, "psi": 0.005, "u": 0.01, "r": 0.002}
CALM = NoiseModel(force=(0.0, 0.0, 0.0), force_tau=3.5, drift=0.05, drift_tau=6.0, arms=(0.37,))


def logged(seed):
    """A turn of a REMUS 100 without a velocity aside, of which only the first seconds are read."""
    model, t = model_of(), 0.2 * np.arange(150)
    orders = {"delta_r_cmd": np.where(t > 2.0, -0.2, 0.0), "n_cmd": np.full(t.size, model.vehicle.rpm_ref)}
    states = simulate(model, model.nominal, plan_run(model, t, orders), steady_start(model), full=True).states
    readings = observe(model, model.nominal, plan_run(model, t, orders), states)
    rng, where = np.random.default_rng(seed), model.kernel.channels.index
    data = {c: readings[:, where(c)] + sd * rng.standard_normal(t.size) for c, sd in SIGMA.items()}
    log = filter_error_run(model, Run("turn", "turn", "identify", t, data, orders), SIGMA, tuple(SIGMA))
    return model, log.without(np.repeat((t > 5.2)[:, None], len(log.channels), axis=1))


@pytest.mark.parametrize("seed", [0, 15, 19, 38])
def test_the_start_is_that_of_the_vehicle(seed):
    model, log = logged(seed)
    found = followed(model, log, model.nominal, CALM, iterations=15)
    truth = steady_start(model)[3:6]
    assert found.converged
    assert np.all(np.abs(found.points[0].states[0, 3:6] - truth[:3]) < (0.01, 0.01, 0.01))


def test_passes_at_the_real_environment_alone_do_not_find_it():
    """Control: what is followed anew has not arrived, and sails sideways."""
    model, log = logged(15)
    first = Trajectory(model.nominal, log.path, np.zeros((log.n - 1, 3)))
    alone = fit(model, [log], NO_PARAMETERS, CALM, [first], initial_noise_scale=0.0, iterations=15)
    assert not alone.converged and abs(alone.points[0].states[0, 4]) > 1.0
