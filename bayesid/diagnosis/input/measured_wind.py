"""Whether the columns of a measured wind hold what their header says, by how the ship moves in it.

Takes a trial whose other mistakes are mended, and a model on which its wind acts. Gives a `WindCheck`. Every
reading of the wind is a hypothesis, each with nothing else, with what an anemometer and the areas of a ship
leave open, and with a current: a gap of the ship must not pass for a mistake of its anemometer. All are
weighed along one path; those that come near the best are fitted. One that cannot be tested, as the log lacks
what it is made of, counts as likely as the best of those that can.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import LinAlgError
from scipy.special import logsumexp

from bayesid.diagnosis.data.problem import DiagnosisProblem, build_problem, first_fit
from bayesid.diagnosis.threshold_table import (
    FOLLOWS_DATA_CHI2,
    PRIOR_CATALOGUE,
    PRIOR_NONE,
    WIND_READ_SCATTER,
)
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.noise_identification import identify_noise
from bayesid.estimation.filter_error.read_run import LONGER_STEPS
from bayesid.estimation.filter_error.shared_linearisations import fresh
from bayesid.estimation.parameters import GaussianPrior, effect_prior
from bayesid.simulation import plan_trial_run
from bayesid.trials import Run, Trial, thin
from bayesid.trials.averaging import averaged
from bayesid.trials.correction import WIND, apply
from bayesid.trials.measured_wind import GAIN
from bayesid.trials.mistakes import InputFinding
from bayesid.trials.mistakes.judge import ALSO, NAMED_AT, SOME_RUNS
from bayesid.trials.mistakes.table import Mistake
from bayesid.trials.mistakes.wind import WIND_MISTAKES
from bayesid.trials.noise_stated import with_noise_of_readings, with_seen_noise
from bayesid.trials.true_wind import APPARENT_BY_COMPASS
from bayesid.words import and_list, first_few

# Share by which wind at the hull differs from that of an anemometer by its height and place: one sd, assumed
GAIN_SD = 0.25
# Readings above which dense ones are averaged; log odds behind the best from which on none is fitted, and how
# many mistakes are
MOST_SAMPLES, RULED_OUT, MOST_FITTED = 2_000, 20.0, 2
CALM = 0.15  # mean true wind over the vehicle's speed below which its direction is noise
WORTH_THINNING = 2.0  # times as many samples
# What may act beside a reading of the wind, and what may not: another wind than the one that was read.
BESIDE: tuple[tuple[str, ...], ...] = ((), ("wind",), ("ocean_current",), ("wind", "ocean_current"))
ANOTHER_WIND = ("wind.blowing_north", "wind.blowing_east")
TOLD_BY = "wind"
SPEED = ("wind_speed",)


@dataclass(frozen=True)
class WindCheck:
    """What was found of the columns of a measured wind.

    Attributes
    ----------
    finding : a mistake; None where the motion tells none
    asked : whether a wind was measured that acts on the vehicle
    in_order : whether the motion rules every other reading of its direction out
    remark : another reading that would explain the motion as well, in words
    untested : what of it could not be tested, and what the log lacks for that, in words
    """

    finding: InputFinding | None = None
    asked: bool = False
    in_order: bool = False
    remark: str | None = None
    untested: str = ""


@dataclass(frozen=True, eq=False)
class _Read:
    """One reading of the wind.

    Attributes
    ----------
    mistake : None where it is as the header says
    problem : None where the log lacks what it is made of
    differs : by how much the wind is another than as the header says, rms over rms
    """

    mistake: Mistake | None
    problem: DiagnosisProblem | None
    differs: float = 0.0

    @property
    def another(self) -> bool:
        """Whether it gives another wind altogether: a slow ship's apparent wind is nearly the true one."""
        mend = None if self.mistake is None else self.mistake.correction
        return mend is not None and (mend.wind != APPARENT_BY_COMPASS or self.differs > GAIN_SD)


@dataclass(frozen=True)
class _Told:
    """Log evidence by what acts beside a reading: of all runs, and along the path of each run alone."""

    every: Mapping[tuple[str, ...], float]
    alone: tuple[Mapping[tuple[str, ...], float], ...]


