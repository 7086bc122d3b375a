"""The paper study: what is counted, marked and compared beside Furlong et al. (2003)."""

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.excitation.motion import exact_motion
from bayesid.equations.model import build_model
from bayesid.estimation.output_error.search import FitOptions, fit
from bayesid.estimation.output_error.simulated_recovery import (
    RecoveryCase,
    draw,
    make_target,
    problem_of,
    run_case,
)
from bayesid.manoeuvres import spiral
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import steady_start
from studies.paper_cases import counts, differences, figures, forces, monitor, similar

NAMES = ("X_vv", "X_rr", "Y_v", "Y_r", "N_v", "N_r")


@pytest.fixture(scope="module")
def boat():
    model = build_model(load_vehicle("generic_sub"), 3)
    return model, make_target(model, "spiral", spiral(90.0, end=120.0, dt=0.5), steady_start(model, 90.0))


def run(ratio, names=NAMES, at_bound=(), known=(), **more):
    point = {"ratio": list(ratio)}
    return {"names": names, "start": point, "goal": point, "end": point, "ratio": list(ratio),
            "low": [0.75] * len(names), "high": [1.25] * len(names), "known_ratio": list(known),
            "at_bound": list(at_bound), **more}  # fmt: skip


def test_coefficient_forces_balance_the_rigid_body_in_sway_and_yaw(boat):
    # m (vdot + u r) = Y and Izz rdot = N with the centre of mass at the origin (Gertler & Hagen 1967);
    # forces come from the force table and the regressors, the motion from the compiled kernel
    model, target = boat
    found = forces.forces_along(model, target)
    motion = exact_motion(model, model.nominal, target.plan, target.x0)
    u, r = (motion.states[:, model.states.index(s)] for s in "ur")
    rate = dict(zip(model.kernel.velocities, motion.rate.T, strict=True))
    mass, inertia = (model.nominal[model.index[n]] for n in ("m", "Izz"))
    for axis, body in (("Y", mass * (rate["v"] + u * r)), ("N", inertia * rate["r"])):
        total = sum(f for n, f in found.items() if n[0] == axis)
        size = max(np.abs(f).max() for n, f in found.items() if n[0] == axis)
        assert np.abs(total - body).max() < 1e-10 * size  # rounding of ten summands


def test_shares_of_force_sum_to_one_in_every_equation(boat):
    table = forces.force_table(*boat)
    assert set(table) == set(boat[0].coefficients)
    for axis in "XYN":
        assert sum(row["share"] for n, row in table.items() if n[0] == axis) == pytest.approx(1.0, abs=1e-12)
    assert table["N_vdot"]["share"] < 0.01 < table["N_r"]["share"]


def test_true_coefficients_predict_every_unfitted_manoeuvre_exactly(boat):
    model, _ = boat
    record = run([1.0] * len(NAMES))
    record["start"] = {"ratio": [1.05] * len(NAMES)}
    found = similar.prediction_table(model, [record], 90.0, 0.5, {})
    assert {row["kind"] for row in found.values()} == {similar.LIKE, similar.UNLIKE}
    for name, row in found.items():
        assert row["goal"]["position"][0] < 1e-9 and row["goal"]["heading"][0] < 1e-9, name
        if name != "coast-down":  # none of the six changed coefficients acts on a straight course
            assert row["start"]["position"][0] > 1.0, name


def test_known_and_zero_coefficients_are_marked_in_the_ratio_figures():
    names = ("X_vv", "X_rr", "Y_v", "N_r")
    runs = [
        run([1.1, 0.9], ("X_rr", "N_r"), known=(1.0, 0.99)),
        run([1.0, 1.2], ("X_rr", "N_r"), known=(1.01, 1.0)),
    ]
    columns = counts.shown(runs, names, ("Y_*",), "end")
    assert [(c.name, c.kind) for c in columns] == [
        ("X_vv", "known"), ("X_rr", "unknown"), ("Y_v", "known"), ("Y_*", "zero"), ("N_r", "unknown"),
    ]  # fmt: skip
    assert columns[0].end == (1.0, 1.01) and columns[2].end == (0.99, 1.0)
    assert columns[1].end == (1.1, 1.0) and not columns[3].end
    axes = figures.ratios(columns, (0.72, 1.28)).axes[0]
    marks = [line.get_marker() for line in axes.lines]
    assert marks.count("s") == 2 and marks.count("x") == 1
    at = {line.get_marker(): np.round(line.get_xdata()).tolist() for line in axes.lines}
    assert at["x"] == [3.0] and len(axes.patches) == 2  # bounds under the unknown ones only


def test_counts_at_the_bound_are_those_of_the_fits(boat):
    # a known wrong by up to 10 % and bounds of 2 %: the unknowns must run into some
    model, target = boat
    case = RecoveryCase("narrow", "", ("X_vv", "Y_v", "N_r"), ("Y_r",), 0.01, "truth", 0.02, 0.1)
    runs = [run_case(model, case, seed, [target], [target]) for seed in (0, 1)]
    for record, count in zip(runs, counts.on_bound(runs), strict=True):
        ratio, low, high = (np.array(v) for v in (record["end"]["ratio"], record["low"], record["high"]))
        assert count == np.sum(np.minimum(ratio - low, high - ratio) <= 1e-6 * (high - low))
    assert sum(counts.on_bound(runs)) == sum(counts.names_on_bound(runs).values()) > 0


