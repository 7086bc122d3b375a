"""Fisher information of planned runs: closed forms, differences, planes of symmetry, refits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.design import (
    Logging,
    PlanningCase,
    RunInformation,
    criteria,
    information,
    knowledge,
    library_within,
    limits,
    refitted,
    usual_logging,
)
from bayesid.analysis.design.criteria import contraction, flat_names, gain
from bayesid.analysis.design.information import planned, run_information
from bayesid.analysis.design.virtual_refit import marginal
from bayesid.analysis.identifiability import row_scaled
from bayesid.equations.model import build_model
from bayesid.errors import FitError, ManoeuvreError
from bayesid.model.terms import term
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import simulate


@pytest.fixture(scope="module")
def case() -> PlanningCase:
    model = build_model(load_vehicle("generic_sub"), 3)
    known = knowledge(model, [n for n in model.coefficients if n not in ("X_udot", "Y_vdot", "N_rdot")])
    return PlanningCase(model, known, usual_logging(model), limits(model, duration=400.0))


@pytest.fixture(scope="module")
def deep() -> PlanningCase:
    model = build_model(load_vehicle("generic_sub"), 6)
    return PlanningCase(model, knowledge(model), usual_logging(model), limits(model, duration=400.0))


def test_information_is_that_of_central_differences_with_the_start_unknown(case: PlanningCase) -> None:
    model, known = case.model, case.knowledge
    run = case.execution(library_within(model, case.bounds)["zigzag_20"]).run
    picked = [model.states.index(c) for c in run.channels]

    def readings(xi: np.ndarray, start: np.ndarray) -> np.ndarray:
        par = model.nominal.copy()
        par[known.where] = known.mean + known.root @ xi
        states = simulate(model, par, run.plan, run.x0 + run.initial_sd * start).states
        return (states[:, picked] / run.sigma).ravel()

    k, i = len(known.names), len(run.initial)
    rows = []
    for j in range(k + i):
        h = 1e-4 * np.eye(k + i)[j]
        rows.append((readings(h[:k], h[k:]) - readings(-h[:k], -h[k:])) / 2e-4)
    jac = np.array(rows).T
    whole = jac.T @ jac + np.diag(np.r_[np.zeros(k), np.ones(i)])
    expected = whole[:k, :k] - whole[:k, k:] @ np.linalg.solve(whole[k:, k:], whole[k:, :k])
    found = run_information(model, known, model.nominal, run)
    # |v| and |r| have kinks, so differences across a zero crossing are good to about 1e-3
    assert np.allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_twice_the_noise_is_a_quarter_of_the_information(case: PlanningCase) -> None:
    turn = library_within(case.model, case.bounds)["turn"]
    noisy = Logging({c: 2 * s for c, s in case.logging.sigma.items()}, case.logging.dt)
    one, two = (
        run_information(case.model, case.knowledge, case.model.nominal, planned(
            case.model, case.model.nominal, turn, log).run)
        for log in (case.logging, noisy)
    )  # fmt: skip
    # not exactly: the prior of the start does not get larger; without it the factor is 4
    assert np.trace(one) / np.trace(two) == pytest.approx(4.0, rel=1e-3)


def test_no_manoeuvre_sees_a_row_scaled_as_a_whole(case: PlanningCase) -> None:
    """Exact symmetry of the equations (identifiability.row_scaled); needs the added mass free."""
    model = case.model
    known = knowledge(model, [*model.coefficients, "Y_rdot", "N_vdot"][: len(model.coefficients)])
    direction = (row_scaled(model, model.nominal, "Y", 1.001) - model.nominal)[known.where] / known.sd
    direction /= np.linalg.norm(direction)
    other = np.zeros(len(known.names))
    other[known.names.index("N_dr")] = 1.0
    for manoeuvre in library_within(model, case.bounds).values():
        run = case.execution(manoeuvre).run
        matrix = run_information(model, known, model.nominal, run)
        assert direction @ matrix @ direction < 1e-9 * max(np.trace(matrix), 1.0)
        if manoeuvre.name.startswith("zig-zag"):  # the control: a direction that is seen
            assert other @ matrix @ other > 1e-2 * np.trace(matrix)


def vertical(names: tuple[str, ...]) -> list[int]:
    """Coefficients whose row is zero while the vehicle stays upright in a horizontal plane."""
    return [i for i, n in enumerate(names) if not term(n).planar and "p" not in term(n).regressor]


@pytest.mark.thorough
def test_level_motion_tells_nothing_of_the_vertical_plane(deep: PlanningCase) -> None:
    model, known = deep.model, deep.knowledge
    flat = model.nominal.copy()
    rolling = [n for n in model.index if n.startswith("K_") or n in ("Y_pdot", "N_pdot")]
    flat[model.positions([*rolling, "z_G", "z_B"])] = 0.0  # nothing rolls it, so it stays upright
    where = vertical(known.names)
    assert len(where) > 10
    found = library_within(model, deep.bounds)
    for name in ("zigzag_20", "turn", "random", "speedsteps"):
        matrix = run_information(model, known, flat, planned(model, flat, found[name], deep.logging).run)
        assert not np.any(contraction(known, matrix)[where]), name
    matrix = run_information(model, known, flat, planned(model, flat, found["vzigzag"], deep.logging).run)
    assert np.max(contraction(known, matrix)[where]) > 0.5


@pytest.mark.thorough
def test_a_vehicle_that_rolls_in_a_turn_tells_something_of_it(deep: PlanningCase) -> None:
    """Why the test above has to hold the vehicle upright: roll tips yaw into pitch."""
    model, known = deep.model, deep.knowledge
    turn = library_within(model, deep.bounds)["turn"]
    matrix = run_information(
        model, known, model.nominal, planned(model, model.nominal, turn, deep.logging).run
    )
    assert np.max(contraction(known, matrix)[vertical(known.names)]) > 0.1


def test_criteria_of_a_diagonal_information_are_the_closed_forms(case: PlanningCase) -> None:
    k = len(case.knowledge.names)
    values = np.geomspace(0.1, 100.0, k)
    found = criteria(case.knowledge, RunInformation("diagonal", 1.0, np.diag(values)[None]))
    assert found.gain == pytest.approx(0.5 * np.sum(np.log1p(values)))
    assert found.remaining == pytest.approx(np.mean(1 / (1 + values)))
    assert found.log_det == pytest.approx(np.mean(np.log(values)))
    assert found.trace_inverse == pytest.approx(np.mean(1 / values))
    assert (found.weakest, found.condition) == (pytest.approx(0.1), pytest.approx(1000.0))
    assert found.identified == np.sum(values > 1)
    assert found.contraction == pytest.approx(1 - 1 / np.sqrt(1 + values))


def test_what_cannot_be_seen_is_infinite_not_large(case: PlanningCase) -> None:
    straight = library_within(case.model, case.bounds)["straight"]
    found = criteria(case.knowledge, case.of(straight, case.model.nominal[None]))
    assert found.condition == np.inf and found.log_det == -np.inf and found.weakest == 0.0


def test_a_further_run_never_widens_a_coefficient(case: PlanningCase) -> None:
    draws = case.draws(np.random.default_rng(1), 3)
    found = library_within(case.model, case.bounds)
    total = case.now(draws)
    before = contraction(case.knowledge, total.matrices)
    assert not before.any()
    for name in ("zigzag_10", "turn", "multisine"):
        total = total + information(case.model, case.knowledge, draws, found[name], case.logging)
        after = contraction(case.knowledge, total.matrices)
        assert (after >= before - 1e-9).all()
        before = after


def test_directions_left_open_are_named_with_their_spread(case: PlanningCase) -> None:
    info = case.of(library_within(case.model, case.bounds)["straight"], case.model.nominal[None])
    names = flat_names(case.knowledge, info)
    assert len(names) == len(case.knowledge.names)
    assert all(sd == pytest.approx(1.0) for _, sd in names)
    rich = case.of(library_within(case.model, case.bounds)["multisine"], case.model.nominal[None])
    assert len(flat_names(case.knowledge, rich)) < len(names) - 5


def test_predicted_contraction_is_that_of_refits(case: PlanningCase) -> None:
    """Prediction before the run against the curvature where refits of noisy virtual trials ended."""
    model = case.model
    known = knowledge(model, case.knowledge.names, assumed=0.2)
    case = replace(case, knowledge=known)
    manoeuvre = library_within(model, limits(model, duration=900.0))["random"]
    draws = case.draws(np.random.default_rng(2), 6)
    expected = np.mean(contraction(known, case.of(manoeuvre, draws).matrices), axis=0)
    true = case.draws(np.random.default_rng(3), 3)
    refits = [refitted(model, known, [case.execution(manoeuvre, par)], par, s) for s, par in enumerate(true)]
    assert all(r.converged for r in refits)
    actual = np.mean([r.contraction(known) for r in refits], axis=0)
    good = expected > 0.5
    assert good.sum() >= 5
    ratio = (1 - actual[good]) / (1 - expected[good])
    assert ratio.max() < 1.5 and ratio.min() > 1 / 1.5
    inside = [
        np.abs(r.values - par[known.where]) / known.spread(r.covariance)
        for r, par in zip(refits, true, strict=True)
    ]
    assert np.mean(np.concatenate(inside) < 2) > 0.85  # 0.95 expected of 57 correlated ones


def test_information_gain_is_the_same_in_any_units(case: PlanningCase) -> None:
    """A joint prior instead of single ones: the determinant does not know the coordinates."""
    known = case.knowledge
    rng = np.random.default_rng(4)
    turned = np.linalg.qr(rng.standard_normal((len(known.names),) * 2))[0]
    run = case.execution(library_within(case.model, case.bounds)["multisine"]).run
    one = run_information(case.model, known, case.model.nominal, run)
    two = run_information(case.model, replace(known, root=known.root @ turned), case.model.nominal, run)
    assert gain(one) == pytest.approx(gain(two), rel=1e-9)
    shares = contraction(replace(known, root=known.root @ turned), two)
    assert shares == pytest.approx(contraction(known, one), abs=1e-9)


def test_marginal_covariance_is_the_block_of_the_inverse() -> None:
    jac = np.random.default_rng(5).standard_normal((40, 7))
    assert marginal(jac, 3) == pytest.approx(np.linalg.inv(jac.T @ jac)[:3, :3])


def test_numbers_that_make_no_sense_are_refused_in_one_message(case: PlanningCase) -> None:
    with pytest.raises(FitError, match="give positive numbers"):
        Logging({"x": -1.0}, 1.0)
    with pytest.raises(FitError, match="no channel wobble"):
        usual_logging(case.model, {"wobble": 1.0})
    with pytest.raises(FitError, match="relative sd"):
        knowledge(case.model, assumed=0.0)
    with pytest.raises(ManoeuvreError, match="2 problems"):
        limits(case.model, rudder=2.0, duration=-1.0)
