"""What a missing force is made of, where no effect of the catalogue explains it.

Takes a `Problem`, the path it was diagnosed along and the smoothed latent force. Gives a frozen
`Description`: terms of a library of force terms, proposed by a sparse regression of the force and accepted
only if each then earns its evidence as a parametric term and runs are predicted no worse without them. Names
a form, never a cause. Reads no held-out run.

Terms are linear in their coefficient, so their whitened columns need no simulation: a term's force along the
path goes through the maps of the latent force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import logsumexp

from bayesid.coloured.colours import force_unit, whitened
from bayesid.coloured.evidence import Gram, gram, posterior
from bayesid.coloured.fit import Free, fit
from bayesid.coloured.log import Array
from bayesid.coloured.path import Path, Point, linearise
from bayesid.diagnose.bank import levels_between
from bayesid.diagnose.candidate import explains
from bayesid.diagnose.problem import Problem
from bayesid.diagnose.where import Where
from bayesid.diagnose.which import Candidates
from bayesid.errors import ModelError
from bayesid.excitation.columns import Column, Rows, evaluate
from bayesid.excitation.select import Witness, select_axis
from bayesid.model import Model
from bayesid.simulate import actuate
from bayesid.terms import TERMS, Term, term

# Evidence a term must earn [nats], bootstrap inclusion from which it (or its group) is tried, most terms.
NEEDED, INCLUDED, MOST = 5.0, 0.8, 4
# Prior sd of a term's rms force over 1/2 rho L^2 U^2, averaged over; the same span as a free force's.
SIZES = (1e-5, 1e-4, 1e-3, 1e-2)
DRAWS = 60
# Gauss-Newton passes of a refit that cleans the path, and how many of those.
PASSES, ROUNDS = 12, 3
BLOCK = 6.0  # L/U

_ROWS = {
    "X": ("vr", "vv", "rr", "uu", "drdr", "prop_un", "prop_n|n|"),
    "Y": ("v", "r", "v|v|", "r|r|", "v|r|", "|v|r", "vvv", "vvr", "vrr", "rrr", "dr", "*"),
    "N": ("v", "r", "v|v|", "r|r|", "v|r|", "|v|r", "vvv", "vvr", "vrr", "rrr", "dr", "*"),
    "Z": ("w", "q", "w|w|", "w|q|", "vv", "rr", "vr", "ds", "*"),
    "K": ("v", "r", "p", "v|v|", "p|p|", "dr", "*"),
    "M": ("w", "q", "w|w|", "q|q|", "vv", "rr", "vr", "ds", "*"),
}
_EARTH = {"cos(psi)": "cos(psi)", "sin(psi)": "sin(psi)"}
_SIDE = {
    "dr|dr|": "u*u*delta_r*abs(delta_r)", "|dr|": "u*u*abs(delta_r)", "|v|": "u*abs(v)", "|r|": "u*abs(r)",
    "nn": "n*abs(n)", **_EARTH,
}  # fmt: skip
_MORE = {
    "X": {"|v|": "u*abs(v)", "|dr|": "u*u*abs(delta_r)", **_EARTH},
    "Y": _SIDE,
    "N": _SIDE,
    "Z": {
        "ds|ds|": "u*u*delta_s*abs(delta_s)",
        "nn": "n*abs(n)",
        "cos(phi)cos(theta)": "cos(phi)*cos(theta)",
    },
    "K": {"|dr|": "u*u*abs(delta_r)", "nn": "n*abs(n)", "sin(phi)": "sin(phi)*cos(theta)"},
    "M": {"ds|ds|": "u*u*delta_s*abs(delta_s)", "nn": "n*abs(n)", "sin(theta)": "sin(theta)"},
}


@dataclass(frozen=True)
class DescribedTerm:
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
    axis: str
    expression: str
    in_model: bool
    value: float
    sd: float
    unit: str
    inclusion: float
    gain: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """What the missing force is made of.

    Attributes
    ----------
    terms : accepted terms, empty if none earned its evidence
    gain : log evidence of all together over none
    predictive : the same for each run predicted from the others; nan with a single run
    explained : axis -> share of the smoothed force's mean square the regression explains
    tried : terms the regression proposed
    sentences : the finding in words
    """

    terms: tuple[DescribedTerm, ...]
    gain: float
    predictive: float
    explained: dict[str, float]
    tried: tuple[str, ...]
    sentences: tuple[str, ...]


def describe_gap(problem: Problem, candidates: Candidates, remainder: bool, seed: int = 0) -> Description:
    """Description of what the best explanation leaves (`remainder`), or of the whole gap."""
    if remainder and candidates.where_after is not None:
        best = candidates.best.fit
        points = best.points if best.converged else best.follow
        level = 0.0 if best.converged else best.follow_level
        return describe(problem, points, best.free, candidates.where_after, level, seed)
    none = candidates.none
    fine = explains(none)
    points = none.fit.points if fine else problem.path
    level = 0.0 if fine else problem.path_level
    return describe(problem, points, problem.coefficients, candidates.where, level, seed)


def describe(
    problem: Problem, points: Sequence[Point], free: Free, where: Where, level: float = 0.0, seed: int = 0
) -> Description:
    """Terms that make up the force in `where`.

    Parameters
    ----------
    points : a path that follows the data, the one `where` was found along
    free : parameters integrated out (coefficients, and effects already in the model)
    level : latent force the path needed over 1/2 rho L^2 U^2
    """
    model = problem.model
    columns = force_library(model)
    added = _no_rows(model)
    paths = _linear(problem, points, free)
    values = [_along(model, path, columns) for path in paths]
    witnesses, explained = _regress(problem, columns, values, where, seed)
    proposed = _proposed(witnesses)
    if not proposed:
        return Description((), 0.0, float("nan"), explained, (), _words((), (), 0.0, float("nan")))
    axes = {w.axis for w in proposed}
    picked = [k for k, c in enumerate(columns) if c.axis in axes and any(v[:, k].any() for v in values)]
    columns = tuple(columns[k] for k in picked)
    trial = _Trial(problem, paths, free, added, columns, [v[:, picked] for v in values], level)
    names = [c.name for c in columns]
    chosen = _grow(trial, [names.index(w.name) for w in proposed])
    for _ in range(ROUNDS):
        # Along a path that knows the terms found so far, sway and yaw no longer carry the sensors' noise: a
        # planted v^3 was named r^3 before, as r is measured better than v.
        again = _refitted(problem, points, free, added, trial, chosen, level)
        if again is None:
            break
        before = set(chosen)
        points, added, level = again
        paths = _linear(problem, points, free + added)
        trial = _Trial(
            problem, paths, free, added, columns, [_along(model, path, columns) for path in paths], level
        )
        chosen = _improved(trial, chosen)
        if set(chosen) == before:
            break
    gain, predictive = trial.gain(chosen), trial.predictive(chosen)
    if chosen and predictive < 0.0:
        chosen, gain = [], 0.0
    witness = {w.name: w for w in witnesses}
    terms = tuple(_term(trial, chosen, j, witness) for j in chosen)
    tried = tuple(w.name for w in proposed)
    return Description(terms, gain, predictive, explained, tried, _words(terms, tried, gain, predictive))


def _no_rows(model: Model) -> Free:
    return Free((), model.positions(()), np.zeros(0), np.zeros(0), np.zeros(0))


def _linear(problem: Problem, points: Sequence[Point], free: Free) -> list[Path]:
    return [
        linearise(problem.model, log, point, free.where)
        for log, point in zip(problem.logs, points, strict=True)
    ]


def _refitted(
    problem: Problem,
    points: Sequence[Point],
    free: Free,
    gone: Free,
    trial: _Trial,
    chosen: Sequence[int],
    level: float,
) -> tuple[Sequence[Point], Free, float] | None:
    """Path of a refit with the chosen terms, the rows it adds, and its level; None if no term is a row.

    `gone` are the rows an earlier refit added.
    """
    model = problem.model
    value, _ = trial.coefficients(chosen)
    found = {trial.columns[j].name: (float(v), j) for v, j in zip(value, chosen, strict=True)}
    rows = {n: (v, trial.scale(j)) for n, (v, j) in found.items() if n in model.index}
    if not rows:
        return None
    par = points[0].par.copy()
    par[gone.where] = gone.mean
    sd = free.sd.copy()
    for name, (v, size) in rows.items():
        i = model.index[name]
        par[i] = (free.mean[free.names.index(name)] if name in free.names else model.nominal[i]) + v
        if name in free.names:
            sd[free.names.index(name)] = float(np.hypot(free.sd[free.names.index(name)], size))
    new = [n for n in rows if n not in free.names]
    where = model.positions(new)
    added = Free(
        tuple(new),
        where,
        model.nominal[where],
        np.array([rows[n][1] for n in new]),
        np.full(len(new), -np.inf),
    )
    try:
        fitted = fit(
            model,
            problem.logs,
            replace(free, sd=sd) + added,
            problem.environment.colours,
            start=[Point(par, point.states, point.force) for point in points],
            loud=level,
            passes=PASSES,
        )
    except ModelError:
        return None
    if fitted.converged:
        return fitted.points, added, 0.0
    return fitted.follow, added, fitted.follow_level


def force_library(model: Model) -> tuple[Column, ...]:
    """Terms a missing force may be made of: rows of the force table and a few more, on every axis."""
    known = {t.name: t for t in TERMS}
    out = []
    for axis in [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]:
        for name in (f"{axis}_{n}" for n in _ROWS[axis]):
            if name in known and (model.dof == 6 or known[name].planar):
                nominal = float(model.nominal[model.index[name]]) if name in model.index else 0.0
                out.append(Column(name, axis, known[name].regressor, nominal))
        out += [Column(f"{axis}_{n}", axis, text, is_row=False) for n, text in _MORE[axis].items()]
    return tuple(out)


def _along(model: Model, path: Path, columns: Sequence[Column]) -> Array:
    """(n-1, k) columns at the middles of the sample intervals of a path."""
    nx = len(model.states)
    middle = 0.5 * (path.point.states[1:, :nx] + path.point.states[:-1, :nx])
    plan = path.log.plan
    act, _ = actuate(model, path.point.par, plan)
    mean = np.add.reduceat(act * plan.steps[:, None], plan.record[:-1], axis=0) / np.diff(plan.t)[:, None]
    return np.column_stack([evaluate(c.expression, model, middle, mean) for c in columns])


def _regress(
    problem: Problem, columns: Sequence[Column], values: Sequence[Array], where: Where, seed: int
) -> tuple[list[Witness], dict[str, float]]:
    """Witnesses of every column, and the share of the smoothed force explained per axis."""
    model = problem.model
    axes = tuple(n[-1] for n in model.kernel.exogenous if n.startswith("force_"))
    time = BLOCK * model.scales["L"] / model.scales["U"]
    stacked, block, first = np.concatenate(values), [], 0
    for t in where.times:
        block.append(first + (t[:-1] // time).astype(int))
        first = int(block[-1].max()) + 1
    force = np.concatenate([f[:-1] for f in where.force])
    band = np.concatenate([b[:-1] for b in where.band])
    rng = np.random.default_rng(seed)
    witnesses: list[Witness] = []
    explained = {}
    for a, axis in enumerate(axes):
        weight = 1.0 / np.maximum(band[:, a], 1e-3 * np.median(band[:, a]) + 1e-300) ** 2
        data = Rows(
            tuple(columns), axes, stacked, np.zeros_like(stacked), force, weight, np.concatenate(block)
        )
        fit = select_axis(data, axis, DRAWS, rng)
        witnesses += fit.witnesses
        explained[axis] = max(0.0, fit.explained)
    return witnesses, explained


def _proposed(witnesses: Sequence[Witness]) -> list[Witness]:
    """Terms most draws keep, and those that could stand in for them; most often kept first."""
    by_name = {w.name: w for w in witnesses}
    names: dict[str, None] = {}
    for w in sorted(witnesses, key=lambda w: -w.inclusion):
        together = sum(by_name[n].inclusion for n in w.group) if w.group else w.inclusion
        if w.inclusion >= INCLUDED or (w.group and together >= INCLUDED and w.inclusion > 0):
            names.update(dict.fromkeys((w.name, *w.group)))
    return [by_name[n] for n in names]


class _Trial:
    """Evidence of any of a few terms along fixed paths, coefficients and all else integrated out."""

    def __init__(
        self,
        problem: Problem,
        paths: Sequence[Path],
        free: Free,
        added: Free,
        columns: Sequence[Column],
        values: Sequence[Array],
        level: float,
    ) -> None:
        model = problem.model
        self.columns = list(columns)
        self.base = len(free.names)
        whole = free + added
        axes = [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]
        at = [axes.index(c.axis) for c in columns]
        rms = np.sqrt(np.mean(np.concatenate(values) ** 2, axis=0))
        # coefficient of one unknown at size 1: a force of rms 1/2 rho L^2 U^2
        self.unit = force_unit(model)[at] / np.maximum(rms, 1e-300)
        self.levels: list[list[Gram]] = []
        self._known: dict[frozenset[int], float] = {}
        for colours in levels_between(problem, level):
            grams = []
            for k, (path, value) in enumerate(zip(paths, values, strict=True)):
                n, q = path.resid.shape
                drive = path.gamma[:, :, at] * (value * self.unit)[:, None, :]
                w = whitened(
                    model,
                    path,
                    whole.mean - path.point.par[whole.where],
                    whole.sd,
                    colours,
                    run=k,
                    extra=(np.zeros((n, q, len(at))), np.ascontiguousarray(drive)),
                )
                # rows a refit added are moved back to none; as columns they are among the terms
                kept = np.delete(w.columns, np.arange(self.base, len(whole.names)), axis=1)
                grams.append(gram(w.resid, kept, w.logdet, w.used))
            self.levels.append(grams)

    def _scaled(self, g: Gram, chosen: Sequence[int], size: float) -> Gram:
        picked = g.pick(np.concatenate([np.arange(self.base), self.base + np.array(chosen, dtype=int)]))
        scale = np.concatenate([np.ones(self.base), np.full(len(chosen), size)])
        return Gram(
            picked.ss * np.outer(scale, scale), picked.se * scale, picked.ee, picked.logdet, picked.used
        )

    def _evidence(self, grams: Sequence[Gram], chosen: Sequence[int]) -> float:
        """Log evidence of one level, averaged over the prior size of the terms."""
        total = sum(grams[1:], grams[0])
        if not chosen:
            return posterior(self._scaled(total, (), 1.0)).log_evidence
        sizes = [posterior(self._scaled(total, chosen, s)).log_evidence for s in SIZES]
        return float(logsumexp(sizes) - np.log(len(SIZES)))

    def best(self, chosen: Sequence[int]) -> int:
        """Level of most evidence."""
        return int(np.argmax([self._evidence(grams, chosen) for grams in self.levels]))

    def evidence(self, chosen: Sequence[int]) -> float:
        """Log evidence of some terms at their best level."""
        key = frozenset(chosen)
        if key not in self._known:
            self._known[key] = max(self._evidence(grams, sorted(key)) for grams in self.levels)
        return self._known[key]

    def gain(self, chosen: Sequence[int], over: Sequence[int] = ()) -> float:
        """Log evidence of some terms over others, each at its own best level."""
        return self.evidence(chosen) - self.evidence(over)

    def predictive(self, chosen: Sequence[int]) -> float:
        """Log density of every run given the others, over that without terms; nan with a single run."""
        if len(self.levels[0]) < 2:
            return float("nan")

        def each(some: Sequence[int]) -> float:
            grams = self.levels[self.best(some)]
            whole = self._evidence(grams, some)
            return sum(
                whole - self._evidence([g for i, g in enumerate(grams) if i != k], some)
                for k in range(len(grams))
            )

        return each(chosen) - each(())

    def scale(self, j: int) -> float:
        """Prior sd of one coefficient [SI] at its most probable size."""
        grams = self.levels[self.best([j])]
        total = sum(grams[1:], grams[0])
        found = [posterior(self._scaled(total, [j], s)).log_evidence for s in SIZES]
        return float(SIZES[int(np.argmax(found))] * self.unit[j])

    def coefficients(self, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Coefficients and their sd [SI] at the most probable level and size."""
        grams = self.levels[self.best(chosen)]
        total = sum(grams[1:], grams[0])
        found = [posterior(self._scaled(total, chosen, s)) for s in SIZES]
        k = int(np.argmax([f.log_evidence for f in found]))
        scale = SIZES[k] * self.unit[list(chosen)]
        inside = np.diag(found[k].covariance)[self.base :]
        return found[k].mean[self.base :] * scale, np.sqrt(inside) * scale


