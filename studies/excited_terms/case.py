"""One case: a vehicle whose coefficients are known here, executed, smoothed and judged by four methods.

Takes names of vehicle, manoeuvres and truth. Gives plain rows, one per column of the library. Does not count.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.excitation import library
from bayesid.analysis.excitation.columns import Rows, rows
from bayesid.analysis.excitation.power import NEIGHBOURS
from bayesid.analysis.excitation.pysindy_regression import terms_of_rows
from bayesid.analysis.excitation.row_selection import Roots, block_noise, select_axis
from bayesid.analysis.excitation.sindy import ensemble
from bayesid.analysis.excitation.track_smoother import smooth_tracks
from bayesid.api.excite import fisher_shares
from bayesid.equations.layout import rows_of
from bayesid.equations.model import Model, build_model
from bayesid.errors import BayesidError
from bayesid.manoeuvres import library as manoeuvre_library
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Trial

# Sensor noise over L, L, 1, U/L, U, U at 19 readings per L/U: navigation grade; `NOISE` of it is taken.
SIGMA = {"x": 0.0127, "y": 0.0127, "psi": 0.0075, "r": 0.0139, "u": 0.0018, "v": 0.0018}
NOISE, SPREAD, INERTIA_SPREAD = 0.3, 0.2, 0.1
# Rows of second order that the truths "fewer" (half of them, at random) and "linear" (all) do not have.
MAY_LACK = ("vv", "vr", "rr", "v|v|", "v|r|", "|v|r", "r|r|", "|r|dr", "drdr", "vdr", "rdr")
TRUTHS = ("as_built", "fewer", "linear", "cubic", "other_inertia")
MOST_DRAWN = 20  # vehicles drawn until one stays on its feet


def executed_case(vehicle: str, names: tuple[str, ...], truth: str, seed: int, draws: int) -> dict[str, Any]:
    """Judge one case.

    Parameters
    ----------
    truth : "as_built" (coefficients within 20 % of the file), "fewer" (half of the rows of second order
        absent), "linear" (all of them), "cubic" (a term the file lacks acts) or "other_inertia" (the
        acceleration derivatives, which the regression takes from the file, differ by 10 %)
    """
    model = build_model(load_vehicle(vehicle), 3)
    rng = np.random.default_rng(seed)
    s = model.scales
    unit = {"x": s["L"], "y": s["L"], "psi": 1.0, "r": s["U"] / s["L"], "u": s["U"], "v": s["U"]}
    noise = {c: NOISE * SIGMA[c] * unit[c] for c in SIGMA}
    limit, rpm = min(0.35, model.vehicle.limits["delta_r"]), float(model.vehicle.rpm_ref or 0.0)
    orders = manoeuvre_library(s["L"], s["U"], rpm, limit, dt=0.053 * s["L"] / s["U"])
    for drawn in range(1, MOST_DRAWN + 1):
        par = model.with_values(true_values(model, truth, rng))
        try:
            runs = [virtual_run(model, par, orders[n], name=n, noise=noise, rng=rng) for n in names]
            break
        except BayesidError:
            if drawn == MOST_DRAWN:
                raise
    motions, _ = smooth_tracks(model, runs, noise)
    data = rows(model, motions, library(model), "weak")
    begin = time.process_time()
    groups = terms_of_rows(model, data, draws=draws, seed=seed)
    middle = time.process_time()
    own_rng = np.random.default_rng(seed)
    own = {w.name: w.status for a in data.axes for w in select_axis(data, a, draws, own_rng).selections}
    end = time.process_time()
    plain: dict[str, float] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for axis in ("X", "Y", "Z", "K", "M", "N"):
            if any(g.axis == axis for g in groups):
                plain |= ensemble(model, motions, library(model), axis, 0.05, draws, seed=seed)
    clean = [virtual_run(model, par, orders[n], name=n) for n in names]
    exact = rows(model, smooth_tracks(model, clean, noise)[0], library(model), "weak")
    shows = oracle(model, exact, data, par)
    noise_only: list[str] = []
    if truth == "as_built":
        empty = terms_of_rows(model, white_force(data, rng), draws=draws, seed=seed)
        noise_only = [g.status for g in empty for _ in g.names]
    shares = fisher_shares(model, Trial("case", Path(), vehicle, 3, tuple(runs), noise))
    found = [
        {
            "name": n, "acts": bool(n in model.index and par[model.index[n]] != 0.0),
            "shows": shows.get(n, 0.0),
            "pysindy": g.status, "group": list(g.names), "inclusion": g.inclusion, "margin": g.margin,
            "value": g.value if np.isfinite(g.value) else None, "sd": g.sd if np.isfinite(g.sd) else None,
            "true": float(par[model.index[n]]) if n in model.index else 0.0,
            "stepwise": own[n], "plain": plain.get(n, 0.0), "fisher": shares.get(n, (None, ""))[0],
        }
        for g in groups
        for n in g.names
    ]  # fmt: skip
    seconds = {"pysindy": middle - begin, "stepwise": end - middle}
    return {
        "vehicle": vehicle, "runs": list(names), "truth": truth, "seed": seed, "vehicles_drawn": drawn,
        "terms": found, "white_force": noise_only, "seconds": seconds,
    }  # fmt: skip


def white_force(data: Rows, rng: np.random.Generator) -> Rows:
    """The rows with a force of the same rms that has nothing to do with the motion: nothing is needed."""
    white = rng.standard_normal((len(data.target) + NEIGHBOURS - 1, data.target.shape[1]))
    total = np.vstack([np.zeros(white.shape[1]), np.cumsum(white, axis=0)])
    smooth = (total[NEIGHBOURS:] - total[:-NEIGHBOURS]) / np.sqrt(NEIGHBOURS)
    return replace(data, target=smooth * np.sqrt(np.mean(data.target**2, axis=0)))


def true_values(model: Model, truth: str, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients [SI] that differ from the file: all but propulsion, accelerations in one truth only."""
    values = {}
    for column in library(model, extra=False):
        if not column.in_model or "prop" in column.name:
            continue
        value = column.nominal * (1 + SPREAD * rng.standard_normal())
        second = column.name[2:] in MAY_LACK
        lacking = second and (truth == "linear" or (truth == "fewer" and rng.uniform() < 0.5))
        values[column.name] = 0.0 if lacking else value
    if truth == "other_inertia":
        for row in rows_of(model.kernel.spec):
            if row.is_inertia and (nominal := float(model.nominal[model.index[row.name]])):
                values[row.name] = nominal * (1 + INERTIA_SPREAD * rng.standard_normal())
    if truth == "cubic":
        s = model.scales
        values["Y_vvv"] = -9.0 * s["rho"] * s["L"] ** 2 / (2 * s["U"])
    return values


