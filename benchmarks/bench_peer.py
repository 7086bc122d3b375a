"""How does a fit compare with a general toolbox (PINTS) on the same problem?

The paper's Case 2: nine unknown coefficients of the generic submarine from one spiral, starts wrong by up to
10 %, bounds 25 % around the truth, no noise. Everybody minimises the same cost with the same simulator from
the same start until the cost has fallen by 1e-10. The last column prices the same number of evaluations with
`solve_ivp` (RK45, 1e-6, numba right side; measured per run, not rerun). Needs `pip install bayesid[bench]`.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from bench_scipy import _compiled, integrate
from setting import machine, row, setting

from bayesid.equations.model import build_model
from bayesid.estimation.output_error import FitOptions, fit
from bayesid.estimation.output_error.simulated_recovery import RecoveryCase, draw, make_target, problem_of
from bayesid.manoeuvres import spiral
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import steady_start

KNOWN = ("X_vv", "Y_v", "Y_v|v|", "N_v", "N_v|v|", "X_drdr", "Y_dr", "N_dr")
KNOWN += ("X_udot", "Y_vdot", "Y_rdot", "N_vdot", "N_rdot")
FALL, CAP = 1e-10, 20_000


try:
    import pints
except ImportError:
    print("bench_peer needs PINTS: pip install 'bayesid[bench]'")
    sys.exit(0)


class Cost(pints.ErrorMeasure):
    """The fit's cost in units of the scales, with gradient."""

    def __init__(self, problem) -> None:
        self.problem, self.scale, self.calls = problem, problem.scale, 0

    def n_parameters(self) -> int:
        return self.scale.size

    def __call__(self, p) -> float:
        self.calls += 1
        return self.problem.cost(np.asarray(p) * self.scale)

    def evaluateS1(self, p):
        self.calls += 1
        value, slope = self.problem.cost_gradient(np.asarray(p) * self.scale)
        return value, slope * self.scale


def main() -> None:
    print(machine())
    row("search", "cost / first cost", "evaluations", "CPU [s]", "worst error [%]", "with solve_ivp [s]")
    row(*["---"] * 6)
    model = build_model(load_vehicle("generic_sub"), 3)
    unknown = tuple(n for n in model.coefficients if n not in KNOWN)
    target = make_target(model, "spiral", spiral(90.0, dt=0.5), steady_start(model, 90.0))
    case = RecoveryCase("2a", "", unknown)
    params, base = draw(model, case, seed=0)
    problem = problem_of(model, params, base, [target])
    truth = model.nominal[model.positions(unknown)]
    first = problem.cost(problem.start)
    problem.cost_gradient(problem.start)
    problem.jacobian(problem.start)
    s = setting(3)
    integrate(s, _compiled, "RK45")
    begin = time.process_time()
    integrate(s, _compiled, "RK45")
    per_run = (time.process_time() - begin) * target.plan.t[-1] / (s.plan.t[-1] - s.plan.t[0])

    def report(name: str, z: np.ndarray, calls: int, seconds: float) -> None:
        worst = 100 * np.abs(z / truth - 1).max()
        row(
            name,
            f"{problem.cost(z) / first:.1e}",
            calls,
            f"{seconds:.2f}",
            f"{worst:.2g}",
            f"{calls * per_run:.0f}",
        )

    begin = time.process_time()
    found = fit(problem, FitOptions(goal=FALL * first))
    report("bayesid, SLSQP", found.z, found.n_cost + found.n_gradient, time.process_time() - begin)
    low, high = problem.low / problem.scale, problem.high / problem.scale
    for method in (pints.CMAES, pints.XNES, pints.IRPropMin, pints.NelderMead):
        cost = Cost(problem)
        np.random.seed(0)  # noqa: NPY002 - PINTS draws from it
        start = problem.start / problem.scale
        walls = pints.RectangularBoundaries(np.minimum(low, high), np.maximum(low, high))
        search = pints.OptimisationController(
            cost, start, 0.05, None if method is pints.NelderMead else walls, method=method
        )
        search.set_log_to_screen(False)
        search.set_threshold(FALL * first)
        search.set_max_iterations(None)
        search.set_max_evaluations(CAP)
        begin = time.process_time()
        best, _ = search.run()
        report(f"PINTS {pints.__version__}, {method.__name__}", best * problem.scale, cost.calls,
               time.process_time() - begin)  # fmt: skip


if __name__ == "__main__":
    main()
