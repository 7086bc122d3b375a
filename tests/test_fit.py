"""A fit recovers what was planted, says what the data leave open, and survives being killed."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.output_error import FitOptions, coefficient_set, fit, load_fit, trial_problem
from bayesid.estimation.output_error.simulated_recovery import (
    RecoveryCase,
    draw,
    make_target,
    problem_of,
    run_case,
    run_seeds,
)
from bayesid.files import read_lines
from bayesid.manoeuvres import spiral, zigzag
from bayesid.model.params import Parameter, ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import steady_start
from bayesid.simulation.virtual_trial import virtual_trial

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.01, "u": 0.05, "v": 0.05, "r": 1e-3}
FREE = ("Y_v", "N_v", "Y_r", "N_r", "Y_dr", "N_dr")
PAPER = FitOptions(gain=0.0, relative_gain=1e-3)


@pytest.fixture(scope="module")
def model():
    return build_model(load_vehicle("generic_sub"), 3)


def zigzag_trial(model, noise=None, seed=0, par=None):
    manoeuvres = {
        "zz20": zigzag(0.35, 0.35, 90.0, 10.0, 300.0, 1.0),
        "zz10": zigzag(-0.17, 0.17, 90.0, 10.0, 300.0, 1.0),
    }
    rng = np.random.default_rng(seed) if noise else None
    values = model.nominal if par is None else par
    return virtual_trial(
        model, values, manoeuvres, title="t", vehicle_ref="generic_sub", noise=noise, rng=rng
    )


def planted(model, factor=1.15):
    return model.with_values({n: model.nominal[model.index[n]] * factor for n in FREE})


@pytest.fixture(scope="module")
def spiral_target(model):
    return make_target(model, "spiral", spiral(90.0, dt=0.5), steady_start(model, 90.0))


def test_noise_free_data_give_back_every_coefficient(model):
    # Case 2 of the paper with the accelerations known: 1e-6 is a hundred times what the search reaches
    x0 = steady_start(model, 90.0)
    target = make_target(model, "spiral", spiral(90.0, dt=1.0), x0)
    unknown = ("X_rr", "X_vr", "Y_r", "Y_v|r|", "Y_|r|dr", "N_r", "N_|v|r", "N_r|r|", "N_|r|dr")
    record = run_case(model, RecoveryCase("2a", "", unknown), 3, [target], [target])
    assert np.abs(np.array(record["end"]["ratio"]) - 1).max() < 1e-6
    assert record["status"] in ("rounding", "converged")


def test_planted_coefficients_are_found_within_their_standard_deviations(model):
    # 6 coefficients of one seed: beyond 4 sd happens to one of them with probability 4e-4
    truth = planted(model)
    trial = zigzag_trial(model, NOISE, seed=5, par=truth)
    result = fit(trial_problem(model, trial, coefficient_set(model, FREE, use_prior=False)))
    assert result.success, result.verdict
    away = (result.z[:6] - truth[model.positions(FREE)]) / result.sd[:6]
    assert np.abs(away).max() < 4
    assert 2 * result.cost / result.n_readings == pytest.approx(1.0, abs=0.06)


def test_noise_estimated_from_the_residuals_is_the_noise_that_was_added(model):
    trial = zigzag_trial(model, NOISE, seed=6)
    problem = trial_problem(model, trial, coefficient_set(model, FREE)).with_sigma(
        {c: 5 * s for c, s in NOISE.items()}
    )
    result = fit(problem, FitOptions(profile=True))
    assert result.converged
    for channel, sigma in NOISE.items():  # 602 readings: the estimate scatters by 3 %
        assert result.sigma[channel] == pytest.approx(sigma, rel=0.12)


def test_a_flat_valley_is_never_called_a_success(model, spiral_target):
    case = RecoveryCase("1", "", model.coefficients, bounds_around="start", bounds=0.1)
    params, base = draw(model, case, 0)
    problem = problem_of(model, params, base, [spiral_target])
    result = fit(problem, replace(PAPER, goal=1e-10 * problem.cost(problem.start)))
    assert result.converged and not result.success
    exact = [d for d in result.flat if d.exact]
    assert len(exact) == 3 and "not a success" in result.verdict
    assert any("Y_vdot" in d.name for d in exact)


@pytest.mark.thorough
def test_a_prior_that_holds_a_flat_direction_makes_it_a_success(model):
    trial = zigzag_trial(model, NOISE, seed=7)
    free = coefficient_set(model, use_prior=False)
    priors = tuple(
        replace(p, prior=Prior("normal", p.start, 0.1 * abs(p.start))) if p.name.endswith("dot") else p
        for p in free.entries
    )
    loose = fit(trial_problem(model, trial, free), FitOptions(rounds=6))
    held = fit(trial_problem(model, trial, ParameterSet(priors)), FitOptions(rounds=6))
    assert sum(d.exact and d.decided_by == "bounds" for d in loose.flat) == 2
    assert not any(d.exact and d.decided_by != "prior" for d in held.flat)
    by_prior = replace(held, status="converged", flat=tuple(d for d in held.flat if d.decided_by == "prior"))
    assert by_prior.flat and by_prior.success and "on the prior, not on these data" in by_prior.verdict


def test_a_coefficient_on_its_bound_is_reported(model):
    truth = planted(model, 1.3)
    trial = zigzag_trial(model, par=truth)
    params = coefficient_set(model, FREE, relative_bounds=0.2, use_prior=False)
    result = fit(trial_problem(model, trial, params, sigma=NOISE))
    assert result.at_bound
    for name in result.at_bound:
        i = result.names.index(name)
        assert min(abs(result.z[i] - result.low[i]), abs(result.high[i] - result.z[i])) < 1e-6 * abs(
            result.z[i]
        )


def test_every_iterate_is_on_disk_and_the_fit_can_be_read_back(model, tmp_path):
    trial = zigzag_trial(model, NOISE, seed=8, par=planted(model))
    result = fit(trial_problem(model, trial, coefficient_set(model, FREE)), folder=tmp_path)
    lines = read_lines(tmp_path / "iterates.jsonl")
    assert [line["cost"] for line in lines if line.get("kind") == "iterate"] == list(result.costs)
    stored = load_fit(tmp_path / "fit.json")
    assert stored.verdict == result.verdict and [d.name for d in stored.flat] == [d.name for d in result.flat]
    assert np.array_equal(stored.z, result.z) and np.allclose(
        stored.covariance, result.covariance, rtol=1e-12
    )


@pytest.mark.thorough
@pytest.mark.parametrize("profile", [False, True])
def test_a_fit_killed_at_any_line_of_its_log_ends_with_the_very_same_numbers(model, tmp_path, profile):
    trial = zigzag_trial(model, NOISE, seed=8, par=planted(model))
    problem = trial_problem(model, trial, coefficient_set(model, FREE))
    options = FitOptions(profile=profile, iterations=4)  # several rounds
    whole = fit(problem, options, folder=tmp_path / "whole")
    lines = (tmp_path / "whole" / "iterates.jsonl").read_text().splitlines()
    assert whole.rounds > 1
    for cut in range(1, len(lines)):
        torn = tmp_path / f"torn{cut}"
        torn.mkdir()
        (torn / "iterates.jsonl").write_text("\n".join(lines[:cut]) + "\n" + lines[cut][:40])
        said, told = [], []
        resumed = fit(
            problem,
            options,
            folder=torn,
            say=said.append,
            watch=lambda done, *_, told=told: told.append(done),
        )
        kept = told[0] - 1  # the first iterate that is found anew is the next
        if kept:
            assert len(said) == 1 and said[0].startswith(f"goes on after {kept} iterates")
        else:
            assert said == ["begins anew: the run before was interrupted in the first 4 iterates"] * (cut > 1)
        assert np.array_equal(resumed.z, whole.z) and np.array_equal(resumed.covariance, whole.covariance)
        assert (resumed.costs, resumed.sigma, resumed.message) == (whole.costs, whole.sigma, whole.message)
    said = []
    again = fit(problem, options, folder=torn, say=said.append)  # ended: read back
    assert said[0].startswith(
        f"goes on after a search of an earlier run of this fit, which had ended after {len(whole.costs)} "
    )
    assert np.array_equal(again.z, whole.z) and again.seconds == resumed.seconds
    assert again.costs == whole.costs


def test_another_problem_does_not_resume_from_a_foreign_log(model, tmp_path):
    trial = zigzag_trial(model, NOISE, seed=8)
    problem = trial_problem(model, trial, coefficient_set(model, FREE))
    fit(problem, FitOptions(rounds=1), folder=tmp_path)
    other = trial_problem(model, trial, coefficient_set(model, FREE[:3]))
    said = []
    result = fit(other, folder=tmp_path, say=said.append)
    assert said == ["begins anew: the iterates kept there are of another fit"]
    lines = read_lines(tmp_path / "iterates.jsonl")
    assert result.names[:3] == FREE[:3] and lines[-1]["kind"] == "end"
    assert {line["problem"] for line in lines if "problem" in line} == {problem.digest, other.digest}


def mixed_logs(model, folder):
    """Two fits of as many, but other, coefficients, and their logs as two commands at once mix them."""
    trial = zigzag_trial(model, NOISE, seed=8, par=planted(model))
    problems = [trial_problem(model, trial, coefficient_set(model, names)) for names in (FREE[:2], FREE[1:3])]
    results = [fit(p, folder=folder / str(i)) for i, p in enumerate(problems)]
    lines = [(folder / str(i) / "iterates.jsonl").read_text().splitlines() for i in (0, 1)]
    return problems, results, lines


def test_lines_of_another_fit_in_the_log_are_not_taken_for_this_one(model, tmp_path):
    problems, results, (mine, others) = mixed_logs(model, tmp_path)
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    (mixed / "iterates.jsonl").write_text("\n".join([*mine[:2], *others]) + "\n")
    found = fit(problems[0], folder=mixed)
    assert found.converged and found.costs == results[0].costs
    assert np.array_equal(found.z, results[0].z)
    assert (mixed / "iterates.jsonl").read_text().splitlines()[: 2 + len(others)] == [*mine[:2], *others]


@pytest.mark.thorough
@pytest.mark.parametrize("spoil", ["cost", "z", "shape", "kind"])
def test_a_log_whose_cost_is_not_that_of_its_values_is_refused_and_kept_aside(model, tmp_path, spoil):
    problems, results, (mine, others) = mixed_logs(model, tmp_path)
    spoilt, other = json.loads(mine[-1]), json.loads(others[-1])
    if spoil == "shape":
        spoilt["z"] = spoilt["z"][:-1]
    elif spoil == "kind":
        spoilt = {"digest": spoilt["digest"], "kind": "end", "start": 0}
    else:
        spoilt[spoil] = other[spoil]
    folder = tmp_path / "spoilt"
    folder.mkdir()
    text = "\n".join([*mine[:-1], json.dumps(spoilt)]) + "\n"
    (folder / "iterates.jsonl").write_text(text)
    with pytest.warns(UserWarning, match=r"not used.*kept as iterates.refused1.jsonl.*begins anew"):
        found = fit(problems[0], folder=folder)
    assert np.array_equal(found.z, results[0].z)
    assert (folder / "iterates.refused1.jsonl").read_text() == text


def test_other_options_do_not_go_on_from_the_log(model, tmp_path):
    trial = zigzag_trial(model, NOISE, seed=8, par=planted(model))
    problem = trial_problem(model, trial, coefficient_set(model, FREE[:2]))
    first = fit(problem, FitOptions(rounds=1, iterations=1), folder=tmp_path)
    assert first.status == "budget"  # which used to stand, however many rounds were allowed next time
    assert fit(problem, folder=tmp_path).converged


@pytest.mark.thorough
def test_several_starts_tell_how_many_end_in_the_same_place(model):
    trial = zigzag_trial(model, NOISE, seed=9)
    problem = trial_problem(model, trial, coefficient_set(model, FREE, use_prior=False), initial=False)
    result = fit(problem, FitOptions(starts=3, seed=4))
    assert len(result.starts) == 3 and "3 of 3 starts end there" in result.message


def test_a_fit_that_may_not_finish_is_a_result_that_says_so(model):
    trial = zigzag_trial(model, NOISE, seed=9, par=planted(model))
    result = fit(
        trial_problem(model, trial, coefficient_set(model, FREE)), FitOptions(rounds=1, iterations=1)
    )
    assert not result.converged and result.status == "budget" and "free fewer coefficients" in result.message


def test_a_vehicle_that_diverges_at_the_start_is_an_error_with_advice(model, spiral_target):
    wild = model.nominal[model.index["N_r"]] * -30
    params = ParameterSet((Parameter("N_r", wild, low=wild - 1e12, high=wild + 1e12, scale=abs(wild)),))
    with pytest.raises(FitError, match="diverges at the start"):
        fit(problem_of(model, params, np.array(model.nominal), [spiral_target]))


def test_shares_of_time_add_up(model):
    trial = zigzag_trial(model, NOISE, seed=9)
    result = fit(trial_problem(model, trial, coefficient_set(model, FREE)))
    assert sum(result.shares.values()) == pytest.approx(1.0)
    assert set(result.shares) == {"line_search", "gradient", "subproblem", "other"}


def test_finished_seeds_are_not_run_again(tmp_path):
    calls = []

    def work(seed):
        calls.append(seed)
        return {"seed": seed, "value": seed**2}

    first = run_seeds(work, range(3), tmp_path, "c")
    second = run_seeds(work, range(4), tmp_path, "c")
    assert sorted(calls) == [0, 1, 2, 3] and second[:3] == first
    assert json.loads((tmp_path / "c-3.json").read_text())["value"] == 9


def test_a_ship_is_not_given_the_submarine_row_of_a_force_it_has():
    ship = build_model(load_vehicle("kvlcc2_mmg"), 3)
    with pytest.raises(FitError, match=r"has N_v,U, N_r,U, by the equations of ships; N_v, N_r would be"):
        coefficient_set(ship, ["N_v", "N_r", "Y_v,U"])
    assert coefficient_set(ship, ["N_v,U", "N_r,U"]).names == ("N_v,U", "N_r,U")
