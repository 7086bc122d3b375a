"""A model with a mistake mended: its numbers, and how well they are known.

Takes a `Model` and a `Change`. Gives a `Model`, and the means and deviations of its coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.simulator.table import ROWS, Change, Numbers
from bayesid.equations.model import Model
from bayesid.estimation.parameters import DEFAULT_RELATIVE_SD, GaussianPrior, coefficient_prior
from bayesid.estimation.run_data import Array
from bayesid.model.vehicles.vehicle import CoefficientPrior


def numbers_of(model: Model) -> Numbers:
    """The numbers of a model as given."""
    value = {n: float(model.nominal[i]) for n, i in model.index.items() if "." not in n}
    return Numbers(value, model.scales, float(model.vehicle.rpm_ref or 1.0))


def usual(stated: GaussianPrior) -> float:
    """Median relative deviation of the coefficients."""
    at = stated.mean != 0.0
    return float(np.median(stated.sd[at] / np.abs(stated.mean[at]))) if at.any() else DEFAULT_RELATIVE_SD


def beside(model: Model, stated: GaussianPrior, changes: Sequence[Change]) -> GaussianPrior:
    """What some mistakes change and the coefficients do not hold; deviations are the largest change."""
    names = tuple(dict.fromkeys(n for c in changes for n in c.values if n not in stated.names))
    where = model.positions(names)
    mean = model.nominal[where]
    sizes = [
        max(max(abs(c.values[n] - m), c.sd.get(n, 0.0)) for c in changes if n in c.values)
        for n, m in zip(names, mean, strict=True)
    ]
    sd = np.maximum(np.array(sizes, dtype=float), 1e-12)
    return GaussianPrior(names, where, mean, sd, np.full(len(names), -np.inf))


def mended_prior(stated: GaussianPrior, extra: GaussianPrior, change: Change) -> tuple[Array, Array]:
    """Means and deviations [SI] of the coefficients and of what is beside them, once mended.

    A coefficient keeps its relative deviation; one the file lacks gets the usual one, a mass property none.
    """
    free = stated + extra
    mean, sd = free.mean.copy(), free.sd.copy()
    k = len(stated.names)
    sd[k:] = 0.0
    for i, name in enumerate(free.names):
        if name not in change.values:
            continue
        mean[i] = change.values[name]
        if name in change.sd:
            sd[i] = change.sd[name]
        elif i < k and free.mean[i] != 0.0 and mean[i] != 0.0:
            sd[i] *= abs(mean[i] / free.mean[i])
        elif i >= k and ROWS.get(name) is not None and ROWS[name].group != "propulsion":
            sd[i] = usual(stated) * abs(mean[i])
    return mean, sd


def mended_model(model: Model, change: Change) -> Model:
    """The model with a mistake mended; its coefficients keep their relative deviations."""
    stated = coefficient_prior(model)
    seen = change.within(model.index)
    nominal = model.with_values(seen.values)
    nominal.setflags(write=False)
    rows = [n for n in seen.values if n in ROWS and ROWS[n].group != "propulsion"]
    vehicle = model.vehicle
    coef = vehicle.coef | {n: seen.values[n] / model.file_scale(n) for n in rows}
    prior = vehicle.prior or CoefficientPrior(dict.fromkeys(vehicle.coef, DEFAULT_RELATIVE_SD))
    relative = {**prior.relative_sd, **{n: usual(stated) for n in rows if n not in vehicle.coef}}
    names, covariance = prior.names, prior.covariance
    if seen.sd:
        own = tuple(n for n in seen.sd if n not in names)
        sizes = np.array([seen.sd[n] / abs(model.file_scale(n)) for n in own])
        old = covariance if covariance is not None else np.zeros((0, 0))
        k = len(names)
        covariance = np.zeros((k + len(own), k + len(own)))
        covariance[:k, :k] = old
        covariance[k:, k:] = np.diag(sizes**2)
        names = (*names, *own)
    mended = replace(vehicle, coef=coef, prior=CoefficientPrior(relative, names, covariance))
    return replace(model, vehicle=mended, nominal=nominal)
