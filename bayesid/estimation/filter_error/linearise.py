"""Linearise a model along any path of one logged run.

Takes a `RunData` and a `Trajectory` (parameters, states at every sample, latent forces), which need not
obey the equations: each sample interval is run on its own and the gap to the next state is kept as a defect.
Gives a frozen `Linearisation`. Does not whiten, choose amplitudes or know which columns are coefficients and
which are effects.

A latent force is stated for the nominal inertia: it is the acceleration it gives that is fixed while inertia
is free. Otherwise a row of the balance could shrink together with its noise, and a path fitted jointly with
the coefficients would always prefer that (measured: N_rdot 20 prior sd off on a clean trial in a rough sea).

Slopes by the parameters are taken along the filtered path, what was known before each interval, once there
is one. Along the smoothed path they would be correlated with the very innovations they explain, and
coefficients would drift to where they shrink the noise (prediction-error identification; Ljung 1999, 8.5). In
a straight run even the rudder answers the environment, so there slopes are taken at rest, fins at their means
(otherwise a disturbance was measured 70 times too quiet).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bayesid.equations.model import Model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.parameter_slopes import (
    HeldSlopes,
    ParameterSlopes,
    RemadeSlopes,
    runs_held,
)
from bayesid.estimation.filter_error.read_run import ANGLES
from bayesid.estimation.run_data import Array, RunData
from bayesid.simulation import TimePlan, chain_of, inertia_ratio, interval_maps, readings_on
from bayesid.threads import each

# States of a straight run that keep their own course when slopes by the parameters are taken.
STRAIGHT_STATES = frozenset({"x", "y", "z", "phi", "theta", "psi", "u"})


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where a run is linearised.

    Attributes
    ----------
    par : (n_par,) parameters [SI]
    states : (n, nx) states at the samples
    force : (n-1, n_force) latent forces held over each sample interval [N, N m]
    before : (n, nx) states known from readings up to each sample; None where no filter has run
    """

    par: Array
    states: Array
    force: Array
    before: Array | None = None


@dataclass(frozen=True, eq=False)
class PerturbedTrajectories:
    """States and inputs beside the path at which slopes by the parameters are taken, and what they give.

    Attributes
    ----------
    plan : inputs, without latent forces
    states : (n, nx)
    ends : (n-1, nx) end of each interval started at `states`
    values : (n, q) readings at `states`
    """

    plan: TimePlan
    states: Array
    ends: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Linearisation:
    """One run linearised about a point.

    Attributes
    ----------
    resid : (n, q) reading minus model on the path, angles wrapped
    slope : (n, q, nx) of the readings by the state
    by_parameter : of readings and interval ends by the free parameters; `direct` and `psi` are all of them
    phi, gamma : (n-1, nx, ..) maps by state and latent inputs (`inputs`)
    defect : (n-1, nx) end of each interval minus the next state of the path
    aside : Aside, where slopes by parameters were taken: the path itself where no filter has run
    """

    log: RunData
    point: Trajectory
    resid: Array
    slope: Array
    by_parameter: ParameterSlopes
    phi: Array
    gamma: Array
    defect: Array
    inputs: tuple[str, ...]
    aside: PerturbedTrajectories

    @property
    def held(self) -> bool:
        """Whether slopes by the free parameters are there, and not made anew block by block."""
        return isinstance(self.by_parameter, HeldSlopes)

    @property
    def size(self) -> int:
        """Bytes of its maps and slopes."""
        slopes = self.by_parameter
        held = slopes.direct.nbytes + slopes.psi.nbytes if isinstance(slopes, HeldSlopes) else 0
        return held + self.phi.nbytes + self.gamma.nbytes + self.slope.nbytes

    @property
    def direct(self) -> Array:
        """(n, q, p) of the readings by the free parameters at fixed state."""
        return self.by_parameter.part(0, self.log.n)[0]

    @property
    def psi(self) -> Array:
        """(n-1, nx, p) of the interval ends by the free parameters."""
        return self.by_parameter.part(0, self.log.n)[1]


