"""Information of runs under the noise of a campaign: dense covariances, limits, pieces, slow channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.design import PlanningCase, knowledge, library_within, limits, usual_logging
from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.executed_runs import campaign_noise, with_form
from bayesid.analysis.design.goals import PredictionGoal
from bayesid.analysis.design.information import columns, planned, run_information, runs_information
from bayesid.analysis.design.planning_case import known_of, trial_case
from bayesid.analysis.design.virtual_refit import refitted
from bayesid.api.excite import fisher_shares, shares_at_fit, shares_under_noise
from bayesid.api.identify import identify
from bayesid.api.inputs import vehicle_of
from bayesid.api.planning import reference_scale
from bayesid.equations.model import build_model
from bayesid.errors import FitError
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.mixed_rates import ChannelGroup, MixedRateNoise
from bayesid.estimation.likelihood.model_form import form_rows
from bayesid.estimation.likelihood.residual_noise import ResidualNoise
from bayesid.estimation.output_error import FitProblem, load_fit
from bayesid.estimation.trial_fit import fit_trial
from bayesid.manoeuvres import parse
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial

MODEL = build_model(load_vehicle("generic_sub"), 3)
KNOWN = knowledge(MODEL, ["N_v", "N_r", "N_dr", "Y_v"])
CASE = PlanningCase(MODEL, KNOWN, usual_logging(MODEL), limits(MODEL, duration=300.0))
TURN = CASE.execution(library_within(MODEL, CASE.bounds)["zigzag_20"], name="zigzag").run
K = len(KNOWN.names)
STATED = build_model(vehicle_of("generic_sub", None, 0.1), 3)  # with a prior sd of 10 %
MEMORY = 0.8


def campaign(memory: float = 0.0, excess: float = 1.0, run_spread: float = 0.0, **changes) -> CampaignNoise:
    """Noise of the same memory in every channel, unit variance, at the readings of the run above."""
    c = len(TURN.channels)
    coefficients = np.eye(c)[None] * memory if memory else np.zeros((0, c, c))
    lags = np.array([np.eye(c) * memory**h for h in range(len(coefficients) + 1)])
    group = ChannelGroup(tuple(range(c)), True, ResidualNoise(lags, coefficients), 1000, 500)
    dt = float(np.median(np.diff(TURN.plan.t)))
    made = CampaignNoise(
        NoiseParts(len(coefficients), excess, run_spread), MixedRateNoise((group,)), TURN.channels, {}, dt,
        np.eye(K),
    )  # fmt: skip
    return replace(made, **changes)


def of(noise: CampaignNoise | None, *runs) -> np.ndarray:
    return runs_information(MODEL, KNOWN, MODEL.nominal, runs or [TURN], noise)


def test_white_noise_gives_the_information_of_white_noise() -> None:
    white = run_information(MODEL, KNOWN, MODEL.nominal, TURN)
    assert np.array_equal(of(None), white)
    assert np.allclose(of(campaign()), white, rtol=1e-7, atol=1e-7 * np.trace(white))


def test_memory_gives_the_information_of_the_dense_covariance() -> None:
    """Least squares under noise with memory: error (H^-1 B H^-1), B with the dense covariance in time."""
    run = replace(TURN, initial_sd=1e-9 * TURN.initial_sd)  # its start is known
    slopes = columns(MODEL, KNOWN, MODEL.nominal, run)[0]
    n = len(slopes)
    correlation = MEMORY ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    h = np.einsum("nck,ncl->kl", slopes, slopes)
    b = np.einsum("nck,nm,mcl->kl", slopes, correlation, slopes, optimize=True)
    expected = h @ np.linalg.solve(b, h)
    found = of(campaign(MEMORY), run)
    assert np.allclose(found, expected, rtol=1e-6, atol=1e-8 * np.trace(expected))
    assert np.trace(found) < 0.5 * np.trace(h)


def test_one_run_never_tells_more_than_how_runs_differ() -> None:
    t = 0.3
    found = of(campaign(run_spread=t))
    assert np.linalg.eigvalsh(found).max() <= 1.0 / t**2 * (1 + 1e-9)
    assert np.linalg.eigvalsh(of(campaign())).max() > 10.0 / t**2
    two = of(campaign(run_spread=t), TURN, replace(TURN, name="another"))
    assert np.allclose(two, 2.0 * found, rtol=1e-9)


def test_pieces_of_a_run_are_one_run() -> None:
    t = 0.3
    pieces = [replace(TURN, name=f"zigzag {i}/2") for i in (1, 2)]
    other = replace(TURN, name="turn 1/2")
    cut = of(campaign(run_spread=t), *pieces, other)
    assert np.linalg.eigvalsh(cut).max() <= 2.0 / t**2 * (1 + 1e-9)
    named_apart = of(campaign(run_spread=t), TURN, replace(TURN, name="again"), other)
    assert np.linalg.eigvalsh(named_apart).max() > 2.5 / t**2


def test_readings_twice_as_dense_add_little_where_they_remember() -> None:
    rarely = planned(
        MODEL, MODEL.nominal, library_within(MODEL, CASE.bounds)["zigzag_20"],
        replace(CASE.logging, dt=2 * CASE.logging.dt),
    ).run  # fmt: skip
    remembered = of(campaign(0.98)), of(campaign(0.98), rarely)
    white = of(campaign()), of(campaign(), rarely)
    assert np.trace(remembered[0]) / np.trace(remembered[1]) < 1.15
    assert np.trace(white[0]) / np.trace(white[1]) == pytest.approx(2.0, rel=0.1)


def test_lags_between_samples_lie_on_a_line_and_every_second_lag_is_exact() -> None:
    noise = campaign(MEMORY).noise.groups[0].noise
    assert np.allclose(noise.at_step(20, 2.0), noise.covariance(40)[::2])
    assert np.allclose(noise.at_step(3, 0.5)[1], 0.5 * (noise.covariance(2)[0] + noise.covariance(2)[1]))


def test_a_channel_read_slowly_stays_slow_in_a_run_to_come() -> None:
    slow = campaign(every={"x": 5, "y": 5})
    dt = float(np.median(np.diff(TURN.plan.t)))
    run = slow.as_logged(TURN, dt)
    read = {c: run.valid[:, j].sum() for j, c in enumerate(run.channels)}
    assert read["x"] == read["y"] == -(-len(run.valid) // 5)
    assert read["psi"] == len(run.valid)
    half = slow.as_logged(TURN, 2.5 * dt)
    assert half.valid[:, half.channels.index("x")].sum() == -(-len(run.valid) // 2)


@pytest.fixture(scope="module")
def flown():
    """Runs of the nominal vehicle with white noise as stated."""
    scale = 4.0
    texts = ["zigzag:10/10", "zigzag:20/20", "zigzag:5/5", "zigzag:15/15"]
    coarse = replace(reference_scale(MODEL), dt=scale)
    runs = {t: parse(t, coarse) for t in texts}
    return virtual_trial(
        MODEL, MODEL.nominal, runs, title="flown", vehicle_ref="generic_sub", noise=CASE.logging.sigma,
        rng=np.random.default_rng(3),
    )  # fmt: skip


def errs_together(trial, memory: float, seed: int):
    """The trial with noise of the same variance that remembers in place of its own."""
    rng = np.random.default_rng(seed)
    runs = []
    for run in trial.runs:
        channels = {}
        for name, values in run.data.items():
            e = rng.standard_normal(len(values))
            for i in range(1, len(e)):
                e[i] = memory * e[i - 1] + np.sqrt(1 - memory**2) * e[i]
            channels[name] = (
                values + 3.0 * CASE.logging.sigma[name] * e if name in CASE.logging.sigma else values
            )
        runs.append(replace(run, data=channels))
    return replace(trial, runs=tuple(runs))


def test_a_campaign_with_white_noise_is_planned_with_white_noise(flown) -> None:
    made = trial_case(MODEL, flown, known_of(MODEL), CASE.bounds)
    assert made.case.noise is None
    assert any("white sensor noise" in note for note in made.notes)


def test_a_campaign_whose_readings_err_together_promises_less(flown) -> None:
    made = trial_case(MODEL, errs_together(flown, 0.95, 5), known_of(MODEL), CASE.bounds)
    case = made.case
    assert case.noise is not None
    assert case.noise.noise.order >= 1
    nominal = MODEL.nominal[None]
    turn = library_within(MODEL, case.bounds)["turn"]
    found = case.of(turn, nominal).matrices[0]
    white = replace(case, noise=None).of(turn, nominal).matrices[0]
    # noise of three times the stated sd whose correlation time is about 39 samples
    assert np.trace(found) < 0.1 * np.trace(white)
    assert np.trace(case.now(nominal).matrices[0]) < 0.1 * np.trace(
        replace(case, noise=None).now(nominal).matrices[0]
    )


def test_errors_of_a_virtual_run_have_the_memory_of_the_campaign() -> None:
    """Variance 1, correlation 0.8 per sample, none between channels; half a step apart its root."""
    rng = np.random.default_rng(0)
    noise, dt = campaign(MEMORY, excess=4.0), float(np.median(np.diff(TURN.plan.t)))
    drawn = np.stack([noise.errors(TURN, dt, rng) for _ in range(60)]) / 2.0
    assert np.mean(drawn**2) == pytest.approx(1.0, abs=0.05)
    assert np.mean(drawn[:, 1:] * drawn[:, :-1]) == pytest.approx(MEMORY, abs=0.05)
    assert np.mean(drawn[:, 3:] * drawn[:, :-3]) == pytest.approx(MEMORY**3, abs=0.05)
    assert abs(np.mean(drawn[:, :, 0] * drawn[:, :, 1])) < 0.05
    double = np.stack([noise.errors(TURN, 2 * dt, rng) for _ in range(60)]) / 2.0
    assert np.mean(double[:, 1:] * double[:, :-1]) == pytest.approx(MEMORY**2, abs=0.05)


def test_a_virtual_refit_under_the_noise_of_a_campaign_errs_as_it_says() -> None:
    manoeuvre = library_within(MODEL, CASE.bounds)["zigzag_20"]
    noise = campaign(0.95, run_spread=0.2)
    noise = replace(noise, parts=replace(noise.parts, share=0.1, weight=0.1))
    errors, claimed = [], []
    for seed, par in enumerate(KNOWN.draws(MODEL, np.random.default_rng(1), 30)):
        found = refitted(MODEL, KNOWN, [CASE.execution(manoeuvre, par)], par, seed, noise)
        errors.append(np.linalg.solve(KNOWN.root, found.values - par[KNOWN.where]))
        claimed.append(np.trace(found.covariance))
    made = float(np.mean(np.sum(np.square(errors), axis=1)))
    assert 0.5 < made / np.mean(claimed) < 1.6
    white = refitted(MODEL, KNOWN, [CASE.execution(manoeuvre)], MODEL.nominal, 0)
    assert np.trace(white.covariance) < 0.6 * np.mean(claimed)


def test_spread_between_runs_stays_in_what_is_promised_of_another_run() -> None:
    """However much is executed, the coefficients of the run to come differ from the vehicle's."""
    noise = campaign(run_spread=0.3)
    assert np.allclose(noise.scatter, 0.09 * np.eye(K))
    rows = np.ones((1, 1, K)) / np.sqrt(K)
    known = np.eye(K)[None] * 1e12
    assert PredictionGoal(rows, "turn", scatter=noise.scatter).shown(known) == pytest.approx(0.3)
    assert PredictionGoal(rows, "turn").shown(known) == pytest.approx(0.0, abs=1e-5)


