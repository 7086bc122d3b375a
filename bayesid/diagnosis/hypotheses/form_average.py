"""Sizes of the effects of an explanation over all model forms that the runs allow.

Takes a `DiagnosisProblem` with a form and a refit of it. Gives values and standard deviations. One
linearisation along the refit; no refit.

How large a form is in every axis is estimated from the same runs. A refit has one form, and takes its size
for known; a lag and a force of the motion under the rudder share what they explain, and how much of it the
one has goes with how large the other may be.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from bayesid.diagnosis.data.model_form import ModelForm
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.form_columns import SIZES, FormColumns
from bayesid.errors import ModelError

Array = np.ndarray
# Nats behind the best form from which on one is left out (Occam's window; Madigan and Raftery 1994): together
# those hardly move a mean.
WINDOW = 6.0
MOST_FORMS = 200


def averaged_over_forms(
    problem: DiagnosisProblem, candidate: RefittedHypothesis, told: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Effect parameters: name -> (value, sd) in SI, of the mixture over the sizes of the form.

    Every size per axis is as probable before the runs. Deviations are at least those told: what single runs
    move is not in the linear model. A refit along whose path nothing can be linearised keeps what was told.

    Parameters
    ----------
    told : sizes to average; what is not estimated beside the form is left as it is
    """
    if problem.form is None or not told:
        return dict(told)
    try:
        columns = FormColumns.along(problem, candidate, problem.form.period)
        names = [n for n in told if n in columns.causes]
        if not names:
            return dict(told)
        found = list(_window(columns, problem.form, names))
        evidence, values, sd = (np.array(part) for part in zip(*found, strict=True))
    except ModelError:
        return dict(told)
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    mean = weight @ values
    within = np.maximum(np.sqrt(weight @ sd**2), [told[n][1] for n in names])
    whole = np.sqrt(within**2 + weight @ (values - mean) ** 2)
    return dict(told) | {n: (float(m), float(s)) for n, m, s in zip(names, mean, whole, strict=True)}


def _window(
    columns: FormColumns, form: ModelForm, names: Sequence[str]
) -> Iterator[tuple[float, Array, Array]]:
    """Evidence and sizes of the forms around one, a step up or down in one axis after the other, as far as
    they lie in the window of the best seen before."""
    steps = (0.0, *SIZES)
    first = tuple(int(np.argmin(np.abs(np.subtract(steps, form.sizes.get(a, 0.0))))) for a in columns.axes)
    best, waiting, met = -np.inf, deque([first]), {first}
    while waiting:
        at = waiting.popleft()
        sizes = {axis: steps[k] for axis, k in zip(columns.axes, at, strict=True)}
        found = columns.sizes(replace(form, sizes=sizes), names)
        yield found
        best = max(best, found[0])
        if found[0] < best - WINDOW:
            continue
        for axis, k in product(range(len(at)), (-1, 1)):
            near = (*at[:axis], at[axis] + k, *at[axis + 1 :])
            if 0 <= near[axis] < len(steps) and near not in met and len(met) < MOST_FORMS:
                met.add(near)
                waiting.append(near)
