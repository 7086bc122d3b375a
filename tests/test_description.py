"""The form of a missing force: planted terms come back with their size, other forces are given no form."""

from __future__ import annotations

from functools import lru_cache

import jsonschema
import numpy as np
import pytest
from gap_trials import model_of, other_vehicle, planted_trial

from bayesid.analysis.excitation.columns import evaluate
from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.evidence import missing_force, term_evidence
from bayesid.diagnosis.evidence.force_terms import force_library, unit_of
from bayesid.diagnosis.evidence.missing_force import MissingForceTerm, describe
from bayesid.diagnosis.hypotheses.localisation import locate
from bayesid.diagnosis.result import schema
from bayesid.diagnosis.schema import plain
from bayesid.equations.model import build_model
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.parameters import GaussianPrior
from bayesid.model.vehicles import load_vehicle

SAMPLES = 120
LOWEST = np.full(1, -np.inf)


@lru_cache
def scales():
    """Model, force unit 1/2 rho L^2 U^2, L and U of the submarine."""
    model = model_of("generic_sub")
    s = model.scales
    return model, 0.5 * s["rho"] * s["L"] ** 2 * s["U"] ** 2, s["L"], s["U"]


@lru_cache
def described_term(name):
    return described(planted(name))[0]


def described(values, force=None, seed=0):
    model = scales()[0]
    trial = planted_trial(
        model, {**other_vehicle(model, seed + 5), **values}, seed=seed, samples=SAMPLES, force=force
    )
    problem = build_problem(model, trial)
    where = locate(problem, problem.path, problem.coefficients, masks=False)
    return describe(problem, problem.path, problem.coefficients, where, problem.path_level), problem


def planted(name):
    _, unit, length, speed = scales()
    return {
        "Y_vvv": {"Y_vvv": -9.0 * unit / speed**3},
        "X_vv": {"X_vv": -0.1 * unit / speed**2},
        "N_v|r|": {"N_v|r|": 0.05 * unit * length**2 / speed**2},
    }[name]


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["Y_vvv", "X_vv", pytest.param("N_v|r|", marks=pytest.mark.slow)])
def test_a_planted_term_is_named_with_its_size(name):
    """Two runs of 48 L/U; coefficients of the executed vehicle drawn from the 5 % prior. X_vv is a row the
    vehicle has, sixteen times its value."""
    found = described_term(name)
    (term,) = found.terms
    assert term.name == name
    truth = planted(name)[name]
    assert abs(term.value - truth) < 4.0 * term.sd
    assert term.sd < 0.1 * abs(truth)
    assert term.gain > 50.0 and found.predictive > 20.0
    assert term.in_model == (name == "X_vv")
    if name == "X_vv":  # prime by 1/2 rho L^2, as the vehicle file has it
        _, unit, _, speed = scales()
        assert term.prime == pytest.approx(term.value / (unit / speed**2))
    assert name in found.sentences[0]


def test_a_vehicle_within_its_prior_gets_no_description():
    found, _ = described({})
    assert not found.terms


@pytest.mark.parametrize(
    "kind", [pytest.param("pulse", marks=pytest.mark.slow), "drag from half way", "drifting"]
)
def test_a_force_that_follows_no_motion_is_given_no_form(kind):
    """Negative control: forces of time, of sizes the free force sees at 30 to 6000 nats."""
    _, unit, length, speed = scales()
    time = length / speed
    rng = np.random.default_rng(4)

    def drifting(t):
        steps = np.exp(-np.diff(t, prepend=t[0]) / (3 * time))
        out = np.zeros(t.size)
        for i in range(1, t.size):
            out[i] = steps[i] * out[i - 1] + np.sqrt(1 - steps[i] ** 2) * rng.standard_normal()
        return out

    def force(name, t):
        if kind == "pulse":
            return {"Y": 3e-4 * unit * ((t > 10 * time) & (t < 14 * time)) * (name == "turn")}
        if kind == "drifting":
            return {"Y": 3e-4 * unit * drifting(t)}
        return {"X": -2e-4 * unit * (t > 20 * time) * (name == "turn")}

    found, _ = described({}, force)
    assert not found.terms
    assert "none is named" in found.sentences[0] or "No term" in found.sentences[0]


