"""Sizes of effects: from few runs, and over all explanations that hold them."""

from types import SimpleNamespace as Plain

import numpy as np
import pytest
from scipy import stats

from bayesid.diagnosis.hypotheses import sizes, unusual_sizes
from bayesid.diagnosis.hypotheses.candidate import widened_by_few
from bayesid.diagnosis.hypotheses.kinematic import NOTHING, Kinematics
from bayesid.diagnosis.hypotheses.run_scatter import scatter_of_runs
from bayesid.diagnosis.threshold_table import ADD_EVIDENCE, SIZE_DEVIATIONS
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.model.effects import CATALOGUE


@pytest.mark.parametrize("runs", [3, 4, 7])
def test_deviations_from_few_runs_hold_95_of_100_means(runs):
    """Means of `runs` normal sizes: 1.96 of their widened deviation hold the truth, of the plain one less."""
    drawn = np.random.default_rng(runs).standard_normal((40_000, runs))
    mean, sd = drawn.mean(1), drawn.std(1, ddof=1) / np.sqrt(runs)
    assert np.mean(np.abs(mean) < 1.96 * widened_by_few(runs) * sd) == pytest.approx(0.95, abs=0.005)
    assert np.mean(np.abs(mean) < 1.96 * sd) < 0.91


def test_many_runs_widen_nothing_and_two_as_much_as_cauchy():
    assert widened_by_few(10_000) == pytest.approx(1.0, abs=1e-3)
    assert widened_by_few(2) == pytest.approx(stats.cauchy.ppf(0.975) / stats.norm.ppf(0.975))


@pytest.fixture
def world(monkeypatch):
    """Three explanations with a lag, one without; each with its table."""
    tables = {
        ("lag",): {"lag.tau": (2.0, 0.1)},
        ("lag", "wind"): {"lag.tau": (3.0, 0.2), "wind.u": (5.0, 1.0)},
        ("lag", "stall"): {"lag.tau": (9.0, 0.1)},
        ("wind",): {"wind.u": (7.0, 1.0)},
    }
    fit = Plain(equations=())  # too few runs to tell of scatter
    refits = [Plain(effects=k, widens=False, follows=k != ("lag", "stall"), fit=fit) for k in tables]
    monkeypatch.setattr(sizes, "by_kinematics", lambda problem, c: NOTHING)
    monkeypatch.setattr(sizes, "parameters_told", lambda problem, c, sensors=None: dict(tables[c.effects]))
    monkeypatch.setattr(sizes, "averaged_over_forms", lambda problem, c, told: told)
    monkeypatch.setattr(sizes, "explains", lambda c: c.follows)
    weights = {("lag",): 0.6, ("lag", "wind"): 0.2, ("lag", "stall"): 0.1, ("wind",): 0.1}
    return refits, Plain(refits=refits, sets=weights, form_seen=0.0)


def test_a_size_is_that_of_the_mixture_of_all_explanations_that_hold_the_effect(world):
    refits, candidates = world
    found = sizes.sizes_told(Plain(form="a form"), candidates, refits[1])
    drawn = np.random.default_rng(0).choice([0, 1], 400_000, p=[0.75, 0.25])
    lags = np.random.default_rng(1).normal(np.array([2.0, 3.0])[drawn], np.array([0.1, 0.2])[drawn])
    assert found["lag.tau"] == pytest.approx((lags.mean(), SIZE_DEVIATIONS * lags.std()), abs=3e-3)
    assert found["wind.u"][0] == pytest.approx((0.2 * 5.0 + 0.1 * 7.0) / 0.3)
    alone = Plain(form=None, coefficients=Plain(names=()))
    assert sizes.sizes_told(alone, candidates, refits[1])["lag.tau"] == (3.0, 0.2)


def test_an_effect_of_no_weighed_explanation_keeps_the_size_of_the_best(world):
    refits, candidates = world
    candidates.sets = {("wind",): 1.0}
    assert sizes.sizes_told(Plain(form="a form"), candidates, refits[0])["lag.tau"] == pytest.approx(
        (2.0, 0.1 * SIZE_DEVIATIONS)
    )


