"""A force of the motion beside an explanation: evidence by dense covariances; motion flown once and twice."""

from __future__ import annotations

from types import SimpleNamespace as Plain

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from bayesid.diagnosis import dependence_stage
from bayesid.diagnosis.cut_runs import BriefSignal, CutRun, Joint
from bayesid.diagnosis.force_of_motion import (
    STATE_DISTANCES,
    STATE_SIZES,
    ForceOfMotion,
    _root,
    correlation,
)
from bayesid.estimation.filter_error.evidence import NormalEquations

KNOWN, ROWS = 2, 2


def random_runs(counts, resid, rng):
    """Runs with columns of two free parameters and of two forces by piece; also all of them side by side."""
    runs, known, forces = [], [], []
    for k, count in enumerate(counts):
        own = rng.standard_normal((len(resid[k]), KNOWN + ROWS * count))
        g = NormalEquations(own.T @ own, own.T @ resid[k], float(resid[k] @ resid[k]), 0.0, len(resid[k]))
        runs.append(CutRun(k, 0.0, 1.0, count, g))
        known.append(own[:, :KNOWN])
        forces.append(own[:, KNOWN:].reshape(-1, ROWS, count))
    wide = np.zeros((sum(len(e) for e in resid), ROWS, sum(counts)))
    row = column = 0
    for f in forces:
        wide[row : row + len(f), :, column : column + f.shape[2]] = f
        row, column = row + len(f), column + f.shape[2]
    return runs, np.concatenate(known), wide


def test_its_columns_are_the_correlation_of_all_motions():
    state = np.random.default_rng(0).standard_normal((30, 3))
    for distance in STATE_DISTANCES:
        root, exact = _root(state, distance, 99), correlation(state, state, distance)
        assert np.abs(root @ root.T - exact).max() < 1e-2
        assert np.abs(np.diag(root @ root.T) - 1.0).max() < 1e-4
    few = _root(state, STATE_DISTANCES[0], 5)
    assert (
        few.shape == (30, 5) and np.linalg.eigvalsh(correlation(state, state, 0.3) - few @ few.T)[0] > -1e-9
    )
    far = correlation(np.zeros((1, 3)), np.ones((1, 3)), 0.5)  # 3 apart, two usual motions are 6
    assert far[0, 0] == pytest.approx(np.exp(-0.5 * 3.0 / (6.0 * 0.25)))


def test_evidence_is_that_of_the_dense_covariance():
    rng, counts = np.random.default_rng(1), (4, 6)
    resid = [rng.standard_normal(30) for _ in counts]
    runs, known, wide = random_runs(counts, resid, rng)
    root = rng.standard_normal((10, 3))
    signal = BriefSignal(0.0, 1, "N", 2, 4, np.array([6 + 2, 6 + 3]), np.array([[0.8, 0.0], [0.3, 0.5]]))
    own = wide[:, 1, 4 + 2 : 4 + 4] @ signal.root
    whole, found = np.concatenate(resid), {"none": (), "one": (signal,)}
    for name, beside in found.items():
        noise = np.eye(60) + known @ known.T + (own @ own.T if name == "one" else 0.0)
        seen = [multivariate_normal.logpdf(whole, cov=noise)]
        for size in STATE_SIZES:
            parts = [wide[:, i, :] @ root for i in range(ROWS)]
            cov = noise + size**2 * sum(p @ p.T for p in parts)
            seen.append(multivariate_normal.logpdf(whole, cov=cov))
        expected = logsumexp(seen) - np.log(len(seen)) + 0.5 * 60 * np.log(2 * np.pi)
        assert ForceOfMotion((root,), (0, 1)).log_evidence(runs, KNOWN, beside) == pytest.approx(expected)


@pytest.mark.parametrize("again", [True, False])
def test_a_force_is_one_of_the_motion_where_it_comes_back_with_it(again):
    """Two runs of the same motion; a force in three pieces of the first, in those of the second or not."""
    rng, count = np.random.default_rng(2), 12
    motion = np.column_stack([np.linspace(-2.0, 2.0, count), np.cos(np.arange(count))])
    acts = np.zeros((ROWS, count))
    acts[1, 5:8] = 0.6
    wide = random_runs((count, count), [np.zeros(120)] * 2, rng)[2]
    push = wide[:, :, :count].reshape(240, -1) @ acts.ravel()
    push += again * (wide[:, :, count:].reshape(240, -1) @ acts.ravel())
    resid = (push + rng.standard_normal(240)).reshape(2, 120)
    runs, *_ = random_runs((count, count), list(resid), np.random.default_rng(2))
    state = np.concatenate([motion, motion])
    force = ForceOfMotion(tuple(_root(state, d, 99) for d in STATE_DISTANCES), (0, 1))
    signal = BriefSignal(0.0, 0, "N", 5, 8, count + np.arange(5, 8), 0.6 * np.eye(3))
    event = Joint(runs, KNOWN, [signal]).log_evidence
    assert event > Joint(runs, KNOWN, []).log_evidence + 30.0
    assert (force.log_evidence(runs, KNOWN, []) > event) == again


def test_a_free_force_is_set_against_it_where_a_cause_outside_is_probable(monkeypatch):
    rng = np.random.default_rng(3)
    runs, *_ = random_runs((4,), [rng.standard_normal(30)], rng)
    none = Joint(runs, KNOWN, ()).log_evidence
    force = Plain(log_evidence=lambda runs, known, found: none + 470.0)
    monkeypatch.setattr(dependence_stage, "force_of_motion", lambda sought: force)
    monkeypatch.setattr(dependence_stage, "force_left", lambda found: 213.0)

    def over(outside, acts=0.0):
        candidates = Plain(probabilities={"outside": outside}, inside={"outside": max(outside, acts)})
        found = Plain(candidates=candidates)
        return dependence_stage.over_motion(found, Plain(runs=runs, known=KNOWN))

    assert over(0.51) == pytest.approx(213.0 - 470.0)
    assert over(0.5) == over(0.4, 0.89) == np.inf
    assert over(0.4, 0.9) == pytest.approx(213.0 - 470.0)  # it acts for sure, with others
