"""A force the equations lack: rows the hull's symmetry allows, used where runs ask for them only."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from bayesid.api.identify import identify
from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.likelihood.model_form import form_rows, typical, with_form
from bayesid.estimation.output_error import FitOptions, fit
from bayesid.model.terms import term
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import plan_run, simulate, steady_start
from studies.coverage import run as coverage
from studies.coverage.campaigns import Condition, campaign, problem_of

PLANTED, CLEAN, FORCE = "other equations: three more rows", "white noise", "large disturbing force"


@pytest.mark.parametrize(("name", "dof"), [("lauv", 3), ("generic_sub", 3), ("generic_sub", 6)])
def test_a_hull_with_its_form_turns_to_starboard_as_to_port(name, dof):
    """Mirrored rudder, mirrored track, all rows on."""
    model = build_model(load_vehicle(name), dof)
    s = model.scales
    base = model.nominal.copy()
    sideways = [n for n in model.index if n in ("y_G", "y_B", "Ixy", "Iyz")]
    constant = [n for n in ("Y_*", "K_*", "N_*") if n in model.index]
    base[model.positions([*sideways, *constant])] = 0.0
    rows = form_rows(model)
    assert len(rows) > 10 and not any(n.endswith("dot") or "*" in n for n in rows)

    def mirrored(names):
        par = base.copy()
        for n in names:
            par[model.index[n]] += 1e-5 * typical(model, n)
        t = 0.1 * s["L"] / s["U"] * np.arange(80)
        found = []
        for side in (1.0, -1.0):
            held = {"n_cmd": model.vehicle.rpm_ref, "delta_r_cmd": 0.1 * side}
            plan = plan_run(model, t, {name: np.full(t.size, value) for name, value in held.items()})
            states = simulate(model, par, plan, steady_start(model)).states
            sign = [side if n in ("y", "phi", "psi", "v", "p", "r") else 1.0 for n in model.states]
            found.append(states * sign)
        scale = np.maximum(np.abs(found[0]).max(axis=0), 1e-3)
        return np.abs((found[0] - found[1]) / scale).max()

    assert mirrored(rows) < 1e-7
    assert mirrored([*rows, "N_*"]) > 1e-4  # the control: a constant moment has a side


def test_the_form_of_a_fit_has_no_cube_of_a_fin():
    """One that predicts goes beyond the angles flown, where a cube outgrows all."""
    model = build_model(load_vehicle("lauv"), 3)
    plain, all_rows = form_rows(model), form_rows(model, cubes_of_fins=True)
    assert {n[2:] for n in set(all_rows) - set(plain)} == {"drdrdr", "vdrdr", "rdrdr", "vvdr", "vrdr", "rrdr"}
    assert {"Y_|r|dr", "N_vvv"} & set(plain)  # the control: cubes of the hull and a product with a fin stay


def test_a_typical_row_makes_its_force_at_the_typical_motion():
    model = build_model(load_vehicle("lauv"), 3)
    s = model.scales
    force = 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
    v, r = 0.2 * s["U"], 0.3 * s["U"] / s["L"]
    assert typical(model, "Y_vvr") * v * v * r * s["U"] ** -1 * s["U"] == pytest.approx(force)
    assert typical(model, "N_v|v|") * v * v == pytest.approx(force * s["L"])


def test_identify_takes_the_rows_of_a_fit_with_their_prior_and_values(tmp_path, monkeypatch):
    s = coverage.setting()
    trial = campaign(s, Condition(), s.params.start, np.random.default_rng(0))
    problem = problem_of(s, trial)
    first = fit(problem, FitOptions(profile=False, rounds=1, iterations=1))
    wide, size = with_form(problem, 3e-4), 3e-4
    row = next(n for n in wide.params.names if n not in problem.params.names)
    rows = [n for n in wide.params.names if n not in problem.params.names]
    k, value = first.n_params, 2 * wide.params[row].prior.spread
    names = (*first.names[:k], row)
    replace(
        first, names=names, n_params=k + 1, z=np.append(first.z[:k], value),
        uncertainty={"form": {"size": size, "rows": dict.fromkeys(rows, 0.0) | {row: 2 * size}}},
    ).save(tmp_path / "fit.json")  # fmt: skip
    seen = []

    def looked(problem, **_):
        seen.append(problem)
        raise FitError("seen enough")

    monkeypatch.setattr("bayesid.api.identify.look", looked)
    with pytest.raises(FitError, match="seen enough"):
        identify(trial, s.model.vehicle, fitted=tmp_path, profile=False)
    params = seen[0].params
    assert set(params.names) == set(wide.params.names)
    assert params[row].start == pytest.approx(value) and params[row].prior == wide.params[row].prior


def replicates(name, count, first=5000):
    s, condition = coverage.setting(), coverage.CONDITIONS[name]
    real = coverage.with_rows(s, condition.rows)
    found = [coverage.replicate(s, real, condition, first + k) for k in range(count)]
    return [r for r in found if not r["failed"]]


@pytest.mark.thorough
def test_rows_that_were_planted_are_asked_for_and_clean_runs_ask_for_none():
    (planted,) = replicates(PLANTED, 1)
    (clean,) = replicates(CLEAN, 1)
    assert planted["form"] > 0 and clean["form"] == 0
    assert np.sqrt(np.mean(planted["z"] ** 2)) < 0.5 * np.sqrt(np.mean(planted["white_z"] ** 2))


@pytest.mark.slow
def test_intervals_hold_where_the_equations_lack_rows_and_no_form_is_found_where_they_do_not():
    planted = replicates(PLANTED, 25)
    assert np.mean([r["form"] > 0 for r in planted]) >= 0.9
    inside = np.array([np.mean(r["inside"]) for r in planted])
    white = np.mean([np.mean(r["white_inside"]) for r in planted])
    assert inside.mean() > 0.88 - 2 * inside.std() / np.sqrt(inside.size)
    assert white < 0.7  # the control: white noise and the given rows alone
    for name in (CLEAN, FORCE):
        assert np.mean([r["form"] > 0 for r in replicates(name, 25)]) <= 0.08


def test_a_form_has_every_odd_product_of_third_order_in_drift_turning_and_rudder():
    """Abkowitz (1964): u only makes up the degree in velocity."""
    model = build_model(load_vehicle("lauv"), 3)
    found = {axis: set() for axis in "YN"}
    for name in form_rows(model, cubes_of_fins=True):
        row = term(name)
        powers = Counter(f.symbol for f in row.factors if f.symbol != "u")
        if row.axis in found and not any(f.wrap for f in row.factors) and sum(powers.values()) == 3:
            found[row.axis].add(tuple(powers[s] for s in ("v", "r", "delta_r")))
    every = {(i, j, 3 - i - j) for i in range(4) for j in range(4 - i)}
    assert found == {"Y": every, "N": every}


def test_another_power_of_drag_leaves_the_reference_speed_and_changes_others_as_a_power_does():
    """Where thrust and drag balance at two revolutions, thrust goes as drag with the power there."""
    model = build_model(load_vehicle("generic_sub"), 3)
    rpm, slow = model.vehicle.rpm_ref, 0.7 * model.vehicle.rpm_ref

    def speed(n, power):
        par = model.with_values({"power_of_drag.power": power})
        t = 0.5 * model.scales["L"] / model.scales["U"] * np.arange(120)
        plan = plan_run(model, t, {"n_cmd": np.full(t.size, n), "delta_r_cmd": np.zeros(t.size)})
        return simulate(model, par, plan, steady_start(model, n)).states[-1, model.states.index("u")]

    assert speed(rpm, 0.0) == pytest.approx(model.scales["U"], rel=0.02)
    assert speed(rpm, 0.5) == pytest.approx(speed(rpm, 0.0), rel=0.01)
    assert speed(slow, 0.5) > 1.03 * speed(slow, 0.0)  # less drag below the reference speed
    assert speed(1.4 * rpm, 0.5) < 0.97 * speed(1.4 * rpm, 0.0)  # more above


def test_an_asymmetry_in_turns_leaves_a_straight_course_and_moves_both_turns_to_one_side():
    model = build_model(load_vehicle("lauv"), 3)
    s, base = model.scales, model.nominal.copy()
    odd = [n for n in ("Y_*", "N_*") if n in model.index]
    base[model.positions(odd)] = 0.0
    with_it = base.copy()
    with_it[model.index["asymmetry_in_turns.N_rr"]] = 0.02 * abs(base[model.index["N_r"]]) * s["L"] / s["U"]

    def turned(par, rudder):
        t = 0.1 * s["L"] / s["U"] * np.arange(200)
        held = {"n_cmd": model.vehicle.rpm_ref, "delta_r_cmd": rudder}
        plan = plan_run(model, t, {name: np.full(t.size, value) for name, value in held.items()})
        return simulate(model, par, plan, steady_start(model)).states[-1, model.states.index("psi")]

    assert turned(with_it, 0.0) == turned(base, 0.0) == pytest.approx(0.0, abs=1e-12)
    port, starboard = (turned(with_it, d) - turned(base, d) for d in (0.1, -0.1))
    assert port * starboard > 0 and abs(port) > 1e-3
    assert turned(base, 0.1) == pytest.approx(-turned(base, -0.1), rel=1e-6)