@pytest.fixture(scope="module")
def fitted(flown, tmp_path_factory):
    """A fit of the runs whose readings err together, and its folder."""
    trial = errs_together(flown, 0.95, 5)
    out = tmp_path_factory.mktemp("fit")
    return trial, out, fit_trial(trial, STATED.vehicle, out, free=KNOWN.names)


@pytest.mark.thorough
def test_a_plan_by_a_fit_has_the_posterior_of_the_fit(fitted) -> None:
    trial, out, found = fitted
    made = trial_case(STATED, trial, known_of(STATED), CASE.bounds, earlier=load_fit(out / "fit.json"))
    assert not found.posterior.parts.white
    assert made.case.noise is not None
    assert made.case.noise.parts == found.posterior.parts
    drawn = made.case.drawn_from
    if found.posterior.final:
        assert drawn.names == found.posterior.names
        assert np.allclose(drawn.mean, found.posterior.estimate)
    problem = FitProblem(STATED, made.case.knowledge.parameters(), made.case.executed, STATED.nominal)
    posterior, _ = campaign_noise(
        problem, found.fit.z, made.case.knowledge, made.case.noise.dt, found.posterior.parts
    )
    assert np.allclose(posterior.sd, found.posterior.sd, rtol=1e-3)


def test_a_fit_of_other_runs_is_refused(fitted, flown) -> None:
    trial, out, _ = fitted
    other = replace(trial, runs=tuple(replace(r, name=f"other {r.name}") for r in trial.runs))
    with pytest.raises(FitError, match=r"the fit is of .* the runs here are other"):
        trial_case(MODEL, other, known_of(MODEL), CASE.bounds, earlier=load_fit(out / "fit.json"))


