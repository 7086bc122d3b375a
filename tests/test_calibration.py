"""Ranks, bands and coverage on cases whose answer is known."""

import numpy as np
import pytest
from scipy.stats import binom

from bayesid.estimation.sampling.rank_statistics import bands, coverage, distribution, inside, rank_of
from studies.calibration.judging import judged
from studies.calibration.replicate import Condition
from studies.calibration.report import calibration_report


def replicates(count, shift=0.0, width=1.0, unknowns=5, seed=0):
    """Conjugate toy: truth and draws of the same normal, unless shifted or stretched."""
    rng = np.random.default_rng(seed)
    ranks, hits = [], []
    for _ in range(count):
        centre = rng.standard_normal(unknowns)
        truth = centre + rng.standard_normal(unknowns)
        draws = centre + shift + width * rng.standard_normal((500, unknowns))
        ranks.append(rank_of(draws, truth, 99))
        hits.append(inside(draws, truth, 0.9))
    return np.array(ranks), np.array(hits)


def test_right_posteriors_stay_in_the_bands_and_cover_nine_in_ten():
    ranks, hits = replicates(200)
    assert bands(200, 5, 99).holds(distribution(ranks, 99)).all()
    found = coverage(hits)
    assert abs(found["share"] - 0.9) < 4 * found["standard_error"]


@pytest.mark.parametrize("wrong", [dict(shift=0.5), dict(width=0.7), dict(width=1.5)])
def test_shifted_narrow_and_wide_posteriors_leave_the_bands(wrong):
    ranks, _ = replicates(200, **wrong)
    assert not bands(200, 5, 99).holds(distribution(ranks, 99)).any()


def test_bands_hold_all_unknowns_at_once_as_often_as_they_say():
    band, rng = bands(100, 8, 49, trials=1500), np.random.default_rng(9)
    kept = [band.holds(distribution(rng.integers(0, 50, (100, 8)), 49)).all() for _ in range(400)]
    # 400 trials at 0.95: sd 0.011; discreteness makes the bands a little wide, never narrow
    assert 0.95 - 3.5 * 0.011 < np.mean(kept) <= 1.0


def test_bands_of_one_unknown_at_one_rank_are_wider_than_the_pointwise_interval():
    band = bands(200, 1, 99)
    low, high = binom.interval(0.95, 200, 0.5)
    assert band.low[49] < low / 200 and band.high[49] > high / 200


def test_a_rank_counts_draws_below_the_truth():
    draws = np.arange(100.0)[:, None]
    assert rank_of(draws, np.array([-1.0]), 99) == 0
    assert rank_of(draws, np.array([1000.0]), 99) == 99
    assert inside(draws, np.array([50.0]), 0.5) and not inside(draws, np.array([99.0]), 0.5)


def records(count, width=1.0, converged=True, seed=0):
    """Replicates of a conjugate toy as the study keeps them; posteriors `width` times too wide."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(count):
        centre = rng.standard_normal(4)
        truth = centre + rng.standard_normal(4)
        draws = centre + width * rng.standard_normal((400, 4))
        out.append(
            {
                "vehicle": "ab"[k % 2], "names": ["N_v", "N_r", "Y_v", "sigma:x"],
                "rank": rank_of(draws, truth, 99),
                "inside50": inside(draws, truth, 0.5), "inside90": inside(draws, truth, 0.9), "tau": 5.0,
                "sd_over_prior": np.ones(4), "converged": converged or k % 2 == 0, "cpu_seconds": 1.0,
                "vehicles_drawn": 1,
            }
        )  # fmt: skip
    return out


def test_conditions_are_met_missed_or_controls_that_fail():
    told = {
        "right": records(150, seed=1), "narrow": records(150, 0.5), "control: narrow": records(150, 0.5),
        "control: right": records(150, seed=1),
    }  # fmt: skip
    found = judged(told, {n: Condition(control=n.startswith("control")) for n in told})["conditions"]
    assert [c["standing"] for c in found.values()] == ["met", "missed", "fails", "does not fail"]
    inputs = {"quick": False, "vehicles": ["a", "b"], "prior_sd": 0.05}
    report = calibration_report(told, {"conditions": found}, inputs)
    assert "narrow" in report.lead and len(report.failures) == 2


def test_replicates_that_did_not_converge_count_and_are_told():
    told = {"right": records(40, converged=False)}
    found = judged(told, {"right": Condition()})["conditions"]
    assert found["right"]["replicates"] == 40 and found["right"]["90 %"]["replicates"] == 40
    assert found["right"]["90 %, converged"]["replicates"] == 20
    inputs = {"quick": False, "vehicles": ["a", "b"], "prior_sd": 0.05}
    assert any("20 of 40" in f for f in calibration_report(told, {"conditions": found}, inputs).failures)
