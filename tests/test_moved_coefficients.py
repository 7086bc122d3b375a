"""Effects that stand for a coefficient further off than stated: closed forms, what a form may leave, a hull
whose drag no stated uncertainty allows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial
from scipy.stats import norm

from bayesid.diagnosis.answer import answer
from bayesid.diagnosis.hypotheses.moved_coefficients import certainly_wrong, standing_for
from bayesid.diagnosis.run import diagnose
from bayesid.estimation.filter_error.evidence import normal_equations
from bayesid.estimation.parameters import GaussianPrior

STATED, SD, FOUND = -2.0, 0.2, -3.0  # of a coefficient of drag: half more, five stated deviations
SHARE_SD = 0.25  # of an effect that multiplies it


def case(error=0.002, alike=1.0, high=3.0, force="share*quadratic_drag()", stated=STATED):
    """A coefficient the readings put at `FOUND`, one that is nothing to it, and an effect with this part of
    its trace from the first."""
    one, other = np.eye(3)[:2]
    trace = np.sqrt(alike) * one + np.sqrt(1.0 - alike) * np.eye(3)[2]
    columns = np.column_stack([SD * one, 0.1 * other, SHARE_SD * FOUND * trace])
    total = normal_equations(np.zeros(3), columns, 0.0, 3)
    effect = SimpleNamespace(
        key=lambda name: f"more_drag.{name}", parameters=(SimpleNamespace(name="share"),), smooth=True,
        force={"X": force},
    )  # fmt: skip
    bank = SimpleNamespace(
        total=lambda level: total,
        effects={"more_drag": SimpleNamespace(effect=effect, variants=(np.array([2]),))},
        par=np.array([FOUND, 1.0]),
    )
    model = SimpleNamespace(
        prior_sd=lambda key: SHARE_SD, index={"more_drag.share": 2}, effect_limits={2: (-0.5, high)}
    )
    prior = GaussianPrior(
        ("X_u|u|", "N_r"), np.arange(2), np.array([stated, 1.0]), np.array([SD, 0.1]), np.full(2, -np.inf)
    )
    posterior_sd = 1.0 / np.sqrt(1.0 / SD**2 + 1.0 / error**2)
    value = stated + (FOUND - stated) * (posterior_sd / error) ** 2
    fitted = SimpleNamespace(free=prior, values=np.array([value, 1.0]), sd=np.array([posterior_sd, 0.05]))
    return SimpleNamespace(model=model, stated=prior), bank, fitted


def test_size_and_evidence_are_those_of_closed_forms():
    """Readings that fix -3.0: half more drag; densities of an estimate five deviations off with and without
    the effect's room."""
    (found,) = standing_for(*case(), leaves=0.0, least=3.0)
    assert (found.effect, found.coefficient) == ("more_drag", "X_u|u|")
    assert found.size == pytest.approx(0.5, rel=1e-6)
    assert found.sd == pytest.approx(0.002 / 2.0, rel=1e-3)
    assert found.moved == pytest.approx(5.0, rel=1e-4)
    room = np.hypot(SD, SHARE_SD * abs(STATED))
    gain = norm.logpdf(FOUND, STATED, room) - norm.logpdf(FOUND, STATED, SD)
    assert found.certain == pytest.approx(gain, rel=1e-3)
    wide = norm.logpdf(FOUND, STATED, 3 * SD) - norm.logpdf(FOUND, STATED, SD) + np.log(0.25)
    assert certainly_wrong((found,), ["every coefficient x3", "every coefficient x10"]) > wide
    assert certainly_wrong((), ["every coefficient x3"]) == 0.0


def test_what_a_form_leaves_moves_the_estimate_by_some_of_its_deviations():
    """A form that may leave 50 nats moves an estimate by ten deviations; the rest of the five is certain."""
    problem, bank, fitted = case(error=0.02)
    (alone,) = standing_for(problem, bank, fitted, 0.0, 3.0)
    (beside,) = standing_for(problem, bank, fitted, 50.0, 3.0)
    assert alone.moved - beside.moved == pytest.approx(10 * 0.02 / SD, rel=0.02)
    assert beside.size == alone.size and beside.sd > alone.sd and 0.0 < beside.certain < alone.certain
    assert standing_for(problem, bank, fitted, 250.0, 3.0) == ()  # 22 deviations: 2.8 are left
    loose = case(error=0.15)
    assert standing_for(*loose, 0.0, 3.0) and standing_for(*loose, 50.0, 3.0) == ()


@pytest.mark.parametrize(
    ("other", "least"),
    [({"alike": 0.99}, 3.0), ({"high": 0.4}, 3.0), ({}, 5.1)],
    ids=["trace", "size", "near"],
)
def test_an_effect_stands_for_no_coefficient_it_does_not_act_as(other, least):
    """A trace that is not its own, a size beyond what it can have, a coefficient within what was stated."""
    assert standing_for(*case(**other), leaves=0.0, least=least) == ()


def test_a_coefficient_the_readings_hardly_tell_is_not_said_to_be_off():
    """An estimate five stated deviations off with an error of three is 1.6 deviations of what to expect."""
    problem, bank, fitted = case(error=3 * SD)
    assert standing_for(problem, bank, fitted, 0.0, 1.7) == ()
    (found,) = standing_for(problem, bank, fitted, 0.0, 1.5)
    assert found.moved == pytest.approx(5.0 / np.hypot(1.0, 3.0))
    assert found.sd == pytest.approx(3 * SD / 2.0, rel=1e-6)


def test_a_force_that_is_no_share_of_coefficients_stands_for_none():
    """A line that is dragged brakes a straight run as drag does and is no share of it; of nothing none is."""
    assert standing_for(*case(force="-share*u*abs(u)"), 0.0, 3.0) == ()
    assert standing_for(*case(stated=0.0), 0.0, 3.0) == ()


def test_an_effect_that_is_in_the_explanation_does_not_stand_for_the_coefficient():
    problem, bank, fitted = case()
    held = replace(fitted.free, names=("X_u|u|", "more_drag.share"))
    assert standing_for(problem, bank, SimpleNamespace(**vars(fitted) | {"free": held}), 0.0, 3.0) == ()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [3, 4])
def test_a_fouled_hull_whose_other_coefficients_are_wrong_as_well_is_told_beside_them(seed):
    """60 % more drag where all coefficients were stated to 5 % and lie about 15 % off: no run tells it from
    a wrong X_u|u|; only the coefficients were said, and no cause."""
    model = model_of()
    wrong = ("Y_v|v|", "N_r|r|", "Y_r", "N_dr", "Y_dr", "N_r", "Y_v")
    rng = np.random.default_rng(seed)
    factor = dict(zip(wrong, 1.0 + 0.15 * rng.standard_normal(len(wrong)), strict=True)) | {"X_u|u|": 1.6}
    values = {n: f * model.nominal[model.index[n]] for n, f in factor.items()}
    result = diagnose(planted_trial(model, values, seed), model, plan_next=False).result
    assert result.verdict == "coefficients"
    assert {"coefficient_error", "hull_fouling"} <= set(result.set95)
    (said,) = result.in_place_of
    assert said.effect.parameters["drag_increase"].value == pytest.approx(0.6, abs=0.06)
    assert "no wrong X_u|u| but hull fouling" in answer(result).headline
