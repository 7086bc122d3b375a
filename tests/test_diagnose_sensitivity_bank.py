"""Evidence, screen and ambiguity on a linearised bank: closed forms and Monte Carlo, no simulation."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from gap_trials import model_of, planted_trial
from scipy import stats

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses import sensitivity_bank as banks
from bayesid.diagnosis.hypotheses.sensitivity_bank import (
    EffectColumns,
    SensitivityBank,
    build_bank,
    isolability,
    screen,
    widened,
)
from bayesid.diagnosis.hypotheses.size_scales import over_usual_size
from bayesid.diagnosis.hypotheses.thresholds import chance, thresholds
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations, posterior


@lru_cache
def nominal_case(name="remus100"):
    """Problem without a gap, its bank along the fitted path, the parameters there."""
    model = model_of(name)
    problem = build_problem(model, planted_trial(model, seed=3))
    fitted = fit_with(problem, ())
    effects = [e for e in model.kernel.effects if banks.testable(problem, e)]
    bank = build_bank(problem, fitted.points, [problem.environment.noise_model], effects)
    return problem, bank, fitted.par


class Draws:
    """Data of a linear world: products of S with e = S truth + S_coef z + noise, straight from S'S."""

    def __init__(self, bank, seed):
        self.bank, self.rng = bank, np.random.default_rng(seed)
        self.ss = bank.total(0).ss
        value, vector = np.linalg.eigh(self.ss)
        self.root = vector * np.sqrt(np.maximum(value, 0.0))

    def one(self, truth=None):
        coef = np.zeros(self.ss.shape[0])
        coef[: self.bank.n_coef] = self.rng.standard_normal(self.bank.n_coef)
        if truth is not None:
            coef = coef + truth
        se = self.ss @ coef + self.root @ self.rng.standard_normal(coef.size)
        # the residual's own square is the same for every hypothesis
        return NormalEquations(self.ss, se, 0.0, 0.0, 0)


def schur(bank, columns):
    """Information on some columns after the coefficients took their part, and the map that takes it."""
    a, c = bank.total(0).ss, bank.n_coef
    taken = np.linalg.solve(np.eye(c) + a[:c, :c], a[:c])
    return a[np.ix_(columns, columns)] - a[np.ix_(columns, np.arange(c))] @ taken[:, columns], taken


def scored(bank, g, name, variant=0):
    """Score of an effect and its information."""
    columns = bank.effects[name].variants[variant]
    information, taken = schur(bank, columns)
    return g.se[columns] - taken[:, columns].T @ g.se[: bank.n_coef], information


def p_value(score, information):
    """Of the score; a parameter that nothing shows (areas without measured wind) is no degree of freedom."""
    rank = np.linalg.matrix_rank(information, tol=1e-9 * np.trace(information))
    return stats.chi2.sf(score @ np.linalg.pinv(information, rcond=1e-9, hermitian=True) @ score, rank)


def gain(bank, g, name, variant=0):
    with_it = posterior(g.pick(bank.columns((name,), (variant,)))).log_evidence
    return with_it - posterior(g.pick(bank.columns(()))).log_evidence


def gain_of_any_size(bank, g, name, variant=0):
    own = g.pick(bank.columns((name,), (variant,)))
    sizes = bank.n_coef + bank.effects[name].sizes_of(variant)
    return gain(bank, g, name, variant) + over_usual_size(own, [sizes])


def test_evidence_is_the_density_of_the_readings():
    rng = np.random.default_rng(0)
    columns, resid = rng.standard_normal((30, 4)), rng.standard_normal(30)
    exact = stats.multivariate_normal(np.zeros(30), np.eye(30) + columns @ columns.T).logpdf(resid)
    found = posterior(normal_equations(resid, columns, 0.0, 30))
    assert abs(found.log_evidence - exact) < 1e-10
    mean = columns.T @ np.linalg.solve(np.eye(30) + columns @ columns.T, resid)
    np.testing.assert_allclose(found.mean, mean, atol=1e-12)


