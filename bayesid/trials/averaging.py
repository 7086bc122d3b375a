"""Readings denser than the motion needs, averaged before a long log is fitted or diagnosed.

Takes a `Trial` and the size of its vehicle. Gives a `Trial` with fewer readings of less noise, or the same.
Does not: touch orders that are held for longer than a block, which switch when they did, nor logs that are
short enough as they are. An order that changes all the time, an autopilot's, is held at its mean instead, one
of revolutions at that of the thrust they give (n|n|), from each of its jumps on anew.

The readings of a block are replaced by the line through them at its middle: exact for motion without bend,
whatever the stamps. A bend adds a 24th of the second difference of neighbouring averages; it is taken off,
the difference being that of averages two blocks away, which hardly adds noise (0.03 of that of an average).
Blocks are made shorter until what is left is small beside the noise: by Taylor's series of the motion about
the middle of a block (1/24^2 + 2^2/(12 24) - 1/1920) of the fourth difference of averages, a 66th.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.trials.held_orders import integral_of_held
from bayesid.trials.kinematics.derived_velocity import velocity_from_track
from bayesid.trials.trial import Floats, Run, Trial
from bayesid.words import and_list

USUAL_BLOCK, LONGEST_BLOCK = 0.05, 0.25  # L/U; longer than usual only as far as too many readings are left
LONGER = 1.1  # a block that is tried after a shorter one
MOST_LEFT = 0.3  # of what a bend adds to an average, rms, over its noise: makes that 4 % larger
AWAY = 2  # blocks
LEFT = 1.0 / 24.0**2 + AWAY**2 / (12.0 * 24.0) - 1.0 / 1920.0  # of the fourth difference of averages
NOISE_OF_FOURTH = 70.0  # variance of 1 -4 6 -4 1 times independent readings of variance one
HELD = 0.5  # changes per block, above which an order changes all the time
JUMP = 5.0  # of its usual changes, from which one is a jump: the begin of a spiral's ramp
EDGE = 1e-3  # of a block, by which it begins early: no edge is on a reading, where rounding would decide
BESIDE = 0.05  # of a block: a reading so near its middle is moved there, by a line to its neighbour
WORTH = 0.75  # most samples left, of those there were: every change of an order keeps one
FEWEST = 1.9  # readings per block, below which a channel keeps its own
FULL = 0.75  # share of the usual readings a block must hold
WHOLE = 0.75  # least share of the readings' weight that averages keep,
FAR = 5  # unless this many times more samples are there than are taken as they are
SAME_RATE = 0.2  # relative difference of the readings per block between runs that share a noise


def averaged(trial: Trial, time_scale: float, most: int) -> Trial:
    """The trial with readings averaged where its runs to identify hold more than `most` samples.

    Parameters
    ----------
    time_scale : L/U [s]
    most : samples of all runs to identify that are taken as they are

    Returns
    -------
    Trial; the same one where it is short enough, where readings are too far apart to average, where orders
    change so often that no fewer samples are left, where runs are logged at different rates (one noise holds
    for all), or where noise is not stated (averages would be weighed by what fast changes of theirs show)
    """
    runs = trial.identify
    samples = _samples(trial)
    if samples <= most or not trial.noise:
        return trial
    spacing = float(np.median(np.concatenate([np.diff(run.t) for run in runs])))
    usual, longest = (round(block * time_scale / spacing) for block in (USUAL_BLOCK, LONGEST_BLOCK))
    best = _best(trial, spacing, usual, longest, most, WHOLE)
    if best is None and samples > FAR * most:
        best = _best(trial, spacing, usual, longest, most, 0.0)
    if best is None:
        return trial
    count, out, left = best
    drawn = sorted(
        {name for run in runs for name, v in run.commands.items() if _restless(run, v, count * spacing)}
    )
    others = {name for run in runs for name in run.commands} - set(drawn)
    ordered = (
        "orders as logged"
        if not drawn
        else f"{and_list(drawn)} held at means over them{', other orders as logged' if others else ''}"
    )
    words = (
        f"{samples} readings {spacing:.3g} s apart are averaged over {count * spacing:.3g} s "
        f"({count * spacing / time_scale:.2g} L/U), {ordered}; what the motion bends "
        f"within an average is taken off but for {left:.1g} of its noise (--resample takes single readings)"
    )
    derived = velocity_from_track(runs)
    known = trial.velocity_from_track if trial.velocity_from_track is not None else derived
    return replace(out, velocity_from_track=known, warnings=(*trial.warnings, words))


def _best(
    trial: Trial, spacing: float, usual: int, longest: int, most: int, whole: float
) -> tuple[int, Trial, float] | None:
    """Readings per block, the averaged trial and what is left of a bend; None where nothing is gained.

    Parameters
    ----------
    spacing : time between readings [s]
    usual, longest : readings per block to begin with, and at most
    whole : least share of the readings' weight that the averages of every channel keep
    """
    best = None
    for count in _counts(max(usual, 2), longest):
        done = _averaged(trial, count * spacing, count, whole)
        if done is None:
            continue
        if done[1] > MOST_LEFT:
            break
        if best is None or _samples(done[0]) < _samples(best[1]):
            best = count, *done
        if _samples(done[0]) <= most:
            break
    count = usual // 2
    while best is None and count >= 2:
        done = _averaged(trial, count * spacing, count, whole)
        if done is not None and done[1] <= MOST_LEFT:
            best = count, *done
        count //= 2
    return best if best is not None and _samples(best[1]) <= WORTH * _samples(trial) else None


def _samples(trial: Trial) -> int:
    return sum(run.n_samples for run in trial.identify)


def _counts(first: int, last: int) -> Iterator[int]:
    """Readings per block, from `first` to `last`, each about a tenth more than the one before."""
    count = first
    while count <= last:
        yield count
        count = max(count + 1, round(LONGER * count))


def _averaged(trial: Trial, width: float, count: int, whole: float) -> tuple[Trial, float] | None:
    """Runs averaged over blocks of `width` [s], and the most left of a bend; None: unlike rates, or averages
    that keep less than the share `whole` of the readings' weight."""
    runs, factors = list[Run](), list[dict[str, float]]()
    for run in trial.runs:
        if run.duration < 2.0 * width:  # too short for its rate to tell: one average of all
            out, _, _ = _run(run, run.duration + width / count, run.n_samples)
            held = dict[str, float]()
        else:
            out, held, kept = _run(run, width, count)
            if run.role == "identify" and kept < whole:
                return None
        runs.append(out)
        factors.append(held)
    names = {name for held in factors for name in held}
    worth = {name: [held[name] for held in factors if name in held] for name in names}
    if any(max(seen) > (1.0 + SAME_RATE) * min(seen) for name, seen in worth.items() if name in trial.noise):
        return None
    single = {name: float(np.sqrt(np.median(seen))) for name, seen in worth.items()}
    noise = {name: sigma / single.get(name, 1.0) for name, sigma in trial.noise.items()}
    left = [
        _left(run, noise, f, width) for run, f in zip(runs, factors, strict=True) if run.role == "identify"
    ]
    done = replace(trial, runs=tuple(runs), noise=noise, single_over_average=single)
    return done, max(left, default=0.0)


