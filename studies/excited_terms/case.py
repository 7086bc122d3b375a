"""One case: a vehicle whose coefficients are known here, executed, smoothed and judged by four methods.

Takes names of vehicle, manoeuvres and truth. Gives plain rows, one per column of the library. Does not count.
"""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.analysis.excitation import library
from bayesid.analysis.excitation.columns import rows
from bayesid.analysis.excitation.pysindy_regression import pysindy_terms
from bayesid.analysis.excitation.regression import excite_motions
from bayesid.analysis.excitation.row_selection import Roots, block_noise
from bayesid.analysis.excitation.sindy import ensemble
from bayesid.analysis.excitation.track_smoother import smooth_tracks
from bayesid.api.excite import fisher_shares
from bayesid.equations.model import Model, build_model
from bayesid.manoeuvres import library as manoeuvre_library
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_run
from bayesid.trials import Trial

# Sensor noise over L, L, 1, U/L, U, U at 19 readings per L/U: navigation grade; `NOISE` of it is taken.
SIGMA = {"x": 0.0127, "y": 0.0127, "psi": 0.0075, "r": 0.0139, "u": 0.0018, "v": 0.0018}
NOISE, SPREAD = 0.3, 0.2
# Rows of second order that the truth "fewer" does not have; half of them at random.
MAY_LACK = ("vv", "vr", "rr", "v|v|", "v|r|", "|v|r", "r|r|", "|r|dr")


def executed_case(vehicle: str, names: tuple[str, ...], truth: str, seed: int, draws: int) -> dict[str, Any]:
    """Judge one case.

    Parameters
    ----------
    truth : "as_built" (coefficients within 20 % of the file), "fewer" (some of second order absent) or
        "cubic" (a term the file lacks acts)
    """
    model = build_model(load_vehicle(vehicle), 3)
    rng = np.random.default_rng(seed)
    values = true_values(model, truth, rng)
    par = model.with_values(values)
    s = model.scales
    unit = {"x": s["L"], "y": s["L"], "psi": 1.0, "r": s["U"] / s["L"], "u": s["U"], "v": s["U"]}
    noise = {c: NOISE * SIGMA[c] * unit[c] for c in SIGMA}
    limit, rpm = min(0.35, model.vehicle.limits["delta_r"]), float(model.vehicle.rpm_ref or 0.0)
    orders = manoeuvre_library(s["L"], s["U"], rpm, limit, dt=0.053 * s["L"] / s["U"])
    runs = [virtual_run(model, par, orders[n], name=n, noise=noise, rng=rng) for n in names]
    motions, _ = smooth_tracks(model, runs, noise)
    begin = time.process_time()
    groups = pysindy_terms(model, motions, draws=draws, seed=seed)
    middle = time.process_time()
    own = {w.name: w.status for w in excite_motions(model, motions, draws=draws, seed=seed).terms}
    end = time.process_time()
    plain: dict[str, float] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for axis in ("X", "Y", "Z", "K", "M", "N"):
            if any(g.axis == axis for g in groups):
                plain |= ensemble(model, motions, library(model), axis, 0.05, draws, seed=seed)
    shows = oracle(model, motions, par)
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
    return {"vehicle": vehicle, "runs": list(names), "truth": truth, "terms": found, "seconds": seconds}


def true_values(model: Model, truth: str, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients [SI] that differ from the file: all of them, but accelerations and propulsion."""
    values = {}
    for column in library(model, extra=False):
        if not column.in_model or "prop" in column.name:
            continue
        value = column.nominal * (1 + SPREAD * rng.standard_normal())
        lacking = truth == "fewer" and column.name[2:] in MAY_LACK and rng.uniform() < 0.5
        values[column.name] = 0.0 if lacking else value
    if truth == "cubic":
        s = model.scales
        values["Y_vvv"] = -9.0 * s["rho"] * s["L"] ** 2 / (2 * s["U"])
    return values


def oracle(model: Model, motions: Any, par: np.ndarray) -> dict[str, float]:
    """Nats by which a term that acts shows to who knows which others act: Fisher information of the "
    "balance."""
    data = rows(model, motions, library(model), "weak")
    out = {}
    for axis in data.axes:
        where = [
            k for k, c in enumerate(data.columns)
            if c.axis == axis and c.name in model.index and par[model.index[c.name]] != 0.0
        ]  # fmt: skip
        size = np.sqrt(np.mean(data.theta[:, where] ** 2, axis=0))
        where = [k for k, s in zip(where, size, strict=True) if s > 1e-12]
        size = size[size > 1e-12]
        target = data.target[:, data.axes.index(axis)]
        roots = Roots(data.theta[:, where] / size, target, data.weight, data.block)
        variance, _ = block_noise(roots, list(range(len(where))), 0.0)
        root = roots.total(np.ones(roots.blocks))[:, :-1]
        inverse = np.linalg.pinv(root.T @ root)
        for i, k in enumerate(where):
            name = data.columns[k].name
            step = par[model.index[name]] * size[i]
            out[name] = float(step**2 / max(variance * inverse[i, i], 1e-300) / 2)
    return out
