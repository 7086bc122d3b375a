"""One sample interval at a time along any path: its end, and how that moves with state, inputs, parameters.

Takes a `Model`, parameters in SI, a `TimePlan` and the states at the samples, which need not obey the
equations. Gives arrays a Kalman filter can use. Does not filter.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.simulation.actuation import actuate
from bayesid.simulation.prepare import (
    LARGEST_STATE,
    check_parameters,
    choose,
    inverse_mass,
    mass_matrices,
)
from bayesid.simulation.sensors import read_channels
from bayesid.simulation.time_plan import TimePlan

Array = np.ndarray

# Actuator motions kept per run, the latest, and their bytes in all: parameters of the hull leave them as
# they are. None of long runs.
MOST_CHAINS, MOST_BYTES = 3, 4_000_000


@dataclass(frozen=True, eq=False)
class Maps:
    """Linear maps over the n-1 sample intervals of a run.

    Attributes
    ----------
    ends : (n-1, nx) state at the next sample when the interval starts on the path
    phi : (n-1, nx, nx) by the state at the start
    gamma : (n-1, nx, k) by inputs held over the interval, per SI unit (rpm for n)
    psi : (n-1, nx, p) by the free parameters, a view
    """

    ends: Array
    phi: Array
    gamma: Array
    psi: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """Actuators of a run: means and changes of their positions over every step, and the slopes of these."""

    act: Array
    dact: Array

    @property
    def nbytes(self) -> int:
        """Bytes of positions and slopes."""
        return self.act.nbytes + self.dact.nbytes


def chain_of(model: Model, par: Array, plan: TimePlan, free: Array, full: bool = True) -> Chain:
    """What the actuators of a run do with the orders.

    Parameters
    ----------
    free : (p,) positions of parameters; slopes are made where one of them moves an actuator
    """
    par = check_parameters(model, plan, par)
    read = list(choose(model, par, full).act_columns)
    # slopes of the actuators' chain cost twice the chain, with every delayed switch cut out of its step
    slopes = bool(np.isin(read, free).any())
    known = plan.kept.get("chains")
    if known is None or known[0]() is not model:
        # by a weak reference, as in `actuate`
        known = plan.kept["chains"] = (weakref.ref(model), {})
    chains: dict[tuple[bool, bool, bytes], Chain] = known[1]
    key = (full, slopes, par[read].tobytes())
    if key not in chains:
        made = Chain(*actuate(model, par, plan, slopes=slopes, full=full))
        if made.nbytes > MOST_BYTES:
            return made
        chains[key] = made
        while len(chains) > MOST_CHAINS or sum(chain.nbytes for chain in chains.values()) > MOST_BYTES:
            del chains[next(iter(chains))]
    return chains[key]


def interval_maps(
    model: Model,
    par: Array,
    plan: TimePlan,
    states: Array,
    inputs: Sequence[str],
    free: Array,
    full: bool = True,
    part: tuple[int, int] | None = None,
    chain: Chain | None = None,
) -> Maps:
    """Maps of every sample interval started on the path.

    Parameters
    ----------
    states : (n, nx) states at the samples, all of the kernel's (`model.kernel.full.states` or `bare`)
    inputs : names among the kernel's actuators and exogenous inputs
    free : (p,) positions of parameters
    part : first and last sample, the intervals between which are wanted; default all. Inputs are those of the
        whole run
    chain : `chain_of` the same run and parameters, where many parts of it are wanted

    Raises
    ------
    ModelError
        if an interval ends beyond all bounds (`LARGEST_STATE`); names the time
    """
    chain = chain or chain_of(model, par, plan, free, full)
    act, dact = chain.act, chain.dact
    par = check_parameters(model, plan, par)
    fun = choose(model, par, full)
    nx, n_in, n_free = len(fun.states), len(inputs), len(free)
    position = {name: nx + i for i, name in enumerate(inputs)}
    names = (*model.kernel.actuators, *model.kernel.exogenous)
    input_columns = np.array([position.get(name, -1) for name in names], dtype=np.int64)
    column = np.full(par.size, -1, dtype=np.int64)
    column[free] = nx + n_in + np.arange(n_free)
    columns = column[fun.entries[:, 1]]
    act_columns = column[np.array(fun.act_columns, dtype=np.int64)]
    slopes = bool((act_columns >= 0).any())
    n = nx + n_in + n_free
    first, last = part or (0, plan.record.size - 1)
    record = plan.record[first : last + 1]
    steps = slice(record[0], record[-1]) if part else slice(None)
    path = np.array(states[first : last + 1], dtype=float, order="C")
    ends, maps = np.empty((record.size, nx)), np.empty((record.size, nx, n))
    fun.variational(
        par, _inverse_mass(model, full, par.tobytes()), path[0], np.eye(nx, n), plan.times[steps],
        plan.steps[steps], act[steps], dact[steps] if slopes else dact, plan.exogenous[steps],
        record - record[0] if part else record, fun.entries, columns, act_columns, input_columns, path, ends,
        maps, np.empty((0, nx)), np.empty((0, nx, n)),
    )  # fmt: skip
    ends, maps = ends[1:], maps[1:]
    good = (np.abs(ends) <= LARGEST_STATE).all(axis=1)  # false for nan
    if not good.all():
        at = plan.t[first + int(np.argmin(good))]
        raise ModelError(f"the vehicle diverges between samples at t = {at:.6g} s")
    psi = maps[:, :, nx + n_in :]
    return Maps(
        ends,
        np.ascontiguousarray(maps[:, :, :nx]),
        np.ascontiguousarray(maps[:, :, nx : nx + n_in]),
        psi if n_free else psi.copy(),  # a view of nothing would keep all of it in memory
    )


@lru_cache(maxsize=4)
def _inverse_mass(model: Model, full: bool, par: bytes) -> Array:
    """(nv*nv) inverse mass matrix, once for all runs of a pass."""
    fun = model.kernel.full if full else model.kernel.bare
    return inverse_mass(model, fun, np.frombuffer(par)[None])[0]


def inertia_ratio(model: Model, par: Array, free: Array) -> tuple[Array, Array]:
    """Mass matrix over the nominal one, M(par) M0^-1, and its derivative by the free parameters.

    Returns
    -------
    (nv, nv) and (p, nv, nv)
    """
    fun = model.kernel.full
    back = np.linalg.inv(mass_matrices(model, fun, model.nominal[None])[0])
    step = 1e-4 * np.maximum(np.abs(model.nominal[free]), np.maximum(np.abs(par[free]), 1e-6))
    pars = np.repeat(np.asarray(par, dtype=float)[None], 2 * len(free) + 1, axis=0)
    pars[1 + 2 * np.arange(len(free)), free] += step
    pars[2 + 2 * np.arange(len(free)), free] -= step
    mass = mass_matrices(model, fun, pars)
    slope = (mass[1::2] - mass[2::2]) / (2.0 * step[:, None, None]) if len(free) else mass[:0]
    return mass[0] @ back, slope @ back


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings on a path with slopes.

    Attributes
    ----------
    values : (n, channels)
    by_state : (n, channels, nx)
    by_parameter : (n, channels, p)
    """

    values: Array
    by_state: Array
    by_parameter: Array


