"""Whitened products of everything a model form may have along the path of an explanation.

Takes a `DiagnosisProblem` and a refit. Gives the evidence of a form of any size, and the sizes of effects
beside it. One linearisation; no refit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from bayesid.diagnosis.data.model_form import ModelForm, form_effects, pushes_ahead, resonates, with_form
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.cross_validation import left_out
from bayesid.diagnosis.hypotheses.form_part import scaled
from bayesid.diagnosis.hypotheses.sensitivity_bank import levels_between
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.estimation.run_data import RunData
from bayesid.threads import each

Array = np.ndarray
# Sizes tried, over 1/2 rho L^2 U^2; the largest sizes the columns.
SIZES = (1e-4, 3e-4, 1e-3, 3e-3)


class FormColumns:
    """Whitened products of everything a form may have, along one path."""

    def __init__(
        self,
        problem: DiagnosisProblem,
        equations: Sequence[NormalEquations],
        free: GaussianPrior,
        largest: ModelForm,
        named: frozenset[str],
        explanation: Sequence[str],
    ) -> None:
        self._problem, self._equations, self._free, self._largest = problem, equations, free, largest
        self._named, self._explanation = named, explanation  # parameters of causes, and of all
        self._sum = sum(equations[1:], equations[0])
        self._scales: dict[tuple[str, float, float | None, bool], Array] = {}
        self.axes = tuple(largest.sizes)
        self.period, self.ahead = largest.period, largest.ahead

    @property
    def causes(self) -> frozenset[str]:
        """Parameters of the explanation's causes that are free."""
        return self._named & set(self._free.names)

    @classmethod
    def along(cls, problem: DiagnosisProblem, best: RefittedHypothesis, period: float | None) -> Self:
        """Columns along the path of an explanation, or where it does not follow the readings, along theirs.

        Parameters
        ----------
        period : of a resonance that a form may have [s]

        Raises
        ------
        ModelError
            if a run cannot be linearised along its path
        """
        model, fitted = problem.model, best.fit
        planar = model.dof == 3
        roll = period if planar and any(resonates(e) for e in model.kernel.effects) else None
        ahead = any(pushes_ahead(e) for e in model.kernel.effects)
        largest = ModelForm(dict.fromkeys("XYN" if planar else "XYZKMN", SIZES[-1]), roll, ahead)
        free = with_form(model, problem.stated, largest, problem.absent_fins)
        explanation = [model.effects[n] for n in best.effects if n in model.effects]
        for effect in explanation:
            if not any(effect.key(p.name) in free.names for p in effect.parameters):
                free = free + effect_prior(model, effect)
        follows = explains(best)
        level = 0.0 if follows else fitted.path_force_level
        points = fitted.points if follows else fitted.path_points
        if problem.form is None or problem.form.period != roll:  # the path of a refit with it has it already
            points = problem.swinging(points, largest, level)
        noise_model = levels_between(problem, level)[-1]

        def of_run(log: RunData, point: Trajectory, k: int) -> NormalEquations:
            path = linearise(model, log, point, free.where)
            return run_equations(model, path, free, noise_model, run=k)

        equations = each(of_run, problem.logs, points, range(len(problem.logs)))
        # what may be part of a form is asked for anew with it: the refits decide between the two
        causes = [e for e in explanation if not e.as_form]
        named = frozenset(e.key(p.name) for e in causes for p in e.parameters)
        whole = [e.key(p.name) for e in explanation for p in e.parameters if e.key(p.name) in free.names]
        return cls(problem, equations, free, largest, named, whole)

    def evidence(self, form: ModelForm) -> float:
        """Log evidence of the causes with a form; what may be part of a form is asked for anew with it."""
        keep, scale = self._columns(form)
        return posterior(scaled(self._sum, scale).pick(keep)).log_evidence

    def sizes(self, form: ModelForm, names: Sequence[str]) -> tuple[float, Array, Array]:
        """Log evidence of the whole explanation with a form, and (k,) values and standard deviations [SI] of
        parameters of its causes.

        Raises
        ------
        ModelError
            if a product is not finite, or no information is positive definite
        """
        keep, scale = self._whole(form)
        found = posterior(scaled(self._sum, scale).pick(keep))
        at = np.array([self._free.names.index(n) for n in names], dtype=int)
        here, unit = np.searchsorted(keep, at), self._free.sd[at] * scale[at]
        sd = unit * np.sqrt(np.diag(found.covariance)[here])
        return found.log_evidence, self._free.mean[at] + unit * found.mean[here], sd

    def explained(self) -> float:
        """Evidence of the whole explanation without a form."""
        keep, scale = self._whole(ModelForm(dict.fromkeys(self.axes, 0.0)))
        return posterior(scaled(self._sum, scale).pick(keep)).log_evidence

    def left_out(self, form: ModelForm) -> float:
        """Log density of every run given the others, with a form, in the sum."""
        keep, scale = self._columns(form)
        return float(left_out(tuple(scaled(g, scale).pick(keep) for g in self._equations)).sum())

    def _whole(self, form: ModelForm) -> tuple[Array, Array]:
        """Columns of a smaller form and of all the explanation has, with its own prior sd."""
        keep, scale = self._columns(form)
        own = np.array([self._free.names.index(n) for n in self._explanation], dtype=int)
        return np.union1d(keep, own), scale

    def _columns(self, form: ModelForm) -> tuple[Array, Array]:
        """Sorted columns of a smaller form, and every prior sd over that of the largest."""
        # every row is of one axis, and an effect acts where it acts in one of them
        scale = np.max([self._scale_in(form, axis) for axis in self.axes], axis=0)
        return np.flatnonzero(scale), np.where(scale > 0.0, scale, 1.0)

    def _scale_in(self, form: ModelForm, axis: str) -> Array:
        """Prior sd over that of the largest form, with a form in one axis only; 0 of what that lacks."""
        alone = replace(form, sizes={a: form.sizes[a] if a == axis else 0.0 for a in self.axes})
        key = (axis, form.sizes[axis], form.period, form.ahead)
        if key not in self._scales:
            model = self._problem.model
            wanted = with_form(model, self._problem.stated, alone, self._problem.absent_fins)
            size = {n: s for n, s in zip(wanted.names, wanted.sd, strict=True) if n not in self._named}
            of_form = form_effects(model, self._largest)
            own = {e.key(p.name) for e in of_form for p in e.parameters} - self._named
            scale = np.zeros(len(self._free.names))
            for i, name in enumerate(self._free.names):
                if name in size:
                    scale[i] = size[name] / self._free.sd[i]
                elif "." in name and name not in own:
                    scale[i] = 1.0  # of the explanation, not of the form
            self._scales[key] = scale
        return self._scales[key]
