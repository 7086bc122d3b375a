"""The runs, priors and truths of the posterior study: a spiral alone, or a zig-zag and a rich run with it.

Takes a width of the prior and a seed. Gives problems whose prior is centred on the vehicle file and whose
truth is drawn from that prior. Does not fit or sample.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.output_error import FitProblem, coefficient_set, trial_problem
from bayesid.estimation.sampling.priors import draw_params
from bayesid.manoeuvres import Manoeuvre, chirp, spiral, zigzag
from bayesid.model.params import ParameterSet, Prior
from bayesid.simulation.virtual_trial import virtual_trial

Array = np.ndarray
VEHICLE, RPM, DT = "generic_sub", 90.0, 1.0
DEG = math.pi / 180
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.5 * DEG}  # the paper reads positions and angles
PRIOR = 0.1  # relative sd of every coefficient: the size of the paper's starting errors
PRIORS = (0.1, 0.5, 1.0)  # of what a data sheet knows least, the rows of second order in v and r
SETS = {"spiral": ("spiral",), "three runs": ("spiral", "zig-zag", "rich")}
# the paper's Case 2: what a towing tank without a planar motion mechanism gives is known
KNOWN = ("X_vv", "Y_v", "Y_v|v|", "N_v", "N_v|v|", "X_drdr", "Y_dr", "N_dr")
SECOND_ORDER = (
    "X_vv", "X_vr", "X_rr", "Y_v|v|", "Y_v|r|", "Y_|r|dr", "N_v|v|", "N_|v|r", "N_r|r|", "N_|r|dr",
)  # fmt: skip
SHORT = 300.0  # s, zig-zag and rich run
MOST_DRAWN = 50  # truths drawn until the vehicle survives its runs


def manoeuvres(quick: bool = False, dt: float = DT) -> dict[str, Manoeuvre]:
    """The paper's spiral, a zig-zag, and a rich run: swept rudder and steps of the shaft speed."""
    end = 200.0 if quick else 600.0
    return {
        "spiral": spiral(RPM, end=end, dt=dt),
        "zig-zag": zigzag(20 * DEG, 20 * DEG, RPM, approach=10.0, duration=SHORT, dt=dt),
        "rich": chirp(25 * DEG, 1 / 150, 1 / 20, RPM, SHORT, dt, (1.0, 0.7, 1.1, 0.8)),
    }


def prior_of(model: Model, names: Iterable[str], wide: float = PRIOR) -> ParameterSet:
    """Normal priors about the vehicle file: `wide` for rows of second order, `PRIOR` for the others."""
    reach = 8 * max(wide, PRIOR)
    entries = coefficient_set(model, tuple(names), relative_bounds=reach, use_prior=False)
    return ParameterSet(
        tuple(
            replace(p, prior=Prior("normal", p.start, (wide if p.name in SECOND_ORDER else PRIOR) * p.scale))
            for p in entries
        )
    )


@dataclass(frozen=True, eq=False)
class Posed:
    """One truth, its readings, and what was known before.

    truth : (k,) true values of the unknown coefficients [SI]
    drawn : vehicles drawn until one survived its runs
    """

    problem: FitProblem
    truth: Array
    drawn: int

    @property
    def known(self) -> Knowledge:
        """The same prior, for quick refits."""
        params, model = self.problem.params, self.problem.model
        sd = np.array([p.prior.spread for p in params if p.prior is not None])
        centre = np.array([p.start for p in params])
        return Knowledge(params.names, model.positions(params.names), centre, np.diag(sd), ())

    @property
    def vehicle(self) -> Array:
        """(n,) all parameters of the true vehicle [SI]."""
        model = self.problem.model
        return self.problem.params.place(np.array(model.nominal), model.index, self.truth)


def posed(
    model: Model,
    executed: Mapping[str, Manoeuvre],
    params: ParameterSet,
    rng: np.random.Generator,
    share: float = 1.0,
    truth: Array | None = None,
) -> Posed:
    """Readings with `share` of the noise of a truth drawn from the prior, or of one given.

    A vehicle that diverges in its runs leaves no log; drawing another cuts the prior there, and so does the
    likelihood, which is zero where the vehicle diverges.
    """
    noise = {c: share * s for c, s in NOISE.items()}
    for drawn in range(1, MOST_DRAWN + 1):
        values = draw_params(params, 1, rng)[0] if truth is None else truth
        par = params.place(np.array(model.nominal), model.index, values)
        try:
            trial = virtual_trial(
                model, par, dict(executed), title="truth", vehicle_ref=VEHICLE, noise=noise, rng=rng
            )
            problem = trial_problem(model, trial, params, channels=tuple(NOISE), threads=1)
            return Posed(problem, values, drawn)
        except BayesidError:
            if drawn == MOST_DRAWN or truth is not None:
                raise
    raise AssertionError
