"""Sizes of effects over all model forms that the runs allow."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace as Plain

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.model_form import ModelForm
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses import form_average
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.hypotheses.form_columns import SIZES, FormColumns
from bayesid.errors import ModelError
from bayesid.estimation.likelihood.model_form import typical

LAG, TAU = "actuator_lag", "actuator_lag.tau"
STEPS = (0.0, *SIZES)


@pytest.fixture(scope="module")
def lagging():
    """A rudder that lags by half a length over the speed, on a vehicle with rows the file lacks."""
    model = model_of("generic_sub")
    rows = ("Y_vvr", "Y_|v|r", "N_vvr", "N_|v|r")
    lacking = {n: -2e-3 * typical(model, n) for n in rows if n in model.index}
    lag = 0.5 * model.scales["L"] / model.scales["U"]
    trial = planted_trial(model, other_vehicle(model, 5) | lacking | {TAU: lag}, 5, samples=160)
    form = ModelForm({"X": 0.0, "Y": 1e-3, "N": 3e-4})
    return build_problem(model, trial).with_form(form), lag


def refit(problem):
    return weighted_hypothesis(problem, (LAG,), fit_with(problem, (problem.model.effects[LAG],)))


def test_a_size_beside_another_form_is_that_of_a_refit_with_it(lagging):
    problem, _ = lagging
    first = refit(problem)
    columns = FormColumns.along(problem, first, None)
    assert columns.causes >= {TAU}
    base, value, sd = columns.sizes(problem.form, [TAU])
    at = first.fit.free.names.index(TAU)
    assert value[0] == pytest.approx(first.fit.values[at], abs=0.05 * sd[0])
    assert sd[0] == pytest.approx(first.fit.sd[at], rel=0.02)
    # far behind (10 nats) the path is another; about as probable ones agree closely
    for sizes, near in (({"X": 0.0, "Y": 1e-3, "N": 1e-3}, 0.1), ({"X": 1e-4, "Y": 1e-3, "N": 1e-4}, 0.5)):
        other = refit(replace(problem, form=None).with_form(ModelForm(sizes)))
        at = other.fit.free.names.index(TAU)
        evidence, value, sd = columns.sizes(ModelForm(sizes), [TAU])
        assert value[0] == pytest.approx(other.fit.values[at], abs=near * sd[0])
        assert sd[0] == pytest.approx(other.fit.sd[at], rel=0.05)
        gained = other.log_evidence - first.log_evidence
        assert evidence - base == pytest.approx(gained, abs=6.0 * near)


def test_the_window_holds_what_all_forms_say(lagging):
    """Against all 125 sizes of three axes, each as probable before the runs."""
    problem, lag = lagging
    first = refit(problem)
    at = first.fit.free.names.index(TAU)
    told = (float(first.fit.values[at]), 0.0)
    mean, sd = form_average.averaged_over_forms(problem, first, {TAU: told, "wind.u": (5.0, 1.0)})[TAU]
    columns = FormColumns.along(problem, first, None)
    every = [
        columns.sizes(ModelForm(dict(zip("XYN", sizes, strict=True))), [TAU])
        for sizes in product(STEPS, repeat=3)
    ]
    evidence, values, deviations = (np.array(part) for part in zip(*every, strict=True))
    weight = np.exp(evidence - evidence.max())[:, None] / np.exp(evidence - evidence.max()).sum()
    whole = (weight * values).sum()
    spread = np.sqrt((weight * (deviations**2 + (values - whole) ** 2)).sum())
    assert mean == pytest.approx(whole, abs=0.02 * spread)
    assert sd == pytest.approx(spread, rel=0.03)
    assert abs(mean - lag) < 3.0 * sd


class Table:
    """Evidence and sizes of made-up forms: a ridge along which more of the one is less of the other."""

    axes, causes = ("Y", "N"), frozenset({"a.size", "b.size"})

    def __init__(self):
        self.asked = []

    def sizes(self, form, names):
        y, n = (STEPS.index(form.sizes[a]) for a in self.axes)
        self.asked.append((y, n))
        assert (form.period, form.ahead) == (3.0, True)  # what the form has besides stays
        at = [{"a.size": 1.0 + y, "b.size": 5.0}[name] for name in names]
        return -3.0 * (y + n - 4) ** 2, np.array(at), np.array([0.1, 0.5])[: len(names)]


@pytest.fixture
def along(monkeypatch):
    table = Table()
    monkeypatch.setattr(form_average.FormColumns, "along", classmethod(lambda cls, *a: table))
    return table


FORM = ModelForm({"Y": 1e-4, "N": 1e-3}, period=3.0, ahead=True)


def test_what_the_form_may_carry_instead_widens_a_size_and_nothing_else(along):
    told = {"a.size": (2.0, 0.1), "b.size": (5.0, 0.7), "gyro.scale": (0.01, 0.001)}
    found = form_average.averaged_over_forms(Plain(form=FORM), None, told)
    # ridge y + n = 4, five forms alike, those beside it exp(-3) of them
    side = np.exp(-3.0)
    share = np.array([1 + side, 1 + 2 * side, 1 + 2 * side, 1 + 2 * side, 1 + side])
    share /= share.sum()
    y = np.arange(5)
    mean = 1.0 + share @ y
    assert found["a.size"] == pytest.approx((mean, np.sqrt(0.01 + share @ (1.0 + y - mean) ** 2)), rel=1e-6)
    assert found["b.size"] == pytest.approx((5.0, 0.7))  # never less than single runs move it
    assert found["gyro.scale"] == (0.01, 0.001)
    assert len(set(along.asked)) == len(along.asked) < 25  # far ones are not asked for


def test_a_size_that_no_form_moves_and_one_without_a_form_stay(along):
    assert form_average.averaged_over_forms(Plain(form=None), None, {"a.size": (2.0, 0.1)}) == {
        "a.size": (2.0, 0.1)
    }
    other = {"gyro.scale": (0.01, 0.001)}
    assert form_average.averaged_over_forms(Plain(form=FORM), None, other) == other
    assert not along.asked


def test_where_nothing_can_be_linearised_what_was_told_stays(monkeypatch):
    def refused(cls, *a):
        raise ModelError("the simulation along the estimated path diverges")

    monkeypatch.setattr(form_average.FormColumns, "along", classmethod(refused))
    told = {"a.size": (2.0, 0.1)}
    assert form_average.averaged_over_forms(Plain(form=FORM), None, told) == told