def check_wind(trial: Trial, model: Model) -> WindCheck:
    """How the columns of a measured wind are to be read, as the motion of the runs tells it."""
    runs = [run for run in trial.identify if set(run.exogenous) >= WIND]
    if not runs or model.vehicle.effects.get(GAIN, 0.0) == 0.0 or "wind" not in model.effects:
        return WindCheck()
    if all(_calm(run, model.scales["U"]) for run in runs):
        return WindCheck(asked=True)  # in calm air an anemometer made true reads its own noise
    try:
        size = model.scales["L"], model.scales["U"]
        seen = _short(with_seen_noise(replace(trial, runs=tuple(runs)), size), size)
        problem = build_problem(model, seen, seek_outliers=False)
        nothing = _fitted(problem, ())
        if nothing.chi2 > FOLLOWS_DATA_CHI2:
            overestimated = identify_noise(model, list(problem.logs), problem.coefficients)
            problem = problem.with_environment(overestimated.noise_model)
            nothing = _fitted(problem, ())
        if not nothing.converged:  # nothing along its path tells one reading from another
            return WindCheck(asked=True)
        # residuals beyond the noise: evidence counts by so much less (McCullagh and Nelder 1989, 9.2)
        less = max(nothing.chi2, 1.0)
        readings = _readings(problem, {run.name: run for run in seen.identify})
        told = {one: _along(one.problem, nothing) for one in readings if one.problem is not None}
        prior = _prior_beside(model)
        weights = _weights(told, prior, less)
        wrong = sorted((one for one in told if one.mistake is not None), key=lambda one: -weights[one])
        near = [one for one in wrong if weights[one] > max(weights.values()) - RULED_OUT][:MOST_FITTED]
        if near:
            # what the header says is never ruled out by linear theory alone
            for one in (*near, *(one for one in told if one.mistake is None)):
                assert one.problem is not None
                told[one] = replace(told[one], every=_with_fits(one.problem, told[one].every))
            weights = _weights(told, prior, less)
        untested = [one for one in readings if one.problem is None]
        best = max(w - _log_odds(one.mistake) for one, w in weights.items())
        weights |= {one: best + _log_odds(one.mistake) for one in untested}
        split = _Split(problem, told, prior, less)
        found = _judged(weights, split, [log.name for log in problem.logs])
    except (BayesidError, LinAlgError, ValueError, MemoryError):  # what ends this check, not a diagnosis
        return WindCheck(asked=True)
    return replace(found, untested=_lacking(untested, runs))


def _short(trial: Trial, size: tuple[float, float]) -> Trial:
    """Dense readings averaged; where that cannot be, fewer of them."""
    trial = averaged(with_noise_of_readings(trial, size), size[0] / size[1], MOST_SAMPLES)
    samples = sum(run.n_samples for run in trial.runs)
    if samples <= WORTH_THINNING * MOST_SAMPLES:
        return trial
    step = sum(run.duration for run in trial.runs) / MOST_SAMPLES
    return replace(trial, runs=tuple(thin(run, step) for run in trial.runs))


def _prior_beside(model: Model) -> dict[tuple[str, ...], float]:
    """Log prior of what may act beside a reading, as the diagnosis weighs it."""
    each = PRIOR_CATALOGUE / (len(model.causes) + 1)
    return {effects: len(effects) * np.log(each) if effects else np.log(PRIOR_NONE) for effects in BESIDE}


def _summed(
    told: Mapping[tuple[str, ...], float], prior: Mapping[tuple[str, ...], float], less: float
) -> float:
    """Log evidence over all that may act beside a reading; `less` is what evidence is divided by."""
    return float(logsumexp([value / less + prior[effects] for effects, value in told.items()]))


def _weights(
    told: Mapping[_Read, _Told], prior: Mapping[tuple[str, ...], float], less: float
) -> dict[_Read, float]:
    """Log weight of every reading."""
    return {one: _log_odds(one.mistake) + _summed(t.every, prior, less) for one, t in told.items()}


