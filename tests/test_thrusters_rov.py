"""A hovering vehicle with six thrusters against Fossen's matrices told anew."""

from __future__ import annotations

import numpy as np
import pytest
from thruster_plants import ROV, rov_run, rov_trial

from bayesid.equations.model import build_model
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.segments import fit_in_pieces
from bayesid.model.vehicles import load_vehicle
from bayesid.report.fit_effects import effect_words
from bayesid.simulation import plan_run, simulate

pytestmark = pytest.mark.slow  # a kernel in 6-DOF of its own


def test_it_hovers_and_moves_in_six_axes_as_the_plant_does():
    model = build_model(load_vehicle(ROV), 6)
    t = np.arange(0.0, 30.0, 0.25)
    rng = np.random.default_rng(1)
    orders = rng.uniform(-1200, 1200, (t.size // 20 + 1, 6))[np.arange(t.size) // 20]
    run, states, _ = rov_run("", t, orders, rng, gain=(1, 1, 0.8, 1, 1, 1))
    plan = plan_run(model, t, run.commands, max_step=0.02)
    par = model.with_values({"thruster_3_gain.share": -0.2})
    assert np.abs(simulate(model, par, plan, states[0]).states[:, :12] - states).max() < 1e-3
    bare = simulate(model, model.nominal, plan, states[0]).states[:, :12]
    assert np.abs(bare - states).max() > 0.1
    still = simulate(model, model.nominal, plan_run(model, t, {}), np.zeros(12)).states
    assert np.abs(still[:, :12]).max() == 0.0


def test_a_weak_thruster_is_found_among_six():
    effects = tuple(f"thruster_{i}_gain" for i in range(1, 7))
    found = fit_in_pieces(
        rov_trial(1, gain=(1, 1, 0.85, 1, 1, 1)), 5.0, free=("X_u0", "N_r0"), effects=effects,
        parts=NoiseParts(),
    )  # fmt: skip
    assert found.fit.success
    for i, name in enumerate(effects):
        at = found.fit.names.index(f"{name}.share")
        truth = -0.15 if i == 2 else 0.0
        assert abs(found.fit.z[at] - truth) < 3.5 * found.fit.sd[at]
    told = effect_words(found)
    assert "less thrust" in told[2] and sum("does not show" in words for words in told) >= 4
