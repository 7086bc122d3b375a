"""How far the gap shrinks on held-out runs: intervals from pieces and posterior draws, standard measures."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.evidence import holdout_prediction
from bayesid.diagnosis.evidence.holdout import _worsens, validate_holdout
from bayesid.diagnosis.evidence.holdout_prediction import pieces_of, start_covariance
from bayesid.diagnosis.run import parameter_draws
from bayesid.estimation.filter_error.linearise import linearise
from bayesid.estimation.filter_error.noise_model import smoothed
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.estimation.segments import held_since
from bayesid.trials import window


@lru_cache
def case(gap, known=0.005):
    """Errors by horizon of a trial whose turn is held out, with a current as the explanation offered.

    known : relative sd of the coefficients; one short run cannot teach many of them
    """
    model = model_of()
    U = model.scales["U"]
    truth = other_vehicle(model_of(relative_sd=known), 1)
    if gap:
        truth |= {"ocean_current.V_north": 0.08 * U, "ocean_current.V_east": 0.04 * U}
    trial = planted_trial(model, truth, 1, samples=120, holdout=("turn",))
    problem = build_problem(model, trial, as_built=known)
    none, best = fit_with(problem, ()), fit_with(problem, (model.effects["ocean_current"],))
    models = {"nominal": model.nominal, "recalibrated": none.par, "with effect": best.par}
    rng = np.random.default_rng(0)
    draws = {"recalibrated": parameter_draws(none, rng), "with effect": parameter_draws(best, rng)}
    noise_model = problem.environment.noise_model
    with_draws = validate_holdout(problem, trial, models, noise_model, 0, draws)
    return model, best, with_draws, validate_holdout(problem, trial, models, noise_model, 0)


def test_the_true_effect_closes_the_gap_within_its_interval():
    _, _, shrink, _ = case(True)
    long = shrink.horizons[-1]
    assert long.significant and long.excess["recalibrated"] > 10.0
    assert long.shrink > 0.9 and long.interval[0] > 0.8
    for horizon_row in shrink.horizons:
        if horizon_row.significant and np.isfinite(horizon_row.interval[0]):
            assert horizon_row.interval[0] <= horizon_row.shrink + 0.1 and horizon_row.interval[1] <= 1.0


def test_another_explanation_does_not_predict_again_what_stands_beside_it(monkeypatch):
    model, best, _, first = case(True)
    truth = other_vehicle(model_of(relative_sd=0.005), 1)
    U = model.scales["U"]
    truth |= {"ocean_current.V_north": 0.08 * U, "ocean_current.V_east": 0.04 * U}
    trial = planted_trial(model, truth, 1, samples=120, holdout=("turn",))
    problem = build_problem(model, trial, as_built=0.005)
    none = fit_with(problem, ())
    followed, noise_model = [], problem.environment.noise_model
    real = holdout_prediction.followed
    monkeypatch.setattr(
        holdout_prediction, "followed", lambda *a, **k: followed.append(a[2]) or real(*a, **k)
    )

    def validated(explained, made):
        followed.clear()
        models = {"nominal": model.nominal, "recalibrated": none.par, "with effect": explained}
        return validate_holdout(problem, trial, models, noise_model, 0, made=made), list(followed)

    made = {}
    alone, calls = validated(best.par, made)
    assert [h.excess for h in alone.horizons] == [h.excess for h in first.horizons]
    pieces = sum(h.pieces for h in alone.horizons)
    assert len(calls) == 3 * pieces
    with_none, calls = validated(none.par, made)
    assert len(calls) == pieces and all(par is none.par for par in calls)
    # what is predicted from nothing kept is the same to the last digit; one model under two names is one
    again, calls = validated(none.par, {})
    assert len(calls) == 2 * pieces
    assert [h.excess for h in again.horizons] == [h.excess for h in with_none.horizons]
    assert again.measures == with_none.measures and again.measures
    assert again.horizons[-1].excess["with effect"] == again.horizons[-1].excess["recalibrated"]


def test_without_a_gap_there_is_nothing_to_shrink():
    _, _, shrink, _ = case(False)
    for horizon_row in shrink.horizons:
        assert not horizon_row.significant and np.isnan(horizon_row.shrink), horizon_row.horizon


def test_one_run_has_an_interval_from_posterior_draws_alone():
    _, _, with_draws, without = case(True)
    one, bare = with_draws.horizons[-1], without.horizons[-1]
    assert one.pieces == 1 and one.draws == 16 and np.isfinite(one.interval).all()
    # control: with neither pieces nor draws to resample no interval is claimed
    assert bare.draws == 0 and np.isnan(bare.interval).all()
    assert one.shrink == bare.shrink


def test_posterior_draws_have_the_posterior_s_mean_and_deviation():
    _, best, _, _ = case(True)
    draws = parameter_draws(best, np.random.default_rng(1), 4000)[:, best.free.where]
    z = (draws - best.values) / best.sd
    assert np.abs(z.mean(axis=0)).max() < 0.1 and np.abs(z.std(axis=0) - 1.0).max() < 0.06
    fixed = np.setdiff1d(np.arange(best.par.size), best.free.where)
    some = parameter_draws(best, np.random.default_rng(1), 3)[:, fixed]
    np.testing.assert_array_equal(some, np.repeat(best.par[None, fixed], 3, axis=0))


@pytest.mark.thorough
def test_coefficients_less_well_known_widen_the_interval():
    narrow, wide = (case(True, known)[2].horizons[-1].interval for known in (0.005, 0.05))
    assert wide[1] - wide[0] > 2.0 * (narrow[1] - narrow[0])


def test_measures_of_the_replay_come_as_logged_and_by_each_model():
    _, _, shrink, _ = case(True)
    advance = next(m for m in shrink.measures if m.name == "advance")
    assert set(advance.models) == {"nominal", "recalibrated", "with effect"}
    off = {k: abs(v - advance.logged) for k, v in advance.models.items()}
    assert off["with effect"] < off["nominal"]


def without(run, channels):
    return replace(run, data={c: v for c, v in run.data.items() if c not in channels})


def test_runs_may_log_different_channels():
    model, best, _, _ = case(True)
    trial = planted_trial(model, seed=1, samples=120, holdout=("turn",))
    zigzag, turn = trial.runs
    models = {"nominal": model.nominal, "recalibrated": model.nominal, "with effect": best.par}
    # one that only the second of the identify runs reads is predicted
    more = (without(zigzag, "uv"), replace(turn, name="again", role="identify"), turn)
    some = replace(trial, runs=more)
    problem = build_problem(model, some, as_built=0.005)
    assert "u" in problem.channels
    last = validate_holdout(problem, some, models, problem.environment.noise_model, 0).horizons[-1]
    assert np.isfinite(list(last.rms["nominal"].values())).all()
    # one it lacks is no number, and the others are what they are without it anywhere
    problem = build_problem(model, trial, as_built=0.005)
    lacking = replace(trial, runs=(zigzag, without(turn, "r")))
    last = validate_holdout(problem, lacking, models, problem.environment.noise_model, 0).horizons[-1]
    assert np.isnan(last.rms["nominal"]["r"]) and np.isnan(last.channels["nominal"]["r"])
    assert np.isfinite(last.excess["with effect"]) and last.floor > 1.0
    nowhere = build_problem(model, replace(trial, runs=(without(zigzag, "r"), turn)), as_built=0.005)
    other = validate_holdout(nowhere, lacking, models, problem.environment.noise_model, 0).horizons[-1]
    for channel in nowhere.channels:
        assert last.rms["nominal"][channel] == other.rms["nominal"][channel], channel


def test_a_run_of_few_readings_and_one_without_any_of_a_channel_are_no_obstacle():
    model = model_of()
    zigzag, turn = planted_trial(model, seed=1, samples=60).runs
    silent = replace(turn, data=turn.data | {"r": np.full(turn.t.size, np.nan)})
    trial = planted_trial(model, seed=1, samples=60)
    short = window(zigzag, 0.0, float(zigzag.t[4]))
    assert short.t.size < 9
    assert len(build_problem(model, replace(trial, runs=(short, silent))).logs) == 2


def test_only_a_prediction_worse_than_it_expects_of_itself_refutes():
    """Worse than re-tuned by luck of an unstable vehicle's start is no refutation; worse than expected is."""
    _, _, shrink, _ = case(True)
    row = shrink.horizons[-1]
    bad = {**row.excess, "with effect": 2.0 * row.excess["recalibrated"]}
    worse = replace(row, excess=bad, interval=(-2.0, -0.5), worsens=True)
    assert row.significant and not row.refutes
    assert replace(worse, expected=0.5 * bad["with effect"]).refutes
    just = bad["with effect"] + row.floor
    assert replace(worse, expected=just - 0.1).refutes and not replace(worse, expected=just + 0.1).refutes
    assert not replace(worse, expected=2.0 * bad["with effect"]).refutes
    assert replace(worse, expected=float("nan")).refutes  # nothing to judge it by
    assert not replace(worse, expected=0.0, interval=(-2.0, 0.1)).refutes