def _run(run: Run, width: float, count: int) -> tuple[Run, dict[str, float], float]:
    """One run averaged; channel -> readings an average is worth, 1 for a channel that keeps its own readings;
    the least share of the readings' weight that averages of a channel keep."""
    firsts = [run.t[good][0] - run.t[0] for v in run.data.values() if (good := np.isfinite(v)).any()]
    # blocks begin with the run, or so that the readings of a seldom channel are in their middles: what needs
    # the fewest samples of those that keep the weight of the others
    begins = [-0.5 * width / count, *sorted({float((b - 0.5 * width) % width) - width for b in firsts})]
    if width > run.duration:  # one block
        begins = begins[:1]
    grid = min((_Grid(run, width, begin) for begin in begins), key=lambda g: (g.kept < WHOLE, g.t.size))
    commands = {name: grid.order(name, values) for name, values in run.commands.items()}
    before = {name: s for name, s in run.acts_before.items() if not grid.held_at_means(name)}
    groups: dict[str, Any] = {"data": grid.data(), "commands": commands}
    for group in ("measured_inputs", "exogenous", "propulsion", "extra"):
        groups[group] = {name: grid.input(values) for name, values in getattr(run, group).items()}
    note = f"averaged over {width:g} s from {run.digest[:12]}"
    began = float(run.t[0]) if run.began is None else run.began  # half a block before its first average
    out = replace(
        run,
        t=run.t[0] + grid.t,
        began=began,
        provenance=(*run.provenance, note),
        acts_before=before,
        **groups,
    )
    return out, grid.held, grid.kept


