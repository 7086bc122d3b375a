"""How much of the gap a model form carries beside an explanation, and what it leaves to name.

Takes a refit of a problem with a form. Gives log evidence. No refit, no linearisation.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.data.model_form import ModelForm, with_form
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis
from bayesid.diagnosis.hypotheses.cross_validation import disagreement
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.parameters import GaussianPrior

Array = np.ndarray
# Axes whose force is the same for sideways motion to port and to starboard.
EVEN = frozenset("XZM")


def form_gain(
    problem: DiagnosisProblem, candidate: RefittedHypothesis, axes: Collection[str] | None = None
) -> float:
    """Log evidence a refit would lose without the form, along its own path [nats].

    Divided by how much the runs disagree about the form (quasi-likelihood; Wedderburn 1974): a force that
    depends on the motion is the same function in every run.

    Parameters
    ----------
    axes : without the form in these only; in all of them where not given
    """
    lost = lost_without_form(problem, candidate, axes)
    return lost / form_excess(problem, candidate) if lost > 0.0 else 0.0


def lost_without_form(
    problem: DiagnosisProblem,
    candidate: RefittedHypothesis,
    axes: Collection[str] | None = None,
    resonance: bool = True,
) -> float:
    """What a refit would lose without the form, or without it in some axes, however far the runs disagree
    about it [nats].

    Parameters
    ----------
    resonance : whether the resonance, and with it what a form has in none of its axes (heel in the yaw rate),
        goes with all axes or stays
    """
    form, model = problem.form, problem.model
    if form is None:
        return 0.0
    whole = axes is None or set(form.sizes) <= set(axes)
    rest = ModelForm(
        {axis: 0.0 if whole or axis in (axes or ()) else size for axis, size in form.sizes.items()},
        None if whole and resonance else form.period,
        form.ahead and not whole and "X" not in (axes or ()),
    )
    if rest == replace(form, sizes=dict(form.sizes)):
        return 0.0
    fitted = candidate.fit
    total = sum(fitted.equations[1:], fitted.equations[0])
    try:
        prior = with_form(model, problem.stated, rest, problem.absent_fins)
        without = posterior(_with_prior(problem, fitted.free, total, prior))
        return max(posterior(total).log_evidence - without.log_evidence, 0.0)
    except ModelError:
        return 0.0


def form_excess(problem: DiagnosisProblem, candidate: RefittedHypothesis) -> float:
    """How much the runs disagree about the whole form along the path of a refit: chi-square over its degrees
    of freedom, at least 1.
    """
    fitted = candidate.fit
    own = np.arange(len(problem.stated.names), len(problem.coefficients.names))
    common = np.setdiff1d(np.arange(len(fitted.free.names)), own)
    last = tuple(g.pick(np.concatenate([common, own])) for g in fitted.equations)
    return max(disagreement(last, common.size)[1], 1.0)


def _with_prior(
    problem: DiagnosisProblem, free: GaussianPrior, total: NormalEquations, wanted: GaussianPrior
) -> NormalEquations:
    """Equations with another prior of coefficients and form: what that widens, not what a hypothesis does."""
    sd = dict(zip(wanted.names, wanted.sd, strict=True))
    scale = np.ones(len(free.names))
    for i, (name, wide) in enumerate(zip(problem.coefficients.names, problem.coefficients.sd, strict=True)):
        scale[i] = sd.get(name, 0.0) / wide
    return scaled(total, scale).pick(np.flatnonzero(scale))


def axes_of(problem: DiagnosisProblem, name: str) -> frozenset[str]:
    """Axes of the form that may stand for an effect.

    Those of its force, where they are even in sideways motion; else all: what a form leaves sideways, roll
    among it, shows in every channel but drives nothing ahead (port-starboard symmetry).
    """
    every = frozenset(problem.form.sizes) if problem.form is not None else frozenset()
    effect = problem.model.effects.get(name)
    acts = frozenset(effect.force or ()) if effect is not None else frozenset()
    return acts & every if acts and acts <= EVEN and acts & every else every


def beyond(gain: float, carried: float) -> float:
    """What a gain is worth beyond as much as a form carries; a loss stays."""
    return gain if gain <= 0 else max(gain - carried, 0.0)


def scaled(g: NormalEquations, scale: Array) -> NormalEquations:
    """Equations of unknowns whose prior sd are multiplied."""
    return NormalEquations(g.ss * np.outer(scale, scale), g.se * scale, g.ee, g.logdet, g.used)