def test_a_model_form_is_planned_with(flown) -> None:
    """Its rows are unknown beside the coefficients, of which a run then tells less."""
    known = known_of(MODEL)
    wide = with_form(known, MODEL, 1e-3)
    assert set(wide.names) - set(known.names) == set(form_rows(MODEL))
    draws = MODEL.nominal[None]
    turn = library_within(MODEL, CASE.bounds)["zigzag_20"]
    plain, formed = replace(CASE, knowledge=known), replace(CASE, knowledge=wide)
    k = len(known.names)
    left = np.linalg.inv(formed.of(turn, draws).matrices[0] + np.eye(len(wide.names)))[:k, :k]
    before = np.linalg.inv(plain.of(turn, draws).matrices[0] + np.eye(k))
    assert np.linalg.eigvalsh(left - before).min() > -1e-6
    assert np.trace(left) > 1.2 * np.trace(before)


def test_excite_has_the_shares_of_identify_at_a_fit(fitted) -> None:
    trial, out, _ = fitted
    seen, _ = shares_at_fit(STATED, trial, load_fit(out / "fit.json"))
    known = identify(trial, STATED.vehicle, fitted=out, profile=False).found
    assert {n: share for n, (share, _) in seen.items()} == pytest.approx(
        {row.name: row.index for row in known.entries}, abs=1e-9
    )


@pytest.mark.thorough
def test_runs_that_err_together_have_a_smaller_share_in_excite(flown) -> None:
    """White runs have that of white noise to the digit."""
    white = fisher_shares(STATED, flown)
    assert shares_under_noise(STATED, flown) == (white, [])
    less, notes = shares_under_noise(STATED, errs_together(flown, 0.95, 5))
    assert "% of the information of white noise" in notes[0]
    assert np.mean([v for v, _ in less.values()]) < 0.8 * np.mean([v for v, _ in white.values()])
