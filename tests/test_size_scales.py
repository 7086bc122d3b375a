"""Evidence of effects whose size is not known to an order of magnitude."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from bayesid.diagnosis.hypotheses.size_scales import SMALLER, gains_of_draws, over_usual_size, sizes_of_effect
from bayesid.diagnosis.threshold_table import SHOWN_NONCENTRALITY, USUAL_SIZE_PROBABILITY
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.model.effects import CATALOGUE


def equations(columns, readings):
    return NormalEquations(
        columns.T @ columns, columns.T @ readings, float(readings @ readings), 0.0, readings.size
    )


def test_it_is_the_integral_over_a_prior_of_several_widths():
    """One effect, one coefficient; the size integrated numerically under the mixture of normal densities."""
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((40, 2)) * [1.0, 200.0]
    readings = columns @ [0.4, 0.02] + rng.standard_normal(40)
    total = equations(columns, readings)
    shares = [USUAL_SIZE_PROBABILITY, *([(1.0 - USUAL_SIZE_PROBABILITY) / len(SMALLER)] * len(SMALLER))]

    def density(z):
        rest = readings - columns[:, 1] * z
        given = posterior(equations(columns[:, :1], rest)).log_evidence
        prior = sum(c * norm.pdf(z, scale=s) for c, s in zip(shares, (1.0, *SMALLER), strict=True))
        return np.exp(given - base) * prior

    base = posterior(total).log_evidence
    whole = quad(density, -0.2, 0.2, points=[0.0, 0.02], limit=400)[0]
    assert over_usual_size(total, [[1]]) == pytest.approx(np.log(whole), abs=1e-3)


def test_what_these_runs_would_not_show_at_smaller_sizes_is_as_before():
    column = np.full((10, 1), np.sqrt(0.9 * SHOWN_NONCENTRALITY / SMALLER[0] ** 2 / 10))
    readings = np.linspace(-1.0, 2.0, 10)
    assert over_usual_size(equations(column, readings), [[0]]) == 0.0
    assert over_usual_size(equations(2.0 * column, readings), [[0]]) != 0.0


def test_where_rounding_leaves_no_equations_of_the_sizes_alone_they_add_nothing():
    """Columns so large that the rest of the matrix is no longer positive definite end no diagnosis: of 256
    matrices of 5e15 that had an evidence one did."""
    rounded = NormalEquations(np.diag([1e6, 1e16, -2.0]), np.ones(3), 10.0, 0.0, 10)
    assert over_usual_size(rounded, [[0]]) == 0.0
    whole = NormalEquations(np.diag([1e6, 1e16, 2.0]), np.ones(3), 10.0, 0.0, 10)
    assert over_usual_size(whole, [[0]]) != 0.0


def test_two_small_parameters_pay_little_more_than_one():
    """A cause of two parameters, a hundredth of its usual size, beside one that is the same line with one."""
    rng = np.random.default_rng(5)
    columns = 70.0 * rng.standard_normal((60, 2))
    readings = columns @ [0.01, -0.01] + rng.standard_normal(60)
    both, line = equations(columns, readings), equations(columns @ [[1.0], [-1.0]], readings)
    usual = posterior(line).log_evidence - posterior(both).log_evidence
    of_any_size = usual + over_usual_size(line, [[0]]) - over_usual_size(both, [[0, 1]])
    assert usual > 3.5 and of_any_size < 0.5 * usual


@pytest.mark.parametrize("information", [12.0, 400.0, 4e4])
def test_without_the_effect_its_evidence_is_one_on_average_and_rarely_large(information):
    """Bayes factors against the truth have mean one (Turing and Good) and pass 100 in one of 100 at most."""
    z = 8.0 * np.sqrt(1.0 + information) * np.linspace(-1.0, 1.0, 100_001)
    score = z * np.sqrt(information)
    gains = gains_of_draws(np.array([[information]]), score[:, None], [0])
    weight = norm.logpdf(z) + np.log(z[1] - z[0])
    assert np.exp(gains + weight).sum() == pytest.approx(1.0, abs=1e-6)
    assert np.exp(weight)[gains > np.log(100.0)].sum() < 0.01


def test_draws_and_refits_are_weighed_alike():
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((50, 4)) * [2.0, 1.0, 50.0, 80.0]
    readings = rng.standard_normal(50)
    total = equations(columns, readings)
    none = posterior(total.pick(np.array([0, 1]))).log_evidence
    gain = posterior(total).log_evidence + over_usual_size(total, [[2, 3]]) - none
    c, e = slice(0, 2), slice(2, 4)
    inner = np.linalg.inv(np.eye(2) + total.ss[c, c])
    information = total.ss[e, e] - total.ss[e, c] @ inner @ total.ss[c, e]
    score = total.se[e] - total.ss[e, c] @ inner @ total.se[c]
    assert gains_of_draws(information, score[None], [0, 1])[0] == pytest.approx(gain, abs=1e-8)


def test_shapes_and_times_are_no_sizes():
    sizes = {e.name: [e.parameters[i].name for i in sizes_of_effect(e)] for e in CATALOGUE}
    assert sizes["drag_step"] == ["extra_drag"] and sizes["fluid_memory"] == ["fraction"]
    assert sizes["hull_misalignment"] == ["side_force", "yaw_moment"]
    # the place of a mass is not small because the mass is
    assert sizes["ballast_mass"] == ["mass_fraction"] and sizes["trim_weight"] == ["weight_excess"]
    assert sizes["crossflow_drag"] == ["Cd"]
