"""Residuals are circular and skip gaps, their Jacobian is exact, and flat directions are named rightly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.identifiability import row_scaled, spectrum, yaw_mixed
from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.output_error import coefficient_set, flat_directions, rank, trial_problem, unweighted
from bayesid.estimation.output_error.flat_directions import combination, varimax
from bayesid.manoeuvres import spiral, zigzag
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, run_manoeuvre, simulate, steady_start
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01, "u": 0.05, "v": 0.05, "r": 1e-3}
FREE = ("Y_v", "N_v", "Y_r", "N_r", "N_dr", "X_vr")


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("generic_sub"), 3)


@pytest.fixture(scope="module")
def trial(model):
    short = zigzag(0.35, 0.35, 90.0, 10.0, 200.0, 1.0)
    rng = np.random.default_rng(1)
    return virtual_trial(
        model, model.nominal, {"zz": short}, title="t", vehicle_ref="generic_sub", noise=NOISE, rng=rng
    )


@pytest.fixture(scope="module")
def problem(model, trial):
    return trial_problem(model, trial, coefficient_set(model, FREE))


def differences(problem, z):
    """Central differences of the residuals."""
    columns = []
    for k in range(z.size):
        step = np.zeros_like(z)
        step[k] = 1e-5 * problem.scale[k]
        columns.append((problem.residuals(z + step) - problem.residuals(z - step)) / (2 * step[k]))
    return np.stack(columns, axis=1)


def moved(problem, seed=0):
    rng = np.random.default_rng(seed)
    return problem.start + 0.03 * problem.scale * rng.standard_normal(problem.start.size)


@pytest.mark.parametrize("variant", ["states", "lever arm", "current"])
def test_the_jacobian_agrees_with_central_differences(model, trial, variant):
    # Central differences of step 1e-5 leave about 1e-7 of the largest entry of a column.
    names = FREE
    if variant == "lever arm":
        trial = replace(trial, measured_point=(10.0, 2.0, 0.0))
    elif variant == "current":
        names = (*FREE, "ocean_current.V_north", "ocean_current.V_east")
    problem = trial_problem(model, trial, coefficient_set(model, names))
    z = moved(problem)
    resid, exact = problem.jacobian(z)
    assert resid == pytest.approx(problem.residuals(z), abs=1e-9)
    rough = differences(problem, z)
    assert (np.abs(exact - rough).max(axis=0) <= 2e-6 * np.abs(exact).max(axis=0)).all()


def test_the_adjoint_and_the_jacobian_give_the_same_gradient(problem):
    z = moved(problem)
    one, two = (replace(problem, adjoint=use).cost_gradient(z) for use in (True, False))
    assert one[0] == pytest.approx(two[0], rel=1e-12)
    assert np.abs(one[1] - two[1]).max() <= 1e-9 * np.abs(two[1]).max()


def test_a_tied_parameter_moves_with_its_master(model, trial):
    params = coefficient_set(model, ("Y_v",), ties={"N_v": ("Y_v", 0.4, 0.0)})
    problem = trial_problem(model, trial, params)
    z = moved(problem)
    exact = problem.jacobian(z)[1][:, 0]
    rough = differences(problem, z)[:, 0]
    assert np.abs(exact - rough).max() <= 2e-6 * np.abs(exact).max()


def test_missing_samples_add_nothing_and_have_no_slope(problem):
    run = problem.runs[0]
    readings = run.readings.copy()
    readings[3:50, 0] = np.nan
    gapped = replace(problem, runs=(replace(run, readings=readings),))
    z = moved(problem)
    resid, jac = gapped.jacobian(z)
    shape = readings.shape
    cells = resid[: readings.size].reshape(shape)
    rows = jac[: readings.size].reshape(*shape, -1)
    assert np.isfinite(resid).all() and not cells[3:50, 0].any() and not rows[3:50, 0].any()
    full = problem.residuals(z)[: readings.size].reshape(shape)
    full[3:50, 0] = 0.0
    assert cells == pytest.approx(full)
    assert gapped.n_readings == problem.n_readings - 47


def test_heading_is_compared_the_short_way_round(problem):
    run = problem.runs[0]
    column = run.channels.index("psi")
    turned = run.readings.copy()
    turned[:, column] += 2 * np.pi * np.random.default_rng(0).integers(-3, 4, turned.shape[0])
    wrapped = replace(problem, runs=(replace(run, readings=turned),))
    z = moved(problem)
    assert wrapped.residuals(z) == pytest.approx(problem.residuals(z), abs=1e-9)


def test_a_run_that_shares_no_channel_with_the_model_is_refused(model, trial):
    with pytest.raises(FitError, match="none of theta"):
        trial_problem(model, trial, coefficient_set(model, FREE), channels=("theta",))


def test_the_unweighted_cost_is_half_of_the_papers_V(model):
    x0 = steady_start(model, 90.0)
    history = spiral(90.0, dt=1.0)
    plan = plan_run(model, history.t, history.commands)
    target = simulate(model, model.nominal, plan, x0).states
    problem = unweighted(model, coefficient_set(model, FREE, use_prior=False), [("spiral", plan, target)], x0)
    z = problem.start * 1.01
    states = simulate(model, problem.split(z)[0], plan, x0).states
    assert 2 * problem.cost(z) == pytest.approx(np.sum((states - target)[:, :3] ** 2), rel=1e-12)


# ---- flat directions ----
@pytest.fixture(scope="module")
def inputs(model):
    x0 = steady_start(model, 90.0)
    found = {}
    for name, manoeuvre in (
        ("spiral", spiral(90.0, dt=0.5)),
        ("zig-zag", zigzag(0.35, 0.35, 90.0, 10.0, 600.0, 0.5)),
    ):
        track, commands = run_manoeuvre(model, model.nominal, manoeuvre, x0)
        found[name] = (plan_run(model, track.t, commands), x0)
    return found


@pytest.mark.parametrize(
    ("run", "known", "lost"),
    [
        ("spiral", (), 3),
        ("zig-zag", (), 2),
        ("spiral", ("Y_v", "N_v"), 1),
        ("zig-zag", ("Y_v", "N_v"), 0),
        ("spiral", ("Y_v", "N_v", "N_dr"), 0),
    ],
)
def test_exactly_flat_directions_are_as_many_as_theory_says(model, inputs, run, known, lost):
    # Rows of the equations of motion may be scaled; a one-sided turn also mixes yaw with sway (v|r| = -|v|r).
    names = tuple(n for n in model.coefficients if n not in known)
    assert len(names) - spectrum(model, model.nominal, [inputs[run]], names).rank == lost


def distance(model, par, run):
    plan, x0 = run
    apart = simulate(model, par, plan, x0).states - simulate(model, model.nominal, plan, x0).states
    return float(np.hypot(apart[:, 0], apart[:, 1]).max())


@pytest.mark.parametrize("axis", ["X", "Y", "N"])
@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_scaling_an_equation_changes_no_track(model, inputs, axis, factor):
    par = row_scaled(model, model.nominal, axis, factor)
    assert np.abs(par / np.where(model.nominal == 0, 1, model.nominal) - 1).max() > 0.04
    assert max(distance(model, par, run) for run in inputs.values()) < 1e-9


def test_mixing_sway_into_yaw_is_seen_only_when_the_turn_changes_side(model, inputs):
    par = yaw_mixed(model, model.nominal, 0.01)
    assert distance(model, par, inputs["spiral"]) < 1e-9
    assert distance(model, par, inputs["zig-zag"]) > 0.01


def test_the_scale_of_the_sway_equation_is_found_and_named(model, inputs):
    flat = spectrum(model, model.nominal, [inputs["zig-zag"]], model.coefficients, level=0.0).flat
    exact = [d for d in flat if d.exact]
    truth = row_scaled(model, model.nominal, "Y", 1 + 1e-6)
    where = model.positions(model.coefficients)
    change = truth[where] / model.nominal[where] - 1
    change /= np.linalg.norm(change)
    best = max(exact, key=lambda d: abs(d.vector @ change))
    assert abs(best.vector @ change) > 0.999
    assert best.name.startswith("0.61 Y_vdot - 0.37 Y_r") and "N_" not in best.name


def test_combinations_are_named_largest_first():
    assert combination(("Y_v", "Y_r", "N_v"), np.array([-0.71, -0.70, 0.05])) == "0.71 Y_v + 0.70 Y_r"


def test_varimax_keeps_the_space_and_separates_blocks():
    rng = np.random.default_rng(0)
    blocks = np.zeros((2, 6))
    blocks[0, :3], blocks[1, 3:] = 1 / np.sqrt(3), 1 / np.sqrt(3)
    turned = np.linalg.qr(rng.standard_normal((2, 2)))[0] @ blocks
    back = varimax(turned)
    assert back.T @ back == pytest.approx(blocks.T @ blocks)
    assert np.sort(np.abs(back), axis=1)[:, :3] == pytest.approx(np.zeros((2, 3)), abs=1e-6)


def test_what_holds_a_flat_direction_is_said():
    jac = np.diag([1e3, 1e-3])
    for prior, half, holder in ((0.1, 1.0, "prior"), (5.0, 1.0, "bounds"), (np.inf, np.inf, "nothing")):
        (found,) = flat_directions(("a", "b"), jac, 0.5, np.full(2, prior), np.full(2, half))
        assert (found.name, found.exact, found.decided_by) == ("1.00 b", False, holder)
    assert rank(np.array([1.0, 1e-15])) == 1


def test_the_compressed_jacobian_has_the_same_normal_equations(problem):
    z = moved(problem)
    resid, jac = problem.jacobian(z)
    small_resid, small = problem.compressed(z)
    assert small.shape[0] < 40 and small_resid @ small_resid == pytest.approx(resid @ resid, rel=1e-12)
    scaled, other = jac * problem.scale, small * problem.scale
    assert other.T @ other == pytest.approx(
        scaled.T @ scaled, rel=1e-9, abs=1e-9 * np.abs(scaled.T @ scaled).max()
    )
    assert other.T @ small_resid == pytest.approx(scaled.T @ resid, rel=1e-8)
