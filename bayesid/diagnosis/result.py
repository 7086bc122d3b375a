"""The result of a diagnosis: final values, made once; `diagnosis.json`, terminal and report are views of it.

The fields of `Result` are the keys of the format (1), in order; the schema is generated from their types and
from what is said of them here. Arrays that only figures need are in `Drawings`, which is not written. Does
not decide, fit or write (`final_values` makes it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence.effect_draws import EffectDraws
from bayesid.diagnosis.evidence.missing_force import MissingForce
from bayesid.diagnosis.evidence.replay import Replay
from bayesid.diagnosis.hypotheses.rules import Word
from bayesid.diagnosis.hypotheses.thresholds import Thresholds
from bayesid.diagnosis.next_manoeuvre import Proposal
from bayesid.diagnosis.schema import About, described, plain

FORMAT = 1
# Keys every file of format 1 has, also one of an earlier version.
CONTRACT = (
    "format", "verdict", "effects", "probabilities", "set95", "ambiguity_groups", "where", "gap",
    "next_manoeuvre", "warnings",
)  # fmt: skip
Array = np.ndarray
Share = Annotated[float, About(checks={"minimum": 0, "maximum": 1})]
ByChannel = Mapping[str, Mapping[str, float | None]]


@dataclass(frozen=True)
class Diagnosed:
    """What was diagnosed."""

    name: str
    digest: str
    dof: int
    channels: tuple[str, ...]
    vehicle: str = ""
    vehicle_digest: str = ""
    attribution: str = ""


@dataclass(frozen=True)
class Value:
    """Estimate and standard deviation (Laplace); the 95 % interval of the draws where that is to be used."""

    value: float
    sd: float
    unit: str
    low95: Annotated[
        float | None,
        About("Use low95 to high95, of the draws, where they are there; else value +- 1.96 sd."),
    ] = None
    high95: float | None = None


@dataclass(frozen=True)
class Effect:
    """One effect the verdict stands on, its probability of acting and its sizes."""

    name: str
    probability: Annotated[float, About("That it acts, alone or with others.", {"minimum": 0, "maximum": 1})]
    parameters: Mapping[str, Value]
    meaning: Annotated[Mapping[str, str], About("Parameter -> what it stands for.")] = field(
        default_factory=dict
    )
    usual_size: Annotated[str, About("How large it usually is, in words; empty if not stated.")] = ""
    says: Annotated[
        str, About("The effect as a sentence with places for sizes, `{parameter:unit}`; empty if not stated.")
    ] = ""
    instead: Annotated[
        Mapping[str, float], About("Constants of the vehicle file that it changes, as given there [SI].")
    ] = field(default_factory=dict)


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
    kind: Annotated[str, About("manoeuvre, window or regime")] = ""
    share: Annotated[float, About("Share of the samples.")] = 0.0


@dataclass(frozen=True)
class Location:
    """Where the gap lies; evidence in nats, period in s."""

    channel: Annotated[
        str | None,
        About(
            "Most probable place, every hypothesis counted by its probability; need not be the place of most "
            "evidence below. null where no free signal gains more than chance."
        ),
    ]
    evidence: Annotated[
        Mapping[str, float],
        About(
            "Gain in log evidence [nats] of a free signal let into each place alone, no effect in the model; "
            "most first."
        ),
    ]
    period: Annotated[
        float | None, About("Seconds, where the free signal of most evidence is periodic; else null.")
    ]
    windows: Annotated[
        tuple[Region, ...],
        About(
            "The same for the place of most evidence, the signal allowed only in one run or stretch of time."
        ),
    ]
    regimes: Annotated[tuple[Region, ...], About("The same, allowed only in one regime of motion.")]
    after: Annotated[Mapping[str, float], About("As evidence, with the best explanation in the model.")] = (
        field(default_factory=dict)
    )


@dataclass(frozen=True)
class Screened:
    """Gain in log evidence of one effect of the catalogue along one path, coefficients free [nats]."""

    name: str
    gain: float


@dataclass(frozen=True)
class Estimate:
    """Estimate and standard deviation, SI."""

    value: float
    sd: float


@dataclass(frozen=True)
class Refit:
    """One hypothesis refitted: gain in log evidence over no effect [nats], fit and parameters."""

    effects: tuple[str, ...]
    gain: float
    chi2: Annotated[float, About("Mean squared residual in noise variances.")]
    converged: bool
    parameters: Mapping[str, Estimate]


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

    before_nominal: Annotated[
        float | None,
        About(
            "Mean squared error on held-out runs above the floor, in noise variances, with the coefficients "
            "as given."
        ),
    ]
    before: Annotated[float | None, About("With re-tuned coefficients.")]
    after: Annotated[
        float | None,
        About("With the best explanation, which may hold more effects than the verdict names."),
    ]
    floor: float | None
    shrink: float | None
    interval: tuple[float | None, ...] | None
    horizons: tuple[Horizon, ...]
    runs: Annotated[tuple[str, ...], About("The held-out runs.")] = ()


@dataclass(frozen=True)
class Outlier:
    """A single reading left out."""

    run: str
    time: float
    channel: str


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
class Moved:
    """A coefficient as given, re-tuned without an effect, with the best explanation; units of the file."""

    given: float
    prior_sd: Annotated[float, About("Stated uncertainty, one standard deviation.")]
    retuned: float
    explained: float


@dataclass(frozen=True)
class RunError:
    """Open-loop replay of one run, root mean square errors after the first seconds of it.

    Models are nominal (as given), recalibrated (coefficients only) and with effect (the best explanation).
    """

    run: str
    manoeuvre: str
    role: str
    seconds: Annotated[float, About("Length of the run.")]
    lead: Annotated[float, About("First seconds, read to begin on the track; errors count after them.")]
    position: Annotated[
        Mapping[str, float | None],
        About("Model -> horizontal distance [m]; null where it diverges or none was logged."),
    ]
    rms: Annotated[ByChannel, About("Model -> channel -> error [SI].")]


@dataclass(frozen=True)
class FormRow:
    """One row of a model form: its force over 1/2 rho L^2 U^2 (moments L^3) at a drift of 0.2, a yaw rate of
    0.3 U/L and a rudder of 0.25 rad, and its standard deviation."""

    name: str
    axis: str
    force: float
    sd: float


@dataclass(frozen=True)
class ModelFormPart:
    """A force that depends on the motion, that the symmetry of a hull allows, and that the equations lack."""

    gain: Annotated[
        float,
        About("Log evidence that would be lost without it, beside the best explanation [nats]."),
    ]
    sizes: Annotated[
        Mapping[str, float],
        About("Axis -> standard deviation of each of its rows, in the unit of their force."),
    ]
    period: Annotated[
        float | None, About("Period [s] of a resonance in it, as of a roll that a planar model leaves out.")
    ]
    looks_like: Annotated[
        tuple[str, ...],
        About("Declared effects that are part of it and differ from off by two standard deviations."),
    ]
    rows: Annotated[tuple[FormRow, ...], About("Rows that differ from zero by as much, clearest first.")]


@dataclass(frozen=True, eq=False)
class Force:
    """Smoothed missing force in body axes, (n, axes) per run, and its standard deviation [N, N m]."""

    axes: tuple[str, ...]
    runs: tuple[str, ...]
    times: tuple[Array, ...]
    values: tuple[Array, ...]
    sd: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Corner:
    """(m, k) draws of the first unknowns, and of their Laplace approximation, in the units of `names`."""

    names: tuple[str, ...]
    draws: Array
    laplace: Array


@dataclass(frozen=True, eq=False)
class Drawings:
    """Arrays figures are drawn from.

    Attributes
    ----------
    force : None where nothing localises the gap
    effects, margin : effects these runs would show, and (k, k) expected log-evidence margin [nats] of a truth
        (row) over an explanation (column)
    corner : None without draws
    replays : every run beside its simulations, the one to show first
    """

    force: Force | None
    effects: tuple[str, ...]
    margin: Array
    corner: Corner | None
    replays: tuple[Replay, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Result:
    """Everything a diagnosis says, as final plain values."""

    format: Annotated[int, About(checks={"const": FORMAT})]
    bayesid: Annotated[str, About("Version that diagnosed.")]
    trial: Annotated[
        Diagnosed,
        About(
            "What was diagnosed: name, digest of its readings, degrees of freedom, the channels used, the "
            "vehicle, and whom the data are owed to."
        ),
    ]
    model: Annotated[str, About("Digest of the equations and the vehicle's numbers.")]
    seed: Annotated[int, About("Of the draws behind thresholds and intervals.")]
    verdict: Annotated[
        Word,
        About(
            "none: nothing beyond noise, environment and stated uncertainty. effect: one effect explains the "
            "gap. effect_with_remainder: one effect is sure and does not explain all, be it that a free "
            "signal still gains, that runs disagree about it, or that others act beside it which are not "
            "sure. several: more than one is sure. outside: a gap, and no effect is named. coefficients: "
            "closed by moving coefficients beyond their uncertainty. ambiguous: these runs cannot tell the "
            "cause, or whether there is one, also where the most probable name has less than 90 %. "
            "model_form: a repeatable force that depends on the motion and that the equations lack is "
            "needed, and no cause beside it is told from what such a force leaves."
        ),
    ]
    effects: Annotated[
        tuple[Effect, ...],
        About(
            "What the verdict stands on; empty for none and outside. Of an ambiguous verdict the members of "
            "set95 but none and outside, which are possible, not named (or, where there is no other, the "
            "effect more probable than not, if any); of coefficients coefficient_error, or the effect more "
            "probable than not that acts alike. Parameters are those of the best explanation (Laplace, "
            "environment at its level), empty for an effect that is not in it."
        ),
    ]
    probabilities: Annotated[
        Mapping[str, Share],
        About(
            "Of every hypothesis: none, each effect of the catalogue, coefficient_error, outside, and "
            "model_form, which takes the place of none where the runs need one. Sums to 1; "
            "effects that act together share their mass.",
            {"required": ["none", "outside"]},
        ),
    ]
    acting: Annotated[
        Mapping[str, Share],
        About(
            "Of every hypothesis: that it is true, alone or with others. Two effects that surely act "
            "together have 1 each; does not sum to 1."
        ),
    ]
    set95: Annotated[
        tuple[str, ...],
        About(
            "Fewest hypotheses that hold 95 % of the probability, most probable first. Those of unseen count "
            "as none."
        ),
    ]
    unseen: Annotated[
        tuple[str, ...],
        About(
            "Effects these runs would hardly show at their usual size and do not speak for: not to be told "
            "from none here. Their probability is about what it was before the data."
        ),
    ]
    hidden_by_coefficients: Annotated[
        tuple[str, ...], About("Effects whose trace changed coefficients can take over.")
    ]
    reasons: Annotated[tuple[str, ...], About("Sentences behind the verdict, numbers included.")]
    rule: Annotated[
        str,
        About(
            "Name of the rule that decided; the rules stand in order in `bayesid.diagnosis.hypotheses.rules`."
        ),
    ]
    thresholds: Annotated[
        Thresholds,
        About(
            "What chance reaches in at most 1 of 100 trials: gain of the best effect (named) and of the best "
            "free signal (remainder) [nats], largest coefficient move (conflict) [prior sd]."
        ),
    ]
    screen: Annotated[
        tuple[Screened, ...], About("Every effect of the catalogue along one path, best first.")
    ]
    refits: Annotated[
        tuple[Refit, ...],
        About("Hypotheses refitted: no effect, then the others, best first."),
    ]
    explanation: Annotated[
        tuple[str, ...],
        About("Effects of the model `with effect` of gap and measures; empty where no effect gains."),
    ]
    ambiguity_groups: Annotated[
        tuple[tuple[str, ...], ...], About("Effects that leave nearly the same trace on these runs.")
    ]
    ambiguity_size: Annotated[
        float, About("Size at which these groups are alike [prior standard deviations].")
    ]
    detectability: Annotated[
        Mapping[str, Detectability],
        About(
            "Per effect these runs can test: expected noncentrality of its trace on them at one prior "
            "standard deviation, and the share of it that coefficients within their prior absorb."
        ),
    ]
    where: Annotated[Location, About("Where the gap lies.")]
    gap: Annotated[Gap, About("Prediction error on held-out runs, which were read after the verdict.")]
    measures: Annotated[
        tuple[Mapping[str, str | float | None], ...],
        About(
            "Overshoots, diameters and the like of held-out runs, as logged and as each model replays them."
        ),
    ]
    events: Annotated[tuple[Event, ...], About("Short pieces left out; see the report for their kinds.")]
    outliers: Annotated[tuple[Outlier, ...], About("Single readings left out.")]
    posterior: Annotated[
        EffectDraws | None, About("Draws of the named effects' parameters, where asked for (SI).")
    ]
    description: Annotated[
        MissingForce | None,
        About("What the missing force is made of, where an effect does not explain all of it."),
    ]
    environment: Annotated[
        Noise,
        About(
            "Noise of the motion the diagnosis allowed for, one standard deviation: force per axis [N, N m] "
            "over force_tau [s], slow error of the position [m] over drift_tau [s], depth that of the depth "
            "[m] (null: as the position, or none logged), arms the moment a disturbance has per force [m]. "
            "Source: stated in the bundle, measured from straight runs, or assumed."
        ),
    ]
    coefficients: Annotated[
        Mapping[str, Coefficient], About("With the best explanation, in the units of the vehicle file.")
    ]
    model_form: Annotated[
        ModelFormPart | None,
        About("The force the equations lack that every hypothesis has; null where the runs ask for none."),
    ]
    next_manoeuvre: Annotated[
        tuple[Proposal, ...],
        About("Manoeuvres, best first, with the margin [nats] of the worst pair without and with each."),
    ]
    warnings: Annotated[tuple[str, ...], About("What a reader has to know besides.")]
    runs: Annotated[
        tuple[RunError, ...],
        About(
            "Errors of every run, replayed open loop as given, re-tuned and with the best explanation. The "
            "first is the one the report shows: the held-out run (else the identify run) that the model as "
            "given misses most."
        ),
    ] = ()
    moved: Annotated[
        Mapping[str, Moved], About("How far each coefficient of the vehicle file moves, in its units.")
    ] = field(default_factory=dict)
    runs_agree: Annotated[
        float | None,
        About(
            "p-value of all identify runs having one and the same effect, the best explanation's; null where "
            "it was not asked."
        ),
    ] = None
    drawings: Drawings | None = field(default=None, metadata={"drawn": True}, compare=False)

    def record(self) -> dict[str, Any]:
        """Plain data of `diagnosis.json`."""
        return plain(self)


def schema() -> dict[str, Any]:
    """JSON Schema of `diagnosis.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"bayesid diagnosis, format {FORMAT}",
        **described(Result),
        "required": list(CONTRACT),
    }
