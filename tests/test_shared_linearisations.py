"""Fits that begin at the same points share their linearisations without any change of a number."""

import gc
import weakref
from dataclasses import replace

import numpy as np
from test_regressor_columns import MODEL, colours_of, path_of

from bayesid.equations.model import build_model
from bayesid.estimation.filter_error import shared_linearisations
from bayesid.estimation.filter_error.linearise import forces, linearise
from bayesid.estimation.filter_error.normal_equations import stacked_equations
from bayesid.estimation.parameters import coefficient_prior, effect_prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import actuate, plan_run

COEFFICIENTS = coefficient_prior(MODEL)


def logs_and_points():
    paths = [path_of(seed) for seed in (0, 1)]
    return [p.log for p in paths], [p.point for p in paths]


def assert_is_its_own(found, logs, points, free, noise_model):
    paths, grams = found
    own = [linearise(MODEL, log, p, free.where, forces(MODEL)) for log, p in zip(logs, points, strict=True)]
    for path, other in zip(paths, own, strict=True):
        for name in ("resid", "slope", "direct", "phi", "gamma", "psi", "defect"):
            np.testing.assert_array_equal(getattr(path, name), getattr(other, name))
    for g, other in zip(grams, stacked_equations(MODEL, own, free, noise_model), strict=True):
        assert np.array_equal(g.ss, other.ss) and np.array_equal(g.se, other.se)
        assert (g.ee, g.logdet) == (other.ee, other.logdet)
        assert g.used == other.used


def test_refits_from_the_same_points_get_the_linearisation_they_would_have_made():
    shared_linearisations._kept.pop(MODEL, None)
    logs, points = logs_and_points()
    noise_model = colours_of()
    effects = [e for e in MODEL.kernel.effects if e.smooth and e.dof <= MODEL.dof][::3]
    wide = replace(COEFFICIENTS, sd=COEFFICIENTS.sd * np.linspace(1.0, 10.0, len(COEFFICIENTS.names)))
    sets = [COEFFICIENTS, wide, *(COEFFICIENTS + effect_prior(MODEL, e) for e in effects)]
    for free in sets:
        assert_is_its_own(
            shared_linearisations.linear(MODEL, logs, points, free, noise_model),
            logs,
            points,
            free,
            noise_model,
        )
    kept = shared_linearisations._kept[MODEL].sets
    assert len(kept) == 1  # the control: all but the first came from one linearisation
    assert len(next(iter(kept.values())).free.names) > max(len(free.names) for free in sets)


def test_other_points_logs_environments_and_prior_means_are_not_taken_for_the_same():
    logs, points = logs_and_points()
    noise_model = colours_of()
    for _ in range(3):
        shared_linearisations.linear(MODEL, logs, points, COEFFICIENTS, noise_model)
    moved = [replace(p, states=p.states + 1e-9) for p in points]
    later = [replace(log, readings=log.readings + 1e-3) for log in logs]
    mean = replace(COEFFICIENTS, mean=1.01 * COEFFICIENTS.mean)
    for case in (
        (logs, moved, COEFFICIENTS, noise_model),
        (later, points, COEFFICIENTS, noise_model),
        (logs, points, COEFFICIENTS, colours_of(2e-4)),
        (logs, points, mean, noise_model),
    ):
        assert_is_its_own(shared_linearisations.linear(MODEL, *case), *case)


def test_a_plan_does_not_keep_its_model_alive():
    """Plans lie in what fits of a model share; that goes with the model, or diagnoses in a row pile up."""
    model = build_model(load_vehicle("remus100"), 3)
    par = model.with_values({"actuator_lag.tau": 0.6})
    t = np.arange(0.0, 20.0, 0.2)
    commands = {"delta_r_cmd": np.where(t > 5.0, 0.2, 0.0), "n_cmd": np.full(t.size, model.vehicle.rpm_ref)}
    plan = plan_run(model, t, commands)
    actuate(model, par, plan)
    gone = weakref.ref(model)
    del model
    gc.collect()
    assert gone() is None and plan.kept