def latent_inputs(model: Model) -> tuple[str, ...]:
    """Names of the inputs a latent signal may enter: forces first, then actuators and moving water."""
    flow = tuple(n for n in model.kernel.exogenous if n.startswith("flow_"))
    return (*forces(model), *model.kernel.actuators, *flow)


def forces(model: Model) -> tuple[str, ...]:
    """The latent inputs an environment enters by: all a fit needs."""
    return tuple(n for n in model.kernel.exogenous if n.startswith("force_"))


def first_trajectory(model: Model, log: RunData, par: Array) -> Trajectory:
    """Point of the readings' own path, without latent forces."""
    n_force = sum(n.startswith("force_") for n in model.kernel.exogenous)
    return Trajectory(par, log.path, np.zeros((log.n - 1, n_force)))


def linearise_runs(
    model: Model,
    logs: Sequence[RunData],
    points: Sequence[Trajectory],
    free: Array,
    inputs: tuple[str, ...] | None = None,
) -> list[Linearisation]:
    """Paths of all runs, slopes by the parameters held as far as those of all together may be."""
    wide = len(model.kernel.channels) + points[0].states.shape[1] if points else 0
    held = runs_held([log.n for log in logs], wide, len(free))
    return each(lambda log, point, hold: linearise(model, log, point, free, inputs, hold), logs, points, held)


def linearise(
    model: Model,
    log: RunData,
    point: Trajectory,
    free: Array,
    inputs: tuple[str, ...] | None = None,
    hold: bool | None = None,
) -> Linearisation:
    """Path of one run about a point, with exact slopes by the free parameters.

    Parameters
    ----------
    free : (p,) positions of parameters
    inputs : the latent inputs to carry, the forces first; default all
    hold : whether slopes by the parameters are held; default as one run alone may

    Raises
    ------
    ModelError
        if an interval leaves the finite numbers
    """
    beside = len(free) > 0 and (log.straight or point.before is not None)
    if hold is None:
        (hold,) = runs_held([log.n], len(model.kernel.channels) + point.states.shape[1], len(free))
    here = free[:0] if beside or not hold else free
    ratio, ratio_slope = _inertia_at(model, point, here)
    forces_now = point.force @ ratio.T
    plan = with_forces(model, log.plan, forces_now)
    inputs = latent_inputs(model) if inputs is None else inputs
    # the actuators' motion is the same whatever forces act, and along both paths
    chain = chain_of(model, point.par, log.plan, free if hold else free[:0])
    maps = interval_maps(model, point.par, plan, point.states, inputs, here, chain=chain)
    n_force = point.force.shape[1]
    raw = maps.gamma[:, :, :n_force].copy()
    maps.gamma[:, :, :n_force] = raw @ ratio
    if point.force.any() and len(here):
        heavy = np.flatnonzero(ratio_slope.any(axis=(1, 2)))  # the parameters the inertia depends on
        change = np.einsum("ixf,pfg,ig->ixp", raw, ratio_slope[heavy], point.force, optimize=True)
        maps.psi[:, :, heavy] += change
    readings = readings_on(model, point.par, plan, point.states, maps, here)
    picked = _columns(tuple(log.positions(model)))
    psi, direct = maps.psi, readings.by_parameter
    aside = PerturbedTrajectories(plan, point.states, maps.ends, readings.values[:, picked])
    if beside:
        where, states = _beside(model, log, point)
        try:
            same = chain if where is log.plan else None
            other = interval_maps(model, point.par, where, states, (), free if hold else free[:0], chain=same)
        except ModelError:
            if log.straight:
                raise
            # the filtered path may leave the numbers where the smoothed one, which has seen all, does not
            return linearise(model, log, replace(point, before=None), free, inputs, hold)
        seen = readings_on(model, point.par, where, states, other, free if hold else free[:0])
        psi, direct = other.psi, seen.by_parameter
        aside = PerturbedTrajectories(where, states, other.ends, seen.values[:, picked])
    by_parameter = HeldSlopes(direct[:, picked], psi) if hold else _remade(model, log, point, aside, free)
    resid = wrap(model, log, log.readings - readings.values[:, picked])
    defect = maps.ends - point.states[1:]
    return Linearisation(
        log,
        point,
        resid,
        np.ascontiguousarray(readings.by_state[:, picked]),
        by_parameter,
        maps.phi,
        maps.gamma,
        defect,
        inputs,
        aside,
    )


