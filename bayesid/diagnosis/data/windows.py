"""How well short pieces of the runs are predicted: chi-square of every window of 6 L/U on its own.

Takes linearised paths. Gives one `Window` per piece. Each starts from a state of its own and keeps the
coefficients free within their prior, so that what happens in one window is not charged to another. Does not
decide what a bad window means (see `event_search`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import LatentInputs, NoiseModel
from bayesid.estimation.filter_error.normal_equations import run_equations
from bayesid.estimation.filter_error.parameter_slopes import HeldSlopes
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array, RunData

WINDOW_LENGTHS = 6.0  # L/U


@dataclass(frozen=True)
class Window:
    """One piece of one run.

    Attributes
    ----------
    run : position of the run
    first, last : its samples, `last` exclusive
    chi2 : squared misfit of its readings under everything the model leaves open
    used : number of readings
    """

    run: int
    first: int
    last: int
    chi2: float
    used: int

    @property
    def ratio(self) -> float:
        """Misfit per reading; 1 where the model and its environment are right."""
        return self.chi2 / max(self.used, 1)


def windows(
    model: Model,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    length: float = WINDOW_LENGTHS,
) -> list[Window]:
    """Windows of all runs, each overlapping half of the next.

    Parameters
    ----------
    free : integrated out under its prior within each window; `NOTHING` to judge the paths' own parameters
    length : of a window [L/U]
    """
    span = length * model.scales["L"] / model.scales["U"]
    out = []
    for k, path in enumerate(paths):
        t = path.log.plan.t
        for begin in np.arange(t[0], max(t[-1] - 0.75 * span, t[0] + 1e-9), 0.5 * span):
            first, last = (int(i) for i in np.searchsorted(t, (begin, begin + span)))
            if last - first < 3 or path.log.valid[first:last].sum() < 6:
                continue
            piece = cut(path, first, last)
            g = window_equations(model, piece, free, noise_model)
            post = posterior(g)
            out.append(Window(k, first, last, g.ee - float(g.se @ post.mean), g.used))
    return out


def window_equations(
    model: Model,
    path: Linearisation,
    free: GaussianPrior,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
):
    """Whitened products of one path, its parameters at the prior mean of `free`."""
    return run_equations(model, path, free, noise_model, latent)


def cut(path: Linearisation, first: int, last: int) -> Linearisation:
    """Samples first to last - 1 of a path, as a run of its own; its plan keeps the times only.

    It starts about the path's own state there, not about the guess for the run's first sample.
    """
    s, steps = slice(first, last), slice(first, last - 1)
    p = path.point
    direct, psi = path.by_parameter.part(first, last)
    return replace(
        path,
        log=replace(cut_log(path.log, first, last), x0=p.states[first]),
        point=replace(p, states=p.states[s], force=p.force[steps]),
        resid=path.resid[s],
        slope=path.slope[s],
        by_parameter=HeldSlopes(direct, psi[: last - 1 - first]),
        phi=path.phi[steps],
        gamma=path.gamma[steps],
        defect=path.defect[steps],
    )


def cut_log(log: RunData, first: int, last: int) -> RunData:
    """Samples first to last - 1 of a log; the plan keeps its times only, enough for a filter."""
    s = slice(first, last)
    plan = replace(log.plan, t=log.plan.t[s])
    jumps = None if log.jumps is None else log.jumps[first : last - 1]
    return replace(log, plan=plan, readings=log.readings[s], path=log.path[s], jumps=jumps)


def ratios(found: Sequence[Window]) -> Array:
    return np.array([w.ratio for w in found])
