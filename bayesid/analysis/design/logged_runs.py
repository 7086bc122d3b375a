"""Richness of runs that were really executed: what each tells, and how well it, fitted alone, predicts
others.

Takes logged runs, in pieces where the vehicle is unstable, and `Knowledge`. Weights come from what the model
misses in a fit of all runs, since with logs the model, not the sensor, is the limit. Gives frozen tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.criteria import gain, posterior
from bayesid.analysis.design.goals import prediction_rows
from bayesid.analysis.design.information import columns, run_information
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.analysis.design.virtual_refit import Refit, refit
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.estimation.output_error.residual_correlation import memory
from bayesid.estimation.run_data import RunData
from bayesid.simulation import TimePlan, simulate

Array = np.ndarray
MOST_ERROR = 100.0  # an error counted for a prediction that diverges
START_LENGTHS = 3.0  # the start of a predicted piece is read from so many L/U
Runs = Mapping[str, Sequence[RunData]]


@dataclass(frozen=True, eq=False)
class Level:
    """How far a fit of all runs stays from them.

    rms : channel -> rms residual [SI]
    sigma : the same times the root of its correlation time [samples]: the weight that keeps readings from
        counting more than once
    starts : run -> fitted initial state of each piece
    """

    rms: Mapping[str, float]
    sigma: Mapping[str, float]
    fit: Refit
    starts: Mapping[str, Sequence[Array]]


def level(model: Model, known: Knowledge, base: Array, runs: Runs, rounds: int = 4) -> Level:
    """Weights from the residuals of a fit of all runs together, found in a few rounds.

    Raises
    ------
    ModelError
        if the vehicle diverges with the coefficients it starts from
    """
    every = [piece for pieces in runs.values() for piece in pieces]
    channels = tuple(dict.fromkeys(c for run in every for c in run.channels))
    sigma: dict[str, float] = {}
    for c in channels:
        seen = np.concatenate([r.readings[:, r.channels.index(c)] for r in every if c in r.channels])
        sigma[c] = float(np.nanstd(seen))
    for _ in range(rounds):
        problem = FitProblem(model, known.parameters(), tuple(r.with_sigma(sigma) for r in every), base)
        found = refit(problem, known, iterations=20)
        rms, weights = _residuals(problem, found, channels)
        sigma = weights
    starts = iter(problem.split(found.unknowns)[1])
    return Level(rms, sigma, found, {n: [next(starts) for _ in pieces] for n, pieces in runs.items()})


def _residuals(
    problem: FitProblem, found: Refit, channels: Sequence[str]
) -> tuple[dict[str, float], dict[str, float]]:
    values: dict[str, list[Array]] = {c: [] for c in channels}
    for run, simulated in zip(problem.runs, problem.readings(found.unknowns), strict=True):
        resid = run.residuals(simulated.copy()) * run.sigma
        for j, c in enumerate(run.channels):
            values[c].append(resid[np.isfinite(run.readings[:, j]), j])
    rms = {c: float(np.sqrt(np.mean(np.concatenate(v) ** 2))) for c, v in values.items()}
    return rms, {c: rms[c] * float(np.sqrt(np.mean([memory(x) for x in values[c]]))) for c in channels}


@dataclass(frozen=True, eq=False)
class LogCrossing:
    """Each run fitted alone, every other predicted from its first readings.

    Attributes
    ----------
    names : (m,) runs
    gains : (m,) information gain of each [nats]
    predicted : (m, m) expected error over the level of the joint fit: 1 is what the model misses anyway
    actual : (m, m) the errors made; inf where the vehicle diverges
    before : (m,) errors with the coefficients one starts from
    joint : (m,) errors of the fit of all runs
    """

    names: tuple[str, ...]
    gains: Array
    predicted: Array
    actual: Array
    before: Array
    joint: Array

    @property
    def excess(self) -> Array:
        """(m, m) errors made over those of the joint fit in the same column, divergence as `MOST_ERROR`."""
        return np.minimum(self.actual / self.joint, MOST_ERROR)

    def others(self, table: Array) -> Array:
        """(m,) geometric mean over the columns but a row's own."""
        logs = np.log(np.clip(table, 1e-12, MOST_ERROR))
        np.fill_diagonal(logs, np.nan)
        return np.exp(np.nanmean(logs, axis=1))