@dataclass(frozen=True, eq=False)
class _Split:
    """Whether runs contradict one another about a reading; which were tested is told by `told`."""

    problem: DiagnosisProblem
    told: Mapping[_Read, _Told]
    prior: Mapping[tuple[str, ...], float]
    less: float

    def words(self, one: _Read, runs: Sequence[str]) -> str | None:
        """A reading that some runs ask for and others contradict; None where none contradicts it.

        Along the path of the header's wind, and along that of this reading where a fit with it arrives: a run
        may be linearised far from what it asks for.
        """
        assert one.mistake is not None and one.problem is not None
        as_read = next(each for each in self.told if each.mistake is None)
        gains = self._gains(self.told[one], self.told[as_read])
        if min(gains) > -SOME_RUNS or max(gains) < SOME_RUNS:
            return None
        path = _fitted(one.problem, ())
        if path.converged:
            there = self._gains(_along(one.problem, path), _along(self.problem, path))
            gains = [min(a, b, key=abs) if a * b > 0.0 else 0.0 for a, b in zip(gains, there, strict=True)]
        wrong = [name for name, gain in zip(runs, gains, strict=True) if gain > SOME_RUNS]
        right = [name for name, gain in zip(runs, gains, strict=True) if gain < -SOME_RUNS]
        if not wrong or not right:
            return None
        return (
            f"{first_few(wrong, 3)} would be explained better if {one.mistake.says}, and "
            f"{first_few(right, 3)} worse: look at the wind of each"
        )

    def _gains(self, one: _Told, as_read: _Told) -> list[float]:
        """What every run alone says for a reading against the one of the header [nats]."""
        pairs = zip(one.alone, as_read.alone, strict=True)
        return [_summed(a, self.prior, self.less) - _summed(b, self.prior, self.less) for a, b in pairs]


def _readings(problem: DiagnosisProblem, runs: Mapping[str, Run]) -> list[_Read]:
    """The wind as its header says, then with every mistake mended."""
    out = [_Read(None, problem)]
    read = [runs[log.name] for log in problem.logs]
    for mistake in WIND_MISTAKES:
        assert mistake.correction is not None
        try:
            mended = [apply(mistake.correction, run) for run in read]
        except BayesidError:  # the log lacks what this mend needs
            out.append(_Read(mistake, None))
            continue
        logs = tuple(
            replace(log, plan=plan_trial_run(problem.model, run, longer=LONGER_STEPS))
            for log, run in zip(problem.logs, mended, strict=True)
        )
        out.append(_Read(mistake, replace(problem, logs=logs), _difference(read, mended)))
    return out


def _difference(read: Sequence[Run], mended: Sequence[Run]) -> float:
    """Rms of what one wind differs from another, over that of the stronger."""
    a, b = (np.concatenate([_vector(run) for run in some]) for some in (read, mended))
    level = max(float(np.nanmean(np.abs(w) ** 2)) for w in (a, b))
    return float(np.sqrt(np.nanmean(np.abs(a - b) ** 2) / level)) if level > 0.0 else 0.0


def _calm(run: Run, speed: float) -> bool:
    """Whether the wind of a run is weak beside the speed of the vehicle, by what does not average out."""
    return bool(abs(np.nanmean(_vector(run))) < CALM * speed)


def _vector(run: Run) -> np.ndarray:
    wind = run.exogenous["wind_speed"] * np.exp(1j * run.exogenous["wind_from"])
    return np.asarray(wind)


def _lacking(untested: Sequence[_Read], runs: Sequence[Run]) -> str:
    """Which readings were not tested, and what would test them."""
    if not untested:
        return ""
    names = and_list([one.mistake.name for one in untested if one.mistake is not None])
    needed = []
    if not all("psi" in run.data for run in runs):
        needed.append("the heading")
    if not all({"x", "y"} <= set(run.data) or {"u", "v", "psi"} <= set(run.data) for run in runs):
        needed.append("the track, or u and v")
    return f"{names} (needs {and_list(needed)})"


def _free(problem: DiagnosisProblem, effects: Sequence[str]) -> GaussianPrior:
    """Coefficients and parameters of effects; the gain of the wind as well known as anemometers are."""
    free = problem.coefficients
    for name in effects:
        prior = effect_prior(problem.model, problem.model.effects[name])
        kept = np.array([n not in ANOTHER_WIND for n in prior.names])
        sd = np.where(np.array(prior.names) == GAIN, GAIN_SD, prior.sd)[kept]
        names = tuple(n for n in prior.names if n not in ANOTHER_WIND)
        free = free + GaussianPrior(
            names, prior.where[kept], prior.mean[kept], sd, prior.low[kept], prior.high[kept]
        )
    return free


