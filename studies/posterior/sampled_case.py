"""What the posterior study hands to its report: sampled cases and predicted runs.

Plain data. Does not compute or choose words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.identifiability import Derived, Identifiability, TrackBands
from bayesid.estimation.output_error import FitProblem
from bayesid.estimation.sampling import Posterior

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Sampled:
    """One case: a problem, its posterior by one or two samplers, and what identifiability says of it.

    posteriors : by sampler; empty where the case was looked at by its Laplace approximation only
    draws : (m, k) of the parameters [SI], of the first posterior or of Laplace
    behaviour : derived quantities of prior and posterior
    truth : (k,) [SI] of a simulated recovery; None for a real log
    """

    key: str
    words: str
    problem: FitProblem
    z: Array
    posteriors: Mapping[str, Posterior]
    draws: Array
    seen: Identifiability
    behaviour: tuple[Derived, Derived]
    truth: Array | None = None

    @property
    def vehicle(self) -> Array:
        """(n,) all parameters of the true vehicle of a simulated recovery [SI]."""
        model = self.problem.model
        values = self.nominal if self.truth is None else self.truth
        return self.problem.params.place(np.array(model.nominal), model.index, values)

    @property
    def nominal(self) -> Array:
        """(k,) values of the vehicle file, the centre of a simulated recovery's prior."""
        return np.asarray(self.problem.model.nominal[self.problem.model.positions(self.seen.names)])


@dataclass(frozen=True, eq=False)
class Tracks:
    """One run of the true vehicle (n, nx), and the bands of prior and posteriors around it."""

    name: str
    truth: Array
    bands: Mapping[str, TrackBands]


def in_prior_units(case: Sampled) -> Array:
    """(m, k) draws of the parameters in prior standard deviations."""
    return case.draws / case.seen.information.unit
