"""What a fit found: numbers, how sure they are, where the time went and why it stopped.

Frozen data, stored as fit.json. Does not draw, print or judge a model.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import FitError
from bayesid.estimation.output_error.flat_directions import Direction
from bayesid.files import write_json

Array = np.ndarray
CONVERGED = ("converged", "rounding", "goal")


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of one fit; a failed one too.

    Attributes
    ----------
    names : of all unknowns, the `n_params` parameters first, then initial states "run:psi(0)"
    z, start, low, high : (k,) SI
    sd : (k,) at the estimate, prior included: of white noise, unless `uncertainty` says otherwise; inf where
        nothing holds
    covariance : (n_params, n_params) of the parameters, as `sd`
    prior_sd : (k,) of single priors, inf where there is none
    cost_start, cost : half the sum of squared residuals (half of V for the paper's objective)
    at_bound : names on a bound, or within 1e-6 of its width
    status : "converged", "rounding", "goal", "stalled", "budget" or "diverged"; `message` says it in words
    flat : combinations the data leave open
    costs, steps : per iteration of the winning start; step is the rms relative change of the unknowns
    shares : share of time in line search (cost), gradient, subproblem with Hessian update, other; `seconds`
        in all
    starts : per start its first and last cost and stop reason
    sigma, channel_rms : per channel [SI]
    uncertainty : what `sd` and `covariance` rest on where they are not those of white noise (`likelihood`)
    """

    names: tuple[str, ...]
    n_params: int
    z: Array
    start: Array
    low: Array
    high: Array
    scale: Array
    sd: Array
    covariance: Array
    prior_sd: Array
    cost_start: float
    cost: float
    n_readings: int
    at_bound: tuple[str, ...]
    status: str
    message: str
    predicted_gain: float
    flat: tuple[Direction, ...]
    singular_values: Array
    costs: tuple[float, ...]
    steps: tuple[float, ...]
    rounds: int
    shares: Mapping[str, float]
    seconds: float
    n_cost: int
    n_gradient: int
    starts: tuple[Mapping[str, Any], ...]
    sigma: Mapping[str, float]
    channel_rms: Mapping[str, float]
    seed: int
    digest: str
    uncertainty: Mapping[str, Any] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """Whether the search ended at a minimum; says nothing about whether the data determine it."""
        return self.status in CONVERGED

    @property
    def success(self) -> bool:
        """Converged, the runs agree, and no combination is left open by data and prior together."""
        agreed = bool(self.uncertainty.get("final", True))
        return self.converged and agreed and all(d.decided_by == "prior" for d in self.flat)

    @property
    def verdict(self) -> str:
        """One sentence: converged or not, and what the data do not determine."""
        open_ones = [d for d in self.flat if d.decided_by != "prior"]
        if not self.flat:
            return self.message
        if not open_ones:
            word = "combination rests" if len(self.flat) == 1 else "combinations rest"
            return f"{self.message}; {len(self.flat)} {word} on the prior, not on these data"
        word = "combination is" if len(open_ones) == 1 else "combinations are"
        return (
            f"{self.message}; not a success: {len(open_ones)} {word} not determined by these data "
            f"({'; '.join(d.name for d in open_ones[:3])}{' ...' if len(open_ones) > 3 else ''})"
        )

    @property
    def values(self) -> dict[str, float]:
        """Parameter -> SI estimate, initial states left out."""
        return {n: float(v) for n, v in zip(self.names[: self.n_params], self.z, strict=False)}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write as JSON, whole or not at all."""
        return write_json(path, self)


def load_fit(path: str | os.PathLike[str]) -> Fit:
    """Read what `Fit.save` wrote.

    Raises
    ------
    FitError
        if the file is missing or not a fit
    """
    target = Path(path)
    try:
        return _fit_of(json.loads(target.read_text(encoding="utf-8")))
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise FitError(f"{target.name}: not a stored fit ({type(error).__name__}: {error})") from None


def _fit_of(raw: dict[str, Any]) -> Fit:
    known = {f.name: raw[f.name] for f in fields(Fit) if f.name in raw or f.name != "uncertainty"}
    for name in ("z", "start", "low", "high", "scale", "sd", "prior_sd", "singular_values"):
        known[name] = _array(known[name])
    # files of before hold that of the initial states too
    rows = [_array(row)[: known["n_params"]] for row in known["covariance"][: known["n_params"]]]
    known["covariance"] = np.array(rows)
    known["flat"] = tuple(Direction(**{**d, "vector": _array(d["vector"])}) for d in known["flat"])
    for name in ("names", "at_bound", "costs", "steps", "starts"):
        known[name] = tuple(known[name])
    known["costs"] = tuple(float(c) for c in known["costs"])
    return Fit(**known)


def _array(values: Any) -> Array:
    return np.array([np.nan if v is None else float(v) for v in values], dtype=float)