def _fitted(problem: DiagnosisProblem, effects: Sequence[str]) -> FilterErrorFit:
    start = first_fit(problem, [problem.model.effects[n] for n in effects], problem.path)
    level = max(problem.path_level, 1e-5)
    noise_model = problem.environment.noise_model
    return fit(
        problem.model, problem.logs, _free(problem, effects), noise_model, start=start,
        initial_noise_scale=level,
    )  # fmt: skip


def _along(problem: DiagnosisProblem, path: FilterErrorFit) -> _Told:
    """Log evidence of each of `BESIDE` along the path of a fit."""
    every = _free(problem, list(dict.fromkeys(name for effects in BESIDE for name in effects)))
    _, equations = fresh(problem.model, problem.logs, path.points, every, problem.environment.noise_model)
    total, names = sum(equations[1:], equations[0]), every.names
    kept = {
        effects: np.array([i for i, n in enumerate(names) if "." not in n or n.partition(".")[0] in effects])
        for effects in BESIDE
    }
    of_all, *of_runs = (
        {effects: posterior(some.pick(which)).log_evidence for effects, which in kept.items()}
        for some in (total, *equations)
    )
    return _Told(of_all, tuple(of_runs))


def _with_fits(
    problem: DiagnosisProblem, along: Mapping[tuple[str, ...], float]
) -> dict[tuple[str, ...], float]:
    """The same by fits, where they come higher: one that has not arrived proves nothing."""
    out = dict(along)
    for effects in (e for e, value in along.items() if value > max(along.values()) - RULED_OUT):
        try:
            fitted = _fitted(problem, effects)
        except BayesidError:
            continue
        if fitted.converged:
            out[effects] = max(out[effects], fitted.log_evidence)
    return out


def _judged(weights: Mapping[_Read, float], split: _Split, runs: Sequence[str]) -> WindCheck:
    """What is said by the log weight of every reading, those among them that were not tested."""
    total = float(logsumexp(list(weights.values())))
    as_read = next(w - total for one, w in weights.items() if one.mistake is None)
    wrong = [(w - total, one) for one, w in weights.items() if one.mistake is not None]
    wrong.sort(key=lambda each: (each[1].problem is None, -each[0]))
    if -np.expm1(as_read) < NAMED_AT:
        # the motion alone, before what a mistake costs that nobody asked for
        left_open = [(w - _log_odds(one.mistake), one) for w, one in wrong if one.another]
        tested = [each for each in left_open if each[1].problem is not None]
        most, likeliest = max(tested, key=lambda each: each[0], default=(-np.inf, None))
        remark = None
        if likeliest is not None and most > as_read:
            remark = split.words(likeliest, runs) or _either(likeliest)
        turned = [w for w, one in left_open if one.mistake is not None and one.mistake.channels != SPEED]
        in_order = all(w < as_read - WIND_READ_SCATTER for w in turned)
        return WindCheck(asked=True, in_order=in_order, remark=remark)
    most, best = wrong[0]
    if apart := split.words(best, runs):
        return WindCheck(asked=True, remark=apart)
    assert best.mistake is not None
    near = [(w, one.mistake.name) for w, one in wrong[1:] if one.mistake is not None and w > most - ALSO]
    together = float(np.exp(logsumexp([most, *(w for w, _ in near)]))) if near else 0.0
    found = InputFinding(
        best.mistake.name, best.mistake.says, best.mistake.channels, tuple(runs), True, float(np.exp(most)),
        (TOLD_BY,), 0.0, 0.0, best.mistake.correction, tuple(name for _, name in near), together,
        most - as_read,
    )  # fmt: skip
    return WindCheck(found, asked=True)


def _log_odds(mistake: Mistake | None) -> float:
    """Log odds of a reading before the data; evidence of one fit and another scatters."""
    return 0.0 if mistake is None else mistake.log_prior - WIND_READ_SCATTER


def _either(one: _Read) -> str:
    """Another reading of the wind that the motion leaves open, in words."""
    mistake = one.mistake
    assert mistake is not None and mistake.correction is not None
    line = "; ".join(mistake.correction.lines())
    if mistake.channels != SPEED:
        return (
            f"the runs would be explained as well if {mistake.says}: look at it (then [corrections] {line})"
        )
    factor = mistake.correction.scale[SPEED[0]]
    return (
        f"the runs move as in a wind {factor:.2g} times as fast as measured, or nearly: an anemometer's "
        f"height and place may do that, or else {mistake.says} (then [corrections] {line})"
    )