def _grow(trial: _Trial, proposed: Sequence[int]) -> list[int]:
    """Terms that enter one by one while each adds `NEEDED` nats.

    The regression sees a smoothed force, the evidence sees the readings: between terms of one axis that the
    regression could hardly tell apart the evidence chooses, and a term that no longer holds its own goes.
    """
    chosen: list[int] = []
    while len(chosen) < MOST:
        others = [k for k in proposed if k not in chosen]
        gains = [trial.gain([*chosen, k], chosen) for k in others]
        if not gains or max(gains) < NEEDED:
            break
        chosen = _improved(trial, [*chosen, others[int(np.argmax(gains))]])
    return chosen


def _improved(trial: _Trial, chosen: list[int]) -> list[int]:
    """Terms after every swap within an axis that raises the evidence, and without those worth too little."""
    while True:
        for j in chosen:
            rest = [k for k in chosen if k != j]
            if trial.gain(chosen, rest) < NEEDED:
                return _improved(trial, rest)
        axis = [c.axis for c in trial.columns]
        swaps = [
            [*(i for i in chosen if i != j), k]
            for j in chosen
            for k in range(len(axis))
            if k not in chosen and axis[k] == axis[j]
        ]
        best = max(swaps, key=trial.evidence, default=chosen)
        if trial.gain(best, chosen) < 0.1:
            return chosen
        chosen = best


