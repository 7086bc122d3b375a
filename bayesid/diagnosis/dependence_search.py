"""What a force that is left depends on, where neither the motion nor the controls decide it: place, a period.

Takes an explanation and all runs cut into pieces. Gives a `Dependence`, or none. Does not name a cause.

Whatever depends on the motion and the controls alone, of any shape, is taken first (a Gaussian process over
both): only what gains beside that is no shape of the equations. Hull forces that change from place to place
are those over an uneven bottom, a force with a period of its own is that of water or of something aboard that
swings. What changes with time and with neither is a rival and never told: gusts do, and so does an
environment measured a little wrong. So is an error of a sensor that changes slowly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import eigh
from scipy.special import logsumexp

from bayesid.diagnosis.cut_runs import CutRun, Joint, Sought, at_noise_scales
from bayesid.diagnosis.data.dependence import Acts, Dependence, On
from bayesid.diagnosis.force_of_motion import AXES, STATE_DISTANCES, STATE_SIZES, correlation
from bayesid.diagnosis.hypotheses.localisation import SENSORS, SIGNAL_AMPLITUDES, channel_sets, units
from bayesid.diagnosis.joined_runs import Joined, Pieces, fewer, joined, longest_runs, pieces_of
from bayesid.diagnosis.threshold_table import DEPENDENCE_EVIDENCE, DEPENDENCE_OVER_RIVALS
from bayesid.estimation.run_data import Array

# Distances [L] or times [L/U] over which the rest changes; shares of the hull's force; forces over the units.
DISTANCES = (2.0, 4.0, 8.0)
# Times of what is slower or lasts a run, one by one rivals: a slow vehicle takes long for a distance.
SLOW_TIMES = (16.0, 64.0, 1e4)
SHARES = (0.03, 0.1, 0.3)
FORCES = (1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
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
    """What a force left by an explanation depends on; None where motion, controls, time or sensors may do.

    Parameters
    ----------
    par : parameters of the explanation

    Raises
    ------
    ModelError, LinAlgError
        if a run cannot be linearised along its path
    """
    model = sought.problem.model
    forces = [f"force_{AXES[v]}" for v in model.kernel.velocities]
    sizes = [units(model)[n] for n in forces]
    kept, most = longest_runs(sought.runs, len(forces))
    runs = [fewer(r, sought.known, most) for r in sought.runs]
    rows = [sought.signals.index(n) for n in forces]
    pieces = pieces_of(model, [sought.paths[k] for k in kept], [runs[k] for k in kept], par, sizes)
    whole = joined(runs, sought.known, rows, kept)
    of_motion = _of_motion(whole, pieces, len(forces))
    rest = whole.beside(of_motion)
    tried = [*_by_place_and_time(rest, pieces), *_periodic(rest, pieces, len(forces))]
    rival = max(t.average for t in tried if t.on == "time")
    best = max((t for t in tried if t.on != "time"), key=lambda t: t.average)
    gain = best.average - float(np.log(len([t for t in tried if t.on != "time"])))
    if gain < DEPENDENCE_EVIDENCE or best.average < rival + DEPENDENCE_OVER_RIVALS:
        return None
    of_sensors = _of_sensors(sought, runs, rows, kept, pieces, of_motion)
    if best.average < of_sensors + DEPENDENCE_OVER_RIVALS:
        return None
    chosen = rest.gains(best.columns, (1.0,))[0] - gain
    gain = _repeatable(sought, forces, kept, most, of_motion, best.columns) - chosen
    if gain < DEPENDENCE_EVIDENCE:
        return None
    square = rest.squares(best.columns).reshape(len(forces), -1)
    if best.acts == "hull":
        told = float(np.sqrt(square.sum() / (pieces.hull**2).sum()))
    else:
        told = float(np.sqrt(square[:2].sum(axis=0).mean())) * sizes[0]
    unit = model.scales["L"] / (1.0 if best.on == "place" else model.scales["U"])
    on: On = "place" if best.on == "place" else "period"
    drawn = _map(best, rest.mean(best.columns).reshape(len(forces), -1), pieces, model.scales["L"], sizes[0])
    return Dependence(on, best.acts, gain, float(best.scale * unit), told, gain, drawn)


def _map(
    best: _Tried, force: Array, pieces: Pieces, length: float, size: float
) -> tuple[tuple[float, ...], ...]:
    """Where the vehicle was, and what acts there.

    Parameters
    ----------
    force : (axes, m) mean in the units of the signals
    length, size : scale of places [m], and unit of a force [N]
    """
    if best.on != "place":
        return ()
    where = length * pieces.place[:, :2]
    if best.acts == "hull":
        square = (pieces.hull**2).sum(axis=1)
        acts = ((force.T * pieces.hull).sum(axis=1) / np.maximum(square, np.finfo(float).tiny))[:, None]
    else:
        c, s = np.cos(pieces.heading), np.sin(pieces.heading)
        acts = size * np.column_stack([c * force[0] - s * force[1], s * force[0] + c * force[1]])
    return tuple(tuple(float(x) for x in row) for row in np.hstack([where, acts]))


def _of_motion(whole: Joined, pieces: Pieces, axes: int) -> Array:
    """Columns of a force of the motion and the controls, of the shape that gains most; none if none gains."""
    best, found = 0.0, np.zeros((axes * pieces.count, 0))
    for distance in STATE_DISTANCES:
        one = _root(correlation(pieces.state, pieces.state, distance))
        columns = np.kron(np.eye(axes), one)
        gains = whole.gains(columns, STATE_SIZES)
        if max(gains) > best:
            best, found = max(gains), STATE_SIZES[int(np.argmax(gains))] * columns
    return found


def _by_place_and_time(rest: Joined, pieces: Pieces) -> Iterator[_Tried]:
    """Hull forces, and a force over ground, that change with the place or with time."""
    axes = pieces.hull.shape[1]
    for on, scales in (("place", DISTANCES), ("time", DISTANCES), *(("time", (t,)) for t in SLOW_TIMES)):
        seen: dict[Acts, list[tuple[float, float, float, Array]]] = {"hull": [], "ground": []}
        for scale in scales:
            one = _root(_near(pieces, scale) if on == "place" else _soon(pieces, scale))
            on_hull = np.concatenate([pieces.hull[:, [i]] * one for i in range(axes)])
            for a, gain in zip(SHARES, rest.gains(on_hull, SHARES), strict=True):
                seen["hull"].append((gain, scale, a, on_hull))
            over_ground = _over_ground(pieces, one, axes)
            for a, gain in zip(FORCES, rest.gains(over_ground, FORCES), strict=True):
                seen["ground"].append((gain, scale, a, over_ground))
        for acts, all_ in seen.items():
            _, scale, a, columns = max(all_, key=lambda s: s[0])
            yield _Tried(on, acts, _average([s[0] for s in all_]), scale, a * columns)  # type: ignore[arg-type]


def _periodic(rest: Joined, pieces: Pieces, axes: int) -> Iterator[_Tried]:
    """A force over ground with one period, its size, direction and phase in every run its own; nothing where
    no run is long enough."""
    longest = max(float(np.ptp(pieces.time[pieces.run == k])) + w for k, w in enumerate(pieces.width))
    step = 2.0 * np.pi / (STEPS * longest)
    least, most = FEWEST_PERIODS * STEPS * step, 2.0 * np.pi / (PIECES_PER_PERIOD * pieces.width.max())
    if most <= least:
        return
    seen: list[tuple[float, float, float]] = []
    for w in np.arange(least, most, step):
        gains = rest.gains(_waves(pieces, w, axes), FORCES)
        seen += [(gain, w, a) for a, gain in zip(FORCES, gains, strict=True)]
    _, w, a = max(seen)
    columns = a * _waves(pieces, w, axes)
    yield _Tried("period", "ground", _average([s[0] for s in seen]), 2.0 * np.pi / w, columns)


def _of_sensors(
    sought: Sought,
    runs: Sequence[CutRun],
    rows: Sequence[int],
    kept: Sequence[int],
    pieces: Pieces,
    of_motion: Array,
) -> float:
    """What a slowly changing error of one sensor gains beside a force of the motion, at most."""
    best = -np.inf
    for name in SENSORS:
        channels = channel_sets(sought.problem).get(name, ((), ()))[1]
        if not channels:
            continue
        with_them = [*rows, *(sought.signals.index(c) for c in channels)]
        apart = np.zeros((len(channels) * pieces.count, of_motion.shape[1]))
        rest = joined(runs, sought.known, with_them, kept).beside(np.concatenate([of_motion, apart]))
        seen = []
        for scale in (*DISTANCES, *SLOW_TIMES):
            wrong = np.kron(np.eye(len(channels)), _root(_soon(pieces, scale)))
            none = np.zeros((of_motion.shape[0], wrong.shape[1]))
            seen += rest.gains(np.concatenate([none, wrong]), SIGNAL_AMPLITUDES)
        best = max(best, _average(seen))
    return best


def _average(gains: Sequence[float]) -> float:
    """Log evidence of several that are as probable before the data."""
    return float(logsumexp(gains) - np.log(len(gains)))


def _near(pieces: Pieces, scale: float) -> Array:
    far = ((pieces.place[:, None] - pieces.place) ** 2).sum(axis=2)
    return np.asarray(np.exp(-0.5 * far / scale**2))


def _soon(pieces: Pieces, scale: float) -> Array:
    long = (pieces.time[:, None] - pieces.time) ** 2
    return np.asarray(np.exp(-0.5 * long / scale**2) * (pieces.run[:, None] == pieces.run))


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


def _repeatable(
    sought: Sought, forces: Sequence[str], kept: Sequence[int], most: int, of_motion: Array, columns: Array
) -> float:
    """Gain of columns beside a force of the motion, where a measured environment may differ between runs by
    its own repeatability."""
    known = sought.known
    rows = [sought.signals.index(n) for n in forces]
    with_, without = [], []
    for weight, cuts in at_noise_scales(sought):
        runs = [fewer(r, known, most) for r in cuts]
        whole = joined(runs, known, rows, kept)
        base = weight + Joint(runs, known, ()).log_evidence + whole.gains(of_motion, (1.0,))[0]
        without.append(base)
        with_.append(base + whole.beside(of_motion).gains(columns, (1.0,))[0])
    return float(logsumexp(with_) - logsumexp(without))
