"""The sampler's word on a few posteriors: emcee beside the Laplace refit and the prediction from information.

Takes a `PlanningCase`, manoeuvres and a true vehicle. Gives contractions three ways. Minutes of computing,
so only a sub-sample of what `refit` does by the hundred.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.criteria import contraction
from bayesid.analysis.design.virtual_refit import logged, problem_of, refit
from bayesid.estimation.sampling import SamplerOptions, SamplingSettings, sample, trial_density
from bayesid.manoeuvres import Manoeuvre

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SampledCheck:
    """Contraction of every coefficient (k,): expected, at the refit, sampled.

    converged, reasons : the convergence check of the sampler
    evaluations : of the density
    """

    names: tuple[str, ...]
    expected: Array
    refitted: Array
    sampled: Array
    converged: bool
    reasons: tuple[str, ...]
    evaluations: int


def sampled(
    case: PlanningCase,
    manoeuvres: Sequence[Manoeuvre],
    par: Array,
    draws: Array,
    seed: int,
    steps: int,
    watch: Callable[[], None] = lambda: None,
) -> SampledCheck:
    """Run manoeuvres with a true vehicle, refit, and sample the posterior with the noise known.

    Parameters
    ----------
    draws : vehicles over which the prediction is averaged
    steps : at most this many per chain

    Raises
    ------
    ModelError, SampleError
        if the vehicle diverges
    """
    known = case.knowledge
    rng = np.random.default_rng([seed, 7])
    runs = [logged(case.model, par, case.execution(m, par), rng) for m in manoeuvres]
    problem = problem_of(case.model, known, runs)
    found = refit(problem, known)
    settings = SamplingSettings(noise="fixed", initial="marginal", memory="ignore")
    density = trial_density(problem, found.unknowns, settings)
    chain = sample(density, density.laplace, SamplerOptions(ensembles=2, max_steps=steps, seed=seed))
    k = len(known.names)
    matrices = sum(case.of(m, draws).matrices for m in manoeuvres)
    watch()
    return SampledCheck(
        known.names, np.mean(contraction(known, np.asarray(matrices)), axis=0), found.contraction(known),
        1.0 - chain.sd[:k] / known.sd, bool(chain.converged), tuple(chain.convergence.reasons),
        int(chain.counts["all"]),
    )  # fmt: skip
