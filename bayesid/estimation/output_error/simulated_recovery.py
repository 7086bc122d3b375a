"""Fits of simulated targets whose truth is known: start somewhere wrong, fit, compare.

Takes a `Model`, manoeuvres and a `RecoveryCase` (what is unknown, how wrong it starts, how far it may go).
Gives one plain record per seed. Does not draw, and adds no noise: what stays wrong is due to the input and
the search alone.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.search import FitOptions, fit
from bayesid.estimation.output_error.slsqp import Iterate
from bayesid.estimation.output_error.trial_setup import unweighted
from bayesid.executor import HERE, Executor
from bayesid.files import to_plain, write_json
from bayesid.manoeuvres import Manoeuvre
from bayesid.model.params import Parameter, ParameterSet
from bayesid.simulation import TimePlan, plan_run, run_manoeuvre, simulate

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Target:
    """A simulated run that plays the full-scale trial: its plan, initial state and true states."""

    name: str
    plan: TimePlan
    x0: Array
    states: Array


@dataclass(frozen=True)
class RecoveryCase:
    """What is unknown and how the search is set up.

    unknown : names, in the order of the figures
    start_error : half width of the uniform relative error of the starts
    bounds_around : "start" or "truth", and their relative half width `bounds`
    known_error : half width of the uniform relative error of all other coefficients of `known`
    goal : first stage ends at this share of the first cost (the paper's own factor); 0 for none
    """

    name: str
    title: str
    unknown: tuple[str, ...]
    known: tuple[str, ...] = ()
    start_error: float = 0.1
    bounds_around: str = "truth"
    bounds: float = 0.25
    known_error: float = 0.0
    goal: float = 0.0


def make_target(model: Model, name: str, manoeuvre: Manoeuvre, x0: Array) -> Target:
    """Run a manoeuvre with the true parameters; a closed-loop one becomes the input history it led to."""
    track, commands = run_manoeuvre(model, model.nominal, manoeuvre, x0)
    plan = plan_run(model, track.t, commands)
    return Target(name, plan, x0, simulate(model, model.nominal, plan, x0).states)


def draw(model: Model, case: RecoveryCase, seed: int) -> tuple[ParameterSet, Array]:
    """Starts and bounds of the unknowns, and the parameter vector that holds the (wrong) knowns."""
    rng = np.random.default_rng(seed)
    truth = model.nominal[model.positions(case.unknown)]
    start = truth * (1 + rng.uniform(-case.start_error, case.start_error, truth.size))
    centre = start if case.bounds_around == "start" else truth
    reach = np.abs(centre) * case.bounds
    entries = tuple(
        Parameter(n, s, "free", c - h, c + h, abs(s), file_scale=model.file_scale(n))
        for n, s, c, h in zip(case.unknown, start, centre, reach, strict=True)
    )
    base = np.array(model.nominal)
    where = model.positions(case.known)
    base[where] *= 1 + rng.uniform(-case.known_error, case.known_error, where.size)
    return ParameterSet(entries), base


def problem_of(model: Model, params: ParameterSet, base: Array, targets: Iterable[Target]) -> FitProblem:
    """The paper's objective on these targets."""
    kept = list(targets)
    runs = [(t.name, t.plan, t.states) for t in kept]
    return replace(unweighted(model, params, runs, kept[0].x0), base=base)


def position_error(model: Model, par: Array, target: Target) -> float:
    """Largest distance from the true track [m]."""
    track = simulate(model, par, target.plan, target.x0)
    where = [i for i, s in enumerate(track.names) if s in ("x", "y", "z")]
    return float(np.linalg.norm(track.states[:, where] - target.states[:, where], axis=1).max())


def run_case(
    model: Model,
    case: RecoveryCase,
    seed: int,
    targets: Sequence[Target],
    coarse: Sequence[Target],
    others: Sequence[Target] = (),
    options: FitOptions | None = None,
    note: Callable[[str, Iterate], None] | None = None,
) -> dict[str, Any]:
    """One seed of a case as plain numbers.

    Parameters
    ----------
    targets, coarse : the runs fitted, and the same with a longer step, on which the search begins
    others : runs not fitted, predicted with the result
    note : called with the stage ("coarse" or "fine" samples) and every SQP iteration

    Returns
    -------
    "start", "goal" (first point at the case's goal, absent without one) and "end", each with V, ratios to the
    truth, rms ratio error, largest position error, and predictions of the other runs; and how the search
    went.
    """
    options = replace(options or FitOptions(), gain=0.0, relative_gain=1e-3, seed=seed)
    params, base = draw(model, case, seed)
    truth = model.nominal[model.positions(case.unknown)]
    fine, rough = (problem_of(model, params, base, kept) for kept in (targets, coarse))
    v0 = 2 * fine.cost(fine.start)

    def point(z: Array) -> dict[str, Any]:
        par, _ = fine.split(z)
        ratio = z / truth
        return {
            "V": 2 * fine.cost(z),
            "ratio": ratio,
            "rms_ratio_error": float(np.sqrt(np.mean((ratio - 1) ** 2))),
            "max_position_error": max(position_error(model, par, t) for t in targets),
            "prediction": {t.name: position_error(model, par, t) for t in others},
        }

    record: dict[str, Any] = {
        "case": case.name, "seed": seed, "names": case.unknown, "V_start": v0, "start": point(fine.start),
        "low": np.minimum(fine.low / truth, fine.high / truth),
        "high": np.maximum(fine.low / truth, fine.high / truth), "V_truth": 2 * fine.cost(truth),
        "known_ratio": (base / np.where(model.nominal == 0, 1.0, model.nominal))[model.positions(case.known)],
    }  # fmt: skip
    found: list[Fit] = []

    def stage(problem: FitProblem, z: Array, goal: float) -> Array:
        begin = problem.with_params(problem.params.started_at(z))
        where = "coarse" if problem is rough else "fine"
        found.append(
            fit(begin, replace(options, goal=0.5 * goal), note=note and (lambda it: note(where, it)))
        )
        return found[-1].z

    z = fine.start
    if case.goal:
        z = stage(rough, z, case.goal * 2 * rough.cost(rough.start))
        z = stage(fine, z, case.goal * v0)
        record["goal"] = point(z)
    z = stage(rough, z, 0.0)
    z = stage(fine, z, 0.0)
    last = found[-1]
    seconds = sum(f.seconds for f in found)
    record |= {
        "end": point(z), "status": last.status, "message": last.message, "at_bound": last.at_bound,
        "iterations": sum(len(f.costs) for f in found), "rounds": sum(f.rounds for f in found),
        "n_cost": sum(f.n_cost for f in found), "n_gradient": sum(f.n_gradient for f in found),
        "seconds": seconds,
        "shares": {k: sum(f.shares[k] * f.seconds for f in found) / max(seconds, 1e-9) for k in last.shares},
    }  # fmt: skip
    return dict(to_plain(record))


def run_seeds(
    work: Callable[[int], Mapping[str, Any]],
    seeds: Iterable[int],
    folder: Path,
    name: str,
    executor: Executor = HERE,
    done: Callable[[], None] | None = None,
) -> list[dict[str, Any]]:
    """Records of all seeds, each stored as it is finished; stored ones are not run again.

    Parameters
    ----------
    folder, name : records go to `<folder>/<name>-<seed>.json`
    executor : where they are computed; `work` and what it holds go to other processes then
    done : called after every seed
    """
    found: dict[int, dict[str, Any]] = {}
    missing = []
    for seed in seeds:
        path = folder / f"{name}-{seed}.json"
        try:
            found[seed] = json.loads(path.read_text(encoding="utf-8"))
            if done is not None:
                done()
        except (OSError, ValueError):
            missing.append(seed)
    for k, record in executor.as_they_come(work, missing):
        seed = missing[k]
        found[seed] = dict(to_plain(record))
        write_json(folder / f"{name}-{seed}.json", found[seed])
        if done is not None:
            done()
    return [found[seed] for seed in sorted(found)]
