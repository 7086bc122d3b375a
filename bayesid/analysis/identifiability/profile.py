"""Profile likelihood: hold one parameter away from the best point, fit all others again, see what objects.

Takes a `FitProblem` and `Information`. A bounded number of small refits, each written as it is done. Reports
how much of the resistance came from data and how much from the prior, and, refitted without any prior, the
profile likelihood itself. Does not search for a best point.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.identifiability.information import Information
from bayesid.errors import FitError, ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.files import read_lines, write_atomic
from bayesid.model.params import ParameterSet

Array = np.ndarray
OFFSETS = (-2.0, -1.0, 1.0, 2.0)  # in posterior sds
ITERATIONS = 12
LEAST_COST_STEP = 1e-4  # a refit is done when a step would lower the cost by less than this
NORMAL_95 = 1.6449
FLAT = 1e-3  # rise up to which nothing resists; a normal profile has 2 at two posterior sd
SAME_COST = 1e-6  # share by which a cost computed again may differ: other processors round otherwise


@dataclass(frozen=True, eq=False)
class Profile:
    """What happened when one parameter was moved and the others refitted.

    Attributes
    ----------
    offsets : (m,) how far it was held from its value [posterior sd of Laplace]
    rise : (m,) rise of the cost (half of chi-square, prior included); 0.5, 2 for a normal posterior
    data_rise : (m,) the part of it that is misfit of the data
    moved : (m, k) change of all parameters [prior sd]
    likelihood : (m,) rise where no parameter has a prior: the profile likelihood; nan where not asked
    evaluations : Jacobians computed
    """

    name: str
    offsets: Array
    rise: Array
    data_rise: Array
    moved: Array
    likelihood: Array
    evaluations: int

    @property
    def data_share(self) -> float:
        """Share of the data in what resists, at the farthest points; nan where nothing did."""
        far = np.abs(self.offsets) >= np.nanmax(np.abs(self.offsets)) - 1e-9
        total = float(np.nansum(self.rise[far]))
        return float(np.clip(np.nansum(self.data_rise[far]) / total, 0.0, 1.0)) if total > 0 else np.nan

    @property
    def path(self) -> Array:
        """(k,) way from the lowest to the highest offset [prior sd], unit length."""
        good = np.flatnonzero(np.isfinite(self.rise))
        way = self.moved[good[-1]] - self.moved[good[0]]
        return way / max(float(np.linalg.norm(way)), 1e-300)

    def interval(self) -> tuple[float, float]:
        """Offsets [posterior sd] where the profile is as high as a 90 % interval has it; +-1.645 if normal.

        Linear in the square root of the rise, extended beyond the outer points.
        """
        return self._interval(self.rise)

    def data_interval(self) -> tuple[float, float]:
        """The same of the profile likelihood, no prior asked; inf on a side where nothing resists."""
        return self._interval(np.where(self.likelihood < FLAT, 0.0, self.likelihood))

    def _interval(self, rise: Array) -> tuple[float, float]:
        offsets, root = self.offsets, np.sqrt(np.maximum(2 * rise, 0.0))
        ends = []
        for side in (-1.0, 1.0):
            picked = (side * offsets > 0) & np.isfinite(root)
            x = np.concatenate([[0.0], np.sort(side * offsets[picked])])
            y = np.concatenate([[0.0], root[picked][np.argsort(side * offsets[picked])]])
            if x.size < 2:
                ends.append(side * np.nan)
                continue
            i = min(int(np.searchsorted(y, NORMAL_95)), x.size - 1)
            slope = (y[i] - y[i - 1]) / (x[i] - x[i - 1])
            ends.append(side * (x[i - 1] + (NORMAL_95 - y[i - 1]) / slope if slope > 0 else np.inf))
        return ends[0], ends[1]


def profiles(
    problem: FitProblem,
    info: Information,
    z: Array,
    names: Sequence[str] | None = None,
    offsets: Sequence[float] = OFFSETS,
    log: Path | str | None = None,
    step: Callable[[], None] | None = None,
    likelihood: bool = True,
) -> tuple[Profile, ...]:
    """Profiles of some parameters, `len(offsets)` refits each, and two more for the profile likelihood.

    Parameters
    ----------
    problem, info, z : with priors for all parameters, and its information at the best point `z` (all
        unknowns)
    log : JSON lines, one per refit; refits found there are not done again where their cost, computed again,
        is the one they tell
    step : called after every offset
    likelihood : whether the outermost offsets are refitted without any prior too

    Raises
    ------
    FitError
        the log cannot be written
    """
    store = _Store(log, f"{problem.digest} {np.asarray(offsets).tolist()} {z.tolist()}")
    start = problem.cost(z)
    free = problem.with_params(without_priors(problem.params))
    free_start = free.cost(z)
    free_store = _Store(log, f"{free.digest} no prior {np.asarray(offsets).tolist()} {z.tolist()}")
    found = []
    for name in names or info.names:
        lines = []
        for offset in offsets:
            line = store.get(name, offset)
            if line is None or not _holds(problem, start, line):
                line = _refit(problem, info, z, info.names.index(name), offset, start)
                store.put(name, offset, line)
            lines.append(line)
            if step is not None:
                step()
        bare = np.full(len(lines), np.nan)
        for i, offset in enumerate(offsets if likelihood else ()):
            if abs(offset) < max(abs(o) for o in offsets):
                continue
            alone = free_store.get(name, offset)
            if alone is None or not _holds(free, free_start, alone):
                # from where the prior left the others: they have farther to go
                alone = _refit(
                    free, info, z, info.names.index(name), offset, free_start, np.array(lines[i]["z"])
                )
                free_store.put(name, offset, alone)
            bare[i] = max(float(alone["rise"]), 0.0)
            lines[i] = {**lines[i], "evaluations": lines[i]["evaluations"] + alone["evaluations"]}
        rise, data_rise, moved = (
            np.array([ln[key] for ln in lines], dtype=float) for key in ("rise", "data_rise", "moved")
        )
        count = sum(int(ln["evaluations"]) for ln in lines)
        found.append(Profile(name, np.array(offsets, dtype=float), rise, data_rise, moved, bare, count))
    return tuple(found)


def without_priors(params: ParameterSet) -> ParameterSet:
    """The same parameters with nothing known before but their bounds."""
    return ParameterSet(tuple(replace(p, prior=None) for p in params.entries))


def _refit(
    problem: FitProblem,
    info: Information,
    z: Array,
    fixed: int,
    offset: float,
    start: float,
    begin: Array | None = None,
) -> dict[str, Any]:
    """Levenberg-Marquardt over all unknowns but one.

    From the best point with that one moved (or from `begin`), so that the way the others take owes nothing to
    the covariance; only where the vehicle diverges there, from where the local quadratic is lowest.
    """
    k = len(info.names)
    column = info.covariance[:, fixed]
    size = problem.scale.copy()
    size[:k] = info.unit
    low, high = problem.low, problem.high
    others = np.arange(z.size) != fixed
    here = z.copy() if begin is None else begin.copy()
    here[fixed] = z[fixed]
    here[fixed] += offset * np.sqrt(column[fixed]) * info.unit[fixed]
    here = np.clip(here, low, high)
    cost, damping, evaluations = problem.cost(here), 1e-6, 0
    if not np.isfinite(cost):
        here[:k] = np.clip(z[:k] + offset * column / np.sqrt(column[fixed]) * info.unit, low[:k], high[:k])
        cost = problem.cost(here)
    for _ in range(ITERATIONS):
        try:
            resid, jac = problem.compressed(here)
        except ModelError:
            break
        evaluations += 1
        matrix = jac[:, others] * size[others]
        slope = matrix.T @ resid
        while damping < 1e6:
            rows = np.vstack([matrix, np.sqrt(damping) * np.eye(matrix.shape[1])])
            move = np.linalg.lstsq(rows, -np.concatenate([resid, np.zeros(matrix.shape[1])]), rcond=None)[0]
            trial = here.copy()
            trial[others] = np.clip(trial[others] + move * size[others], low[others], high[others])
            new = problem.cost(trial)
            if new <= cost:
                break
            damping *= 10.0
        else:
            break
        promised, gained = -0.5 * float(slope @ move), cost - new
        here, cost, damping = trial, new, max(0.1 * damping, 1e-9)
        if promised < LEAST_COST_STEP and gained < LEAST_COST_STEP:
            break
    moved = (here - z)[:k] / info.unit
    prior_resid = problem.params.prior_residuals(here[:k])[0]
    prior_start = problem.params.prior_residuals(z[:k])[0]
    prior_rise = 0.5 * float(prior_resid @ prior_resid - prior_start @ prior_start)
    rise = cost - start if np.isfinite(cost) else np.nan
    return {
        "rise": rise, "data_rise": rise - prior_rise, "moved": moved.tolist(), "evaluations": evaluations,
        "z": here.tolist(),
    }  # fmt: skip


class _Store:
    """Refits already done, one JSON line each with the digest of what it belongs to; other lines stay."""

    def __init__(self, path: Path | str | None, header: str) -> None:
        self._lines: dict[tuple[str, float], dict[str, Any]] = {}
        self._path = None if path is None else Path(path)
        self._digest = hashlib.sha256(header.encode()).hexdigest()[:16]
        if self._path is None:
            return
        kept = read_lines(self._path)
        for line in kept:
            if line.get("digest") == self._digest and {"name", "offset", "refit"} <= line.keys():
                self._lines[line["name"], line["offset"]] = line["refit"]
        try:
            write_atomic(self._path, "".join(json.dumps(line) + "\n" for line in kept))
        except OSError as error:
            raise FitError(f"{self._path}: the log of refits cannot be written ({error.strerror})") from None

    def get(self, name: str, offset: float) -> dict[str, Any] | None:
        return self._lines.get((name, float(offset)))

    def put(self, name: str, offset: float, refit: dict[str, Any]) -> None:
        if self._path is not None:
            line = {"digest": self._digest, "name": name, "offset": float(offset), "refit": refit}
            with self._path.open("a", encoding="utf-8") as handle:
                handle.write(json.dumps(line) + "\n")


def _holds(problem: FitProblem, start: float, line: dict[str, Any]) -> bool:
    """Whether the cost a stored refit tells is that of its values, computed again."""
    try:
        stored = start + float(line["rise"])
        found = problem.cost(np.array(line["z"], dtype=float))
        moved = np.array(line["moved"], dtype=float)
    except (KeyError, TypeError, ValueError, IndexError):
        return False
    if moved.shape != (len(problem.params.names),):
        return False
    if not np.isfinite(stored):
        return not np.isfinite(found)
    return bool(abs(found - stored) <= SAME_COST * max(abs(stored), abs(start)))