def test_a_prediction_by_the_truth_is_seldom_the_worse_one_by_chance():
    """A sea moves either prediction; what coefficients re-tuned without the cause change may help."""
    rng = np.random.default_rng(0)
    for pieces in (1, 2, 4, 12):
        refuted = harmed = 0
        for _ in range(400):
            sea = rng.standard_normal((pieces, 40)) * 5.0
            change = 2.0 * rng.standard_normal(40)
            before, after = np.mean((sea + change) ** 2, axis=1), np.mean(sea**2, axis=1)
            refuted += _worsens(before, after, 1.0)
            far = np.mean((sea + 8.0 * change) ** 2, axis=1)
            harmed += _worsens(after, far, 1.0)
        assert refuted <= 0.05 * 400
        assert harmed >= 0.9 * 400


def test_a_loss_below_the_floor_and_one_of_some_pieces_only_refute_nothing():
    flat = np.full(6, 2.0)
    assert _worsens(flat, flat + 3.0, 1.0)
    assert not _worsens(flat, flat + 0.9, 1.0)
    assert not _worsens(flat, flat + np.array([18.0, 0.0, -1.0, 0.0, 1.0, 0.0]), 1.0)


def test_what_an_explanation_expects_grows_with_what_is_unknown():
    model = model_of()
    trial = planted_trial(model, {}, 1, samples=120, holdout=("turn",))
    problem = build_problem(model, trial, as_built=0.005)
    none = fit_with(problem, ())
    models = {"nominal": model.nominal, "recalibrated": none.par, "with effect": none.par}
    drawn = parameter_draws(none, np.random.default_rng(0))
    point = np.repeat(none.par[None], len(drawn), axis=0)
    noise_model = problem.environment.noise_model
    start_alone, both, wider = (
        validate_holdout(problem, trial, models, noise_model, 0, {"with effect": d}).horizons[-1].expected
        for d in (point, drawn, point + 5.0 * (drawn - point))
    )
    assert 0.0 < start_alone < both < wider


