"""Times at which an effect that acts from a time on may begin, and where an output-error fit begins with one.

Takes runs or a `FitProblem`. Gives times, or the problem with other start values. Does not fit.
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.estimation.effect_gain import descended
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.run_data import RunData

# Times tried of a dated effect, as shares of the runs: the speed of a hull takes about a tenth of a trial's
# run to follow, so that one of them is near enough for a fit to find the time.
ONSETS = (0.5, 0.3, 0.7, 0.15, 0.85)


def onsets_tried(runs: Sequence[RunData]) -> tuple[float, ...]:
    """Times since the runs began [s], the usual one first; of parts of runs those the parts reach."""
    first = min(float(run.plan.t[0] - run.plan.began) for run in runs)
    last = max(float(run.plan.t[-1] - run.plan.began) for run in runs)
    return tuple(first + share * (last - first) for share in ONSETS)


def begun_in_time(problem: FitProblem) -> FitProblem:
    """The problem with every dated effect begun at the best of some times, in the size asked for there.

    A time has no slope while the effect is off: a search from nothing at the prior's mean stays there. One
    that the vehicle file has on begins as the file says.
    """
    model = problem.model
    for effect in model.effects.values():
        if effect.dated is None or effect.key(effect.parameters[effect.dated].name) in model.vehicle.effects:
            continue
        own = [effect.key(p.name) for p in effect.parameters]
        time, params = own[effect.dated], problem.params
        if not set(own) <= set(params.names):
            continue
        best, start = float("inf"), dict[str, float]()
        for onset in onsets_tried(problem.runs):
            held = problem.with_params(params.changed([time], role="fixed", start=onset, prior=None))
            z, cost = descended(held, held.start)
            if cost < best:
                found = dict(zip(held.params.names, z, strict=False))
                best, start = cost, {n: float(found.get(n, onset)) for n in own}
        for name, value in start.items():
            params = params.changed([name], start=value)
        problem = problem.with_params(params)
    return problem
