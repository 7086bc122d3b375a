"""What predictions of runs and of manoeuvres share: explanations as they are, the disturbance, lost draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.linearise import with_forces
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.run_data import Array
from bayesid.prediction.prediction import Centre
from bayesid.simulation import TimePlan, inertia_ratio

# Share of draws that may diverge before the prediction is refused.
MOST_DIVERGED = 0.2

Undisturbed = Callable[[Array, NoiseModel], tuple[Array, Mapping[str, Array] | None] | None]


def centres_of(found: DiagnosedModel, undisturbed: Undisturbed) -> tuple[Centre, ...]:
    """Every explanation, where all have the coefficients as given; none where one of them diverges."""
    out: list[Centre] = []
    for h in found.hypotheses if found.coefficients_as_given else ():
        if (centre := _centre(found, h, undisturbed)) is None:
            return ()
        out.append(centre)
    return tuple(out)


def estimate_of(found: DiagnosedModel, undisturbed: Undisturbed) -> Centre | None:
    """The estimate of a fit, whose hypotheses differ in the noise model alone."""
    if found.verdict != "fit":
        return None
    return _centre(found, max(found.hypotheses, key=lambda h: h.weight), undisturbed)


def _centre(found: DiagnosedModel, h: WeightedHypothesis, undisturbed: Undisturbed) -> Centre | None:
    """The mean of a hypothesis as one vehicle; None where it diverges."""
    par = found.model.nominal.copy()
    par[found.model.positions(h.names)] = h.mean
    made = undisturbed(par, h.noise_model)
    return None if made is None else Centre(h.weight, *made)


def slow_errors(noise_model: NoiseModel, channels: Sequence[str]) -> Array:
    """(nd,) standard deviations of the slow errors of the measured positions [m]."""
    return np.array([noise_model.slow(c) for c in channels if c in ("x", "y", "z")])


def disturbed(model: Model, par: Array, plan: TimePlan, force: Array) -> TimePlan:
    """Plan with the disturbance, which is stated for the nominal inertia."""
    ratio, _ = inertia_ratio(model, par, np.zeros(0, dtype=np.int64))
    return with_forces(model, plan, force @ ratio.T)


class DivergingDraws(ModelError):
    """More of the draws diverge than a prediction may lose."""


def require_enough(name: str, kept: int, draws: int, most_diverged: float = MOST_DIVERGED) -> None:
    if kept < max((1.0 - most_diverged) * draws, 1):
        raise DivergingDraws(
            f"{name}: {draws - kept} of {draws} draws diverge; the coefficients are too uncertain to predict "
            "this run"
        )
