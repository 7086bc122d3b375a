"""What a force that is left depends on: evidence by dense covariances; place and period planted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gap_trials import model_of, noise_of, orders, other_vehicle
from scipy.stats import multivariate_normal

from bayesid.diagnosis import cut_runs
from bayesid.diagnosis.cut_runs import CutRun, sought_in
from bayesid.diagnosis.data.dependence import Dependence
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.dependence_search import _map, _Tried, dependence
from bayesid.diagnosis.event_words import depends
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.joined_runs import MOST_COLUMNS, Pieces, fewer, joined, longest_runs
from bayesid.estimation.filter_error.evidence import NormalEquations
from bayesid.manoeuvres import OpenLoop
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

    whole = joined(runs, KNOWN, range(rows), range(len(runs)))
    for a, gain in zip((0.1, 1.0), whole.gains(columns, (0.1, 1.0)), strict=True):
        assert gain == pytest.approx(density(a * columns) - density(), abs=1e-8)
    beside = whole.beside(other).gains(columns, (1.0,))[0]
    assert beside == pytest.approx(density(columns, other) - density(other), abs=1e-8)


def test_fewer_pieces_are_the_same_force_in_neighbours():
    (run,), *_ = random_runs((12,), 2)
    half = fewer(run, KNOWN, 6)
    assert half.count == 6 and half.width == 2.0
    value = np.random.default_rng(3).standard_normal((2, 6))
    slow = joined([half], KNOWN, range(2), [0]).gains(value.reshape(-1, 1), (1.0,))[0]
    fast = joined([run], KNOWN, range(2), [0]).gains(np.repeat(value, 2, axis=1).reshape(-1, 1), (1.0,))[0]
    assert slow == pytest.approx(fast, abs=1e-9)
    assert fewer(run, KNOWN, 12) is run


def trial_of(
    force, samples=160, stated=True, keep=("zigzag", "turn", "zigzag back", "turn back"), wrong=None
):
    """Runs of another vehicle of the prior in a force (time, states); `wrong` is added to a channel."""
    model = model_of("remus100")
    par, sigma, rng = model.with_values(other_vehicle(model, 3)), noise_of(model), np.random.default_rng(3)
    runs = []
    flown = dict(orders(model, samples))
    for name, m in tuple(flown.items()):  # the other way: through places like those of the first
        other = {c: -v if c == "delta_r_cmd" else v for c, v in m.commands.items()}
        flown[f"{name} back"] = OpenLoop(m.name, m.t, other)
    for name, manoeuvre in flown.items():
        plan = plan_run(model, manoeuvre.t, manoeuvre.commands)
        for _ in range(4):  # the force goes with a path that it bends
            states = simulate(model, par, plan, steady_start(model), full=True).states
            at = {n: np.interp(plan.times, manoeuvre.t, states[:, i]) for i, n in enumerate(model.states)}
            exogenous = plan.exogenous.copy()
            for axis, value in force(model, par, name, plan.times, at).items():
                exogenous[:, model.kernel.exogenous.index(f"force_{axis}")] = value
            plan = replace(plan, exogenous=exogenous)
        states = simulate(model, par, plan, steady_start(model), full=True).states
        readings = observe(model, par, plan, states)
        where = model.kernel.channels.index
        data = {c: readings[:, where(c)] + sd * rng.standard_normal(samples) for c, sd in sigma.items()}
        for channel, error in (wrong or {}).items():
            data[channel] = data[channel] + error(model, manoeuvre.t)
        if name in keep:
            runs.append(Run(name, manoeuvre.name, "identify", manoeuvre.t, data, manoeuvre.commands))
    calm = Environment(force_rms=1e-6, nav_drift=0.0) if stated else None
    return model, Trial("pond", Path("."), "remus100", 3, tuple(runs), noise=sigma, environment=calm)


def found_in(force, **more):
    model, trial = trial_of(force, **more)
    problem = build_problem(model, trial)
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    return model.scales, dependence(sought_in(problem, none.fit.free, none.fit.followed), none.fit.par)


@pytest.mark.thorough
def test_nothing_is_found_where_only_coefficients_differ():
    assert found_in(lambda *rest: {})[1] is None


@pytest.mark.thorough
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
        wave = 2.0 * np.pi * at["x"] / (far * model.scales["L"])
        grown = share * (np.sin(wave) if np.isfinite(far) else 1.0)
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


@pytest.mark.thorough
def test_hull_forces_that_change_from_place_to_place_are_told():
    scales, found = found_in(uneven(0.3, 16.0))
    assert (found.on, found.acts) == ("place", "hull")
    assert found.alone == found.evidence > 30.0
    planted = 0.3 / 2.0**0.5  # of which a force of the motion takes a part
    assert 0.4 * planted < found.size < 1.1 * planted
    assert 2.0 <= found.scale / scales["L"] <= 8.0
    north, _, share = np.array(found.map).T
    there = np.sin(2.0 * np.pi * north / (16.0 * scales["L"]))
    assert np.corrcoef(share, there)[0, 1] > 0.6
    assert np.sqrt((share**2).mean()) < 1.3 * planted


def test_a_map_gives_a_force_over_ground_back_whatever_the_heading():
    """Columns of forces in body axes, their north and east in newtons, at places in metres."""
    rng, count, size = np.random.default_rng(5), 6, 40.0
    heading, place = rng.uniform(-3.0, 3.0, count), rng.standard_normal((count, 2))
    run, time = np.zeros(count, dtype=int), np.arange(float(count))
    hull, state = np.ones((count, 3)), np.zeros((count, 0))
    pieces = Pieces(run, time, place, heading, state, hull, np.ones(1))
    north, east = rng.standard_normal((2, count))
    body = np.array(
        [
            north * np.cos(heading) + east * np.sin(heading),
            -north * np.sin(heading) + east * np.cos(heading),
            rng.standard_normal(count),
        ]
    )
    drawn = np.array(_map(_Tried("place", "ground", 0.0, 1.0, body), body, pieces, 2.0, size))
    assert drawn == pytest.approx(np.column_stack([2.0 * place, size * north, size * east]))
    share = np.array(_map(_Tried("place", "hull", 0.0, 1.0, body), 0.3 * pieces.hull.T, pieces, 2.0, size))
    assert share[:, 2] == pytest.approx(np.full(count, 0.3))
    assert _map(_Tried("period", "ground", 0.0, 1.0, body), body, pieces, 2.0, size) == ()


@pytest.mark.thorough
def test_a_force_with_a_period_is_told():
    scales, found = found_in(swell(1e-3, 5.0))
    assert (found.on, found.acts) == ("period", "ground")
    assert found.scale * scales["U"] / scales["L"] == pytest.approx(5.0, rel=0.03)
    planted = 1e-3 * 0.5 * scales["rho"] * (scales["L"] * scales["U"]) ** 2 / 2.0**0.5
    assert found.size == pytest.approx(planted, rel=0.3) and found.map == ()


@pytest.mark.thorough
def test_a_force_with_a_period_is_told_where_nobody_states_the_environment():
    scales, found = found_in(swell(1e-3, 5.0), stated=False)
    assert found.on == "period"
    assert found.scale * scales["U"] / scales["L"] == pytest.approx(5.0, rel=0.03)


@pytest.mark.thorough
def test_runs_of_very_many_samples_are_cut_alike_at_every_size_of_the_environment(monkeypatch):
    """Fewer bytes, fewer pieces: those of the search and those that ask again are the same."""
    monkeypatch.setattr(cut_runs, "MOST_BYTES", 4_000_000)
    assert found_in(swell(1e-3, 8.0), stated=False)[1].on == "period"


@pytest.mark.parametrize("seed", range(3))
def test_gusts_in_one_run_are_no_place(seed):
    """In one run the place goes with time: a first-order Gauss-Markov force is told by neither."""

    def gusts(model, par, name, t, at):
        s = model.scales
        rng, step = np.random.default_rng(seed), np.diff(t, append=2 * t[-1] - t[-2]) * s["U"] / s["L"]
        force = np.zeros(t.size)
        for i in range(1, t.size):
            keep = np.exp(-step[i] / 8.0)
            force[i] = keep * force[i - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal()
        size = 2e-3 * 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2
        return {"Y": size * force, "X": 0.3 * size * force}

    assert found_in(gusts, keep=("zigzag",))[1] is None


@pytest.mark.thorough
def test_hull_forces_of_a_run_that_is_another_day_s_are_no_place():
    """Each run its own share, as of a draught or a growth that differs: one number per run."""
    share = {"zigzag": 0.25, "turn": -0.2, "zigzag back": -0.25, "turn back": 0.2}

    def another_day(model, par, name, t, at):
        return uneven(share[name], np.inf)(model, par, name, t, at)

    assert found_in(another_day)[1] is None


@pytest.mark.thorough
def test_a_position_that_swings_is_no_force_with_a_period():
    def swings(model, t):
        time = model.scales["L"] / model.scales["U"]
        return 0.3 * model.scales["L"] * np.sin(2.0 * np.pi * t / (9.0 * time))

    assert found_in(lambda *rest: {}, wrong={"x": swings})[1] is None


def test_of_many_runs_the_longest_are_asked():
    runs = [CutRun(k, 0.0, 1.0, 10 + k, None) for k in range(60)]
    kept, most = longest_runs(runs, 3)
    assert kept == list(range(60 - len(kept), 60)) and len(kept) * most * 3 <= MOST_COLUMNS
    assert longest_runs(runs[:4], 6) == ([0, 1, 2, 3], MOST_COLUMNS // 24)


def test_pieces_of_runs_that_do_not_divide_are_equal_but_the_last():
    (run,), *_ = random_runs((10,), 1)
    four = fewer(run, KNOWN, 4)
    assert (four.count, four.width) == (4, 3.0)
    value = np.array([1.0, -2.0, 0.5, 3.0])
    slow = joined([four], KNOWN, range(1), [0]).gains(value[:, None], (1.0,))[0]
    fast = joined([run], KNOWN, range(1), [0]).gains(np.repeat(value, 3)[:10, None], (1.0,))[0]
    assert slow == pytest.approx(fast, abs=1e-9)


@pytest.mark.parametrize(
    ("on", "acts", "scale", "size", "said"),
    [
        (
            "period",
            "ground",
            263.0,
            1.6e6,
            "a period of 263 s acts, at least 1.6 MN (rms), as water that swings",
        ),
        (
            "place",
            "hull",
            2560.0,
            0.18,
            "from place to place by at least 18% (rms), over about 2560 m, as over an uneven",
        ),
        (
            "place",
            "ground",
            40.0,
            3.2,
            "A force of at least 3.2 N (rms), whatever the heading, changes",
        ),
    ],
)
def test_it_is_told_in_the_units_of_whoever_reads(on, acts, scale, size, said):
    assert said in depends(Dependence(on, acts, 40.0, scale, size, 40.0))
