"""Effects that do what one coefficient does which the readings put far from where it was stated.

Takes a bank of sensitivities and a refit. Gives `StandsFor`s. Fits nothing.

More drag straight ahead and a coefficient of drag that was stated too small are one force: no run tells a
fouled hull from a wrong number, and each is worth saying. How far such a coefficient lies off is told by
every straight run, whatever else the equations lack: what a model form may leave moves the estimate by some
of its deviations, and the rest is certain.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidences import shares_of_wide
from bayesid.diagnosis.hypotheses.probabilities import TWO_SIDED_95
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY, SensitivityBank
from bayesid.diagnosis.threshold_table import ONE_COEFFICIENT
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.model.effects import Effect
from bayesid.model.terms import term

# what an effect that multiplies coefficients is made of
_SHARE = re.compile(r"\b(quadratic_drag|drag|rows|coef)\(")


@dataclass(frozen=True)
class StandsFor:
    """An effect, and the coefficient in whose place it would explain the runs as well.

    Attributes
    ----------
    effect, coefficient : names
    size, sd : of the effect that moves the coefficient as the readings do [unit of its parameter]
    moved : how improbable that is of what was stated, as of a normal deviate, less what a form may leave
    certain : log evidence of the effect over no effect that no force of the motion takes away [nats]
    """

    effect: str
    coefficient: str
    size: float
    sd: float
    moved: float
    certain: float


def standing_for(
    problem: DiagnosisProblem, bank: SensitivityBank, fitted: FilterErrorFit, leaves: float, least: float
) -> tuple[StandsFor, ...]:
    """Effects that stand for coefficients of hull forces which a fit puts beyond doubt further off than
    stated, the surest first.

    Parameters
    ----------
    fitted : with coefficients known as stated
    leaves : log evidence that a model form may leave; it moves an estimate by sqrt(2 leaves) deviations
    least : normal deviate from which on a coefficient is further off than stated
    """
    model, total, names = problem.model, bank.total(0), list(problem.stated.names)
    out = []
    for name, columns in bank.effects.items():
        key = columns.effect.key(columns.effect.parameters[0].name)
        if not _one_share(columns.effect) or key in fitted.free.names:
            continue
        j = int(columns.variants[0][0])
        norm = np.sqrt(np.diag(total.ss)[: len(names)] * total.ss[j, j])
        alike = np.abs(total.ss[j, : len(names)]) / np.where(norm > 0.0, norm, np.inf)
        k = int(np.argmax(alike)) if alike.size else 0
        if not alike.size or alike[k] ** 2 < ONE_COEFFICIENT or term(names[k]).is_number:
            continue  # a number of a propeller or rudder, as the thrust deduction, does what many causes do
        moved, left = _estimate(fitted, names[k])
        form = math.sqrt(2.0 * leaves * left)
        # a deviate of the prior's predictive distribution, small where the readings hardly tell
        surely = max(abs(moved) / math.sqrt(1.0 - left) - form, 0.0)
        at, stated = bank.par[problem.stated.where[k]], problem.stated.mean[k]
        if surely < least or not at or not stated:
            continue
        # a share of the coefficient as the path has it, of which the stated one is another share
        per = float(total.ss[j, k] / total.ss[k, k]) * stated / at
        unit, error = model.prior_sd(key), math.sqrt(left / (1.0 - left))
        low, high = model.effect_limits.get(model.index[key], (-math.inf, math.inf))
        size = moved / (1.0 - left) / per * unit
        if low <= size <= high:
            certain = max(_gain(surely, 1.0 + per**2 * (1.0 - left)), 0.0)
            sd = abs(math.hypot(error, error * math.sqrt(2.0 * leaves) / TWO_SIDED_95) / per) * unit
            out.append(StandsFor(name, names[k], size, sd, surely, certain))
    return tuple(sorted(out, key=lambda s: -s.moved))


def certainly_wrong(stands: Sequence[StandsFor], tried: Sequence[str]) -> float:
    """Log evidence of coefficients further off than stated over none that no force of the motion takes away.

    Parameters
    ----------
    tried : names of what was tried with a wider prior
    """
    if not stands or not tried:
        return 0.0
    share, widths = shares_of_wide(tried), {**dict.fromkeys(tried, 10.0), **EVERY}
    most = max(stands, key=lambda s: s.moved)
    about = [n for n in tried if n in EVERY or n == most.coefficient]
    if not about:
        return 0.0
    gains = [_gain(most.moved, widths[n] ** 2) for n in about]
    return max(float(logsumexp(gains, b=[share[n] for n in about])), 0.0)


def explained_by(stands: Sequence[StandsFor], fitted: FilterErrorFit, least: float) -> float:
    """What of the log evidence that no force of the motion takes away is an explanation's as well: that of
    coefficients which are as stated in its refit.

    Straight runs tell that something ahead is off, not that it is the coefficient: a loss of thrust that
    leaves the drag as stated explains them too.
    """
    known = [s for s in stands if s.coefficient in fitted.free.names]
    return max((s.certain for s in known if abs(_estimate(fitted, s.coefficient)[0]) < least), default=0.0)


def _one_share(effect: Effect) -> bool:
    """Whether an effect is one share of coefficients and nothing else."""
    return (
        len(effect.parameters) == 1
        and effect.smooth
        and bool(effect.force)
        and all(_SHARE.search(text) for text in effect.force.values())
    )


def _estimate(fitted: FilterErrorFit, name: str) -> tuple[float, float]:
    """Estimate of a coefficient from what was stated, and what is left of its variance, of that stated."""
    i = fitted.free.names.index(name)
    moved = float((fitted.values[i] - fitted.free.mean[i]) / fitted.free.sd[i])
    return moved, min(float(fitted.sd[i] / fitted.free.sd[i]) ** 2, 1.0 - 1e-9)


def _gain(moved: float, wider: float) -> float:
    """What a variance so many times that stated gains of an estimate so many deviations off [nats]."""
    return 0.5 * moved**2 * (1.0 - 1.0 / wider) - 0.5 * math.log(wider)
