"""How many effective draws per second, beside emcee with a likelihood by scipy's `solve_ivp`?

Case 2 of the paper: 14 unknowns, one 10-minute spiral read every second, noise and initial state known.
All samplers see the same posterior in the same whitened coordinates, start from the same Laplace
approximation and run four ensembles of 64 walkers. The baseline is emcee as it comes (stretch move, one
walker at a time) on `solve_ivp` (RK45, 1e-6) with only the rows that are not zero and one continuous rudder
ramp: nothing to restart.

A chain by `solve_ivp` that is long enough would take hours. Its effective draws per evaluation are those of
the stretch move on the very same density (the two likelihoods are compared below), its seconds per evaluation
are measured here; the ratio is of both. Prints Markdown rows.
"""

from __future__ import annotations

import importlib.util
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_scipy import _compiled, right_side
from scipy.integrate import solve_ivp
from setting import RPM, machine, row
from simd import HAND

from bayesid.equations.model import build_model
from bayesid.estimation.output_error import coefficient_set, fit, trial_problem
from bayesid.estimation.sampling import (
    ConvergenceLimits,
    Posterior,
    SamplerOptions,
    SamplingSettings,
    TrialDensity,
    sample,
    trial_density,
)
from bayesid.manoeuvres import spiral
from bayesid.model.params import Prior
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import simulate
from bayesid.simulation.prepare import actuate, inverse_mass
from bayesid.simulation.virtual_trial import virtual_trial

sys.path.insert(0, str(Path(__file__).parents[1]))
from studies.paper_cases.run import DRIFT, RUDDER

DEG = math.pi / 180
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.5 * DEG}
PRIOR_SD = 0.25 / math.sqrt(3)  # of the paper's bounds of 25 %, as a normal prior
BASELINE_STEPS, EVALUATIONS = 2500, 8


# the baseline runs all its steps: it neither passes nor is given up as too slow
NEVER = ConvergenceLimits(n_tau=1.0, ess=math.inf)


def case2() -> TrialDensity:
    """Posterior of the 14 unknowns."""
    model = build_model(load_vehicle("generic_sub"), 3)
    unknown = tuple(n for n in model.coefficients if n not in (*DRIFT, *RUDDER))
    trial = virtual_trial(
        model, model.nominal, {"spiral": spiral(RPM, dt=1.0)}, title="spiral", vehicle_ref="generic_sub",
        noise=NOISE, rng=np.random.default_rng(0),
    )  # fmt: skip
    params = coefficient_set(model, unknown, relative_bounds=5 * PRIOR_SD, use_prior=False)
    for p in params.free:
        params = params.changed([p.name], prior=Prior("normal", p.start, PRIOR_SD * p.scale))
    problem = trial_problem(model, trial, params, channels=tuple(NOISE))
    (run,) = problem.runs
    known = replace(run, initial=(), initial_sd=np.zeros(0))
    problem = replace(problem, runs=(known,))
    choice = SamplingSettings(noise="fixed", initial="fixed", memory="ignore")
    return replace(trial_density(problem, fit(problem).z, choice), threads=1)


class ByScipy:
    """The same log posterior of one vector with `solve_ivp`."""

    def __init__(self, density: TrialDensity, rate) -> None:
        self.density, self.rate = density, rate
        (self.run,) = density.problem.runs
        self.model = density.problem.model
        self.where = self.model.positions(HAND)
        plan = self.run.plan
        self.t = plan.t - plan.t[0]
        fins = self.model.kernel.actuators.index("delta_r")
        rudder, middle = (
            actuate(self.model, self.model.nominal, plan)[0][:, fins],
            plan.times + 0.5 * plan.steps,
        )
        late = middle > self.t[-1] / 10  # past the first move, at the vehicle's own rate
        self.slope, self.offset = np.polyfit(middle[late], rudder[late], 1)
        self.turn = float(plan.times[np.argmax(rudder != 0)])
        self.rate_limit = 1.0 / float(self.model.nominal[self.model.index["inverse_rate_r"]])

    def track(self, z: np.ndarray) -> np.ndarray:
        par, (x0,) = self.density.problem.split(z)
        coefficients = par[self.where]
        inverse = inverse_mass(self.model, self.model.kernel.bare, par[None])[0]
        if self.rate is right_side:  # Python is faster with plain numbers
            coefficients, inverse = coefficients.tolist(), inverse.tolist()
        turn, limit, slope, offset = self.turn, self.rate_limit, self.slope, self.offset

        def rates(t, x):
            moved = limit * (t - turn)
            ramp = slope * t + offset
            rudder = 0.0 if moved < 0 else min(moved, ramp) if ramp > 0 else max(-moved, ramp)
            return self.rate(t, x, rudder, RPM, coefficients, inverse)

        return solve_ivp(rates, (0.0, self.t[-1]), x0, t_eval=self.t, rtol=1e-6, atol=1e-8).y.T

    def log_prob(self, z: np.ndarray) -> float:
        states = self.track(z)
        picked = [self.model.states.index(c) for c in self.run.channels]
        resid = self.run.residuals(states[:, picked].copy())
        return float(-0.5 * np.sum(resid**2) - 0.5 * np.sum(self.density.problem.prior(z)[0] ** 2))


