"""Is the noise of a channel what was stated: the stated value as prior, fast changes of the readings as data.

Takes runs and the stated noise. Gives, per channel, what is seen and whether it is to be believed.
Does not: judge channels whose fast changes are not white noise alone (coarse sampling, filtered, held or
quantised readings); these keep what was stated. Fast changes do not show slow errors, which the stated value
may well mean: a noise below the stated one asks for more than one above it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.model.channels import channel
from bayesid.trials.noise import difference_noise, noise_of_readings, not_stated_words, raised
from bayesid.trials.trial import Floats, Run, Trial, channels_of

ORDER, OTHER_ORDERS = 6, (4, 8)  # of the differences: a quintic is removed, a cubic, a polynomial of 7
FEWEST = 60  # readings of a channel in all runs together
# White noise is the same at every other reading and by differences of any order; motion and what a low-pass
# filter leaves grow at every other reading.
WHITE = 0.2  # logarithm by which these, and at most twice that single runs, may differ
# Where every other reading shows more, the rest is motion, whose variance grows at least fourfold there (that
# of a rate with a kink): this bounds the noise from below, and it is told if the bounds are no farther apart.
BOUNDS = 0.3
# Where all channels that are told are stated too small by one factor (within this in the logarithm, at least
# so many), those that are not told are taken to be so, too.
ALIKE, MANY = 0.25, 2
# Motion sampled too coarsely to follow is white as well. Where it is not longer than this of L/U from reading
# to reading, and its noise less than this of what a channel does, a noise above the stated one is believed.
FINE, SMALL = 0.7, 0.25
FINER = 0.35  # the same where motion is seen in the differences
# A noise below the stated one is believed where every fourth reading shows the same as well. Of the tanker in
# the pond (filtered, or stamps that jitter) it shows 1.6 times as much, of noise that is white 0.9 to 1.1.
SLOWER, MOST = 4, 200.0  # stated over seen: beyond it the log is no sensor's
SPREAD = 0.1  # sd of the logarithm, of the stated value and of the seen one each
APART = 2.5  # standard deviations of their difference from which on the stated one is not believed
REPEATED = 0.3  # share of readings equal to the one before: held or quantised
SAID = "noise stated against noise seen"
DEGREES = 0.15  # logarithm by which stated over seen may miss 57.3 where degrees were stated for radians


@dataclass(frozen=True)
class SeenNoise:
    """Noise of one channel as stated and as its fast changes show it [SI].

    Attributes
    ----------
    name : channel
    stated, seen : one sigma
    width : half of the range of the logarithm in which the seen one lies, beside its spread
    by_others : whether the other channels tell it
    """

    name: str
    stated: float
    seen: float
    width: float = 0.0
    by_others: bool = False

    @property
    def ratio(self) -> float:
        """Stated over seen."""
        return self.stated / self.seen

    @property
    def wrong(self) -> bool:
        """Whether the two disagree by more than their spread."""
        return abs(math.log(self.ratio)) > APART * math.hypot(SPREAD, SPREAD) + self.width


def seen_noise(
    runs: Sequence[Run], stated: Mapping[str, float], size: tuple[float, float] | None = None
) -> tuple[SeenNoise, ...]:
    """Channels whose noise can be told from their readings.

    Parameters
    ----------
    stated : channel -> one sigma [SI]
    size : length and speed of the vehicle [m, m/s], where they are known
    """
    out, left = [], {}
    for name, sigma in stated.items():
        series = _series(runs, name)
        bounds = _bounds(series)
        if not sigma > 0 or bounds is None:
            continue
        low, high = bounds
        width = 0.5 * math.log(high / low) if low > 0 else math.inf
        seen = math.sqrt(low * high)
        bounded = width == 0 or (2 * width < BOUNDS and seen > sigma and _fine(series, size, FINER))
        if not bounded or (seen > sigma and not (_fine(series, size, FINE) and _small(series, seen))):
            left[name] = high
        elif seen < sigma and not _believable(series, name, seen, sigma, size):
            continue
        else:
            out.append(SeenNoise(name, sigma, seen, width))
    return (*out, *_by_others(out, left, stated))


def _by_others(
    told: Sequence[SeenNoise], left: Mapping[str, float], stated: Mapping[str, float]
) -> list[SeenNoise]:
    """Channels that are not told, by the factor by which all others are stated too small.

    Parameters
    ----------
    left : channel -> what its noise is at most [SI]
    """
    factors = [-math.log(one.ratio) for one in told]
    if len(told) < MANY or not all(one.wrong and one.ratio < 1 for one in told):
        return []
    if max(factors) - min(factors) > 2 * ALIKE:
        return []
    factor = math.exp(sum(factors) / len(factors))
    return [
        SeenNoise(name, stated[name], min(factor * stated[name], high), by_others=True)
        for name, high in left.items()
        if high > stated[name]
    ]


def with_seen_noise(trial: Trial, size: tuple[float, float]) -> Trial:
    """The trial with the noise that is seen where what is stated is not to be believed, and a warning on it.

    Parameters
    ----------
    size : length and speed of the vehicle [m, m/s]
    """
    seen = seen_noise(trial.identify, trial.noise, size)
    wrong = stated_wrongly(seen)
    if wrong is None:
        return trial
    return replace(trial, noise=believed(trial.noise, seen), warnings=(*trial.warnings, wrong))


def with_noise_of_readings(trial: Trial, size: tuple[float, float]) -> Trial:
    """The trial with a noise for every channel: what is not stated is seen in its readings, and said.

    Parameters
    ----------
    size : length and speed of the vehicle [m, m/s]; no noise is taken to be less than `LEAST` of it
    """
    missing = [name for name in channels_of(trial.identify) if name not in trial.noise]
    found = noise_of_readings(trial.identify, missing)
    if not found:
        return trial
    noise = {**trial.noise, **found}
    return replace(
        trial, noise=noise | raised(noise, *size), warnings=(*trial.warnings, not_stated_words(found))
    )


def noise_warning(trial: Trial) -> str | None:
    """The sentence `with_seen_noise` has put into the warnings of a trial."""
    return next((text for text in trial.warnings if text.startswith(SAID)), None)


def _series(runs: Sequence[Run], name: str) -> list[tuple[Floats, Floats]]:
    """Times and values of a channel in every run that reads it."""
    out = []
    for run in runs:
        if name in run.data:
            good = np.isfinite(run.data[name])
            if good.sum() > 2 * ORDER:
                out.append((run.t[good], run.data[name][good]))
    return out


def _bounds(series: Sequence[tuple[Floats, Floats]]) -> tuple[float, float] | None:
    """Least and most noise over all runs, equal where it is white; None where fast changes do not tell it."""
    if sum(t.size for t, _ in series) < FEWEST:
        return None
    steps = np.concatenate([np.diff(x) for _, x in series])
    if float(np.mean(steps == 0.0)) > REPEATED:
        return None
    runs = _estimates(series, ORDER, 1)
    if not runs.size or not float(np.median(runs)) > 0:
        return None
    high = float(np.median(runs))
    if float(np.median(np.abs(np.log(np.maximum(runs, 1e-9 * high) / high)))) > 2 * WHITE:
        return 0.0, high
    for order in OTHER_ORDERS:
        if not abs(_log_median(_estimates(series, order, 1), high)) < WHITE:
            return 0.0, high
    more = _log_median(_estimates(series, ORDER, 2), high)
    if not more > -WHITE:
        return None
    if more < WHITE:
        return high, high
    return high * math.sqrt(max(0.0, (4.0 - math.exp(2.0 * more)) / 3.0)), high


def _log_median(values: Floats, unit: float) -> float:
    return math.log(max(float(np.median(values)), 1e-9 * unit) / unit) if values.size else math.nan


def _estimates(series: Sequence[tuple[Floats, Floats]], order: int, stride: int) -> Floats:
    """Noise at every `stride`-th reading of every run."""
    found = []
    for t, x in series:
        for first in range(stride):
            at, values = t[first::stride], x[first::stride]
            usual = float(np.median(np.diff(at)))
            found.append(difference_noise(at / usual, values, np.diff(at) <= 3.0 * usual, order))
    return np.array([value for value in found if math.isfinite(value)])


def _believable(
    series: Sequence[tuple[Floats, Floats]],
    name: str,
    seen: float,
    stated: float,
    size: tuple[float, float] | None,
) -> bool:
    """Whether a noise below the stated one may be all there is: white for longer, and that of a sensor."""
    if stated > MOST * seen or (size is not None and raised({name: seen}, *size)):
        return False
    return abs(_log_median(_estimates(series, ORDER, SLOWER), seen)) < WHITE


def _fine(series: Sequence[tuple[Floats, Floats]], size: tuple[float, float] | None, most: float) -> bool:
    """Whether readings follow each other closely, in L/U; motion that nobody bounds counts as fast."""
    step = max(float(np.median(np.diff(t))) for t, _ in series)
    return most >= FINE if size is None else step <= most * size[0] / size[1]


def _small(series: Sequence[tuple[Floats, Floats]], noise: float) -> bool:
    """Whether a noise is small beside what the channel does."""
    return noise < SMALL * max(float(np.std(x)) for _, x in series)


def believed(stated: Mapping[str, float], seen: Sequence[SeenNoise]) -> dict[str, float]:
    """Channel -> noise to go on with: as stated, or as seen where the two disagree [SI]."""
    return dict(stated) | {one.name: one.seen for one in seen if one.wrong}


def stated_wrongly(seen: Sequence[SeenNoise]) -> str | None:
    """One sentence on what is stated wrongly, with the lines that mend it; None where nothing is."""
    wrong = [one for one in seen if one.wrong]
    if not wrong:
        return None
    parts = ", ".join(f"{one.name} {_times(one)}" for one in wrong)
    lines = ", ".join(f"{one.name} = {one.seen:.3g}" for one in wrong)
    degrees = [one.name for one in wrong if _in_degrees(one)]
    hint = f" ({', '.join(degrees)} in degrees? [noise] is in rad and rad/s)" if degrees else ""
    return (
        f"{SAID} in fast changes of the readings: {parts}{hint}; the seen one is used. In trial.toml: "
        f"[noise] {lines}"
    )


def _in_degrees(one: SeenNoise) -> bool:
    angle = channel(one.name).unit.startswith("rad")
    return angle and abs(math.log(one.ratio * math.pi / 180.0)) < DEGREES


def _times(one: SeenNoise) -> str:
    times = f"{one.ratio:.2g} times" if one.ratio >= 1 else f"1/{1 / one.ratio:.2g}"
    return times + " (as the others)" if one.by_others else times
