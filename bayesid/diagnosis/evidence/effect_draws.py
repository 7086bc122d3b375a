"""Draws of an effect's parameters as final numbers, and which interval to use: theirs or Laplace's.

Takes nothing but numbers. Gives one word; warning, report and terminal follow it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

ROUGH_DENSITY = 0.5  # nats the density of the draws may be off where they go


@dataclass(frozen=True)
class ParameterDraws:
    """One unknown: mean, deviation and 95 % interval of its draws, and how they differ from Laplace's."""

    mean: float
    sd: float
    low95: float
    high95: float
    sd_over_laplace: float
    shift_in_laplace_sd: float


@dataclass(frozen=True)
class DensityCheck:
    """How the density drawn from was linearised anew.

    Attributes
    ----------
    nodes : points of linearisation
    missed_nats : log density missed at each, over the least
    roughness_nats : how far the density may be off between them
    noise_scale_nats : the same between levels of the environment
    noise_scale : amplitude of the environment -> factors on its level at which the density was computed
    """

    nodes: int
    missed_nats: tuple[float, ...]
    roughness_nats: float
    noise_scale_nats: float
    noise_scale: Mapping[str, tuple[float, ...]]


@dataclass(frozen=True)
class EffectDraws:
    """Posterior draws of the named effects' parameters and of what could hide them, in numbers.

    Attributes
    ----------
    reasons : why the draws did not pass their convergence check
    log_evidence, log_evidence_error : by bridge sampling [nats]
    """

    parameters: Mapping[str, ParameterDraws]
    agrees_with_laplace: bool
    converged: bool
    reasons: tuple[str, ...]
    log_evidence: float
    log_evidence_error: float
    linearised_anew: DensityCheck

    @property
    def ratios(self) -> list[float]:
        """sd of the draws over Laplace's, of the effects' parameters only."""
        return [p.sd_over_laplace for n, p in self.parameters.items() if "." in n]


def trusted(posterior: EffectDraws) -> bool:
    """Whether the density the draws are of is right where they go."""
    off = posterior.linearised_anew
    return off.roughness_nats < ROUGH_DENSITY and off.noise_scale_nats < ROUGH_DENSITY


def choice(posterior: EffectDraws) -> str:
    """either, Laplace or draws.

    Draws that did not pass their convergence check are not used; where they differ from Laplace they are,
    unless their density is rough: then the wider of the two.
    """
    if not posterior.converged:
        return "Laplace"
    if posterior.agrees_with_laplace:
        return "either"
    if trusted(posterior):
        return "draws"
    return "Laplace" if max(posterior.ratios) < 1.0 else "draws"


def warning(posterior: EffectDraws) -> str | None:
    """What a reader of the verdict alone has to know of the intervals; None where nothing."""
    picked = choice(posterior)
    if picked == "either":
        return None
    if not posterior.converged:
        return (
            f"the posterior draws did not pass their convergence check: {posterior.reasons[0]}; use the +- "
            "printed"
        )
    differ = "the posterior is not the Gaussian its deviations suggest"
    if trusted(posterior):
        return f"{differ}; use the intervals of the draws, not the +- printed"
    use = "the intervals of the draws" if picked == "draws" else "the +- printed"
    return (
        f"{differ}, and the density drawn from is not right to {ROUGH_DENSITY} nats; use {use}, the wider of "
        "the two"
    )
