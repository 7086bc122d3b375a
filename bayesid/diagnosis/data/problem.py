"""What a diagnosis works on: model, identify runs, coefficient priors, environment.

Takes a trial and a vehicle. Gives a frozen `DiagnosisProblem`. Held-out runs are not even read here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from bayesid.diagnosis.data.event import Event, blanked, released, without_readings
from bayesid.diagnosis.data.model_form import ModelForm, absent_fins, frequency_start, with_form
from bayesid.diagnosis.data.outliers import Found, set_aside
from bayesid.diagnosis.data.sampling import too_coarse
from bayesid.diagnosis.threshold_table import FOLLOWS_DATA_CHI2
from bayesid.equations.model import Model
from bayesid.errors import ModelError, TrialError
from bayesid.estimation.filter_error.fit import FilterErrorFit, fit
from bayesid.estimation.filter_error.linearise import Trajectory, first_trajectory
from bayesid.estimation.filter_error.noise_identification import (
    NoiseIdentification,
    identify_noise,
    stated_noise,
)
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.filter_error.read_run import LONGER_STEPS, filter_error_run, why_not_straight
from bayesid.estimation.filter_error.straight_run_noise import RemovedForces, identify_straight_noise
from bayesid.estimation.onsets import onsets_tried
from bayesid.estimation.parameters import NO_PARAMETERS, GaussianPrior, coefficient_prior, effect_prior
from bayesid.estimation.run_data import RunData
from bayesid.model.effects import Effect
from bayesid.trials import Trial
from bayesid.trials.health import one_sided_turns
from bayesid.trials.kinematics.derived_velocity import velocity_from_track
from bayesid.trials.noise import noise_of_readings, not_stated_words, raised, raised_words
from bayesid.words import counted

Notify = Callable[[str], None]
# How far the environment of manoeuvres may lie from that of straight runs that hold a gap, in the logarithm.
STRAIGHT_NOISE_SPREAD = 0.2
# Passes for the path of the nominal model along the readings.
PATH_ITERATIONS = 16
# Passes in which states that hang on nothing but a known motion arrive.
SETTLING_ITERATIONS = 3
# Latent force of the first pass where the start already follows the data.
FOLLOWING_FORCE_LEVEL = 1e-5
# Of the first pass along the readings' own path, which no equation has made smooth.
READINGS_FORCE_LEVEL = 0.03
# Where an effect without a slope when off begins, in prior standard deviations.
USUAL_START = 0.5
# Secant sizes, in prior standard deviations, of effects without a slope when off, or with one that says
# nothing of large sizes: a rudder that is late by longer than it moves.
SECANT_SIZES = (0.15, 0.8, 2.0, 3.0)
# Effect -> how far each of its parameters is from its prior mean, in prior standard deviations.
Starts = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class DiagnosisProblem:
    """A gap to diagnose.

    Attributes
    ----------
    model : Model
    logs : identify runs, outliers set aside
    coefficients : what is free in every hypothesis: coefficients of the vehicle first, then the model form
    environment : Environment
    channels : measured channels used
    outliers : (run, time [s], channel) of the readings set aside
    warnings : sentences for the report
    path, path_level : nominal model along a path that follows the data, and the latent force this needs over
        1/2 rho L^2 U^2: where sensitivities are taken while nothing is known
    events : what happened once and is left out
    as_built : whether an earlier clean identification fixed the coefficients
    form : size of the model form in `coefficients`; None without
    vehicle : the coefficients of the vehicle alone, where there is a form
    velocity_from_track : whether u, v are the logged track differentiated, so that both are of one point
    turns : whether every run turns to the same side with its rudder amidships
    ended : names of free parameters -> points at which their fit ended in another environment
    """

    model: Model
    logs: tuple[RunData, ...]
    coefficients: GaussianPrior
    environment: NoiseIdentification
    channels: tuple[str, ...]
    outliers: tuple[tuple[str, float, str], ...]
    warnings: tuple[str, ...]
    path: tuple[Trajectory, ...]
    path_level: float
    events: tuple[Event, ...] = ()
    as_built: bool = False
    form: ModelForm | None = None
    vehicle: GaussianPrior | None = None
    velocity_from_track: bool = False
    turns: bool = False
    ended: Mapping[frozenset[str], tuple[Trajectory, ...]] = field(default_factory=dict)

    @property
    def stated(self) -> GaussianPrior:
        """Coefficients of the vehicle within the prior of its file."""
        return self.coefficients if self.vehicle is None else self.vehicle

    @property
    def absent_fins(self) -> frozenset[str]:
        """Fins of the equations that the vehicle does not have."""
        return absent_fins(self.model, self.logs)

    def with_form(self, form: ModelForm) -> DiagnosisProblem:
        """The problem with a model form free in every hypothesis."""
        free = with_form(self.model, self.stated, form, self.absent_fins)
        path = self.swinging(self.path, form, self.path_level)
        return replace(self, coefficients=free, form=form, vehicle=self.stated, path=path)

    def ended_with(self, effects: Sequence[Effect]) -> tuple[Trajectory, ...] | None:
        """Points at which a fit of the same effects ended in another environment; None where none did."""
        names = {e.key(p.name) for e in effects for p in e.parameters}
        return self.ended.get(frozenset(names | set(self.coefficients.names)))

    def along_readings(self) -> DiagnosisProblem:
        """The problem along the readings' own path: that of the nominal model may leave what can be simulated
        where the readings are too far apart for its fastest motion."""
        base = self.model.nominal.copy()
        base[self.coefficients.where] = self.coefficients.mean
        path = tuple(first_trajectory(self.model, log, base) for log in self.logs)
        return replace(self, path=path, path_level=READINGS_FORCE_LEVEL)

    def with_environment(
        self, noise_model: NoiseModel, fits: Sequence[FilterErrorFit] = ()
    ) -> DiagnosisProblem:
        """The problem without a form under another process noise, its path anew.

        Parameters
        ----------
        fits : of this problem, near which those of the same parameters begin
        """
        along = fit(self.model, self.logs, NO_PARAMETERS, noise_model, iterations=PATH_ITERATIONS)
        return replace(
            self,
            coefficients=self.stated,
            environment=replace(self.environment, noise_model=noise_model, again=True),
            warnings=(*self.warnings, "the environment was estimated again beside the best explanation"),
            path=along.path_points,
            path_level=along.path_force_level,
            form=None,
            vehicle=None,
            ended={frozenset(f.free.names): f.points for f in fits},
        )

    def swinging(
        self, points: Sequence[Trajectory], form: ModelForm, force_level: float
    ) -> tuple[Trajectory, ...]:
        """Points at the natural frequency of a form's resonance, its states smoothed anew along them.

        Parameters
        ----------
        force_level : latent force over 1/2 rho L^2 U^2 with which the points follow the readings; 0 for the
            real one
        """
        if form.period is None:
            return tuple(points)
        moved = [replace(p, par=frequency_start(self.model, form, p.par)) for p in points]
        return fit(
            self.model,
            self.logs,
            NO_PARAMETERS,
            self.environment.noise_model,
            start=moved,
            initial_noise_scale=force_level,
            iterations=SETTLING_ITERATIONS,
        ).points


def build_problem(
    model: Model,
    trial: Trial,
    notify: Notify = lambda text: None,
    as_built: float | None = None,
    events: tuple[Event, ...] = (),
    outlying: Found = (),
    seek_outliers: bool = True,
) -> DiagnosisProblem:
    """Problem of a trial.

    Parameters
    ----------
    as_built : relative sd of the coefficients if an earlier clean identification fixed them (as-built frame)
    events : what happened once and is to be left out
    outlying : single readings (run, time [s], channel) to be left out
    seek_outliers : whether to look for more of them

    Raises
    ------
    TrialError
        if there is nothing to identify from
    """
    warnings: list[str] = []
    runs = tuple(without_readings(blanked(run, events), outlying) for run in trial.identify)
    if not runs:
        raise TrialError(f"{trial.name}: no run has role 'identify'; a diagnosis needs at least one")
    noise = dict(trial.noise)
    measured = {c for run in runs for c in run.data}
    missing = [c for c in model.kernel.channels if c in measured and c not in noise]
    if missing:
        noise |= noise_of_readings(runs, missing)
        warnings.append(not_stated_words(missing))
    channels = tuple(c for c in model.kernel.channels if c in noise and c in measured)
    least = raised({c: noise[c] for c in channels}, model.scales["L"], model.scales["U"])
    if least:
        noise |= least
        warnings.append(raised_words(least))
    known = trial.velocity_from_track
    derived = bool(velocity_from_track(trial.identify) if known is None else known)
    if derived:
        warnings.append(
            "u and v are the logged track differentiated and filtered (fast changes of both agree): both are "
            "of one point, so a position lever arm is not looked for; a latency may be"
        )
    logs = [
        released(model, filter_error_run(model, run, noise, channels, LONGER_STEPS), events) for run in runs
    ]
    if (coarse := too_coarse(model, logs)) is not None:
        warnings.append(coarse)
    outliers: Found = ()
    if seek_outliers:
        notify("reading: readings that no smooth motion explains")
        logs, outliers = set_aside(model, logs)
    coefficients = coefficient_prior(model)
    if as_built is not None:
        coefficients = replace(coefficients, sd=as_built * np.abs(coefficients.mean))
    if model.vehicle.prior is None and as_built is None:
        warnings.append("the vehicle file states no prior; coefficients are taken as known to 10 %")
    environment = _environment(model, trial, logs, coefficients, warnings, notify)
    notify("path: the nominal model along the data under a free force")
    along_data = fit(model, logs, NO_PARAMETERS, environment.noise_model, iterations=PATH_ITERATIONS)
    return DiagnosisProblem(
        model,
        tuple(logs),
        coefficients,
        environment,
        channels,
        (*outlying, *outliers),
        tuple(warnings),
        along_data.path_points,
        along_data.path_force_level,
        events,
        as_built is not None,
        velocity_from_track=derived,
        turns=bool(one_sided_turns(runs)[0]),
    )


def _environment(
    model: Model, trial: Trial, logs: list[RunData], free: GaussianPrior, warnings: list[str], notify: Notify
) -> NoiseIdentification:
    stated = trial.environment
    if stated is not None and stated.force_rms is not None:
        return stated_noise(model, stated.force_rms, stated.nav_drift or 0.0)
    straight = [log for log in logs if log.straight]
    if straight:
        notify(f"environment: measured from {counted(len(straight), 'straight run')}")
        first, apart = identify_straight_noise(model, straight, free)
        if apart.any:
            # the manoeuvres have it as well, and must not count it as process noise there
            warnings.append(_removed_words(model, apart))
            if apart.repeated:
                return first
            firm = replace(first, left=())
            return identify_noise(
                model,
                logs,
                free,
                rounds=1,
                known=firm,
                steps=5,
                equations=apart.equations,
                same=STRAIGHT_NOISE_SPREAD,
            )
        return identify_noise(model, logs, free, rounds=1, known=first, steps=5)
    warnings.append(_not_straight(model, trial, logs))
    found = identify_noise(model, logs, free)
    return NoiseIdentification(found.noise_model, "assumed", 1.0)


def _not_straight(model: Model, trial: Trial, logs: list[RunData]) -> str:
    """That no run tells the environment apart from the vehicle, and why not those that were meant to."""
    meant = {run.name for run in trial.identify if "straight" in run.manoeuvre.lower()}
    told = [f"{log.name}: {why_not_straight(model, log)}" for log in logs if log.name in meant]
    why = f" ({'; '.join(told)})" if told else ""
    return f"no straight run{why}: the environment is estimated from all runs, so a gap may hide in it"


def _removed_words(model: Model, apart: RemovedForces) -> str:
    """What straight runs have that is not process noise, in words."""
    parts = []
    if apart.repeated:
        parts.append(f"the same disturbance in {', '.join(apart.repeated)} at the same time")
    if apart.frequencies:
        periods = ", ".join(f"{2 * np.pi / f:.3g}" for f in apart.frequencies)
        parts.append(f"a force with a period of {periods} s")
    if apart.lasting:
        parts.append("a force that lasts")
    return f"the straight runs have {' and '.join(parts)}: not process noise, left out of the environment"


def first_fit(
    problem: DiagnosisProblem,
    effects: Sequence[Effect],
    points: Sequence[Trajectory],
    sizes: Starts = MappingProxyType({}),
) -> list[Trajectory]:
    """Points with some effects at their start: off, or some way from it where they have no slope when off.

    Parameters
    ----------
    sizes : effect -> how far each parameter, in prior sd; half of one where not given, and of a dated effect
        the middle of the runs
    """
    par = points[0].par.copy()
    for effect in effects:
        prior = effect_prior(problem.model, effect)
        par[prior.where] = [p.mean for p in effect.parameters]
        if not effect.smooth:
            usual = at_time(effect, USUAL_START, sizes_tried(problem, effect)[0])
            par[prior.where] += np.array(sizes.get(effect.name, usual)) * prior.sd
    return [replace(point, par=par) for point in points]


def at_time(effect: Effect, size: float, time: float) -> tuple[float, ...]:
    """Parameters of an effect, prior sd from their means: a size, and of a dated effect a time."""
    return tuple(time if p.dated else size for p in effect.parameters)


def sizes_tried(problem: DiagnosisProblem, effect: Effect) -> tuple[float, ...]:
    """Sizes of an effect without a slope when off that a screen tries, the usual one first [prior sd].

    Of a dated effect they are times in the runs; elsewhere secants stand in for a slope.
    """
    if effect.dated is None:
        return SECANT_SIZES
    prior = effect_prior(problem.model, effect)
    mean, sd = float(prior.mean[effect.dated]), float(prior.sd[effect.dated])
    return tuple((time - mean) / sd for time in onsets_tried(problem.logs))


def fit_with(
    problem: DiagnosisProblem,
    effects: tuple[Effect, ...],
    start: Sequence[Trajectory] | None = None,
    iterations: int = 25,
    initial_noise_scale: float = READINGS_FORCE_LEVEL,
    sizes: Starts = MappingProxyType({}),
    worth: float = -np.inf,
) -> FilterErrorFit:
    """Filter-error fit of coefficients and of some effects' parameters.

    One that runs out of passes with residuals about as small as the noise is on its way and goes on once.

    Parameters
    ----------
    sizes : where effects begin without `start` (`first_fit`)
    worth : log evidence below which a fit that runs out of passes does not go on
    """
    free = problem.coefficients
    for effect in effects:
        free = free + effect_prior(problem.model, effect)
    if start is None:
        start = list(problem.path)
        if effects:
            start = first_fit(problem, effects, start, sizes)
        initial_noise_scale = max(problem.path_level, 1e-5)
    noise_model = problem.environment.noise_model
    out = fit(
        problem.model,
        problem.logs,
        free,
        noise_model,
        start=start,
        iterations=iterations,
        initial_noise_scale=initial_noise_scale,
    )
    if out.converged or out.iterations < iterations or not out.chi2 <= FOLLOWS_DATA_CHI2:
        return out
    if out.log_evidence < worth:
        return out
    try:
        more = fit(
            problem.model,
            problem.logs,
            free,
            noise_model,
            start=out.points,
            iterations=iterations,
            initial_noise_scale=0.0,
        )
    except ModelError:
        return out
    return more if more.chi2 <= FOLLOWS_DATA_CHI2 else out


def fit_without(problem: DiagnosisProblem) -> FilterErrorFit:
    """Filter-error fit without any effect, begun where it ended in another environment."""
    if (ended := problem.ended_with(())) is not None:
        out = fit_with(problem, (), start=ended, initial_noise_scale=FOLLOWING_FORCE_LEVEL)
        if out.converged:
            return out
    return fit_with(problem, ())
