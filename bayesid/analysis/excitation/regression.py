"""Which forces a set of runs excites, and which terms beyond the vehicle's own they ask for.

Takes a `Model` and runs. Gives a frozen `Excitation`. Fits no track and reads no held-out run unless handed
one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from bayesid.analysis.excitation.columns import AXIS, LibraryColumn, library, rows
from bayesid.analysis.excitation.motion import Motion
from bayesid.analysis.excitation.row_selection import ENGINE, AxisFit, RowSelection, select_axis
from bayesid.analysis.excitation.track_smoother import smooth_tracks
from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.model.terms import TERMS
from bayesid.trials import Run
from bayesid.words import counted

DEFAULT_RELATIVE_SD = 0.1


@dataclass(frozen=True, eq=False)
class Excitation:
    """What runs say about every column of the library.

    Attributes
    ----------
    vehicle, model : name and digest
    runs : names
    form, draws, seed : "weak" or "strong"; bootstrap draws
    axes : one regression per axis, nothing known of any coefficient
    beyond : the same with the vehicle's own rows held within their prior: what they leave
    out_of_plane : rows of the table outside a planar model, whose regressors are zero in the plane or whose
        axis is not logged
    """

    vehicle: str
    model: str
    runs: tuple[str, ...]
    form: str
    draws: int
    seed: int
    axes: tuple[AxisFit, ...]
    beyond: tuple[AxisFit, ...]
    out_of_plane: tuple[str, ...]

    @cached_property
    def terms(self) -> tuple[RowSelection, ...]:
        """What speaks for every column, nothing known of any."""
        return tuple(w for fit in self.axes for w in fit.selections)

    @cached_property
    def inclusion(self) -> dict[str, float]:
        """Share of bootstrap draws that keep each column."""
        return {w.name: w.inclusion for w in self.terms} | dict.fromkeys(self.out_of_plane, 0.0)

    @cached_property
    def spread(self) -> dict[str, float]:
        """Bootstrap sd of each coefficient over its size; infinite where it was not selected."""
        out = {}
        for w in self.terms:
            known = np.isfinite(w.value) and w.value != 0.0 and np.isfinite(w.sd)
            out[w.name] = abs(w.sd / w.value) if known else float("inf")
        return out | dict.fromkeys(self.out_of_plane, float("inf"))

    @cached_property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Columns that could stand in for each other on these runs."""
        return tuple(dict.fromkeys(w.group for w in self.terms if w.status == "cannot tell" and w.group))

    @cached_property
    def candidates(self) -> tuple[RowSelection, ...]:
        """Columns the vehicle file lacks that these runs ask for and nothing else explains."""
        return tuple(w for f in self.beyond for w in f.selections if w.status == "found" and not w.in_model)

    @cached_property
    def candidate_groups(self) -> tuple[tuple[str, ...], ...]:
        """Groups of columns the vehicle file lacks, of which these runs ask for one without telling which."""
        return tuple(
            dict.fromkeys(
                w.group
                for f in self.beyond
                for w in f.selections
                if w.status == "cannot tell" and w.group and not w.in_model
            )
        )


def excite(
    model: Model,
    runs: Sequence[Run],
    noise: Mapping[str, float],
    *,
    form: str = "weak",
    draws: int = 100,
    seed: int = 0,
    drift: float = 0.0,
    notify: Callable[[str], None] = lambda text: None,
) -> Excitation:
    """Sparse regression of the rigid-body wrench of logged runs on the columns of the force table.

    Parameters
    ----------
    runs : logged, or executed by `virtual.virtual_run`
    noise : channel -> one sigma of white sensor noise [SI]; estimated for channels without it
    form : "weak" (no accelerations needed) or "strong"
    draws : bootstrap draws over stretches of time
    drift : one sigma of a slow position error [m]

    Raises
    ------
    TrialError
        if velocities cannot be had from the channels logged
    ModelError
        if there is no run, or a run is shorter than a window of the weak form
    """
    if not runs:
        raise ModelError("no run to read; excitation needs at least one")
    notify(f"smoothing {counted(len(runs), 'run')}")
    motions, _ = smooth_tracks(model, runs, noise, drift)
    return excite_motions(model, motions, form=form, draws=draws, seed=seed, notify=notify)


def excite_motions(
    model: Model,
    motions: Sequence[Motion],
    *,
    form: str = "weak",
    draws: int = 100,
    seed: int = 0,
    columns: Sequence[LibraryColumn] | None = None,
    notify: Callable[[str], None] = lambda text: None,
) -> Excitation:
    """As `excite`, from motions already at hand (`exact_motion` for a run free of noise)."""
    rng = np.random.default_rng(seed)
    columns = library(model) if columns is None else columns
    data = rows(model, motions, columns, form)
    axes = [AXIS[v] for v in model.kernel.velocities]
    prior = {}
    for column in columns:
        if column.in_model:
            sd = model.prior_sd(column.name)
            known = np.isfinite(sd) and sd > 0
            prior[column.name] = sd if known else DEFAULT_RELATIVE_SD * abs(column.nominal)
    free, beyond = [], []
    for axis in axes:
        notify(f"regressing {axis} on {sum(c.axis == axis for c in columns)} columns")
        free.append(select_axis(data, axis, draws, rng))
        beyond.append(select_axis(data, axis, draws, rng, prior))
    seen = {c.name for c in columns}
    out_of_plane = tuple(
        t.name for t in TERMS if t.group == "base" and not t.is_inertia and t.name not in seen
    )
    return Excitation(
        model.vehicle.name,
        model.digest,
        tuple(m.name for m in motions),
        form,
        draws,
        seed,
        tuple(free),
        tuple(beyond),
        out_of_plane,
    )


def as_json(found: Excitation) -> dict[str, Any]:
    """Plain data of `excitation.json`."""
    return {
        "format": 1,
        "engine": ENGINE,
        "vehicle": found.vehicle,
        "model": found.model,
        "runs": list(found.runs),
        "form": found.form,
        "draws": found.draws,
        "seed": found.seed,
        "axes": {fit.axis: _axis(fit) for fit in found.axes},
        "beyond": {fit.axis: _axis(fit) for fit in found.beyond},
        "unseen": list(found.out_of_plane),
        "groups": [list(g) for g in found.groups],
        "candidates": [w.name for w in found.candidates],
        "candidate_groups": [list(g) for g in found.candidate_groups],
    }


def _axis(fit: AxisFit) -> dict[str, Any]:
    return {
        "rms": fit.rms,
        "residual": fit.residual,
        "explained": fit.explained,
        "correlation": fit.correlation,
        "terms": [
            {
                "name": w.name,
                "regressor": w.expression,
                "in_model": w.in_model,
                "status": w.status,
                "inclusion": w.inclusion,
                "value": _number(w.value),
                "sd": _number(w.sd),
                "share": w.share,
                "group": list(w.group),
                "margin": _number(w.margin),
            }
            for w in fit.selections
        ],
    }


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
