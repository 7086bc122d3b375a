"""A diagnosed model whose parameters end at bounds, as those of a fit do, in memory and in model.json.

Takes a `DiagnosedModel` and bounds. Gives draws within them. Does not fit or simulate.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bayesid.diagnosis.diagnosed_model import (
    LARGEST_MODEL,
    MODEL_FILE,
    DiagnosedModel,
    WeightedHypothesis,
    read_diagnosed,
    write_diagnosed,
)
from bayesid.errors import ModelError
from bayesid.estimation.truncated_normal import within_bounds
from bayesid.files import read_regular, write_json
from bayesid.model.effects import Effect

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class BoundedModel(DiagnosedModel):
    """A diagnosed model with bounds.

    Attributes
    ----------
    bounds : parameter -> low and high [SI]
    """

    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def draw(self, rng: np.random.Generator, count: int) -> list[tuple[WeightedHypothesis, Array]]:
        """As that of a diagnosed model, no parameter beyond its bounds."""
        out = super().draw(rng, count)
        for h, pars in out:
            low, high = np.array([self.bounds.get(n, (-np.inf, np.inf)) for n in h.names]).T
            where = self.model.positions(h.names)
            pars[:, where] = within_bounds(pars[:, where], h.mean, h.covariance, low, high, rng)
        return out


def write_model(found: DiagnosedModel, folder: str | os.PathLike[str]) -> Path:
    """Write `model.json`, with bounds where there are some, and the nominal vehicle beside it."""
    path = write_diagnosed(found, folder)
    if isinstance(found, BoundedModel):
        record = json.loads(path.read_text(encoding="utf-8"))
        write_json(path, {**record, "bounds": {n: list(b) for n, b in found.bounds.items()}})
    return path


def read_model(folder: str | os.PathLike[str], declared: Iterable[Effect] = ()) -> DiagnosedModel:
    """Read what `write_model` or `write_diagnosed` wrote.

    Raises
    ------
    ModelError
        as `read_diagnosed`; or bounds that are none
    """
    found = read_diagnosed(folder, declared)
    path = Path(folder) / MODEL_FILE
    told = json.loads(read_regular(path, LARGEST_MODEL).decode("utf-8")).get("bounds")
    if told is None:
        return found
    try:
        bounds = {str(n): (float(low), float(high)) for n, (low, high) in told.items()}
        wrong = [n for n, (low, high) in bounds.items() if not low < high]
    except (ValueError, TypeError, AttributeError) as error:
        raise ModelError(f"{path}: its bounds cannot be read ({error})") from None
    if wrong:
        raise ModelError(f"{path}: the bounds of {wrong[0]} leave no room")
    return BoundedModel(found.model, found.hypotheses, found.noise, found.verdict, found.trial, bounds)
