"""Runs against each other, and the weighing of causes: closed forms and Monte Carlo on linear worlds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.stats import norm

from bayesid.api.simulate import simulate_model
from bayesid.diagnosis.failed_checks import failures
from bayesid.diagnosis.hypotheses.cross_validation import (
    CrossValidation,
    agreement,
    between_runs,
    disagreement,
    excess_where_apart,
    left_out,
    log_odds_over_runs,
    of_single_runs,
)
from bayesid.diagnosis.hypotheses.localisation import Localisation, LocatedSignal
from bayesid.diagnosis.hypotheses.probabilities import FormError, Remainder, credible_set, probabilities, told
from bayesid.diagnosis.run import diagnose
from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.evidence import normal_equations
from bayesid.model.vehicles import load_vehicle

COEF, OWN, RUNS, READINGS = 3, 2, 5, 40


def world(rng, spread=0.0):
    """Columns and residuals of five runs; the effect differs by `spread` prior sd from run to run."""
    z, phi = rng.standard_normal(COEF), rng.standard_normal(OWN)
    out = []
    for _ in range(RUNS):
        s = 0.4 * rng.standard_normal((READINGS, COEF + OWN))
        here = phi + spread * rng.standard_normal(OWN)
        out.append((s @ np.r_[z, here] + rng.standard_normal(READINGS), s))
    return out


def grams(runs):
    return tuple(normal_equations(e, s, 0.0, READINGS) for e, s in runs)


def density(runs):
    e, s = np.concatenate([e for e, _ in runs]), np.vstack([s for _, s in runs])
    return stats.multivariate_normal(np.zeros(e.size), np.eye(e.size) + s @ s.T).logpdf(e)


def test_the_density_of_a_run_given_the_others_is_the_ratio_of_dense_densities():
    runs = world(np.random.default_rng(0))
    exact = [density(runs) - density(runs[:m] + runs[m + 1 :]) for m in range(RUNS)]
    np.testing.assert_allclose(left_out(grams(runs)), exact, atol=1e-9)


def test_the_p_value_of_one_and_the_same_effect_is_uniform_where_it_is_the_same():
    rng = np.random.default_rng(1)
    p = [disagreement(grams(world(rng)), COEF)[0] for _ in range(300)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


def test_agreement_of_runs_is_that_p_value_and_one_run_has_none():
    found = grams(world(np.random.default_rng(4)))

    def refit(equations):
        return SimpleNamespace(fit=SimpleNamespace(equations=equations))

    assert agreement(refit(found), COEF) == disagreement(found, COEF)[0]
    assert agreement(refit(found[:1]), COEF) is None
    assert agreement(refit((replace(found[0], ss=np.nan * found[0].ss), *found[1:])), COEF) is None


def test_runs_with_effects_of_their_own_disagree():
    rng = np.random.default_rng(2)
    found = [disagreement(grams(world(rng, spread=1.0)), COEF) for _ in range(20)]
    assert np.median([p for p, _ in found]) < 1e-4
    assert min(excess for _, excess in found) > 1.5
    apart = grams(world(np.random.default_rng(3), spread=3.0))
    assert excess_where_apart(apart, COEF) == disagreement(apart, COEF)[1] > 1.5
    agreeing = grams(world(np.random.default_rng(3)))
    assert disagreement(agreeing, COEF)[0] > 0.05
    assert excess_where_apart(agreeing, COEF) == 1.0


@pytest.mark.parametrize("ahead", [(-1.0, 2.0), (-2.0, 1.0, 1.0), (-1.0, -1.0, 3.0, 3.1, 3.2), range(-7, 5)])
def test_the_odds_over_runs_are_those_of_weights_drawn_uniformly(ahead):
    ahead = np.array(ahead, dtype=float)
    drawn = np.random.default_rng(5).dirichlet(np.ones(ahead.size), 200_000) @ ahead > 0.0
    odds = np.exp(log_odds_over_runs(ahead))
    assert odds / (1.0 + odds) == pytest.approx(drawn.mean(), abs=4.0 * drawn.std() / np.sqrt(drawn.size))
    assert log_odds_over_runs(-ahead) == pytest.approx(-log_odds_over_runs(ahead), abs=1e-9)


def test_runs_that_all_agree_leave_no_odds_and_more_runs_that_disagree_leave_more():
    assert log_odds_over_runs(np.array([0.1, 400.0, 0.0])) == np.inf
    assert log_odds_over_runs(np.array([-0.1, -400.0])) == -np.inf
    assert log_odds_over_runs(np.zeros(4)) == 0.0
    many = [log_odds_over_runs(np.repeat([3.0, -1.0], m)) for m in (1, 2, 4, 8, 16)]
    assert np.all(np.diff(many) > 0.1)


def test_an_effect_the_other_runs_speak_against_is_refuted_and_a_doubtful_one_is_not():
    assert CrossValidation(np.array([-3.0, -4.0, -2.5, -3.5]), 1.0, 1.0).refuted
    assert not CrossValidation(np.array([-3.0, 40.0, -2.5, -3.5]), 1.0, 1.0).refuted
    assert not CrossValidation(np.array([-1.0, 0.9]), 1.0, 1.0).refuted  # two runs cannot say
    assert not CrossValidation(np.array([3.0, 4.0, -2.5, 3.5]), 1.0, 1.0).refuted


def candidate(log_evidence, *effects):
    fit = SimpleNamespace(converged=True, chi2=1.0)
    return SimpleNamespace(effects=effects, log_evidence=log_evidence, fit=fit)


@pytest.fixture
def weighing():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    pair = candidate(60.0, "a", "b")
    evidence = {"a": 40.0, "b": 10.0, "c": 30.0, "coefficient_error": 2.0, "outside": 5.0}
    return lambda excess, refits=(pair,): probabilities(evidence, refits, none, where, excess).shared


def test_probabilities_are_prior_times_evidence(weighing):
    p = weighing(1.0, ())
    assert sum(p.values()) == pytest.approx(1.0)
    each = 0.4 / 4
    assert p["a"] / p["c"] == pytest.approx(np.exp(10.0))
    assert p["a"] / p["none"] == pytest.approx(each * np.exp(40.0) / 0.5)


def test_half_of_what_lies_outside_is_a_free_signal_and_half_is_like_an_effect():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 40.0, "c": 0.0, "coefficient_error": 0.0, "outside": 90.0}
    free = probabilities(evidence, (), none, where).shared
    assert free["outside"] / free["none"] == pytest.approx(0.05 * np.exp(90.0) / 0.5)
    like = probabilities(evidence | {"outside": 0.0}, (), none, where).shared
    # leaves less than 3 of the 40 nats: chance that is the root of the share left, as in the catalogue
    assert like["outside"] / like["a"] == pytest.approx(0.05 / 0.4 * np.sqrt(3.0 / 40.0), rel=1e-6)


def test_the_second_of_two_effects_may_be_something_like_it():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 4000.0, "b": 10.0, "c": 30.0, "coefficient_error": 2.0, "outside": 5.0}
    for second, least, most in ((9.0, 0.92, 0.94), (300.0, 0.98, 0.995), (5000.0, 0.998, 0.9999)):
        pair = candidate(4000.0 + second, "a", "b")
        inside = probabilities(evidence, (pair,), none, where).inside
        assert least < inside["b"] / inside["a"] <= most


def test_two_effects_share_alike_until_the_runs_disagree_about_them(weighing):
    agreed, disagreed = weighing(1.0), weighing(4.0)
    assert agreed["a"] == pytest.approx(agreed["b"], rel=0.05)
    assert disagreed["a"] > 3 * disagreed["b"]


def test_disagreement_lets_more_causes_stand_but_not_no_cause(weighing):
    sharp, soft = weighing(1.0, ()), weighing(8.0, ())
    assert credible_set(sharp, 0.9) == ("a",)
    assert {"a", "c"} <= set(credible_set(soft, 0.9))
    assert soft["none"] < 1e-6


def test_what_an_effect_leaves_goes_to_it_and_in_part_to_a_cause_that_only_looks_like_it():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 60.0, "c": 30.0, "coefficient_error": 2.0, "outside": 70.0}
    refits = (candidate(60.0, "a"),)

    def weigh(more, generic):
        return probabilities(
            evidence | {"outside": generic}, refits, none, where, left=Remainder({("a",): more})
        ).shared

    clean, left, little = weigh(-1.0, 20.0), weigh(30.0, 70.0), weigh(400.0, 460.0)
    assert 0.02 < clean["outside"] < 0.1  # a name is never quite alone
    # half of it left: density of the catalogue's likeness over that of every magnitude alike
    odds = 0.125 * (0.45**2 * 0.5**0.45 + 2.75 * 0.5**5) * np.log(1e3) / 0.25
    assert left["outside"] / left["a"] == pytest.approx(odds, rel=0.05)
    assert little["outside"] > 0.99  # what explains an eighth of the gap is a part of something else


def test_the_smaller_the_share_that_is_left_the_less_it_speaks_for_another_cause():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 1e5, "c": 30.0, "coefficient_error": 2.0, "outside": 1e3}

    def outside(more):
        found = probabilities(evidence, (candidate(1e5, "a"),), none, where, left=Remainder({("a",): more}))
        return found.shared["outside"]

    assert outside(3e4) > 0.25 > 0.2 > outside(3e3) > 0.1 > outside(300.0) > 0.03


def test_what_chance_leaves_does_not_speak_against_either_of_two_effects():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 500.0, "b": 300.0, "c": 3.0, "coefficient_error": 2.0, "outside": 40.0}
    pair = candidate(1000.0, "a", "b")
    rest = {("a", "b"): 6.0}

    def least(shows):
        return min(
            probabilities(evidence, (pair,), none, where, 1.0, Remainder(rest, shows)).inside[n] for n in "ab"
        )

    assert least(False) > 0.95
    assert least(True) < 0.95


def test_a_free_signal_alone_is_hardly_better_than_beside_an_effect():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 2000.0, "c": 3.0, "coefficient_error": 2.0, "outside": 4000.0}
    kept = probabilities(
        evidence, (candidate(2000.0, "a"),), none, where, left=Remainder({("a",): -2.0})
    ).shared
    assert kept["outside"] / kept["a"] < np.exp(10.0 + np.log(0.05 / 0.1)) * 1.1  # 2000 nats before
    unsound = candidate(2000.0, "a")
    unsound.fit.chi2 = 5.0
    free = probabilities(evidence, (unsound,), none, where, left=Remainder({("a",): -2.0})).shared
    assert free["outside"] > 0.999


def test_a_signal_that_gains_nothing_beside_an_effect_explains_nothing_the_effect_does_not():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 2000.0, "c": 3.0, "coefficient_error": 2.0, "outside": 2160.0}

    def outside(kept):
        left = Remainder({("a",): -3.0}, shows=False, share=0.0, kept=kept)
        return probabilities(evidence, (candidate(2000.0, "a"),), none, where, left=left).shared["outside"]

    assert outside(np.inf) > 0.99  # two linearisations, 160 nats apart
    assert outside(-50.0) < 0.01
    assert outside(500.0) > 0.99


def test_what_a_signal_keeps_is_read_where_it_gained_most():
    def where(gains, periodic=0.0):
        places = (LocatedSignal("N", max(periodic, max(gains.values())), 0.1, 1.0, 0.0),)
        return Localisation(places, (), 0.0, 0.0, (), (), (), (), gains)

    before = {("N", 0.1, 1.0): 80.0, ("N", 0.01, 1.0): 20.0}
    after = where({("N", 0.1, 1.0): -7.0, ("N", 0.01, 1.0): 4.0})
    assert where(before).kept(after) == -7.0
    assert where(before, periodic=90.0).kept(after) == np.inf  # a period was better: not tried again
    elsewhere = {("N", 0.1, 1.0): 60.0, ("Y", 0.1, 1.0): 80.0}
    assert where(elsewhere, periodic=90.0).kept(where(dict.fromkeys(elsewhere, -40.0))) == np.inf


def test_a_gap_that_is_mostly_explained_by_one_effect_that_does_not_arrive_is_like_that_effect():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 500.0, "b": 481.0, "c": 3.0, "coefficient_error": 2.0, "outside": 4000.0}
    refits = [candidate(500.0, "a"), candidate(481.0, "b")]
    for c in refits:
        c.fit.chi2 = 6.0

    def shared(share):
        left = Remainder({("a",): 400.0, ("b",): 400.0}, share=share)
        return probabilities(evidence, refits, none, where, left=left).shared

    assert shared(0.6)["outside"] > 0.999  # an effect that leaves more than half: a part of something else
    near = shared(0.1)
    assert near["a"] > 0.5 and near["outside"] > 0.1
    assert near["b"] < 1e-6  # 19 nats behind stays 19 nats behind


def test_effects_of_an_explanation_that_does_not_arrive_share_by_what_each_says_alone():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 400.0, "b": 10.0, "c": 3.0, "coefficient_error": 2.0, "outside": 4000.0}
    pair = candidate(500.0, "a", "b")
    left = Remainder({("a", "b"): 400.0}, share=0.1)
    arrived = probabilities(evidence | {"outside": 0.0}, (pair,), none, where, left=left).shared
    assert arrived["a"] < 2 * arrived["b"]
    pair.fit.chi2 = 6.0
    rough = probabilities(evidence, (pair,), none, where, left=left).shared
    assert rough["a"] > 5 * rough["b"]


def test_what_mends_an_effect_where_it_acts_may_be_another_form_of_it():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 400.0, "b": 10.0, "c": 3.0, "coefficient_error": 2.0, "outside": 5.0}

    def second(gained, places):
        pair = candidate(400.0 + gained, "a", "b")
        found = probabilities(evidence, (pair,), none, where, places=places).inside
        assert found["a"] > 0.85
        return found["b"]

    same = {"a": ("N", "Y"), "b": ("Y", "N"), "c": ("X",)}
    apart = same | {"b": ("psi",)}
    assert second(200.0, apart) > 0.95 > 0.9 > second(200.0, same)
    crowded = same | {f"other {i}": ("N", "Y") for i in range(9)}
    assert second(200.0, same) < second(200.0, crowded)  # one of ten things its other form may look like
    assert second(1e6, crowded) > 0.98


def test_a_lag_as_large_as_what_a_form_leaves_is_worth_odds_of_twenty_and_never_more_than_itself():
    error = FormError(40.0)
    assert error.lag(40.0) == pytest.approx(np.log(20.0), abs=0.01)
    for lag in (0.0, 0.1, 3.0, 40.0, 400.0, 1e5):
        assert 0.0 <= error.lag(lag) <= lag
        assert FormError().lag(lag) == lag
    # the odds are those of a normal error turning the order
    chance = norm.sf(15.0, scale=40.0 / 1.96)
    assert error.lag(15.0) == pytest.approx(-np.log(2.0 * chance), rel=1e-6)


def test_causes_closer_than_the_error_of_the_equations_stand_together_and_no_cause_stays_where_it_is():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 95.0, "b": 80.0, "c": 5.0, "coefficient_error": -np.inf, "outside": 0.0}
    firm = probabilities(evidence, (), none, where).shared
    loose = probabilities(evidence, (), none, where, error=FormError(48.0)).shared
    assert firm["b"] < 1e-5 and 0.1 < loose["b"] < loose["a"]
    assert loose["c"] < 1e-30  # what explains no more than the form may leave is no rival
    assert loose["none"] < 1e-30  # that there is a cause is not in doubt


def test_what_kinematics_tells_keeps_its_own_evidence_beside_an_unsure_form():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"gyro": 40.0, "lag": 100.0, "rate": 90.0, "coefficient_error": 0.0, "outside": 0.0}
    refits = [candidate(v, *names) for names, v in {
        ("gyro", "lag"): 140.0, ("gyro", "rate"): 130.0, ("lag", "rate"): 112.0}.items()]  # fmt: skip

    def inside(gyro):
        alone = dict.fromkeys([("gyro",), ("gyro", "lag"), ("gyro", "rate")], gyro)
        return probabilities(evidence, refits, none, where, error=FormError(60.0, alone)).inside

    told, unsure = inside(40.0), inside(0.0)
    assert told["gyro"] > 0.95 > unsure["gyro"]
    assert 0.1 < told["rate"] < told["lag"] < 0.9


def test_a_set_refitted_only_beside_a_kinematic_effect_lifts_no_other():
    gain = {("gyro",): 500.0, ("a",): 100.0, ("b",): 60.0, ("c",): 70.0,
            ("a", "gyro"): 600.0, ("b", "gyro"): 560.0}  # fmt: skip
    beside = [("gyro",), ("a", "gyro"), ("b", "gyro"), ("a", "c", "gyro")]
    error = FormError(48.0, dict.fromkeys(beside, 500.0))
    pairs = told(gain, error)
    more = told(gain | {("a", "c", "gyro"): 605.0}, error)
    assert more["a", "gyro"] == pytest.approx(pairs["a", "gyro"], abs=6.0)
    assert more["a",] == pytest.approx(pairs["a",], abs=6.0)
    assert max(more, key=lambda k: more[k]) in {("a", "gyro"), ("a", "c", "gyro")}


def test_what_a_form_leaves_counts_in_the_axes_of_the_causes_that_differ():
    """200 nats are left sideways and 4 ahead: a loss of thrust is told beside either of two side forces."""
    axes = {"screw": frozenset("XYN"), "rudder": frozenset("XYN"), "thrust": frozenset("X")}
    error = FormError(200.0, axes=axes, parts={frozenset("X"): 4.0, frozenset("XYN"): 200.0})
    gain = {("screw",): 650.0, ("rudder",): 610.0, ("thrust",): 3.0,
            ("screw", "thrust"): 800.0, ("rudder", "thrust"): 765.0}  # fmt: skip
    worth = told(gain, error)
    assert worth["screw", "thrust"] - worth["screw",] == pytest.approx(150.0)
    assert worth["screw", "thrust"] - worth["rudder", "thrust"] < 1.0  # look-alikes stay together
    assert worth["thrust",] == 3.0  # what explains no more than is left ahead is no rival
    whole = told(gain, FormError(200.0))
    assert whole["screw", "thrust"] - whole["screw",] < 5.0


@pytest.mark.parametrize("leaves", [100.0, 300.0])
def test_what_was_not_asked_of_kinematics_is_no_measure_of_what_was(leaves):
    """A gyro alone does not follow the readings: pairs with it are still compared with each other, and none
    is worth more than the best was.
    """
    gain = {("gyro",): 5400.0, ("gyro", "lag"): 6000.0, ("gyro", "rate"): 5950.0}
    error = FormError(leaves, {("gyro", "lag"): 5500.0, ("gyro", "rate"): 5500.0}, frozenset({"gyro"}))
    worth = told(gain, error)
    assert worth["gyro",] == 5400.0 and max(worth.values()) == 6000.0
    assert 6000.0 - worth["gyro", "rate"] == pytest.approx(error.lag(50.0))


def test_a_lead_that_one_run_makes_against_the_others_is_worth_the_odds_of_the_runs():
    """Two look-alikes 200 nats apart, ten times what the form leaves: one run carries it, three object."""
    one, other = ("lag",), ("rate",)
    agreed = FormError(20.0, by_run={one: np.full(4, -50.0), other: np.zeros(4)})
    apart = np.array([300.0, -40.0, -30.0, -30.0])
    split = FormError(20.0, by_run={one: -apart, other: np.zeros(4)})
    assert agreed.behind(200.0, one, other) == agreed.lag(200.0) > 100.0
    assert split.behind(200.0, one, other) == log_odds_over_runs(apart) < 3.0  # all of it from the runs
    assert split.behind(0.5, one, other) <= 0.5
    assert split.behind(200.0, one, ("unknown",)) == split.lag(200.0)
    opposed = FormError(20.0, by_run={one: np.zeros(4), other: -np.ones(4)})
    # every run left out is predicted better by what lags: what was stated before the runs alone speaks
    assert opposed.behind(200.0, one, other) == opposed.lag(200.0)
    exact = FormError(0.0, by_run=split.by_run)
    assert exact.behind(200.0, one, other) == 200.0  # the equations lack nothing: evidence is what it is


def test_what_an_unusual_size_costs_is_not_what_a_form_may_leave():
    """30 nats apart, of which a form may leave all; 12 of them say that 39 % of ballast is not usual."""
    ballast, thrust = ("ballast",), ("thrust",)
    sums = {ballast: np.full(4, 1.0), thrust: np.zeros(4)}  # run by run the ballast is the better
    for by_run in ({}, sums):
        error = FormError(60.0, by_run=by_run, costs={ballast: 14.0, thrust: 2.0})
        assert error.lag(30.0) < 3.0
        assert error.behind(30.0, ballast, thrust) == pytest.approx(12.0)
        assert error.behind(5.0, ballast, thrust) == pytest.approx(5.0)  # never more than the distance
        # the usual size is no merit, and what is not known of one of them tells nothing
        for one, other in ((thrust, ballast), (ballast, ("unknown",))):
            assert error.behind(30.0, one, other) == FormError(60.0, by_run=by_run).behind(30.0, one, other)


def test_a_name_acts_as_probably_as_all_sets_that_hold_it():
    none, where = candidate(0.0), SimpleNamespace(base=0.0)
    evidence = {"a": 40.0, "b": 10.0, "c": 38.0, "coefficient_error": 2.0, "outside": 5.0}
    found = probabilities(evidence, (candidate(43.0, "b", "a"),), none, where)
    assert found.sets[("a", "b")] > 0.05
    assert sum(found.sets.values()) == pytest.approx(1.0)
    for name, inside in found.inside.items():
        assert inside == pytest.approx(sum(p for key, p in found.sets.items() if name in key))


@pytest.mark.parametrize("planted", [0.0, 0.3, 2.0])
def test_the_scatter_of_a_size_from_run_to_run_is_what_was_planted(planted):
    """Common slope, a size of its own for every run; in the mean of many draws, noise of one."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(200):
        runs = []
        for size in 1.5 + planted * rng.normal(size=6):
            columns = rng.normal(size=(80, 2))
            runs.append((columns @ [0.7, size] + rng.normal(size=80), columns))
        found.append(between_runs(*of_single_runs(grams(runs), 1)))
    squares = np.square(found)
    error = squares.std() / np.sqrt(squares.size)
    if planted == 0.0:
        assert np.mean(squares == 0.0) > 0.3 and squares.mean() < 0.01  # 1/80 is the variance of a size
    else:
        assert abs(squares.mean() - planted**2) < 4.0 * error
    # what a run asks for is its own regression on what the common slope leaves
    size, covariance = of_single_runs(grams(runs), 1)
    slopes = np.linalg.lstsq(
        np.block([[c[:, :1], *(c[:, 1:] * (k == m) for m in range(6))] for k, (_, c) in enumerate(runs)]),
        np.concatenate([e for e, _ in runs]), rcond=None,
    )[0]  # fmt: skip
    assert size == pytest.approx(slopes[1:], abs=5e-3) and np.all(np.diag(covariance) < 0.05)
    one, *others = grams(runs)
    silent = [replace(e, ss=0.0 * e.ss, se=0.0 * e.se) for e in others]
    assert between_runs(*of_single_runs((one, *silent), 1)) == 0.0  # one run alone says nothing


