"""Where refits of an effect without a slope when off begin, and that they arrive from there."""

from dataclasses import replace
from types import SimpleNamespace as Plain

import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.hypotheses import refit as refits
from bayesid.diagnosis.hypotheses import sensitivity_bank as banks
from bayesid.diagnosis.hypotheses.candidate import parameter_table, weighted_hypothesis
from bayesid.diagnosis.hypotheses.refit import refit, refit_screened, sizes_of
from bayesid.trials.trial import Environment


def test_a_rudder_late_by_longer_than_it_moves_is_found_in_a_loud_environment():
    """From off, and under as much process noise, a search ends on the nearest hill, 150 nats below."""
    model = model_of()
    time, key = model.scales["L"] / model.scales["U"], "actuator_dead_time.delay"
    trial = planted_trial(model, other_vehicle(model, 3) | {key: 1.3 * time}, 3)
    problem = build_problem(model, replace(trial, environment=Environment(force_rms=6e-4, nav_drift=0.0)))
    effect = model.effects["actuator_dead_time"]
    bank = banks.build_bank(
        problem, problem.path, banks.levels_between(problem, problem.path_level), [effect]
    )
    (near,) = refit(problem, (effect,), lambda text: None)
    (found,) = refit_screened(problem, bank, banks.screen(bank)[0], lambda text: None)
    value, sd = parameter_table(found.fit, problem)[key]
    assert found.log_evidence > near.log_evidence + 100.0
    assert abs(value - 1.3 * time) < 3.0 * sd < 0.1 * time
    # and beside another effect it begins where it was found
    pair = (effect, model.effects["gyro_scale"])
    (both,) = refit(problem, pair, lambda text: None, sizes_of(problem, [found]))
    assert parameter_table(both.fit, problem)[key][0] == pytest.approx(value, abs=3.0 * sd)


def test_a_rudder_late_by_four_prior_deviations_is_found_at_once_where_the_screen_points():
    """From the usual size, and from the screen's estimate, the search ended 60 nats below."""
    model = model_of("generic_sub")
    time, key = model.scales["L"] / model.scales["U"], "actuator_dead_time.delay"
    trial = planted_trial(model, other_vehicle(model, 4) | {key: 2.0 * time}, 4)
    problem = build_problem(model, replace(trial, environment=Environment(force_rms=6e-4, nav_drift=0.0)))
    effect, said = model.effects["actuator_dead_time"], []
    bank = banks.build_bank(
        problem, problem.path, banks.levels_between(problem, problem.path_level), [effect]
    )
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    (found,) = refit_screened(problem, bank, banks.screen(bank)[0], said.append, none)
    value, sd = parameter_table(found.fit, problem)[key]
    assert abs(value - 2.0 * time) < 3.0 * sd < 0.2 * time
    assert said == ["refit with actuator dead time"]


def test_an_effect_that_alone_came_out_as_nothing_does_not_begin_at_nothing():
    model = model_of()
    problem = build_problem(model, planted_trial(model))
    effect = model.effects["actuator_lag"]
    (alone,) = refit(problem, (effect,), lambda text: None)
    free = alone.fit.free
    off = replace(alone, fit=replace(alone.fit, values=free.mean))
    moved = replace(alone, fit=replace(alone.fit, values=free.mean + free.sd))
    assert sizes_of(problem, [off]) == {}
    assert sizes_of(problem, [off, moved]) == {"actuator_lag": pytest.approx((1.0,))}


@pytest.mark.parametrize(
    ("size", "gains", "asked"),
    [
        (0.8, [5.0], ["usual"]),  # near off: the first that explains is kept, whatever was promised
        (0.8, [None, 90.0], ["usual", "estimate"]),
        (3.0, [85.0], ["screen"]),
        (3.0, [75.0, 85.0], ["screen", "usual"]),  # short of four fifths of 100 nats
        (3.0, [75.0, 70.0, 90.0], ["screen", "usual", "estimate"]),
        (3.0, [None, None, None], ["screen", "usual", "estimate"]),
    ],
)
def test_a_refit_begins_elsewhere_until_it_gains_what_was_promised(monkeypatch, size, gains, asked):
    """Gains of the refits in turn over none; without a number the refit does not follow the readings."""
    begun, left = [], list(gains)

    def candidate(gain):
        lost = gain is None
        fit = Plain(converged=not lost, chi2=9.0 if lost else 1.0, log_evidence=0.0 if lost else 50.0 + gain)
        return Plain(fit=fit, log_evidence=fit.log_evidence)

    def first(problem, effects, notify, sizes, none, promised):
        begun.append("screen" if sizes == {"late": (size,)} else "usual")
        return [candidate(left.pop(0))]

    def again(problem, effects, start, level, out, notify):
        begun.append(start)
        return [max(*out, candidate(left.pop(0)), key=lambda c: (c.fit.converged, c.log_evidence))]

    monkeypatch.setattr(refits, "refit", first)
    monkeypatch.setattr(refits, "refit_again", again)
    monkeypatch.setattr(refits, "first_fit", lambda problem, effects, path: "usual")
    monkeypatch.setattr(refits, "_estimated", lambda problem, bank, score: "estimate")
    effect = Plain(name="late", smooth=False, dated=None)
    problem = Plain(model=Plain(effects={"late": effect}), path=(), path_level=0.0)
    score = Plain(name="late", start=(size,), gain=100.0)
    (found,) = refit_screened(problem, None, score, print, candidate(0.0))
    assert begun == asked and not left
    assert found.log_evidence == max([50.0 + g for g in gains if g is not None], default=0.0)