def test_watching_the_search_moves_no_number_and_its_parts_add_up(boat):
    model, target = boat
    case = RecoveryCase("watched", "", NAMES)
    params, base = draw(model, case, 3)
    problem = problem_of(model, params, base, [target])
    options = FitOptions(gain=0.0, relative_gain=1e-3, rounds=3)
    notes = []
    plain, watched = fit(problem, options), fit(problem, options, note=notes.append)
    assert np.array_equal(plain.z, watched.z) and plain.costs == watched.costs
    assert [n.cost for n in notes] == list(watched.costs)
    # every cost the iterations asked for, and those of steps that ended a round without a gradient
    assert 0 < sum(n.trials for n in notes) <= watched.n_cost
    assert all(n.slope < 0 and 0 < n.length <= 1 + 1e-9 and n.violation < 1e-6 for n in notes)
    trace = {k: [vars(n)[k] for n in notes] for k in vars(notes[0])}
    shares = monitor.time_shares([{"trace": trace}], hessian=1e-6)
    assert sum(shares.values()) == pytest.approx(100.0) and min(shares.values()) > 0.0


def test_directional_derivative_is_the_slope_of_the_cost_along_the_step(boat):
    # one unknown: the step proposed is the change over the length taken, so slope = dV/dz * dz / length
    model, target = boat
    case = RecoveryCase("one", "", ("N_r",), start_error=0.1)
    params, base = draw(model, case, 1)
    problem = problem_of(model, params, base, [target])
    notes, at = [], [problem.start.copy()]
    fit(problem, FitOptions(gain=0.0, rounds=1, iterations=1), note=notes.append)
    slope = problem.cost_gradient(at[0])[1][0]
    step = notes[0].step * problem.scale[0] / notes[0].length
    assert abs(notes[0].slope) == pytest.approx(abs(slope) * step, rel=1e-6)


def test_hessian_update_meets_the_secant_condition_and_stays_positive():
    rng = np.random.default_rng(4)
    hessian, s = np.eye(5), rng.normal(size=5)
    y = s + 0.1 * rng.normal(size=5)
    assert monitor.bfgs_update(hessian, s, y) @ s == pytest.approx(y, rel=1e-12)
    damped = monitor.bfgs_update(hessian, s, -s)  # negative curvature: Powell's damping
    assert np.linalg.eigvalsh(damped).min() > 0.0


def table_of(error_n, error_y=1.0):
    off = {"X_vv": 1.0, "X_rr": 1.0, "Y_v": error_y, "Y_r": error_y, "N_v": error_n, "N_r": error_n}
    return run([1 + 0.01 * off[n] for n in NAMES])


def facts_for(record, force=0.3):
    row = {"kind": similar.LIKE, "goal": {"position": [0.01], "heading": [0.1]}}
    far = {"kind": similar.UNLIKE, "goal": {"position": [0.4], "heading": [0.2]}}
    return {
        "plain": {case: [record] for case in "123"},
        "predictions": {"like": row, "unlike": far},
        "forces": {n: {"share": force} for n in NAMES},
    }


@pytest.mark.parametrize("error, same", [(9.0, True), (1.1, False)])
def test_yaw_is_called_particularly_poor_only_if_it_is(error, same):
    record = table_of(error)
    found = differences._yaw({"1": [record]}, facts_for(record))
    assert found.same is same and bool(found.short) is not same
    assert counts.axis_errors([record], "goal")["N"] == pytest.approx(error)


@pytest.mark.parametrize("count, same", [(5, True), (2, False)])
def test_five_on_the_bounds_is_stated_from_the_counts_of_the_fits(count, same):
    record = run([1.0] * 6, at_bound=NAMES[:count])
    found = differences._bounds({"3": [record]}, facts_for(record))
    assert found.same is same and found.ours.startswith(f"{count} to {count} per fit")
    assert bool(found.short) is not same


def test_outlying_values_are_named_and_an_axis_without_one_is_not():
    record = run([1.0, 1.08, 1.0, 1.0, 1.07, 1.0])
    found = differences._strays({"2": [record]}, facts_for(record))
    assert not found.same and "X_rr" in found.short and "N_v" in found.short and "Y_" not in found.short
    both = run([1.0, 1.08, 1.07, 1.0, 1.0, 1.0])
    assert differences._strays({"2": [both]}, facts_for(both)).same


def test_unusual_manoeuvres_count_as_badly_predicted_beyond_a_tenth_of_the_length():
    facts = facts_for(table_of(1.0))
    assert not differences._unusual(facts).same and differences._similar(facts).same
    facts["predictions"]["unlike"]["goal"]["position"] = [11.0]
    facts["predictions"]["like"]["goal"]["position"] = [2.0]
    assert differences._unusual(facts).same and not differences._similar(facts).same


def test_worse_knowns_leave_the_starts_of_a_case_where_they_are(boat):
    # the extra fits with worse knowns draw the same starts, so that only the knowns differ
    model, _ = boat
    case = RecoveryCase("3", "", ("X_rr", "N_r"), ("Y_v",), known_error=0.01)
    starts = [draw(model, replace(case, known_error=e), 5)[0].start for e in (0.01, 0.05)]
    assert np.array_equal(*starts)
