"""Words for why the interval shown of an effect's parameter is Laplace's, or that of the draws.

Takes the draws of a result. The choice itself is `bayesid.diagnosis.evidence.effect_draws`'s.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.evidence.effect_draws import EffectDraws, choice, trusted

SECTION = "How well its parameters are known"
FAR = 0.5  # logarithm of an amplitude that draws have moved, and error bars with it


def moved(posterior: EffectDraws) -> dict[str, float]:
    """Amplitudes of the environment the draws put far from their level: name -> factor on it."""
    return {
        name.removeprefix("log "): math.exp(p.mean)
        for name, p in posterior.parameters.items()
        if name.startswith("log ") and abs(p.mean) > FAR
    }


def why(posterior: EffectDraws, source: str) -> str:
    """The choice and its reason, for the section on the parameters.

    Parameters
    ----------
    source : where the level of the environment comes from
    """
    picked = choice(posterior)
    if picked == "either":
        return "Draws and Laplace say the same."
    if not posterior.converged:
        return (
            "**The interval shown is Laplace's**: the draws did not pass their convergence check "
            f"({'; '.join(posterior.reasons)})."
        )
    ratio = posterior.ratios
    spread = f"{min(ratio):.2f}" + (f" to {max(ratio):.2f}" if len(ratio) > 1 else "")
    shown = "that of the draws" if picked == "draws" else "Laplace's"
    use = f"**The interval shown is {shown}**"
    differ = f"the sd of the effects' parameters in the draws is {spread} of Laplace's. "
    if not trusted(posterior):
        off = posterior.linearised_anew
        return (
            f"{use}, the wider of the two: {differ}The density drawn from is itself only right to "
            f"{max(off.roughness_nats, off.noise_scale_nats):.2g} nats."
        )
    levels = moved(posterior)
    if not levels:
        return (
            f"{use}: {differ}The density is bent where Laplace takes it for a Gaussian, and the draws follow "
            "the bend."
        )
    factors = " and ".join(f"the {n} at {f:.2f}" for n, f in levels.items())
    against = (
        " The straight runs measured another level, without the effect: if it acts in them too, they took it "
        "for process noise."
        if source == "measured"
        else ""
    )
    return (
        f"{use}: {differ}Laplace keeps the environment at its level ({source}); the draws put {factors} of "
        f"it, and error bars follow the level.{against}"
    )
