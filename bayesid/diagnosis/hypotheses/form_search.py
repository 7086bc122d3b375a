"""Whether the runs need a model form, how large, and how much of the gap it carries.

Takes a `DiagnosisProblem` and an explanation without a form. Gives the `SoughtForm` of most evidence, or
None. One linearisation along that explanation; no refit.

A form is needed where both say so beside the explanation: the evidence, its size averaged over nothing but
chosen per axis, and the density of every run given the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from bayesid.diagnosis.data.model_form import ModelForm
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.form_columns import SIZES, FormColumns
from bayesid.diagnosis.threshold_table import ADD_EVIDENCE, FORM_EVIDENCE, LEAST_RUNS
from bayesid.errors import ModelError

# Rounds over the axes: the size of one changes what another needs.
ROUNDS = 2


@dataclass(frozen=True)
class SoughtForm:
    """A form, and what it gains beside the explanation it was asked for with.

    Attributes
    ----------
    gain : over the explanation without what may be part of a form, which is asked for anew with it [nats]
    beyond : over the whole explanation [nats]
    predicts : whether every run given the others is more probable with it, in the sum; true of too few runs
    """

    form: ModelForm
    gain: float
    beyond: float
    predicts: bool

    @property
    def needed(self) -> bool:
        """Whether evidence and left-out runs ask for it."""
        return self.predicts and self.gain >= FORM_EVIDENCE


def sought_form(
    problem: DiagnosisProblem, best: RefittedHypothesis, period: float | None
) -> SoughtForm | None:
    """Form of most evidence beside an explanation without one; None where none has any.

    Parameters
    ----------
    period : of what the explanation leaves, where that has one [s]
    """
    try:
        return _asked_for(problem, FormColumns.along(problem, best, period))
    except ModelError:
        return None


def _asked_for(problem: DiagnosisProblem, equations: FormColumns) -> SoughtForm | None:
    """Sizes of most evidence, axis by axis; None where that is no form."""
    nothing = ModelForm(dict.fromkeys(equations.axes, 0.0))
    best, form = equations.evidence(nothing), nothing
    base = best
    for _ in range(ROUNDS):
        for axis in equations.axes:
            for size in (0.0, *SIZES):
                tried = replace(form, sizes={**form.sizes, axis: size})
                value = equations.evidence(tried)
                if value > best + (ADD_EVIDENCE if form.sizes[axis] == 0.0 else 0.0):
                    best, form = value, tried
        for more in ({"ahead": equations.ahead}, {"period": equations.period}):
            tried = replace(form, **more)
            if tried != form and (value := equations.evidence(tried)) > best + ADD_EVIDENCE:
                best, form = value, tried
    if not form.acts:
        return None
    few = len(problem.logs) < LEAST_RUNS
    predicts = few or equations.left_out(form) > equations.left_out(nothing)
    return SoughtForm(form, float(best - base), float(best - equations.explained()), predicts)