@pytest.mark.thorough
def test_a_rudder_offset_of_some_runs_only_fails_a_check_and_one_of_all_does_not():
    model = build_model(load_vehicle("remus100"), 3)
    noise = {"x": 0.05, "y": 0.05, "psi": 0.003, "r": 0.002, "u": 0.004, "v": 0.004}
    orders = (
        "zigzag:13/13",
        "zigzag:10/10,rpm=1200",
        "turn:12",
        "prbs:12",
        "turn:-8",
        "zigzag:12/12,rpm=1700",
    )
    every, never = (
        simulate_model(model, "remus100", orders, 0.5, None, change, noise, 3)
        for change in ({"rudder_offset.offset": 0.03}, None)
    )
    half = tuple((never, every)[k % 2].runs[k] for k in range(len(orders)))
    for trial, fails in ((every, False), (replace(every, runs=half), True)):
        found = diagnose(trial, model, plan_next=False).result
        assert found.explanation == ("rudder_offset",)
        assert any("disagree about the size of rudder offset" in text for text in failures(found)) == fails
        runs = found.run_sizes["rudder_offset"].sizes["rudder_offset.offset"]
        assert len(runs) == 6
        with_it = [name for k, name in enumerate(runs) if not fails or k % 2]
        for name, size in runs.items():
            assert abs(size.value - (0.03 if name in with_it else 0.0)) < 4.0 * size.sd + 0.004
