"""Which terms a set of runs needs, by PySINDy: a regression that knows no prior and fits no track.

Takes runs' motions and a `Model`. Gives one `TermGroup` per term, or per group of terms that can stand in for
one another. PySINDy's FROLS (forward regression by orthogonal least squares) proposes the models, its STLSQ
prunes them in units of standard errors; both see the weak form of `columns.rows`. Import is lazy: PySINDy
takes a second to load.

Of every draw: stretches of time are resampled whole, velocities are moved by errors of the size the smoother
states, and the assumed added mass by its prior, so that the spread holds all three.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bayesid.analysis.excitation.columns import AXIS, LibraryColumn, Rows, library, rows
from bayesid.analysis.excitation.motion import Motion
from bayesid.analysis.excitation.power import NEIGHBOURS, noticed, white_reach
from bayesid.analysis.excitation.row_selection import (
    COLUMN_PENALTY,
    EXACT_RESIDUAL,
    INCLUDED,
    MARGIN,
    NOISE_SHARE,
    SAME_COLUMN,
    THRESHOLD,
    Roots,
    block_noise,
)
from bayesid.equations.layout import rows_of
from bayesid.equations.model import Model

Array = np.ndarray
Status = Literal["found", "cannot tell", "not needed", "not excited"]
# |cos| of two columns from which they are judged as one group, whatever the noise.
PARALLEL = 0.9995
# Inclusion below which a group counts as not needed.
SELDOM = 0.2
MOST_TERMS = 10  # of one axis; the largest vehicle file has eight
ADDED_MASS_SD = 0.1  # relative, where the vehicle file states none
MOST_MODELS = 8  # of which terms are exchanged, best first
MOST_JOINED = 4  # rounds in which substitutes join a group
# A term nobody states is not needed only if this share of the axis' force would have been noticed of it.
NOTICED = 0.25


@dataclass(frozen=True)
class TermGroup:
    """What PySINDy says about a term, or about terms it cannot tell apart.

    Attributes
    ----------
    axis : X Y Z K M N
    names : one, or a group of near-parallel columns
    in_model : those the vehicle file has
    status : "found" (some member is needed), "cannot tell", "not needed" (and it would have been noticed) or
        "not excited"
    inclusion : share of draws that keep a member
    margin : log likelihood, less the price of terms, by which the best model without any member loses
    value, sd : of a single term [SI]; nan for a group
    share : rms of its force over that of the axis
    """

    axis: str
    names: tuple[str, ...]
    in_model: tuple[str, ...]
    status: Status
    inclusion: float
    margin: float
    value: float
    sd: float
    share: float


def pysindy_terms(
    model: Model,
    motions: Sequence[Motion],
    *,
    draws: int = 40,
    seed: int = 0,
    form: str = "weak",
    columns: Sequence[LibraryColumn] | None = None,
) -> tuple[TermGroup, ...]:
    """Groups of every axis, largest force first.

    Raises
    ------
    ModelError
        a motion shorter than a window of the weak form
    """
    data = rows(model, motions, library(model) if columns is None else columns, form)
    return terms_of_rows(model, data, draws=draws, seed=seed)


def terms_of_rows(model: Model, data: Rows, *, draws: int = 40, seed: int = 0) -> tuple[TermGroup, ...]:
    """As `pysindy_terms`, from rows of the balance at hand."""
    rng = np.random.default_rng(seed)
    inertia = _inertia(model)
    found: list[TermGroup] = []
    for axis in (AXIS[v] for v in model.kernel.velocities):
        found += sorted(_axis(model, data, axis, inertia, draws, rng), key=lambda g: -g.share)
    return tuple(found)


def parallel_groups(theta: Array, alive: Array) -> list[list[int]]:
    """Columns whose directions are within `PARALLEL` of one another, chains of them joined."""
    size = np.linalg.norm(theta, axis=0)
    unit = theta / np.where(size > 0, size, 1.0)
    near = np.abs(unit.T @ unit) >= PARALLEL
    left, out = [int(k) for k in np.flatnonzero(alive)], []
    while left:
        group = [left.pop(0)]
        for k in group:
            joined = [i for i in left if near[k, i]]
            group += joined
            left = [i for i in left if i not in joined]
        out.append(sorted(group))
    return out


def _inertia(model: Model) -> list[tuple[str, int, float]]:
    """Axis, velocity and prior sd [SI] of every acceleration derivative."""
    out = []
    for row in rows_of(model.kernel.spec):
        if row.is_inertia:
            names = [f.symbol for f in row.factors]
            velocity = next((v for v in model.kernel.velocities if f"{v}dot" in names), None)
            if velocity is None:
                continue
            sd = model.prior_sd(row.name)
            nominal = float(model.nominal[model.index[row.name]])
            sd = sd if np.isfinite(sd) and sd > 0 else ADDED_MASS_SD * abs(nominal)
            out.append((row.axis, list(model.kernel.velocities).index(velocity), float(sd)))
    return out


def _axis(
    model: Model, data: Rows, axis: str, inertia: list[tuple[str, int, float]], draws: int,
    rng: np.random.Generator,
) -> list[TermGroup]:  # fmt: skip
    where = [k for k, c in enumerate(data.columns) if c.axis == axis]
    columns = [data.columns[k] for k in where]
    theta, moved = data.theta[:, where], data.moved[:, :, where]
    target = data.target[:, data.axes.index(axis)]
    rms = float(np.sqrt(np.mean(target**2)))
    size = np.sqrt(np.mean(theta**2, axis=0))
    noise = np.mean(data.error[:, where] ** 2, axis=0)
    alive = (size > 1e-12) & (noise < NOISE_SHARE * size**2)
    unit = np.where(size > 0, size, 1.0)
    offered = _without_twins(theta, columns, alive)
    roots = Roots(theta / unit, target, data.weight, data.block)
    variance, _ = block_noise(roots, offered, (EXACT_RESIDUAL * rms) ** 2)
    variance *= white_reach(theta / unit, data.weight, data.block, offered, rng)
    root = roots.total(np.ones(roots.blocks))
    own = [k for k in offered if columns[k].in_model]
    pool = {tuple(propose(root, variance, offered)), tuple(own), tuple(_pruned(root, variance, own))}
    kept = np.zeros((draws, len(columns)), dtype=bool)
    values = np.full((draws, len(columns)), np.nan)
    for i in range(draws):
        slip = _smooth_noise(len(theta), len(moved), rng)
        there = theta + np.einsum("ms,smk->mk", slip, moved)
        goal = target.copy()
        for row_axis, velocity, sd in inertia:
            if row_axis == axis:
                goal -= sd * rng.standard_normal() * data.rate[:, velocity]
        weights = rng.multinomial(roots.blocks, np.full(roots.blocks, 1.0 / roots.blocks)).astype(float)
        some = Roots(there / unit, goal, data.weight, data.block).total(weights)
        picked = propose(some, variance, offered)
        kept[i, picked] = True
        pool.add(tuple(sorted(picked)))
        if picked:
            values[i, picked] = np.linalg.lstsq(some[:, picked], some[:, -1], rcond=None)[0]
    out = []
    models = [(_worth(root, variance, list(m)), list(m)) for m in sorted(pool)]
    best = min(models)[1]
    nominal = np.abs([c.nominal for c in columns]) * size
    asked = np.where(nominal > 0, np.minimum(nominal, NOTICED * rms), NOTICED * rms)
    for group, margin in _substitutes(root, variance, offered, models, kept, parallel_groups(theta, alive)):
        inclusion = float(kept[:, group].any(axis=1).mean())
        value = sd = float("nan")
        single = values[np.isfinite(values[:, group[0]]), group[0]]
        if len(group) == 1 and single.size > 1:
            low, middle, high = np.percentile(single, [16, 50, 84]) / size[group[0]]
            value, sd = float(middle), float(0.5 * (high - low))
        sure = len(group) > 1 or abs(value) > THRESHOLD * sd
        status: Status = "cannot tell"
        if inclusion >= INCLUDED and margin >= MARGIN and sure:
            status = "found"
        elif inclusion <= SELDOM and margin < MARGIN and noticed(root, variance, best, group, asked):
            status = "not needed"
        force = np.nanmedian(np.abs(np.nansum(values[:, group], axis=1))) if kept[:, group].any() else 0.0
        names = tuple(columns[k].name for k in group)
        stated = tuple(columns[k].name for k in group if columns[k].in_model)
        out.append(
            TermGroup(
                axis,
                names,
                stated,
                status,
                inclusion,
                float(margin),
                value,
                sd,
                float(force / max(rms, 1e-300)),
            )
        )
    for k in np.flatnonzero(~alive):
        c, nan = columns[k], float("nan")
        out.append(
            TermGroup(
                axis, (c.name,), (c.name,) if c.in_model else (), "not excited", 0.0, 0.0, nan, nan, 0.0
            )
        )
    return out


def _substitutes(
    root: Array,
    variance: float,
    offered: list[int],
    models: list[tuple[float, list[int]]],
    kept: Array,
    groups: list[list[int]],
) -> list[tuple[list[int], float]]:
    """Groups with what others of the model can do in their place joined to them, and the margin of each.

    Where the best model without a group loses less than `MARGIN`, the terms it brings instead join the
    group; so do two groups of which most draws keep one and hardly any both. `models`, with
    what they lose, are those of the draws, of all rows and of the vehicle file: a forward path alone misses
    better ones.
    """
    best, chosen = min(models)
    todo, done = [list(g) for g in groups], []

    def rival(group: list[int]) -> tuple[list[int], float]:
        anew = propose(root, variance, [k for k in offered if k not in group])
        tried = [(_worth(root, variance, anew), anew)]
        for _, model in sorted(models)[:MOST_MODELS]:
            without = [k for k in model if k not in group]
            more = [k for k in offered if k not in model and k not in group]
            tried += [(_worth(root, variance, m), m) for m in (without, *([*without, k] for k in more))]
        worth, found = min(tried)
        return [k for k in found if k not in chosen], worth - best

    for other in range(len(todo) - 1, 0, -1):
        for one in range(other):
            a, b = (kept[:, todo[i]].any(axis=1) for i in (one, other))
            alone = max(a.mean(), b.mean()) < INCLUDED and min(a.mean(), b.mean()) > SELDOM
            if alone and (a | b).mean() >= INCLUDED and (a & b).mean() < SELDOM:
                todo[one] += todo.pop(other)
                break
    while todo:
        group = todo.pop(0)
        brings, margin = rival(group)
        for _ in range(MOST_JOINED):
            joined = [g for g in todo if set(g) & set(brings)]
            if margin >= MARGIN or not joined or not set(group) & set(chosen):
                break
            todo = [g for g in todo if g not in joined]
            group = sorted([*group, *(k for g in joined for k in g)])
            brings, margin = rival(group)
        done.append((group, margin))
    return done


def propose(root: Array, variance: float, offered: list[int]) -> list[int]:
    """Columns of the best model on PySINDy's forward path, pruned by its thresholded least squares.

    Parameters
    ----------
    root : (r, k + 1) triangular factor of the columns with the target behind them
    variance : of a row, its memory counted
    offered : columns to choose from
    """
    pysindy = _pysindy()
    if not offered:
        return []
    x, y = root[:, offered], root[:, -1:]
    forward = pysindy.FROLS(alpha=0.0, max_iter=min(MOST_TERMS, len(offered)), unbias=False)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            forward.fit(x, y)
        path = [list(np.flatnonzero(coef[0])) for coef in forward.history_]
    except ValueError:  # what is left is parallel to what was taken
        path = [list(np.flatnonzero(coef[0])) for coef in getattr(forward, "history_", [])]
    found: list[int] = []
    best = _worth(root, variance, [])
    for picked in path:
        model = [offered[int(i)] for i in picked]
        worth = _worth(root, variance, model)
        if worth < best:
            found, best = model, worth
    return _pruned(root, variance, found)


def _pruned(root: Array, variance: float, model: list[int]) -> list[int]:
    """PySINDy's STLSQ with every column times its standard error: its threshold is one of significance."""
    while model:
        x, y = root[:, model], root[:, -1:]
        inverse = np.linalg.pinv(x.T @ x)
        error = np.sqrt(variance * np.maximum(np.diag(inverse), 1e-300))
        prune = _pysindy().STLSQ(threshold=THRESHOLD, alpha=0.0, max_iter=1, unbias=False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            prune.fit(x * error, y)
        ratio = np.abs(np.linalg.lstsq(x, y, rcond=None)[0][:, 0]) / error
        gone = np.flatnonzero(np.asarray(prune.coef_)[0] == 0)
        if not gone.size:
            break
        model = [k for i, k in enumerate(model) if i != int(gone[np.argmin(ratio[gone])])]
    return model


def _worth(root: Array, variance: float, model: list[int]) -> float:
    """Log likelihood lost, and the price of the terms."""
    y = root[:, -1]
    left = y - root[:, model] @ np.linalg.lstsq(root[:, model], y, rcond=None)[0] if model else y
    return float(left @ left) / (2 * variance) + COLUMN_PENALTY * len(model)


def _without_twins(theta: Array, columns: Sequence[LibraryColumn], alive: Array) -> list[int]:
    """Columns offered: of those parallel to rounding one only, the vehicle file's first."""
    size = np.linalg.norm(theta, axis=0)
    unit = theta / np.where(size > 0, size, 1.0)
    out: list[int] = []
    for k in sorted(
        map(int, np.flatnonzero(alive)), key=lambda k: (not columns[k].in_model, not columns[k].is_row, k)
    ):
        if all(1.0 - abs(float(unit[:, k] @ unit[:, i])) > SAME_COLUMN for i in out):
            out.append(int(k))
    return sorted(out)


def _smooth_noise(count: int, states: int, rng: np.random.Generator) -> Array:
    """(m, s) standard normal numbers that neighbouring rows share."""
    white = rng.standard_normal((count + NEIGHBOURS - 1, states))
    total = np.cumsum(np.vstack([np.zeros(states), white]), axis=0)
    return (total[NEIGHBOURS:] - total[:-NEIGHBOURS]) / np.sqrt(NEIGHBOURS)


def _pysindy() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its dependencies warn on import
        import pysindy
    return pysindy
