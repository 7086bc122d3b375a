"""The coefficients of one vehicle over its bundles: shared values, whether they are one set, what changed.

Takes records of diagnoses and their diagnosed models. Gives frozen values in the units of the vehicle file.
Fits no log again: every bundle gives what its log alone says of the coefficients under its explanations,
effects and model form integrated out and the prior they were found under taken out, and these enter a normal
hierarchical model (`estimation.hierarchical_fit`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from bayesid.diagnosis.coefficient_estimate import CoefficientEstimate
from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.estimation.hierarchical_fit import HierarchicalFit, fit_hierarchy
from bayesid.estimation.hierarchical_normal import Information, information, mixed
from bayesid.model.vehicles import Vehicle, prime_scale
from bayesid.model.vehicles.inertia import mass_problems
from bayesid.model.vehicles.writing import identified

Array = np.ndarray
# Standard deviation over the prior's below which data fix a coefficient better than the prior.
FIXED = 0.8
# Probability of being one set from which coefficients are told so, and below which as not one, which is wrong
# in at most 1 of 19 vehicles that are one set (`hierarchical_fit`).
ONE_SET, NOT_ONE = 0.75, 0.05
# Probability from which a coefficient is told as changed where they are not one set, and share of it that
# those hold among which it is open.
CHANGED, HELD = 0.8, 0.95
# Share of the explanations that has to have arrived, or to widen a prior for the shared value to have it so.
MOST = 0.5
# Precision over the prior's below which no bundle says anything of a coefficient.
NOTHING = 1e-6
WIDER = 1.01
# Growth of the rms error of runs left out, as a logarithm, from which re-tuned coefficients took what is not
# theirs. Where those of the file are right, re-tuning predicts worse as well, by its own scatter.
WORSE = 0.1


@dataclass(frozen=True)
class CoefficientOfBundle:
    """One coefficient in one bundle, in the unit of the vehicle file.

    Attributes
    ----------
    alone, alone_sd : from its own log and the prior
    value, sd : with what the other bundles say of it (partially pooled)
    apart, apart_sd : its value minus that of the others
    others : value of the others
    fixed : whether its log fixes it better than the prior
    """

    bundle: str
    alone: float
    alone_sd: float
    value: float
    sd: float
    apart: float
    apart_sd: float
    others: float
    fixed: bool


@dataclass(frozen=True)
class SharedCoefficient:
    """One coefficient of a vehicle, in the unit of its file.

    Attributes
    ----------
    given, prior_sd : value of the file and its stated uncertainty
    value, sd : what the bundles share
    new_sd : of its value in a bundle to come
    changed : probability that it differs between bundles beyond the spread of all coefficients
    each : in the order of the bundles
    """

    name: str
    given: float
    prior_sd: float
    value: float
    sd: float
    new_sd: float
    changed: float
    each: tuple[CoefficientOfBundle, ...]

    @property
    def fixed(self) -> bool:
        """Whether the bundles together fix it better than the prior."""
        return self.sd < FIXED * self.prior_sd

    @property
    def furthest(self) -> CoefficientOfBundle:
        """The bundle without which the others agree best (least chi-square about their mean); of alike the
        later. Its distance from the others does not tell: one that differs draws the mean of all, and where
        two of three agree all three lie as many standard deviations from the other two.
        """
        able = [e for e in self.each if e.fixed] or list(self.each)

        def left(one: CoefficientOfBundle) -> float:
            others = [e for e in able if e is not one]
            value, weight = np.array([(e.alone, e.alone_sd**-2) for e in others]).T
            return round(float(weight @ (value - weight @ value / weight.sum()) ** 2), 6)

        last = max(able, key=lambda e: e.bundle)
        return last if len(able) < 3 else min(able, key=lambda e: (left(e), e is not last))


@dataclass(frozen=True, eq=False)
class SharedCoefficients:
    """The coefficients of one vehicle over its bundles.

    Attributes
    ----------
    vehicle : as given in the bundles
    bundles : that count, in their order
    same : probability that all coefficients are the same in all of them, to a tenth of what is stated
    any_changed : probability that at least one differs beyond the spread of all
    spread, spread_high : standard deviation tau between bundles [stated uncertainties], mean and 95 % limit
    coefficients : those of which a log says anything
    covariance, new_covariance : (k, k) of their shared values, and of their values in a bundle to come
    widened : coefficients whose stated uncertainty does not hold, with a wider prior
    cut : bundle -> directions in which its log says less than nothing, taken as nothing
    """

    vehicle: Vehicle
    bundles: tuple[str, ...]
    same: float
    any_changed: float
    spread: float
    spread_high: float
    coefficients: tuple[SharedCoefficient, ...]
    covariance: Array
    new_covariance: Array
    widened: tuple[str, ...] = ()
    cut: Mapping[str, int] = field(default_factory=dict)

    @property
    def changed(self) -> tuple[SharedCoefficient, ...]:
        """Coefficients told as changed, most probable first."""
        return tuple(c for c in self._ranked() if c.changed >= CHANGED)

    @property
    def suspects(self) -> tuple[SharedCoefficient, ...]:
        """Where it is open which one has changed: the fewest that hold 95 % of it, most probable first."""
        if self.changed or self.any_changed < MOST:
            return ()
        order = self._ranked()
        held = np.cumsum([c.changed for c in order])
        return order[: int(np.searchsorted(held, HELD * held[-1])) + 1] if order else ()

    def _ranked(self) -> tuple[SharedCoefficient, ...]:
        if self.same > NOT_ONE:
            return ()
        return tuple(sorted(self.coefficients, key=lambda c: (-c.changed, c.name)))

    @property
    def impossible(self) -> str:
        """Why no vehicle can have the shared coefficients, where none can."""
        return "; ".join(mass_problems(self.as_vehicle()))

    def as_vehicle(self) -> Vehicle:
        """The vehicle with the shared coefficients; its prior is that of a bundle to come."""
        names = [c.name for c in self.coefficients]
        scale = np.array([prime_scale(self.vehicle, n) for n in names])
        return identified(
            self.vehicle,
            {c.name: c.value * s for c, s in zip(self.coefficients, scale, strict=True)},
            source=f"shared by {', '.join(self.bundles)} (bayesid, normal hierarchical model)",
            names=names,
            covariance=self.new_covariance * np.outer(scale, scale),
        )


@dataclass(frozen=True)
class CoefficientSharing:
    """All vehicles, and bundle -> why it does not count."""

    vehicles: tuple[SharedCoefficients, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Log:
    """What one log says alone: coefficient -> value as given and stated sd; per explanation its weight and
    its likelihood in these units; wider prior sd over the stated one where explanations have it."""

    names: tuple[str, ...]
    given: Array
    prior_sd: Array
    each: tuple[tuple[float, Information], ...]
    wider: Array


def share_coefficients(
    records: Mapping[str, Mapping[str, Any]], models: Mapping[str, DiagnosedModel | str]
) -> CoefficientSharing:
    """Shared coefficients of every vehicle with two bundles that count, or more.

    Parameters
    ----------
    records : bundle -> what its diagnosis.json holds, in the order in which the bundles were logged
    models : bundle -> its diagnosed model, or why there is none
    """
    left: dict[str, str] = {}
    of_vehicle: dict[tuple[str, str], dict[str, tuple[_Log, Vehicle]]] = {}
    for name, record in records.items():
        model = models.get(name, "it keeps no model")
        log = _log(record, model)
        if isinstance(log, str) or isinstance(model, str):
            left[name] = str(log)
            continue
        key = str(record["trial"]["vehicle"]), str(record["trial"].get("vehicle_digest", ""))
        of_vehicle.setdefault(key, {})[name] = log, model.model.vehicle
    out = []
    for (vehicle, _), logs in sorted(of_vehicle.items()):
        if len(logs) > 1:
            out.append(_shared({n: log for n, (log, _) in logs.items()}, next(iter(logs.values()))[1]))
        else:
            left[next(iter(logs))] = f"no other bundle of the same vehicle file of {vehicle} counts"
    return CoefficientSharing(tuple(out), MappingProxyType({n: left[n] for n in records if n in left}))


def _log(record: Mapping[str, Any], model: DiagnosedModel | str) -> _Log | str:
    """What a bundle's log says, or why it does not count."""
    if isinstance(model, str):
        return model
    if record["verdict"] == "outside":
        return "its gap has no cause that is listed, and the coefficients may have taken some of it"
    if record.get("simulator"):
        return "a mistake of the simulator was found, which its coefficients may have taken some of"
    if _worse(record.get("retuning") or {}):
        return "re-tuned coefficients predict its own runs clearly worse than those of the vehicle file"
    if not model.estimates:
        return "its model does not keep the estimates of coefficients; diagnose it again"
    arrived = [e for e in model.estimates if e.converged]
    if sum(e.weight for e in arrived) < MOST:
        return "the fit of its explanation did not arrive"
    stated = record["moved"]
    names = tuple(n for n in stated if all(n in e.names for e in arrived))
    if not names:
        return "it frees no coefficient"
    given, sd = (np.array([stated[n][key] for n in names], dtype=float) for key in ("given", "prior_sd"))
    unit = sd * np.array([prime_scale(model.model.vehicle, n) for n in names])
    each = [(e.weight, *_likelihood(e, names, given / sd, unit)) for e in arrived]
    total = sum(w for w, _, _ in each)
    widening = np.sum([w / total * (ratio > WIDER) for w, _, ratio in each], axis=0)
    wider = np.max([ratio for _, _, ratio in each], axis=0)
    return _Log(
        names, given, sd, tuple((w, found) for w, found, _ in each), np.where(widening > MOST, wider, 1.0)
    )


