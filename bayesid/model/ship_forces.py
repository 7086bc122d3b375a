"""Propeller and rudder of a ship by the formulas of the MMG table, evaluated with numpy.

Takes: numbers of the ship, its motion through the water, rudder and revolutions. Gives forces.
Does not: simulate; kernels print the same formulas (`bayesid.equations`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayesid.model.terms.mmg import DEFINITIONS, FORCES, NUMBERS, SPEED

_FUNCTIONS = {
    "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "exp": np.exp, "atan": np.arctan, "abs": np.abs,
    "min": np.minimum, "max": np.maximum, "step": lambda x: (np.asarray(x) > 0.0) * 1.0,
}  # fmt: skip
_COMPILED = {
    name: compile(text, f"<{name}>", "eval")
    for name, text in {
        "U": SPEED,
        **DEFINITIONS,
        **{f"{p} {a}": t for (p, a), (t, _) in FORCES.items()},
    }.items()
}


def ship_forces(
    values: Mapping[str, Any],
    u: ArrayLike,
    v: ArrayLike = 0.0,
    r: ArrayLike = 0.0,
    delta_r: ArrayLike = 0.0,
    n: ArrayLike = 0.0,
) -> dict[str, np.ndarray]:
    """Every formula of the module at some motions, by name; forces [N] and moments [N m] as "rudder N".

    Parameters
    ----------
    values : rho, L, U_ref, D_P, H_R, A_R, x_R and numbers; a number that is missing is 0
    u, v, r, delta_r, n : through the water [m/s, rad/s], rudder to port [rad], shaft [rpm]
    """
    motion = dict(zip("uvr", np.broadcast_arrays(*(np.asarray(x, float) for x in (u, v, r))), strict=True))
    known = {**dict.fromkeys(NUMBERS, 0.0), **values, **motion}
    known |= {"delta_r": np.asarray(delta_r, float), "n": np.asarray(n, float)}
    for name, code in _COMPILED.items():
        known[name] = eval(code, {"__builtins__": {}, **_FUNCTIONS}, known)
    return {name: np.asarray(known[name]) for name in _COMPILED}


def rudder_slopes(values: Mapping[str, Any], speed: float, n: float) -> dict[str, np.ndarray]:
    """d(rudder force)/d(v or r) over the speed on a straight course, as "Yv", "Yr", "Nv", "Nr".

    The mean of both sides, for the flow is not straightened alike. `values` may be numbers or (m,) arrays.
    """
    out = {}
    for velocity, size in (("v", 1e-4 * speed), ("r", 1e-4 * speed / np.mean(values["L"]))):
        low, high = (ship_forces(values, speed, **{velocity: side * size}, n=n) for side in (-1.0, 1.0))
        for axis in "YN":
            rise = high[f"rudder {axis}"] - low[f"rudder {axis}"]
            out[axis + velocity] = rise / (2.0 * size * speed)
    return out
