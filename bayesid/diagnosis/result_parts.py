"""The parts of a result: what was diagnosed, effects, refits, errors of runs, the model form, drawings.

Final plain values; their names and what is said of them are keys of `diagnosis.json` (`result.Result`). Does
not decide, fit or write.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from bayesid.diagnosis.evidence.replay import Replay
from bayesid.diagnosis.schema import About

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
    steers: Annotated[bool, About("Whether a rudder steers it: manoeuvres are designed for one.")] = True


@dataclass(frozen=True)
class Value:
    """Estimate, standard deviation (Laplace) and the 95 % interval to use."""

    value: float
    sd: float
    unit: str
    low95: Annotated[
        float | None,
        About(
            "The 95 % interval to use, low95 to high95: of the draws where these count, else value +- 1.96 "
            "sd; null where neither is known or the size is derived (then value +- 1.96 sd)."
        ),
    ] = None
    high95: float | None = None


@dataclass(frozen=True)
class Effect:
    """One effect the verdict stands on, its probability of acting and its sizes."""

    name: str
    probability: Annotated[
        float,
        About("That it, or one `in_its_place`, acts, alone or with others.", {"minimum": 0, "maximum": 1}),
    ]
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
    in_its_place: Annotated[
        Mapping[str, float],
        About("Effects of the same kind that may act in its place -> probability that they do."),
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
class StretchFound:
    """A stretch of one run that holds what a free signal gains; times in s by the clock of the log."""

    run: str
    start: float
    end: float
    gain: Annotated[float, About("Gain in log evidence [nats] of the signal allowed only there.")]
    value: Annotated[
        float | None,
        About("Mean of the signal over the stretch, SI; null where the place has more inputs than one."),
    ] = None
    sd: Annotated[float | None, About("One standard deviation of it.")] = None


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
    stretch: Annotated[
        StretchFound | None,
        About(
            "The shortest stretch of one run to which the signal in the place of most evidence can be "
            "confined; null where it acts in several runs, or nowhere."
        ),
    ] = None


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
    expected: Annotated[
        float | None,
        About("Error, floor included, that 95 % of draws of the explanation and its start stay below."),
    ] = None


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
    again: bool = False


@dataclass(frozen=True)
class Coefficient:
    """Estimate and standard deviation in the units of the vehicle file."""

    value: float
    sd: float


# Stated standard deviations from which a coefficient counts as moved by re-tuning.
LEAST_MOVED = 0.5
# Standard deviations of the estimate from which the runs determine that it moved.
SURELY_MOVED = 2.0


@dataclass(frozen=True)
class Moved:
    """A coefficient as given, re-tuned without an effect, with the best explanation; units of the file."""

    given: float
    prior_sd: Annotated[float, About("Stated uncertainty, one standard deviation.")]
    retuned: float
    explained: float
    retuned_sd: Annotated[
        float | None, About("Standard deviation of the re-tuned value; null in results of earlier versions.")
    ] = None
    explained_sd: Annotated[
        float | None,
        About(
            "Standard deviation of the explained value; null where the explanation keeps the coefficient as "
            "given, and in results of earlier versions."
        ),
    ] = None
    completed: Annotated[
        bool, About("Whether the vehicle file does not state it: it was completed from the convention.")
    ] = False
    beside: Annotated[
        float | None,
        About(
            "Its value in the fit that the sizes of the effects told are from; null where that is the "
            "explained one."
        ),
    ] = None
    beside_sd: Annotated[float | None, About("Standard deviation of that.")] = None
    form_sd: Annotated[float, About("By how much a force the equations lack widens it, one sd.")] = 0.0

    @property
    def deviations(self) -> float:
        """How many of its own sd the re-tuned value is away; of the stated one where that is not known."""
        return abs(self.retuned - self.given) / (self.retuned_sd or self.prior_sd or math.inf)

    @property
    def open(self) -> bool:
        """Whether the deviation of the re-tuned value is known and leaves room for the value as given."""
        return self.retuned_sd is not None and self.deviations < SURELY_MOVED

    @property
    def explained_open(self) -> bool:
        """The same of the explained value."""
        sd = self.explained_sd
        return sd is not None and abs(self.explained - self.given) < SURELY_MOVED * sd

    @property
    def beside_open(self) -> bool:
        """The same of the value beside the sizes told."""
        value, sd = self.beside, self.beside_sd
        return value is None or (sd is not None and abs(value - self.given) < SURELY_MOVED * sd)


@dataclass(frozen=True)
class InPlaceOf:
    """An effect that does what a coefficient does which the runs put elsewhere than it was stated."""

    effect: Effect
    coefficient: str
    moved: Annotated[float, About("How far the coefficient certainly lies off, as a normal deviate.")]
    certain: Annotated[
        bool, About("Whether that is further than stated; else its size is told, no more.")
    ] = True


@dataclass(frozen=True)
class Retuning:
    """Whether the model of the explanation has the coefficients re-tuned or as the vehicle file states them.

    Stated ones stay unless re-tuning predicts runs left out in turn better by more than a standard error.
    Beside the simulator as given the whole explanation is held to the same; one that the verdict names is
    left out only where it predicts them worse.
    """

    kept: Annotated[bool, About("Whether the coefficients of the explanation are re-tuned.")]
    gain: Annotated[
        float | None,
        About(
            "Mean logarithm, over identify runs left out in turn and channels, of the rms error with "
            "coefficients as stated over that with them re-tuned; null where it was not asked."
        ),
    ]
    error: Annotated[float | None, About("Its standard error over runs.")]
    sizes: Annotated[
        Mapping[str, float],
        About("Parameters of the effects in that model, as `effect.parameter` (SI)."),
    ]
    as_given: Annotated[
        bool,
        About(
            "Whether the simulator as given predicts in its place, without any effect, because the "
            "explanation does not predict runs left out better."
        ),
    ] = False
    given_gain: Annotated[
        float | None,
        About("As `gain`, of the simulator as given over the explanation; null where it was not asked."),
    ] = None
    given_error: Annotated[float | None, About("Its standard error over runs.")] = None
    alone: Annotated[
        bool,
        About(
            "Whether re-tuned coefficients alone predict in its place, without any effect, because they "
            "predict runs left out better than it does, or the simulator as given, with stated ones."
        ),
    ] = False
    alone_gain: Annotated[
        float | None,
        About("As `gain`, of that model over re-tuned coefficients alone; null where it was not asked."),
    ] = None
    alone_error: Annotated[float | None, About("Its standard error over runs.")] = None


@dataclass(frozen=True)
class SimulatorMistakeFound:
    """A mistake of the simulator whose mend leaves no gap that asks for a cause, or one with named causes."""

    name: str
    says: str
    probability: Annotated[Share, About("Among the mistakes listed.")]
    gain: Annotated[float, About("Log evidence of the mended simulator over the one given [nats].")]
    lead: Annotated[float, About("The same over the best explanation without a mistake [nats].")]
    size: Annotated[float, About("Size of the mistake where it has one, else 1.")]
    numbers: Annotated[
        Mapping[str, float], About("What the vehicle file would hold: coefficient (in its units) -> value.")
    ]
    given: Annotated[Mapping[str, float], About("The same as given.")]
    beside: Annotated[
        tuple[str, ...], About("Effects that the mended simulator still needs; empty where nothing is left.")
    ] = ()
    or_coefficients: Annotated[
        bool,
        About("Whether coefficients further off than stated explain the gap nearly as well: it is either."),
    ] = False


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
    expected: Annotated[
        Mapping[str, float | None],
        About(
            "Channel -> error that the explanation expects of itself by noise, environment, start and "
            "coefficients [SI]; null where it grows beyond what can be told, empty where the explanation "
            "diverges or in a file of an older version."
        ),
    ] = field(default_factory=dict)


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
    """A force that depends on the motion and that the equations lack."""

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
    drag_power: Annotated[Estimate | None, About("Power of the speed that drag goes with in it.")] = None


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
