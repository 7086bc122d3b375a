"""Runs and gradients of many parameter vectors equal those of one at a time."""

import numpy as np
import pytest

from bayesid.equations.model import build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import gradient, gradient_batch, plan_run, simulate, simulate_batch, steady_start


@pytest.fixture(scope="module")
def case():
    """Eighteen vectors: one full group of lanes and one with two."""
    model = build_model(load_vehicle("generic_sub"), 3)
    t = np.arange(0.0, 40.0, 2.0)
    plan = plan_run(model, t, {"delta_r_cmd": 0.2 * np.sin(t / 9), "n_cmd": np.full(t.size, 90.0)})
    rng = np.random.default_rng(4)
    pars = np.repeat(model.nominal[None], 18, axis=0)
    free = model.positions(model.coefficients)
    pars[:, free] *= 1 + 0.05 * rng.standard_normal((18, free.size))
    starts = steady_start(model, 90.0) + 0.1 * rng.standard_normal((18, 6))
    return model, plan, pars, starts


def effects_on(model, pars, actuators):
    """Every effect a little on; with `actuators` the chain differs between vectors."""
    out, rng = pars.copy(), np.random.default_rng(5)
    for effect in model.kernel.effects:
        for p in effect.parameters:
            spread = rng.uniform(0.5, 1.0, len(pars)) if actuators or not effect.stages else 0.7
            i = model.index[effect.key(p.name)]
            if actuators or i not in model.kernel.full.act_columns:
                out[:, i] = p.off + 0.02 * model.prior_sd(effect.key(p.name)) * spread
    return out


@pytest.mark.parametrize("kind", ["bare", "effects", "effects and actuators"])
def test_lanes_give_the_states_and_gradients_of_single_runs(case, kind):
    """Tolerance: rounding of sums in another order."""
    model, plan, pars, starts = case
    if kind != "bare":
        pars = effects_on(model, pars, actuators="actuators" in kind)

    def cotangent(states):
        return np.cos(states) + 0.1

    found = gradient_batch(model, pars, plan, starts, cotangent)
    tracks = simulate_batch(model, pars, plan, starts)
    assert np.allclose(tracks, found[0], rtol=1e-13, atol=1e-12)
    for j in (0, 7, 15, 16, 17):
        expected = gradient(model, pars[j], plan, starts[j], cotangent)
        single = simulate(model, pars[j], plan, starts[j])
        assert np.allclose(tracks[j], single.states, rtol=1e-11, atol=1e-11)
        for one, many in zip(expected[1:], found[1:], strict=True):
            assert np.allclose(many[j], one, rtol=1e-8, atol=1e-9 * np.abs(one).max())


def test_threads_change_nothing(case):
    model, plan, pars, starts = case
    many, begin = np.tile(pars, (8, 1)), np.tile(starts, (8, 1))
    one, two = (simulate_batch(model, many, plan, begin, threads=n) for n in (1, 2))
    assert np.array_equal(one, two)
