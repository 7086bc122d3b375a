"""Simulated campaigns whose errors are not those a fit assumes, and the fit of one of them.

Gives a `Setting` that all share, and the problem of one truth under one `Condition`. Does not judge.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bayesid.equations.model import Model, build_model
from bayesid.estimation.filter_error.linearise import with_forces
from bayesid.estimation.filter_error.noise_model import force_unit
from bayesid.estimation.likelihood import CoefficientPosterior, NoiseParts
from bayesid.estimation.likelihood.filter_estimate import filter_estimate
from bayesid.estimation.likelihood.weighted_fit import weighted_fit
from bayesid.estimation.output_error import FitOptions, FitProblem, coefficient_set, trial_problem
from bayesid.estimation.output_error.fit_result import Fit
from bayesid.estimation.segments import in_pieces
from bayesid.manoeuvres import zigzag
from bayesid.model.params import ParameterSet, Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import TimePlan, plan_trial_run, simulate, steady_start
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Run, Trial

Array = np.ndarray
VEHICLE, DEG = "lauv", math.pi / 180
INERTIA = ("X_udot", "Y_vdot", "N_rdot")  # known; all other coefficients are free
PRIOR_SD = 0.1  # of every coefficient, relative
ANGLES = (10.0, 20.0, 15.0, 5.0)  # deg, zig-zags
DURATION, DT, FORCE_MEMORY = 40.0, 0.2, 2.0  # L/U
# over L, U and U/L; angles in radian
NOISE = {"x": 0.02, "y": 0.02, "psi": 0.3 * DEG, "u": 0.005, "v": 0.005, "r": 0.006}


@dataclass(frozen=True)
class Condition:
    """What the readings of a campaign are like.

    memory : correlation time of the sensor noise [samples]; 0 is white
    force : sd of a force with memory over 1/2 rho L^2 U^2 (moments: L^3)
    run_spread : sd of a coefficient from run to run over its prior sd
    rows : coefficients [file units] of the true vehicle that the fitted equations lack
    effect : effect parameters of the true vehicle, off in the fit
    piece : length of the pieces the runs are cut into [L/U]; 0 fits whole runs
    estimate_noise : the noise is estimated with the fit instead of stated
    dt : time between readings [L/U]
    """

    memory: float = 0.0
    force: float = 0.0
    run_spread: float = 0.0
    rows: Mapping[str, float] = field(default_factory=dict)
    effect: Mapping[str, float] = field(default_factory=dict)
    piece: float = 0.0
    estimate_noise: bool = False
    dt: float = DT


@dataclass(frozen=True, eq=False)
class Setting:
    """What all campaigns share."""

    model: Model
    params: ParameterSet
    runs: tuple[Run, ...]
    plans: tuple[TimePlan, ...]
    noise: Mapping[str, float]
    dt: float = DT

    @property
    def time(self) -> float:
        """L/U [s]."""
        return float(self.model.scales["L"] / self.model.scales["U"])


def setting(angles: tuple[float, ...] = ANGLES, model: Model | None = None, dt: float = DT) -> Setting:
    """Zig-zags of one vehicle, by default all four, and what is known of its coefficients."""
    model = model or build_model(load_vehicle(VEHICLE), 3)
    s = model.scales
    time, rpm = s["L"] / s["U"], float(model.vehicle.rpm_ref or 0.0)
    known = coefficient_set(model, tuple(n for n in model.coefficients if n not in INERTIA), use_prior=False)
    entries = tuple(replace(p, prior=Prior("normal", p.start, PRIOR_SD * p.scale)) for p in known.entries)
    runs = tuple(
        virtual_run(
            model,
            model.nominal,
            zigzag(a * DEG, a * DEG, rpm, approach=2 * time, duration=DURATION * time, dt=dt * time),
            name=f"zz{a:g} {i}",
        )
        for i, a in enumerate(angles)
    )
    unit = {"x": s["L"], "y": s["L"], "psi": 1.0, "u": s["U"], "v": s["U"], "r": s["U"] / s["L"]}
    noise = {c: v * unit[c] for c, v in NOISE.items()}
    plans = tuple(plan_trial_run(model, run) for run in runs)
    return Setting(model, ParameterSet(entries), runs, plans, noise, dt)


def with_rows(s: Setting, rows: Mapping[str, float]) -> Setting:
    """The setting with a model that has these coefficients [file units] too."""
    if not rows:
        return s
    vehicle = replace(s.model.vehicle, coef={**s.model.vehicle.coef, **rows})
    model = build_model(vehicle, s.model.dof)
    return replace(s, model=model, plans=tuple(plan_trial_run(model, run) for run in s.runs))


def remembering(rng: np.random.Generator, count: int, memory: float) -> Array:
    """(count,) first-order autoregression of unit variance, correlation time in samples; 0 is white."""
    noise = rng.standard_normal(count)
    if memory <= 0:
        return noise
    keep = math.exp(-1.0 / memory)
    for i in range(1, count):
        noise[i] = keep * noise[i - 1] + math.sqrt(1.0 - keep**2) * noise[i]
    return noise


def drawn_truth(s: Setting, rng: np.random.Generator) -> Array:
    """(k,) coefficients drawn from the prior [SI]."""
    return s.params.start + PRIOR_SD * s.params.vector("scale") * rng.standard_normal(len(s.params.names))


def campaign(
    s: Setting,
    condition: Condition,
    truth: Array,
    rng: np.random.Generator,
    real: Setting | None = None,
    noise_scale: float = 1.0,
) -> Trial:
    """The runs of a vehicle with these coefficients.

    Parameters
    ----------
    real : `with_rows` of the condition, where it has any; made here otherwise
    noise_scale : of the sensor noise, 0 for readings without any
    """
    true = real or with_rows(s, condition.rows)
    base = true.model.with_values(condition.effect)
    sd = PRIOR_SD * s.params.vector("scale")
    runs = []
    for run, plan in zip(s.runs, true.plans, strict=True):
        own = truth + condition.run_spread * sd * rng.standard_normal(truth.size)
        if condition.force > 0:
            memory = FORCE_MEMORY / s.dt
            forces = [
                condition.force * u * remembering(rng, plan.t.size - 1, memory)
                for u in force_unit(true.model)
            ]
            plan = with_forces(true.model, plan, np.column_stack(forces))
        par = s.params.place(base, true.model.index, own)
        track = simulate(true.model, par, plan, steady_start(true.model), full=True)
        data = {
            c: track.states[:, true.model.states.index(c)]
            + noise_scale * sigma * remembering(rng, plan.t.size, condition.memory)
            for c, sigma in s.noise.items()
        }
        runs.append(Run(run.name, run.manoeuvre, "identify", run.t, data, run.commands))
    return Trial("campaign", Path("."), VEHICLE, 3, tuple(runs), noise=dict(s.noise))


def cut(s: Setting, trial: Trial, piece: float = 0.0) -> Trial:
    """A campaign in pieces of that length [L/U] if any."""
    return in_pieces(trial, piece * s.time) if piece > 0 else trial


def problem_of(s: Setting, trial: Trial, piece: float = 0.0) -> FitProblem:
    """Fit of a campaign, in pieces of that length [L/U] if any."""
    return trial_problem(s.model, cut(s, trial, piece), s.params, threads=1)


def fitted(
    s: Setting, trial: Trial, options: FitOptions, piece: float = 0.0, parts: NoiseParts | None = None
) -> tuple[FitProblem, Fit, CoefficientPosterior | None]:
    """A campaign fitted as `bayesid fit` does: the problem, the fit and its posterior."""
    problem = problem_of(s, trial, piece)
    runs = cut(s, trial, piece).identify
    return weighted_fit(
        problem, options, parts=parts, filtered=lambda even, tick: filter_estimate(even, runs, tick)
    )
