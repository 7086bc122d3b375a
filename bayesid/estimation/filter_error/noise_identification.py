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
from bayesid.estimation.filter_error.linearise import Linearisation, linearise_runs
from bayesid.estimation.filter_error.minimise_scaled import minimise_scaled, spread_left
from bayesid.estimation.filter_error.noise_model import NoiseModel, force_unit, pairs
from bayesid.estimation.filter_error.normal_equations import of_all_runs
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
    again : whether it was estimated again beside an explanation of the gap
    """

    noise_model: NoiseModel
    source: str
    spread: float
    left: tuple[float, ...] = ()
    again: bool = False


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
    unknowns = _unknowns(model, logs, known, same)
    theta = unknowns.centre.copy()
    for left in range(rounds - 1, -1, -1):
        # Coefficients stay nominal along the path: a row of the balance and its noise may shrink together
        # without any change in the track, and a path fitted under too quiet a guess would take that way out.
        settled = settled_paths(model, logs, unknowns.noise_model(theta)).released()
        cost = unknowns.cost(linear_paths(model, logs, settled, free), free, equations)
        theta = minimise_scaled(cost, theta, unknowns.low, unknowns.high, unknowns.spread, steps)
        if left:
            del cost  # and the paths it holds, before the next ones are made
    found = tuple(float(x) for x in spread_left(cost, theta, unknowns.spread)) if known is None else ()
    return NoiseIdentification(unknowns.noise_model(theta), "measured", MEASURED_SPREAD, found)


def noise_beside(
    fitted: FilterErrorFit, noise_model: NoiseModel, steps: int = 12, louder: bool = True
) -> tuple[NoiseModel, float]:
    """Most probable process noise along a fit, everything free in it integrated out, and what that gains in
    log density over the noise the fit was made with [nats]; where drift, times and arms of that lie beyond
    the bounds of a first guess, over the nearest within.

    The path is that of a fit that explains the data: no balance is left that noise could shrink with.

    Parameters
    ----------
    noise_model : the noise the fit was made with
    louder : whether forces may be larger than in that
    """
    unknowns = _unknowns(fitted.model, fitted.logs, None, 0.0)
    cost = unknowns.cost(fitted.paths, fitted.free, stacked_equations)
    before, low, high = unknowns.theta(noise_model), unknowns.low, unknowns.high
    if not louder:
        # a measured sea may lie outside the bounds of a first guess
        force = slice(None, unknowns.forces)
        low[force], high[force] = np.minimum(low, before)[force], before[force]
    start = np.clip(before, low, high)
    theta = minimise_scaled(cost, start, low, high, unknowns.spread, steps)
    return unknowns.noise_model(theta), float(cost(start) - cost(theta))


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """Unknowns of an environment, in logarithms but for the arms, and their prior.

    Attributes
    ----------
    model : the model whose noise it is
    unit : (k,) amplitudes and times one stands for [SI]
    forces : number of force amplitudes
    deep : whether depth has a slow error of its own
    centre, spread : (n,) prior
    """

    model: Model
    unit: Array
    forces: int
    deep: bool
    centre: Array
    spread: Array

    @property
    def low(self) -> Array:
        return self.centre - 2.5 * self.spread

    @property
    def high(self) -> Array:
        out = self.centre + 2.5 * self.spread
        out[self.forces + 1] = min(out[self.forces + 1], np.log(LONGEST_TAU))
        return out

    def noise_model(self, theta: Array) -> NoiseModel:
        k = self.unit.size
        value = np.exp(theta[:k]) * self.unit
        drift, force_tau, drift_tau, *depth = (float(x) for x in value[self.forces :])
        return NoiseModel(
            tuple(float(f) for f in value[: self.forces]),
            force_tau,
            drift,
            drift_tau,
            tuple(float(x) for x in theta[k:] * self.model.scales["L"]),
            depth[0] if depth else None,
        )

    def theta(self, noise: NoiseModel) -> Array:
        """Unknowns of a noise model; the depth of one without it as slow as the positions."""
        slow = [noise.slow("z")] if self.deep else []
        level = np.array([*noise.force, noise.drift, noise.force_tau, noise.drift_tau, *slow]) / self.unit
        arms = np.array(noise.arms) / self.model.scales["L"]
        level = np.log(np.maximum(level, np.finfo(float).tiny))  # none at all is below every bound
        return np.concatenate([level, arms if arms.size else np.zeros(len(pairs(self.model)))])

    def cost(
        self, paths: Sequence[Linearisation], free: GaussianPrior, equations: Equations
    ) -> Callable[[Array], float]:
        """Negative log posterior density of the unknowns along paths [nats]."""

        def cost(theta: Array) -> float:
            try:
                all_runs = equations(self.model, paths, free, self.noise_model(theta))
                total = of_all_runs(all_runs, free)
                if not (
                    np.isfinite(total.ss).all() and np.isfinite(total.se).all() and np.isfinite(total.ee)
                ):
                    return DIVERGED_COST
                log_evidence = posterior(total).log_evidence
            except ModelError:
                return DIVERGED_COST
            away = (theta - self.centre) / self.spread
            return -log_evidence + 0.5 * float((away**2).sum())

        return cost


def _unknowns(
    model: Model, logs: Sequence[RunData], known: NoiseIdentification | None, same: float
) -> _Unknowns:
    """Unknowns under a wide prior, or close to an earlier measurement."""
    unit, s = force_unit(model), model.scales
    arms = len(pairs(model))
    noise = depth_noise(model, logs)
    deep = [] if noise is None else [noise]
    rest = np.array([s["L"], s["L"] / s["U"], NAVIGATION_TAU, *deep])
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
    return _Unknowns(model, np.concatenate([unit, rest]), unit.size, bool(deep), centre, spread)


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
        return tuple(linearise_runs(model, logs, settled.points, free.where))
    except ModelError:
        return tuple(linearise_runs(model, logs, settled.path_points, free.where))
