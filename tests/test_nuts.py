"""The gradient sampler: the right spread on a known Gaussian, the same chain for a seed, an honest gate."""

from __future__ import annotations

import numpy as np
import pytest

from bayesid.errors import SampleError
from bayesid.estimation.sampling import Laplace, Unknowns
from bayesid.estimation.sampling import nuts as module
from bayesid.estimation.sampling.nuts import NutsOptions, continue_nuts, sample_nuts

pytest.importorskip("nutpie")
K = 10


class Gaussian:
    """N(0, C) with correlations of 0.99 and standard deviations over six decades; `wall` cuts half off."""

    digest = "gaussian"

    def __init__(self, power: float = 1.0, wall: bool = False) -> None:
        rng = np.random.default_rng(3)
        root = np.linalg.qr(rng.standard_normal((K, K)))[0] * np.geomspace(0.1, 1.0, K)
        self.sd = np.geomspace(1e-3, 1e3, K)
        size = np.sqrt(np.sum(root**2, axis=1))
        self.covariance = root @ root.T / np.outer(size, size) * np.outer(self.sd, self.sd)
        self.precision = power * np.linalg.inv(self.covariance / np.outer(self.sd, self.sd))
        self.wall = wall
        names = tuple(f"p{i}" for i in range(K))
        none = np.full(K, np.inf)
        self.unknowns = Unknowns(names, K, -none, none, np.zeros(K), none, np.ones(K))

    def natural(self, q):
        return np.asarray(q)

    def coordinates(self, v):
        return np.asarray(v)

    def log_prob(self, q):
        z = q / self.sd
        value = -0.5 * np.einsum("bi,ij,bj->b", z, self.precision, z)
        return np.where(self.wall & (z[:, 0] < 0), -np.inf, value)

    def log_prob_slope(self, q):
        return float(self.log_prob(q[None])[0]), -(self.precision @ (q / self.sd)) / self.sd


def spread(target, **options):
    start = Laplace(np.zeros(K), 1.5 * target.covariance)  # as wrong as Laplace may be
    return sample_nuts(target, start, NutsOptions(seed=1, **options), threads=1)


@pytest.mark.thorough
def test_standard_deviations_of_a_known_gaussian_are_met():
    # 4000 draws of about 5000 effective: 1 % each, so 5 % is five sigma and 1 % of the mean of ten is three
    target = Gaussian()
    found = spread(target)
    assert found.converged, found.convergence.reasons
    assert found.sd / target.sd == pytest.approx(np.ones(K), abs=0.05)
    assert np.mean(found.sd / target.sd) == pytest.approx(1.0, abs=0.01)


@pytest.mark.thorough
def test_a_target_ten_percent_too_narrow_fails_the_same_test():
    # the control: the error of emcee's stock snooker move, which R-hat and effective size do not see
    target = Gaussian(power=1 / 0.9**2)
    found = spread(target)
    assert found.converged
    assert abs(np.mean(found.sd / target.sd) - 1.0) > 0.05


def test_the_same_seed_gives_the_same_chain():
    target, start = Gaussian(), Laplace(np.zeros(K), Gaussian().covariance)
    one, two = (sample_nuts(target, start, NutsOptions(draws=50, tune=50), threads=t) for t in (1, 2))
    assert one.draws.tolist() == two.draws.tolist()


@pytest.mark.thorough
def test_a_lengthened_chain_keeps_its_draws_and_gets_the_spread_right():
    # far too wide a start: what 300 draws say of the shape has to serve the rest
    target = Gaussian()
    start = Laplace(np.zeros(K), 9.0 * np.diag(target.sd**2))
    short = sample_nuts(target, start, NutsOptions(draws=75, tune=100, accept=0.8, seed=2), threads=1)
    assert not short.converged
    long = continue_nuts(target, start, short, NutsOptions(draws=1000, tune=100, accept=0.8, seed=2))
    assert long.draws.shape[:2] == (4, 1075)
    assert long.draws[:, :75].tolist() == short.draws.tolist()
    assert long.converged, long.convergence.reasons
    # 4000 draws of about 4000 effective, tails of a wrong start included
    assert long.draws[:, 75:].reshape(-1, K).std(axis=0) / target.sd == pytest.approx(np.ones(K), abs=0.06)
    assert long.seconds > short.seconds and long.counts["all"] > short.counts["all"]
    per_draw = (long.counts["all"] - short.counts["all"]) / 4400
    assert per_draw < 0.7 * short.counts["all"] / 700, "whitened with its own draws it needs fewer gradients"
    again = continue_nuts(target, start, short, NutsOptions(draws=1000, tune=100, accept=0.8, seed=2))
    assert again.draws.tolist() == long.draws.tolist()


def test_a_chain_of_another_density_is_not_lengthened():
    target, start = Gaussian(), Laplace(np.zeros(K), Gaussian().covariance)
    found = sample_nuts(target, start, NutsOptions(draws=50, tune=50), threads=1)
    target.digest = "another"
    with pytest.raises(SampleError, match="not of this density"):
        continue_nuts(target, start, found)


@pytest.mark.thorough
def test_a_wall_across_the_posterior_is_told_and_does_not_converge():
    # half the space is wall: a tenth of the usual draws meets it often enough
    found = spread(Gaussian(wall=True), tune=100, draws=100)
    assert not found.converged
    assert any("the steps cannot follow" in reason for reason in found.convergence.reasons)


def test_without_nutpie_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "nutpie", None)
    with pytest.raises(SampleError, match=r"bayesid\[nuts\]"):
        module._nutpie()
