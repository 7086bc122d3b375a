"""The force a simulator lacks along a run is the one that acted there: a steady force, in body axes."""

import numpy as np
from gap_trials import model_of, planted_trial

from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.evidence.residual_force import residual_force

NORTH, EAST = 2.0, -1.5  # [N]


def test_a_steady_force_is_found_along_the_heading_of_every_instant():
    model = model_of()
    truth = {"steady_force.F_north": NORTH, "steady_force.F_east": EAST}
    problem = build_problem(model, planted_trial(model, truth, 1, samples=120))
    for log in problem.logs:
        force = residual_force(problem, log, model.nominal)
        psi = log.path[:, model.kernel.full.states.index("psi")]
        expected = np.stack(
            [NORTH * np.cos(psi) + EAST * np.sin(psi), -NORTH * np.sin(psi) + EAST * np.cos(psi)], axis=1
        )
        inner = slice(10, -10)
        miss = np.sqrt(np.mean((force[inner, :2] - expected[inner]) ** 2))
        assert miss < 0.3 * np.hypot(NORTH, EAST)  # noise of the sensors; without a force found it is 0.7
        # control: the simulator that has the force lacks next to none
        par = model.nominal.copy()
        par[[model.index["steady_force.F_north"], model.index["steady_force.F_east"]]] = NORTH, EAST
        left = residual_force(problem, log, par)[inner, :2]
        assert np.sqrt(np.mean(left**2)) < 0.01 * np.hypot(NORTH, EAST)
