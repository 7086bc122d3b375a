"""How well a linear relation holds: marginal likelihood over its parameters and the level of its residuals.

Takes a response, columns and prior standard deviations. Gives log evidence and estimates with sd.
Does not: know what the columns mean.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayesid.trials.trial import Floats

FLOOR = 2e-3  # relations of rigid-body kinematics between sampled, filtered channels hold no better than this
LEVELS = 28  # residual levels from the floor to the size of the response, evenly in the logarithm
_LEVEL2 = np.geomspace(FLOOR, 4.0, LEVELS) ** 2
_LOG_LEVEL2 = np.log(_LEVEL2)


@dataclass(frozen=True, eq=False)
class Relation:
    """response = columns @ parameters + white residuals of unknown level.

    Attributes
    ----------
    name : "track", "course", "yaw", "depth", "pitch", "roll"
    response : (n,) real; two-dimensional relations stacked
    columns : parameter -> (n,)
    sd : parameter -> prior standard deviation about zero
    size : rms of what the relation explains, in units of the response: the scale of its residuals
    jacobian : log of |d response / d response as logged|, summed over the readings, of a corrected log
    """

    name: str
    response: Floats
    columns: Mapping[str, Floats]
    sd: Mapping[str, float]
    size: float
    jacobian: float = 0.0


@dataclass(frozen=True)
class Held:
    """A relation weighed.

    Attributes
    ----------
    log_evidence : [nats]
    level : rms of the residuals over `size`
    estimate : parameter -> (value, sd)
    residuals : (n,) over `size`
    """

    log_evidence: float
    level: float
    estimate: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    residuals: Floats = field(default_factory=lambda: np.zeros(0))


def weigh(relation: Relation) -> Held:
    """Evidence of a relation; its residual level has a log-uniform prior from `FLOOR` to 4 times `size`."""
    y = relation.response / relation.size
    names = list(relation.columns)
    x = np.column_stack([relation.columns[k] * relation.sd[k] for k in names]) / relation.size
    left, values, right = np.linalg.svd(x, full_matrices=False)
    inside = left.T @ y
    outside = max(float(y @ y - inside @ inside), 0.0)
    spread = values**2 + _LEVEL2[:, None]
    n = y.size
    quadratic = np.sum(inside**2 / spread, axis=1) + outside / _LEVEL2
    log_det = np.sum(np.log(spread), axis=1) + (n - values.size) * _LOG_LEVEL2
    each = -0.5 * (quadratic + log_det + n * np.log(2 * np.pi))
    top = float(each.max())
    share = np.exp(each - top)
    total = top + float(np.log(share.mean())) - n * np.log(relation.size) + relation.jacobian
    best = float(_LEVEL2[int(each.argmax())])
    gain = values / (values**2 + best)
    z = right.T @ (gain * inside)
    var = np.sum((right.T**2) * (best / (values**2 + best)), axis=1) + 1.0 - np.sum(right.T**2, axis=1)
    estimate = {
        k: (float(z[i] * relation.sd[k]), float(np.sqrt(max(var[i], 0.0)) * relation.sd[k]))
        for i, k in enumerate(names)
    }
    return Held(total, float(np.sqrt(best)), estimate, y - x @ z)