def by_slopes(density: TrialDensity) -> Posterior | None:
    """The same posterior by NUTS; None without nutpie."""
    if importlib.util.find_spec("nutpie") is None:
        return None
    from bayesid.estimation.sampling.nuts import NutsOptions, sample_nuts
    from bayesid.estimation.sampling.trial_gradient import GradientTrialDensity

    few = NutsOptions(tune=200, draws=500, accept=0.9, seed=1)
    return sample_nuts(GradientTrialDensity(density), density.laplace, few)


def main() -> None:
    print(machine())
    density = case2()
    laplace = density.laplace
    ours = sample(density, laplace, SamplerOptions(seed=1))
    plain = SamplerOptions(seed=1, weights={"stretch": 1.0}, max_steps=BASELINE_STEPS, limits=NEVER)
    stretch = sample(density, laplace, plain)
    per_call = float(stretch.convergence.ess_bulk.min()) / stretch.counts["all"]
    row("sampler, likelihood", "state", "tau [steps]", "evaluations", "ms each", "least ESS", "ESS / CPU s")
    row(*["---"] * 7)
    passed = "passed" if ours.converged else "not passed"
    row("bayesid", passed, f"{ours.convergence.tau.max():.0f}", ours.counts["all"],
        f"{1e3 * ours.seconds / ours.counts['all']:.3f}", f"{ours.convergence.ess_bulk.min():.0f}",
        f"{ours.ess_per_second:.0f}")  # fmt: skip
    slopes = by_slopes(density)
    if slopes is not None:
        row("bayesid, NUTS", "passed" if slopes.converged else "not passed",
            f"{slopes.convergence.tau.max():.0f}", "", "", f"{slopes.convergence.ess_bulk.min():.0f}",
            f"{slopes.ess_per_second:.0f}")  # fmt: skip
    points = ours.subset(EVALUATIONS, np.random.default_rng(0))
    mine = density.log_prob(points)
    for words, rate in (("Python", right_side), ("numba", _compiled)):
        scipy = ByScipy(density, rate)
        scipy.log_prob(points[0])
        begin = time.process_time()
        other = np.array([scipy.log_prob(p) for p in points])
        seconds = (time.process_time() - begin) / EVALUATIONS
        apart = np.abs((other - other[0]) - (mine - mine[0])).max()
        row(f"emcee, stretch, solve_ivp ({words}); log densities apart by {apart:.2g}",
            f"at {stretch.convergence.n_tau:.0f} tau", f"{stretch.convergence.tau.max():.0f}", "",
            f"{1e3 * seconds:.1f}",
            "", f"{per_call / seconds:.3f}")  # fmt: skip
        row(f"ratio of ESS per CPU second, bayesid / emcee with solve_ivp ({words})", "", "", "", "", "",
            f"{ours.ess_per_second * seconds / per_call:.0f}")  # fmt: skip
        if slopes is not None:
            row(f"the same of NUTS ({words})", "", "", "", "", "",
                f"{slopes.ess_per_second * seconds / per_call:.0f}")  # fmt: skip
    moves = ours.convergence.ess_bulk.min() / ours.counts["all"] / per_call
    row("of that, by the moves: ESS per evaluation", "", "", "", "", "", f"{moves:.1f}")
    track = simulate(density.problem.model, density.problem.split(points[0])[0], density.problem.runs[0].plan,
                     density.problem.split(points[0])[1][0]).states  # fmt: skip
    distance = np.hypot(*(ByScipy(density, right_side).track(points[0]) - track)[:, :2].T).max()
    row("tracks apart at most [m]", "", "", "", "", "", f"{distance:.2g}")


if __name__ == "__main__":
    main()
