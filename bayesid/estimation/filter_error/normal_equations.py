"""Whitened products of the columns of free parameters, run by run.

Takes paths. Knows neither the fit nor which parameter is a coefficient and which belongs to an effect.

A run of one block is whitened as a whole. A longer one is whitened and multiplied block by block, its slopes
held or made anew: memory does not grow with its length, and the same products are summed in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error import parameter_slopes
from bayesid.estimation.filter_error.evidence import NormalEquations, normal_equations
from bayesid.estimation.filter_error.kalman import whiten_on
from bayesid.estimation.filter_error.kalman_step import opening
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.noise_model import (
    LatentInputs,
    NoiseModel,
    active_inputs,
    filter_settings,
    whitened,
)
from bayesid.estimation.filter_error.parameter_slopes import blocks
from bayesid.estimation.filter_error.regressor_columns import known_part
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array
from bayesid.threads import each


def stacked_equations(
    model: Model, paths: Sequence[Linearisation], free: GaussianPrior, noise_model: NoiseModel
) -> list[NormalEquations]:
    """Whitened normal matrix of every run, residual relative to the prior mean, columns per prior sd."""
    return each_run(model, paths, free, noise_model)


def of_all_runs(equations: Sequence[NormalEquations], free: GaussianPrior) -> NormalEquations:
    """Products of all runs, with what is known of the parameters together beyond what each is."""
    total = sum(equations[1:], equations[0])
    if free.together is None:
        return total
    more = np.linalg.slogdet(np.eye(len(free.names)) + free.together)[1]
    return total + NormalEquations(free.together, np.zeros(len(free.names)), 0.0, -float(more), 0)


def each_run(
    model: Model,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
) -> list[NormalEquations]:
    """`run_equations` of every run, with a generic latent signal where one is given."""
    return each(
        lambda path, k: run_equations(model, path, free, noise_model, latent, k), paths, range(len(paths))
    )


def run_equations(
    model: Model,
    path: Linearisation,
    free: GaussianPrior,
    noise_model: NoiseModel,
    latent: LatentInputs | None = None,
    run: int = 0,
    extra: tuple[Array, Array] | None = None,
) -> NormalEquations:
    """The same of one run.

    Parameters
    ----------
    latent, run, extra : as in `whitened`
    """
    step = free.mean - path.point.par[free.where]
    if path.log.n <= parameter_slopes.BLOCK:
        w = whitened(model, path, step, free.sd, noise_model, latent, run, extra)
        return normal_equations(w.resid, w.columns, w.logdet, w.used)
    f, _ = active_inputs(filter_settings(model, path, noise_model, latent, run))
    first = path.log.x0 - path.point.states[0]
    (n, q), nx, p = path.resid.shape, first.size, free.sd.size
    c = 1 + p + (extra[0].shape[2] if extra is not None else 0)
    firsts = np.zeros((nx, c))
    firsts[:, 0] = first
    joint = opening(firsts, f.start, f.variance_f, f.variance_d)
    products, logdet, used = np.zeros((c, c)), 0.0, 0
    for a, b in blocks(n):
        direct, psi = path.by_parameter.part(a, b)
        resid, drive = known_part(path, step, a, b, (direct, psi))
        columns, drives = np.empty((b - a, q, c)), np.empty((psi.shape[0], nx, c))
        columns[:, :, 0], drives[:, :, 0] = resid, drive
        np.multiply(direct, free.sd, out=columns[:, :, 1 : 1 + p])
        np.multiply(psi, -free.sd, out=drives[:, :, 1 : 1 + p])
        if extra is not None:
            columns[:, :, 1 + p :] = extra[0][a:b]
            np.negative(extra[1][a:b], out=drives[:, :, 1 + p :])
        out = np.empty(((b - a) * q, c))
        more, count = whiten_on(
            joint, columns, drives, path.log.valid[a:b], path.slope[a:b], f.variance, path.phi[a:b],
            f.gamma[a:b], f.decay_f[a:b], f.variance_f, f.drift, f.decay_d[a:b], f.variance_d, out,
        )  # fmt: skip
        products += out.T @ out
        logdet, used = logdet + more, used + count
    return NormalEquations(products[1:, 1:], products[1:, 0], float(products[0, 0]), logdet, used)
