"""A long run linearised block by block says what it says as a whole."""

from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, noise_of

from bayesid.estimation.filter_error import parameter_slopes
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.filter_error.linearise import Trajectory, linearise, linearise_runs, released
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, smoothed
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import RunData
from bayesid.simulation import plan_run, simulate, steady_start

MODEL = model_of("remus100")
SAMPLES = 45
# inertia (it scales latent forces), the chain of the rudder, a late sensor, a bias, what depends on time
EFFECTS = ("actuator_lag", "position_latency", "gyro_bias", "ocean_current_varying", "thrust_decay")
NAMES = ["N_v", "N_rdot", "X_u|u|", *(f"{e}.{p.name}" for e in EFFECTS for p in MODEL.effects[e].parameters)]


def case(late=0.0, straight=False, filtered=False):
    s, rng = MODEL.scales, np.random.default_rng(1)
    t = 7.0 + 0.3 * s["L"] / s["U"] * np.arange(SAMPLES)
    rudder = 0.0 * t if straight else 0.1 * np.sign(np.sin(0.4 * np.arange(SAMPLES)))
    plan = plan_run(MODEL, t, {"n_cmd": np.full(SAMPLES, MODEL.vehicle.rpm_ref), "delta_r_cmd": rudder})
    states = simulate(MODEL, MODEL.nominal, plan, steady_start(MODEL), full=True).states
    names = ("x", "y", "psi", "r")
    sigma = np.array([noise_of(MODEL)[c] for c in names])
    data = states[:, [MODEL.kernel.full.states.index(c) for c in names]]
    data = data + sigma * rng.standard_normal(data.shape)
    data[rng.uniform(size=data.shape) < 0.1] = np.nan
    log = RunData(
        "a", plan, names, data, sigma, states[0], MODEL.kernel.full.states, np.full(states.shape[1], 0.1),
        path=states, straight=straight,
    )  # fmt: skip
    par = MODEL.nominal.copy()
    par[MODEL.index["position_latency.delay"]] = late
    force = 1e-3 * force_unit(MODEL) * rng.standard_normal((SAMPLES - 1, 3))
    before = states + 1e-3 * rng.standard_normal(states.shape) if filtered else None
    where = MODEL.positions(NAMES)
    free = GaussianPrior(
        tuple(NAMES), where, par[where] + 0.01, np.full(where.size, 0.1), np.full(where.size, -9.0)
    )
    return log, Trajectory(par, states, force, before), free


def both(monkeypatch, log, point, free):
    whole = linearise(MODEL, log, point, free.where)
    monkeypatch.setattr(parameter_slopes, "MOST_BYTES", 0)
    monkeypatch.setattr(parameter_slopes, "BLOCK", 7)
    parts = linearise(MODEL, log, point, free.where)
    assert whole.held and not parts.held
    return whole, parts


@pytest.mark.parametrize("kind", [{}, {"late": 0.2}, {"straight": True}, {"filtered": True, "late": 0.2}])
def test_slopes_made_block_by_block_are_those_of_the_whole_run(monkeypatch, kind):
    log, point, free = case(**kind)
    whole, parts = both(monkeypatch, log, point, free)
    for name in ("resid", "slope", "phi", "gamma", "defect"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))
    assert np.abs(whole.psi).max() > 0 and np.abs(whole.direct).max() > 0
    for first, last in [*parameter_slopes.blocks(SAMPLES), (0, SAMPLES), (3, 5)]:
        for one, two in zip(
            whole.by_parameter.part(first, last), parts.by_parameter.part(first, last), strict=True
        ):
            assert one.shape == two.shape
            # rates at the samples are sums over the same few intervals; einsum may take them in another order
            np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-15 * np.abs(one).max(initial=0.0))


def test_the_rudders_chain_is_gone_through_once_for_all_blocks(monkeypatch):
    log, point, free = case()
    _, parts = both(monkeypatch, log, point, free)
    made = []
    chain_of = parameter_slopes.chain_of
    monkeypatch.setattr(parameter_slopes, "chain_of", lambda *a: made.append(1) or chain_of(*a))
    for first, last in parameter_slopes.blocks(SAMPLES):
        parts.by_parameter.part(first, last)
    assert len(list(parameter_slopes.blocks(SAMPLES))) > 3 and len(made) == 1


