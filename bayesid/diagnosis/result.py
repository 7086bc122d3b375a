"""The result of a diagnosis: final values, made once. `diagnosis.json`, terminal and report are views of it.

The fields of `Result` are the keys of the format (1), in order; `schema.json` describes them. Takes the parts
of a diagnosis. Does not decide, fit or write.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.evidence.effect_posterior import EffectPosterior
from bayesid.diagnosis.evidence.effect_posterior import as_json as sampled
from bayesid.diagnosis.evidence.holdout import HoldoutValidation, HorizonError, MeasureComparison
from bayesid.diagnosis.evidence.missing_force import MissingForce
from bayesid.diagnosis.evidence.missing_force import as_json as described
from bayesid.diagnosis.hypotheses.candidate import COEFFICIENT_ERROR, RefittedHypothesis, parameter_table
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.facts import simplest, unseen
from bayesid.diagnosis.hypotheses.location import location_of
from bayesid.diagnosis.hypotheses.verdict import Verdict
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.equations.model import Model
from bayesid.trials import Trial

FORMAT = 1
MODELS = ("nominal", "recalibrated", "with effect")
MOST_MASKS = 5
ByChannel = Mapping[str, Mapping[str, float | None]]


@dataclass(frozen=True)
class Diagnosed:
    """What was diagnosed."""

    name: str
    digest: str
    dof: int
    channels: tuple[str, ...]


@dataclass(frozen=True)
class Value:
    """Estimate and standard deviation."""

    value: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Effect:
    """One effect the verdict stands on, its probability of acting and its sizes."""

    name: str
    probability: float
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class Detectability:
    """Trace of an effect on these runs and the share of it that coefficients absorb."""

    noncentrality_at_one_prior_sd: float
    absorbed: float


@dataclass(frozen=True)
class Region:
    """A stretch of time, run or regime, and what a free signal only there gains [nats]."""

    name: str
    evidence: float


@dataclass(frozen=True)
class Location:
    """Where the gap lies; evidence in nats, period in s."""

    channel: str | None
    evidence: Mapping[str, float]
    period: float | None
    windows: tuple[Region, ...]
    regimes: tuple[Region, ...]
    after: Mapping[str, float]


@dataclass(frozen=True)
class Horizon:
    """Held-out errors over one horizon; None where there is nothing to compare."""

    horizon: str
    seconds: float | None
    excess: Mapping[str, float]
    shrink: float | None
    interval: tuple[float | None, ...]
    worth_shrinking: bool
    floor: float
    rms: ByChannel
    pieces: int
    posterior_draws: int
    channels: ByChannel


@dataclass(frozen=True)
class Gap:
    """The longest horizon that shows a gap, and all of them."""

    before_nominal: float | None
    before: float | None
    after: float | None
    floor: float | None
    shrink: float | None
    interval: tuple[float | None, ...] | None
    horizons: tuple[Horizon, ...]


@dataclass(frozen=True)
class Noise:
    """Noise of the motion the diagnosis allowed for; units as in the format."""

    source: str
    force: tuple[float, ...]
    force_tau: float
    drift: float
    drift_tau: float
    depth: float | None
    arms: tuple[float, ...]


@dataclass(frozen=True)
class Coefficient:
    """Estimate and standard deviation in the units of the vehicle file."""

    value: float
    sd: float


@dataclass(frozen=True)
class Result:
    """Everything a diagnosis says, as final plain values. Keys and meanings: `schema.json`."""

    format: int
    bayesid: str
    trial: Diagnosed
    model: str
    seed: int
    verdict: str
    effects: tuple[Effect, ...]
    probabilities: Mapping[str, float]
    acting: Mapping[str, float]
    set95: tuple[str, ...]
    unseen: tuple[str, ...]
    hidden_by_coefficients: tuple[str, ...]
    reasons: tuple[str, ...]
    rule: str
    ambiguity_groups: tuple[tuple[str, ...], ...]
    detectability: Mapping[str, Detectability]
    where: Location
    gap: Gap
    measures: tuple[Mapping[str, Any], ...]
    events: tuple[Event, ...]
    posterior: Mapping[str, Any] | None
    description: Mapping[str, Any] | None
    environment: Noise
    coefficients: Mapping[str, Coefficient]
    next_manoeuvre: tuple[Proposal, ...]
    warnings: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        """Plain data of `diagnosis.json`."""
        return {key: _plain(value) for key, value in asdict(self).items()}


def result_of(
    trial: Trial,
    model: Model,
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    verdict: Verdict,
    shrink: HoldoutValidation,
    proposals: tuple[Proposal, ...],
    warnings: tuple[str, ...],
    seed: int,
    description: MissingForce | None = None,
    posterior: EffectPosterior | None = None,
) -> Result:
    """Final values of a diagnosis."""
    from bayesid import __version__

    c, best = candidates, simplest(candidates)
    every = ["none", *(e.name for e in model.kernel.effects), COEFFICIENT_ERROR, "outside"]
    told = c.ambiguity
    return Result(
        format=FORMAT,
        bayesid=__version__,
        trial=Diagnosed(trial.name, trial.digest, model.dof, tuple(problem.channels)),
        model=model.digest,
        seed=seed,
        verdict=verdict.word,
        effects=_effects(model, problem, c, verdict, best),
        probabilities={n: float(c.probabilities.get(n, 0.0)) for n in every},
        acting={n: float(min(c.inside.get(n, 0.0), 1.0)) for n in every},
        set95=verdict.set95,
        unseen=unseen(c),
        hidden_by_coefficients=verdict.hidden,
        reasons=verdict.reasons,
        rule=verdict.rule,
        ambiguity_groups=tuple(tuple(g) for g in told.groups),
        detectability={
            n: Detectability(float(x), float(a))
            for n, x, a in zip(told.names, told.detect, told.absorbed, strict=True)
        },
        where=_location(c, model),
        gap=_gap(shrink.horizons),
        measures=tuple(_measure(m) for m in shrink.measures),
        events=problem.events,
        posterior=sampled(posterior) if posterior is not None else None,
        description=described(description) if description is not None else None,
        environment=_noise(problem),
        coefficients={
            n: Coefficient(float(x / model.file_scale(n)), float(s / abs(model.file_scale(n))))
            for n, x, s in zip(problem.coefficients.names, best.fit.values, best.fit.sd, strict=False)
        },
        next_manoeuvre=proposals,
        warnings=warnings,
    )


def _effects(
    model: Model,
    problem: DiagnosisProblem,
    c: HypothesisComparison,
    verdict: Verdict,
    best: RefittedHypothesis,
) -> tuple[Effect, ...]:
    """What the verdict stands on, or what is more probable than not where it names nothing."""
    table = parameter_table(best.fit, problem)
    named = verdict.effects
    if not named and verdict.word in ("ambiguous", "coefficients"):
        named = tuple(n for n in best.effects if n in model.effects and c.inside.get(n, 0.0) > 0.5)
    out = []
    for name in named:
        effect = model.effects.get(name)
        keys = {p.name: (effect.key(p.name), p.unit) for p in effect.parameters} if effect is not None else {}
        values = {p: Value(*table[key], unit) for p, (key, unit) in keys.items() if key in table}
        out.append(Effect(name, float(min(1.0, c.inside.get(name, 0.0))), _contract(name, values)))
    return tuple(out)


def _contract(name: str, values: dict[str, Value]) -> dict[str, Value]:
    """Parameters under the names of the contract: wind as speed and direction."""
    if name != "wind" or "blowing_north" not in values:
        return values
    n, e = values["blowing_north"], values["blowing_east"]
    speed = float(np.hypot(n.value, e.value))
    spread = float(np.hypot(n.sd, e.sd) / np.sqrt(2))
    came = float((np.arctan2(e.value, n.value) + np.pi) % (2 * np.pi))
    return {
        "V_wind": Value(speed, spread, "m/s"),
        "from": Value(came, min(spread / max(speed, 1e-9), np.pi), "rad"),
        "area_coefficients": values["area_coefficients"],
    }


def _location(c: HypothesisComparison, model: Model) -> Location:
    def masks(regime: bool) -> tuple[Region, ...]:
        kept = [m for m in c.where.masks if (m.kind == "regime") == regime]
        return tuple(Region(m.name, float(m.evidence)) for m in kept[:MOST_MASKS])

    return Location(
        location_of(c, model),
        {p.channel: float(p.evidence) for p in c.where.places},
        c.where.places[0].period,
        masks(False),
        masks(True),
        {p.channel: float(p.evidence) for p in c.where_after.places} if c.where_after else {},
    )


def _gap(errors: tuple[HorizonError, ...]) -> Gap:
    horizons = tuple(
        Horizon(
            r.horizon,
            _number(r.seconds),
            r.excess,
            _number(r.shrink),
            tuple(_number(x) for x in r.interval),
            r.worth,
            r.floor,
            _numbers(r.rms),
            r.pieces,
            r.draws,
            _numbers(r.channels),
        )
        for r in errors
    )
    worth = [h for h in horizons if h.worth_shrinking]
    if not horizons:
        return Gap(None, None, None, None, None, None, ())
    full = worth[-1] if worth else horizons[-1]
    nominal, before, after = (full.excess[m] for m in MODELS)
    return Gap(nominal, before, after, full.floor, full.shrink, full.interval, horizons)


def _measure(m: MeasureComparison) -> dict[str, Any]:
    known = {"run": m.run, "name": m.name, "unit": m.unit, "logged": m.logged}
    return known | {k: _number(m.models.get(k, float("nan"))) for k in MODELS}


def _noise(problem: DiagnosisProblem) -> Noise:
    e, c = problem.environment, problem.environment.noise_model
    return Noise(e.source, tuple(c.force), c.force_tau, c.drift, c.drift_tau, c.depth, tuple(c.arms))


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _numbers(table: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
    """Model -> channel -> number; None for a channel no held-out run reads."""
    return {k: {c: _number(x) for c, x in row.items()} for k, row in table.items()}


def _plain(value: Any) -> Any:
    """Lists for tuples, plain dicts for mappings."""
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value
