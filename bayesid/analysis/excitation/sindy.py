"""The force table as a PySINDy library, for those who want to go on with PySINDy, and its STLSQ on it.

Takes a `Model` and a `Motion`. Gives an object PySINDy accepts, with named columns, and PySINDy's plain
ensemble as a control: it resamples single rows, which are not independent here. `pysindy_regression` judges.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pysindy
from pysindy.feature_library.base import BaseFeatureLibrary

from bayesid.analysis.excitation.columns import LibraryColumn, rows, theta
from bayesid.analysis.excitation.motion import Motion
from bayesid.equations.model import Model

Array = np.ndarray


class TermLibrary(BaseFeatureLibrary):
    """Columns of the force table as a PySINDy feature library.

    Inputs are states and actuator positions side by side, order of `Model.states`, then of the kernel's
    actuators: `numpy.hstack([motion.states, motion.actuators])`.
    """

    def __init__(self, model: Model, columns: Sequence[LibraryColumn]) -> None:
        self.model = model
        self.columns = columns

    def fit(self, x: Array, y: Array | None = None) -> TermLibrary:
        """Note the number of inputs and columns."""
        self.n_features_in_ = int(np.asarray(x[0] if isinstance(x, list) else x).shape[-1])
        self.n_output_features_ = len(self.columns)
        return self

    def transform(self, x: Array | list[Array]) -> Array | list[Array]:
        """(n, k) columns."""
        if isinstance(x, list):
            return [self.transform(part) for part in x]  # type: ignore[misc]
        plain = np.asarray(x)
        nx = len(self.model.states)
        values, _, _ = theta(self.model, self.columns, plain[:, :nx], plain[:, nx:])
        return type(x)(values, x.axes) if hasattr(x, "axes") else values

    def get_feature_names(self, input_features: Sequence[str] | None = None) -> list[str]:
        """Names of the columns, as in the force table."""
        return [c.name for c in self.columns]


def stlsq(
    model: Model,
    motions: Sequence[Motion],
    columns: Sequence[LibraryColumn],
    axis: str,
    threshold: float,
    form: str = "strong",
) -> dict[str, float]:
    """Coefficients of one axis [SI] by PySINDy's sequentially thresholded least squares.

    Parameters
    ----------
    threshold : smallest force of a term kept, over the rms of the axis' force
    """
    data = rows(model, motions, columns, form)
    picked = [k for k, c in enumerate(columns) if c.axis == axis]
    target = data.target[:, data.axes.index(axis)]
    rms = float(np.sqrt(np.mean(target**2)))
    size = np.sqrt(np.mean(data.theta[:, picked] ** 2, axis=0))
    optimiser = pysindy.STLSQ(threshold=threshold, alpha=0.0)
    optimiser.fit(data.theta[:, picked] / size, target[:, None] / rms)
    values = np.asarray(optimiser.coef_)[0] * rms / size
    return {columns[k].name: float(v) for k, v in zip(picked, values, strict=True)}


def ensemble(
    model: Model,
    motions: Sequence[Motion],
    columns: Sequence[LibraryColumn],
    axis: str,
    threshold: float,
    draws: int = 100,
    form: str = "weak",
    seed: int = 0,
) -> dict[str, float]:
    """Inclusion frequency of every column of one axis by PySINDy's own ensemble of STLSQ, single rows drawn.

    For comparison only: near-parallel columns survive any threshold as sums that cancel (a spiral of
    generic_sub keeps 14 of 15 columns in every draw, eight of them false).
    """
    data = rows(model, motions, columns, form)
    picked = [k for k, c in enumerate(columns) if c.axis == axis]
    target = data.target[:, data.axes.index(axis)]
    size = np.sqrt(np.mean(data.theta[:, picked] ** 2, axis=0))
    scaled = data.theta[:, picked] / np.where(size > 0, size, 1.0)
    optimiser = pysindy.EnsembleOptimizer(
        pysindy.STLSQ(threshold=threshold, alpha=0.0), bagging=True, n_models=draws
    )
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002 (PySINDy draws from the global generator)
    try:
        optimiser.fit(scaled, target[:, None] / np.sqrt(np.mean(target**2)))
    finally:
        np.random.set_state(state)  # noqa: NPY002
    kept = np.mean(np.abs(np.stack(optimiser.coef_list)) > 0, axis=0)[0]
    return {columns[k].name: float(v) for k, v in zip(picked, kept, strict=True)}