def part_of(plan: TimePlan, first: int, last: int) -> TimePlan:
    """Samples `first` to `last` of a plan, as `readings_on` needs it; at its end inputs are those before."""
    record = plan.record[first : last + 1]
    steps = slice(record[0], record[-1])
    return replace(
        plan, t=plan.t[first : last + 1], times=plan.times[steps], steps=plan.steps[steps],
        record=record - record[0], command=plan.command[steps], exogenous=plan.exogenous[steps],
    )  # fmt: skip


# maps of a path that diverges are finite but huge; what overflows here is refused with the products of it
@np.errstate(over="ignore", invalid="ignore")
def readings_on(
    model: Model,
    par: Array,
    plan: TimePlan,
    states: Array,
    maps: Maps,
    free: Array,
    full: bool = True,
) -> Readings:
    """Readings of every channel on a path, with slopes by the state at the sample and by the free parameters.

    A sensor delay T reads x(t) - T dx/dt to second order, the rate taken from the interval maps, so that its
    slopes need the state at one sample only.
    """
    par = np.array(par, dtype=float, order="C")
    fun = choose(model, par, full)
    column = {int(p): c for c, p in enumerate(free)}
    values, by_state, sparse = read_channels(fun, par, plan, states, True)
    by_parameter = np.zeros((plan.t.size, values.shape[1], len(free)))
    entries = [(e, int(c), column[int(p)]) for e, (c, p) in enumerate(fun.sensor_entries) if int(p) in column]
    for e, c, k in entries:
        by_parameter[:, c, k] += sparse[:, e]
    late_by = {channel: float(sum(par[i] for i in ids)) for channel, ids in fun.delays.items()}
    late_by = {c: d for c, d in late_by.items() if d != 0.0 or any(i in column for i in fun.delays[c])}
    if not late_by:
        return Readings(values, by_state, by_parameter)
    rate = _rate(plan, states, maps)
    for channel in [c for c, d in late_by.items() if d == 0.0]:  # nothing but the slope by the delay is new
        change = np.einsum("ix,ix->i", by_state[:, channel], rate)
        for k in (column[i] for i in fun.delays[channel] if i in column):
            by_parameter[:, channel, k] -= change
        del late_by[channel]
    if not late_by:
        return Readings(values, by_state, by_parameter)
    turn, force = _turn_and_force(plan, states, maps)
    for channel, delay in late_by.items():
        wanted = [column[i] for i in fun.delays[channel] if i in column]
        acceleration = np.einsum("ixy,iy->ix", turn, rate)
        late, late_slope, late_sparse = read_channels(
            fun, par, plan, states - delay * rate + 0.5 * delay**2 * acceleration, True
        )
        values[:, channel] = late[:, channel]
        back = np.eye(states.shape[1]) - delay * turn + 0.5 * delay**2 * turn @ turn
        by_state[:, channel] = np.einsum("ix,ixy->iy", late_slope[:, channel], back)
        change = np.gradient(force, plan.t, axis=0) if plan.t.size > 1 else np.zeros_like(force)
        forth = -delay * force + 0.5 * delay**2 * (turn @ force + change)
        by_parameter[:, channel] = np.einsum("ix,ixk->ik", late_slope[:, channel], forth)
        for e, c, k in entries:
            if c == channel:
                by_parameter[:, c, k] += late_sparse[:, e]
        for k in wanted:
            by_parameter[:, channel, k] -= np.einsum(
                "ix,ix->i", late_slope[:, channel], rate - delay * acceleration
            )
    return Readings(values, by_state, by_parameter)


def _rate(plan: TimePlan, states: Array, maps: Maps) -> Array:
    """(n, nx) rate of the state at the samples, from the interval maps."""
    mean_rate = (maps.ends - states[:-1]) / np.diff(plan.t)[:, None]
    rate = np.empty_like(states)
    rate[1:-1] = 0.5 * (mean_rate[1:] + mean_rate[:-1])
    rate[0], rate[-1] = mean_rate[0], mean_rate[-1]
    return rate


def _turn_and_force(plan: TimePlan, states: Array, maps: Maps) -> tuple[Array, Array]:
    """Jacobian of the rate of the state and its slope by parameters at the samples."""
    gaps = np.diff(plan.t)[:, None]
    eye = np.eye(states.shape[1])
    step = (maps.phi - eye) / gaps[:, :, None]
    turn = step - 0.5 * gaps[:, :, None] * step @ step
    turn = np.concatenate([turn, turn[-1:]])
    force = maps.psi / gaps[:, :, None]
    return turn, np.concatenate([force, force[-1:]])