def _worse(retuning: Mapping[str, Any]) -> bool:
    """Whether re-tuning predicts runs left out in turn clearly worse, by over two standard errors."""
    if retuning.get("alone"):  # the gain is that of an explanation which does not predict
        return False
    gain, error = retuning.get("gain"), retuning.get("error")
    return gain is not None and error is not None and gain < -max(2.0 * error, WORSE)


def _likelihood(
    e: CoefficientEstimate, names: Sequence[str], given: Array, unit: Array
) -> tuple[Information, Array]:
    """What the data say of coefficients under one explanation, and its prior sd.

    Parameters
    ----------
    given : (k,) values of the file in stated standard deviations
    unit : (k,) a stated standard deviation [SI], with the sign of the file's unit
    """
    where = [e.names.index(n) for n in names]
    wide = e.prior_sd[where] / np.abs(unit)
    found = information(
        e.mean[where] / unit - given,
        e.covariance[np.ix_(where, where)] / np.outer(unit, unit),
        e.prior_mean[where] / unit - given,
        wide,
    )
    return found, wide


def _shared(logs: Mapping[str, _Log], vehicle: Vehicle) -> SharedCoefficients:
    names = tuple(dict.fromkeys(n for log in logs.values() for n in log.names))
    place = {n: i for i, n in enumerate(names)}
    given, prior_sd, wide = np.zeros(len(names)), np.ones(len(names)), np.ones(len(names))
    for log in logs.values():
        at = np.array([place[n] for n in log.names])
        given[at], prior_sd[at] = log.given, log.prior_sd
        wide[at] = np.maximum(wide[at], log.wider)
    groups = []
    for log in logs.values():
        at = np.array([place[n] for n in log.names])
        found = mixed([e for _, e in log.each], [w for w, _ in log.each], wide[at])
        precision, score = np.zeros((len(names), len(names))), np.zeros(len(names))
        precision[np.ix_(at, at)], score[at] = found.precision, found.score
        groups.append(Information(precision, score, found.cut))
    told = np.flatnonzero(np.max([np.diag(g.precision) for g in groups], axis=0) > NOTHING)
    groups = [Information(g.precision[np.ix_(told, told)], g.score[told], g.cut) for g in groups]
    names = tuple(names[i] for i in told)
    given, prior_sd, wide = given[told], prior_sd[told], wide[told]
    alone = [g.posterior(wide) for g in groups]
    alone_sd = np.sqrt([np.diag(c) for _, c in alone])
    kept = alone_sd / wide  # of the prior sd they were found under
    weight = np.where(kept < FIXED, 1.0 - np.minimum(kept, 1.0) ** 2, 0.0)
    fit = fit_hierarchy(groups, wide, weight)
    unit = np.outer(prior_sd, prior_sd)
    values = np.array([m for m, _ in alone])
    return SharedCoefficients(
        vehicle,
        tuple(logs),
        fit.same,
        fit.any_changed,
        fit.spread,
        fit.spread_high,
        tuple(
            _coefficient(
                i, name, tuple(logs), given[i], prior_sd[i], fit, values[:, i], alone_sd[:, i], kept[:, i]
            )
            for i, name in enumerate(names)
        ),
        fit.covariance * unit,
        (fit.covariance + np.diag(fit.between)) * unit,
        tuple(n for n, w in zip(names, wide, strict=True) if w > WIDER),
        MappingProxyType({n: g.cut for n, g in zip(logs, groups, strict=True) if g.cut}),
    )


def _coefficient(
    i: int,
    name: str,
    bundles: Sequence[str],
    given: float,
    unit: float,
    fit: HierarchicalFit,
    alone: Array,
    alone_sd: Array,
    kept: Array,
) -> SharedCoefficient:
    each = tuple(
        CoefficientOfBundle(
            bundle,
            float(given + unit * alone[b]),
            float(unit * alone_sd[b]),
            float(given + unit * fit.groups[b, i]),
            float(unit * fit.groups_sd[b, i]),
            float(unit * fit.apart[b, i]),
            float(unit * fit.apart_sd[b, i]),
            float(given + unit * fit.others[b, i]),
            bool(kept[b] < FIXED),
        )
        for b, bundle in enumerate(bundles)
    )
    sd = float(np.sqrt(fit.covariance[i, i]))
    new_sd = float(np.sqrt(fit.covariance[i, i] + fit.between[i]))
    return SharedCoefficient(
        name,
        float(given),
        float(unit),
        float(given + unit * fit.mean[i]),
        float(unit * sd),
        float(unit * new_sd),
        float(fit.changed[i]),
        each,
    )
