"""What the readings tell of the effects of sensors by kinematics alone, whatever force the equations lack.

Takes a `DiagnosisProblem` and its refits. Gives log evidence and parameters. Fits nothing.

Along the path of a refit the forces are left free: process noise larger than any force that manoeuvres a
vehicle. What the effects of sensors still gain is that positions, heading, rates and speeds contradict one
another without them; what they gain besides rests on the equations, and is worth what these are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import (
    RefittedHypothesis,
    explains,
    log_mass_in_range,
    parameter_table,
    size_columns,
    spread_over_runs,
    widened_by_few,
)
from bayesid.diagnosis.threshold_table import ADD_EVIDENCE
from bayesid.equations.layout import names_read
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import stacked_equations
from bayesid.estimation.filter_error.noise_model import force_unit
from bayesid.model.effects import Effect

# Force over 1/2 rho L^2 U^2, moment over 1/2 rho L^3 U^2, that leaves the motion free. Between 0.003 and 0.03
# estimates move by less than half of their sd.
FREE_FORCE = 0.01


@dataclass(frozen=True)
class Kinematics:
    """What kinematics says of the effects of sensors in one explanation.

    Attributes
    ----------
    evidence : log evidence lost without all of them [nats]
    parts : effect -> what is lost without it beside the others [nats]
    table : parameter -> estimate and standard deviation [SI], of those that are told
    """

    evidence: float = 0.0
    parts: Mapping[str, float] = field(default_factory=dict)
    table: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def told(self) -> frozenset[str]:
        """Effects that kinematics tells beside the others."""
        return frozenset(n for n, part in self.parts.items() if part > ADD_EVIDENCE)


NOTHING = Kinematics()


def by_kinematics(problem: DiagnosisProblem, candidate: RefittedHypothesis) -> Kinematics:
    """What kinematics alone says of a refit; nothing where no effect of a sensor can be read so, or the refit
    does not follow the data.
    """
    fitted, model = candidate.fit, problem.model
    if candidate.widens or not candidate.effects or not explains(candidate):
        return NOTHING
    found = parameter_table(fitted, problem)
    asked = [n for n in candidate.effects if readable(problem, model.effects[n], found)]
    if not asked:
        return NOTHING
    noise_model, free = problem.environment.noise_model, fitted.free
    overestimated = np.maximum(noise_model.force, FREE_FORCE * force_unit(model))
    columns = {n: [free.names.index(model.effects[n].key(p.name)) for p in model.effects[n].parameters
                   if model.effects[n].key(p.name) in free.names] for n in asked}  # fmt: skip
    z = (fitted.values - free.mean) / free.sd

    def evidence(without: Sequence[str] = ()) -> float:
        gone = np.array([i for n in without for i in columns[n]], dtype=int)
        # an effect of no size shows no shape: a time to settle stays where the columns of both were taken
        sized = {n: size_columns(model, free.names, [n]) for n in without}
        shape = np.array(
            [i for n, own in sized.items() for i in columns[n] if own and i not in own[0]], dtype=int
        )
        kept = np.setdiff1d(np.arange(len(free.names)), gone)
        some = posterior(total.given(shape, z[shape]).pick(kept))
        return some.log_evidence + log_mass_in_range(model, fitted, some, kept)

    try:
        equations = stacked_equations(
            model, fitted.paths, free, replace(noise_model, force=tuple(overestimated))
        )
        total = sum(equations[1:], equations[0])
        whole = evidence()
        lost = [whole - evidence(n) for n in (asked, *([n] for n in asked))]
        found_so = posterior(total)
    except (ModelError, np.linalg.LinAlgError):
        return NOTHING
    parts = dict(zip(asked, (float(x) for x in lost[1:]), strict=True))
    value = free.mean + free.sd * found_so.mean
    spread = widened_by_few(len(equations)) * spread_over_runs(equations, free.sd)
    sd = np.maximum(free.sd * np.sqrt(np.diag(found_so.covariance)), spread)
    table = {}
    for i in (i for n in asked if parts[n] > ADD_EVIDENCE for i in columns[n]):
        low, high = model.effect_limits.get(int(free.where[i]), (-np.inf, np.inf))
        table[free.names[i]] = (float(np.clip(value[i], low, high)), float(sd[i]))
    return Kinematics(float(lost[0]), parts, table)


def parameters_told(
    problem: DiagnosisProblem, candidate: RefittedHypothesis, sensors: Kinematics | None = None
) -> dict[str, tuple[float, float]]:
    """Effect parameters of a refit: name -> (value, sd) in SI.

    Where the equations lack a form, what kinematics tells is taken from kinematics alone: equations that are
    not those of the vehicle would only bend it (cut inference; Plummer 2015).

    Parameters
    ----------
    sensors : `by_kinematics` of the refit, where it is there already
    """
    table = parameter_table(candidate.fit, problem)
    if problem.form is None:
        return table
    return table | dict((by_kinematics(problem, candidate) if sensors is None else sensors).table)


def readable(problem: DiagnosisProblem, effect: Effect, table: Mapping[str, tuple[float, float]]) -> bool:
    """Whether channels are there that contradict an effect of a sensor without any force: d psi/dt against r,
    the velocity over ground against u, v turned by psi. Not where roll, which a planar model leaves out,
    gives the same.

    Parameters
    ----------
    table : parameter -> estimate and standard deviation (`parameter_table`)
    """
    channels = set(problem.channels)
    seen = set(effect.sensor) | {c for group in effect.sensor_delay.values() for c in group}
    if effect.port != "sensor" or "z" in seen or given_by_roll(problem, effect, table):
        return False
    whole = {"x", "y", "psi", "u", "v"} <= channels
    return {"psi", "r"} <= channels if seen == {"r"} else whole


def given_by_roll(
    problem: DiagnosisProblem, effect: Effect, table: Mapping[str, tuple[float, float]]
) -> bool:
    """Whether a list or heel, which a planar model leaves out, gives what an effect is estimated at.

    Parameters
    ----------
    table : parameter -> estimate and standard deviation (`parameter_table`)
    """
    sizes = ((p, table.get(effect.key(p.name), (p.off, 0.0))[0]) for p in effect.parameters)
    return problem.model.dof == 3 and any(p.roll_from < size < p.off for p, size in sizes)


def given_by_leeway(
    problem: DiagnosisProblem,
    effect: Effect,
    table: Mapping[str, tuple[float, float]],
    beside: Sequence[Effect] = (),
) -> bool:
    """Whether the leeway of a constant side force gives what an effect is estimated at.

    Only where no reading of v tells them apart: where v is not read, beside a model form, where such a force
    is no hypothesis of its own (one screw pushes a ship aside as well) and the effect would stand for it; or
    where the zero of v is unknown, as another effect adds a share of u to its reading. Of a compass and a
    velocity log that are turned, kinematics tells the difference alone.

    Parameters
    ----------
    beside : the other effects of the explanation
    """
    turned = any("u" in names_read(e.sensor["v"]) for e in beside if "v" in e.sensor)
    if not turned and (problem.form is None or "v" in problem.channels):
        return False
    sizes = ((p, table.get(effect.key(p.name), (p.off, 0.0))[0]) for p in effect.parameters)
    return any(0.0 < abs(size - p.off) < p.leeway for p, size in sizes)
