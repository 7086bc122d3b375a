"""Designs put to the test: paired campaigns, causes told apart, logs that predict one another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.design import PlanningCase, causes, knowledge, library_within, limits, usual_logging
from bayesid.analysis.design.discrimination import VIRTUAL_FORCE_LEVEL, evidence
from bayesid.analysis.design.goals import shrink
from bayesid.analysis.design.logged_runs import cross_logs, level
from bayesid.analysis.design.paired_comparison import paired, paired_outcomes
from bayesid.analysis.design.virtual_refit import logged
from bayesid.diagnosis.data.problem import build_problem
from bayesid.equations.model import build_model
from bayesid.errors import ModelError
from bayesid.manoeuvres import on_grid
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import Environment

MODEL = build_model(load_vehicle("generic_sub"), 3)
KNOWN = knowledge(MODEL, [n for n in MODEL.coefficients if n not in ("X_udot", "Y_vdot", "N_rdot")])
CASE = PlanningCase(MODEL, KNOWN, usual_logging(MODEL, dt=5.0), limits(MODEL, duration=300.0))
FOUND = library_within(MODEL, CASE.bounds)


def test_rich_run_wins_every_pair_against_a_straight_one_and_none_against_itself() -> None:
    draws = CASE.draws(np.random.default_rng(0), 2)
    truths = CASE.draws(np.random.default_rng(1), 5)
    goal = shrink(CASE.of(FOUND["zigzag_10"], draws))
    test = paired_outcomes(
        CASE, {"zigzag_10": FOUND["zigzag_10"]}, {n: FOUND[n] for n in ("multisine", "straight")}, goal,
        FOUND["turn"], truths, 3,
    )  # fmt: skip
    ratio, won, p = paired(test.left[0], test.left[1])
    assert won == 1.0 and ratio > 1.0 and p == pytest.approx(1 / 32)  # the least p five pairs can give
    assert paired(test.spread[0], test.spread[1])[1] == 1.0
    assert np.isnan(paired(test.left[0], test.left[0])).all()


def test_logs_of_a_rich_run_predict_better_and_the_table_knows_it_beforehand() -> None:
    """Virtual logs of a vehicle that differs; level of the joint fit is that of the sensors."""
    rng = np.random.default_rng(2)
    par = CASE.draws(rng, 1)[0]
    names = ("zigzag_modified", "zigzag_20", "random", "pullout")
    runs = {n: [logged(MODEL, par, CASE.execution(FOUND[n], par, n), rng)] for n in names}
    weights = level(MODEL, KNOWN, np.array(MODEL.nominal), runs)
    assert weights.fit.converged
    for channel, sigma in CASE.logging.sigma.items():
        assert weights.rms[channel] == pytest.approx(sigma, rel=0.25)
    table = cross_logs(MODEL, KNOWN, np.array(MODEL.nominal), runs, weights)
    made = table.others(table.excess)
    assert table.names[int(np.argmin(table.gains))] == "zigzag_modified"
    assert np.argmax(made) == np.argmin(table.gains)
    assert (table.before > table.joint).all() and table.before.sum() > 5 * table.joint.sum()


def test_a_planted_cause_is_told_from_its_rival_by_the_run_that_promised_to() -> None:
    """0.4 degrees of rudder offset against the side force of the screw; sea stated at 1e-5."""
    found = library_within(MODEL, limits(MODEL))
    flown_runs = {n: on_grid(found[n], 5.0) for n in ("straight", "speedsteps", "turn")}
    flown_runs["zigzag_10"] = replace(found["zigzag_10"], dt=5.0)
    par = MODEL.with_values({"rudder_offset.offset": 0.007})
    expected, margins = {}, {}
    for more in ("turn", "speedsteps"):
        names = ("straight", "zigzag_10", more)
        trial = virtual_trial(
            MODEL, par, {n: flown_runs[n] for n in names}, title="told", vehicle_ref="",
            noise=CASE.logging.sigma, rng=np.random.default_rng(4),
        )  # fmt: skip
        trial = replace(trial, environment=Environment(VIRTUAL_FORCE_LEVEL, 0.0))
        goal = causes(build_problem(MODEL, trial), ("rudder_offset", "propeller_side_force"), 0.2)
        seen = evidence(goal)
        expected[more], margins[more] = goal.now, seen["rudder_offset"] - seen["propeller_side_force"]
    assert expected["speedsteps"] > expected["turn"] + 1
    assert margins["speedsteps"] > margins["turn"] + 1 and margins["speedsteps"] > 5


def test_causes_that_cannot_show_are_refused() -> None:
    coarse = {"straight": on_grid(FOUND["straight"], 5.0)}
    trial = virtual_trial(
        MODEL, MODEL.nominal, coarse, title="t", vehicle_ref="", noise={"psi": 0.01, "u": 0.05},
        rng=np.random.default_rng(0),
    )  # fmt: skip
    kept = replace(trial, runs=tuple(
        replace(r, data={c: r.data[c] for c in ("psi", "u")}) for r in trial.runs))  # fmt: skip
    problem = build_problem(MODEL, kept)
    with pytest.raises(ModelError, match="no effect gremlins"):
        causes(problem, ("gremlins", "steady_force"))
    with pytest.raises(ModelError, match="cannot show"):
        causes(problem, ("gyro_bias", "steady_force"))
