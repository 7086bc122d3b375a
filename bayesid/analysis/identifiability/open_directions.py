"""The directions data leave open, structural ones by name, ridges by family, the rest by their coefficients.

Takes `Information`, scalings and covariances. Gives `OpenDirection` directions and how well three views of
them agree: singular vectors of the sensitivities, eigenvectors of the posterior covariance, paths of the
profile likelihood. Does not simulate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.identifiability.information import Information
from bayesid.analysis.identifiability.scalings import Scaling
from bayesid.estimation.output_error.flat_directions import SHOWN, combination, varimax
from bayesid.model.terms import TERMS, term

Array = np.ndarray
UNINFORMED_SHARE = 1e-6  # a structural change moves the residuals by less than this share of its parts
EXACT_SHARE = 1e-11  # and by less than this where it is exact in arithmetic
OPEN_DATA_SHARE = 0.5  # a direction is open where the data's share of what is known along it is below this
FAMILY_SHARE = 0.6  # a ridge has a family's name if its members make up this share of it
FAMILIES = {
    "vv/vr/rr": "rows of v², v r and r² stand in for each other",
    "v/r": "rows of v and of r stand in for each other",
    "accelerations": "rows of sway and yaw acceleration have little to show",
    "rudder": "rudder rows at rest and while turning stand in for each other",
}
_ROWS = {t.name for t in TERMS}


@dataclass(frozen=True, eq=False)
class OpenDirection:
    """A direction the data do not fix.

    Attributes
    ----------
    name : "0.71 Y_v + 0.70 Y_r", relative changes
    kind : "structural" (equations alike), "ridge" (one family of rows) or "mixture"
    words : what it is: the scaling, the family and why; "" for a mixture
    fixed : for two coefficients, the combination the data do fix; else ""
    data_share : share of the data in what is known along it
    singular_value : residual change per unit step [noise units]; a unit is one prior sd
    sd : relative sd the data alone leave along it, inf if exact
    exact : zero to rounding
    vector : (k,) unit vector in units of prior sd
    relative : (k,) unit vector of relative changes
    agreement : |cos| with the space each lens calls open: "svd", "covariance", "profile"
    """

    name: str
    kind: str
    words: str
    fixed: str
    data_share: float
    singular_value: float
    sd: float
    exact: bool
    vector: Array
    relative: Array
    agreement: dict[str, float]


def open_directions(info: Information, structural: Sequence[Scaling] = ()) -> tuple[OpenDirection, ...]:
    """Open directions of some data: confirmed structural ones first, then flattest first.

    Parameters
    ----------
    structural : candidates; one the data see is left out (a zig-zag sees what a one-sided turn cannot)
    """
    found, basis = [], np.zeros((len(info.names), 0))
    for candidate in structural:
        step = candidate.tangent / info.unit
        step = step / np.linalg.norm(step)
        change, parts = np.linalg.norm(info.data @ step), np.linalg.norm(info.reach * step)
        if change <= UNINFORMED_SHARE * parts and info.share_along(step) < OPEN_DATA_SHARE:
            exact = bool(change <= EXACT_SHARE * parts)
            found.append(_open(info, step, "structural", candidate.name, exact))
            basis = np.column_stack([basis, step])
    rest = _complement(basis)
    values, vectors = _weak(info.data @ rest)
    vectors = rest @ vectors
    top = float(np.linalg.norm(info.data, 2))
    zero = values <= 1e-12 * top
    if zero.sum() > 1:
        vectors[:, zero] = varimax(vectors[:, zero].T).T
    for value, vector in zip(values, vectors.T, strict=True):
        if info.share_along(vector) < OPEN_DATA_SHARE:
            kind, words = _family(info, vector)
            found.append(_open(info, vector, kind, words, bool(value <= 1e-12 * top)))
    return tuple(found)


def _complement(basis: Array) -> Array:
    """(k, k - m) orthonormal columns orthogonal to m given ones."""
    q, _ = np.linalg.qr(basis, mode="complete")
    return q[:, basis.shape[1] :]


def _weak(matrix: Array) -> tuple[Array, Array]:
    """Singular values, rising, and right vectors as columns."""
    _, values, vt = np.linalg.svd(matrix)
    return values[::-1], vt[::-1].T


def _open(info: Information, vector: Array, kind: str, words: str, exact: bool) -> OpenDirection:
    relative = info.relative(vector)
    largest = np.argmax(np.abs(relative))
    if relative[largest] < 0:
        vector, relative = -vector, -relative
    value = float(np.linalg.norm(info.data @ vector))
    per_relative = value / np.linalg.norm(vector * info.unit / info.scale)
    sd = np.inf if exact or per_relative == 0 else float(1.0 / per_relative)
    return OpenDirection(
        combination(info.names, relative), kind, words, _fixed(info, relative),
        info.share_along(vector), value, sd, exact, vector, relative, {},
    )  # fmt: skip


def _fixed(info: Information, relative: Array) -> str:
    """The combination orthogonal to a direction of two coefficients, if the data do fix it; else ""."""
    pair = np.flatnonzero(np.abs(relative) >= SHOWN)
    if pair.size != 2:
        return ""
    other = np.zeros_like(relative)
    i, j = pair
    other[i], other[j] = -relative[j], relative[i]
    if info.share_along(other * info.scale / info.unit) < OPEN_DATA_SHARE:
        return ""
    return combination(info.names, other / np.linalg.norm(other))


def _family(info: Information, vector: Array) -> tuple[str, str]:
    share: dict[tuple[str, str], float] = {}
    for name, value in zip(info.names, info.relative(vector), strict=True):
        family = family_of(name)
        if family:
            key = (family, name[0])
            share[key] = share.get(key, 0.0) + float(value**2)
    for family, why in FAMILIES.items():
        axes = {axis: s for (f, axis), s in share.items() if f == family}
        if sum(axes.values()) >= FAMILY_SHARE:
            shown = sorted((a for a, s in axes.items() if s >= 0.1), key=lambda a: -axes[a])
            return "ridge", f"{family} ridge of {' and '.join(shown)}: {why}"
    return "mixture", ""


def family_of(name: str) -> str:
    """Which of `FAMILIES` a row of the horizontal plane belongs to; "" for none."""
    if name not in _ROWS or not term(name).planar or term(name).group != "base":
        return ""
    row = term(name)
    motions = [f.symbol for f in row.factors for _ in range(f.degree)]
    if row.is_inertia:
        return "accelerations" if set(motions) <= {"vdot", "rdot"} else ""
    if "delta_r" in motions:
        return "rudder"
    turning = [s for s in motions if s in ("v", "Rv", "r")]
    if set(motions) <= {"v", "Rv", "r"} and len(turning) == 2:
        return "vv/vr/rr"
    if len(turning) == 1 and set(motions) <= {"u", "v", "Rv", "r"}:
        return "v/r"
    return ""


def covariance_space(covariance: Array, prior_covariance: Array) -> Array:
    """(k, m) eigenvectors of a posterior covariance that kept more than half of the prior's variance.

    Parameters
    ----------
    covariance, prior_covariance : (k, k) in units squared; of draws, or Laplace
    """
    values, vectors = np.linalg.eigh(covariance)
    prior = np.sum(vectors * np.linalg.lstsq(prior_covariance, vectors, rcond=None)[0], axis=0)
    return vectors[:, values * prior > OPEN_DATA_SHARE]


def path_space(steps: Array, weights: Array) -> Array:
    """(k, m) space spanned by the paths (p, k) of profiles that the prior alone ended.

    Parameters
    ----------
    weights : (p,) share of the data in what ended each path
    """
    open_ones = steps[weights < OPEN_DATA_SHARE]
    if not open_ones.size:
        return np.zeros((steps.shape[1], 0))
    rows = open_ones / np.linalg.norm(open_ones, axis=1)[:, None]
    _, values, vt = np.linalg.svd(rows, full_matrices=False)
    return vt[values > 0.1 * values[0]].T


def cosine(vector: Array, space: Array) -> float:
    """|cos| of the angle between a vector (k,) and a space with orthonormal columns (k, m); 0 if empty."""
    return float(np.linalg.norm(space.T @ vector) / np.linalg.norm(vector)) if space.shape[1] else 0.0


def svd_space(info: Information) -> Array:
    """(k, m) right singular vectors of the whitened sensitivities with less data than prior behind them."""
    _, vectors = _weak(info.data)
    return np.column_stack(
        [v for v in vectors.T if info.share_along(v) < OPEN_DATA_SHARE] or [np.zeros((len(info.names), 0))]
    )
