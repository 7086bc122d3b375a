"""A force the equations lack that depends on the motion: rows the vehicle has not, of unknown size.

Takes a `FitProblem` and its estimate. Gives the problem with such rows free under a prior of one common size,
the size the runs ask for; none where they ask for none. Does not search.

Port-starboard symmetry of the hull decides which rows may act: X, Z and M even, Y, K and N odd in the motions
that change sign in a mirror. A row's coefficient is normal about zero; its standard deviation is the size, a
force over 1/2 rho L^2 U^2, that it makes at a drift of 0.2, a turning rate of 0.3 U/L and a fin angle of 0.25
rad (Kennedy and O'Hagan 2001; Brynjarsdottir and O'Hagan 2014: a discrepancy needs what is known of it).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.likelihood.composite import LEAST_RUNS
from bayesid.estimation.likelihood.held_coefficients import (
    HeldCheck,
    held_coefficients,
    surely_moved,
    with_held,
)
from bayesid.estimation.likelihood.parts import NoiseParts
from bayesid.estimation.likelihood.posterior import (
    asked_for,
    better,
    composite_of,
    groups,
    scores_and_noise,
)
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.model.params import Parameter, ParameterSet, Prior
from bayesid.model.terms import Term, term
from bayesid.model.vehicles.orders import missing_actuators

Array = np.ndarray
SCALE = 1e-3  # of the unknowns: one for all sizes, so that densities of scores compare
SIZES = (3e-5, 6e-5, 1e-4, 2e-4, 3e-4, 6e-4, 1e-3, 2e-3, 3e-3)
FORM_EVIDENCE = 5.0  # log evidence the form must earn
# Size of a motion at which a row is as large as its prior says: over U, U/L or in rad; 1 for the rest.
TYPICAL = {
    **dict.fromkeys(("v", "w", "Rv", "Rw"), 0.2),
    **dict.fromkeys(("p", "q", "r"), 0.3),
    **dict.fromkeys(("delta_r", "delta_s", "delta_b"), 0.25),
}
# What changes sign in a mirror between port and starboard.
MIRRORED = frozenset(("v", "p", "r", "delta_r"))
NOT_SO_SMALL = 1e-9  # of a size: no form at all, in the same unknowns


def form_rows(model: Model, cubes_of_fins: bool = False) -> tuple[str, ...]:
    """Rows the vehicle lacks that the symmetry of its hull allows; no accelerations, no constants, none of a
    fin it does not have.

    Parameters
    ----------
    cubes_of_fins : with products of third order that have a fin in them. Not in fits, which predict with
        their form: it sent two of seven held-out zig-zags and turns of a ship out of all bounds (30 and 35
        degrees of rudder), none without them.
    """
    lacks = missing_actuators(model.vehicle)
    rows = (
        n
        for n in model.candidate_rows
        if depends_on_motion(term(n)) and not lacks & {f.symbol for f in term(n).factors}
    )
    return tuple(n for n in rows if cubes_of_fins or not is_cube_of_fins(term(n)))


def is_cube_of_fins(row: Term) -> bool:
    """Whether a row is a product of third order in drift, turning and fins, with a fin in it."""
    moving = [f.symbol for f in row.factors if f.symbol in TYPICAL and f.degree > 0]
    return len(moving) == 3 and any(s.startswith("delta") for s in moving)


def depends_on_motion(row: Term) -> bool:
    """Whether a row is a force by drift, turning or fins that the symmetry of a hull allows."""
    moves = any(f.symbol in TYPICAL for f in row.factors)
    odd = sum(f.symbol in MIRRORED and not f.is_even for f in row.factors) % 2 == 1
    return moves and not row.is_inertia and odd == (row.axis in "YKN")


def typical(model: Model, name: str) -> float:
    """Coefficient [SI] whose force is 1/2 rho L^2 U^2 (moments L^3) at the typical motion."""
    row, s = term(name), model.scales
    unit = 0.5 * s["rho"] * s["L"] ** row.length_power * s["U"] ** (2 - row.velocity_power)
    motion = np.prod([TYPICAL.get(f.symbol, 1.0) for f in row.factors if f.wrap != "sgn"])
    return float(unit / motion)


def with_form(problem: FitProblem, size: float, rows: Iterable[str] | None = None) -> FitProblem:
    """The problem with the rows of its form free, each normal about zero with this size: those given, as of
    an earlier fit, else all but those of fins that stay at zero in all runs."""
    given = {p.name for p in problem.params}  # free, kept or tied
    if rows is None:
        idle = idle_fins(problem)
        rows = (n for n in form_rows(problem.model) if not idle & {f.symbol for f in term(n).factors})
    entries = []
    for name in rows:
        if name not in given:
            unit = typical(problem.model, name)
            entries.append(
                Parameter(
                    name, 0.0, scale=SCALE * abs(unit), prior=Prior("normal", 0.0, size * abs(unit)),
                    file_scale=problem.model.file_scale(name),
                )
            )  # fmt: skip
    params = ParameterSet((*problem.params.entries, *entries), problem.params.joint)
    return problem.with_params(params)


@dataclass(frozen=True)
class Asked:
    """What the runs ask for beyond the free parameters: a model form, coefficients that the fit holds.

    Attributes
    ----------
    size : of the form, 0 for none
    held : None where the fit holds none, or none that explains anything
    """

    size: float
    held: HeldCheck | None = None


NOTHING_ASKED = Asked(0.0)


def idle_fins(problem: FitProblem) -> set[str]:
    """Actuators that no run moves from zero: no reading tells a row of theirs; a 6-DOF model has bow planes
    whether or not the vehicle has."""
    names = problem.model.kernel.actuators
    return {name for a, name in enumerate(names) if not any(r.plan.levels[:, a].any() for r in problem.runs)}


def form_size(problem: FitProblem, z: Array, parts: NoiseParts) -> float:
    """Size of the form that these runs ask for, 0 for none; see `asked_beyond`."""
    return asked_beyond(problem, z, parts).size


def asked_beyond(problem: FitProblem, z: Array, parts: NoiseParts) -> Asked:
    """Size of the form that these runs ask for, and whether they ask for coefficients that the fit holds.

    Both must speak for it: the evidence of the runs' scores, each size with the parts of noise it leaves, and
    the multi-step cost of left-out runs, which must fall and may not be above that of the best size by more
    than chance makes it. (A form that evidence alone asks for, its cost within chance of none, moved the
    heading of a tanker's held-out zig-zags from 3.5 to 4.8 degrees.) Of the sizes left it is the root of the
    mean square, weighed by evidence, all sizes as likely before by their logarithm: what the runs do not show
    of a form varies by that square, whatever they show of it. The size of least cost is the choice of chance
    among those that differ by less: on simulated vehicles it was a third of that of largest evidence in a
    third of the campaigns, and the intervals were too narrow.

    A form is what is lacking beside all coefficients, those that the fit holds free within what was known of
    them: a vehicle whose file is off by 20 % asked for a form of 75 rows as soon as six of its coefficients
    alone were free.

    Asked are runs of at least `LEAST_RUNS`; of fewer, neither is told.
    """
    k = len(problem.params.names)
    held = held_coefficients(problem)
    fixed, freed = with_held(problem, on=False), with_held(problem)
    nothing = with_form(fixed, NOT_SO_SMALL * SIZES[0])
    extra = len(nothing.params.names) - k
    if extra == 0 or len(set(groups([r.name for r in problem.runs]))) < LEAST_RUNS:
        return NOTHING_ASKED
    start = np.concatenate([z[:k], nothing.params.start[k:], z[k:]])
    scores, noise = scores_and_noise(nothing, start)  # in units that are the same for all sizes

    def weighed(rival: FitProblem) -> tuple[float, Array]:
        composite = composite_of(rival, start, scores)
        return composite.log_evidence(asked_for(composite, noise.order)), composite.left_out_costs(parts)

    sized = {size: with_form(freed, size or NOT_SO_SMALL * SIZES[0]) for size in (0.0, *SIZES)}
    found = [(*weighed(rival), size) for size, rival in sized.items()]
    evidence, none, _ = found[0]
    check = None
    if held:
        as_given, cost = weighed(nothing)
        if evidence > as_given + FORM_EVIDENCE and none.sum() < cost.sum():
            composite = composite_of(sized[0.0], start, scores)
            law = composite.law(asked_for(composite, noise.order))
            check = HeldCheck(evidence - as_given, surely_moved(sized[0.0], held, law.mean, law.covariance))
    able = [one for one in found if one[0] > evidence + FORM_EVIDENCE]
    best = min((cost for _, cost, _ in found), key=np.sum)
    allowed = [
        (worth, size) for worth, cost, size in able if cost.sum() < none.sum() and not better(best, cost)
    ]
    if not allowed:
        return Asked(0.0, check)
    worths, sizes = (np.array(column) for column in zip(*allowed, strict=True))
    return Asked(float(np.sqrt(np.average(sizes**2, weights=np.exp(worths - worths.max())))), check)


def form_part(model: Model, values: Mapping[str, float], given: Mapping[str, float]) -> dict[str, float]:
    """Force of every row of a form over 1/2 rho L^2 U^2 at the typical motion, no row of the vehicle."""
    return {n: values[n] / typical(model, n) for n in form_rows(model) if n in values and n not in given}
