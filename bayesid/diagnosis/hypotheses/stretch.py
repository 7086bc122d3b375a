"""When a gap acts: the shortest stretch of one run that holds what a latent signal gains.

Takes the paths of a `DiagnosisProblem` and the latent input that gains most. Gives a frozen `Stretch`; None
where the signal is wanted in more than one run. Names no cause.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import LatentInputs, NoiseModel, smoothed
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.parameters import GaussianPrior

# Log evidence by which the signal of one run alone must beat one in every run, and that a shorter stretch may
# lose: three nats are odds of twenty to one.
CLEAR = 3.0


@dataclass(frozen=True)
class Stretch:
    """A stretch of one run.

    Attributes
    ----------
    run : its name
    start, end : [s], by the clock of the log
    gain : log evidence of the signal, allowed only there, over none
    value, sd : mean of the signal over the stretch and one standard deviation, SI; None where the place has
        more inputs than one
    """

    run: str
    start: float
    end: float
    gain: float
    value: float | None = None
    sd: float | None = None


def stretch_of(
    problem: DiagnosisProblem,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    latent: LatentInputs,
) -> Stretch | None:
    """Shortest stretch of one run to which a latent input can be confined.

    None where it acts in several runs, or all through the only one.

    Parameters
    ----------
    paths : linearised along the path the evidence of places is taken at
    free : parameters integrated out
    latent : input of the place of most evidence, allowed everywhere
    """

    def equations(k: int, allowed: LatentInputs | None) -> NormalEquations:
        return run_equations(problem.model, paths[k], free, noise_model, allowed, k)

    count = len(paths)
    none, every = ([equations(k, one) for k in range(count)] for one in (None, latent))
    base = _evidence(none)
    alone = [_evidence([*none[:k], every[k], *none[k + 1 :]]) - base for k in range(count)]
    k = int(np.argmax(alone))
    if not alone[k] > CLEAR or (count > 1 and alone[k] < _evidence(every) - base + CLEAR):
        return None
    size = problem.logs[k].n

    def only(first: int, last: int) -> LatentInputs:
        masks = [np.zeros(log.n, dtype=bool) for log in problem.logs]
        masks[k][first:last] = True
        return replace(latent, masks=tuple(masks))

    def gain(first: int, last: int) -> float:
        return _evidence([*none[:k], equations(k, only(first, last)), *none[k + 1 :]]) - base

    first, last = shortest(gain, size)
    if count == 1 and (first, last) == (0, size):
        return None
    found = only(first, last)
    equal = [*none[:k], equations(k, found), *none[k + 1 :]]
    t = problem.logs[k].plan.t
    told = Stretch(
        problem.logs[k].name, float(t[first]), float(t[min(last, size - 1)]), _evidence(equal) - base
    )
    if len(latent.inputs) != 1:
        return told
    values = free.mean + free.sd * posterior(sum(equal[1:], equal[0])).mean
    path = paths[k]
    signal = smoothed(problem.model, path, values - path.point.par[free.where], noise_model, found, k)
    at = path.point.states.shape[1] + len(noise_model.force)
    inside = slice(first, last)
    return replace(
        told,
        value=float(signal.mean[inside, at].mean()),
        sd=float(np.sqrt(np.maximum(signal.variance[inside, at], 0.0)).mean()),
    )


def shortest(gain: Callable[[int, int], float], size: int, most: float = CLEAR) -> tuple[int, int]:
    """First sample, and the one after the last, of the shortest stretch that holds the gain.

    The start is moved as late and then the end as early as loses at most `most` of the largest gain seen.

    Parameters
    ----------
    gain : of a stretch
    size : samples in all
    """
    first, last, best = 0, size, gain(0, size)
    for side in ("first", "last"):
        good, bad = (first, last) if side == "first" else (last, first)
        while abs(bad - good) > 1:
            middle = (good + bad) // 2
            found = gain(middle, last) if side == "first" else gain(first, middle)
            if found >= best - most:
                good, best = middle, max(best, found)
            else:
                bad = middle
        first, last = (good, last) if side == "first" else (first, good)
    return first, last


def _evidence(equations: Sequence[NormalEquations]) -> float:
    return posterior(sum(equations[1:], equations[0])).log_evidence
