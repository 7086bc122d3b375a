"""What a missing force is made of, where no effect of the catalogue explains it.

Takes a `DiagnosisProblem`, the path it was diagnosed along and the smoothed latent force. Gives a frozen
`MissingForce`: terms of a library of force terms, proposed by a sparse regression of the force and accepted
only if each then earns its evidence as a parametric term and runs are predicted no worse without them. Names
a form, never a cause. Reads no held-out run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from bayesid.analysis.excitation.columns import LibraryColumn, Rows
from bayesid.analysis.excitation.row_selection import RowSelection, select_axis
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.force_terms import along, force_library, unit_of
from bayesid.diagnosis.evidence.term_evidence import (
    TERM_EVIDENCE,
    TermEvidence,
    gain_over,
    grow,
    held,
    improved,
    linear_paths,
    predictive_gain,
    refitted,
    without_terms,
)
from bayesid.diagnosis.hypotheses.candidate import explains
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.localisation import Localisation
from bayesid.diagnosis.schema import About
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.parameters import NO_PARAMETERS, GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.model.vehicles import Vehicle, prime_unit
from bayesid.model.vehicles.check import drives
from bayesid.words import digits

# Bootstrap inclusion from which a term (or its group) is tried, draws, stretches they keep together [L/U].
LEAST_INCLUSION, DRAWS, BLOCK_LENGTHS = 0.8, 60, 6.0
# Refits that clean the path, at most.
MOST_ROUNDS = 3
# Rows that are another one while the vehicle goes ahead.
AHEAD_THE_SAME = {"X_uu": "X_u|u|", "X_u|u|": "X_uu"}


@dataclass(frozen=True)
class MissingForceTerm:
    """One term of a missing force.

    Attributes
    ----------
    name, axis, expression : as a row of the force table; `in_model` if the vehicle file has it, and the term
        is then a change of its coefficient beyond the prior
    value, sd, unit : coefficient, SI
    inclusion : share of bootstrap draws that keep it in the regression of the force
    gain : log evidence lost if it alone is taken out again
    rivals : terms that could stand in for it
    """

    name: str
    axis: Annotated[str, About(checks={"enum": list("XYZKMN")})]
    expression: str
    in_model: bool
    value: float
    sd: float
    unit: str
    inclusion: Annotated[float, About(checks={"minimum": 0, "maximum": 1})]
    gain: float
    rivals: tuple[str, ...]
    prime: Annotated[
        float | None, About("The value in the prime system; null for what is no row of the force table.")
    ] = None


@dataclass(frozen=True)
class MissingForce:
    """What the missing force is made of.

    Attributes
    ----------
    terms : accepted terms, empty if none earned its evidence
    gain : log evidence of all together over none
    predictive : the same for each run predicted from the others; None with a single run
    explained : axis -> share of the smoothed force's mean square the regression explains
    tried : terms the regression proposed
    sentences : the finding in words
    """

    terms: tuple[MissingForceTerm, ...]
    gain: float
    predictive: float | None
    explained: dict[str, float]
    tried: tuple[str, ...]
    sentences: tuple[str, ...]


def describe_missing_force(
    problem: DiagnosisProblem, candidates: HypothesisComparison, remainder: bool, seed: int = 0
) -> MissingForce:
    """Description of what the best explanation leaves (`remainder`), or of the whole gap."""
    if remainder and candidates.where_after is not None:
        best = candidates.best.fit
        points = best.followed
        level = 0.0 if best.converged else best.path_force_level
        return describe(problem, points, best.free, candidates.where_after, level, seed, best)
    none = candidates.none
    fine = explains(none)
    points = none.fit.points if fine else problem.path
    level = 0.0 if fine else problem.path_level
    return describe(problem, points, problem.coefficients, candidates.where, level, seed, none.fit)


def describe(
    problem: DiagnosisProblem,
    points: Sequence[Trajectory],
    free: GaussianPrior,
    where: Localisation,
    level: float = 0.0,
    seed: int = 0,
    base: FilterErrorFit | None = None,
) -> MissingForce:
    """Terms that make up the force in `localisation`.

    Parameters
    ----------
    points : a path that follows the data, the one `localisation` was found along
    free : parameters integrated out (coefficients, and effects already in the model)
    level : latent force the path needed over 1/2 rho L^2 U^2
    base : fit of `free` without any term; made here if not at hand
    """
    model = problem.model
    columns = force_library(model)
    added = NO_PARAMETERS
    paths = linear_paths(problem, points, free)
    values = [along(model, path, columns) for path in paths]
    selections, explained = _regress(problem, columns, values, where, seed)
    proposed = _proposed(selections)
    if not proposed:
        return MissingForce((), 0.0, None, explained, (), _words((), (), 0.0, float("nan")))
    axes = {w.axis for w in proposed}
    picked = [k for k, c in enumerate(columns) if c.axis in axes and any(v[:, k].any() for v in values)]
    columns = tuple(columns[k] for k in picked)
    trial = TermEvidence(problem, paths, free, added, columns, [v[:, picked] for v in values], level)
    trials = [trial]
    names = [c.name for c in columns]
    chosen = grow(trial, [names.index(w.name) for w in proposed])
    for _ in range(MOST_ROUNDS):
        # Along a path that knows the terms found so far, sway and yaw no longer carry the sensors' noise: a
        # planted v^3 was named r^3 before, as r is measured better than v.
        again = refitted(problem, points, free, added, trial, chosen, level)
        if again is None:
            break
        before = set(chosen)
        points, added, level = again
        paths = linear_paths(problem, points, free + added)
        trial = TermEvidence(
            problem, paths, free, added, columns, [along(model, path, columns) for path in paths], level
        )
        trials.append(trial)
        chosen = improved(trial, chosen)
        if set(chosen) == before:
            break
    if chosen:
        trials.append(without_terms(problem, points, free, added, base, columns, level))
    chosen = held(trials, trial, chosen)
    gain, predictive = gain_over(trials, trial, chosen, ()), predictive_gain(trials, trial, chosen)
    if chosen and predictive < 0.0:
        chosen, gain = [], 0.0
    selection = {w.name: w for w in selections}
    terms = tuple(_term(model.vehicle, trials, trial, chosen, j, selection) for j in chosen)
    ahead = all(float(np.nanmin(log.path[:, model.states.index("u")])) > 0.0 for log in problem.logs)
    tried = tuple(w.name for w in proposed)
    known = predictive if np.isfinite(predictive) else None
    own = {n: float(model.nominal[model.index[n]]) for n in model.vehicle.coef if n in model.index}
    words = _words(terms, tried, gain, predictive, own, ahead)
    return MissingForce(terms, gain, known, explained, tried, words)


def _regress(
    problem: DiagnosisProblem,
    columns: Sequence[LibraryColumn],
    values: Sequence[Array],
    where: Localisation,
    seed: int,
) -> tuple[list[RowSelection], dict[str, float]]:
    """What speaks for every column, and the share of the smoothed force explained per axis."""
    model = problem.model
    axes = tuple(n[-1] for n in model.kernel.exogenous if n.startswith("force_"))
    time = BLOCK_LENGTHS * model.scales["L"] / model.scales["U"]
    stacked, block, first = np.concatenate(values), [], 0
    for t in where.times:
        block.append(first + (t[:-1] // time).astype(int))
        first = int(block[-1].max()) + 1
    force = np.concatenate([f[:-1] for f in where.force])
    band = np.concatenate([b[:-1] for b in where.band])
    rng = np.random.default_rng(seed)
    selections: list[RowSelection] = []
    explained = {}
    for a, axis in enumerate(axes):
        weight = 1.0 / np.maximum(band[:, a], 1e-3 * np.median(band[:, a]) + 1e-300) ** 2
        data = Rows(
            tuple(columns), axes, stacked, np.zeros_like(stacked), force, weight, np.concatenate(block),
            np.zeros((0, *stacked.shape)), np.zeros_like(force),
        )  # fmt: skip
        fit = select_axis(data, axis, DRAWS, rng)
        selections += fit.selections
        explained[axis] = max(0.0, fit.explained)
    return selections, explained


def _proposed(selections: Sequence[RowSelection]) -> list[RowSelection]:
    """Terms most draws keep, and those that could stand in for them; most often kept first."""
    by_name = {w.name: w for w in selections}
    names: dict[str, None] = {}
    for w in sorted(selections, key=lambda w: -w.inclusion):
        together = sum(by_name[n].inclusion for n in w.group) if w.group else w.inclusion
        if w.inclusion >= LEAST_INCLUSION or (w.group and together >= LEAST_INCLUSION and w.inclusion > 0):
            names.update(dict.fromkeys((w.name, *w.group)))
    return [by_name[n] for n in names]


def _term(
    vehicle: Vehicle,
    trials: Sequence[TermEvidence],
    trial: TermEvidence,
    chosen: Sequence[int],
    j: int,
    selection: dict[str, RowSelection],
) -> MissingForceTerm:
    column = trial.columns[j]
    value, sd = trial.coefficients(chosen)
    rest = [k for k in chosen if k != j]
    rivals = tuple(
        trial.columns[k].name
        for k, other in enumerate(trial.columns)
        if k not in chosen and other.axis == column.axis and trial.gain([*rest, k], chosen) > -TERM_EVIDENCE
    )
    at = list(chosen).index(j)
    return MissingForceTerm(
        column.name,
        column.axis,
        column.expression,
        column.in_model,
        float(value[at]),
        float(sd[at]),
        unit_of(column),
        selection[column.name].inclusion,
        gain_over(trials, trial, chosen, rest),
        rivals,
        _prime(vehicle, column, float(value[at])),
    )


def _prime(vehicle: Vehicle, column: LibraryColumn, value: float) -> float | None:
    unit = prime_unit(vehicle, column.name) if column.is_row else float("nan")
    return value / unit if np.isfinite(unit) else None


def _words(
    terms: Sequence[MissingForceTerm],
    tried: Sequence[str],
    gain: float,
    predictive: float,
    own: Mapping[str, float] | None = None,
    ahead: bool = False,
) -> tuple[str, ...]:
    """The finding in words; `own` are the rows of the vehicle file [SI], `ahead` that all runs go ahead."""
    if not terms:
        if not tried:
            return ("No term of the library is kept in most bootstrap draws of the missing force.",)
        why = (
            f"predict the runs worse ({predictive:+.1f} nats)"
            if predictive < 0
            else f"do not earn {TERM_EVIDENCE:g} nats"
        )
        return (f"Terms proposed for the missing force ({', '.join(tried)}) {why}; none is named.",)
    out = []
    for t in terms:
        form = t.expression.replace("*", " ")
        row, kind, held = t.name, "a row the vehicle lacks", 0.0
        if t.in_model:
            kind, held = "a change of the vehicle's own row", (own or {}).get(t.name, 0.0)
        elif ahead and (twin := AHEAD_THE_SAME.get(t.name)) is not None and twin in (own or {}):
            row, kind, held = (
                twin,
                f"a change of the vehicle's own {twin} as it goes ahead",
                (own or {})[twin],
            )
        text = (
            f"The missing {'force' if t.axis in 'XYZ' else 'moment'} in {t.axis} goes as {form}: {t.name} = "
            f"{digits(t.value, 4)} ± {digits(t.sd, 2)} {t.unit}, {kind}, worth {t.gain:.1f} nats"
        )
        if drives(row, held + t.value):
            text += (
                "; it drives the motion: beside the rows of the file it fits what these runs reach, and "
                "beyond that a simulator with it may diverge"
            )
        if t.rivals:
            text += f"; these runs cannot tell it from {', '.join(t.rivals)}"
        out.append(text + ".")
    tail = f"Together they raise the log evidence by {gain:.1f}"
    if np.isfinite(predictive):
        tail += f" and the density of each run given the others by {predictive:.1f} nats"
    out.append(tail + ". A form, not a cause.")
    return tuple(out)
