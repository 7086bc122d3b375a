"""Which way each of several named fins pushes, told by turn, pitch and roll together.

Fins of an X steer and dive at once, and one reversed fin of four leaves a turn of half the size beside a
pitch and a roll that the log does not have: no single angle tells it. Takes a model and a run. Gives a log
likelihood, the mistakes of single fins, and which of them the runs would show.
Does not: weigh mistakes against one another.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from bayesid.diagnosis.input.pieces import change_between, speed_of, start_of
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.model.vehicles.orders import NEAR_CENTRE, planes_together, rudders_together
from bayesid.simulation import plan_run, simulate
from bayesid.trials import Run
from bayesid.trials.correction import Correction, apply
from bayesid.trials.mistakes.judge import SOME_RUNS
from bayesid.trials.mistakes.table import COMMON, RARE, USUAL, Mistake
from bayesid.words import and_list

Array = np.ndarray

SINGLE = "single fins"  # key of what this tells
ANGLES = ("psi", "theta", "phi")
PIECES, PIECE = 12, 4.0  # of a run; length of a piece in L/U
FEWEST = 4  # pieces
LEAST = math.radians(1.0)  # rms of what the fins turn the vehicle from which on it is seen
GAIN_SD = 0.4  # of the logarithm of turn over simulated turn
MOST_GAIN = math.exp(2 * GAIN_SD)
COUPLED = 0.3  # of the angle that fins turn most, as much as other motions turn the others
UNEXPLAINED = GAIN_SD**2  # share of the square of a turn that a right simulator may well leave


def single_fins(model: Model) -> tuple[str, ...]:
    """Columns of the named fins off the centre of a vehicle some of whose fins dive; none in the plane."""
    fins = [fin for fin in model.vehicle.fins if abs(fin.at[0]) > NEAR_CENTRE * model.vehicle.L]
    if not set(ANGLES) <= set(model.states) or not any(fin.direction[2] for fin in fins):
        return ()
    return tuple(fin.signals[0] for fin in fins)


def mistakes_of_fins(model: Model) -> tuple[Mistake, ...]:
    """Every fin and pair of fins with the opposite sign, those of one order and all; two exchanged."""
    fins, vehicle = single_fins(model), model.vehicle
    pairs = list(combinations(fins, 2))
    orders = (rudders_together(vehicle), planes_together(vehicle), planes_together(vehicle, bow=True))
    common = [group for order in orders if len(group := tuple(f for f in fins if f in order)) > 1]
    priors: dict[tuple[str, ...], float] = {(fin,): USUAL for fin in fins}
    priors |= dict.fromkeys(pairs, RARE)
    priors |= dict.fromkeys([*common, *([fins] if len(fins) > 1 else [])], COMMON)
    reversed_ones = [_reversed(group, prior) for group, prior in priors.items()]
    return (*reversed_ones, *(_exchanged(a, b) for a, b in pairs))


def _reversed(fins: Sequence[str], prior: float) -> Mistake:
    return Mistake(
        f"sign of {', '.join(fins)}",
        f"{_words(fins)} {'have' if len(fins) > 1 else 'has'} the opposite sign, or `direction` in the "
        "vehicle file has",
        Correction(scale={name: -1.0 for fin in fins for name in (fin, f"{fin}_cmd")}),
        prior,
    )


def _exchanged(a: str, b: str) -> Mistake:
    return Mistake(
        f"{a} and {b} exchanged",
        f"{_words((a, b))} are exchanged, or their names in the vehicle file are",
        Correction(exchange=((a, b), (f"{a}_cmd", f"{b}_cmd"))),
        USUAL,  # more of a kind than other columns that are exchanged
    )


def _words(fins: Sequence[str]) -> str:
    return f"{'fins' if len(fins) > 1 else 'fin'} {and_list([f.removeprefix('delta_') for f in fins])}"


def fins_density(model: Model, run: Run, fins: Sequence[str]) -> float | None:
    """Log likelihood [nats] of what the vehicle turns, pitches and rolls for its fins, over the largest.

    None where it is not read, where the fins do not turn the vehicle, and where the simulation diverges.

    Notes
    -----
    Every angle is measured by what the fins could turn it if all pushed the same way: a hull that pitches
    little for its fins tells as much by its pitch as by its turn, down to `COUPLED` of the largest: below,
    what the other motions do to it is in the way. Over n pieces of a run the share of the square of these
    changes that a simulation leaves, at the gain that suits it best, is f: -n/2 log(1 + f/f0), the marginal
    likelihood of residuals whose size is known no better than that of the simulator's errors, f0.
    """
    try:
        found = _changes(model, run, fins)
    except BayesidError:
        return None
    if found is None:
        return None
    most = np.sqrt(np.mean(found[2] ** 2, axis=0))
    most = np.maximum(most, COUPLED * most.max())
    logged, simulated = (each - each.mean(axis=0) for each in found[:2])
    if not float(np.sum(logged**2)) > len(logged) * LEAST**2 or not most.all():
        return None
    logged, simulated = logged / most, simulated / most
    size = float(np.sum(logged**2))
    power = float(np.sum(simulated**2))
    gain = min(max(float(np.sum(simulated * logged)) / power, 0.0), MOST_GAIN) if power > 0.0 else 0.0
    left = float(np.sum((logged - gain * simulated) ** 2)) / size
    return -0.5 * len(logged) * math.log1p(left / UNEXPLAINED)


def _changes(model: Model, run: Run, fins: Sequence[str]) -> Array | None:
    """(3, pieces, angles) changes of the angles beyond those of a free start: logged, simulated, and the most
    that the fins, each with the side of its own, could make of them."""
    speed, angles = speed_of(run), [angle for angle in ANGLES if angle in run.data]
    orders = [order for fin in fins if (order := run.input(fin)) is not None]
    if speed is None or not angles or not any(np.ptp(order) > 0.0 for order in orders):
        return None
    usual = float(np.nanmedian(speed))
    if not usual > 0:
        return None
    travel = model.scales["L"] / usual
    length = max(PIECE * travel, 3.0 * float(np.median(np.diff(run.t))))
    many = min(PIECES, int(run.duration / length))
    rows = []
    for t0 in np.linspace(run.t[0] + travel, run.t[-1] - length, max(0, many)):
        inside = (run.t >= t0) & (run.t <= t0 + length)
        row = _piece(model, run, speed, fins, angles, inside, travel) if inside.sum() >= 3 else None
        rows += [] if row is None else [row]
    if len(rows) < FEWEST:
        return None
    return np.array(rows).transpose(1, 0, 2)


def _piece(
    model: Model,
    run: Run,
    speed: Array,
    fins: Sequence[str],
    angles: Sequence[str],
    inside: Array,
    travel: float,
) -> Array | None:
    """(3, angles) changes over a piece as of `_changes`; None if not read."""
    t = run.t[inside]
    start = start_of(model, run, speed, "theta", t[0], travel)
    read = [change_between(run.t, run.data[angle], t[0], t[-1], travel) for angle in angles]
    if start is None or any(change is None for change in read):
        return None
    *groups, wind = (
        {k: v[inside] for k, v in group.items()}
        for group in (run.commands, run.measured_inputs, run.exogenous)
    )
    at = [model.states.index(angle) for angle in angles]

    def turned(moving: Sequence[str]) -> Array:
        still = {name for fin in fins if fin not in moving for name in (f"{fin}_cmd", fin)}
        commands, measured = (
            {k: np.zeros(v.shape) if k in still else v for k, v in group.items()} for group in groups
        )
        plan = plan_run(model, t, commands, measured, wind, acts_before=run.acts_before)
        states = simulate(model, model.nominal, plan, start).states
        return states[-1, at] - states[0, at]

    free = turned(())
    each = [
        abs(turned((fin,)) - free)
        for fin in fins
        if fin in run.measured_inputs or f"{fin}_cmd" in run.commands
    ]
    found = np.array([np.array(read) - free, turned(fins) - free, np.sum(each, axis=0)])
    return found if np.isfinite(found).all() else None


def shown(model: Model, runs: Sequence[Run]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Which mistakes of single fins these runs would show, and which they would not, in words.

    Only of fins that are logged; a mistake is shown where it would cost `SOME_RUNS` nats.
    """
    logged = {name.removesuffix("_cmd") for run in runs for name in (*run.commands, *run.measured_inputs)}
    fins = [fin for fin in single_fins(model) if fin in logged]
    if not fins:
        return (), ()
    with np.errstate(all="ignore"):
        as_read = [_density(model, run) for run in runs]
        signs = {fin: _shows(model, runs, as_read, _reversed((fin,), USUAL)) for fin in fins}
        pairs = {(a, b): _shows(model, runs, as_read, _exchanged(a, b)) for a, b in combinations(fins, 2)}
    good = [fin for fin, seen in signs.items() if seen]
    open_signs = [fin for fin in fins if fin not in good]
    open_pairs = [pair for pair, seen in pairs.items() if not seen]
    told = [f"side to which {_words(good)} push{'' if len(good) > 1 else 'es'}"] if good else []
    if pairs and not open_pairs:
        told.append("which fin is which")
    lacks = [f"the side to which {_words(open_signs)} push{'' if len(open_signs) > 1 else 'es'}"]
    return tuple(told), (*(lacks if open_signs else ()), *_open_pairs(open_pairs, len(pairs)))


def _open_pairs(pairs: Sequence[tuple[str, str]], of: int) -> Iterator[str]:
    if pairs and len(pairs) == of:
        yield "which fin is which"
    elif pairs:
        yield f"whether {' or '.join(_words(pair) for pair in pairs)} are exchanged"


def _shows(model: Model, runs: Sequence[Run], as_read: Sequence[float], mistake: Mistake) -> bool:
    assert mistake.correction is not None
    wrong = [_density(model, apply(mistake.correction, run)) for run in runs]
    return sum(as_read) - sum(wrong) > SOME_RUNS


def _density(model: Model, run: Run) -> float:
    return fins_density(model, run, single_fins(model)) or 0.0
