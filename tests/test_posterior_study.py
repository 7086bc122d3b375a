"""The posterior study in quick form, and what stands behind its comparison of samplers."""

from __future__ import annotations

import json
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesid.errors import SampleError
from bayesid.estimation.sampling import ConvergenceCheck, Posterior, Unknowns
from bayesid.estimation.sampling.compare_samplers import agreement
from bayesid.report import posterior_figures as figures

STUDY = Path(__file__).parents[1] / "studies" / "posterior" / "run.py"


def drawn(shift: float, scale: float, seed: int, digest: str = "d") -> Posterior:
    """Independent normal draws of two unknowns dressed as a posterior."""
    rng = np.random.default_rng(seed)
    draws = shift + scale * rng.standard_normal((4, 1000, 1, 2))
    ess, none = np.full(2, 4000.0), np.full(2, np.inf)
    gate = ConvergenceCheck(True, (), np.ones(2), ess, ess, np.ones(2), 1000.0, 0.0, ())
    unknowns = Unknowns(("a", "b"), 2, -none, none, np.zeros(2), none, np.ones(2))
    flat = np.zeros((4, 1000, 1))
    return Posterior(
        unknowns, draws, flat, flat, gate, np.zeros(2), np.ones(2), np.ones(4), 1, 0, {"all": 4000}, 1.0,
        seed, digest,
    )  # fmt: skip


def test_equal_posteriors_agree_within_their_errors_and_others_do_not():
    same = agreement(drawn(0.0, 1.0, 1), drawn(0.0, 1.0, 2))
    assert np.abs(same.mean).max() < 4 and np.abs(np.log(same.spread)).max() < 4 * same.spread_error.max()
    moved = agreement(drawn(0.0, 1.0, 1), drawn(0.2, 1.0, 2))
    assert np.abs(moved.mean).min() > 4
    narrow = agreement(drawn(0.0, 1.0, 1), drawn(0.0, 0.9, 2))
    assert np.log(narrow.spread).min() > 4 * narrow.spread_error.max()


def test_posteriors_of_other_densities_are_not_compared():
    with pytest.raises(SampleError, match="same density"):
        agreement(drawn(0.0, 1.0, 1), drawn(0.0, 1.0, 2, digest="other"))
    one = drawn(0.0, 1.0, 1)
    with pytest.raises(SampleError, match="same density"):
        agreement(one, replace(one, unknowns=replace(one.unknowns, names=("a", "c"))))


def test_a_corner_plot_labels_every_unknown_and_every_set():
    pytest.importorskip("corner")
    rng = np.random.default_rng(0)
    sets = {n: 1 + 0.1 * rng.standard_normal((500, 3)) for n in ("one", "two")}
    figure = figures.corner(("X_vv", "X_vr", "X_rr"), sets, np.ones(3))
    assert [axes.get_xlabel() for axes in figure.axes[-3:]] == ["$X_{vv}$", "$X_{vr}$", "$X_{rr}$"]
    assert [text.get_text() for text in figure.texts] == ["one (solid)", "two (dashed)"]


@pytest.mark.slow
def test_the_quick_study_names_what_a_short_spiral_leaves_open(tmp_path):
    pytest.importorskip("corner")
    study = runpy.run_path(str(STUDY), run_name="study")
    study["main"](tmp_path, None, True, 0)
    results = json.loads((tmp_path / "results.json").read_text())
    found = results["identifiability"]["spiral14"]
    assert found["n_fixed"] + len(found["directions"]) == 14
    assert found["least_agreement"] > 0.9  # the covariance of 800 draws, not of Laplace
    assert {"rhat_max", "chains", "derived"} <= set(results)
    assert (tmp_path / "report.html").exists()
