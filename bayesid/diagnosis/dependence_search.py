"""What a force that is left depends on, where neither the motion nor the controls decide it: place, a period.

Takes an explanation and all runs cut into pieces. Gives a `Dependence`, or none. Does not name a cause.

Whatever depends on the motion and the controls alone, of any shape, is taken first (a Gaussian process over
both): only what gains beside that is no shape of the equations. Hull forces that change from place to place
are those over an uneven bottom, a force with a period of its own is that of a swell. What changes with time
and with neither is a rival and never told: gusts do, and so does an environment measured a little wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.special import logsumexp

from bayesid.diagnosis.cut_runs import CutRun, Joint, Sought, cut
from bayesid.diagnosis.data.dependence import Acts, Dependence, On
from bayesid.diagnosis.hypotheses.candidate import NOISE_SCALE_SHIFTS
from bayesid.diagnosis.hypotheses.localisation import units
from bayesid.diagnosis.joined_runs import Joined, Pieces, fewer, pieces_of
from bayesid.diagnosis.threshold_table import DEPENDENCE_EVIDENCE
from bayesid.estimation.filter_error.noise_identification import MANOEUVRE_NOISE_SPREAD
from bayesid.estimation.run_data import Array

# Pieces of all runs together, and the fewest of one run.
MOST_TOGETHER, FEWEST = 700, 8
# Distances over which a force of the motion changes, over that of two usual motions; sizes over the units.
STATE_DISTANCES = (0.3, 0.6, 1.2)
STATE_SIZES = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
# Distances [L] or times [L/U] over which the rest changes; shares of the hull's force; forces over the units.
DISTANCES = (2.0, 4.0, 8.0)
SHARES = (0.03, 0.1, 0.3)
FORCES = (1e-3, 3e-3, 1e-2, 3e-2)
# Periods are looked for from three in the longest run to four pieces; steps in one over its length.
FEWEST_PERIODS, PIECES_PER_PERIOD, STEPS = 3.0, 4.0, 4.0
# Share of a prior's greatest variance below which a direction of it is left out.
NEGLIGIBLE = 1e-5


@dataclass(frozen=True, eq=False)
class _Tried:
    """One kind of dependence: evidence averaged over its numbers, and the columns of the best of them."""

    on: On | Literal["time"]
    acts: Acts
    average: float
    scale: float
    columns: Array


def dependence(sought: Sought, par: Array) -> Dependence | None:
    """What a force left by an explanation depends on; None where the motion and the controls may decide it.

    Parameters
    ----------
    par : parameters of the explanation

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    model = sought.problem.model
    size = units(model)
    forces = [n for n in model.kernel.exogenous if n.startswith("force_")]
    sizes = [size[n] for n in forces]
    runs = _coarse(sought.runs, sought.known)
    joined = Joined(runs, sought.known, [sought.signals.index(n) for n in forces])
    pieces = pieces_of(model, sought.paths, runs, par, sizes)
    of_motion = _of_motion(joined, pieces, len(forces))
    rest = joined.beside(of_motion)
    tried = [*_by_place_and_time(rest, pieces), _periodic(rest, pieces, len(forces))]
    best = max(tried, key=lambda t: t.average)
    gain = best.average - float(np.log(len(tried)))
    if best.on == "time" or gain < DEPENDENCE_EVIDENCE:
        return None
    gain = _repeatable(sought, forces, of_motion, best.columns) - (rest.gains(best.columns, (1.0,))[0] - gain)
    if gain < DEPENDENCE_EVIDENCE:
        return None
    square = rest.squares(best.columns).reshape(len(forces), -1)
    if best.acts == "hull":
        told = float(np.sqrt(square.sum() / (pieces.hull**2).sum()))
    else:
        told = float(np.sqrt(square[:2].sum(axis=0).mean())) * sizes[0]
    unit = model.scales["L"] / (1.0 if best.on == "place" else model.scales["U"])
    return Dependence(best.on, best.acts, gain, float(best.scale * unit), told, gain)


