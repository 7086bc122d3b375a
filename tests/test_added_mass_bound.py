"""No refit makes an added mass negative: one that is asked for becomes zero, and its evidence is cut."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_trials import model_of, planted_trial

from bayesid.diagnosis.data.problem import build_problem
from bayesid.diagnosis.hypotheses.candidate import corrected_evidence
from bayesid.estimation.filter_error.fit import fit
from bayesid.estimation.parameters import coefficient_prior, coefficient_set
from bayesid.report.fit_first_screen import without_added_mass


def fits(share):
    """Fits with and without the bound to readings of a vehicle with this share of its sway added mass, which
    is known to its order only: model, (fit, share found) of each."""
    model = model_of("remus100")
    given = model.nominal[model.index["Y_vdot"]]
    problem = build_problem(model, planted_trial(model, {"Y_vdot": share * given}, 1))
    free = problem.coefficients
    wide = np.where(np.array(free.names) == "Y_vdot", abs(given), free.sd)
    found = [
        fit(model, problem.logs, f, problem.environment.noise_model)
        for f in (replace(free, sd=wide), replace(free, sd=wide, high=np.full(len(wide), np.inf)))
    ]
    return model, *((f, f.values[free.names.index("Y_vdot")] / given) for f in found)


@pytest.mark.thorough
def test_readings_that_ask_for_a_negative_added_mass_get_none():
    model, (bound, held), (unbound, asked) = fits(-0.1)
    assert unbound.converged and -0.4 < asked < -0.01  # the control
    assert bound.converged and held == pytest.approx(0.0, abs=1e-6)
    # a prior cut at zero leaves a part of the posterior
    assert corrected_evidence(model, bound) < bound.log_evidence - 1.0


@pytest.mark.thorough
def test_a_fit_arrives_that_went_astray_beyond_zero():
    _, (bound, held), (unbound, _) = fits(-0.3)
    assert bound.converged and held == pytest.approx(0.0, abs=1e-6) and bound.chi2 < 1.2
    assert not unbound.converged and unbound.chi2 > 10.0  # the control


def test_only_added_masses_are_bound_and_only_as_the_file_has_them():
    model = model_of("remus100")
    free = coefficient_prior(model)
    bound = {n for n, high in zip(free.names, free.high, strict=True) if high == 0.0}
    assert bound == {"X_udot", "Y_vdot", "N_rdot"} and np.all(np.isinf(free.low))
    assert np.all(np.isinf([h for n, h in zip(free.names, free.high, strict=True) if n not in bound]))
    turned = model.with_values({"Y_vdot": -model.nominal[model.index["Y_vdot"]]})
    assert model.index["Y_vdot"] not in replace(model, nominal=turned).coefficient_limits


def test_the_search_of_a_fit_ends_at_zero_added_mass_however_wide_its_bounds():
    model = model_of("remus100")
    entries = {p.name: p for p in coefficient_set(model)}
    given = model.nominal[model.index["Y_vdot"]]
    assert entries["Y_vdot"].high == 0.0 and entries["Y_vdot"].low == pytest.approx(6.0 * given)
    assert entries["Y_v"].high > 0.0
    narrow = {p.name: p for p in coefficient_set(model, relative_bounds=0.3)}
    assert narrow["Y_vdot"].high == pytest.approx(0.7 * given)


def test_an_added_mass_that_ended_at_zero_is_told_no_other_bound():
    fit = SimpleNamespace(
        names=("Y_vdot", "N_rdot", "X_udot", "Y_v", "wind.north"),
        n_params=5,
        at_bound=("Y_vdot", "X_udot", "Y_v"),
        z=[-1e-12, -3.0, -12.0, 0.0, 0.0],
        start=[-30.0, -3.0, -2.0, -1.0, 0.0],
    )
    assert without_added_mass(fit) == ["Y_vdot"]