def test_forms_are_averaged_over_for_all_but_what_kinematics_tells(world, monkeypatch):
    refits, candidates = world
    monkeypatch.setattr(sizes, "by_kinematics", lambda problem, c: Kinematics(table={"wind.u": (6.0, 0.1)}))
    monkeypatch.setattr(
        sizes,
        "averaged_over_forms",
        lambda problem, c, told: {n: (v + 1.0, 2.0 * s) for n, (v, s) in told.items()},
    )
    candidates.sets = {("lag", "wind"): 1.0}
    found = sizes.sizes_told(Plain(form="a form"), candidates, refits[1])
    assert found == {
        "lag.tau": pytest.approx((4.0, SIZE_DEVIATIONS * 0.4)),
        "wind.u": pytest.approx((5.0, SIZE_DEVIATIONS)),
    }


def test_a_size_costs_what_the_nearer_end_of_its_interval_is_improbable_of_the_usual(monkeypatch):
    """Ballast of 30 % where 6 % is usual; its place has no usual size, nor has a size near nothing a cost."""
    ballast = next(e for e in CATALOGUE if e.name == "ballast_mass")
    keys = [ballast.key(p.name) for p in ballast.parameters]
    fit = Plain(free=Plain(names=("N_r", *keys), sd=np.array([0.1, 0.06, 0.2])))

    def cost(value, sd, place=0.0, told=None):
        table = {keys[0]: (value, sd), keys[1]: (place, 0.01)}
        monkeypatch.setattr(unusual_sizes, "parameters_told", lambda problem, c, sensors: table)
        problem = Plain(model=Plain(effects={"ballast_mass": ballast}))
        return unusual_sizes.cost_of_sizes(
            problem,
            Plain(fit=fit, effects=("ballast_mass",)),
            Plain(table={} if told is None else {told: table[told]}),
        )

    end = 0.3 - stats.norm.ppf(0.975) * SIZE_DEVIATIONS * 0.02
    odds = stats.norm.logpdf(0.0, scale=0.06) - stats.norm.logpdf(end, scale=0.06)
    assert cost(0.3, 0.02) == pytest.approx(odds, rel=1e-3)
    assert cost(-0.3, 0.02, place=5.0) == cost(0.3, 0.02)
    assert cost(0.1, 0.04) == 0.0
    assert cost(0.3, 0.02, told=keys[0]) == 0.0  # kinematics told it, and its evidence has paid


RUNS, READINGS, COEFFICIENTS = 5, 40, 3


def one_effect_of(own, rng):
    """A linear fit of an effect, size 0.3 prior sd in the mean and `own` more in each run, beside
    coefficients.

    The whitened readings of a run are seldom as informative as those of another.
    """
    truth = rng.standard_normal(COEFFICIENTS)
    equations = []
    for more in own:
        a = rng.standard_normal((READINGS, COEFFICIENTS + 1)) * rng.uniform(1.0, 3.0)
        e = a @ np.append(truth, 0.3 + more) + rng.standard_normal(READINGS)
        equations.append(NormalEquations(a.T @ a, a.T @ e, float(e @ e), 0.0, READINGS))
    found = posterior(sum(equations[1:], equations[0]))
    names = tuple(f"c{i}" for i in range(COEFFICIENTS)) + ("lag.tau",)
    sd = np.sqrt(np.diag(found.covariance))
    fit = Plain(
        equations=tuple(equations), values=found.mean, sd=sd,
        free=Plain(names=names, sd=np.ones(len(names))),
    )  # fmt: skip
    return Plain(effects=("lag",), widens=False, fit=fit)


def told(refit, monkeypatch, seen=0.0):
    problem = Plain(form=None, coefficients=Plain(names=("",) * COEFFICIENTS))
    monkeypatch.setattr(sizes, "explains", lambda c: True)
    candidates = Plain(refits=[refit], sets={("lag",): 1.0}, form_seen=seen)
    return sizes.sizes_told(problem, candidates, refit)["lag.tau"]


