"""A log that does not say what its header says is not fitted or sampled, unless it is trusted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bayesid.api import fit as fit_module
from bayesid.api.fit import fit
from bayesid.api.predict import predict
from bayesid.api.sample import sample
from bayesid.api.simulate import simulate
from bayesid.errors import MistakenLogError
from bayesid.trials import Trial
from bayesid.trials.correction import Correction, apply

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


def test_only_runs_that_are_fitted_count(right, turned):
    half = replace(right, runs=(right.runs[0], replace(turned.runs[1], role="holdout")))
    assert fit(half, free="X_u|u|", quick=True).found.fit.converged


@pytest.mark.thorough
def test_a_trusted_log_is_fitted_as_it_is(turned, monkeypatch):
    asked = []
    monkeypatch.setattr(fit_module, "refuse_mistaken_log", lambda *of: asked.append(of))
    fit(turned, free="X_u|u|", quick=True, trust_input=True)
    assert not asked
    fit(turned, free="X_u|u|", quick=True)
    assert len(asked) == 1
