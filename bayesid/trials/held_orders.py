"""Orders that hold until the next one, over time."""

from __future__ import annotations

import numpy as np

from bayesid.trials.trial import Floats


def integral_of_held(t: Floats, values: Floats, at: Floats) -> Floats:
    """Integral of an order over time from the first row to `at`, the first and last order held outside.

    Parameters
    ----------
    t, values : (n,) rows, finite
    at : (m,) times
    """
    total = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(t))])
    outside = values[0] * np.minimum(at - t[0], 0.0) + values[-1] * np.maximum(at - t[-1], 0.0)
    return np.asarray(np.interp(at, t, total) + outside)
