"""Free parameters with Gaussian priors, and the whitened products of their columns.

Takes paths. Knows neither the fit nor which parameter is a coefficient and which belongs to an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.coloured.colours import Colours, whitened
from bayesid.coloured.evidence import Gram, gram
from bayesid.coloured.log import Array
from bayesid.coloured.path import Path
from bayesid.model import Model


@dataclass(frozen=True, eq=False)
class Free:
    """Free parameters with Gaussian priors, all in SI and in the order of `names`."""

    names: tuple[str, ...]
    where: Array
    mean: Array
    sd: Array
    low: Array

    def __add__(self, other: Free) -> Free:
        return Free(
            (*self.names, *other.names),
            np.concatenate([self.where, other.where]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.sd, other.sd]),
            np.concatenate([self.low, other.low]),
        )


NOTHING = Free((), np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def stack(model: Model, paths: Sequence[Path], free: Free, colours: Colours) -> list[Gram]:
    """Whitened Gram matrix of every run, residual relative to the prior mean, columns per prior sd."""
    out = []
    for k, path in enumerate(paths):
        w = whitened(model, path, free.mean - path.point.par[free.where], free.sd, colours, run=k)
        out.append(gram(w.resid, w.columns, w.logdet, w.used))
    return out
