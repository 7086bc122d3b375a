"""Errors of an estimate along ridges that bend, against closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from bayesid.errors import ModelError
from bayesid.estimation.likelihood.nonlinear_covariance import nonlinear_covariance

SIGMA = 0.05


@dataclass(frozen=True)
class Curve:
    """Readings f(z) with unit noise beside a prior of unit variance on some unknowns; estimate at 0."""

    names: tuple[str, ...]
    f: object
    known: tuple[int, ...]  # unknowns with a prior
    initial: tuple[str, ...] = ()
    survives: float = np.inf

    @property
    def params(self):
        return SimpleNamespace(names=self.names)

    @property
    def runs(self):
        return (
            SimpleNamespace(
                initial=self.initial, initial_sd=np.ones(len(self.initial)), residuals=lambda y: y
            ),
        )

    def readings(self, z):
        if np.abs(z).max() > self.survives:
            raise ModelError("diverges")
        return [np.asarray(self.f(z), dtype=float)]

    def run_blocks(self, z):
        step = 1e-6
        slopes = [
            (self.readings(z + d)[0] - self.readings(z - d)[0]) / (2 * step) for d in step * np.eye(z.size)
        ]
        return lambda i: (self.readings(z)[0], np.stack(slopes, axis=1))

    def prior(self, z):
        rows = np.eye(z.size)[list(self.known)]
        return rows @ z, rows


def law(curve: Curve, n: int) -> np.ndarray:
    """Covariance of the first parameters by linear theory."""
    _, jac = curve.run_blocks(np.zeros(n))(0)
    rows = np.vstack([jac, curve.prior(np.zeros(n))[1]])
    k = len(curve.names)
    return np.linalg.inv(rows.T @ rows)[:k, :k]


def test_a_problem_that_is_linear_keeps_its_covariance():
    rng = np.random.default_rng(3)
    slopes = rng.standard_normal((7, 4)) * np.array([1.0, 10.0, 1e3, 0.1])
    line = Curve(("a", "b", "c", "d"), lambda z: slopes @ z, (0, 1, 2, 3))
    linear = law(line, 4)
    found = nonlinear_covariance(line, np.zeros(4), linear)
    assert found.pairs == 0 and found.lost == 0
    assert found.covariance is linear


@pytest.mark.parametrize("bend", [0.1, 0.5])
def test_a_parabola_adds_the_fourth_moment_of_what_is_left_open(bend):
    """y = (a + c b^2) / s, b known to 1: the second moment of a is s^2 + 3 c^2, and a does not go with b."""
    parabola = Curve(("a", "b"), lambda z: [(z[0] + bend * z[1] ** 2) / SIGMA], (1,))
    linear = law(parabola, 2)
    found = [nonlinear_covariance(parabola, np.zeros(2), linear, seed) for seed in range(12)]
    sd = np.array([np.sqrt(f.covariance[0, 0]) for f in found]) / np.sqrt(SIGMA**2 + 3 * bend**2)
    assert {f.pairs for f in found} == {64} and not any(f.lost for f in found)
    assert np.mean(sd) == pytest.approx(1.0, abs=0.05)
    assert np.abs(sd - 1.0).max() < 0.25  # of 64 pairs, where one direction is left open
    for f in found:
        assert f.covariance[1, 1] == pytest.approx(1.0, rel=0.01)
        assert abs(f.covariance[0, 1]) < 0.02 * bend
        assert f.widest == pytest.approx(np.sqrt(f.covariance[0, 0]) / SIGMA, rel=1e-3)


def test_what_bends_too_little_to_tell_is_left_alone():
    slight = Curve(("a", "b"), lambda z: [(z[0] + 0.1 * SIGMA * z[1] ** 2) / SIGMA], (1,))
    linear = law(slight, 2)
    assert nonlinear_covariance(slight, np.zeros(2), linear).covariance is linear


def test_initial_states_follow_the_parameters():
    """What an initial state can take is no error of a parameter."""
    taken = Curve(("a", "b"), lambda z: [(z[2] + z[1] ** 2) / SIGMA, z[0] / SIGMA], (1,), ("y",))
    linear = law(taken, 3)
    assert nonlinear_covariance(taken, np.zeros(3), linear).covariance is linear


def test_coefficients_that_are_one_stay_one():
    """Two perfectly correlated coefficients, as the added masses of a symmetric hull, bend together."""
    tied = Curve(("a", "a2", "b"), lambda z: [(z[0] + 0.5 * z[2] ** 2) / SIGMA, 1e9 * (z[0] - z[1])], (2,))
    linear = SIGMA**2 * np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1 / SIGMA**2]])
    found = nonlinear_covariance(tied, np.zeros(3), linear)
    assert found.pairs == 64
    assert found.covariance[:2, :2] == pytest.approx(np.full((2, 2), SIGMA**2 + 0.75), rel=0.4)
    assert found.covariance[0, 0] == pytest.approx(found.covariance[0, 1], rel=1e-6)


def test_where_draws_diverge_linear_theory_stands():
    cliff = Curve(("a", "b"), lambda z: [(z[0] + 0.5 * z[1] ** 2) / SIGMA], (1,), survives=1e-3)
    linear = law(cliff, 2)
    found = nonlinear_covariance(cliff, np.zeros(2), linear)
    assert found.covariance is linear
    assert found.pairs == 0 and found.lost > 0


def test_a_few_draws_that_diverge_are_no_doubt_of_a_problem_that_is_linear():
    slight = Curve(("a", "b"), lambda z: [(z[0] + 0.05 * SIGMA * z[1] ** 2) / SIGMA], (1,), survives=1.6)
    linear = law(slight, 2)
    found = nonlinear_covariance(slight, np.zeros(2), linear)
    assert found.covariance is linear and found.lost == 0


def test_the_seed_fixes_the_answer():
    parabola = Curve(("a", "b"), lambda z: [(z[0] + 0.5 * z[1] ** 2) / SIGMA], (1,))
    linear = law(parabola, 2)
    one, same, other = (nonlinear_covariance(parabola, np.zeros(2), linear, s).covariance for s in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_a_parameter_on_its_bound_stays_there_and_the_others_bend():
    """y = (a + c b^2) / s beside d, which may not go below its estimate: beyond it the vehicle diverges."""

    @dataclass(frozen=True)
    class Bounded(Curve):
        def readings(self, z):
            if abs(z[2]) > 1e-5:
                raise ModelError("diverges")
            return super().readings(z)

    bounded = Bounded(("a", "b", "d"), lambda z: [(z[0] + 0.5 * z[1] ** 2 + 0.1 * z[2]) / SIGMA], (1, 2))
    linear = law(bounded, 3)
    lost = nonlinear_covariance(bounded, np.zeros(3), linear)
    assert lost.pairs == 0 and lost.lost > 0
    found = nonlinear_covariance(bounded, np.zeros(3), linear, held=[2])
    assert found.pairs == 64 and found.lost == 0
    assert found.covariance[2] == pytest.approx(linear[2])
    inner = linear[0, 0] - linear[0, 2] ** 2 / linear[2, 2]
    added = found.covariance[0, 0] - linear[0, 0]
    assert added == pytest.approx(3 * 0.25, rel=0.4) and inner == pytest.approx(SIGMA**2)


def test_an_unknown_that_nothing_holds_leaves_linear_theory():
    free = Curve(("a", "b"), lambda z: [z[0] / SIGMA], (0,))
    linear = np.diag([SIGMA**2, 1.0])
    assert nonlinear_covariance(free, np.zeros(2), linear).covariance is linear


def test_initial_states_taken_out_run_by_run_are_those_of_one_run():
    """Two runs that bend in parameters and starts: as one run whose starts are those of both."""

    def first(z):
        a, b, x, y = z[0], z[1], z[2], z[3]
        return np.array([a + x - 0.2 * b**2, x - 0.1 * a * b, y + a, y - 0.1 * b, 0.02 * b]) / SIGMA

    def second(z):
        a, b, x = z[0], z[1], z[4]
        return np.array([a + 2.0 * x - 0.1 * b**2, x - a, x + 0.3 * a**2, 0.01 * b]) / SIGMA

    def together(z):
        return np.concatenate([first(z), second(z)])

    whole = Curve(("a", "b"), together, (0, 1, 2, 4), initial=("x", "y", "x of the second"))

    @dataclass(frozen=True)
    class Apart(Curve):
        @property
        def runs(self):
            starts = (("x", "y"), ("x",))
            return tuple(
                SimpleNamespace(initial=i, initial_sd=np.ones(len(i)), residuals=lambda y: y) for i in starts
            )

        def readings(self, z):
            return [first(z), second(z)]

        def run_blocks(self, z):
            _, slopes = whole.run_blocks(z)(0)
            parts = ((slice(0, 5), [0, 1, 2, 3]), (slice(5, 9), [0, 1, 4]))
            return lambda i: (self.readings(z)[i], slopes[parts[i][0]][:, parts[i][1]])

    apart = Apart(("a", "b"), together, (0, 1, 2, 4))
    linear = law(whole, 5)
    one, two = (nonlinear_covariance(c, np.zeros(5), linear) for c in (whole, apart))
    assert one.pairs > 0 and one.widest > 1.0
    assert two.covariance == pytest.approx(one.covariance, rel=1e-7)


def test_a_piece_with_fewer_readings_than_initial_states_stays_linear():
    short = Curve(("a",), lambda z: np.array([z[0] + z[1]]) / SIGMA, (0,), initial=("x", "y"))
    linear = np.array([[1.0]])
    assert nonlinear_covariance(short, np.zeros(3), linear).covariance is linear
