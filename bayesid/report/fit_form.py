"""The model form of a fit, as kept in its uncertainty.

Takes a `Fit`. Gives numbers. Does not fit.
"""

from __future__ import annotations

from collections.abc import Mapping

from bayesid.estimation.output_error import Fit


def form_rows_of(fit: Fit) -> Mapping[str, float]:
    """Rows of the model form a fit needed: force over 1/2 rho L^2 U^2 at the typical motion."""
    return fit.uncertainty.get("form", {}).get("rows", {})
