"""The filter-error fit: planted coefficients and effects come back from far away, with honest deviations."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from gap_trials import model_of, noise_of, other_vehicle, planted_trial
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses import sensitivity_bank as banks
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.hypotheses.sensitivity_bank import build_bank, levels_between, screen
from bayesid.errors import ModelError
from bayesid.estimation.filter_error import fit as fits
from bayesid.estimation.filter_error import noise_identification
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations, posterior
from bayesid.estimation.filter_error.fit import (
    LEAST_SHARE,
    _relaxation,
    fit,
    stacked_equations,
    within_bounds,
)
from bayesid.estimation.filter_error.linearise import first_trajectory, linearise
from bayesid.estimation.filter_error.noise_model import filter_settings
from bayesid.estimation.filter_error.read_run import filter_error_run
from bayesid.estimation.parameters import NO_PARAMETERS
from bayesid.simulation import (
    interval_maps,
    observe_sensitivity,
    plan_trial_run,
    sensitivities,
    steady_start,
)
from bayesid.trials.trial import Environment

VEHICLES = ("remus100", "generic_sub")


def current(model, share, direction):
    """A current of a share of the speed."""
    U = model.scales["U"]
    return {
        "ocean_current.V_north": share * U * np.cos(direction),
        "ocean_current.V_east": share * U * np.sin(direction),
    }


@lru_cache
def case(name, seed):
    """Another vehicle of the prior in a current of 20 % of its speed: problem, truth, fit with it."""
    model = model_of(name)
    truth = other_vehicle(model, seed) | current(model, 0.2, 1.9 * seed + 0.7)
    problem = build_problem(model, planted_trial(model, truth, seed))
    return problem, truth, fit_with(problem, (model.effects["ocean_current"],))


def open_loop_chi2(model, problem, free, iterations):
    """Mean squared residual of whole replays after each Gauss-Newton pass with the prior, white noise."""
    par, values, out = model.nominal.copy(), free.mean.copy(), []
    for _ in range(iterations):
        par[free.where] = values
        h, g, square, count = np.eye(values.size), -(values - free.mean) / free.sd, 0.0, 0
        for log in problem.logs:
            start = steady_start(model)
            s = sensitivities(model, par, log.plan, start, free.where, initial=False, full=True, rates=True)
            value, slope = observe_sensitivity(model, par, log.plan, s, free.where)
            resid = ((log.readings - value[:, log.positions(model)]) / log.sigma).ravel()
            columns = (slope[:, log.positions(model)] / log.sigma[:, None]).reshape(resid.size, -1) * free.sd
            h, g = h + columns.T @ columns, g + columns.T @ resid
            square, count = square + resid @ resid, count + resid.size
        out.append(square / count)
        values = values + np.linalg.solve(h, g) * free.sd
    return out


@pytest.mark.parametrize("name", VEHICLES)
def test_a_current_of_a_fifth_of_the_speed_is_found_from_nominal(name):
    problem, truth, found = case(name, 0)
    assert found.converged and 0.8 < found.chi2 < 1.2
    z = [(v - truth[n]) / s for n, v, s in zip(found.free.names, found.values, found.sd, strict=True)]
    assert np.abs(z).max() < 4.0  # some 20 correlated normals: false alarm below 0.2 %
    U = problem.model.scales["U"]
    assert np.all(found.sd[-2:] < 0.01 * U)
    # the start is tens of sigma away in every reading
    assert open_loop_chi2(problem.model, problem, found.free, 1)[0] > 1e3


def test_replaying_whole_runs_does_not_arrive_from_there():
    # control, and the reason for latent forces: same unknowns, data and prior, Gauss-Newton on whole runs
    problem, _, found = case("remus100", 0)
    assert found.converged
    with pytest.raises(ModelError, match="diverges"):
        open_loop_chi2(problem.model, problem, found.free, 10)


def test_standard_deviations_are_those_of_the_errors():
    # 4 campaigns of two vehicles, some 170 estimates, correlated within a campaign
    z = []
    for name in VEHICLES:
        for seed in range(4):
            _, truth, found = case(name, seed)
            z += [
                (v - truth[n]) / s for n, v, s in zip(found.free.names, found.values, found.sd, strict=True)
            ]
    z = np.array(z)
    assert 0.75 < np.sqrt(np.mean(z**2)) < 1.25
    assert np.mean(np.abs(z) < 2.0) > 0.88


@pytest.mark.thorough
@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("seed", (0, 1))
def test_the_true_effect_beats_none_and_heads_the_screen(name, seed):
    problem, _, found = case(name, seed)
    model = problem.model
    none = fit_with(problem, ())
    assert found.log_evidence > none.log_evidence + 1000.0
    assert none.chi2 > 10.0
    effects = [e for e in model.kernel.effects if banks.testable(problem, e)]
    bank = build_bank(problem, problem.path, levels_between(problem, problem.path_level), effects)
    ranked = screen(bank)
    # a varying current contains a steady one: the family is what a screen can name
    assert model.effects[ranked[0].name].family == "current"
    rival = next(s for s in ranked if model.effects[s.name].family != "current")
    steady = next(s for s in ranked if s.name == "ocean_current")
    assert steady.gain > rival.gain + 30.0


@pytest.mark.parametrize("name", VEHICLES)
def test_the_optimum_does_not_depend_on_where_the_fit_starts(name):
    problem, _, found = case(name, 1)
    raw = fit(problem.model, problem.logs, found.free, problem.environment.noise_model)
    assert raw.converged
    # both stopped within `SETTLED` posterior sd of the optimum
    assert np.abs((raw.values - found.values) / found.sd).max() < 0.3
    assert abs(raw.log_evidence - found.log_evidence) < 0.5


def test_a_better_merit_along_a_path_that_has_not_settled_does_not_hold_a_fit_up():
    # no effect, in a current of one prior deviation: refused steps alone used up all passes
    model = model_of("generic_sub")
    effect = model.effects["ocean_current"]
    values = other_vehicle(model, 1) | {effect.key(p.name): p.off + p.sd for p in effect.parameters}
    swell = Environment(force_rms=1e-5, nav_drift=0.0)
    problem = build_problem(model, replace(planted_trial(model, values, 3), environment=swell))
    assert fit_with(problem, ()).converged


def test_a_log_keeps_missing_readings_out():
    model = model_of()
    trial = planted_trial(model)
    run = trial.runs[0]
    gone = dict(run.data)
    gone["x"] = np.where(np.arange(run.t.size) % 3 == 0, np.nan, gone["x"])
    log = filter_error_run(model, replace(run, data=gone), trial.noise, tuple(gone))
    k = list(gone).index("x")
    assert (~log.valid[:, k]).sum() == np.isnan(gone["x"]).sum()
    assert np.isfinite(log.path).all()


def test_the_first_guess_of_a_path_has_the_velocities_positions_and_heading_tell():
    model = model_of("remus100")
    trial = planted_trial(model, seed=4)
    run = trial.runs[0]
    noise = {c: noise_of(model)[c] for c in ("x", "y", "psi")}
    bare = replace(run, data={c: run.data[c] for c in noise})
    log = filter_error_run(model, bare, noise, tuple(noise))
    states = model.kernel.full.states
    for name, unit in (("u", model.scales["U"]), ("r", model.scales["U"] / model.scales["L"])):
        miss = log.path[:, states.index(name)] - run.data[name]
        assert np.sqrt(np.mean(miss**2)) < 0.12 * unit, name
    assert np.ptp(log.path[:, states.index("r")]) > 0.2 * model.scales["U"] / model.scales["L"]


def test_slopes_are_taken_along_the_smoothed_path_where_the_filtered_one_leaves_the_numbers():
    model = model_of()
    trial = planted_trial(model, other_vehicle(model, 2), 2, samples=30)
    problem = build_problem(model, trial)
    free = problem.coefficients
    log = problem.logs[0]
    point = replace(first_trajectory(model, log, model.nominal), before=None)
    wild = point.states.copy()
    wild[20, model.states.index("v")] = 1e6
    smoothed = linearise(model, log, point, free.where)
    found = linearise(model, log, replace(point, before=wild), free.where)
    np.testing.assert_array_equal(found.psi, smoothed.psi)
    np.testing.assert_array_equal(found.direct, smoothed.direct)
    # a filtered path that stays within them is still the one
    wild[20] = point.states[20] * 1.01
    assert np.abs(linearise(model, log, replace(point, before=wild), free.where).psi - smoothed.psi).max() > 0


def test_log_evidence_of_a_trial_is_that_of_its_readings_written_out():
    # the whole chain, a vehicle's own maps: one covariance of all readings, coefficients included
    model = model_of()
    trial = planted_trial(model, other_vehicle(model, 2), 2, samples=14)
    problem = build_problem(model, trial)
    noise_model = noise_identification.stated_noise(model, 1e-4, 0.3).noise_model
    log = problem.logs[0]
    free = problem.coefficients
    point = first_trajectory(model, log, model.nominal)
    path = linearise(model, log, point, free.where)
    gram = stacked_equations(model, [path], free, noise_model)[0]
    f = filter_settings(model, path, noise_model)
    n, q, nx, nf = log.n, len(log.channels), path.phi.shape[1], f.gamma.shape[2]
    # everything random as one standard normal vector: coefficients, first state, forces, drifts
    k, steps = len(free.names), f.gamma.shape[0]
    first, force = k, k + nx
    drift = force + nf * n
    size = drift + f.drift.shape[1] * n
    state, mean = np.zeros((nx, size)), log.path[0] - point.states[0]
    state[:, first : first + nx] = np.diag(np.sqrt(f.start))
    latent = np.zeros((nf, size))
    latent[:, force : force + nf] = np.diag(np.sqrt(f.variance_f))
    slow = np.zeros((f.drift.shape[1], size))
    slow[:, drift : drift + len(slow)] = np.diag(np.sqrt(f.variance_d))
    rows, resid = [], []
    for i in range(n):
        row = path.slope[i] @ state + f.drift @ slow
        row[:, :k] += path.direct[i] * free.sd
        rows.append(row)
        resid.append(path.resid[i] - path.slope[i] @ mean)
        if i == steps:
            break
        state = path.phi[i] @ state + f.gamma[i] @ latent
        state[:, :k] += path.psi[i] * free.sd
        mean = path.phi[i] @ mean + path.defect[i]
        fresh = np.sqrt(f.variance_f * (1 - f.decay_f[i] ** 2))
        latent = f.decay_f[i][:, None] * latent
        latent[:, force + nf * (i + 1) : force + nf * (i + 2)] += np.diag(fresh)
        fresh = np.sqrt(f.variance_d * (1 - f.decay_d[i] ** 2))
        slow = f.decay_d[i][:, None] * slow
        at = drift + len(slow) * (i + 1)
        slow[:, at : at + len(slow)] += np.diag(fresh)
    s = np.concatenate(rows) / np.tile(log.sigma, n)[:, None]
    e = np.concatenate(resid) / np.tile(log.sigma, n)
    kept = log.valid.ravel()
    assert kept.sum() == n * q == gram.used
    dense = multivariate_normal(np.zeros(kept.sum()), np.eye(kept.sum()) + s @ s.T).logpdf(e)
    dense -= np.log(np.tile(log.sigma, n)).sum()
    found = posterior(gram).log_evidence
    assert abs(found - dense) < 1e-8 * max(1.0, abs(dense))
    # control: without the drift it is another number
    calm = posterior(stacked_equations(model, [path], free, replace(noise_model, drift=0.0))[0]).log_evidence
    assert abs(calm - dense) > 1e-3


def test_a_released_fit_linearises_again_to_the_same_numbers():
    _, _, fitted = case(VEHICLES[0], 0)
    light = fitted.released()
    assert not light.held and light.chi2 == fitted.chi2
    for kept, again in zip(fitted.paths, light.paths, strict=True):
        for name in ("resid", "slope", "direct", "phi", "gamma", "psi", "defect"):
            assert np.array_equal(getattr(kept, name), getattr(again, name)), name


def test_a_fit_of_long_runs_holds_no_linearisation(monkeypatch):
    problem, _, fitted = case(VEHICLES[0], 0)
    monkeypatch.setattr(fits, "MOST_HELD", 1000)
    light = fit_with(problem, (problem.model.effects["ocean_current"],))
    assert fitted.held and not light.held
    assert np.array_equal(light.values, fitted.values) and light.log_evidence == fitted.log_evidence


def test_refits_of_a_diagnosis_hold_no_linearisation():
    problem, _, fitted = case(VEHICLES[0], 0)
    assert not weighted_hypothesis(problem, ("ocean_current",), fitted).fit.held


def test_a_bound_holds_one_unknown_and_the_others_are_at_the_best_beside_it():
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(40, 6)), rng.normal(size=40)
    total = normal_equations(b, a, 0.0, 40)
    free = posterior(total).mean
    assert within_bounds(total, free, np.full(6, -np.inf), np.full(6, np.inf)) is free
    low = np.where(np.arange(6) < 2, free + 0.3, -np.inf)
    found = within_bounds(total, free, low, np.full(6, np.inf))

    def cost(z):
        return np.sum((b - a @ z) ** 2) + z @ z

    by_hand = minimize(cost, np.maximum(free, low), method="L-BFGS-B", bounds=[(x, None) for x in low]).x
    assert found == pytest.approx(by_hand, abs=1e-5) and cost(found) < cost(np.maximum(free, low)) - 1e-3


def test_a_latency_that_would_have_to_be_negative_gains_nothing_over_none():
    """Positions stamped a sample early; the environment is measured, so its size is averaged over.

    The forbidden size gained 47 nats here in a calm that the range had not been applied to.
    """
    model = model_of("remus100")
    trial = planted_trial(model, other_vehicle(model, 3), 3, samples=160)
    early = []
    for run in trial.runs:
        data = dict(run.data)
        for c in ("x", "y"):
            data[c] = np.append(data[c][1:], np.nan)
        early.append(replace(run, data=data))
    problem = build_problem(model, replace(trial, runs=tuple(early), environment=None))
    assert problem.environment.source != "stated"
    effect = model.effects["position_latency"]
    none, late = (
        weighted_hypothesis(problem, names, fit_with(problem, effects))
        for names, effects in (((), ()), (("position_latency",), (effect,)))
    )
    assert none.fit.converged and late.fit.converged
    i = late.fit.free.names.index("position_latency.delay")
    assert late.fit.values[i] == 0.0
    k = len(problem.coefficients.names)
    gap = (late.fit.values[:k] - none.fit.values) / none.fit.sd
    assert np.abs(gap).max() < 0.1  # held at zero, it is no effect
    assert late.log_evidence - none.log_evidence < 0.0


def test_steps_of_single_intervals_are_half_as_many_and_lose_nothing_the_sensors_see():
    """Ends of the intervals a fit uses against those of steps eight times as short, in sensor deviations."""
    model = model_of("remus100")
    problem = build_problem(model, planted_trial(model, {}, 3))
    for log, run in zip(problem.logs, planted_trial(model, {}, 3).identify, strict=True):
        fine, usual = plan_trial_run(model, run, longer=0.25), plan_trial_run(model, run)
        assert log.plan.steps.size < 0.7 * usual.steps.size
        whole = filter_error_run(model, run, noise_of(model), log.channels)
        assert np.array_equal(whole.plan.steps, usual.steps)
        ends = [
            interval_maps(model, model.nominal, plan, log.path, (), np.zeros(0, dtype=np.int64)).ends
            for plan in (log.plan, fine)
        ]
        slope = linearise(model, log, first_trajectory(model, log, model.nominal), NO_PARAMETERS.where).slope
        seen = np.einsum("iqx,ix->iq", slope[1:], ends[0] - ends[1]) / log.sigma
        assert np.sqrt(np.mean(seen**2)) < 0.05


@pytest.mark.parametrize(("size", "told"), [(1e4, True), (1e9, False)])
def test_an_evidence_that_rounding_decides_is_none(size, told):
    """Residuals of 1e9 sd along a path that diverges: e'e and g'H^-1 g agree to 16 digits, what is left of
    both is rounding. Such a refit came first of all, 400 nats before the truth."""
    rng = np.random.default_rng(0)
    slopes = rng.standard_normal((200, 3))
    noise = rng.standard_normal(200)
    e = size * slopes @ np.array([1.0, -2.0, 0.5]) + noise
    g = NormalEquations(slopes.T @ slopes, slopes.T @ e, float(e @ e), 0.0, e.size)
    if not told:
        with pytest.raises(ModelError, match="cannot be linearised"):
            posterior(g)
        return
    exact = multivariate_normal.logpdf(e, cov=np.eye(200) + slopes @ slopes.T)
    assert posterior(g).log_evidence == pytest.approx(exact, rel=1e-6)


def products(spread):
    """Normal equations whose columns are worth so many prior deviations."""
    spread = np.asarray(spread, dtype=float)
    return NormalEquations(np.diag(spread**2), np.zeros(spread.size), 0.0, 0.0, spread.size)


@pytest.mark.parametrize("swing", [0.3, 0.9, 1.0, 1.4])
def test_steps_that_swing_come_to_rest(swing):
    """Whole steps of x <- x + r(x), r of slope -(1 + swing), halve only below a swing of one half."""
    total, at, share, lengths = products([3.0, 0.5]), np.array([1.0, -2.0]), 1.0, []
    before = None
    for _ in range(5):
        step = -(1.0 + swing) * at
        share = 1.0 if before is None else _relaxation(share, before, step, total)
        at, before = at + share * step, step
        lengths.append(float(np.linalg.norm(at)))
    assert lengths[-1] < 1e-9


def test_steps_that_shrink_are_taken_whole_and_those_that_grow_hardly():
    total, before = products([2.0, 1.0]), np.array([1.0, 0.5])
    assert _relaxation(1.0, before, 0.2 * before, total) == 1.0  # the same way, shorter
    assert _relaxation(1.0, before, before, total) == 1.0  # nothing learnt
    assert _relaxation(1.0, before, -30.0 * before, total) == LEAST_SHARE


def test_a_fit_whose_last_passes_diverge_ends_with_the_last_that_did_not(monkeypatch):
    model = model_of("generic_sub")
    truth = other_vehicle(model, 2) | {"ocean_current.V_north": 0.05 * model.scales["U"]}
    problem = build_problem(model, planted_trial(model, truth, 2, samples=160))
    first, made = fits.fresh, []

    def diverges(*given):
        made.append(1)
        paths, equations = first(*given)
        return paths, [replace(e, ee=np.inf) for e in equations] if len(made) > 1 else equations

    monkeypatch.setattr(fits, "fresh", diverges)
    found = fit_with(problem, (), start=problem.path, initial_noise_scale=0.0, iterations=4)
    assert len(made) == 4 and not found.converged
    total = sum(found.equations[1:], found.equations[0])
    assert posterior(total).log_evidence == found.posterior.log_evidence


def away(problem):
    """Points of the path of a problem with every coefficient off by a prior deviation."""
    par = problem.path[0].par.copy()
    par[problem.coefficients.where] += problem.coefficients.sd
    return [replace(point, par=par) for point in problem.path]


def test_a_try_that_comes_out_worse_is_followed_before_it_is_refused(monkeypatch):
    problem, *_ = case("generic_sub", 1)
    effects = (problem.model.effects["ocean_current"],)
    plain = fit_with(problem, effects, start=away(problem), initial_noise_scale=0.0)
    assert plain.converged and plain.iterations > 3
    asked = []

    def worse(best, *given):
        asked.append(best)
        return len(asked) in (1, 2)

    monkeypatch.setattr(fits._Best, "refused", worse)
    found = fit_with(problem, effects, start=away(problem), initial_noise_scale=0.0)
    assert asked[0] is asked[1] is asked[2] is not asked[3]  # against the point before the first of them
    assert found.converged and found.iterations == plain.iterations
    assert np.array_equal(found.values, plain.values)


def test_a_try_after_which_nothing_comes_out_better_is_gone_back_on(monkeypatch):
    problem, *_ = case("generic_sub", 1)
    first = fit_with(problem, (), start=away(problem), initial_noise_scale=0.0, iterations=1)
    monkeypatch.setattr(fits._Best, "refused", lambda best, *given: True)
    for passes in (3, fits.WATCHED_PASSES + 3):
        found = fit_with(problem, (), start=away(problem), initial_noise_scale=0.0, iterations=passes)
        assert not found.converged and found.iterations == passes
        assert found.log_evidence == first.log_evidence
        assert all(np.array_equal(a.par, b.par) for a, b in zip(found.about, first.about, strict=True))


@pytest.mark.parametrize("far", (1.0, 1.8, -1.5))
def test_a_fit_begun_near_the_optimum_in_a_loud_environment_arrives_there(far):
    # the real level holds from the first pass on: passes that let the path settle are no step that swung
    model = model_of("generic_sub")
    trial = planted_trial(model, other_vehicle(model, 3), 3, samples=120)
    problem = build_problem(model, trial)
    loud = replace(problem.environment.noise_model, force=(2e-5, 5e-5, 2e-4))
    unit = fits.force_unit(model)
    loud = replace(loud, force=tuple(np.array(loud.force) * unit))
    free = problem.coefficients
    there = fit(model, problem.logs, free, loud, start=problem.path)
    assert there.converged
    moved = there.values + far * there.sd / np.sqrt(there.values.size)
    start = []
    for point in there.points:
        par = point.par.copy()
        par[free.where] = moved
        start.append(replace(point, par=par))
    again = fit(model, problem.logs, free, loud, start=start, initial_noise_scale=1e-5)
    assert again.converged
    assert np.abs((again.values - there.values) / there.sd).max() < 0.2
