"""What an explanation surely costs by the sizes it asks for.

Takes a `DiagnosisProblem` and a refit. Gives nats. Fits nothing.

A force that the equations lack bends what the readings tell of a cause; it does not make a size usual that
is not. Ballast of 39 % of the mass, where 6 % is usual, is as improbable whatever else acts on the hull: of
that part of the evidence nothing is taken away.
"""

from __future__ import annotations

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.candidate import RefittedHypothesis, size_columns
from bayesid.diagnosis.hypotheses.kinematic import Kinematics, parameters_told
from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.threshold_table import SIZE_DEVIATIONS


def cost_of_sizes(problem: DiagnosisProblem, candidate: RefittedHypothesis, sensors: Kinematics) -> float:
    """Log prior density of nothing over that of the sizes, each at the end of its 95 % interval that is
    nearer to nothing [nats].

    Intervals are those of sizes where the equations lack a form (`SIZE_DEVIATIONS`). Shapes and times have no
    usual size and cost nothing; what kinematics tells has paid in its own evidence.

    Parameters
    ----------
    sensors : `by_kinematics` of the refit
    """
    free = candidate.fit.free
    groups = size_columns(problem.model, free.names, candidate.effects)
    own = {free.names[i] for group in groups for i in group} - set(sensors.table)
    usual = dict(zip(free.names, free.sd, strict=True))
    told = parameters_told(problem, candidate, sensors)
    return sum(
        0.5 * (max(abs(value) - TWO_SIDED_95 * SIZE_DEVIATIONS * sd, 0.0) / usual[name]) ** 2
        for name, (value, sd) in told.items()
        if name in own
    )
