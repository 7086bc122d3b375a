"""How much of the gap a model form carries beside an explanation, and what it leaves to name.

Takes a refit of a problem with a form. Gives log evidence. No refit, no linearisation.
"""

from __future__ import annotations

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.cross_validation import disagreement
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior

Array = np.ndarray


def form_gain(problem: DiagnosisProblem, candidate: RefittedHypothesis) -> float:
    """Log evidence a refit would lose without the form, along its own path [nats].

    Divided by how much the runs disagree about the form (quasi-likelihood; Wedderburn 1974): a force that
    depends on the motion is the same function in every run.
    """
    if problem.form is None:
        return 0.0
    fitted, stated = candidate.fit, problem.stated
    k = len(stated.names)
    scale = np.ones(len(fitted.free.names))
    # what the form widens, not what a hypothesis does
    scale[:k] = stated.sd / problem.coefficients.sd[:k]
    keep = np.concatenate([np.arange(k), np.arange(len(problem.coefficients.names), scale.size)])
    total = sum(fitted.equations[1:], fitted.equations[0])
    try:
        with_it, less = posterior(total), posterior(scaled(total, scale).pick(keep))
    except ModelError:
        return 0.0
    gain = max(with_it.log_evidence - less.log_evidence, 0.0)
    own = np.arange(k, len(problem.coefficients.names))
    last = tuple(g.pick(np.concatenate([keep, own])) for g in fitted.equations)
    _, excess = disagreement(last, keep.size)
    return gain / max(excess, 1.0)


def beyond(gain: float, carried: float) -> float:
    """What a gain is worth beyond as much as a form carries; a loss stays."""
    return gain if gain <= 0 else max(gain - carried, 0.0)


def scaled(g: NormalEquations, scale: Array) -> NormalEquations:
    """Equations of unknowns whose prior sd are multiplied."""
    return NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, g.ee, g.logdet, g.used)
