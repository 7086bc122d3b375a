"""Information of runs under the noise of a campaign: dense covariances, limits, pieces, slow channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesid.analysis.design import PlanningCase, knowledge, library_within, limits, usual_logging
from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.information import columns, planned, run_information, runs_information
from bayesid.analysis.design.planning_case import known_of, trial_case
from bayesid.api.planning import reference_scale
from bayesid.equations.model import build_model
from bayesid.estimation.likelihood import NoiseParts
from bayesid.estimation.likelihood.mixed_rates import ChannelGroup, MixedRateNoise
from bayesid.estimation.likelihood.residual_noise import ResidualNoise
from bayesid.manoeuvres import parse
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial

MODEL = build_model(load_vehicle("generic_sub"), 3)
KNOWN = knowledge(MODEL, ["N_v", "N_r", "N_dr", "Y_v"])
CASE = PlanningCase(MODEL, KNOWN, usual_logging(MODEL), limits(MODEL, duration=300.0))
TURN = CASE.execution(library_within(MODEL, CASE.bounds)["zigzag_20"], name="zigzag").run
K = len(KNOWN.names)
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