@pytest.mark.parametrize("wrong", [np.inf, np.nan, 1e40])
def test_a_product_no_arithmetic_can_hold_is_said_and_does_not_end_in_algebra(wrong):
    ss = wrong * np.array([[1.0, 1.0 + 1e-9], [1.0 + 1e-9, 1.0]])  # 1 of 1e40 is lost beside it
    with pytest.raises(ModelError, match="linearised"):
        posterior(NormalEquations(ss, np.zeros(2), 1.0, 0.0, 3))


def test_readings_exactly_on_the_model_cost_every_effect_its_occam_factor():
    _, bank, _ = nominal_case()
    silent = replace(bank.total(0), se=np.zeros(bank.total(0).se.size))
    for name, column in bank.effects.items():
        for v, columns in enumerate(column.variants):
            information, _ = schur(bank, columns)
            occam = -0.5 * np.linalg.slogdet(np.eye(columns.size) + information)[1]
            assert abs(gain(bank, silent, name, v) - occam) < 1e-6 * max(1.0, abs(occam)), name


def test_pure_noise_pays_the_occam_factor_less_half_the_score_it_makes():
    _, bank, _ = nominal_case()
    g = Draws(bank, 1).one()
    for name in bank.effects:
        score, information = scored(bank, g, name)
        k = score.size
        expected = -0.5 * np.linalg.slogdet(np.eye(k) + information)[1]
        expected += 0.5 * score @ np.linalg.solve(np.eye(k) + information, score)
        assert abs(gain(bank, g, name) - expected) < 1e-5 * max(1.0, abs(expected)), name


@pytest.mark.thorough
def test_score_p_values_are_uniform_on_nulls():
    # 100 nulls per effect, Kolmogorov-Smirnov; Bonferroni over some 35 effects at 1 % in all
    _, bank, _ = nominal_case()
    draws = Draws(bank, 2)
    nulls = [draws.one() for _ in range(100)]
    visible = [n for n, a in zip(isolability(bank).names, isolability(bank).detect, strict=True) if a > 1e-3]
    assert len(visible) > 20
    worst = {}
    for name in visible:
        p = []
        for g in nulls:
            score, information = scored(bank, g, name)
            p.append(p_value(score, information))
        worst[name] = stats.kstest(p, "uniform").pvalue
    assert min(worst.values()) > 0.01 / len(visible), min(worst, key=worst.get)
    # control: with a truth of five noise standard deviations they are not
    name = visible[0]
    columns = bank.effects[name].variants[0]
    truth = np.zeros(bank.total(0).ss.shape[0])
    truth[columns[0]] = 5.0 / np.sqrt(schur(bank, columns)[0][0, 0])
    p = []
    for _ in range(100):
        score, information = scored(bank, draws.one(truth), name)
        p.append(p_value(score, information))
    assert stats.kstest(p, "uniform").pvalue < 1e-10


@pytest.mark.thorough
def test_no_null_makes_the_screen_ring():
    # evidence of 5 over none is a false alarm below exp(-5) per effect (Markov); 100 nulls, 35 effects
    _, bank, _ = nominal_case()
    draws = Draws(bank, 3)
    alarms = 0
    for _ in range(100):
        here = SensitivityBank(((draws.one(),),), bank.levels, bank.n_coef, bank.effects)
        alarms += screen(here)[0].gain > 5.0
    assert alarms <= 5


def test_a_planted_effect_heads_the_screen_of_a_linear_world():
    _, bank, _ = nominal_case()
    known, draws = isolability(bank), Draws(bank, 4)
    rightly, tried = 0, 0
    for i, name in enumerate(known.names):
        rivals = np.delete(known.margin[i], i)
        if rivals.min() < 8.0:
            continue
        truth = np.zeros(bank.total(0).ss.shape[0])
        columns = bank.effects[name].variants[0]
        truth[columns] = known.size / np.sqrt(columns.size)
        here = SensitivityBank(((draws.one(truth),),), bank.levels, bank.n_coef, bank.effects)
        rightly, tried = rightly + (screen(here)[0].name == name), tried + 1
    assert tried >= 8
    assert rightly >= tried - 1


