"""Final values of a diagnosis: the one place where its parts become the frozen `Result`.

Takes the parts of a diagnosis while they are in memory, and has every run replayed with the models found.
Does not decide or write.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from bayesid.diagnosis.attempt import attempt
from bayesid.diagnosis.data.model_form import pushes_ahead, resonates
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.effects_found import effects_found, in_place_of
from bayesid.diagnosis.evidence.effect_posterior import EffectPosterior, numbers
from bayesid.diagnosis.evidence.explained_model import ExplainedModel
from bayesid.diagnosis.evidence.holdout import HoldoutValidation
from bayesid.diagnosis.evidence.holdout_prediction import MeasureComparison
from bayesid.diagnosis.evidence.missing_force import MissingForce
from bayesid.diagnosis.evidence.replay import EXPLAINED, GIVEN, RETUNED, Replay, replay_trial
from bayesid.diagnosis.hypotheses.candidate import (
    COEFFICIENT_ERROR,
    RefittedHypothesis,
    jackknife,
    parameter_table,
)
from bayesid.diagnosis.hypotheses.comparison import HypothesisComparison
from bayesid.diagnosis.hypotheses.cross_validation import agreement
from bayesid.diagnosis.hypotheses.facts import like_a_form, simplest, undetectable
from bayesid.diagnosis.hypotheses.location import location_of
from bayesid.diagnosis.hypotheses.probabilities import several_act
from bayesid.diagnosis.hypotheses.rules import MOTION_EVENT
from bayesid.diagnosis.hypotheses.verdict import Verdict
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.result import FORMAT, Result
from bayesid.diagnosis.result_parts import (
    Coefficient,
    Corner,
    Detectability,
    Diagnosed,
    Drawings,
    Estimate,
    Force,
    FormRow,
    Gap,
    Horizon,
    Location,
    ModelFormPart,
    Moved,
    Noise,
    Outlier,
    Refit,
    Region,
    Retuning,
    RunError,
    Screened,
    SimulatorMistakeFound,
    StretchFound,
)
from bayesid.diagnosis.run_sizes import run_sizes
from bayesid.equations.model import Model
from bayesid.estimation.likelihood.model_form import typical
from bayesid.model.terms import term
from bayesid.model.vehicles.orders import steers
from bayesid.trials import Trial
from bayesid.trials.measured_wind import apart_from_measured_wind

MODELS = ("nominal", "recalibrated", "with effect")
MOST_MASKS = 5
MODEL_FORM = "model_form"
# Standard deviations from which a row of a model form is listed, and how many are.
CLEAR, MOST_ROWS = 2.0, 8
# Noncentrality from which runs show an effect; runs of the force, panels and draws a reader can make out.
SHOWN, MOST_RUNS, MOST_PANELS, LAPLACE_DRAWS = 10.0, 4, 7, 4000


def result_of(
    trial: Trial,
    model: Model,
    problem: DiagnosisProblem,
    candidates: HypothesisComparison,
    verdict: Verdict,
    explained: ExplainedModel,
    holdout: HoldoutValidation,
    proposals: tuple[Proposal, ...] | None,
    warnings: tuple[str, ...],
    seed: int,
    description: MissingForce | None = None,
    posterior: EffectPosterior | None = None,
    simulator: tuple[SimulatorMistakeFound, ...] = (),
) -> Result:
    """Final values of a diagnosis."""
    from bayesid import __version__

    c, best = candidates, simplest(candidates)
    every = ["none", *(e.name for e in model.causes), COEFFICIENT_ERROR, "outside"]
    probability = {n: float(c.probabilities.get(n, 0.0)) for n in every}
    acting = {n: float(min(c.inside.get(n, 0.0), 1.0)) for n in every}
    if problem.form is not None or verdict.word == MODEL_FORM:
        # no effect beside a form that the runs need is not "nothing"
        probability |= {"none": 0.0, MODEL_FORM: probability["none"]}
        acting |= {"none": 0.0, MODEL_FORM: 1.0}  # every hypothesis has it
    like = () if best.widens else like_a_form(c, best, problem.model)
    apart = c.ambiguity
    gains = best.log_evidence > c.none.log_evidence
    drawn = numbers(posterior) if posterior is not None else None
    told, nothing = list(warnings), tuple[Replay, ...]()
    replays = attempt(
        "the runs could not be replayed for the picture",
        lambda: replay_trial(
            problem,
            trial,
            {GIVEN: None, RETUNED: c.none.fit, EXPLAINED: explained.fit},
            seed,
            [e.run for e in problem.events if e.unexplained] if verdict.rule == MOTION_EVENT else (),
        ),
        nothing,
        told,
    )
    return Result(
        format=FORMAT,
        bayesid=__version__,
        trial=Diagnosed(
            trial.name,
            trial.digest,
            model.dof,
            tuple(problem.channels),
            model.vehicle.name,
            apart_from_measured_wind(model.vehicle).digest,
            trial.attribution,
            steers(model.vehicle),
        ),
        model=model.digest,
        seed=seed,
        verdict=verdict.word,
        effects=effects_found(model, problem, c, verdict, best, drawn),
        probabilities=probability,
        acting=acting,
        together=float(min(several_act(c.sets, like), 1.0)),
        set95=verdict.set95,
        unseen=undetectable(c),
        hidden_by_coefficients=verdict.confounded,
        reasons=verdict.reasons,
        rule=verdict.rule,
        unnamed=dict(verdict.unnamed),
        in_place_of=in_place_of(model, c, verdict, acting),
        thresholds=c.thresholds,
        screen=tuple(Screened(s.name, float(s.gain)) for s in c.scores),
        refits=tuple(_refit(problem, c.none, r) for r in (c.none, *c.refits)),
        explanation=best.effects if gains else (),
        ambiguity_groups=tuple(tuple(g) for g in apart.groups),
        ambiguity_size=apart.size,
        detectability={
            n: Detectability(float(x), float(a))
            for n, x, a in zip(apart.names, apart.detect, apart.absorbed, strict=True)
        },
        where=_location(c, model),
        gap=gap_of(holdout),
        measures=tuple(_measure(m) for m in holdout.measures),
        events=problem.events,
        outliers=tuple(Outlier(*o) for o in problem.outliers),
        posterior=drawn,
        description=description,
        environment=_noise(problem),
        coefficients={
            n: Coefficient(float(x / model.file_scale(n)), float(s / abs(model.file_scale(n))))
            for n, x, s in zip(
                problem.stated.names,
                explained.fit.par[problem.stated.where],
                explained.fit.sd if explained.retuned else problem.stated.sd,
                strict=False,
            )
        },
        retuning=Retuning(
            explained.retuned,
            _number(explained.gain),
            _number(explained.error),
            _sizes(model, explained),
            explained.as_given,
            _number(explained.given_gain),
            _number(explained.given_error),
            explained.coefficients_alone,
            _number(explained.alone_gain),
            _number(explained.alone_error),
        ),
        model_form=_form(problem, c, best),
        next_manoeuvre=proposals or (),
        next_asked=proposals is not None,
        warnings=tuple(told),
        runs=tuple(_run_error(r) for r in replays),
        moved=_moved(model, problem, c.none, best, explained),
        runs_agree=agreement(best, len(problem.coefficients.names)) if gains and not best.widens else None,
        run_sizes=run_sizes(problem, best) if gains and not best.widens else {},
        simulator=simulator,
        drawings=_drawings(model, c, posterior, seed, replays),
    )


def _run_error(r: Replay) -> RunError:
    return RunError(
        r.run,
        r.manoeuvre,
        r.role,
        float(r.t[-1] - r.t[0]),
        r.lead,
        {m: _number(r.position_error(m)) for m in r.models},
        _numbers(r.rms),
        {c: _number(v) for c, v in r.expected.items()},
    )


def _sizes(model: Model, explained: ExplainedModel) -> dict[str, float]:
    """Parameters of the effects in the model that stands for the explanation."""
    keys = [
        model.effects[n].key(p.name)
        for n in explained.effects
        if n in model.effects
        for p in model.effects[n].parameters
    ]
    return {k: float(explained.fit.par[model.index[k]]) for k in keys}


def _moved(
    model: Model,
    problem: DiagnosisProblem,
    none: RefittedHypothesis,
    best: RefittedHypothesis,
    explained: ExplainedModel,
) -> dict[str, Moved]:
    """Coefficients of the vehicle file as given, re-tuned and explained, in its units."""
    stated, out = problem.stated, {}
    other = best.effects and best.fit is not explained.fit
    known = dict(zip(explained.fit.free.names, explained.fit.sd, strict=True))
    widened = np.sqrt(np.maximum(problem.coefficients.sd[: len(stated.names)] ** 2 - stated.sd**2, 0.0))
    for i, name in enumerate(stated.names):
        scale = model.file_scale(name)
        out[name] = Moved(
            float(stated.mean[i] / scale),
            float(stated.sd[i] / abs(scale)),
            float(none.fit.values[i] / scale),
            float(explained.fit.par[stated.where[i]] / scale),
            _number(none.fit.sd[i] / abs(scale)),
            _number(known[name] / abs(scale)) if name in known else None,
            name in model.vehicle.completed,
            float(best.fit.values[i] / scale) if other else None,
            _number(best.fit.sd[i] / abs(scale)) if other else None,
            float(widened[i] / abs(scale)),
        )
    return out


def _refit(problem: DiagnosisProblem, none: RefittedHypothesis, refit: RefittedHypothesis) -> Refit:
    found = parameter_table(refit.fit, problem)
    return Refit(
        refit.effects,
        float(refit.log_evidence - none.log_evidence),
        float(refit.fit.chi2),
        bool(refit.fit.converged),
        {n: Estimate(value, sd) for n, (value, sd) in found.items()},
    )


def _form(
    problem: DiagnosisProblem, c: HypothesisComparison, best: RefittedHypothesis
) -> ModelFormPart | None:
    """What the model form carries beside the best explanation, and its largest rows.

    Without one, what of several effects may stand for one, where there is such.
    """
    form, model = problem.form, problem.model
    own = like_a_form(c, best, model)
    if form is None:
        gain = max(best.log_evidence - c.none.log_evidence, 0.0)
        return ModelFormPart(gain, {}, None, own, ()) if own else None
    first, last = len(problem.stated.names), len(problem.coefficients.names)
    sd = np.maximum(best.fit.sd, jackknife(best.fit))[first:last]
    values = best.fit.values[first:last]
    rows, like, power = [], [], None
    for name, value, spread in zip(problem.coefficients.names[first:last], values, sd, strict=True):
        effect, _, parameter = name.partition(".")
        if not parameter:
            unit = typical(model, name)
            rows.append(FormRow(name, term(name).axis, float(value / unit), float(spread / abs(unit))))
        elif resonates(model.effects[effect]):
            continue  # the period says it
        elif pushes_ahead(model.effects[effect]):
            if abs(value) > CLEAR * spread > 0.0:
                power = Estimate(2.0 + float(value), float(spread))
        elif (
            model.effect_off[model.index[name]] == 0.0
            and abs(value - model.nominal[model.index[name]]) > CLEAR * spread
        ):
            like.append(effect)
    rows.sort(key=lambda r: -abs(r.force) / r.sd)
    return ModelFormPart(
        float(c.carried_beside if best.effects else c.carried),
        {a: float(s) for a, s in form.sizes.items() if s},
        form.period,
        tuple(dict.fromkeys((*like, *own))),
        tuple(r for r in rows if abs(r.force) > CLEAR * r.sd)[:MOST_ROWS],
        power,
    )


def _location(c: HypothesisComparison, model: Model) -> Location:
    def masks(regime: bool) -> tuple[Region, ...]:
        kept = [m for m in c.where.masks if (m.kind == "regime") == regime]
        return tuple(Region(m.name, float(m.evidence), m.kind, float(m.share)) for m in kept[:MOST_MASKS])

    return Location(
        location_of(c, model),
        {p.channel: float(p.evidence) for p in c.where.places},
        c.where.places[0].period,
        masks(False),
        masks(True),
        {p.channel: float(p.evidence) for p in c.where_after.places} if c.where_after else {},
        None if c.where.stretch is None else StretchFound(**asdict(c.where.stretch)),
    )


def gap_of(holdout: HoldoutValidation) -> Gap:
    """Errors of all horizons; the headline is the longest that shows a gap."""
    horizons = tuple(
        Horizon(
            r.horizon,
            _number(r.seconds),
            r.excess,
            _number(r.shrink),
            tuple(_number(x) for x in r.interval),
            r.significant,
            r.floor,
            _numbers(r.rms),
            r.pieces,
            r.draws,
            _numbers(r.channels),
            _number(r.expected),
        )
        for r in holdout.horizons
    )
    significant = [h for h in horizons if h.worth_shrinking]
    if not horizons:
        return Gap(None, None, None, None, None, None, (), holdout.runs)
    full = significant[-1] if significant else horizons[-1]
    nominal, before, after = (full.excess[m] for m in MODELS)
    return Gap(nominal, before, after, full.floor, full.shrink, full.interval, horizons, holdout.runs)


def _measure(m: MeasureComparison) -> dict[str, str | float | None]:
    known: dict[str, str | float | None] = {
        "run": m.run,
        "name": m.name,
        "unit": m.unit,
        "logged": _number(m.logged),
    }
    return known | {k: _number(m.models.get(k, float("nan"))) for k in MODELS}


def _noise(problem: DiagnosisProblem) -> Noise:
    e, c = problem.environment, problem.environment.noise_model
    return Noise(e.source, tuple(c.force), c.force_tau, c.drift, c.drift_tau, c.depth, tuple(c.arms), e.again)


def _drawings(
    model: Model,
    c: HypothesisComparison,
    posterior: EffectPosterior | None,
    seed: int,
    replays: tuple[Replay, ...],
) -> Drawings:
    apart, where = c.ambiguity, c.where
    shown = np.flatnonzero(apart.size**2 * apart.detect >= SHOWN)
    force = None
    if where.masks:
        axes = tuple(n[-1] for n in model.kernel.exogenous if n.startswith("force_"))
        first = slice(MOST_RUNS)
        force = Force(axes, where.runs[first], where.times[first], where.force[first], where.band[first])
    return Drawings(
        force,
        tuple(apart.names[i] for i in shown),
        apart.margin[np.ix_(shown, shown)],
        _corner(model, posterior, seed) if posterior is not None else None,
        replays,
    )


def _corner(model: Model, p: EffectPosterior, seed: int) -> Corner:
    """Draws beside Laplace's, coefficients over their nominal value."""
    k = min(p.density.count, MOST_PANELS)
    rng = np.random.default_rng(seed)
    gauss = p.density.natural(p.laplace.draw(LAPLACE_DRAWS, 1.0, np.random.RandomState(rng.integers(2**31))))[
        :, :k
    ]
    scale, names = np.ones(k), []
    for i, n in enumerate(p.posterior.names[:k]):
        nominal = model.nominal[model.index[n]]
        if "." not in n and nominal:
            scale[i] = nominal
            names.append(f"{n} / nominal")
        else:
            unit = _unit(model, n)
            scale[i] = math.pi / 180 if unit == "deg" else 1.0
            names.append(n.split(".")[-1].replace("_", " ") + (f" [{unit}]" if unit else ""))
    return Corner(tuple(names), p.posterior.flat[:, :k] / scale, gauss / scale)


def _unit(model: Model, name: str) -> str:
    """Unit an effect's parameter is shown in; empty for a plain number."""
    effect, _, parameter = name.partition(".")
    declared = model.effects.get(effect)
    units = {q.name: q.unit for q in declared.parameters} if declared is not None else {}
    unit = units.get(parameter, "")
    return {"rad": "deg", "-": ""}.get(unit, unit)


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _numbers(table: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float | None]]:
    """Model -> channel -> number; None for a channel no held-out run reads."""
    return {k: {c: _number(x) for c, x in row.items()} for k, row in table.items()}
