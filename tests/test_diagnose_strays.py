"""Outliers that only a known environment shows."""

from dataclasses import replace

import numpy as np
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnose.outliers import stripped
from bayesid.diagnose.problem import fit_with, pose


def test_yaw_rates_off_by_eight_sigma_are_found_along_the_fit_and_nothing_else_is():
    model = model_of("generic_sub")
    trial = planted_trial(model, other_vehicle(model, 5), seed=1, samples=160)
    problem = pose(model, trial)
    log = problem.logs[0]
    j = log.channels.index(model.kernel.channels.index("r"))
    at = np.array([40, 90, 91 + 30])
    data = log.data.copy()
    data[at, j] += 8.0 * log.sigma[j]
    spoilt = [replace(log, data=data), *problem.logs[1:]]
    fitted = fit_with(replace(problem, logs=tuple(spoilt)), ())
    kept, found = stripped(model, spoilt, fitted.points, problem.environment.colours)
    assert {(r, c) for r, _, c in found} == {(log.name, "r")}
    assert {round(t, 6) for _, t, _ in found} == {round(float(log.plan.t[i]), 6) for i in at}
    assert not kept[0].valid[at, j].any()
    assert stripped(model, problem.logs, fitted.points, problem.environment.colours)[1] == ()
