"""Which effects readings tell by kinematics alone, whatever force the equations lack.

Takes a `DiagnosisProblem`, an effect and its parameters. No fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, parameter_table
from bayesid.model.effects import Effect


def is_kinematic(problem: DiagnosisProblem, effect: Effect, table: Mapping[str, tuple[float, float]]) -> bool:
    """Whether readings tell an effect of a sensor without any force: d psi/dt against r, the velocity over
    ground against u, v turned by psi. Not where roll, which a planar model leaves out, gives the same.

    Parameters
    ----------
    table : parameter -> estimate and standard deviation (`parameter_table`)
    """
    channels, planar = set(problem.channels), problem.model.dof == 3
    rolls = (p.roll_from < table[effect.key(p.name)][0] < p.off for p in effect.parameters)
    seen = set(effect.sensor) | {c for group in effect.sensor_delay.values() for c in group}
    if effect.port != "sensor" or "z" in seen or (planar and any(rolls)):
        return False
    whole = {"x", "y", "psi", "u", "v"} <= channels
    return {"psi", "r"} <= channels if seen == {"r"} else whole


def kinematic_effects(problem: DiagnosisProblem, candidates: Iterable[RefittedHypothesis]) -> frozenset[str]:
    """Effects of these candidates that kinematics tells in each that has them."""
    told: dict[str, bool] = {}
    for c in candidates:
        if c.widens or not c.effects:
            continue
        table = parameter_table(c.fit, problem)
        for name in c.effects:
            told[name] = told.get(name, True) and is_kinematic(problem, problem.model.effects[name], table)
    return frozenset(n for n, yes in told.items() if yes)