class _Grid:
    """Samples a run is averaged to: middles of blocks, what seldom channels read, switches of orders.

    Attributes
    ----------
    t : (m,) times from the first sample of the run [s]
    held : channel -> readings an average is worth; 1 for a channel that keeps its own readings
    kept : least share of the readings' weight that the averages of a channel keep: a line through readings
        that lie beside the middle of their block tells less there, one through two no more than a reading
    """

    def __init__(self, run: Run, width: float, begin: float) -> None:
        t = run.t - run.t[0]
        self._t, self._width = t, width
        self._block = np.floor((t - begin) / width + EDGE).astype(np.int64)
        self._middle: Floats = np.asarray(
            begin + (np.arange(int(self._block[-1]) + 1) + 0.5) * width, np.float64
        )
        self._whole = (self._middle >= t[0]) & (self._middle <= t[-1])
        kept = self._middle[self._whole]
        self._means, self.held, self._own = dict[str, Floats](), dict[str, float](), dict[str, Floats]()
        self.kept = 1.0
        for name, values in run.data.items():
            mean, share, rate, worth = self._lines(values)
            if rate < FEWEST:
                self.held[name], self._own[name] = 1.0, values
            else:
                self.held[name], self._means[name] = rate * worth, _unbent(mean, share)
                self.kept = min(self.kept, worth)
        self._ordered, self._sooner = run.commands, run.acts_before
        switched = [t[self._switches(values)] - self._before(name) for name, values in run.commands.items()]
        read = [t[np.isfinite(values)] for values in self._own.values()]
        extra = [_off(kept, times, 1e-6 * width) for times in switched]
        extra += [_off(kept, times, BESIDE * width) for times in read]
        ends = t[[0, -1]] if kept.size < 2 else t[:0]
        self.t = np.unique(np.concatenate([kept, ends, *extra]))
        self._at = np.searchsorted(self.t, kept)

    def _switches(self, values: Floats) -> np.ndarray:
        """(n,) where an order is to switch as it did: where it changes; of one that does so all the time,
        where it jumps, unless it jumps all the time too."""
        moves = _moves(values)
        if not self._moving(moves):
            return moves
        jumps = _jumps(values)
        return jumps & (not self._moving(jumps))

    def _moving(self, moves: np.ndarray) -> bool:
        return bool(np.count_nonzero(moves) > HELD * self._middle.size)

    def _lines(self, values: Floats) -> tuple[Floats, Floats, float, float]:
        return _lines(self._t, values, self._block, self._middle, self._width)

    def data(self) -> dict[str, Floats]:
        """Averages, and the readings of seldom channels, by channel; NaN where a channel has none."""
        out = {name: np.full(self.t.size, np.nan) for name in self.held}
        for name, mean in self._means.items():
            out[name][self._at] = mean[self._whole]
        for name, values in self._own.items():
            good = np.isfinite(values)
            if good.any():
                read = self._t[good]
                at = _nearest(self.t, read)
                at = np.unique(at[np.abs(self.t[at] - read) <= 1.001 * BESIDE * self._width])
                near = 1e-6 * self._width
                inside = at[(self.t[at] >= read[0] - near) & (self.t[at] <= read[-1] + near)]
                out[name][inside] = np.interp(self.t[inside], read, values[good])
        return out

    def held_at_means(self, name: str) -> bool:
        """Whether an order changes all the time, and is held at its means from when on it acts."""
        values = self._ordered[name]
        return self._moving(_moves(values)) and bool(np.isfinite(values).all())

    def _before(self, name: str) -> float:
        """By how much an order that is held at means acts before its rows [s]."""
        return self._sooner.get(name, 0.0) if self.held_at_means(name) else 0.0

    def order(self, name: str, values: Floats) -> Floats:
        """An order as it is held at the samples; one that changes all the time at its mean to the next, of
        revolutions at that of n|n|, with which thrust goes."""
        near, at = 1e-6 * self._width, self.t + self._before(name)
        row = np.clip(np.searchsorted(self._t, at + near, side="right") - 1, 0, None)
        held = values[row]
        if not self.held_at_means(name) or self.t.size < 2:
            return held
        turning = name.startswith("n_")
        pull = values * np.abs(values) if turning else values
        until = integral_of_held(self._t, pull, at)
        mean = np.diff(until) / np.diff(self.t)
        held[:-1] = np.sign(mean) * np.sqrt(np.abs(mean)) if turning else mean
        return held

    def input(self, values: Floats) -> Floats:
        """Averages, linear in between; its own readings where it has few."""
        means, _, _, _ = self._lines(values)
        good = np.isfinite(means) & self._whole
        if good.any():
            return np.interp(self.t, self._middle[good], means[good])
        fine = np.isfinite(values)
        if not fine.any():
            return np.full(self.t.size, np.nan)
        return np.interp(self.t, self._t[fine], values[fine])


