"""What a force that is left depends on: evidence by dense covariances; place and period planted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gap_trials import model_of, noise_of, orders, other_vehicle
from scipy.stats import multivariate_normal

from bayesid.diagnosis.cut_runs import CutRun, sought_in
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.dependence_search import dependence
from bayesid.diagnosis.event_words import depends
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.joined_runs import Joined, fewer
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.simulation import observe, plan_run, simulate, steady_start
from bayesid.trials import Run, Trial
from bayesid.trials.trial import Environment

KNOWN = 2
HULL = (
    "X_uu", "X_vv", "X_rr", "X_vr", "Y_v", "Y_r", "Y_v|v|", "Y_r|r|", "Y_v|r|", "Y_|v|r",
    "N_v", "N_r", "N_v|v|", "N_r|r|", "N_v|r|", "N_|v|r",
)  # fmt: skip


def random_runs(counts, rows, seed=0, readings=40):
    """Runs of random columns; also columns and residual of all readings, forces of all runs side by side."""
    rng = np.random.default_rng(seed)
    runs, known, forces, resid = [], [], [], []
    for k, count in enumerate(counts):
        own = rng.standard_normal((readings, KNOWN + rows * count))
        e = rng.standard_normal(readings)
        g = NormalEquations(own.T @ own, own.T @ e, float(e @ e), 0.0, readings)
        runs.append(CutRun(k, 0.0, 1.0, count, g))
        known.append(own[:, :KNOWN])
        forces.append(own[:, KNOWN:].reshape(readings, rows, count))
        resid.append(e)
    total = sum(counts)
    wide = np.zeros((readings * len(counts), rows, total))
    for k, f in enumerate(forces):
        first = sum(counts[:k])
        wide[k * readings : (k + 1) * readings, :, first : first + counts[k]] = f
    return runs, np.concatenate(known), wide.reshape(len(wide), -1), np.concatenate(resid)


def test_evidence_is_that_of_the_dense_covariance():
    counts, rows = (3, 5, 4), 2
    runs, known, forces, resid = random_runs(counts, rows)
    columns = np.random.default_rng(1).standard_normal((rows * sum(counts), 6))
    other = np.random.default_rng(2).standard_normal((rows * sum(counts), 3))
    noise = np.eye(resid.size) + known @ known.T

    def density(*parts):
        spread = noise + sum((forces @ c @ c.T @ forces.T for c in parts), np.zeros_like(noise))
        return multivariate_normal.logpdf(resid, cov=spread)

    joined = Joined(runs, KNOWN, range(rows))
    for a, gain in zip((0.1, 1.0), joined.gains(columns, (0.1, 1.0)), strict=True):
        assert gain == pytest.approx(density(a * columns) - density(), abs=1e-8)
    beside = joined.beside(other).gains(columns, (1.0,))[0]
    assert beside == pytest.approx(density(columns, other) - density(other), abs=1e-8)


def test_fewer_pieces_are_the_same_force_in_neighbours():
    (run,), *_ = random_runs((12,), 2)
    half = fewer(run, KNOWN, 6)
    assert half.count == 6 and half.width == 2.0
    value = np.random.default_rng(3).standard_normal((2, 6))
    slow = Joined([half], KNOWN, range(2)).gains(value.reshape(-1, 1), (1.0,))[0]
    fast = Joined([run], KNOWN, range(2)).gains(np.repeat(value, 2, axis=1).reshape(-1, 1), (1.0,))[0]
    assert slow == pytest.approx(fast, abs=1e-9)
    assert fewer(run, KNOWN, 12) is run


def trial_of(force, samples=160):
    """Two runs of another vehicle of the prior, in a force (time, states) over ground or on the hull."""
    model = model_of("remus100")
    par, sigma, rng = model.with_values(other_vehicle(model, 3)), noise_of(model), np.random.default_rng(3)
    runs = []
    for name, manoeuvre in orders(model, samples).items():
        plan = plan_run(model, manoeuvre.t, manoeuvre.commands)
        for _ in range(4):  # the force goes with a path that it bends
            states = simulate(model, par, plan, steady_start(model), full=True).states
            at = {n: np.interp(plan.times, manoeuvre.t, states[:, i]) for i, n in enumerate(model.states)}
            exogenous = plan.exogenous.copy()
            for axis, value in force(model, par, name, plan.times, at).items():
                exogenous[:, model.kernel.exogenous.index(f"force_{axis}")] = value
            plan = replace(plan, exogenous=exogenous)
        readings = observe(
            model, par, plan, simulate(model, par, plan, steady_start(model), full=True).states
        )
        where = model.kernel.channels.index
        data = {c: readings[:, where(c)] + sd * rng.standard_normal(samples) for c, sd in sigma.items()}
        runs.append(Run(name, manoeuvre.name, "identify", manoeuvre.t, data, manoeuvre.commands))
    calm = Environment(force_rms=1e-6, nav_drift=0.0)
    return model, Trial("pond", Path("."), "remus100", 3, tuple(runs), noise=sigma, environment=calm)


def found_in(force):
    model, trial = trial_of(force)
    problem = build_problem(model, trial)
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    return model.scales, dependence(sought_in(problem, none.fit.free, none.fit.followed), none.fit.par)


def test_nothing_is_found_where_only_coefficients_differ():
    assert found_in(lambda *rest: {})[1] is None


def test_a_force_of_the_motion_that_the_equations_lack_is_no_dependence():
    def cubed(model, par, name, t, at):
        s = model.scales
        return {"N": -1e-3 * 0.5 * s["rho"] * s["L"] ** 6 / s["U"] * at["r"] ** 3}

    assert found_in(cubed)[1] is None


def uneven(share, far):
    """Forces of the hull that grow and shrink by a share, to the north and back in `far` lengths."""

    def force(model, par, name, t, at):
        c = {row: par[model.index[row]] if row in model.index else 0.0 for row in HULL}
        u, v, r = at["u"], at["v"], at["r"]
        grown = share * np.sin(2.0 * np.pi * at["x"] / (far * model.scales["L"]))
        motion = {
            "v": u * v, "r": u * r, "v|v|": v * abs(v), "r|r|": r * abs(r), "v|r|": v * abs(r),
            "|v|r": abs(v) * r, "uu": u * u, "vv": v * v, "rr": r * r, "vr": v * r,
        }  # fmt: skip
        return {a: grown * sum(c[row] * motion[row[2:]] for row in HULL if row[0] == a) for a in "XYN"}

    return force


def swell(size, period):
    """A force to the north-east with a period [L/U]; size over 1/2 rho L^2 U^2."""

    def force(model, par, name, t, at):
        s = model.scales
        f = size * 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
        f = f * np.sin(2.0 * np.pi * t * s["U"] / (period * s["L"]) + (name == "turn"))
        return {"X": f * np.cos(at["psi"] - 0.8), "Y": -f * np.sin(at["psi"] - 0.8)}

    return force


def test_hull_forces_that_change_from_place_to_place_are_told():
    scales, found = found_in(uneven(0.3, 16.0))
    assert (found.on, found.acts) == ("place", "hull")
    assert found.alone == found.evidence > 30.0
    planted = 0.3 / 2.0**0.5  # of which a force of the motion takes a part
    assert 0.3 * planted < found.size < 1.2 * planted
    assert 2.0 <= found.scale / scales["L"] <= 8.0


def test_a_force_with_a_period_is_told():
    scales, found = found_in(swell(1e-3, 5.0))
    assert (found.on, found.acts) == ("period", "ground")
    assert found.scale * scales["U"] / scales["L"] == pytest.approx(5.0, rel=0.03)
    planted = 1e-3 * 0.5 * scales["rho"] * (scales["L"] * scales["U"]) ** 2 / 2.0**0.5
    assert found.size == pytest.approx(planted, rel=0.3)


@pytest.mark.parametrize(
    ("on", "acts", "scale", "size", "said"),
    [
        ("period", "ground", 263.0, 1.6e6, "a period of 263 s acts, 1.6 MN (rms)"),
        (
            "place",
            "hull",
            2560.0,
            0.18,
            "from place to place by 18% (rms), over about 2560 m, as over an uneven",
        ),
        ("place", "ground", 40.0, 3.2, "A force of 3.2 N (rms) that keeps its direction over ground changes"),
    ],
)
def test_it_is_told_in_the_units_of_whoever_reads(on, acts, scale, size, said):
    assert said in depends(Dependence(on, acts, 40.0, scale, size, 40.0))