def oracle(model: Model, exact: Rows, data: Rows, par: np.ndarray) -> dict[str, float]:
    """Nats by which a term that acts shows to who knows which others act: Fisher information of the balance.

    Columns are those of the run without noise, for a column of noise alone has information too; the variance
    is that of the rows with noise.
    """
    out = {}
    for axis in data.axes:
        where = [
            k for k, c in enumerate(data.columns)
            if c.axis == axis and c.name in model.index and par[model.index[c.name]] != 0.0
        ]  # fmt: skip
        size = np.sqrt(np.mean(exact.theta[:, where] ** 2, axis=0))
        where = [k for k, s in zip(where, size, strict=True) if s > 1e-12]
        size = size[size > 1e-12]
        target = data.target[:, data.axes.index(axis)]
        noisy = Roots(data.theta[:, where] / size, target, data.weight, data.block)
        variance, _ = block_noise(noisy, list(range(len(where))), 0.0)
        root = np.sqrt(exact.weight / exact.weight.mean())[:, None] * exact.theta[:, where] / size
        for i, k in enumerate(where):
            x, others = root[:, i], np.delete(root, i, axis=1)
            alone = x - others @ np.linalg.lstsq(others, x, rcond=None)[0] if len(where) > 1 else x
            name = data.columns[k].name
            force = par[model.index[name]] * size[i]
            out[name] = float(force**2 * (alone @ alone) / (2 * max(variance, 1e-300)))
    return out