def _coarse(runs: Sequence[CutRun], known: int) -> list[CutRun]:
    most = max(FEWEST, MOST_TOGETHER // len(runs))
    return [fewer(r, known, most) for r in runs]


def _of_motion(joined: Joined, pieces: Pieces, axes: int) -> Array:
    """Columns of a force of the motion and the controls, of the shape that gains most; none if none gains."""
    apart = ((pieces.state[:, None] - pieces.state) ** 2).sum(axis=2)
    usual = 2.0 * max(pieces.state.shape[1], 1)
    best, found = 0.0, np.zeros((axes * pieces.count, 0))
    for distance in STATE_DISTANCES:
        one = _root(np.exp(-0.5 * apart / (usual * distance**2)))
        columns = np.kron(np.eye(axes), one)
        gains = joined.gains(columns, STATE_SIZES)
        if max(gains) > best:
            best, found = max(gains), STATE_SIZES[int(np.argmax(gains))] * columns
    return found


def _by_place_and_time(rest: Joined, pieces: Pieces) -> Iterator[_Tried]:
    """Hull forces, and a force over ground, that change with the place or with time."""
    far = ((pieces.place[:, None] - pieces.place) ** 2).sum(axis=2)
    long = (pieces.time[:, None] - pieces.time) ** 2
    same = pieces.run[:, None] == pieces.run
    axes = pieces.hull.shape[1]
    for on in ("place", "time"):
        seen: dict[Acts, list[tuple[float, float, float, Array]]] = {"hull": [], "ground": []}
        for scale in DISTANCES:
            apart = far if on == "place" else long
            prior = np.exp(-0.5 * apart / scale**2) * (1.0 if on == "place" else same)
            one = _root(prior)
            on_hull = np.concatenate([pieces.hull[:, [i]] * one for i in range(axes)])
            for a, gain in zip(SHARES, rest.gains(on_hull, SHARES), strict=True):
                seen["hull"].append((gain, scale, a, on_hull))
            over_ground = _over_ground(pieces, one, axes)
            for a, gain in zip(FORCES, rest.gains(over_ground, FORCES), strict=True):
                seen["ground"].append((gain, scale, a, over_ground))
        for acts, all_ in seen.items():
            gain, scale, a, columns = max(all_, key=lambda s: s[0])
            average = float(logsumexp([s[0] for s in all_]) - np.log(len(all_)))
            yield _Tried(on, acts, average, scale, a * columns)  # type: ignore[arg-type]


def _periodic(rest: Joined, pieces: Pieces, axes: int) -> _Tried:
    """A force over ground with one period, its size, direction and phase in every run its own."""
    longest = max(float(np.ptp(pieces.time[pieces.run == k])) + w for k, w in enumerate(pieces.width))
    step = 2.0 * np.pi / (STEPS * longest)
    least, most = FEWEST_PERIODS * STEPS * step, 2.0 * np.pi / (PIECES_PER_PERIOD * pieces.width.max())
    seen: list[tuple[float, float, float]] = []
    for w in np.arange(least, max(most, least) + step, step):
        gains = rest.gains(_waves(pieces, w, axes), FORCES)
        seen += [(gain, w, a) for a, gain in zip(FORCES, gains, strict=True)]
    _, w, a = max(seen)
    average = float(logsumexp([s[0] for s in seen]) - np.log(len(seen)))
    return _Tried("period", "ground", average, 2.0 * np.pi / w, a * _waves(pieces, w, axes))


def _waves(pieces: Pieces, frequency: float, axes: int) -> Array:
    one = np.column_stack([np.sin(frequency * pieces.time), np.cos(frequency * pieces.time)])
    by_run = [one * (pieces.run == k)[:, None] for k in range(pieces.width.size)]
    return _over_ground(pieces, np.hstack(by_run), axes)


def _over_ground(pieces: Pieces, one: Array, axes: int) -> Array:
    """Columns of a force to the north, then of one to the east, in body axes."""
    c, s, nothing = np.cos(pieces.heading)[:, None], np.sin(pieces.heading)[:, None], np.zeros_like(one)
    others = [nothing] * (axes - 2)
    north = np.concatenate([one * c, -one * s, *others])
    east = np.concatenate([one * s, one * c, *others])
    return np.hstack([north, east])


def _root(prior: Array) -> Array:
    """(m, k) columns whose products are a covariance, but for what is negligible."""
    values, vectors = eigh(prior)
    kept = values > NEGLIGIBLE * values[-1]
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def _repeatable(sought: Sought, forces: Sequence[str], of_motion: Array, columns: Array) -> float:
    """Gain of columns beside a force of the motion, where a measured environment may differ between runs by
    its own repeatability (as `candidate.repeatable_evidence`)."""
    problem, known = sought.problem, sought.known
    environment = problem.environment
    stated = environment.source == "stated" or not any(environment.noise_model.force)
    shifts = np.zeros(1) if stated else np.array(NOISE_SCALE_SHIFTS)
    weight = -0.5 * (shifts / MANOEUVRE_NOISE_SPREAD) ** 2
    with_, without = [], []
    for shift in shifts:
        noise = environment.noise_model.scaled(float(np.exp(shift)))
        cuts = [
            cut(problem, sought.free, k, path, forces, noise_model=noise)
            for k, path in enumerate(sought.paths)
        ]
        runs = _coarse(cuts, known)
        joined = Joined(runs, known, range(len(forces)))
        base = Joint(runs, known, ()).log_evidence + joined.gains(of_motion, (1.0,))[0]
        without.append(base)
        with_.append(base + joined.beside(of_motion).gains(columns, (1.0,))[0])
    return float(logsumexp(np.array(with_) + weight) - logsumexp(np.array(without) + weight))
