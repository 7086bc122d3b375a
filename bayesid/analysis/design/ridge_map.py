"""Which manoeuvre closes which ridge: what each leaves of coefficients that stand in for each other.

Takes `Knowledge` and the information of manoeuvres. Gives a frozen `RidgeMap`. Does not execute or draw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayesid.analysis.design.criteria import gain, posterior
from bayesid.analysis.design.information import RunInformation
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.analysis.identifiability.posterior_ridges import ridges_of

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class RidgeMap:
    """What manoeuvres leave of ridges.

    Attributes
    ----------
    manoeuvres : (m,)
    families : (g,) "vv/vr/rr of X" and the like
    members : (g,) coefficients of each
    fixed, left : (g, m) posterior over prior sd along the combination known best, and least
    best, worst : (g, m) names of these combinations
    """

    manoeuvres: tuple[str, ...]
    families: tuple[str, ...]
    members: tuple[tuple[str, ...], ...]
    fixed: Array
    left: Array
    best: tuple[tuple[str, ...], ...]
    worst: tuple[tuple[str, ...], ...]


def ridge_map(knowledge: Knowledge, infos: Mapping[str, RunInformation]) -> RidgeMap:
    """Families of rows (as in `open_directions`) against manoeuvres, in the mean of drawn vehicles."""
    scaled = knowledge.root / knowledge.sd[:, None]
    before = scaled @ scaled.T
    columns = []
    for info in infos.values():
        known = scaled @ np.mean(posterior(info.matrices), axis=0) @ scaled.T
        groups = ridges_of(knowledge.names, known, before).groups
        columns.append({g.family: g for g in groups if g.family})
    families = tuple(columns[0]) if columns else ()
    families = tuple(sorted(families, key=lambda f: -max(c[f].worst.left for c in columns)))
    return RidgeMap(
        tuple(infos), families, tuple(columns[0][f].names for f in families),
        np.array([[c[f].best.left for c in columns] for f in families]).reshape(len(families), len(columns)),
        np.array([[c[f].worst.left for c in columns] for f in families]).reshape(len(families), len(columns)),
        tuple(tuple(c[f].best.name for c in columns) for f in families),
        tuple(tuple(c[f].worst.name for c in columns) for f in families),
    )  # fmt: skip


def per_minute(infos: Mapping[str, RunInformation]) -> Array:
    """(m, 3) gain per minute of run [nats], least, mean and most of the vehicles drawn."""
    found = []
    for info in infos.values():
        each = gain(info.matrices) / max(info.duration / 60.0, 1e-9)
        found.append((each.min(), each.mean(), each.max()))
    return np.array(found).reshape(len(infos), 3)
