"""A log that does not say what its header says is not fitted or sampled, unless it is trusted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bayesid.api import fit as fit_module
from bayesid.api.diagnose import diagnose
from bayesid.api.fit import fit
from bayesid.api.mistaken_log import held_out_mistakes
from bayesid.api.predict import predict
from bayesid.api.sample import sample
from bayesid.api.simulate import simulate
from bayesid.errors import MistakenLogError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import Run, Trial
from bayesid.trials.correction import Correction, apply
from bayesid.trials.held_out_log import FITTED, SAID, held_out_notes
from studies.log_mistakes.one_run_late import logged_late


def held_out(run: Run) -> Run:
    return replace(run, role="holdout")


NOISE = {"x": 0.1, "y": 0.1, "psi": 0.005, "r": 0.002, "u": 0.01, "v": 0.01}


@pytest.fixture(scope="module")
def right() -> Trial:
    orders = ("zigzag:10/10,duration=40", "zigzag:13/13,duration=40")
    return simulate("remus100", *orders, dof=3, dt=0.4, noise=NOISE, seed=1)


@pytest.fixture
def turned(right) -> Trial:
    mirrored = Correction(scale={"psi": -1.0})
    return replace(right, runs=tuple(apply(mirrored, run) for run in right.runs))


@pytest.mark.thorough
def test_the_mistake_and_its_mend_are_told_with_exit_code_4(turned, tmp_path):
    with pytest.raises(
        MistakenLogError, match=r"heading has the opposite sign.*scale = \{ psi = -1 \}"
    ) as told:
        fit(turned, free="X_u|u|", quick=True)
    assert told.value.exit_code == 4 and "--trust-input" in str(told.value)
    with pytest.raises(MistakenLogError, match="heading has the opposite sign"):
        sample(turned, tmp_path / "chain", free="X_u|u|", quick=True)
    assert not (tmp_path / "chain").exists()


def test_a_prediction_that_diagnoses_first_refuses_it_too(turned):
    with pytest.raises(
        MistakenLogError, match=r"heading has the opposite sign.*with --model the log is not checked"
    ):
        predict(turned, vehicle="remus100")


def test_a_mistake_of_held_out_runs_alone_fails_a_check_of_the_fit(right, turned):
    """The fit stands: it does not read them. Its errors there are those of the log."""
    held = [replace(run, role="holdout") for run in (right.runs[1], turned.runs[1])]
    for run, said in zip(held, (False, True), strict=True):
        found = fit(replace(right, runs=(right.runs[0], run)), free="X_u|u|", quick=True)
        assert found.found.fit.converged
        told = [text for text in found.failures if text.startswith(SAID)]
        assert len(told) == said
    assert run.name in told[0] and "heading has the opposite sign" in told[0]


def test_a_mistake_that_fitted_runs_have_too_is_not_told_of_the_held_out_ones(right, turned):
    """Trusted, or read after a mend: what is asked of the held-out runs is what only they have wrong."""
    ship = load_vehicle("remus100")
    assert held_out_mistakes(turned, ship) == ()  # none is held out
    beside = replace(turned, runs=(*turned.runs, replace(right.runs[0], name="third", role="holdout")))
    assert held_out_mistakes(beside, ship) == ()
    (said,) = held_out_mistakes(replace(right, runs=(right.runs[0], held_out(turned.runs[1]))), ship)
    assert held_out_notes(("another", said)) == [said]
    assert f'runs = ["{turned.runs[1].name}"]' in said  # the mend does not reach the fitted run


def test_a_fitted_run_that_is_silent_is_not_said_to_be_wrong(turned):
    """A straight run tells nothing of the sign of its heading: whether it is turned as well is not known."""
    straight = simulate("remus100", "straight:duration=40", dof=3, dt=0.4, noise=NOISE, seed=1).runs[0]
    trial = replace(turned, runs=(straight, held_out(turned.runs[1])))
    (said,) = held_out_mistakes(trial, load_vehicle("remus100"))
    assert said.startswith(SAID) and f'runs = ["{turned.runs[1].name}"]' in said
    assert "the fitted runs do not tell whether they have it too" in said and straight.name not in said


@pytest.mark.thorough
def test_a_fitted_run_that_only_the_held_out_ones_tell_wrong_is_told():
    """Orders of one run are late against those of others only: here the fit read the late one."""
    orders = ("zigzag:10/10,duration=60", "zigzag:12/12,duration=60", "zigzag:5/10,duration=60")
    three = simulate("remus100", *orders, dof=3, dt=0.2, noise=NOISE, seed=1)
    runs = (logged_late(three.runs[0], 1.0)[0], *(held_out(run) for run in three.runs[1:]))
    (said,) = held_out_mistakes(replace(three, runs=runs), load_vehicle("remus100"))
    assert said.startswith(FITTED) and runs[0].name in said and "does not stand" in said


@pytest.mark.thorough
def test_a_diagnosis_tells_it_after_the_verdict(right, turned):
    half = replace(right, runs=(right.runs[0], held_out(turned.runs[1])))
    found = diagnose(half, vehicle="remus100", first_look=True, next_manoeuvre=False)
    assert found.verdict == "none"
    assert [text.startswith(SAID) for text in found.failures] == [True]
    assert found.headline


@pytest.mark.thorough
def test_a_trusted_log_is_fitted_as_it_is(turned, monkeypatch):
    asked = []
    monkeypatch.setattr(fit_module, "with_log_checked", lambda *of: asked.append(of) or of[0])
    fit(turned, free="X_u|u|", quick=True, trust_input=True)
    assert not asked
    fit(turned, free="X_u|u|", quick=True)
    assert len(asked) == 1
