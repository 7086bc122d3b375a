"""Manoeuvres side by side: what each reveals, what it adds to those executed, what it lets one predict.

Takes a `PlanningCase` (vehicle, knowledge, logger, limits) and drawn vehicles. Gives frozen tables. Does not
choose or draw pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import spearmanr

from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.criteria import Criteria, criteria, gain, posterior
from bayesid.analysis.design.goals import prediction_rows
from bayesid.analysis.design.information import (
    Logging,
    PlannedRun,
    RunInformation,
    executed_information,
    information,
    nothing,
    planned,
)
from bayesid.analysis.design.limits import OrderLimits, allowed_manoeuvres, library_within, within_limits
from bayesid.analysis.design.prior_knowledge import Knowledge, controllable
from bayesid.analysis.design.virtual_refit import Refit, prediction_error, refitted
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre, straight
from bayesid.simulation import sensitivities

Array = np.ndarray
MOST_GROWTH = 1e5  # growth of a disturbance beyond which orders without feedback make no prediction
Watch = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class PlanningCase:
    """A vehicle before its next run.

    executed : runs already logged, as a fit reads them
    drawn_from : where vehicles are drawn from, the knowledge itself by default; the posterior of the runs
    noise : of the runs executed, taken for that of the next; white as stated by default
    """

    model: Model
    knowledge: Knowledge
    logging: Logging
    bounds: OrderLimits
    executed: tuple[RunData, ...] = ()
    drawn_from: Knowledge | None = None
    noise: CampaignNoise | None = None

    def draws(self, rng: np.random.Generator, count: int) -> Array:
        """(<= count, n) vehicles as the knowledge allows, those that cannot turn left out."""
        found = (self.drawn_from or self.knowledge).draws(self.model, rng, count)
        return controllable(
            self.model, found, (allowed_manoeuvres(self.model, d, self.bounds) for d in found)
        )

    def now(self, draws: Array) -> RunInformation:
        """Information of the runs flown."""
        if not self.executed:
            return nothing(self.knowledge, len(draws))
        return executed_information(self.model, self.knowledge, draws, self.executed, noise=self.noise)

    def of(self, manoeuvre: Manoeuvre, draws: Array, name: str = "") -> RunInformation:
        """Information of a manoeuvre."""
        return information(self.model, self.knowledge, draws, manoeuvre, self.logging, name, self.noise)

    def execution(self, manoeuvre: Manoeuvre, par: Array | None = None, name: str = "") -> PlannedRun:
        """The manoeuvre executed by one vehicle, the nominal one by default."""
        return planned(self.model, self.model.nominal if par is None else par, manoeuvre, self.logging, name)

    def growth(self, execution: PlannedRun) -> float:
        """How many times a yaw rate at the start comes back as heading per length travelled."""
        nobody = np.zeros(0, dtype=np.int64)
        start = sensitivities(
            self.model, self.model.nominal, execution.run.plan, execution.run.x0, nobody
        ).jacobian
        psi, r = (self.model.states.index(n) for n in ("psi", "r"))
        return float(np.max(np.abs(start[:, psi, r]))) * self.model.scales["U"] / self.model.scales["L"]

    @property
    def scatter(self) -> Array | float:
        """(k, k) covariance by which the coefficients of a single run differ from the vehicle's, in units of
        what is known; 0 where none was seen."""
        return 0.0 if self.noise is None else self.noise.scatter

    @cached_property
    def steady(self) -> bool:
        """Whether the nominal vehicle keeps straight without a hand on the rudder for the whole duration."""
        run = straight(self.bounds.usual, self.bounds.duration, self.bounds.dt)
        return self.growth(self.execution(run)) <= MOST_GROWTH

    def allowed(self) -> tuple[dict[str, Manoeuvre], dict[str, str]]:
        """Library manoeuvres of the right duration within the limits, and why the others are not."""
        fit, refused = {}, {}
        for name, manoeuvre in library_within(self.model, self.bounds).items():
            try:
                execution = self.execution(manoeuvre)
            except ModelError as exc:
                refused[name] = str(exc)
                continue
            why = within_limits(self.bounds, execution.track, execution.commands)
            grown = self.growth(execution)
            if grown > MOST_GROWTH:
                why = f"the vehicle is unstable: a disturbance at the start grows {grown:.0e}-fold"
            if why:
                refused[name] = why
            else:
                fit[name] = manoeuvre
        return fit, refused


@dataclass(frozen=True, eq=False)
class Richness:
    """What every manoeuvre reveals.

    Attributes
    ----------
    criteria : one per manoeuvre, richest (largest gain) first
    added : gain [nats] on top of the runs executed, in the same order
    now : of the runs executed
    """

    criteria: tuple[Criteria, ...]
    added: Array
    now: Criteria

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.criteria)

    def contraction(self) -> Array:
        """(m, k) expected contraction."""
        return np.array([c.contraction for c in self.criteria])


def richness(
    case: PlanningCase,
    manoeuvres: Mapping[str, Manoeuvre],
    draws: Array,
    watch: Watch = lambda name: None,
    now: RunInformation | None = None,
) -> tuple[Richness, dict[str, RunInformation]]:
    """Criteria of every manoeuvre; those a drawn vehicle cannot fly are left out.

    `now` is the information of the runs executed, where the caller has it already.
    """
    now = case.now(draws) if now is None else now
    infos: dict[str, RunInformation] = {}
    for name, manoeuvre in manoeuvres.items():
        with suppress(ModelError):
            infos[name] = case.of(manoeuvre, draws, name)
        watch(name)
    found = sorted((criteria(case.knowledge, i) for i in infos.values()), key=lambda c: -c.gain)
    base = gain(now.matrices)
    added = np.array([np.mean(gain(now.matrices + infos[c.name].matrices) - base) for c in found])
    return Richness(tuple(found), added, criteria(case.knowledge, now)), infos


@dataclass(frozen=True, eq=False)
class Crossing:
    """Identify on the row, predict the column; rms error over sensor noise.

    Attributes
    ----------
    names : (m,)
    predicted : (m, m) from information alone, over the drawn vehicles
    actual : (m, m) of refits of virtual trials, root mean square over true vehicles; nan where none was made
    prior : (m,) predicted error with nothing executed
    """

    names: tuple[str, ...]
    predicted: Array
    actual: Array
    prior: Array

    def others(self, table: Array) -> Array:
        """(m,) log-mean error of a row over all columns but its own."""
        with np.errstate(divide="ignore"):
            logs = np.log(np.maximum(table, 1e-12))
        np.fill_diagonal(logs, np.nan)
        return np.exp(np.nanmean(logs, axis=1))


def crossing(
    case: PlanningCase, manoeuvres: Mapping[str, Manoeuvre], infos: Mapping[str, RunInformation], draws: Array
) -> Crossing:
    """Predicted part of the table; `actual` is filled by `refit_crossing`."""
    names = tuple(infos)
    rows = {
        name: np.array(
            [
                prediction_rows(case.model, case.knowledge, par, case.execution(manoeuvres[name], par).run)
                for par in draws
            ]
        )
        for name in names
    }
    table = np.empty((len(names), len(names)))
    for i, row in enumerate(names):
        left = posterior(infos[row].matrices) + case.scatter
        for j, column in enumerate(names):
            table[i, j] = _rms(rows[column], left)
    prior = np.array([np.sqrt(np.mean(np.sum(rows[n] ** 2, axis=2))) for n in names])
    return Crossing(names, table, np.full_like(table, np.nan), prior)


def _rms(rows: Array, left: Array) -> float:
    return float(np.sqrt(np.mean(np.einsum("dni,dij,dnj->dn", rows, left, rows, optimize=True))))


@dataclass(frozen=True, eq=False)
class VirtualRefits:
    """Refits of one true vehicle, one per manoeuvre."""

    par: Array
    executions: Mapping[str, PlannedRun]
    refits: Mapping[str, Refit]


def refit_all(
    case: PlanningCase,
    manoeuvres: Mapping[str, Manoeuvre],
    par: Array,
    seed: int,
    watch: Watch = lambda name: None,
) -> VirtualRefits:
    """Every manoeuvre executed by one true vehicle, logged with noise and refitted on its own."""
    executions, refits = {}, {}
    for k, (name, manoeuvre) in enumerate(manoeuvres.items()):
        with suppress(ModelError):
            executions[name] = case.execution(manoeuvre, par, name)
            refits[name] = refitted(
                case.model, case.knowledge, [executions[name]], par, seed * 1000 + k, case.noise
            )
        watch(name)
    return VirtualRefits(par, executions, refits)


def refit_crossing(case: PlanningCase, table: Crossing, trials: Sequence[VirtualRefits]) -> Crossing:
    """The table with the errors that refits really make."""
    total = np.zeros_like(table.predicted)
    count = np.zeros_like(total)
    for trial in trials:
        for i, row in enumerate(table.names):
            for j, column in enumerate(table.names):
                if row in trial.refits and column in trial.executions:
                    error = prediction_error(
                        case.model,
                        case.knowledge,
                        trial.refits[row].values,
                        trial.par,
                        trial.executions[column],
                    )
                    total[i, j] += error**2
                    count[i, j] += 1
    actual = np.sqrt(np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0))
    return Crossing(table.names, table.predicted, actual, table.prior)


def rank_correlation(a: Array, b: Array) -> float:
    """Spearman's rank correlation of two arrays where both are finite; nan if one of them does not vary."""
    x, y = np.ravel(a), np.ravel(b)
    keep = np.isfinite(x) & np.isfinite(y)
    if keep.sum() < 3 or np.ptp(x[keep]) == 0 or np.ptp(y[keep]) == 0:
        return float("nan")
    return float(spearmanr(x[keep], y[keep]).statistic)
