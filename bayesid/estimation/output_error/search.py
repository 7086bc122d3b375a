"""Fit a problem: rounds of SLSQP, each rescaled where the last one ended, from one or several starts.

Takes a `FitProblem` and `FitOptions`. Gives a `Fit`; one that did not converge is a result with a message.
Does not choose parameters, read logs or write reports.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from bayesid.errors import FitError
from bayesid.estimation.output_error.curvature import predicted_gain, root_of_covariance
from bayesid.estimation.output_error.elimination import eliminated
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.output_error.flat_directions import flat_directions, singular_values
from bayesid.estimation.output_error.iterate_log import IterateLog
from bayesid.estimation.output_error.problem import FitProblem
from bayesid.estimation.output_error.slsqp import DAMPING, Clock, Enough, Iterate, Round, run_round
from bayesid.estimation.output_error.trust_region import finish

Array = np.ndarray
TIME_SHARES = ("line_search", "gradient", "subproblem", "other")
FRESH = "--fresh (in Python resume=False) begins anew"
SAME_COST = 1e-6  # share by which a cost computed again may differ: other processors round otherwise
# Rounds of SLSQP before a search is finished in a trust region, and evaluations there per round allowed.
BEFORE_FINISHING, FINISHING = 6, 10
SAME_COST_SHARE = 1e-3  # starts whose costs differ by less than this share end in the same minimum


@dataclass(frozen=True)
class FitOptions:
    """How to search.

    rounds, iterations : at most this many rounds of at most so many SLSQP iterations
    gain : converged when the predicted further decrease of the cost is below this [half chi-square: 1e-3
        moves no estimate by more than 0.05 sd] ...
    relative_gain : ... or below this share of the cost
    goal : stop as soon as the cost is below this
    starts : number of starts; the first is the parameter set's own, the others a Sobol design within the
        bounds
    spread : half width of that design where there are no bounds, in units of the scale
    flat_level : relative sd beyond which a direction counts as flat
    profile : weigh every channel by its own residuals: their rms, as the maximum of the likelihood has it,
        times the root of their correlation time [samples], so that errors that persist do not count as many
        readings. None: no, but `fit_trial` does where the trial leaves the noise of a channel open
    finish : a search that has not converged after six rounds goes on in a trust region (`trust_region`),
        unless it stalls or profiles
    """

    rounds: int = 20
    iterations: int = 25
    gain: float = 1e-3
    relative_gain: float = 1e-6
    goal: float = 0.0
    starts: int = 1
    spread: float = 0.3
    flat_level: float = 0.5
    profile: bool | None = None
    finish: bool = False
    seed: int = 0


def fit(
    problem: FitProblem,
    options: FitOptions | None = None,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = True,
    watch: Callable[[int, float, float], None] | None = None,
    note: Callable[[Iterate], None] | None = None,
    store: bool = True,
    say: Callable[[str], None] | None = None,
    begin: Array | None = None,
) -> Fit:
    """Minimise the cost of a problem.

    Parameters
    ----------
    folder : gets `iterates.jsonl` (every iterate as it is reached) and `fit.json` (before anything else is
        done)
    store : without it no fit.json is written: this search is a part of one that is not done
    resume : go on from an `iterates.jsonl` of the same problem and options; warns, and begins anew, where the
        cost it tells is not that of the values it tells
    watch : called with (iterations done, cost, step)
    note : called with every `Iterate`; for studies of the search itself
    say : told in a sentence whether the search goes on from what the folder holds, where it holds anything
    begin : unknowns at which the first search begins, within the bounds; by default the start values

    Raises
    ------
    FitError
        if the vehicle diverges where the search begins
    """
    options = options or FitOptions()
    if not np.isfinite(problem.cost(problem.start if begin is None else begin)):
        raise FitError(
            "the simulated vehicle diverges at the start values; check signs and units of the coefficients"
        )
    journal = IterateLog(
        Path(folder) / "iterates.jsonl" if folder else None,
        {
            "digest": _digest(problem, options, begin), "problem": problem.digest, "seed": options.seed,
            "names": list(problem.names),
        },
        resume,
    )  # fmt: skip
    try:
        _check(problem, options, journal, begin)
        if say is not None and (words := _resumed_words(journal, options)):
            say(words)
        searches = [
            _search(problem, options, number, z0, journal, watch, note)
            for number, z0 in enumerate(start_points(problem, options, begin))
        ]
    finally:
        journal.close()
    best = min(searches, key=lambda s: s.cost_unit if options.profile else s.cost)
    clock = Clock()
    for search in searches:
        clock.add(search.clock)
    result = _result(problem, options, best, searches, clock)
    if begin is not None:
        result = replace(result, cost_start=problem.with_sigma(result.sigma).cost(problem.start))
    if folder and store:
        result.save(Path(folder) / "fit.json")
    return result


def start_points(problem: FitProblem, options: FitOptions, begin: Array | None = None) -> list[Array]:
    """Starts (k,): the parameter set's own or the one given, then a scrambled Sobol design; initial states
    there as the data suggest.
    """
    points = [problem.start if begin is None else begin]
    if options.starts > 1:
        k = len(problem.params.names)
        start, scale = problem.start[:k], problem.scale[:k]
        low = np.maximum(problem.low[:k], start - options.spread * scale)
        high = np.minimum(problem.high[:k], start + options.spread * scale)
        design = qmc.Sobol(k, seed=np.random.default_rng(options.seed))
        count = 1 << (options.starts - 2).bit_length() if options.starts > 2 else 1
        for row in design.random(count)[: options.starts - 1]:
            points.append(np.concatenate([low + row * (high - low), problem.start[k:]]))
    return points


def minus_log_likelihood(problem: FitProblem, found: Fit) -> float:
    """Negative log-likelihood with prior of a fit of the problem, under the fit's own noise, up to a constant
    [nats]: costs of fits whose noise was estimated are each in their own."""
    return _unit_cost(problem.with_sigma(found.sigma), found.cost)


def _unit_cost(problem: FitProblem, cost: float) -> float:
    logs = sum(
        float(np.isfinite(r.readings[:, j]).sum()) * np.log(r.sigma[j])
        for r in problem.runs
        for j in range(len(r.channels))
    )
    return cost + float(logs)


class _Search:
    """One start on its way: its point, path and clock."""

    def __init__(self, problem: FitProblem, number: int, z: Array) -> None:
        self.problem, self.number, self.z = problem, number, z
        self.cost_start = self.cost = problem.cost(z)
        self.costs: list[float] = []
        self.steps: list[float] = []
        self.rounds = 0
        self.clock = Clock()
        self.status, self.message, self.predicted = "budget", "", float("nan")

    @property
    def cost_unit(self) -> float:
        return _unit_cost(self.problem, self.cost)


def _search(
    problem: FitProblem,
    options: FitOptions,
    number: int,
    z0: Array,
    journal: IterateLog,
    watch: Callable[[int, float, float], None] | None,
    note: Callable[[Iterate], None] | None = None,
) -> _Search:
    search = _Search(problem, number, z0)
    ended, begun = _restore(search, journal.found)
    if ended:
        return search
    if not np.isfinite(search.cost):
        search.status, search.message = "diverged", "the simulated vehicle diverges at this start"
        return search

    def after(z: Array, cost: float, step: float) -> None:
        search.costs.append(cost)
        search.steps.append(step)
        journal.write(
            kind="iterate", start=number, round=search.rounds, cost=cost, step=step, z=z.tolist(),
            sigma=_sigma(search.problem) if options.profile else None,
        )  # fmt: skip
        if watch is not None:
            watch(len(search.costs), cost, step)
        if cost <= options.goal:
            raise Enough("the cost goal is reached")

    slow, damping = 0, DAMPING
    finishing = options.finish and not options.profile
    most = min(options.rounds, BEFORE_FINISHING) if finishing else options.rounds
    while search.rounds < most:
        if begun is None:
            settled = not options.profile or _profile(search)
            search.predicted, zero = predicted_gain(search.problem, search.z)
            search.status, search.message = _judge(search, options, zero, slow)
            if search.status != "budget" and settled:
                break
            # a fit that is stopped goes on from here: a round cut short would take other steps
            journal.write(
                kind="round", start=number, round=search.rounds, done=len(search.costs), cost=search.cost,
                z=search.z.tolist(), sigma=_sigma(search.problem) if options.profile else None,
                predicted=search.predicted, slow=slow, damping=damping,
            )  # fmt: skip
        else:
            search.predicted, slow, damping = begun["predicted"], begun["slow"], begun["damping"]
            # said again, or the iterates of the round cut short would count beside those found anew
            journal.write(**{k: v for k, v in begun.items() if k != "digest"})
            begun = None
        done: Round = run_round(
            search.problem, search.z, options.iterations, 1e-9, search.predicted, damping, after, note
        )
        search.rounds += 1
        search.clock.add(done.clock)
        gained = search.cost - done.cost
        slow = slow + 1 if gained < 0.01 * search.predicted else 0
        # a bent valley: short line searches all along; the next round goes shorter ways from the beginning
        damping = min(100 * damping, 1e6) if gained < 0.7 * search.predicted else max(0.01 * damping, DAMPING)
        search.z, search.cost = done.z, done.cost
    else:
        search.predicted, zero = predicted_gain(search.problem, search.z)
        search.status, search.message = _judge(search, options, zero, slow)
    if search.status == "budget" and finishing:
        _finish(search, options, after)
    journal.write(
        kind="end", start=number, status=search.status, message=search.message, cost=search.cost,
        cost_start=search.cost_start, rounds=search.rounds, z=search.z.tolist(), predicted=search.predicted,
        sigma=_sigma(search.problem) if options.profile else None, clock=vars(search.clock),
    )  # fmt: skip
    return search


def _finish(search: _Search, options: FitOptions, after: Callable[[Array, float, float], None]) -> None:
    """The search taken on in a trust region; it stays where it was if that gains nothing."""
    most = FINISHING * options.rounds
    z, cost = finish(search.problem, search.z, _limit(search, options), most, after)
    if not cost < search.cost:
        return
    search.z, search.cost = z, cost
    search.predicted, zero = predicted_gain(search.problem, z)
    status, message = _judge(search, options, zero, 0)
    if status != "budget":
        search.status, search.message = status, f"{message}; the last steps in a trust region"


def _digest(problem: FitProblem, options: FitOptions, begin: Array | None) -> str:
    """Hash of problem, options and start: what an iterate belongs to."""
    out = hashlib.sha256(f"{problem.digest}|{options!r}".encode())
    if begin is not None:
        out.update(begin.tobytes())
    return out.hexdigest()[:16]


def _check(problem: FitProblem, options: FitOptions, journal: IterateLog, begin: Array | None) -> None:
    """Recompute the last cost of every start in a log; one that is not true makes the log worthless."""
    if not journal.found:
        return
    try:
        for number, z0 in enumerate(start_points(problem, options, begin)):
            search = _Search(problem, number, z0)
            _restore(search, journal.found)
            mine = [line for line in journal.found if line["start"] == number]
            for line in (*mine[-1:], *[x for x in mine if x["kind"] == "round"][-1:]):
                there = problem.with_sigma(line["sigma"]) if line.get("sigma") else problem
                found, told = there.cost(np.array(line["z"], dtype=float)), line["cost"]
                slack = SAME_COST * (abs(told) + 1e-3 * abs(search.cost_start))
                if not abs(found - told) <= slack < np.inf:
                    reason = f"start {number + 1} has cost {found:.6g}, its log says {told:.6g}"
                    break
            else:
                continue
            break
        else:
            return
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        reason = f"a line cannot be read ({type(error).__name__}: {error})"
    aside = journal.refuse()
    name = "" if aside is None else f"; it is kept as {aside.name}"
    warnings.warn(
        f"the log of the interrupted fit is not used: {reason}{name}, and the fit begins anew", stacklevel=3
    )


def _resumed_words(journal: IterateLog, options: FitOptions) -> str:
    """Whether a fit goes on from its log, and after how many iterates; empty where there is no log."""
    kept, ended = 0, set()
    for number in range(options.starts):
        count = at = 0
        for line in (x for x in journal.found if x.get("start") == number):
            if line["kind"] == "iterate":
                count += 1
            else:
                count = at = int(line["done"]) if line["kind"] == "round" else count
            if line["kind"] == "end":
                ended.add(number)
        kept += at
    if len(ended) == options.starts:
        return (
            f"goes on after a search of an earlier run of this fit, which had ended after {kept} iterates, "
            f"and after what is kept of searches that followed; {FRESH}"
        )
    if kept:
        return f"goes on after {kept} iterates of an interrupted run of this fit; {FRESH}"
    if journal.found:
        return f"begins anew: the run before was interrupted in the first {options.iterations} iterates"
    return "begins anew: the iterates kept there are of another fit" if journal.of_others else ""


def _restore(search: _Search, found: list[dict[str, Any]]) -> tuple[bool, dict[str, Any] | None]:
    """Take up what an earlier run left of this start: whether it had ended, else the round it was in."""
    begun = None
    for line in (x for x in found if x.get("start") == search.number):
        if line["kind"] == "iterate":
            search.costs.append(line["cost"])
            search.steps.append(line["step"])
            continue
        begun = line
        if line["kind"] == "round":  # iterates of a round cut short are found anew, and were told before
            del search.costs[int(line["done"]) :], search.steps[int(line["done"]) :]
    if begun is None:
        del search.costs[:], search.steps[:]
        return False, None
    search.z = np.array(begun["z"], dtype=float)
    if begun.get("sigma"):
        search.problem = search.problem.with_sigma(begun["sigma"])
    if begun["kind"] == "end":
        end = begun
        search.status, search.message, search.rounds = end["status"], end["message"], end["rounds"]
        search.cost, search.cost_start = end["cost"], end["cost_start"]
        search.predicted = end["predicted"]
        search.clock = Clock(**end["clock"])
        return True, None
    done = int(begun["done"])
    del search.costs[done:], search.steps[done:]
    search.cost, search.rounds = begun["cost"], int(begun["round"])
    return False, begun


def _sigma(problem: FitProblem) -> dict[str, float]:
    return {c: float(s) for r in problem.runs for c, s in zip(r.channels, r.sigma, strict=True)}


def _profile(search: _Search) -> bool:
    """Weights from the residuals at this point (see `Options.profile`); True if none changed by more than 3
    %.

    Held above 1e-6 of a channel's spread, so that perfect data do not make it vanish.
    """
    floor: dict[str, float] = {}
    for run in search.problem.runs:
        for j, c in enumerate(run.channels):
            floor[c] = max(floor.get(c, 0.0), 1e-6 * float(np.nanstd(run.readings[:, j])))
    new = {c: max(v, floor[c], 1e-12) for c, v in search.problem.channel_rms(search.z).items()}
    old = _sigma(search.problem)
    if all(abs(new[c] / old[c] - 1.0) < 0.01 for c in new):
        return True
    search.problem = search.problem.with_sigma(new)
    search.cost = search.problem.cost(search.z)
    return False


def _limit(search: _Search, options: FitOptions) -> float:
    """Predicted decrease of the cost that counts as none."""
    return max(options.gain, options.relative_gain * search.cost)


def _judge(search: _Search, options: FitOptions, zero: bool, slow: int) -> tuple[str, str]:
    if zero:
        return "rounding", "converged: residuals are at rounding level"
    if search.cost <= options.goal:
        return "goal", f"the cost goal {options.goal:.3g} is reached"
    limit = _limit(search, options)
    if search.predicted <= limit:
        return (
            "converged",
            f"converged: a further step would lower the cost by {search.predicted:.2g} (limit {limit:.2g})",
        )
    if slow >= 2:
        return "stalled", (
            f"stalled: two rounds gained less than 1 % of what a step promises ({search.predicted:.3g} "
            f"of {search.cost:.3g}); the cost has a kink or a jump here, as when an unstable "
            "vehicle tips to the other side: cut the runs into shorter pieces"
        )
    return "budget", (
        f"not converged after {search.rounds} rounds: a step promises {search.predicted:.3g} of "
        f"{search.cost:.3g}; fit pieces of the runs (--pieces SECONDS), free fewer "
        "coefficients, or begin from the vehicle file this fit writes"
    )


def _result(
    problem: FitProblem, options: FitOptions, best: _Search, searches: list[_Search], clock: Clock
) -> Fit:
    problem = best.problem
    z, low, high, scale = best.z, problem.low, problem.high, problem.scale
    k = len(problem.params.names)
    turned = problem.triangles(z)
    left = eliminated(problem, z, turned)
    prior = problem.params.prior_sd
    prior_all = np.concatenate([prior, *(r.initial_sd for r in problem.runs)])
    half = np.where(np.isfinite(high - low), 0.5 * (high - low), np.inf)
    seen = eliminated(problem, z, turned, prior=False).jac
    flat = flat_directions(
        problem.names[:k], seen, options.flat_level, prior / scale[:k], half[:k] / scale[:k]
    )
    root = root_of_covariance(left.jac)
    variance = np.concatenate([(root**2).sum(axis=1), left.state_variance(root)]) * scale**2
    # no state is less known than before; growth of an unstable run hides its prior in rounding
    variance[k:] = np.fmin(variance[k:], prior_all[k:] ** 2)
    covariance = root @ root.T * np.outer(scale[:k], scale[:k])
    width = np.where(np.isfinite(high - low), high - low, np.inf)
    near = (z - low <= 1e-6 * width) | (high - z <= 1e-6 * width)
    total = clock.line_search + clock.gradient + clock.subproblem + clock.other
    same = sum(abs(s.cost - best.cost) <= SAME_COST_SHARE * max(best.cost, 1e-300) for s in searches)
    message = best.message
    if len(searches) > 1:
        message += f"; {same} of {len(searches)} starts end there"
    return Fit(
        names=problem.names, n_params=k, z=z, start=problem.start, low=low, high=high, scale=scale,
        sd=np.sqrt(variance), covariance=covariance, prior_sd=prior_all,
        cost_start=best.cost_start, cost=best.cost, n_readings=problem.n_readings,
        at_bound=tuple(n for n, b in zip(problem.names, near & np.isfinite(width), strict=True) if b),
        status=best.status, message=message, predicted_gain=best.predicted, flat=flat,
        singular_values=singular_values(seen)[0], costs=tuple(best.costs), steps=tuple(best.steps),
        rounds=best.rounds,
        shares={n: getattr(clock, n) / max(total, 1e-12) for n in TIME_SHARES},
        seconds=total, n_cost=clock.n_cost, n_gradient=clock.n_gradient,
        starts=tuple({"cost_start": s.cost_start, "cost": s.cost, "reason": s.message} for s in searches),
        sigma=_sigma(problem), channel_rms=problem.channel_rms(z), seed=options.seed, digest=problem.digest,
    )  # fmt: skip