def _restless(run: Run, values: Floats, width: float) -> bool:
    """Whether an order changes in more than every other block."""
    many = np.count_nonzero(_moves(values)) > HELD * max(run.duration / width, 1.0)
    return bool(many and np.isfinite(values).all())


def _moves(values: Floats) -> np.ndarray:
    """(n,) where an order is another than before."""
    return np.concatenate([[False], (np.diff(values) != 0) & np.isfinite(values[1:])])


def _jumps(values: Floats) -> np.ndarray:
    """(n,) where an order that changes all the time jumps: its mean over a block would be early and late."""
    moves = np.abs(np.nan_to_num(np.diff(values, prepend=values[:1])))
    return np.asarray(moves > JUMP * np.median(moves[moves > 0.0]))


def _nearest(samples: Floats, t: Floats) -> np.ndarray:
    return np.searchsorted(0.5 * (samples[1:] + samples[:-1]), t)


def _off(samples: Floats, t: Floats, beside: float) -> Floats:
    """Times between the first and last sample that are farther than `beside` from every one."""
    inside = t[(t > samples[0]) & (t < samples[-1])] if samples.size else t[:0]
    return inside[np.abs(samples[_nearest(samples, inside)] - inside) > beside]


def _lines(
    t: Floats, values: Floats, block: np.ndarray, middle: Floats, width: float
) -> tuple[Floats, Floats, float, float]:
    """(n,) the line through the readings of each block at its middle, NaN where few; (n,) what it takes of a
    bend, over that of many even readings; how many a block holds by the time between readings; what one is
    worth there, of one of readings about the middle (the variance of a line beside its centre)."""
    good, n = np.isfinite(values), middle.size
    times = t[good]
    rate = width / float(np.median(np.diff(times))) if times.size > 1 else 0.0
    where = block[good]
    size = np.bincount(where, minlength=n).astype(float)
    # about the block's own middle and first reading: positions far from the origin keep their digits
    origin = np.zeros(n)
    origin[where[::-1]] = values[good][::-1]
    off, x = (times - middle[where]) / width, values[good] - origin[where]
    sums = [np.bincount(where, weights=w, minlength=n) for w in (off, x, off**2, off * x, off**3)]
    enough = size >= max(2.0, FULL * rate)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_t, mean_x, tt, tx, ttt = (s / size for s in sums)
        spread = tt - mean_t**2
        out = origin + mean_x - (tx - mean_t * mean_x) / spread * mean_t
        share = 12.0 * (tt - mean_t * (ttt - mean_t * tt) / spread)
        worth = 1.0 / (1.0 + mean_t**2 / spread)
    usual = float(np.median(worth[enough])) if enough.any() else 1.0
    return np.where(enough, out, np.nan), np.where(enough, share, 0.0), rate, usual


def _unbent(means: Floats, share: Floats) -> Floats:
    """Averages without what the bend of the motion adds to them; beyond the first and last bend that the
    averages show it goes on by a line, over holes by one between neighbours."""
    there = np.flatnonzero(np.isfinite(means))
    if there.size < 3:
        return means
    inner = means[there[0] : there[-1] + 1]
    away = AWAY if inner.size >= 2 * AWAY + 2 else 1
    second = (inner[2 * away :] - 2.0 * inner[away : inner.size - away] + inner[: -2 * away]) / away**2
    known = np.flatnonzero(np.isfinite(second))
    if not known.size:
        return means
    second = np.interp(np.arange(second.size), known, second[known])
    on, slope = np.arange(away, 0, -1), np.diff(second) if second.size > 1 else np.zeros(1)
    bend = np.concatenate([second[0] - on * slope[0], second, second[-1] + on[::-1] * slope[-1]])
    out = means.copy()
    out[there[0] : there[-1] + 1] -= share[there[0] : there[-1] + 1] * bend / 24.0
    return out


def _left(run: Run, noise: Mapping[str, float], held: Mapping[str, float], width: float) -> float:
    """The most that is left of a bend in the averages of a channel, rms, over their noise."""
    out = 0.0
    for name, values in run.data.items():
        good = np.isfinite(values)
        if name not in noise or held.get(name, 1.0) <= 1.0 or good.sum() < 5:
            continue
        x, t = values[good], run.t[good]
        near = np.abs(t[4:] - t[:-4] - 4.0 * width) < 0.1 * width
        fourth = np.diff(x, 4)[near]
        if fourth.size:
            excess = float(np.mean(fourth**2)) - NOISE_OF_FOURTH * noise[name] ** 2
            out = max(out, LEFT * np.sqrt(max(excess, 0.0)) / noise[name])
    return float(out)
