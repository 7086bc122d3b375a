"""The force a model's equations lack and that depends on the motion, as unknowns beside the coefficients.

Takes a `Model`, the prior of its coefficients and a size per axis. Gives the prior of everything that is free
in every hypothesis. Does not ask whether the runs need it (`hypotheses.form_search`).

Three kinds of unknowns make it up. Rows of the force table the vehicle lacks, normal about zero. Its own rows
of the same kinds, whose prior is widened by as much: the file's values were tuned to other equations. Effects
declared as such functions of the motion (`Effect.as_form`): strips in cross flow, cubes, roll,
a list in turns.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.likelihood.model_form import depends_on_motion, form_rows, typical
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.estimation.run_data import RunData
from bayesid.model.effects import Effect
from bayesid.model.terms import TERMS, term
from bayesid.model.vehicles.vehicle import FINS

Array = np.ndarray
_ROWS = frozenset(t.name for t in TERMS)
# Standard deviation of a natural frequency over the one seen, which is read off a spectrum.
FREQUENCY_SPREAD = 0.1
FREQUENCY = "frequency"


@dataclass(frozen=True)
class ModelForm:
    """Size of the form.

    Attributes
    ----------
    sizes : axis -> standard deviation of every row's force over 1/2 rho L^2 U^2 (moments L^3) at the typical
        motion; 0 for none
    period : of a resonance the planar model leaves out [s]; None without
    ahead : whether drag may go with another power of the speed, which acts on a straight course as well
    """

    sizes: Mapping[str, float]
    period: float | None = None
    ahead: bool = False

    @property
    def acts(self) -> bool:
        return self.ahead or self.period is not None or any(self.sizes.values())


def form_effects(model: Model, form: ModelForm) -> tuple[Effect, ...]:
    """Declared effects that are part of a form: those in its axes, and what a planar model leaves out."""
    if not form.acts:
        return ()
    chosen = []
    for effect in model.kernel.effects:
        acts = any(form.sizes.get(axis, 0.0) for axis in effect.force)
        if resonates(effect):
            acts = form.period is not None
        elif pushes_ahead(effect):
            acts = form.ahead
        elif not effect.force:  # of a sensor
            acts = effect.as_form == "only" and (form.period is not None or any(form.sizes.values()))
        if acts and effect.as_form in ("also", "only"):
            chosen.append(effect)
    return tuple(chosen)


def absent_fins(model: Model, logs: Iterable[RunData]) -> frozenset[str]:
    """Fins of the equations that the vehicle does not have: its file has no row of them, no run moves them.

    A 6-DOF model has bow planes whether or not the vehicle has.
    """
    there = {f.symbol for n in model.vehicle.coef for f in term(n).factors}
    plans, names = [log.plan for log in logs], model.kernel.actuators
    moved = {n for a, n in enumerate(names) if any(plan.levels[:, a].any() for plan in plans)}
    return frozenset(n for n in names if n in FINS and n not in there and n not in moved)


def with_form(
    model: Model, stated: GaussianPrior, form: ModelForm, absent: frozenset[str] = frozenset()
) -> GaussianPrior:
    """Prior of the coefficients with a form: the stated ones first, wider; then its own unknowns.

    Parameters
    ----------
    absent : fins that the vehicle does not have; no row of theirs is free
    """
    wide = np.array([_row_sd(model, n, form) for n in stated.names])
    lacked = (n for n in form_rows(model, cubes_of_fins=True) if n not in stated.names)
    lacked = (n for n in lacked if not absent & {f.symbol for f in term(n).factors})
    rows = tuple(n for n in lacked if _row_sd(model, n, form) > 0)
    added = GaussianPrior(
        rows,
        model.positions(rows),
        np.zeros(len(rows)),
        np.array([_row_sd(model, n, form) for n in rows]),
        np.full(len(rows), -np.inf),
    )
    out = replace(stated, sd=np.hypot(stated.sd, wide)) + added
    for effect in form_effects(model, form):
        out = out + _effect_prior(model, effect, form)
    return out


def frequency_start(model: Model, form: ModelForm, par: Array) -> Array:
    """Parameters with the natural frequency of a form's resonance at what was seen."""
    out = par.copy()
    for effect in form_effects(model, form):
        if resonates(effect):
            out[model.index[effect.key(FREQUENCY)]] = _frequency(model, form)
    return out


def resonates(effect: Effect) -> bool:
    """Whether it is part of a form only where a period was seen: that of a motion left out."""
    return effect.as_form == "only" and any(p.name == FREQUENCY for p in effect.parameters)


def pushes_ahead(effect: Effect) -> bool:
    """Whether it is part of a form only where the runs ask for it by itself: a force ahead alone."""
    return effect.as_form == "only" and effect.family == "power_of_drag"


def _frequency(model: Model, form: ModelForm) -> float:
    assert form.period is not None
    return float(2 * np.pi / form.period * model.scales["L"] / model.scales["U"])


def _effect_prior(model: Model, effect: Effect, form: ModelForm) -> GaussianPrior:
    prior = effect_prior(model, effect)
    if not resonates(effect):
        return prior
    mean, sd = prior.mean.copy(), prior.sd.copy()
    i = prior.names.index(effect.key(FREQUENCY))
    mean[i] = _frequency(model, form)
    sd[i] = FREQUENCY_SPREAD * mean[i]
    return replace(prior, mean=mean, sd=sd)


def _row_sd(model: Model, name: str, form: ModelForm) -> float:
    if name not in _ROWS or not depends_on_motion(term(name)):
        return 0.0
    return form.sizes.get(term(name).axis, 0.0) * abs(typical(model, name))