def _term(trial: _Trial, chosen: Sequence[int], j: int, witness: dict[str, Witness]) -> DescribedTerm:
    column = trial.columns[j]
    value, sd = trial.coefficients(chosen)
    rest = [k for k in chosen if k != j]
    rivals = tuple(
        trial.columns[k].name
        for k, other in enumerate(trial.columns)
        if k not in chosen and other.axis == column.axis and trial.gain([*rest, k], chosen) > -NEEDED
    )
    at = list(chosen).index(j)
    return DescribedTerm(
        column.name,
        column.axis,
        column.expression,
        column.in_model,
        float(value[at]),
        float(sd[at]),
        _unit(column),
        witness[column.name].inclusion,
        trial.gain(chosen, rest),
        rivals,
    )


def _unit(column: Column) -> str:
    """SI unit of the coefficient."""
    if column.is_row:
        return term(column.name).unit
    if "(psi)" in column.name or "(phi)" in column.name or "(theta)" in column.name:
        return "N" if column.axis in "XYZ" else "N m"
    return Term(column.name, column.axis, column.expression, "assumed: description of a missing force").unit


def _words(
    terms: Sequence[DescribedTerm], tried: Sequence[str], gain: float, predictive: float
) -> tuple[str, ...]:
    if not terms:
        if not tried:
            return ("No term of the library is kept in most bootstrap draws of the missing force.",)
        why = (
            f"predict the runs worse ({predictive:+.1f} nats)"
            if predictive < 0
            else f"do not earn {NEEDED:g} nats"
        )
        return (f"Terms proposed for the missing force ({', '.join(tried)}) {why}; none is named.",)
    out = []
    for t in terms:
        form = t.expression.replace("*", " ")
        kind = "a change of the vehicle's own row" if t.in_model else "a row the vehicle lacks"
        text = (
            f"The missing {'force' if t.axis in 'XYZ' else 'moment'} in {t.axis} goes as {form}: {t.name} = "
            f"{t.value:.4g} ± {t.sd:.2g} {t.unit}, {kind}, worth {t.gain:.1f} nats"
        )
        if t.rivals:
            text += f"; these runs cannot tell it from {', '.join(t.rivals)}"
        out.append(text + ".")
    tail = f"Together they raise the log evidence by {gain:.1f}"
    if np.isfinite(predictive):
        tail += f" and the density of each run given the others by {predictive:.1f} nats"
    out.append(tail + ". A form, not a cause.")
    return tuple(out)


def as_json(d: Description) -> dict[str, Any]:
    """Plain data of the block "description" of `diagnosis.json`."""
    return {
        "terms": [
            {
                "name": t.name,
                "axis": t.axis,
                "expression": t.expression,
                "in_model": t.in_model,
                "value": t.value,
                "sd": t.sd,
                "unit": t.unit,
                "inclusion": t.inclusion,
                "gain": t.gain,
                "rivals": list(t.rivals),
            }
            for t in d.terms
        ],
        "gain": d.gain,
        "predictive": d.predictive if np.isfinite(d.predictive) else None,
        "explained": d.explained,
        "tried": list(d.tried),
        "sentences": list(d.sentences),
    }
