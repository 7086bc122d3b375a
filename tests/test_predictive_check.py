"""Posterior predictive p: uniform or higher where the noise is as assumed, small where a motion is missed."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from bayesid.api.fit import FitResult
from bayesid.estimation.likelihood import NoiseParts, coefficient_posterior
from bayesid.estimation.likelihood.mixed_rates import mixed_rate_noise
from bayesid.estimation.likelihood.predictive_check import _of_noise, kind_of, missed, predictive_p
from bayesid.estimation.output_error import FitOptions, fit
from bayesid.estimation.trial_fit import fit_trial
from bayesid.model.params import ParameterSet
from bayesid.report.fit import fit_report, predictive_words
from studies.coverage.campaigns import Condition, campaign, drawn_truth, problem_of, remembering, setting

STATED = FitOptions(profile=False)
FEW = ("N_v", "N_r", "N_dr", "Y_v", "Y_r")


def campaign_of(condition, seed, louder=()):
    """A campaign of five unknown coefficients; in `louder` runs r has another four times its noise."""
    s = setting()
    s = replace(s, params=ParameterSet(tuple(p for p in s.params.entries if p.name in FEW)))
    rng = np.random.default_rng([41, seed])
    trial = campaign(s, condition, drawn_truth(s, rng), rng)
    runs = []
    for i, run in enumerate(trial.runs):
        more = 4 * s.noise["r"] * remembering(rng, run.t.size, condition.memory) if i in louder else 0.0
        kind = "zig-zag 20/20" if i < 2 else "turn 15"
        runs.append(replace(run, manoeuvre=kind, data={**run.data, "r": run.data["r"] + more}))
    return s, replace(trial, runs=tuple(runs))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("zigzag 20/20", "zigzag"), ("turning circle starboard 12", "turning circle starboard"),
     ("speed steps and random rudder", "speed steps and random rudder"), ("circle -35 deg", "circle"),
     ("20/20", "20/20")],
)  # fmt: skip
def test_the_kind_of_a_motion_is_its_name_without_numbers(name, kind):
    assert kind_of(name) == kind


def test_a_sum_of_squares_of_noise_with_memory_and_gaps_has_the_moments_of_many_such_sums():
    rng = np.random.default_rng(1)
    valid = (rng.uniform(size=300) > 0.3)[:, None]
    runs = [remembering(rng, 300, 8.0)[:, None] for _ in range(60)]
    noise = mixed_rate_noise(runs, [np.ones((300, 1), dtype=bool)] * 60)
    (group,) = noise.groups
    mean, variance = _of_noise(group, 0, valid)
    sums = np.array([np.sum(remembering(rng, 300, 8.0)[valid[:, 0]] ** 2) for _ in range(3000)])
    assert mean == pytest.approx(sums.mean(), rel=0.08)
    assert variance == pytest.approx(sums.var(), rel=0.25)
    assert variance > 5 * 2 * valid.sum()  # white noise would have this


@pytest.mark.thorough
def test_clean_campaigns_are_flagged_no_more_often_than_their_p_says():
    p = []
    for seed in range(20):
        s, trial = campaign_of(Condition(), seed)
        problem = problem_of(s, trial)
        z = fit(problem, STATED).z
        found = predictive_p(problem, z, coefficient_posterior(problem, z, NoiseParts()))
        assert set(found) == {"all runs"} and set(found["all runs"]) == set(s.noise)
        p += list(found["all runs"].values())
    for level in (0.01, 0.05, 0.2):
        assert np.sum(np.array(p) < level) <= binom.ppf(0.999, len(p), level)
    assert np.median(p) < 0.8  # nor does it pass everything


@pytest.mark.thorough
@pytest.mark.parametrize("memory", [0.0, 10.0])
def test_a_kind_of_motion_whose_errors_are_larger_is_told_from_the_others(memory):
    s, trial = campaign_of(Condition(memory=memory), 3, louder=(2, 3))
    parts = NoiseParts() if memory == 0 else None
    found = fit_trial(trial, s.model.vehicle, params=s.params, threads=1, parts=parts, options=STATED)
    low = missed(found.fit.uncertainty["predictive_p"])
    assert set(low) == {"turn"} and set(low["turn"]) == {"r"}
    (said,) = predictive_words(found.fit)
    assert "turn: r (p = " in said and said in FitResult(found)._doubts()


@pytest.mark.thorough
def test_runs_of_one_noise_are_not_told_apart_and_fit_json_and_report_have_the_numbers(tmp_path):
    s, trial = campaign_of(Condition(memory=10.0), 3)
    found = fit_trial(trial, s.model.vehicle, tmp_path, params=s.params, threads=1, options=STATED)
    checked = json.loads((tmp_path / "fit.json").read_text())["uncertainty"]["predictive_p"]
    assert set(checked) == {"zig-zag", "turn"} and set(checked["turn"]) == set(s.noise)
    assert not missed(checked) and not predictive_words(found.fit)
    section = next(x for x in fit_report(found).sections if x.title.startswith("What the standard"))
    assert [row[0] for row in section.blocks[-1].rows] == ["zig-zag", "turn"]


def test_equations_that_miss_the_motion_are_flagged_under_the_stated_noise():
    s, _ = campaign_of(Condition(), 0)
    rng = np.random.default_rng(6)
    wrong = Condition(rows={"Y_r|r|": 40.0, "N_v|v|": -80.0})
    problem = problem_of(s, campaign(s, wrong, s.params.start, rng))
    z = fit(problem, STATED).z
    found = missed(predictive_p(problem, z, coefficient_posterior(problem, z, NoiseParts())))
    assert {"v", "r"} <= set(found["all runs"])
    many = dict.fromkeys(s.noise, 0.0005)
    result = SimpleNamespace(uncertainty={"predictive_p": {"zigzag": many, "turn": {"u": 0.5}}})
    (said,) = predictive_words(result)
    assert f"zigzag: {len(many)} channels" in said and "turn" not in said
