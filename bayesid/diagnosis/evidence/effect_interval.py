"""Which interval of an effect's parameter to use: Laplace's or that of the draws.

Takes the record of a posterior (`effect_posterior.as_json`). Gives one word; warning, report and terminal
follow it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

ROUGH_DENSITY = 0.5  # nats the density of the draws may be off where they go


def trusted(posterior: Mapping[str, Any]) -> bool:
    """Whether the density the draws are of is right where they go."""
    off = posterior["linearised_anew"]
    return bool(off["roughness_nats"] < ROUGH_DENSITY and off["loudness_nats"] < ROUGH_DENSITY)


def choice(posterior: Mapping[str, Any]) -> str:
    """either, Laplace or draws.

    Draws that did not pass their convergence check are not used; where they differ from Laplace they are,
    unless their density is rough: then the wider of the two.
    """
    if not posterior["converged"]:
        return "Laplace"
    if posterior["agrees_with_laplace"]:
        return "either"
    if trusted(posterior):
        return "draws"
    ratio = [p["sd_over_laplace"] for n, p in posterior["parameters"].items() if "." in n]
    return "Laplace" if max(ratio) < 1.0 else "draws"


def warning(posterior: Mapping[str, Any]) -> str | None:
    """What a reader of the verdict alone has to know of the intervals; None where nothing."""
    picked = choice(posterior)
    if picked == "either":
        return None
    if not posterior["converged"]:
        return f"the posterior draws did not pass their convergence check: {posterior['reasons'][0]}; use the +- printed"  # noqa: E501
    differ = "the posterior is not the Gaussian its deviations suggest"
    if trusted(posterior):
        return f"{differ}; use the intervals of the draws, not the +- printed"
    use = "the intervals of the draws" if picked == "draws" else "the +- printed"
    return f"{differ}, and the density drawn from is not right to {ROUGH_DENSITY} nats; use {use}, the wider of the two"  # noqa: E501
