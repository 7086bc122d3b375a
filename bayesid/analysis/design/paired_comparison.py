"""Does a designed manoeuvre deliver: true vehicles run it and its rivals; posteriors are compared in pairs.

Takes a `PlanningCase`, designs and rivals. Gives per true vehicle what each posterior left and how wrong it
was. Virtual trials only; the posterior is Laplace at the refit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.stats import wilcoxon

from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.goals import ContractionGoal, prediction_rows
from bayesid.analysis.design.virtual_refit import Refit, logged, prediction_error, problem_of, refit
from bayesid.errors import ModelError
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre

Array = np.ndarray


class Vehicles(Protocol):
    """True vehicles that execute manoeuvres."""

    def logged(self, par: Array, manoeuvre: Manoeuvre, rng: np.random.Generator, name: str = "") -> RunData:
        """A run as its sensors give it."""

    def missed(self, values: Array, par: Array, manoeuvre: Manoeuvre) -> float:
        """Rms error over sensor noise of a run predicted with the coefficients `values`."""


@dataclass(frozen=True, eq=False)
class SimulatedVehicles:
    """True vehicles by the equations they are identified with."""

    case: PlanningCase

    def logged(self, par: Array, manoeuvre: Manoeuvre, rng: np.random.Generator, name: str = "") -> RunData:
        return logged(self.case.model, par, self.case.execution(manoeuvre, par, name), rng)

    def missed(self, values: Array, par: Array, manoeuvre: Manoeuvre) -> float:
        model, known = self.case.model, self.case.knowledge
        return prediction_error(model, known, values, par, self.case.execution(manoeuvre, par))


@dataclass(frozen=True, eq=False)
class PairedOutcome:
    """Campaigns of the same true vehicles: runs executed before, plus one manoeuvre.

    Attributes
    ----------
    names : (m,) manoeuvres
    left, wrong : (m, s) shrink goal: variance left in the open directions by the posterior, and mean squared
        error made in them, both in units of what was known
    spread, missed : (m, s) predict goal: rms error of the wanted run over sensor noise, as the posterior
        expects it and as made
    converged : share of refits that converged
    """

    names: tuple[str, ...]
    left: Array
    wrong: Array
    spread: Array
    missed: Array
    converged: float


def paired_outcomes(
    case: PlanningCase,
    before: Mapping[str, Manoeuvre],
    manoeuvres: Mapping[str, Manoeuvre],
    goal: ContractionGoal,
    wanted: Manoeuvre,
    truths: Array,
    seed: int,
    watch: Callable[[], None] = lambda: None,
    varied: Callable[[int], Manoeuvre] | None = None,
    vehicles: Vehicles | None = None,
) -> PairedOutcome:
    """Run `before` and each manoeuvre with every true vehicle, and refit.

    Parameters
    ----------
    varied : another manoeuvre for every true vehicle, listed as "random design"
    vehicles : who executes; by default the equations that are fitted, which shares their errors
    """
    true_ones = vehicles or SimulatedVehicles(case)
    names = (*manoeuvres, *(("random design",) if varied else ()))
    shape = (4, len(names), len(truths))
    out, good, count = np.full(shape, np.nan), 0, 0
    for s, par in enumerate(truths):
        rng = np.random.default_rng([seed, s])
        runs = [true_ones.logged(par, m, rng) for m in before.values()]
        target = case.execution(wanted, par)
        rows = prediction_rows(case.model, case.knowledge, par, target.run)
        true = np.linalg.solve(case.knowledge.root, par[case.knowledge.where] - case.knowledge.mean)
        for k, name in enumerate(names):
            chosen = varied(s) if varied is not None and name == "random design" else manoeuvres[name]
            with suppress(ModelError):
                noise = np.random.default_rng([seed, s, 1])  # the same noise for every rival: a paired test
                run = true_ones.logged(par, chosen, noise, name)
                found = refit(problem_of(case.model, case.knowledge, [*runs, run]), case.knowledge)
                good, count = good + found.converged, count + 1
                far = true_ones.missed(found.values, par, wanted)
                out[:, k, s] = (*_figures(case, goal, found, true, rows), far)
            watch()
    left, wrong, spread, missed = out
    return PairedOutcome(names, left, wrong, spread, missed, good / max(count, 1))


def _figures(
    case: PlanningCase,
    goal: ContractionGoal,
    found: Refit,
    true: Array,
    rows: Array,
) -> tuple[float, float, float]:
    xi = np.linalg.solve(case.knowledge.root, found.values - case.knowledge.mean)
    open_ones = goal.space
    left = float(np.mean(np.einsum("im,ij,jm->m", open_ones, found.covariance, open_ones)))
    wrong = float(np.mean((open_ones.T @ (xi - true)) ** 2))
    spread = float(np.sqrt(np.mean(np.einsum("ni,ij,nj->n", rows, found.covariance, rows))))
    return left, wrong, spread


def paired(designed: Array, rival: Array) -> tuple[float, float, float]:
    """Ratio of medians rival over designed, share of pairs the design wins, one-sided Wilcoxon p."""
    keep = np.isfinite(designed) & np.isfinite(rival)
    a, b = designed[keep], rival[keep]
    if a.size < 5 or not np.any(a - b):
        return float("nan"), float("nan"), float("nan")
    p = float(wilcoxon(np.log(a), np.log(b), alternative="less").pvalue)
    return float(np.median(b) / np.median(a)), float(np.mean(a < b)), p
