"""Effects that do what one coefficient does which the readings put far from where it was stated.

Takes a bank of sensitivities and a refit. Gives `StandsFor`s. Fits nothing.

More drag straight ahead and a coefficient of drag that was stated too small are one force: no run tells a
fouled hull from a wrong number, and each is worth saying. How far such a coefficient lies off is told by
every straight run, whatever else the equations lack: what a model form may leave moves the estimate by some
of its deviations, and the rest is certain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidences import shares_of_wide
from bayesid.diagnosis.hypotheses.sensitivity_bank import EVERY, SensitivityBank
from bayesid.diagnosis.threshold_table import ONE_COEFFICIENT
from bayesid.estimation.filter_error.fit import FilterErrorFit
from bayesid.model.terms import term


@dataclass(frozen=True)
class StandsFor:
    """An effect, and the coefficient in whose place it would explain the runs as well.

    Attributes
    ----------
    effect, coefficient : names
    size, sd : of the effect that moves the coefficient as the readings do [unit of its parameter]
    moved : how far the coefficient surely lies from what was stated [stated standard deviations]
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
    least : stated standard deviations from which on a coefficient is further off than stated
    """
    model, total, names = problem.model, bank.total(0), list(problem.stated.names)
    out = []
    for name, columns in bank.effects.items():
        key = columns.effect.key(columns.effect.parameters[0].name)
        if len(columns.effect.parameters) > 1 or not columns.effect.smooth or key in fitted.free.names:
            continue
        j = int(columns.variants[0][0])
        norm = np.sqrt(np.diag(total.ss)[: len(names)] * total.ss[j, j])
        alike = np.abs(total.ss[j, : len(names)]) / np.where(norm > 0.0, norm, np.inf)
        k = int(np.argmax(alike)) if alike.size else 0
        if not alike.size or alike[k] ** 2 < ONE_COEFFICIENT or term(names[k]).is_number:
            continue  # a number of a propeller or rudder, as the thrust deduction, does what many causes do
        moved, error = _likelihood(fitted, names[k])
        surely = math.copysign(max(abs(moved) - math.sqrt(2.0 * leaves) * error, 0.0), moved)
        if abs(surely) < least:
            continue
        # a share of the coefficient as the path has it, of which the stated one is another share
        at, stated = bank.par[problem.stated.where[k]], problem.stated.mean[k]
        per = float(total.ss[j, k] / total.ss[k, k]) * (stated / at if at else 1.0)
        unit = model.prior_sd(key)
        low, high = model.effect_limits.get(model.index[key], (-math.inf, math.inf))
        size = moved / per * unit
        if low <= size <= high:
            certain = _gain(surely, 1.0 + per**2)
            out.append(
                StandsFor(name, names[k], size, abs(error / per) * unit, abs(surely), max(certain, 0.0))
            )
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


def _likelihood(fitted: FilterErrorFit, name: str) -> tuple[float, float]:
    """Estimate of a coefficient by the readings alone and its deviation [stated standard deviations]."""
    i = fitted.free.names.index(name)
    moved = float((fitted.values[i] - fitted.free.mean[i]) / fitted.free.sd[i])
    left = min(float(fitted.sd[i] / fitted.free.sd[i]), 1.0 - 1e-9) ** 2
    return moved / (1.0 - left), math.sqrt(left / (1.0 - left))


def _gain(moved: float, wider: float) -> float:
    """What a variance so many times that stated gains of an estimate so many deviations off [nats]."""
    return 0.5 * moved**2 * (1.0 - 1.0 / wider) - 0.5 * math.log(wider)