def test_products_and_smoothed_states_are_those_of_the_whole_run(monkeypatch):
    log, point, free = case(late=0.2)
    s = MODEL.scales
    noise = NoiseModel(tuple(1e-4 * force_unit(MODEL)), 3 * s["L"] / s["U"], 0.1, 25 * s["L"] / s["U"])
    whole, parts = both(monkeypatch, log, point, free)
    rng = np.random.default_rng(0)
    extra = (
        rng.standard_normal((SAMPLES, 4, 2)),
        rng.standard_normal((SAMPLES - 1, whole.defect.shape[1], 2)),
    )
    for more in (None, extra):
        two, held = (run_equations(MODEL, p, free, noise, extra=more) for p in (parts, whole))
        # slopes made anew are those that are held but for the order of sums of a late sensor
        np.testing.assert_allclose(two.ss, held.ss, rtol=1e-9, atol=1e-12 * np.abs(held.ss).max())
        with monkeypatch.context() as unbroken:
            unbroken.setattr(parameter_slopes, "BLOCK", SAMPLES)
            one = run_equations(MODEL, whole, free, noise, extra=more)
        scale = np.sqrt(np.where(np.diag(one.ss) > 0, np.diag(one.ss), 1.0))
        np.testing.assert_allclose(
            two.ss / np.outer(scale, scale), one.ss / np.outer(scale, scale), atol=1e-11
        )
        np.testing.assert_allclose(two.se / scale, one.se / scale, atol=1e-10 * np.sqrt(one.ee))
        assert two.ee == pytest.approx(one.ee, rel=1e-11)
        assert (two.logdet, two.used) == (pytest.approx(one.logdet, rel=1e-12), one.used)
    step = np.full(len(NAMES), 0.01)
    moved = [smoothed(MODEL, p, step, noise) for p in (whole, parts)]
    np.testing.assert_allclose(moved[0].mean, moved[1].mean, rtol=1e-9, atol=1e-12)
    # control: another step smooths to something else
    other = smoothed(MODEL, replace(parts), 2 * step, noise).mean
    assert np.abs(other - moved[0].mean).max() > 1e-6


@pytest.mark.parametrize("kind", [{}, {"straight": True}, {"filtered": True}])
def test_paths_let_go_of_their_slopes_and_make_the_same_again(kind):
    log, point, free = case(**kind)
    whole = linearise(MODEL, log, point, free.where)
    anew = released(MODEL, whole, free.where)
    assert whole.held and not anew.held
    for one, two in zip(whole.by_parameter.part(0, SAMPLES), anew.by_parameter.part(0, SAMPLES), strict=True):
        np.testing.assert_array_equal(one, two)


def test_slopes_of_all_runs_together_stay_below_the_limit(monkeypatch):
    monkeypatch.setattr(parameter_slopes, "MOST_BYTES", 8 * 100 * 10 * 4)
    assert parameter_slopes.runs_held([60, 50, 30, 20], 10, 4) == (True, False, True, False)
    log, point, free = case()
    width = len(MODEL.kernel.channels) + point.states.shape[1]
    monkeypatch.setattr(parameter_slopes, "MOST_BYTES", 8 * width * len(NAMES) * 2 * SAMPLES)
    paths = linearise_runs(MODEL, [log] * 5, [point] * 5, free.where)
    assert [p.held for p in paths] == [True, True, False, False, False]


def test_a_fit_does_not_depend_on_how_many_slopes_are_held(monkeypatch):
    log, point, free = case(filtered=True)
    monkeypatch.setattr(parameter_slopes, "BLOCK", 16)
    noise = NoiseModel(tuple(1e-4 * force_unit(MODEL)), 3.0, 0.0, 25.0)
    found = []
    for most in (10**9, 0):
        monkeypatch.setattr(parameter_slopes, "MOST_BYTES", most)
        found.append(fit(MODEL, [log, log], free, noise, [point, point], iterations=5))
    one, two = found
    assert one.held[0].held and not two.held[0].held
    np.testing.assert_array_equal(one.values, two.values)
    assert one.log_evidence == two.log_evidence
    # control: a fit that stops a pass earlier is another
    assert not np.array_equal(
        fit(MODEL, [log, log], free, noise, [point, point], iterations=4).values, two.values
    )
