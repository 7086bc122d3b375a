"""How large the process noise is, measured from the data: latent force per axis, drift, correlation times.

Takes logs along a path. Gives `NoiseModel` by maximum marginal likelihood under a wide prior. Does not decide
what is environment and what is a gap: the caller picks the runs (straight runs and repeats, where no effect
is excited).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.evidence import NormalEquations, posterior
from bayesid.estimation.filter_error.fit import (
    FilterErrorFit,
    fit,
    stacked_equations,
)
from bayesid.estimation.filter_error.linearise import Linearisation, linearise
from bayesid.estimation.filter_error.minimise_scaled import minimise_scaled, spread_left
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, pairs
from bayesid.estimation.parameters import NO_PARAMETERS, GaussianPrior
from bayesid.estimation.run_data import Array, RunData

# Prior medians over 1/2 rho L^2 U^2 and L, and spreads of their logarithms: wide enough for a basin and for
# a rough sea. That of the slow error of depth is the white noise of its sensor.
FORCE_MEDIAN, FORCE_SPREAD = 3e-5, 1.5
DRIFT_MEDIAN, DRIFT_SPREAD = 0.05, 1.5
# How far the environment of manoeuvring runs may lie from that of the straight ones, in the logarithm.
MANOEUVRE_NOISE_SPREAD = 0.4
TAU_FORCE, TAU_DRIFT, TAU_SPREAD = 3.0, 25.0, 0.7
# Time over which a position error wanders [s] and spread of its logarithm: what makes it (satellites,
# beacons, reflections) knows nothing of the vehicle's size. Taken as so many L/U, the drift of a 60 m hull
# came out twice too large and ten times too slow.
NAVIGATION_TAU, NAVIGATION_TAU_SPREAD = 60.0, 1.0
# Longest correlation time of a disturbance [L/U]. A force that lasts longer than the vehicle's own answer to
# it is not noise about its equations but a cause missing from them: a drag that stepped up for good passed
# for a slow sea, and its look-alike was named.
LONGEST_TAU = 6.0
# Prior sd of the arms of the disturbances over L, and how well a measured one repeats.
ARM_SPREAD, ARM_MEASURED_SPREAD = 0.25, 0.05
# Passes a path may take to settle.
SETTLING_ITERATIONS = 20
# Spread of the logarithm of measured amplitudes.
MEASURED_SPREAD = 0.5
# Cost of an environment under which a path leaves the numbers.
DIVERGED_COST = 1e12


Equations = Callable[[Model, Sequence[Linearisation], GaussianPrior, NoiseModel], list[NormalEquations]]


@dataclass(frozen=True)
class NoiseIdentification:
    """Environment of a trial.

    Attributes
    ----------
    noise_model : amplitudes and times
    source : "stated", "measured" or "assumed"
    spread : standard deviation of the logarithm of the amplitudes
    left : standard deviation left to each unknown of a first measurement, in its order, the others held;
        empty where not measured, or measured again from an earlier one
    """

    noise_model: NoiseModel
    source: str
    spread: float
    left: tuple[float, ...] = ()


def no_process_noise(model: Model) -> NoiseModel:
    """No process noise at all."""
    unit, s = force_unit(model), model.scales
    return NoiseModel((0.0,) * unit.size, TAU_FORCE * s["L"] / s["U"], 0.0, TAU_DRIFT * s["L"] / s["U"])


def stated_noise(model: Model, force_rms: float, nav_drift: float) -> NoiseIdentification:
    """Environment a bundle states: force over 1/2 rho L^2 U^2 (moments L^3), drift in m."""
    quiet = no_process_noise(model)
    force = tuple(float(f) for f in force_rms * force_unit(model))
    return NoiseIdentification(NoiseModel(force, quiet.force_tau, nav_drift, NAVIGATION_TAU), "stated", 0.0)


def identify_noise(
    model: Model,
    logs: Sequence[RunData],
    free: GaussianPrior,
    rounds: int = 2,
    known: NoiseIdentification | None = None,
    steps: int = 12,
    equations: Equations = stacked_equations,
    same: float = MANOEUVRE_NOISE_SPREAD,
) -> NoiseIdentification:
    """Environment of runs on which the nominal structure is trusted.

    Coefficients are integrated out under their prior; amplitudes and times maximise the marginal likelihood.

    Parameters
    ----------
    known : an earlier measurement to stay close to
    equations : whitened normal equations of the runs; another one may know forces beside the environment
    same : how close, one standard deviation in the logarithm
    """
    unit, s = force_unit(model), model.scales
    time = s["L"] / s["U"]
    arms = len(pairs(model))
    noise = depth_noise(model, logs)
    deep = [] if noise is None else [noise]
    rest = np.array([s["L"], time, NAVIGATION_TAU, *deep])
    amplitudes = unit.size + rest.size
    if known is None:
        medians = [DRIFT_MEDIAN, TAU_FORCE, 1.0] + [1.0 for _ in deep]
        wide = [DRIFT_SPREAD, TAU_SPREAD, NAVIGATION_TAU_SPREAD] + [DRIFT_SPREAD for _ in deep]
        centre = np.concatenate(
            [np.log(np.concatenate([np.full(unit.size, FORCE_MEDIAN), medians])), np.zeros(arms)]
        )
        spread = np.concatenate([np.full(unit.size, FORCE_SPREAD), wide, np.full(arms, ARM_SPREAD)])
    else:
        c = known.noise_model
        # straight runs without a depth say nothing about its error
        fresh = c.depth is None
        level = np.array([c.drift, c.force_tau, c.drift_tau, *(d if fresh else c.slow("z") for d in deep)])
        level = level / rest
        left = list(known.left)
        if left and deep and fresh:
            left.insert(amplitudes - 1, DRIFT_SPREAD)
        before = np.array(c.arms) / s["L"] if c.arms else np.zeros(arms)
        centre = np.concatenate([np.log(np.concatenate([np.array(c.force) / unit, level])), before])
        # an amplitude the straight runs hardly tell may be another one
        spread = np.hypot(
            np.concatenate([np.full(amplitudes, same), np.full(arms, ARM_MEASURED_SPREAD)]),
            np.array(left) if left else 0.0,
        )

    def noise_model(theta: Array) -> NoiseModel:
        value = np.exp(theta[:amplitudes]) * np.concatenate([unit, rest])
        drift, force_tau, drift_tau, *depth = (float(x) for x in value[unit.size :])
        return NoiseModel(
            tuple(float(f) for f in value[: unit.size]),
            force_tau,
            drift,
            drift_tau,
            tuple(float(x) for x in theta[amplitudes:] * s["L"]),
            depth[0] if depth else None,
        )

    theta = centre.copy()
    for _ in range(rounds):
        # Coefficients stay nominal along the path: a row of the balance and its noise may shrink together
        # without any change in the track, and a path fitted under too quiet a guess would take that way out.
        settled = settled_paths(model, logs, noise_model(theta))
        linear = linear_paths(model, logs, settled, free)

        def cost(t: Array, paths: tuple = linear) -> float:
            all_runs = equations(model, paths, free, noise_model(t))
            total = sum(all_runs[1:], all_runs[0])
            if not (np.isfinite(total.ss).all() and np.isfinite(total.se).all() and np.isfinite(total.ee)):
                return DIVERGED_COST
            return -posterior(total).log_evidence + 0.5 * float((((t - centre) / spread) ** 2).sum())

        high = centre + 2.5 * spread
        high[unit.size + 1] = min(high[unit.size + 1], np.log(LONGEST_TAU))
        theta = minimise_scaled(cost, theta, centre - 2.5 * spread, high, spread, steps)
    found = tuple(float(x) for x in spread_left(cost, theta, spread)) if known is None else ()
    return NoiseIdentification(noise_model(theta), "measured", MEASURED_SPREAD, found)


def depth_noise(model: Model, logs: Sequence[RunData]) -> float | None:
    """White noise of the measured depth [m], loudest of the runs; None where none has it."""
    seen = [float(log.sigma[log.channels.index("z")]) for log in logs if "z" in log.channels]
    return max(seen, default=None)


def settled_paths(model: Model, logs: Sequence[RunData], noise_model: NoiseModel) -> FilterErrorFit:
    """Paths settled at the nominal coefficients.

    Straight runs settle at once at the real level. Where they do not, they are led there from a large one: a
    path that has not settled passes for process noise (a remus100 in a clean rough sea: every level at its
    bound).
    """
    if all(log.straight for log in logs):
        try:
            near = fit(model, logs, NO_PARAMETERS, noise_model, initial_noise_scale=0.0, iterations=8)
        except ModelError:
            near = None
        if near is not None and near.converged:
            return near
    return fit(model, logs, NO_PARAMETERS, noise_model, iterations=SETTLING_ITERATIONS)


def linear_paths(
    model: Model, logs: Sequence[RunData], settled: FilterErrorFit, free: GaussianPrior
) -> tuple[Linearisation, ...]:
    """Paths about where a fit ended; about its most probable pass if the last step left the numbers."""
    try:
        return tuple(
            linearise(model, log, p, free.where) for log, p in zip(logs, settled.points, strict=True)
        )
    except ModelError:
        return tuple(
            linearise(model, log, p, free.where) for log, p in zip(logs, settled.path_points, strict=True)
        )