def test_pieces_begin_where_the_orders_have_been_held():
    model = model_of()
    trial = planted_trial(model, {}, 1, samples=240, holdout=("zigzag_20",))
    run = next(r for r in trial.runs if "zigzag" in r.name)
    run = replace(run, role="holdout")
    length = 0.15 * run.duration
    pieces = pieces_of(run, 0.5 * length, length)
    held = held_since(run)
    assert len(pieces) > 2
    for piece, start in pieces[1:]:
        at = int(np.searchsorted(run.t, start))
        reach = (run.t >= start - 0.2 * 1.5 * length) & (run.t <= start)
        assert held[at] >= held[reach].max() - 1e-9
        assert piece.t[0] == start


def test_the_covariance_of_the_start_has_the_variances_of_the_smoother():
    model = model_of()
    trial = planted_trial(model, {}, 1, samples=120, holdout=("turn",))
    problem = build_problem(model, trial, as_built=0.005)
    noise_model = problem.environment.noise_model
    log, point = problem.logs[0], fit_with(problem, ()).points[0]
    path = linearise(model, log, point, NO_PARAMETERS.where)
    found = start_covariance(model, path, noise_model)
    variance = smoothed(model, path, np.zeros(0), noise_model).variance[0, : len(found)]
    assert np.allclose(np.diag(found), variance, rtol=1e-6, atol=1e-12 * variance.max())
    sd = np.sqrt(variance)
    seen = sd > 0
    correlation = found[np.ix_(seen, seen)] / np.outer(sd[seen], sd[seen])
    assert np.abs(correlation - np.diag(np.diag(correlation))).max() > 0.1  # they are not independent
