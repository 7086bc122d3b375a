"""How plainly the causes of a campaign change its readings, open loop and after every start was fitted.

Takes: a campaign and its runs. Gives sums of squares over noise: whole runs, and pieces of ten lengths whose
start state is fitted, as the labels of `practice_foreign` state them. Knows nothing of any model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bayesid.benchmark.other_equations.campaign import Campaign, Executed
from bayesid.benchmark.other_equations.causes import settings_of
from bayesid.benchmark.other_equations.simulate import CHANNELS, Record, carried, readings, simulate_run
from bayesid.benchmark.other_equations.vehicles import OtherVehicle

Array = np.ndarray
FITTED = (0, 1, 5, 6, 7, 11)  # x y psi u v r of a start state
PIECE, SHORTEST = 10.0, 12.0  # L/U and s
ROUNDS = 4


def piece_seconds(vehicle: OtherVehicle) -> float:
    """Length of a piece [s]."""
    return max(PIECE * vehicle.LU, SHORTEST)


def pieces(vehicle: OtherVehicle, t: Array) -> list[slice]:
    """Samples of the pieces of a run; neighbours share an end."""
    span = float(t[-1] - t[0])
    edges = np.linspace(0, t.size - 1, max(1, round(span / piece_seconds(vehicle))) + 1).round().astype(int)
    return [slice(a, b + 1) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def evidence(campaign: Campaign, runs: Sequence[Executed], known: Sequence[str] = ()) -> dict[str, float]:
    """D, D_pieces of the causes on the runs to identify from.

    Parameters
    ----------
    known : causes that the reference has too; what the others add is stated
    """
    c, total, apart = campaign, 0.0, 0.0
    g0 = settings_of([p for p in c.planted if p.name in known])
    sd = np.array([c.sigma.get(name, np.inf) for name in CHANNELS])
    for run in runs:
        if run.plan.role != "identify":
            continue
        there = simulate_run(c.vehicle, c.settings, run.record.t, run.record.orders, run.record.states[0])
        truth = readings(c.settings, there.fine, there.states, there.parts)
        bare = simulate_run(c.vehicle, g0, run.record.t, run.record.orders, run.record.states[0])
        total += float(np.sum(((readings(g0, bare.fine, bare.states, bare.parts) - truth) / sd) ** 2))
        for piece in pieces(c.vehicle, run.record.t):
            apart += _piece(c.vehicle, g0, bare, there, piece, truth, sd)
    return {"D": total, "D_pieces": apart}


def _piece(
    v: OtherVehicle, g: np.void, bare: Record, there: Record, piece: slice, truth: Array, sd: Array
) -> float:  # fmt: skip
    fine = slice(piece.start * bare.parts, (piece.stop - 1) * bare.parts + 1)
    t, h = bare.fine[fine], bare.fine[1] - bare.fine[0]

    def model(start: Array) -> Array:
        x = there.states[fine.start].copy()
        x[list(FITTED)] += start
        states = carried(v, g, float(t[0]), x, bare.rudder[fine], bare.shaft[fine], h)
        return readings(g, t, states, bare.parts) / sd

    scale = np.array([0.1 * v.L, 0.1 * v.L, 0.02, 0.02 * v.U, 0.02 * v.U, 0.02 / v.LU])
    wanted = truth[piece] / sd
    return float(np.sum((model(fitted_start(model, wanted, scale)) - wanted) ** 2))


def fitted_start(model: Callable[[Array], Array], wanted: Array, scale: Array) -> Array:
    """Change of a start state for which the sum of squares of model - wanted is least.

    Gauss-Newton; slopes by differences of 1e-3 of a scale, a step halved while it does not gain.

    Parameters
    ----------
    scale : (k,) size of a change that matters, of every state
    """
    at = np.zeros(scale.size)
    resid = (model(at) - wanted).ravel()
    for _ in range(ROUNDS):
        slopes = [(model(at + 1e-3 * e) - wanted).ravel() - resid for e in np.diag(scale)]
        way = np.linalg.lstsq(np.stack(slopes, axis=1), -resid, rcond=None)[0] * 1e-3 * scale
        for halved in range(5):
            new = (model(at + way / 2**halved) - wanted).ravel()
            if new @ new < resid @ resid:
                break
        else:
            break
        gain = resid @ resid - new @ new
        at, resid = at + way / 2**halved, new
        if gain < 1e-3 * (new @ new):
            break
    return at
