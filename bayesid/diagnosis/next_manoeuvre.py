"""Which manoeuvre to run next: the one that best tells the explanations still standing apart.

Takes a `DiagnosisProblem` and candidate names. Gives ranked manoeuvres by the expected log-evidence margin
of the worst pair
(T-optimality: Hunter & Reiner 1965; Atkinson & Fedorov 1975). Flies the nominal model; needs no data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.sensitivity_bank import SensitivityBank, isolability, secants
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations
from bayesid.estimation.filter_error.linearise import Trajectory, linearise
from bayesid.estimation.filter_error.noise_model import whitened
from bayesid.estimation.parameters import effect_prior
from bayesid.estimation.run_data import Array, RunData
from bayesid.manoeuvres import LIBRARY, Manoeuvre, library, order_words
from bayesid.model.vehicles.orders import rudder_limits, steers
from bayesid.simulation import plan_run, run_manoeuvre, steady_start, with_own_states

MOST_LENGTHS = 60.0
# Duration of a manoeuvre over that of the longest run of the log, above which there may be no room for it: a
# spiral of an hour for a model in a pond.
LONGEST = 3.0


@dataclass(frozen=True)
class Proposal:
    """A manoeuvre and the margin [nats] of the worst pair without and with it; what is ordered in words, and
    the text by which commands take it."""

    name: str
    duration: float
    margin_now: float
    margin_with: float
    orders: str = ""
    typed: str = ""


def propose(
    problem: DiagnosisProblem, bank: SensitivityBank, names: Sequence[str], size: float
) -> tuple[Proposal, ...]:
    """Library manoeuvres, best first; none for a vehicle without a rudder, which cannot run them, and none
    that lasts much longer than any run of the log.

    Parameters
    ----------
    names : effects to tell apart; with fewer than two, detection of every visible effect counts instead
    size : of the effects, in prior standard deviations
    """
    model = problem.model
    if not steers(model.vehicle):
        return ()
    chosen = [n for n in names if n in bank.effects]
    now = worst_margin(bank, chosen, size)
    rpm = model.vehicle.rpm_ref or 1.0
    limit = min(rudder_limits(model.vehicle)[0], 0.6)
    out = []
    try:
        executed = library(model.scales["L"], model.scales["U"], rpm, limit, dof=model.dof)
    except BayesidError:
        return ()
    longest = max(float(log.plan.t[-1] - log.plan.t[0]) for log in problem.logs)
    for name, manoeuvre in with_room(executed, longest).items():
        try:
            added = added_equations(problem, bank, manoeuvre)
        except BayesidError:
            continue
        if added is None:
            continue
        more = replace(
            bank, equations=tuple((*g, added) if i == 0 else g for i, g in enumerate(bank.equations))
        )
        out.append(
            Proposal(
                name, float(manoeuvre.t[-1]), now, worst_margin(more, chosen, size), order_words(manoeuvre),
                LIBRARY[name],
            )
        )  # fmt: skip
    return tuple(sorted(out, key=lambda p: -p.margin_with))


def with_room(executed: Mapping[str, Manoeuvre], longest: float) -> dict[str, Manoeuvre]:
    """Manoeuvres that last no more than `LONGEST` times the longest run [s]; the shortest where all do."""
    short = {name: m for name, m in executed.items() if float(m.t[-1]) <= LONGEST * longest}
    return short or dict(sorted(executed.items(), key=lambda item: float(item[1].t[-1]))[:1])


def worst_margin(bank: SensitivityBank, names: Sequence[str], size: float) -> float:
    """Expected log-evidence margin [nats] of the pair that is hardest to tell apart; with fewer than two
    names half the median noncentrality of all effects."""
    apart = isolability(bank, size)
    if len(names) >= 2:
        index = [apart.names.index(n) for n in names]
        return float(min(apart.margin[i, j] for i in index for j in index if i != j))
    seen = size**2 * apart.detect
    return float(np.median(seen)) / 2.0


def added_equations(
    problem: DiagnosisProblem,
    bank: SensitivityBank,
    manoeuvre: object,
    par: Array | None = None,
    longest: float = MOST_LENGTHS,
) -> NormalEquations | None:
    """normal matrix a manoeuvre would add, in the column order of the bank; None if too few readings.

    Parameters
    ----------
    par : (n_par,) vehicle that runs it, effects off; the nominal one by default
    longest : what comes later is not counted [L/U]

    Raises
    ------
    ModelError
        if the vehicle diverges
    """
    model = problem.model
    par = model.nominal if par is None else par
    track, commands = run_manoeuvre(model, par, manoeuvre, steady_start(model))
    spacing = float(np.median(np.diff(problem.logs[0].plan.t)))
    stop = min(track.t[-1], longest * model.scales["L"] / model.scales["U"])
    t = np.arange(track.t[0], stop, spacing)
    if t.size < 20:
        return None
    held = {
        k: v[np.clip(np.searchsorted(track.t, t, side="right") - 1, 0, v.size - 1)]
        for k, v in commands.items()
    }
    plan = plan_run(model, t, held)
    like = problem.logs[0]
    base = np.column_stack([np.interp(t, track.t, track.states[:, j]) for j in range(len(model.states))])
    states = with_own_states(model, base)
    q = len(like.channels)
    log = RunData(
        "next",
        plan,
        like.channels,
        np.zeros((t.size, q)),
        like.sigma,
        states[0],
        model.kernel.full.states,
        like.initial_sd,
        path=states,
    )
    point = Trajectory(np.array(par), states, np.zeros((t.size - 1, len(bank.levels[0].force))))
    smooth = [c.effect for c in bank.effects.values() if c.effect.smooth]
    kinked = [c.effect for c in bank.effects.values() if not c.effect.smooth]
    free = problem.coefficients
    for effect in smooth:
        free = free + effect_prior(model, effect)
    path = linearise(model, log, point, free.where)
    extra = secants(problem, path, kinked) if kinked else None
    zero = np.zeros(len(free.names))
    w = whitened(model, path, zero, free.sd, bank.levels[0], extra=extra)
    empty: Array = np.zeros_like(w.resid)
    return normal_equations(empty, w.columns, w.logdet, w.used)
