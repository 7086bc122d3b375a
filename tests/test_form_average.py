"""Sizes of effects over all model forms that the runs allow."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace as Plain

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.model_form import ModelForm, with_form
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


def refit(problem, *names):
    names = names or (LAG,)
    return weighted_hypothesis(
        problem, names, fit_with(problem, tuple(problem.model.effects[n] for n in names))
    )


def test_a_size_beside_another_form_is_that_of_a_refit_with_it(lagging):
    problem, _ = lagging
    first = refit(problem)
    columns = FormColumns.along(problem, first, None)
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
        assert evidence - base == pytest.approx(gained, abs=0.5 if near < 0.5 else 3.0)


def test_the_mean_over_forms_is_that_of_refits_with_each(lagging):
    """Refits with nine forms around that of the problem, weighed by their evidence."""
    problem, lag = lagging
    first = refit(problem)
    at = first.fit.free.names.index(TAU)
    told = {TAU: (float(first.fit.values[at]), 0.0)}
    mean, sd = form_average.averaged_over_forms(problem, first, told)[TAU]
    others = [
        refit(replace(problem, form=None).with_form(ModelForm({"X": 0.0, "Y": y, "N": n})))
        for y, n in product((3e-4, 1e-3, 3e-3), (1e-4, 3e-4, 1e-3))
    ]
    evidence = np.array([o.log_evidence for o in others])
    weight = np.exp(evidence - evidence.max()) / np.exp(evidence - evidence.max()).sum()
    values, deviations = (
        np.array([getattr(o.fit, what)[o.fit.free.names.index(TAU)] for o in others])
        for what in ("values", "sd")
    )
    whole = weight @ values
    spread = np.sqrt(weight @ (deviations**2 + (values - whole) ** 2))
    assert mean == pytest.approx(whole, abs=0.25 * spread)
    assert sd == pytest.approx(spread, rel=0.1)
    assert abs(mean - lag) < 3.0 * sd


def test_columns_of_a_form_are_those_of_its_prior(lagging):
    problem, _ = lagging
    columns = FormColumns.along(problem, refit(problem), None)
    for sizes in product((0.0, 1e-4, 3e-3), repeat=3):
        form = ModelForm(dict(zip("XYN", sizes, strict=True)))
        wanted = with_form(problem.model, problem.stated, form, problem.absent_fins)
        keep, scale = columns._columns(form)
        names = [columns._free.names[i] for i in keep]
        assert sorted(names) == sorted({*wanted.names, TAU})
        sd = dict(zip(wanted.names, wanted.sd, strict=True))
        assert (columns._free.sd * scale)[keep] == pytest.approx(
            [sd.get(n, columns._free.sd[i]) for n, i in zip(names, keep, strict=True)]
        )


def test_a_shape_that_the_explanation_has_stays_in_it_with_every_form(lagging):
    """A hull out of line is in no form in Y alone: 7.9 s where it was dropped, 9.2 fitted."""
    problem, _ = lagging
    problem = replace(problem, form=None).with_form(ModelForm({"X": 0.0, "Y": 1e-3, "N": 0.0}))
    first = refit(problem, LAG, "hull_asymmetry")
    columns = FormColumns.along(problem, first, None)
    _, value, sd = columns.sizes(problem.form, [TAU])
    at = first.fit.free.names.index(TAU)
    assert value[0] == pytest.approx(first.fit.values[at], abs=0.1 * sd[0])
    assert sd[0] == pytest.approx(first.fit.sd[at], rel=0.05)


class Table:
    """Evidence and sizes of made-up forms: a ridge along which more of the one is less of the other."""

    causes = frozenset({"lag.tau", "wind.u", "loss.share"})

    def __init__(self, axes="YN", refused=()):
        self.axes, self.refused, self.asked = tuple(axes), refused, []

    def sizes(self, form, names):
        place = tuple(STEPS.index(form.sizes[a]) for a in self.axes)
        self.asked.append(place)
        assert (form.period, form.ahead) == (3.0, True)  # what the form has besides stays
        if place in self.refused:
            raise ModelError("not positive definite")
        values = {"lag.tau": 1.0 + place[0], "wind.u": 5.0, "loss.share": -1.0 + place[0]}
        evidence = -3.0 * (place[0] + place[1] - 4) ** 2 - sum((k - 2.0) ** 2 for k in place[2:])
        return (
            evidence,
            np.array([values[n] for n in names]),
            np.array([{"wind.u": 0.5}.get(n, 0.1) for n in names]),
        )


def world(monkeypatch, table, form, follows=True):
    """A problem and a refit beside a form whose sizes are those of a table."""
    monkeypatch.setattr(form_average.FormColumns, "along", classmethod(lambda cls, *a: table))
    monkeypatch.setattr(form_average, "explains", lambda candidate: follows)
    index = {"lag.tau": 0, "wind.u": 1, "loss.share": 2}
    model = Plain(index=index, effect_limits={0: (0.0, 4.0), 2: (0.0, np.inf)})
    return Plain(form=form, model=model), Plain(effects=("lag", "wind", "loss", "shape"))


FORM = ModelForm({"Y": 1e-4, "N": 1e-3}, period=3.0, ahead=True)
TOLD = {"lag.tau": (2.2, 0.1), "wind.u": (5.0, 0.7), "gyro.scale": (0.01, 0.001), "shape.c": (3.0, 0.1)}


def test_what_the_form_may_carry_instead_moves_a_size_and_widens_it(monkeypatch):
    problem, refitted = world(monkeypatch, Table(), FORM)
    found = form_average.averaged_over_forms(problem, refitted, TOLD)
    # all 25 forms, sizes 1 to 5 by the steps of Y but no more than the limit of 4; the refit's own is 2
    places = np.array(list(product(range(5), repeat=2)))
    weight = np.exp(-3.0 * (places.sum(1) - 4.0) ** 2)
    weight /= weight.sum()
    values = np.minimum(1.0 + places[:, 0], 4.0)
    mean = weight @ values
    spread = np.sqrt(0.01 + weight @ (values - mean) ** 2)
    assert found["lag.tau"] == pytest.approx((2.2 + mean - 2.0, spread))
    assert found["wind.u"] == pytest.approx((5.0, 0.7))  # never less than single runs move it
    assert {n: found[n] for n in ("gyro.scale", "shape.c")} == {n: TOLD[n] for n in ("gyro.scale", "shape.c")}


def test_a_size_at_its_bound_stays_there_where_forms_only_push_it_further_out(monkeypatch):
    problem, refitted = world(monkeypatch, Table(), replace(FORM, sizes={"Y": 0.0, "N": 3e-3}))
    value, sd = form_average.averaged_over_forms(problem, refitted, {"loss.share": (0.0, 0.5)})["loss.share"]
    assert 0.0 < value < 2.0 and sd > 0.5  # the forms above its bound count, the one below is at it
    table = Table()
    table.sizes = lambda form, names: (0.0, np.array([-3.0]), np.array([0.1]))
    problem, refitted = world(monkeypatch, table, FORM)
    assert form_average.averaged_over_forms(problem, refitted, {"loss.share": (0.0, 0.5)}) == {
        "loss.share": pytest.approx((0.0, 0.5))
    }


def test_a_form_that_has_no_evidence_is_left_out_and_no_other(monkeypatch):
    problem, refitted = world(monkeypatch, Table(), FORM)
    whole = form_average.averaged_over_forms(problem, refitted, TOLD)["lag.tau"]
    problem, refitted = world(monkeypatch, Table(refused={(4, 4), (0, 0)}), FORM)  # 48 nats behind
    assert form_average.averaged_over_forms(problem, refitted, TOLD)["lag.tau"] == pytest.approx(whole)
    problem, refitted = world(monkeypatch, Table(refused={(1, 3)}), FORM)  # the form of the refit
    assert form_average.averaged_over_forms(problem, refitted, TOLD) == TOLD


def test_of_six_axes_the_forms_about_the_most_probable_are_taken_wherever_the_refit_is(monkeypatch):
    found = []
    for start in ((1, 3, 0, 0, 0, 0), (1, 3, 2, 2, 2, 2), (1, 3, 4, 4, 1, 0)):
        table = Table("YNXZKM")
        form = replace(FORM, sizes={a: STEPS[k] for a, k in zip("YNXZKM", start, strict=True)})
        problem, refitted = world(monkeypatch, table, form)
        found.append(form_average.averaged_over_forms(problem, refitted, TOLD)["lag.tau"])
        assert len(table.asked) < 1000
    assert found[1] == pytest.approx(found[0]) and found[2] == pytest.approx(found[0])
    # three steps of Y and N about the ridge at (1, 3), the others alike: 1, 2 or 3
    places = np.array([(y, n) for y in (0, 1, 2) for n in (2, 3, 4)])
    weight = np.exp(-3.0 * (places.sum(1) - 4.0) ** 2)
    mean = 1.0 + weight @ places[:, 0] / weight.sum()
    assert found[0][0] == pytest.approx(2.2 + mean - 2.0)


def test_sizes_without_a_form_or_of_what_does_not_follow_the_readings_stay(monkeypatch):
    table = Table()
    for form, follows in ((None, True), (FORM, False)):
        problem, refitted = world(monkeypatch, table, form, follows)
        assert form_average.averaged_over_forms(problem, refitted, TOLD) == TOLD
    problem, refitted = world(monkeypatch, table, FORM)
    other = {"gyro.scale": (0.01, 0.001), "shape.c": (3.0, 0.1)}
    assert form_average.averaged_over_forms(problem, refitted, other) == other
    assert not table.asked


def test_where_nothing_can_be_linearised_what_was_told_stays(monkeypatch):
    def refused(cls, *a):
        raise ModelError("the simulation along the estimated path diverges")

    problem, refitted = world(monkeypatch, Table(), FORM)
    monkeypatch.setattr(form_average.FormColumns, "along", classmethod(refused))
    assert form_average.averaged_over_forms(problem, refitted, TOLD) == TOLD
