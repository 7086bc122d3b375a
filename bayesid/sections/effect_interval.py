"""Which interval of an effect's parameter to use, Laplace's or that of the draws, and why they differ.

Takes the record of a diagnosis. Gives one choice and the words for it, in the report and on the terminal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bayesid.diagnose.density import LOUDNESS

SECTION = "How well its parameters are known"
# Begin of the warning a diagnosis carries where draws and Laplace differ; the choice below replaces it.
_DIFFER = "the posterior is not the Gaussian"


def beyond(posterior: Mapping[str, Any]) -> dict[str, float]:
    """Amplitudes of the environment the draws put outside the levels the density was computed for.

    Name -> factor on the assumed level.
    """
    return {
        name.removeprefix("log "): math.exp(p["mean"])
        for name, p in posterior["parameters"].items()
        if name.startswith("log ") and abs(p["mean"]) > LOUDNESS[-1]
    }


def choice(posterior: Mapping[str, Any]) -> str:
    """either, Laplace or draws.

    Draws that did not pass their gate are not used. Where they rest on an environment outside the levels
    computed, the wider of the two is; else, where they differ, the draws.
    """
    if not posterior["converged"]:
        return "Laplace"
    if posterior["agrees_with_laplace"]:
        return "either"
    if not beyond(posterior):
        return "draws"
    ratio = [p["sd_over_laplace"] for n, p in posterior["parameters"].items() if "." in n]
    return "Laplace" if max(ratio) < 1.0 else "draws"


def why(posterior: Mapping[str, Any], source: str, limit: float) -> str:
    """The choice and its reason, for the section on the parameters.

    Parameters
    ----------
    source : where the level of the environment comes from
    limit : largest logarithm of a level the density allows
    """
    picked = choice(posterior)
    if picked == "either":
        return "Both say the same: use either."
    if not posterior["converged"]:
        return (
            "**Use the ± of the lead** (Laplace): the draws did not pass their gate "
            f"({'; '.join(posterior['reasons'])})."
        )
    ratio = [p["sd_over_laplace"] for n, p in posterior["parameters"].items() if "." in n]
    spread = f"{min(ratio):.2f}" + (f" to {max(ratio):.2f}" if len(ratio) > 1 else "")
    use = "**Use the intervals of the draws**" if picked == "draws" else "**Use the ± of the lead** (Laplace)"
    differ = f"the sd of the effects' parameters in the draws is {spread} of Laplace's. "
    moved = beyond(posterior)
    if not moved:
        return (
            f"{use}: {differ}The density is bent where Laplace takes it for a Gaussian, and the draws follow "
            "the bend."
        )
    factors = " and ".join(f"the {n} at {f:.2f}" for n, f in moved.items())
    reach = [
        max(-p["low95"], p["high95"]) for n, p in posterior["parameters"].items() if n.startswith("log ")
    ]
    edge = "The draws even lie against the end of what it allows. " if max(reach) > 0.95 * limit else ""
    against = ", and against what straight runs measured" if source == "measured" else ""
    low, high = (math.exp(x) for x in (LOUDNESS[0], LOUDNESS[-1]))
    return (
        f"{use}, the wider of the two: {differ}Laplace keeps the environment at its level ({source}); the "
        f"draws let it go and put {factors} of it, and error bars follow the level. That lies outside the "
        f"{low:.2f} to {high:.2f} for which the density was computed{against}. {edge}"
        "The narrower interval holds only if the environment really was that far from it."
    )


def lead_words(record: Mapping[str, Any]) -> str:
    """What the ± of the lead is worth, where that needs a word."""
    posterior = record.get("posterior")
    picked = "either" if posterior is None else choice(posterior)
    if picked == "either":
        return ""
    if picked == "draws":
        return f"Instead of the ± use the intervals of the draws under `{SECTION}`, which says why."
    return f"Use this ±; `{SECTION}` says why not that of the draws."


def warnings_told(record: Mapping[str, Any]) -> list[str]:
    """Warnings of a diagnosis, that on the intervals replaced by the choice."""
    out = []
    for warning in record["warnings"]:
        posterior = record.get("posterior")
        if posterior is not None and warning.startswith(_DIFFER):
            if choice(posterior) == "Laplace":
                warning = (
                    "the posterior draws differ from the Gaussian because they move the environment far from "
                    "its level; use the +- printed, which is the wider"
                )
            else:
                warning = (
                    "the posterior draws differ from the Gaussian; use their intervals, not the +- printed"
                )
        out.append(warning)
    return out