def released(model: Model, path: Linearisation, free: Array) -> Linearisation:
    """The same with slopes by the `free` parameters, with which it was made, made anew where asked for."""
    if not path.held:
        return path
    return replace(path, by_parameter=_remade(model, path.log, path.point, path.aside, free))


def _remade(
    model: Model, log: RunData, point: Trajectory, aside: PerturbedTrajectories, free: Array
) -> RemadeSlopes:
    """Slopes along `aside`; where that is the path itself its latent forces have a part in them."""
    forced = bool(point.force.any()) and not (log.straight or point.before is not None)
    _, ratio_slope = _inertia_at(model, point, free if forced else free[:0])
    return RemadeSlopes(
        model, point.par, aside.plan, aside.states, free, _columns(tuple(log.positions(model))),
        forces(model) if forced else (), point.force, ratio_slope,
    )  # fmt: skip


def _inertia_at(model: Model, point: Trajectory, free: Array) -> tuple[Array, Array]:
    return _inertia(model, point.par.tobytes(), free.astype(np.int64).tobytes())


@lru_cache(maxsize=4)
def _inertia(model: Model, par: bytes, free: bytes) -> tuple[Array, Array]:
    """`inertia_ratio`, once for all runs of a pass."""
    return inertia_ratio(model, np.frombuffer(par), np.frombuffer(free, dtype=np.int64))


def _columns(channels: tuple[int, ...]) -> slice | list[int]:
    """Channels as a slice where they are neighbours: a view is free, a copy is half the cost of a stack."""
    if channels and channels == tuple(range(channels[0], channels[0] + len(channels))):
        return slice(channels[0], channels[0] + len(channels))
    return list(channels)


def _beside(model: Model, log: RunData, point: Trajectory) -> tuple[TimePlan, Array]:
    """Inputs and states at which slopes by the parameters are taken."""
    if not log.straight:
        assert point.before is not None
        return log.plan, point.before
    plan = replace(log.plan, command=_held(model, log.plan.command), levels=_held(model, log.plan.levels))
    return plan, _calmed(model, point.states)


def _calmed(model: Model, states: Array) -> Array:
    """(n, nx) states with sideways velocities and turning rates at their means over the run."""
    out = states.copy()
    for j, name in enumerate(model.kernel.full.states):
        if name not in STRAIGHT_STATES:
            out[:, j] = states[:, j].mean()
    return out


def _held(model: Model, command: Array) -> Array:
    """Commands with fins at their means: a helmsman answers the environment."""
    out = command.copy()
    for j, name in enumerate(model.kernel.actuators):
        if name != "n":
            out[:, j] = command[:, j].mean()
    return out


def wrap(model: Model, log: RunData, resid: Array) -> Array:
    """Residuals with angles brought into (-pi, pi]."""
    out = resid.copy()
    for j, c in enumerate(log.channels):
        if c in ANGLES:
            out[:, j] = (out[:, j] + np.pi) % (2 * np.pi) - np.pi
    return out


def with_forces(model: Model, plan: TimePlan, force: Array) -> TimePlan:
    """Plan with latent forces added to its inputs; `force` is held over each sample interval."""
    if not np.any(force):
        return plan
    exo = plan.exogenous.copy()
    count = np.diff(plan.record)
    names = [n for n in model.kernel.exogenous if n.startswith("force_")]
    for j, name in enumerate(names):
        exo[:, model.kernel.exogenous.index(name)] += np.repeat(force[:, j], count)
    return replace(plan, exogenous=exo)