@pytest.mark.slow
def test_evidence_of_the_named_term_is_that_of_a_refit_with_it(monkeypatch):
    """Expected: converged non-linear refits with one more row free beside the coefficients. The named term's
    evidence agrees within 3 nats; linear columns along its path flatter a rival, so none is overlooked."""
    kept = {}
    original = missing_force.improved

    def spy(trial, chosen):
        kept["trial"] = trial
        return original(trial, chosen)

    monkeypatch.setattr(missing_force, "improved", spy)
    monkeypatch.setattr(term_evidence, "TERM_FORCE_SDS", (1e-3,))
    found, problem = described(planted("Y_vvv"))
    assert [t.name for t in found.terms] == ["Y_vvv"]
    trial, model = kept["trial"], problem.model
    names = [c.name for c in trial.columns]
    for name, within in (("Y_vvv", 3.0), ("Y_rrr", np.inf)):
        j = names.index(name)
        row = GaussianPrior((name,), model.positions([name]), np.zeros(1), 1e-3 * trial.unit[[j]], LOWEST)
        fitted = fit(
            model, problem.logs, problem.coefficients + row, problem.environment.noise_model,
            start=problem.path, initial_noise_scale=problem.path_level,
        )  # fmt: skip
        assert fitted.converged
        assert -3.0 < trial.evidence([j]) - fitted.log_evidence < within, name


def test_every_term_of_the_library_can_be_evaluated_and_has_a_unit():
    for dof in (3, 6):
        model = build_model(load_vehicle("remus100"), dof)
        columns = force_library(model)
        assert len({c.name for c in columns}) == len(columns) > 40
        rng = np.random.default_rng(0)
        states = 0.3 * rng.standard_normal((5, len(model.states)))
        act = rng.standard_normal((5, len(model.kernel.actuators)))
        for column in columns:
            assert np.isfinite(evaluate(column.expression, model, states, act)).all()
            assert unit_of(column).startswith(("kg", "N"))


def test_the_block_of_the_record_is_what_the_schema_states():
    found = described_term("X_vv")
    block = schema()["properties"]["description"]
    jsonschema.validate(plain(found), block)
    broken = plain(found)
    del broken["terms"][0]["gain"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(broken, block)


@pytest.mark.parametrize(
    ("name", "value", "in_model", "ahead", "kind", "drives"),
    [
        ("N_rrr", 1103.0, False, True, "a row the vehicle lacks", True),
        ("N_rrr", -1103.0, False, True, "a row the vehicle lacks", False),
        ("X_uu", 13.6, False, True, "a change of the vehicle's own X_u|u| as it goes ahead", False),
        ("X_uu", 16.0, False, True, "a change of the vehicle's own X_u|u| as it goes ahead", True),
        ("X_uu", -13.6, False, False, "a row the vehicle lacks", False),
        ("N_r", 5.0, True, True, "a change of the vehicle's own row", False),
        ("N_r", 15.0, True, True, "a change of the vehicle's own row", True),
    ],
)
def test_a_row_that_drives_the_motion_and_one_the_file_has_are_said_so(
    name, value, in_model, ahead, kind, drives
):
    """The file has X_u|u| = -15.5 and N_r = -10: what counts is the sum."""
    term = MissingForceTerm(name, name[0], "r", in_model, value, 60.0, "kg m^2 s", 0.9, 166.0, ())
    own = {"X_u|u|": -15.5, "N_r": -10.0}
    said = missing_force._words((term,), (name,), 166.0, 20.0, own, ahead)[0]
    assert f", {kind}, worth" in said and ("it drives the motion" in said) == drives
