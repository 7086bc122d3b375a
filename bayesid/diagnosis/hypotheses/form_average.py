"""Sizes of the effects of an explanation over all model forms that the runs allow.

Takes a `DiagnosisProblem` with a form and a refit of it. Gives values and standard deviations. One
linearisation along the refit; no refit.

How large a form is in every axis is estimated from the same runs. A refit has one form, and takes its size
for known; a lag and a force of the motion under the rudder share what they explain, and how much of it the
one has goes with how large the other may be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.linalg import LinAlgError

from bayesid.diagnosis.data.model_form import ModelForm
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, explains
from bayesid.diagnosis.hypotheses.form_columns import SIZES, FormColumns
from bayesid.errors import ModelError

Array = np.ndarray
Sizes = tuple[float, Array, Array]  # log evidence, values, standard deviations
STEPS = (0.0, *SIZES)
# Of more axes than a planar model has, forms within a step of the most probable in each: 729 of 15625.
ALL_OF_AXES = 3


def averaged_over_forms(
    problem: DiagnosisProblem, candidate: RefittedHypothesis, told: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Effect parameters: name -> (value, sd) in SI, of the mixture over the sizes of the form.

    Every size per axis is as probable before the runs (Bayesian model averaging; Hoeting et al. 1999). A
    value moves by what the mean over the forms differs from the size with the form of the refit, and stays
    within the limits of its effect; a deviation is at least that told (what single runs move is not in the
    linear model), and wider by how much the forms differ. What is told of a refit that does not follow the
    readings, or along whose path nothing can be linearised, stays.

    Parameters
    ----------
    told : sizes to average; what is not estimated beside the form is left as it is
    """
    form, model = problem.form, problem.model
    if form is None or not told or not explains(candidate):
        return dict(told)
    try:
        columns = FormColumns.along(problem, candidate, form.period)
        names = [n for n in told if n in columns.causes]
        if not names:
            return dict(told)
        form = replace(form, sizes={axis: form.sizes.get(axis, 0.0) for axis in columns.axes})
        _, here, _ = columns.sizes(form, names)
    except (ModelError, LinAlgError):
        return dict(told)
    evidence, values, sd = (np.array(part) for part in zip(*_forms(columns, form, names), strict=True))
    low, high = np.array([model.effect_limits.get(model.index[n], (-np.inf, np.inf)) for n in names]).T
    values, here = np.clip(values, low, high), np.clip(here, low, high)
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    mean = weight @ values
    given = np.array([told[n] for n in names])
    within = np.maximum(np.sqrt(weight @ sd**2), given[:, 1])
    whole = np.sqrt(within**2 + weight @ (values - mean) ** 2)
    moved = given[:, 0] + mean - here
    moved = np.clip(moved, np.minimum(low, given[:, 0]), np.maximum(high, given[:, 0]))
    return dict(told) | {n: (float(m), float(s)) for n, m, s in zip(names, moved, whole, strict=True)}


def _forms(columns: FormColumns, form: ModelForm, names: Sequence[str]) -> list[Sizes]:
    """Evidence and sizes of all forms, or of those around the most probable; what has none is left out."""
    axes, seen = columns.axes, dict[tuple[int, ...], Sizes | None]()

    def at(place: tuple[int, ...]) -> float:
        if place not in seen:
            sizes = {axis: STEPS[k] for axis, k in zip(axes, place, strict=True)}
            try:
                seen[place] = columns.sizes(replace(form, sizes=sizes), names)
            except (ModelError, LinAlgError):
                seen[place] = None
        found = seen[place]
        return -np.inf if found is None else found[0]

    steps = range(len(STEPS))
    if len(axes) <= ALL_OF_AXES:
        reach = [list(steps)] * len(axes)
    else:
        best, before = tuple(int(np.abs(np.subtract(STEPS, form.sizes[a])).argmin()) for a in axes), None
        while best != before:
            before = best
            for i in range(len(axes)):
                best = max(((*best[:i], k, *best[i + 1 :]) for k in steps), key=at)
        reach = [[k for k in (b - 1, b, b + 1) if k in steps] for b in best]
    around = list(product(*reach))
    for place in around:
        at(place)
    return [found for place in around if (found := seen[place]) is not None]
