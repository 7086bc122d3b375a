"""A second opinion on what a manoeuvre excites: how often sparse regression on the motion alone keeps a row.

Takes a `PlanningCase` and manoeuvres. Gives the inclusion frequency of every coefficient, from virtual logs
with the noise of the case. Knows no prior and no posterior: `bayesid.analysis.excitation` is a sparse
regression, not a verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from bayesid.analysis.design.compare import PlanningCase
from bayesid.analysis.design.information import laid_out
from bayesid.analysis.excitation import excite
from bayesid.errors import BayesidError
from bayesid.manoeuvres import Manoeuvre
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Run

Array = np.ndarray


def inclusion(
    case: PlanningCase,
    manoeuvres: Mapping[str, Manoeuvre],
    par: Array,
    seed: int,
    draws: int = 100,
    watch: Callable[[str], None] = lambda name: None,
) -> dict[str, Array]:
    """(k,) inclusion frequency of every coefficient per manoeuvre; nan for a row that is not searched.

    A manoeuvre whose log does not let the regression work is left out.

    Parameters
    ----------
    par : (n,) vehicle that runs
    draws : bootstrap samples of the regression
    """
    found = {}
    names = case.knowledge.names
    for k, (name, manoeuvre) in enumerate(manoeuvres.items()):
        rng = np.random.default_rng([seed, k])
        try:
            run = _logged(case, par, manoeuvre, name, rng)
            seen = excite(case.model, [run], case.logging.sigma, draws=draws, seed=seed)
        except BayesidError:
            continue
        finally:
            watch(name)
        found[name] = np.array([seen.inclusion.get(n, np.nan) for n in names])
    return found


def _logged(case: PlanningCase, par: Array, manoeuvre: Manoeuvre, name: str, rng: np.random.Generator) -> Run:
    """The log of a manoeuvre, its channels with white noise as stated or with errors of the campaign."""
    sigma = dict(case.logging.sigma)
    if case.noise is None:
        return virtual_run(case.model, par, manoeuvre, name=name, noise=sigma, rng=rng)
    run = virtual_run(case.model, par, manoeuvre, name=name)
    dt = float(np.median(np.diff(run.t)))
    start = np.zeros(len(case.model.states))
    planned = laid_out(case.model, run.t, run.commands, start, replace(case.logging, dt=dt), name)
    errors = case.noise.errors(planned, dt, rng)
    data = {c: run.data[c] + s * e for (c, s), e in zip(sigma.items(), errors.T, strict=True)}
    return replace(run, data={**run.data, **data})
