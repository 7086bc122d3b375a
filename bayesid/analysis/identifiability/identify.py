"""Everything data say about coefficients at one point: directions, coefficient table, profiles, and whether
they agree.

Takes a `FitProblem`, with or without a fit or draws. Gives an `Identifiability`. Does not fit, write or draw.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayesid.analysis.identifiability.coefficient_table import CoefficientRow, coefficient_rows
from bayesid.analysis.identifiability.information import (
    LEVEL,
    Information,
    as_if_read,
    information,
    states_prior,
    with_assumed_priors,
)
from bayesid.analysis.identifiability.open_directions import (
    OpenDirection,
    cosine,
    covariance_space,
    open_directions,
    path_space,
    svd_space,
)
from bayesid.analysis.identifiability.profile import OFFSETS, Profile, profiles
from bayesid.analysis.identifiability.scalings import scalings
from bayesid.estimation.output_error import FitProblem, singular_values

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What data tell about the parameters of a problem, and what they leave open.

    Attributes
    ----------
    names : (k,)
    z : (k,) the point [SI]
    information : whitened sensitivities and prior there
    singular_values : (k,) residual change per prior sd, falling [noise units]
    directions : open ones, structural first
    entries : the coefficient table
    profiles : empty unless asked for
    source : of the covariance lens: "Laplace" or "draws"
    n_readings : readings the data consist of
    """

    names: tuple[str, ...]
    z: Array
    information: Information
    singular_values: Array
    directions: tuple[OpenDirection, ...]
    entries: tuple[CoefficientRow, ...]
    profiles: tuple[Profile, ...]
    source: str
    n_readings: int

    @property
    def structural(self) -> tuple[OpenDirection, ...]:
        """Directions no data of this kind can fix."""
        return tuple(d for d in self.directions if d.kind == "structural")

    @property
    def n_fixed(self) -> int:
        """Number of independent combinations the data fix."""
        return len(self.names) - len(self.directions)

    @property
    def agreement(self) -> float:
        """Least |cos| over open directions and lenses; nan where nothing is open."""
        return min((min(d.agreement.values()) for d in self.directions), default=float("nan"))

    def entry(self, name: str) -> CoefficientRow:
        """The coefficient table's line of one parameter."""
        return self.entries[self.names.index(name)]


def identify(
    problem: FitProblem,
    z: Array | None = None,
    *,
    fitted: bool = False,
    draws: Array | None = None,
    level: float = LEVEL,
    profile: Sequence[str] | bool = True,
    offsets: Sequence[float] = OFFSETS,
    at_bound: Iterable[str] = (),
    log: Path | str | None = None,
    step: Callable[[], None] | None = None,
) -> Identifiability:
    """Look at the parameters of a problem through three lenses.

    Parameters
    ----------
    z : (n,) unknowns, initial states included; by default the problem's start
    fitted : whether `z` is the best point of these readings. If not, readings the model would give at `z`
        take their place: what could such runs tell?
    draws : (m, k) posterior draws [SI] of the free parameters; without them the covariance is Laplace's
    level : prior sd assumed where none is stated, in sizes of the parameter
    profile : which parameters to profile (four refits each); True for all
    at_bound, log, step : see `coefficient_rows` and `profiles`

    Raises
    ------
    FitError, ModelError
        a vehicle that diverges at `z`, a log that cannot be written
    """
    z = problem.start if z is None else np.asarray(z, dtype=float)
    stated = states_prior(problem)
    full = with_assumed_priors(problem.with_params(problem.params.started_at(z[: len(stated)])), level)
    problem_seen = full if fitted else as_if_read(full, z)
    info = information(problem_seen, z, stated)
    found = open_directions(info, scalings(problem_seen, z))
    covariance, source = info.covariance, "Laplace"
    if draws is not None:
        covariance, source = np.cov(draws / info.unit, rowvar=False), "draws"
    spaces = {"svd": svd_space(info), "covariance": covariance_space(covariance, info.prior_covariance)}
    done: tuple[Profile, ...] = ()
    if profile:
        names = info.names if profile is True else tuple(profile)
        done = profiles(problem_seen, info, z, names, offsets, log, step)
        shares = np.array([p.data_share for p in done])
        spaces["profile"] = path_space(np.array([p.path for p in done]), shares)
    directions = tuple(
        replace(d, agreement={lens: cosine(d.vector, space) for lens, space in spaces.items()}) for d in found
    )
    return Identifiability(
        info.names, info.z, info, singular_values(info.data)[0], directions, coefficient_rows(info,
            at_bound), done,
        source, problem_seen.n_readings,
    )  # fmt: skip
