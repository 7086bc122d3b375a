"""Outliers that only a known environment shows."""

from dataclasses import replace

import numpy as np
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.event import without_readings
from bayesid.diagnosis.data.outliers import stripped
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.trials import Run


def test_yaw_rates_off_by_eight_sigma_are_found_along_the_fit_and_nothing_else_is():
    model = model_of("generic_sub")
    trial = planted_trial(model, other_vehicle(model, 5), seed=1, samples=160)
    problem = build_problem(model, trial)
    log = problem.logs[0]
    j = log.channels.index("r")
    at = np.array([40, 90, 91 + 30])
    readings = log.readings.copy()
    readings[at, j] += 8.0 * log.sigma[j]
    spoilt = [replace(log, readings=readings), *problem.logs[1:]]
    fitted = fit_with(replace(problem, logs=tuple(spoilt)), ())
    kept, found = stripped(model, spoilt, fitted.points, problem.environment.noise_model)
    assert {(r, c) for r, _, c in found} == {(log.name, "r")}
    assert {round(t, 6) for _, t, _ in found} == {round(float(log.plan.t[i]), 6) for i in at}
    assert not kept[0].valid[at, j].any()
    assert stripped(model, problem.logs, fitted.points, problem.environment.noise_model)[1] == ()


def test_single_readings_are_taken_from_their_run_and_channel_and_from_no_other():
    t = 0.1 * np.arange(40)
    run = Run("a", "turn", "identify", t, {"r": np.sin(t), "psi": t}, {"n_cmd": np.ones(40)})
    less = without_readings(run, [(run.name, float(run.t[7]), "r"), ("another", float(run.t[9]), "r")])
    assert list(np.flatnonzero(np.isnan(less.data["r"]))) == [7]
    for name, values in run.data.items():
        assert np.isfinite(values).all()  # the run itself is as it was
        if name != "r":
            np.testing.assert_array_equal(less.data[name], values)
