"""Per coefficient: what the prior knew, what the data added, and the verdict in words.

Takes `Information`. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bayesid.analysis.identifiability.information import Information

Verdict = Literal["fixed by data", "traded off", "too small to matter", "at a bound", "prior only"]
FIXED_DATA_SHARE = (
    0.75  # data share from which data fix a coefficient; its posterior sd is then at most half the prior
)
VISIBLE_NOISE_UNITS = 1.0  # noise units: what a move by the prior sd must change to matter
PARTNER_CORRELATION = 0.5  # posterior correlation from which partners are named ...
WEAK_CORRELATION = 0.2  # ... or, where there are none, the closest two
MOST_PARTNERS = 3


@dataclass(frozen=True)
class CoefficientRow:
    """One line of the coefficient table.

    Attributes
    ----------
    value, prior_sd, sd : SI
    stated : whether the prior was stated or assumed
    index : share of the data in the posterior variance, 0 to 1 (`Information.data_share`)
    contraction : 1 - posterior over prior variance; partners' priors can raise it, the index not
    prior_sensitivity : change of log posterior variance when the log of the prior is scaled; 1 - index
    reach : residual change for a move by the prior sd, all others known [noise units]
    partners : coefficients it is traded off with, closest first
    """

    name: str
    value: float
    prior_sd: float
    stated: bool
    sd: float
    index: float
    contraction: float
    prior_sensitivity: float
    reach: float
    verdict: Verdict
    partners: tuple[str, ...]

    @property
    def words(self) -> str:
        """The verdict with its partners."""
        if self.verdict == "traded off":
            return f"traded off with {', '.join(self.partners) or 'many, a little each'}"
        return self.verdict


def coefficient_rows(info: Information, at_bound: Iterable[str] = ()) -> tuple[CoefficientRow, ...]:
    """Entries of all parameters, in their order.

    Parameters
    ----------
    at_bound : parameters whose estimate lies on a bound
    """
    bound = set(at_bound)
    share, contraction, reach, sd = info.data_share, info.contraction, info.reach, info.sd
    correlation = info.correlation
    found = []
    for i, name in enumerate(info.names):
        partners: tuple[str, ...] = ()
        verdict: Verdict
        if name in bound:
            verdict = "at a bound"
        elif reach[i] <= 1e-9 * max(reach.max(), 1e-300):
            verdict = "prior only"
        elif reach[i] < VISIBLE_NOISE_UNITS:
            verdict = "too small to matter"
        elif share[i] >= FIXED_DATA_SHARE:
            verdict = "fixed by data"
        else:
            verdict, partners = "traded off", _partners(info, correlation[i], i)
        found.append(
            CoefficientRow(
                name, float(info.z[i]), float(info.unit[i]), bool(info.stated[i]), float(sd[i]),
                float(share[i]), float(contraction[i]), float(1.0 - share[i]), float(reach[i]), verdict,
                partners,
            )
        )  # fmt: skip
    return tuple(found)


def _partners(info: Information, correlation: np.ndarray, i: int) -> tuple[str, ...]:
    """Parameters most correlated with one in the posterior."""
    size = np.abs(correlation)
    order = [j for j in np.argsort(-size) if j != i]
    close = [j for j in order if size[j] >= PARTNER_CORRELATION][:MOST_PARTNERS] or [
        j for j in order[:2] if size[j] >= WEAK_CORRELATION
    ]
    return tuple(info.names[j] for j in close)