@pytest.mark.parametrize("seen", [0.0, 100.0])
def test_a_large_size_that_one_run_alone_tells_keeps_its_deviation(seen, monkeypatch):
    """Five prior deviations, four runs, three of them without the effect: no run can say of another."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        truth, equations = rng.standard_normal(COEFFICIENTS), []
        for some in (1.0, 0.0, 0.0, 0.0):
            a = 2.0 * rng.standard_normal((READINGS, COEFFICIENTS + 1))
            a[:, -1] *= some
            e = a @ np.append(truth, 5.0) + rng.standard_normal(READINGS)
            equations.append(NormalEquations(a.T @ a, a.T @ e, float(e @ e), 0.0, READINGS))
        found = posterior(sum(equations[1:], equations[0]))
        sd = np.sqrt(np.diag(found.covariance))
        names = tuple(f"c{i}" for i in range(COEFFICIENTS)) + ("lag.tau",)
        free = Plain(names=names, sd=np.ones(len(names)))
        fit = Plain(equations=tuple(equations), values=found.mean, sd=sd, free=free)
        _, told_sd = told(Plain(effects=("lag",), widens=False, fit=fit), monkeypatch, seen)
        assert told_sd == pytest.approx(sd[-1] * (1.5 if seen else 1.0), rel=1e-6)


@pytest.mark.parametrize(("scatter", "held", "narrow"), [(0.3, 0.87, 0.5), (0.1, 0.78, 0.77)])
def test_a_size_that_differs_from_run_to_run_has_an_interval_that_holds_its_mean(
    scatter, held, narrow, monkeypatch
):
    """The size of a run scatters about 0.3; the deviation of the fit alone is 0.03."""
    rng = np.random.default_rng(17)
    inside, alone = [], []
    for _ in range(300):
        refit = one_effect_of(scatter * rng.standard_normal(RUNS), rng)
        value, sd = told(refit, monkeypatch)
        inside.append(abs(value - 0.3) < 1.96 * sd)
        alone.append(abs(value - 0.3) < 1.96 * refit.fit.sd[-1])
    assert np.mean(inside) > held and np.mean(alone) < narrow


def test_runs_that_agree_leave_the_deviation_about_as_it_is(monkeypatch):
    rng = np.random.default_rng(18)
    wider = []
    for _ in range(300):
        refit = one_effect_of(np.zeros(RUNS), rng)
        value, sd = told(refit, monkeypatch)
        assert value == refit.fit.values[-1]
        wider.append(sd / refit.fit.sd[-1])
    assert min(wider) >= 1.0 and np.median(wider) < 1.05 and np.mean(wider) < 1.12


def test_the_scatter_of_runs_that_agree_is_chi_square_with_its_degrees_of_freedom():
    rng = np.random.default_rng(20)
    ratios, freedom = [], []
    for _ in range(400):
        refit = one_effect_of(np.zeros(RUNS), rng)
        found = scatter_of_runs(refit.fit.equations, np.array([COEFFICIENTS]))
        ratios.append(found.ratio[0])
        freedom.append(found.freedom[0])
        assert 1.0 < found.freedom[0] < RUNS - 1 + 1e-9 and 0.9 < found.share[0] <= 1.0
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.12)
    tail = stats.chi2.sf(np.array(freedom) * np.array(ratios), np.array(freedom))
    assert np.mean(tail < 0.05) == pytest.approx(0.05, abs=0.03)


def test_equal_runs_have_one_degree_of_freedom_less_than_there_are():
    a = np.random.default_rng(21).standard_normal((READINGS, 2)) * 1e3
    values = (1.0, 2.0, 4.0, 9.0)
    equations = tuple(
        NormalEquations(a.T @ a, a.T @ (a @ np.array([0.0, v])), 0.0, 0.0, READINGS) for v in values
    )
    found = scatter_of_runs(equations, np.array([1]))
    assert found.freedom[0] == pytest.approx(len(values) - 1, rel=1e-4)
    sd = np.sqrt(found.ratio[0] * np.linalg.inv(4 * a.T @ a)[1, 1])
    assert sd == pytest.approx(np.std(values, ddof=1) / 2.0, rel=1e-4)  # of a mean


def test_a_form_that_shows_and_is_in_no_hypothesis_widens_as_one_that_is(monkeypatch):
    rng = np.random.default_rng(19)
    refit = one_effect_of(np.zeros(RUNS), rng)
    plain = told(refit, monkeypatch)
    assert told(refit, monkeypatch, seen=ADD_EVIDENCE) == plain
    value, sd = told(refit, monkeypatch, seen=ADD_EVIDENCE + 0.1)
    between = max(sizes.from_run_to_run(refit.fit)["lag.tau"], refit.fit.sd[-1])
    assert value == pytest.approx(plain[0]) and sd == pytest.approx(SIZE_DEVIATIONS * between)
