"""Which parameters of a model an estimator is to find: coefficients and effect parameters, with their priors.

Takes a `Model` and names. Gives a `ParameterSet`, the one description both estimators read, or its Gaussian
form in arrays.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.model.effects import Effect
from bayesid.model.params import JointPrior, Parameter, ParameterSet, Prior
from bayesid.model.terms import TERMS, term
from bayesid.words import did_you_mean

Array = np.ndarray
# Prior sd over |value| of a coefficient for which the vehicle file states none, where a prior is needed.
DEFAULT_RELATIVE_SD = 0.1
# Least variance of a combination of parameters over theirs: what is known exactly is known to a millionth.
EXACTLY = 1e-12
SEE_COEFFICIENTS = "; see `bayesid vehicle show` for its coefficients"
START_SD = 0.2  # prior standard deviations from its end at which a one-sided effect starts
WIDE = 5.0  # half width of the default bounds in prior standard deviations, or in sizes of the coefficient
NO_LIMIT = (-math.inf, math.inf)


def coefficient_set(
    model: Model,
    free: Iterable[str] | None = None,
    *,
    relative_bounds: float | None = None,
    use_prior: bool = True,
    ties: Mapping[str, tuple[str, float, float]] | None = None,
) -> ParameterSet:
    """Coefficients as unknowns, starting at the vehicle's values.

    Parameters
    ----------
    free : names; by default every coefficient of the file this model reads
    relative_bounds : half width of the bounds over |value|; by default 5 prior sd or 5 |value|, whichever is
        more
    use_prior : normal prior from the vehicle file where it states one
    ties : name -> (free name, factor, offset)

    Raises
    ------
    FitError
        a name the model does not have
    """
    names = tuple(free) if free is not None else model.coefficients
    unknown = [n for n in names if n not in model.index]
    if unknown:
        hint = did_you_mean(unknown, model.coefficients) or SEE_COEFFICIENTS
        raise FitError(
            f"model of {model.vehicle.name!r} ({model.dof}-DOF) has no parameter "
            f"{', '.join(unknown)}{hint}{' (a shell wants quotes around the bars)' if '|' in hint else ''}"
        )
    if mixed := [n for n in names if n not in model.coefficients and f"{n},U" in model.coefficients]:
        own = ", ".join(f"{n},U" for n in mixed)
        raise FitError(
            f"{model.vehicle.name} has {own}, by the equations of ships; {', '.join(mixed)} would be the "
            "same force once more"
        )
    entries = []
    for name in names:
        value = float(model.nominal[model.index[name]])
        sd = model.prior_sd(name)
        scale = abs(value) or unit_size(model, name)
        half = (
            relative_bounds * scale if relative_bounds else WIDE * max(scale, 0.0 if math.isnan(sd) else sd)
        )
        prior = Prior("normal", value, sd) if use_prior and sd > 0 and math.isfinite(sd) else None
        entries.append(
            Parameter(
                name,
                value,
                "free",
                value - half,
                min(value + half, model.coefficient_limits.get(model.index[name], NO_LIMIT)[1]),
                scale,
                prior,
                file_scale=model.file_scale(name),
            )
        )
    for name, tie in (ties or {}).items():
        start = tie[2] + tie[1] * float(model.nominal[model.positions([tie[0]])[0]])
        entries.append(Parameter(name, start, "tied", tie=tie, file_scale=model.file_scale(name)))
    joint = joint_prior(model, names) if use_prior else None
    if joint is not None:
        entries = [Parameter(**{**vars(p), "prior": None}) if p.name in joint.names else p for p in entries]
    return ParameterSet(tuple(entries), joint)


def unit_size(model: Model, name: str) -> float:
    """Scale of a parameter that is zero: its prior sd, else 1e-3 of the prime unit at the reference speed."""
    sd = model.prior_sd(name)
    if sd > 0:
        return float(sd)
    if name in {t.name for t in TERMS}:
        row = term(name)
        s = model.scales
        return 1e-3 * 0.5 * s["rho"] * s["L"] ** row.length_power * s["U"] ** (2 - row.velocity_power)
    return 1.0


def joint_prior(model: Model, names: Sequence[str]) -> JointPrior | None:
    """What the vehicle file knows of some coefficients together; None where it knows none of them so."""
    prior = model.vehicle.prior
    if prior is None or prior.covariance is None:
        return None
    kept = [i for i, n in enumerate(prior.names) if n in names]
    if not kept:
        return None
    picked = tuple(prior.names[i] for i in kept)
    scale = np.array([model.file_scale(n) for n in picked])
    covariance = prior.covariance[np.ix_(kept, kept)] * np.outer(scale, scale)
    return JointPrior(picked, model.nominal[model.positions(picked)], covariance)


def effect_set(model: Model, effect: Effect) -> ParameterSet:
    """Parameters of one effect as unknowns with the prior its declaration states.

    One that the vehicle file has on starts there, known as well as the file says.
    """
    entries = []
    for p in effect.parameters:
        key = effect.key(p.name)
        sd, mean = model.prior_sd(key), model.vehicle.effects.get(key, p.mean)
        low = p.off if p.one_sided else -math.inf
        entries.append(Parameter(key, mean, low=low, scale=sd, prior=Prior("normal", mean, sd)))
    return ParameterSet(tuple(entries))


def with_effects(model: Model, params: ParameterSet, names: Iterable[str]) -> ParameterSet:
    """The set with parameters of effects beside it, in the range in which they are those of the effect.

    Parameters
    ----------
    names : effects ("wind"), or single parameters of theirs ("wind.blowing_north")

    Raises
    ------
    FitError
        a name the model does not have, with the nearest ones it has
    """
    chosen: dict[str, Parameter] = {}
    for name in names:
        effect = model.effects.get(name.partition(".")[0])
        found = () if effect is None else effect_set(model, effect).entries
        found = tuple(p for p in found if name in (p.name, p.name.partition(".")[0]))
        if not found:
            near = difflib.get_close_matches(name, model.effects, n=3, cutoff=0.5)
            raise FitError(
                f"no effect {name!r} in {model.dof}-DOF"
                + (f"; did you mean {', '.join(near)}?" if near else "; `bayesid effect list` names them")
            )
        chosen |= {p.name: _inside(model, p) for p in found}
    there = set(params.names)
    return replace(params, entries=(*params.entries, *(p for n, p in chosen.items() if n not in there)))


def _inside(model: Model, p: Parameter) -> Parameter:
    """Bounds of the declaration; an amplitude with one side starts off its end, where it may lack a slope."""
    low, high = model.effect_limits[model.index[p.name]]
    start = p.start if p.start > low else low + START_SD * p.scale
    return replace(p, start=min(start, 0.5 * (low + high)) if high < math.inf else start, low=low, high=high)


@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """Free parameters of a set with normal priors, as arrays.

    Attributes
    ----------
    names : (k,) free parameters
    where : (k,) their positions in the model's parameter vector
    mean, sd : (k,) of the prior [SI]
    low, high : (k,) bounds [SI], infinite for none; none above where `high` is not given
    together : (k, k) precision of what is known of them together beyond that of each alone, in units of their
        deviations; None where they are independent
    """

    names: tuple[str, ...]
    where: Array
    mean: Array
    sd: Array
    low: Array
    high: Array = None  # type: ignore[assignment]
    together: Array | None = None

    def __post_init__(self) -> None:
        if self.high is None:
            object.__setattr__(self, "high", np.full(len(self.low), np.inf))

    @property
    def standard_bounds(self) -> tuple[Array, Array]:
        """(k,) bounds in prior standard deviations from the mean, twice."""
        return (self.low - self.mean) / self.sd, (self.high - self.mean) / self.sd

    def __add__(self, other: GaussianPrior) -> GaussianPrior:
        return GaussianPrior(
            (*self.names, *other.names),
            np.concatenate([self.where, other.where]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.sd, other.sd]),
            np.concatenate([self.low, other.low]),
            np.concatenate([self.high, other.high]),
            self._together(other),
        )

    def _together(self, other: GaussianPrior) -> Array | None:
        if self.together is None and other.together is None:
            return None
        k = len(self.names)
        out = np.zeros((k + len(other.names), k + len(other.names)))
        for one, at in ((self.together, slice(0, k)), (other.together, slice(k, None))):
            if one is not None:
                out[at, at] = one
        return out


NO_PARAMETERS = GaussianPrior((), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def known_together(params: ParameterSet) -> Array | None:
    """(k, k) `GaussianPrior.together` of the free parameters of a set; None where it has no joint prior."""
    joint = params.joint
    if joint is None:
        return None
    at = np.array([params.names.index(n) for n in joint.names])
    sd = np.sqrt(np.diag(joint.covariance))
    sd = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(joint.covariance / np.outer(sd, sd))
    precision = (vectors / np.maximum(values, EXACTLY)) @ vectors.T
    out = np.zeros((len(params.names), len(params.names)))
    out[np.ix_(at, at)] = precision - np.eye(at.size)
    return out


def gaussian_prior(model: Model, params: ParameterSet) -> GaussianPrior:
    """Free parameters of a set with their normal priors; `DEFAULT_RELATIVE_SD` where one states none.

    Bounds count where an effect may not change its sign and where a coefficient has a physical limit; of a
    joint prior the standard deviations count.
    A parameter that is zero and has no prior is left out.
    """
    known = (
        {}
        if params.joint is None
        else dict(zip(params.joint.names, np.sqrt(np.diag(params.joint.covariance)), strict=True))
    )
    kept = []
    for p in params.free:
        sd = known.get(p.name, p.prior.spread if p.prior else math.nan)
        sd = sd if math.isfinite(sd) and sd > 0 else DEFAULT_RELATIVE_SD * abs(p.start)
        if sd > 0:
            limits = model.coefficient_limits.get(model.index[p.name], NO_LIMIT)
            limits = (p.low, math.inf) if "." in p.name else limits
            kept.append((p.name, p.prior.centre if p.prior else p.start, sd, *limits))
    names = tuple(name for name, *_ in kept)
    mean, sd, low, high = np.array([values for _, *values in kept], dtype=float).reshape(-1, 4).T
    return GaussianPrior(names, model.positions(names), mean, sd, low, high)


def coefficient_prior(model: Model) -> GaussianPrior:
    """All coefficients of the vehicle within the prior of its file."""
    return gaussian_prior(model, coefficient_set(model))


def effect_prior(model: Model, effect: Effect) -> GaussianPrior:
    """Parameters of one effect within its declared prior."""
    return gaussian_prior(model, effect_set(model, effect))