def cross_logs(
    model: Model,
    known: Knowledge,
    base: Array,
    runs: Runs,
    weights: Level,
    watch: Callable[[str], None] = lambda name: None,
) -> LogCrossing:
    """Richness and cross prediction of logged runs; information is taken at the fit of all of them."""
    names = tuple(runs)
    joint = np.array(base)
    joint[known.where] = weights.fit.values
    begun = {n: [replace(r, x0=x) for r, x in zip(runs[n], weights.starts[n], strict=True)] for n in names}
    weighed = {n: [r.with_sigma(weights.sigma) for r in runs[n]] for n in names}
    matrices, rows = {}, {}
    for n in names:
        inside = [r.with_sigma(weights.sigma) for r in begun[n]]
        matrices[n] = np.sum([run_information(model, known, joint, r) for r in inside], axis=0)
        plain = [r.with_sigma(weights.rms) for r in begun[n]]
        rows[n] = np.concatenate([prediction_rows(model, known, joint, r) for r in plain])
    m = len(names)
    predicted, actual = np.full((m, m), np.nan), np.full((m, m), np.nan)
    for i, row in enumerate(names):
        left = posterior(matrices[row])
        values = None
        try:
            problem = FitProblem(model, known.parameters(), tuple(weighed[row]), base)
            values = refit(problem, known).values
        except ModelError:
            pass
        for j, column in enumerate(names):
            variance = np.mean(np.einsum("ni,ij,nj->n", rows[column], left, rows[column]))
            predicted[i, j] = np.sqrt(1.0 + variance)
            if values is not None:
                actual[i, j] = error(model, known, base, values, runs[column], weights.rms)
        watch(row)
    before, together = (
        np.array([error(model, known, base, v, runs[n], weights.rms) for n in names])
        for v in (known.mean, weights.fit.values)
    )
    gains = np.array([float(gain(matrices[n])) for n in names])
    return LogCrossing(names, gains, predicted, actual, before, together)


def error(
    model: Model,
    known: Knowledge,
    base: Array,
    values: Array,
    run: Sequence[RunData],
    rms: Mapping[str, float],
) -> float:
    """Rms over all pieces, channels and samples after the head, in units of `rms`; inf if it diverges."""
    par = np.array(base)
    par[known.where] = values
    total, count = 0.0, 0
    for piece in run:
        weighed = piece.with_sigma(rms)
        try:
            x0, until = _start(model, known, par, weighed)
            states = simulate(model, par, weighed.plan, x0).states
        except ModelError:
            return float("inf")
        resid = weighed.residuals(states[:, [model.states.index(c) for c in weighed.channels]])
        kept = np.isfinite(weighed.readings) & (np.arange(len(resid)) > until)[:, None]
        total += float(np.sum(resid[kept] ** 2))
        count += int(kept.sum())
    return float(np.sqrt(total / max(count, 1)))


def _start(model: Model, known: Knowledge, par: Array, run: RunData) -> tuple[Array, int]:
    """Initial state from the head of a piece, Gauss-Newton, and the last sample used."""
    head = START_LENGTHS * model.scales["L"] / model.scales["U"]
    until = max(int(np.searchsorted(run.plan.t, run.plan.t[0] + head)), 10)
    until = min(until, run.plan.t.size // 2)
    plan = _cut(run.plan, until + 1)
    short = replace(run, plan=plan, readings=run.readings[: until + 1])
    x0 = np.array(run.x0, dtype=float)
    for _ in range(3):
        here = replace(short, x0=x0)
        _, slopes = columns(model, known, par, here)
        states = simulate(model, par, plan, x0).states
        resid = here.residuals(states[:, [model.states.index(c) for c in here.channels]]).ravel()
        a = np.vstack([slopes.reshape(-1, slopes.shape[2]), np.eye(slopes.shape[2])])
        pull = np.concatenate([resid, (x0 - run.x0) / run.initial_sd])
        x0 = x0 - np.linalg.lstsq(a, pull, rcond=None)[0] * run.initial_sd
    return x0, until


def _cut(plan: TimePlan, samples: int) -> TimePlan:
    """The plan up to a sample."""
    steps = int(plan.record[samples - 1])
    return replace(
        plan, t=plan.t[:samples], record=plan.record[:samples], times=plan.times[:steps],
        steps=plan.steps[:steps], command=plan.command[:steps], exogenous=plan.exogenous[:steps],
    )  # fmt: skip
