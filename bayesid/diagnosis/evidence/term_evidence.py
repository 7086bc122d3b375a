"""Evidence of terms of a missing force: whitened columns along fixed paths, refits that clean the paths.

Takes a `DiagnosisProblem`, a path and columns. Gives a `TermEvidence`, from which any choice of terms is
weighed without a simulation, and the choice that earns its evidence. Does not regress the force or word the
result.

Terms are linear in their coefficient: a term's force along the path goes through the maps of the latent
force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from bayesid.analysis.excitation.columns import LibraryColumn
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.force_terms import along
from bayesid.diagnosis.hypotheses.sensitivity_bank import levels_between
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations, posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, linearise_runs
from bayesid.estimation.filter_error.noise_model import force_unit, whitened
from bayesid.estimation.parameters import NO_PARAMETERS, GaussianPrior
from bayesid.estimation.run_data import Array

# Evidence a term must earn [nats], and most terms.
TERM_EVIDENCE, MOST_TERMS = 5.0, 4
# Prior sd of a term's rms force over 1/2 rho L^2 U^2, averaged over; the same span as a free force's.
TERM_FORCE_SDS = (1e-5, 1e-4, 1e-3, 1e-2)
# Gauss-Newton passes of a refit that cleans the path.
CLEANING_ITERATIONS = 12


class TermEvidence:
    """Evidence of any of a few terms along fixed paths, coefficients and all else integrated out."""

    def __init__(
        self,
        problem: DiagnosisProblem,
        paths: Sequence[Linearisation],
        free: GaussianPrior,
        added: GaussianPrior,
        columns: Sequence[LibraryColumn],
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
        self.levels: list[list[NormalEquations]] = []
        self._known: dict[frozenset[int], float] = {}
        for noise_model in levels_between(problem, level):
            equations = []
            for k, (path, value) in enumerate(zip(paths, values, strict=True)):
                n, q = path.resid.shape
                drive = path.gamma[:, :, at] * (value * self.unit)[:, None, :]
                w = whitened(
                    model,
                    path,
                    whole.mean - path.point.par[whole.where],
                    whole.sd,
                    noise_model,
                    run=k,
                    extra=(np.zeros((n, q, len(at))), np.ascontiguousarray(drive)),
                )
                # rows a refit added are moved back to none; as columns they are among the terms
                kept = np.delete(w.columns, np.arange(self.base, len(whole.names)), axis=1)
                equations.append(normal_equations(w.resid, kept, w.logdet, w.used))
            self.levels.append(equations)

    def _scaled(self, g: NormalEquations, chosen: Sequence[int], size: float) -> NormalEquations:
        picked = g.pick(np.concatenate([np.arange(self.base), self.base + np.array(chosen, dtype=int)]))
        scale = np.concatenate([np.ones(self.base), np.full(len(chosen), size)])
        return NormalEquations(
            picked.ss * np.outer(scale, scale), picked.se * scale, picked.ee, picked.logdet, picked.used
        )

    def _evidence(self, equations: Sequence[NormalEquations], chosen: Sequence[int]) -> float:
        """Log evidence of one level, averaged over the prior size of the terms."""
        total = sum(equations[1:], equations[0])
        if not chosen:
            return posterior(self._scaled(total, (), 1.0)).log_evidence
        sizes = [posterior(self._scaled(total, chosen, s)).log_evidence for s in TERM_FORCE_SDS]
        return float(logsumexp(sizes) - np.log(len(TERM_FORCE_SDS)))

    def best(self, chosen: Sequence[int]) -> int:
        """Level of most evidence."""
        return int(np.argmax([self._evidence(equations, chosen) for equations in self.levels]))

    def evidence(self, chosen: Sequence[int]) -> float:
        """Log evidence of some terms at their best level."""
        key = frozenset(chosen)
        if key not in self._known:
            self._known[key] = max(self._evidence(equations, sorted(key)) for equations in self.levels)
        return self._known[key]

    def gain(self, chosen: Sequence[int], over: Sequence[int] = ()) -> float:
        """Log evidence of some terms over others, each at its own best level."""
        return self.evidence(chosen) - self.evidence(over)

    def left_out(self, chosen: Sequence[int]) -> float:
        """Log density of every run given the others; nan with a single run."""
        equations = self.levels[self.best(chosen)]
        if len(equations) < 2:
            return float("nan")
        whole = self._evidence(equations, chosen)
        return sum(
            whole - self._evidence([g for i, g in enumerate(equations) if i != k], chosen)
            for k in range(len(equations))
        )

    def scale(self, j: int) -> float:
        """Prior sd of one coefficient [SI] at its most probable size."""
        equations = self.levels[self.best([j])]
        total = sum(equations[1:], equations[0])
        found = [posterior(self._scaled(total, [j], s)).log_evidence for s in TERM_FORCE_SDS]
        return float(TERM_FORCE_SDS[int(np.argmax(found))] * self.unit[j])

    def coefficients(self, chosen: Sequence[int]) -> tuple[Array, Array]:
        """Coefficients and their sd [SI] at the most probable level and size."""
        equations = self.levels[self.best(chosen)]
        total = sum(equations[1:], equations[0])
        found = [posterior(self._scaled(total, chosen, s)) for s in TERM_FORCE_SDS]
        k = int(np.argmax([f.log_evidence for f in found]))
        scale = TERM_FORCE_SDS[k] * self.unit[list(chosen)]
        inside = np.diag(found[k].covariance)[self.base :]
        return found[k].mean[self.base :] * scale, np.sqrt(inside) * scale


def grow(trial: TermEvidence, proposed: Sequence[int]) -> list[int]:
    """Terms that enter one by one while each adds `TERM_EVIDENCE` nats.

    The regression sees a smoothed force, the evidence sees the readings: between terms of one axis that the
    regression could hardly tell apart the evidence chooses, and a term that no longer holds its own goes.
    """
    chosen: list[int] = []
    while len(chosen) < MOST_TERMS:
        others = [k for k in proposed if k not in chosen]
        gains = [trial.gain([*chosen, k], chosen) for k in others]
        if not gains or max(gains) < TERM_EVIDENCE:
            break
        chosen = improved(trial, [*chosen, others[int(np.argmax(gains))]])
    return chosen


def improved(trial: TermEvidence, chosen: list[int]) -> list[int]:
    """Terms after every swap within an axis that raises the evidence, and without those worth too little."""
    while True:
        for j in chosen:
            rest = [k for k in chosen if k != j]
            if trial.gain(chosen, rest) < TERM_EVIDENCE:
                return improved(trial, rest)
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


def without_terms(
    problem: DiagnosisProblem,
    points: Sequence[Trajectory],
    free: GaussianPrior,
    added: GaussianPrior,
    base: FilterErrorFit | None,
    columns: Sequence[LibraryColumn],
    level: float,
) -> TermEvidence:
    """Trial along the path of the best fit without terms."""
    model = problem.model
    if base is None:
        plain = points[0].par.copy()
        plain[added.where] = added.mean
        base = fit(
            model,
            problem.logs,
            free,
            problem.environment.noise_model,
            start=[Trajectory(plain, point.states, point.force) for point in points],
            initial_noise_scale=max(level, problem.path_level, 1e-5),
        )
    fine = base.converged
    paths = linear_paths(problem, base.points if fine else base.path_points, free)
    values = [along(model, path, columns) for path in paths]
    return TermEvidence(
        problem, paths, free, NO_PARAMETERS, columns, values, 0.0 if fine else base.path_force_level
    )


def gain_over(
    trials: Sequence[TermEvidence], trial: TermEvidence, chosen: Sequence[int], over: Sequence[int]
) -> float:
    """Log evidence of terms along their own path over fewer terms along the path that suits those best.

    Moved back to nothing along the path of a refit with terms, the bare model looks worse than it is: forces
    of vortices then gained 80 nats where a free force gained 2.
    """
    return trial.evidence(chosen) - max(other.evidence(over) for other in trials)


def predictive_gain(trials: Sequence[TermEvidence], trial: TermEvidence, chosen: Sequence[int]) -> float:
    """Log density of every run given the others, over that without terms; nan with a single run."""
    bare = max(trials, key=lambda other: other.evidence(()))
    return trial.left_out(chosen) - bare.left_out(())


def held(trials: Sequence[TermEvidence], trial: TermEvidence, chosen: list[int]) -> list[int]:
    """Terms that hold their evidence against fewer of them along any path."""
    while chosen:
        losses = {j: gain_over(trials, trial, chosen, [k for k in chosen if k != j]) for j in chosen}
        weakest = min(losses, key=lambda j: losses[j])
        if losses[weakest] >= TERM_EVIDENCE and gain_over(trials, trial, chosen, ()) >= TERM_EVIDENCE:
            break
        chosen = [k for k in chosen if k != weakest]
    return chosen


def linear_paths(
    problem: DiagnosisProblem, points: Sequence[Trajectory], free: GaussianPrior
) -> list[Linearisation]:
    return linearise_runs(problem.model, problem.logs, points, free.where)


def refitted(
    problem: DiagnosisProblem,
    points: Sequence[Trajectory],
    free: GaussianPrior,
    gone: GaussianPrior,
    trial: TermEvidence,
    chosen: Sequence[int],
    level: float,
) -> tuple[Sequence[Trajectory], GaussianPrior, float] | None:
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
    added = GaussianPrior(
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
            problem.environment.noise_model,
            start=[Trajectory(par, point.states, point.force) for point in points],
            initial_noise_scale=level,
            iterations=CLEANING_ITERATIONS,
        )
    except ModelError:
        return None
    if fitted.converged:
        return fitted.points, added, 0.0
    return fitted.path_points, added, fitted.path_force_level