def test_an_effect_that_is_a_change_of_coefficients_is_the_sum_of_their_columns():
    problem, bank, par = nominal_case()
    a = bank.total(0).ss
    names, model = list(problem.coefficients.names), problem.model
    column = bank.effects["rudder_effectiveness"].variants[0]
    loss = model.prior_sd("rudder_effectiveness.loss")
    weight = np.zeros(bank.n_coef)
    for n in names:
        if n.endswith("dr") and n[0] in "YN":
            weight[names.index(n)] = -loss * par[model.index[n]] / problem.coefficients.sd[names.index(n)]
    assert np.count_nonzero(weight) == 2
    c = bank.n_coef
    np.testing.assert_allclose(
        a[:c, column[0]], a[:c, :c] @ weight, rtol=1e-6, atol=1e-6 * np.abs(a[:c, :c]).max()
    )
    known = isolability(bank)
    detect = known.detect[known.names.index("rudder_effectiveness")]
    # the coefficients' prior is the only thing that speaks against them: (0.2/0.05)^2 each at most
    assert 0.0 < detect < weight @ weight * (1 + 1e-6)


def coefficients_times(bank, factor):
    """The bank with priors of the coefficients wider by a factor."""
    g, scale = bank.total(0), np.ones(bank.total(0).se.size)
    scale[: bank.n_coef] = factor
    wide = NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, g.ee, g.logdet, g.used)
    return SensitivityBank(((wide,),), bank.levels, bank.n_coef, bank.effects)


def test_coefficients_that_may_be_anything_absorb_what_is_a_change_of_them():
    _, bank, _ = nominal_case()
    place = isolability(bank).names.index
    absorbed = [isolability(coefficients_times(bank, f)).absorbed for f in (1.0, 10.0, 1e3)]
    rudder = [float(a[place("rudder_effectiveness")]) for a in absorbed]
    assert rudder[0] < rudder[1] < rudder[2] and rudder[2] > 1 - 1e-4
    # control: a heading bias is no coefficient whatever their prior
    assert absorbed[2][place("heading_bias")] < 0.9
    frozen = isolability(coefficients_times(bank, 1e-9)).absorbed
    assert np.abs(frozen).max() < 1e-6


