"""Events of seconds that no misfit shows: a force in one run is dated; what lasts, and none, are no event."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

import bayesid.diagnosis.brief_events as brief_events_module
from bayesid.diagnosis.brief_events import Found, Joint, Pieces, _gains, _root, brief_events
from bayesid.diagnosis.data.problem import build_problem, fit_with
from bayesid.diagnosis.events_counted import verdict_of
from bayesid.diagnosis.exclusions import compare_without
from bayesid.diagnosis.hypotheses.candidate import weighted_hypothesis
from bayesid.diagnosis.hypotheses.localisation import locate
from bayesid.diagnosis.hypotheses.rules import MOTION_EVENT
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior, without

BEGIN, LASTS = 25.0, 4.0  # L/U
SIZE = 1e-4  # over 1/2 rho L^3 U^2


def trial_of(model, acts, size=SIZE):
    """Two runs; `acts` (run, time over L/U) says when a turning moment does."""
    L, U, rho = (model.scales[k] for k in ("L", "U", "rho"))

    def force(run, t):
        return {"N": size * 0.5 * rho * L**3 * U**2 * acts(run, t * U / L)}

    return planted_trial(model, other_vehicle(model, 3), 3, force, samples=160)


def brief(run, t):
    return (t > BEGIN) & (t < BEGIN + LASTS) & (run == "turn")


def events_of(acts, size=SIZE, change=lambda trial: trial, least=None):
    model = model_of("remus100")
    problem = build_problem(model, change(trial_of(model, acts, size)))
    none = weighted_hypothesis(problem, (), fit_with(problem, ()))
    left = locate(problem, none.fit.points, problem.coefficients).places[0].evidence
    return model.scales["L"] / model.scales["U"], brief_events(
        problem, none, left if least is None else least
    )


def test_a_moment_of_seconds_is_dated():
    time, found = events_of(brief)
    assert [e.run for e in found] == ["turn"] and found[0].kind == "motion" and found[0].misfit is None
    assert found[0].start / time == pytest.approx(BEGIN, abs=1.5)
    assert found[0].end / time == pytest.approx(BEGIN + LASTS, abs=1.5)
    assert found[0].evidence > 30.0


def test_a_rudder_that_sticks_is_told_by_how_much():
    """As a signal of the rudder would be told that acts in those seconds only (`stretch`)."""
    _, (event,) = events_of(brief)
    model = model_of("remus100")
    problem = build_problem(model, trial_of(model, brief))
    beside = locate(problem, fit_with(problem, ()).points, problem.coefficients).stretch
    assert event.channel == "rudder" and beside.value is not None
    times = [e.value * (e.end - e.start) for e in (event, beside)]
    assert times[0] == pytest.approx(times[1], rel=0.1)
    assert event.sd == pytest.approx(beside.sd, rel=0.5)


@pytest.mark.parametrize(
    "acts",
    [
        lambda run, t: np.zeros(t.size),
        lambda run, t: np.sign(np.sin(t / 5.0)),
        lambda run, t: np.sin(t / 9.0 + (run == "turn")),
    ],
    ids=["nothing", "every few lengths", "a swell"],
)
def test_nothing_and_what_lasts_are_no_event(acts):
    assert events_of(acts)[1] == ()


def test_a_reading_wrong_for_seconds_is_no_motion(monkeypatch):
    """Heading 1.7 degrees off for five lengths, six times its noise: taken for a motion if not asked for."""

    def change(trial):
        zigzag, turn = trial.runs
        psi = turn.data["psi"].copy()
        psi[60:72] += 0.03
        return replace(trial, runs=(zigzag, replace(turn, data={**turn.data, "psi": psi})))

    def found():
        return events_of(lambda run, t: np.zeros(t.size), change=change, least=0.0)[1]

    assert found() == ()
    sets = brief_events_module.channel_sets
    monkeypatch.setattr(
        brief_events_module, "channel_sets", lambda problem: {k: v for k, v in sets(problem).items() if v[0]}
    )
    assert [e.run for e in found()] == ["turn"]


def test_a_diagnosis_says_when_and_blames_no_effect():
    model = model_of("remus100")
    compared = compare_without(model, trial_of(model, brief))
    verdict = verdict_of(compared)
    assert [(e.run, e.misfit) for e in compared.problem.events] == [("turn", None)]
    assert (verdict.word, verdict.rule, verdict.effects) == ("outside", MOTION_EVENT, ())


def equations(rng, rows, columns):
    a, e = rng.standard_normal((rows, columns)), rng.standard_normal(rows)
    return NormalEquations(a.T @ a, a.T @ e, float(e @ e), 0.0, rows)


def test_gains_are_those_of_one_linear_model_of_all_runs():
    """Two runs, three shared parameters: evidence of the joint model with a signal over that without it."""
    rng = np.random.default_rng(0)
    known, signals = 3, 6
    runs = [Pieces(k, 0.0, 1.0, signals, equations(rng, 60, known + signals)) for k in (0, 1)]

    def joint(allowed):
        """Log evidence with signals (run, columns, root), each run's own."""
        size = known + sum(root.shape[1] for *_, root in allowed)
        total, begin = None, known
        bases = {k: np.zeros((known + signals, size)) for k in (0, 1)}
        for basis in bases.values():
            basis[:known, :known] = np.eye(known)
        for run, columns, root in allowed:
            bases[run][known + columns, begin : begin + root.shape[1]] = root
            begin += root.shape[1]
        for k, basis in bases.items():
            g = runs[k].equations
            one = NormalEquations(basis.T @ g.ss @ basis, basis.T @ g.se, g.ee, 0.0, g.used)
            total = one if total is None else total + one
        return posterior(total).log_evidence

    first, second = np.array([1, 2, 3]), np.array([0, 1])
    roots = 0.7 * _root(1, 3, 0.5), 0.4 * _root(1, 2, 0.5)
    alone = _gains(Joint(runs, known, []).beside()[1], first[None], roots[0])[0]
    assert alone == pytest.approx(joint([(1, first, roots[0])]) - joint([]), rel=1e-9)
    kept = Found(alone, 1, "N", 1, 4, first, roots[0])
    for run in (0, 1):  # beside the first, in the other run and in its own
        more = _gains(Joint(runs, known, [kept]).beside()[run], second[None], roots[1])[0]
        both = joint([(1, first, roots[0]), (run, second, roots[1])])
        assert more == pytest.approx(both - joint([(1, first, roots[0])]), rel=1e-9)
    # integrating out the parameters of one run alone agrees with `without`
    g = runs[0].equations
    turned = g.pick(np.array([*range(known, known + signals), *range(known)]))
    np.testing.assert_allclose(
        Joint(runs[:1], known, []).beside()[0].ss, without(turned, signals).ss, rtol=1e-9
    )
