"""The force of every coefficient along a manoeuvre, and its share of its axis.

Takes a `Model` and a simulated run. Gives plain numbers. Explanation 3 of the paper speaks of terms whose
force is small; what a track shows of them is their sensitivity, which is another thing.
"""

from __future__ import annotations

import numpy as np

from bayesid.analysis.excitation.columns import evaluate
from bayesid.analysis.excitation.motion import exact_motion
from bayesid.equations.model import Model
from bayesid.estimation.output_error.simulated_recovery import Target
from bayesid.model.terms import term

RATE = {"udot": "u", "vdot": "v", "rdot": "r"}


def forces_along(model: Model, target: Target) -> dict[str, np.ndarray]:
    """(n,) force of every coefficient the vehicle has, at the samples of a run [N, N m]; truth, effects off.

    Acceleration derivatives count with their force X_udot udot, ..., as Gertler & Hagen (1967) write them.
    """
    motion = exact_motion(model, model.nominal, target.plan, target.x0)
    rates = dict(zip(model.kernel.velocities, motion.rate.T, strict=True))
    found = {}
    for name in model.coefficients:
        row = term(name)
        if row.is_inertia:
            regressor = rates[RATE[row.regressor]]
        else:
            regressor = evaluate(row.regressor, model, motion.states, motion.actuators)
        found[name] = model.nominal[model.index[name]] * regressor
    return found


def force_table(model: Model, target: Target) -> dict[str, dict[str, float]]:
    """Per coefficient: rms force, and share of its axis.

    The share is the mean size of the force over the sum of the mean sizes of all coefficients of the axis, so
    that the shares of an axis sum to one although the forces themselves largely cancel.
    """
    forces = forces_along(model, target)
    size = {n: float(np.mean(np.abs(f))) for n, f in forces.items()}
    whole = {axis: sum(s for n, s in size.items() if n[0] == axis) for axis in {n[0] for n in size}}
    return {
        n: {"rms": float(np.sqrt(np.mean(f * f))), "share": size[n] / whole[n[0]]} for n, f in forces.items()
    }