def test_detectability_grows_with_the_square_of_the_size():
    _, bank, _ = nominal_case()
    g, n = bank.total(0), bank.n_coef
    scale = np.ones(g.se.size)
    scale[n:] = 3.0
    larger = SensitivityBank(
        ((NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, 0.0, 0.0, 0),),),
        bank.levels,
        n,
        bank.effects,
    )
    once, thrice = isolability(bank), isolability(larger)
    np.testing.assert_allclose(thrice.detect, 9.0 * once.detect, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(thrice.absorbed, once.absorbed, atol=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ("remus100", "generic_sub"))
def test_expected_margins_are_the_mean_of_realised_ones(name):
    # rule A6 by Monte Carlo; margins between 3 and 300, where a name is at stake
    _, bank, _ = nominal_case(name)
    size = 0.1
    known, draws = isolability(bank, size=size), Draws(bank, 5)
    pairs = [(i, k) for i, k in zip(*np.nonzero((known.margin > 3.0) & (known.margin < 300.0)), strict=True)]
    assert len(pairs) > 40
    chosen = [pairs[j] for j in np.random.default_rng(6).choice(len(pairs), 25, replace=False)]
    for i, k in chosen:
        truth = np.zeros(bank.total(0).ss.shape[0])
        columns = bank.effects[known.names[i]].variants[0]
        truth[columns] = size / np.sqrt(columns.size)
        realised = []
        for _ in range(200):
            g = draws.one(truth)
            realised.append(gain(bank, g, known.names[i]) - gain(bank, g, known.names[k]))
        error = 4.0 * np.std(realised) / np.sqrt(200)
        told = known.margin[i, k]
        assert abs(np.mean(realised) - told) < max(0.15 * told, error), (known.names[i], known.names[k])


def test_widening_a_prior_gains_where_the_coefficient_is_wrong():
    problem, bank, _ = nominal_case()
    names = problem.coefficients.names
    truth = np.zeros(bank.total(0).ss.shape[0])
    # the one that the others can imitate least
    a = bank.total(0).ss[: bank.n_coef, : bank.n_coef]
    wrong = int(np.argmin(np.diag(np.linalg.inv(np.eye(bank.n_coef) + a))))
    truth[wrong] = 8.0
    g = Draws(bank, 7).one(truth)
    gains = widened(SensitivityBank(((g,),), bank.levels, bank.n_coef, bank.effects), names)
    assert max(gains, key=gains.get) == names[wrong] and gains[names[wrong]] > 10.0
    none = Draws(bank, 7).one()
    quiet = widened(SensitivityBank(((none,),), bank.levels, bank.n_coef, bank.effects), names)
    assert max(quiet.values()) < 3.0


def test_effects_with_one_column_in_two_banks_share_a_group():
    # two copies of one column cannot be told apart; an orthogonal one can
    s = np.zeros((60, 4))
    rng = np.random.default_rng(8)
    q, _ = np.linalg.qr(rng.standard_normal((60, 3)))
    s[:, 0], s[:, 1], s[:, 2], s[:, 3] = q[:, 0], 40 * q[:, 1], 40 * q[:, 1], 40 * q[:, 2]
    problem, _, _ = nominal_case()
    effects = list(problem.model.kernel.effects)[:3]
    columns = {f"e{i}": EffectColumns(effects[i], (np.array([1 + i]),)) for i in range(3)}
    known = isolability(SensitivityBank(((normal_equations(np.zeros(60), s, 0.0, 60),),), (), 1, columns))
    assert known.groups == (("e0", "e1"),)
    assert abs(known.margin[0, 1]) < 1e-9 and known.margin[0, 2] > 5.0
    np.testing.assert_allclose(known.detect, 1600.0)
    np.testing.assert_allclose(known.absorbed, 0.0, atol=1e-12)


@pytest.mark.thorough
def test_thresholds_are_what_trials_without_effect_reach_by_chance():
    _, bank, _ = nominal_case()
    best, moved = chance(bank, seed=1, draws=2000)
    draws = Draws(bank, seed=2)
    seen = []
    for _ in range(150):
        g = draws.one()
        every = [(n, v) for n, e in bank.effects.items() for v in range(len(e.variants))]
        seen.append(max(gain_of_any_size(bank, g, n, v) for n, v in every))
    # the same distribution from the evidence itself, draw by draw
    assert stats.ks_2samp(best, seen).pvalue > 1e-3
    assert stats.ks_2samp(best + 0.7, seen).pvalue < 1e-3
    limit = thresholds(bank, tried=100, seed=1)
    assert 3.0 <= limit.named < np.log(len(bank.effects) / 0.01) + 1
    assert np.mean(moved > limit.conflict) <= 0.0101
    assert thresholds(bank, tried=100, seed=1) == limit


def test_known_values_of_some_columns_leave_the_equations_of_what_they_leave():
    rng = np.random.default_rng(5)
    resid, columns = rng.standard_normal(30), rng.standard_normal((30, 4))
    values, known, rest = np.array([0.7, -2.0]), np.array([1, 3]), np.array([0, 2])
    found = normal_equations(resid, columns, 2.0, 30).given(known, values).pick(rest)
    expected = normal_equations(resid - columns[:, known] @ values, columns[:, rest], 2.0, 30)
    assert found.ee == pytest.approx(expected.ee) and posterior(found).log_evidence == pytest.approx(
        posterior(expected).log_evidence
    )
    np.testing.assert_allclose(found.se, expected.se)
    np.testing.assert_array_equal(found.ss, expected.ss)
