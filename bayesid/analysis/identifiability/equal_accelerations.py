"""Changes of free parameters that alter no acceleration at any state: found by numbers, in any plane.

Takes a `FitProblem` and a point. Gives tangents, one equation's first. Looks at random states and fins, not
at data; where the planar scalings are known in closed form, `scalings` gives those.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.output_error import FitProblem
from bayesid.simulation.accelerations import rates_on

Array = np.ndarray
EQUATIONS = {"X": "surge", "Y": "sway", "Z": "heave", "K": "roll", "M": "pitch", "N": "yaw"}
# rows that look like the rigid body: accelerations, products of rates, a rate times the speed
RIGID = re.compile(r"([uvwpqr]dot|[pqr]|[uvwpqr][pqr])0?$")
POINTS = 400
# Of the largest change of an acceleration: what is left of one that vanishes, exact slopes and all.
ROUNDING = 1e-9
TRIFLE = 1e-6  # share of a direction below which a parameter takes no part in it
# Sizes of random states: angles [rad], share of the speed across, rates over U/L, fins [rad].
ANGLE, ACROSS, TURNING, FIN = 0.4, 0.4, 0.8, 0.4


def equal_accelerations(problem: FitProblem, z: Array, seed: int = 0) -> list[tuple[str, Array]]:
    """Words and tangents (k,) [SI, any length] of the changes that leave every acceleration as it is.

    Thrust, weight, buoyancy and cross-flow drag are no coefficients, so that an equation that holds them
    can be scaled only where rows of the model look like them.
    """
    model, par = problem.model, problem.split(z)[0]
    positions, chain = problem.params.chain(model.index)
    try:
        _, slopes, mass = rates_on(model, par, *_points(model, par, seed), positions)
    except ModelError:
        return []
    # as forces: an equation's own coefficients then move its own row only
    forces = np.einsum("ij,njp->nip", mass, slopes) @ chain
    matrix = forces.reshape(-1, chain.shape[1])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    names = problem.params.names
    coefficients = dict(zip(names, problem.split(z)[0][model.positions(names)], strict=True))
    found: list[tuple[str, Array]] = []
    for axis in EQUATIONS:
        own = [i for i, n in enumerate(names) if n.startswith(f"{axis}_")]
        for words, tangent in _named(axis, [names[i] for i in own], _null(matrix[:, own] / size[own]),
                                     size[own], coefficients):  # fmt: skip
            whole = np.zeros(len(names))
            whole[own] = tangent
            found.append((words, whole))
    taken = np.array([size * tangent for _, tangent in found]).reshape(len(found), len(names))
    for null in _beyond(_null(matrix / size), taken):
        parts = {n[0] for n, share in zip(names, null, strict=True) if abs(share) > TRIFLE and n[1:2] == "_"}
        joined = " and ".join(EQUATIONS[a] for a in EQUATIONS if a in parts)
        found.append((f"{joined} equations together" if joined else "forces together", null / size))
    return found


def _named(
    axis: str, names: list[str], null: Array, size: Array, coefficients: Mapping[str, float]
) -> list[tuple[str, Array]]:
    """Directions within one equation: itself scaled, another one added to it, what is left of them.

    A row that the rigid body has too moves by other than its share, so the others decide on the name.
    """
    if not len(null):
        return []
    plain = np.array([RIGID.match(n[2:]) is None for n in names])
    found: list[tuple[str, Array]] = []
    for other in (axis, *(a for a in EQUATIONS if a != axis)):
        wanted = size * np.array([coefficients.get(f"{other}_{n[2:]}", 0.0) for n in names])
        if not plain.any() or not np.any(wanted[plain]) or len(found) == len(null):
            continue
        shares = np.linalg.lstsq(null[:, plain].T, wanted[plain], rcond=None)[0]
        if np.linalg.norm(shares @ null[:, plain] - wanted[plain]) > TRIFLE * np.linalg.norm(wanted[plain]):
            continue
        words = f"scale of the {EQUATIONS[axis]} equation"
        if other != axis:
            words = f"{EQUATIONS[other]} equation added to the {EQUATIONS[axis]} equation"
        found.append((words, shares @ null / size))
    taken = np.array([size * tangent for _, tangent in found]).reshape(len(found), len(names))
    rest = f"rows of the {EQUATIONS[axis]} equation that make up for each other"
    return found + [(rest, left / size) for left in _beyond(null, taken)]


def _null(matrix: Array) -> Array:
    """(m, k) orthonormal directions that a matrix does not see."""
    if not matrix.shape[1]:
        return np.zeros((0, 0))
    _, values, vectors = np.linalg.svd(matrix, full_matrices=False)
    return vectors[values < ROUNDING * max(float(values[0]), 1e-300) * np.sqrt(len(matrix))]


def _beyond(every: Array, taken: Array) -> Array:
    """What is left of some directions beside others."""
    if not len(every) or not len(taken):
        return every
    basis = np.linalg.qr(taken.T)[0]
    rest = every - (every @ basis) @ basis.T
    _, values, vectors = np.linalg.svd(rest, full_matrices=False)
    return vectors[values > 1e-6]


def _points(model: Model, par: Array, seed: int) -> tuple[Array, Array]:
    """(n, nx) states about straight ahead and (n, na) actuators, all of them moving."""
    rng = np.random.default_rng(seed)
    length, speed = model.scales["L"], model.scales["U"]
    spread = {"phi": ANGLE, "theta": ANGLE, "psi": ANGLE, "v": ACROSS * speed, "w": ACROSS * speed}
    spread |= dict.fromkeys("pqr", TURNING * speed / length)
    states = np.zeros((POINTS, len(model.states)))
    for i, name in enumerate(model.states):
        if name == "u":
            states[:, i] = speed * rng.uniform(-0.6, 1.2, POINTS)  # astern tells u|u| from u u
        else:
            states[:, i] = spread.get(name, length) * rng.uniform(-1.0, 1.0, POINTS)
    revolutions = model.vehicle.rpm_ref or 1.0
    actuators = np.stack([
        FIN * rng.uniform(-1.0, 1.0, POINTS) if name in model.kernel.spec.servos else
        revolutions * rng.uniform(0.5, 1.2, POINTS)
        for name in model.kernel.actuators
    ], axis=1)  # fmt: skip
    return states, actuators
