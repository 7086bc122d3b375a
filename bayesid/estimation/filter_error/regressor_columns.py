"""Columns of one linearised run as the filter takes them: residual first, then the sensitivities.

Takes a `Linearisation` and where and in which units its parameters are seen. Gives a frozen
`RegressorColumns`. Does not know the environment: the same stack is whitened under many, so the latest are
kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np

from bayesid.estimation.filter_error import parameter_slopes
from bayesid.estimation.filter_error.linearise import Linearisation
from bayesid.estimation.filter_error.parameter_slopes import blocks
from bayesid.estimation.run_data import Array

# Bytes of stacks kept: those of all runs of a usual trial, some MB each.
MOST_BYTES = 48_000_000


@dataclass(frozen=True, eq=False)
class RegressorColumns:
    """Columns of one run.

    Attributes
    ----------
    columns : (n, q, c) residual and sensitivities by sample and channel
    drive : (n-1, nx, c) known change of the state's deviation over each interval
    first : (nx, c) known initial deviation
    step, scale, extra : what it was made of
    """

    columns: Array
    drive: Array
    first: Array
    step: Array
    scale: Array
    extra: tuple[Array, Array] | None

    @property
    def size(self) -> int:
        """Bytes."""
        return self.columns.nbytes + self.drive.nbytes

    def made_of(self, step: Array, scale: Array, extra: tuple[Array, Array] | None) -> bool:
        """Whether it is the stack of these."""
        return extra is self.extra and np.array_equal(step, self.step) and np.array_equal(scale, self.scale)


_kept: WeakKeyDictionary[Linearisation, RegressorColumns] = WeakKeyDictionary()
_lock = Lock()  # of `_kept`


def known(path: Linearisation, step: Array) -> tuple[Array, Array, Array]:
    """Residual, drive and initial deviation when the parameters are moved by `step` from the path's own.

    The deviation is measured from the path: latent forces zero, initial state that of the readings.
    """
    first = path.log.x0 - path.point.states[0]
    if path.held or not step.any():
        slopes = path.by_parameter.part(0, path.log.n) if step.any() else None
        return *known_part(path, step, 0, path.log.n, slopes), first
    resid, drive = np.empty_like(path.resid), np.empty_like(path.defect)
    for a, b in blocks(path.log.n):
        resid[a:b], drive[a:b] = known_part(path, step, a, b, path.by_parameter.part(a, b))
    return resid, drive, first


def known_part(
    path: Linearisation, step: Array, first: int, last: int, slopes: tuple[Array, Array] | None
) -> tuple[Array, Array]:
    """Residual of the samples from `first` to before `last`, and drive of the intervals that begin there.

    Parameters
    ----------
    slopes : of these samples by the parameters; not asked for where there is no step
    """
    resid, drive, force = path.resid[first:last], path.defect[first:last], path.point.force[first:last]
    if step.any() and slopes is not None:
        resid = resid - slopes[0] @ step
        drive = drive + slopes[1] @ step
    if force.any():
        drive = drive - np.matmul(path.gamma[first:last, :, : force.shape[1]], force[:, :, None])[:, :, 0]
    return resid, drive


def regressor_columns(
    path: Linearisation, step: Array, scale: Array, extra: tuple[Array, Array] | None = None
) -> RegressorColumns:
    """Stack of a path.

    Parameters
    ----------
    step : (p,) where the residual is taken, as a move from the path's parameters
    scale : (p,) unit of each column [SI]
    extra : further columns, direct (n, q, k) and drive (n-1, nx, k), e.g. secants
    """
    with _lock:
        old = _kept.get(path)
    if old is not None and old.made_of(step, scale, extra):
        return old
    direct, psi = path.by_parameter.part(0, path.log.n)
    resid, drive = known_part(path, step, 0, path.log.n, (direct, psi))
    first = path.log.x0 - path.point.states[0]
    (n, q), nx, p = resid.shape, first.size, scale.size
    c = 1 + p + (extra[0].shape[2] if extra is not None else 0)
    columns, drives, firsts = np.empty((n, q, c)), np.empty((n - 1, nx, c)), np.zeros((nx, c))
    columns[:, :, 0], drives[:, :, 0], firsts[:, 0] = resid, drive, first
    np.multiply(direct, scale, out=columns[:, :, 1 : 1 + p])
    np.multiply(psi, -scale, out=drives[:, :, 1 : 1 + p])
    if extra is not None:
        columns[:, :, 1 + p :] = extra[0]
        np.negative(extra[1], out=drives[:, :, 1 + p :])
    out = RegressorColumns(columns, drives, firsts, step.copy(), scale.copy(), extra)
    if n > parameter_slopes.BLOCK:
        return out  # whitened once: sums over a long run are taken block by block
    with _lock:
        _kept[path] = out
        room = MOST_BYTES - out.size
        for other in reversed([k for k in _kept if k is not path]):
            room -= _kept[other].size
            if room < 0:
                del _kept[other]
    return out
