"""Long tables thinned while they are read: one sample per channel and step, and every change of an order.

Takes parts of a table, one after the other. Does not: average, or move a reading to another time.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayesid.trials.importing.raw import Request
from bayesid.trials.trial import Floats


class Thinning:
    """What to keep of the rows of a table: of each channel its first reading in a step.

    A row may hold readings of some channels only, as of a log that writes a line per message; what a
    kept row holds of a channel that has a reading in that step already is left out.
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self._begun = False
        self._step: dict[str, int] = {}
        self._value: dict[str, float] = {}

    def keep(self, t: Floats, columns: Mapping[str, np.ndarray]) -> tuple[np.ndarray, dict[str, Floats]]:
        """(rows to keep, name -> its numbers in them, NaN where left out) of the next rows of a table.

        Parameters
        ----------
        t : (n,) finite times
        columns : name -> (n,) numbers; those that are not requested are passed over
        """
        assert self.request.step is not None
        steps = np.floor(t / self.request.step + 1e-9).astype(np.int64)
        kept = {n: self._of(n, steps, v) for n, v in columns.items() if self.request.wants(n)}
        some = np.zeros(t.size, dtype=bool)
        some[:1] = not self._begun  # windows of runs count from the first row, whatever it holds
        self._begun = True
        rows = np.flatnonzero(np.logical_or.reduce([some, *kept.values()]))
        data = {n: np.where(own[rows], columns[n][rows], np.nan) for n, own in kept.items()}
        return rows, data

    def _of(self, name: str, steps: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Which numbers of a channel are kept."""
        good = np.flatnonzero(np.isfinite(values))
        out = np.zeros(values.shape, dtype=bool)
        if not good.size:
            return out
        own, read = steps[good], values[good].astype(float)
        keep = np.diff(own, prepend=self._step.get(name, own[0] - 1)) != 0
        if name in self.request.switching:
            keep |= np.diff(read, prepend=self._value.get(name, read[0])) != 0.0
        self._step[name], self._value[name] = int(own[-1]), float(read[-1])
        out[good] = keep
        return out
