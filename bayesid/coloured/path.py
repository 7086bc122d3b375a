"""Linearise a model along one logged run: residuals, step maps, sensitivity columns.

Takes a `Model`, a run and a point (parameters, initial state, latent forces). Gives a frozen `Path`.
Does not whiten, choose amplitudes or know which columns are coefficients and which are effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayesid.model import Model
from bayesid.simulate import (
    Plan,
    interval_maps,
    observe,
    observe_sensitivity,
    plan_trial_run,
    reading_slopes,
    sensitivities,
    simulate,
    steady_start,
)

Array = np.ndarray
ANGLES = frozenset({"psi", "phi", "theta"})


@dataclass(frozen=True, eq=False)
class Log:
    """Readings of one run in the order of the model's channels.

    Attributes
    ----------
    name, manoeuvre, role : as in the bundle
    plan : Plan
    channels : (q,) positions of the measured channels in `model.kernel.channels`
    data, valid : (n, q) readings [SI] and whether they count
    sigma : (q,) white sensor noise, one standard deviation
    start : (nx0,) first guess of the initial state, from the readings
    start_sd : (nx0,) how far it may be off
    """

    name: str
    manoeuvre: str
    role: str
    plan: Plan
    channels: tuple[int, ...]
    data: Array
    valid: Array
    sigma: Array
    start: Array
    start_sd: Array

    @property
    def n(self) -> int:
        return int(self.plan.t.size)


@dataclass(frozen=True, eq=False)
class Point:
    """Where a run is linearised: parameters [SI], initial state, latent forces held over each sample interval."""

    par: Array
    x0: Array
    force: Array


@dataclass(frozen=True, eq=False)
class Path:
    """One run linearised about a point.

    Attributes
    ----------
    states : (n, nx)
    resid : (n, q) reading minus model, angles wrapped
    slope : (n, q, nx) derivative of the readings by the state
    phi, gamma : (n-1, nx, nx) and (n-1, nx, n_inputs) maps over the sample intervals, inputs as in `inputs`
    columns : (n, q, k) derivative of the readings by the k free parameters
    """

    log: Log
    point: Point
    states: Array
    resid: Array
    slope: Array
    phi: Array
    gamma: Array
    columns: Array
    inputs: tuple[str, ...]


def latent_inputs(model: Model) -> tuple[str, ...]:
    """Names of the inputs a latent signal may enter: forces first, then actuators and moving water."""
    forces = tuple(n for n in model.kernel.exogenous if n.startswith("force_"))
    flow = tuple(n for n in model.kernel.exogenous if n.startswith("flow_"))
    return (*forces, *model.kernel.actuators, *flow)


def prepare(model: Model, run: Any, noise: dict[str, float], channels: Sequence[str]) -> Log:
    """Readings of a trial run with a first guess of its initial state.

    Parameters
    ----------
    run : trials.Run
    noise : channel -> white sensor sigma [SI]
    channels : names to use, a subset of the kernel's channels
    """
    plan = plan_trial_run(model, run)
    names = [c for c in channels if c in run.data]
    data = np.column_stack([run.data[c] for c in names])
    start, start_sd = _first_state(model, run, noise, plan)
    return Log(
        name=run.name,
        manoeuvre=run.manoeuvre,
        role=run.role,
        plan=plan,
        channels=tuple(model.kernel.channels.index(c) for c in names),
        data=data,
        valid=np.isfinite(data),
        sigma=np.array([noise[c] for c in names]),
        start=start,
        start_sd=start_sd,
    )


def _first_state(model: Model, run: Any, noise: dict[str, float], plan: Plan) -> tuple[Array, Array]:
    """Local quadratic fits to the first readings; a straight run at the commanded revolutions where nothing is logged."""
    scale = model.scales
    span = max(0.5 * scale["L"] / scale["U"], 6.0 * float(np.median(np.diff(run.t))))
    rpm = float(plan.command[0, model.kernel.actuators.index("n")])
    try:
        guess = steady_start(model, rpm)
    except Exception:
        guess = steady_start(model) if model.vehicle.rpm_ref else np.zeros(len(model.states))
    fitted: dict[str, tuple[float, float]] = {}
    inside = run.t <= run.t[0] + span
    for name in set(run.data) & set(model.states):
        t = run.t[inside] - run.t[0]
        y = np.unwrap(run.data[name][inside]) if name in ANGLES and np.isfinite(run.data[name]).all() else run.data[name][inside]
        good = np.isfinite(y)
        if good.sum() < 3:
            continue
        basis = np.vander(t[good], 2, increasing=True)
        value = np.linalg.lstsq(basis, y[good], rcond=None)[0]
        fitted[name] = (float(value[0]), float(value[1]))
    x0 = dict(zip(model.states, guess, strict=True))
    for name in model.states:
        if name in fitted:
            x0[name] = fitted[name][0]
    psi = x0["psi"]
    if "u" not in fitted and "x" in fitted and "y" in fitted:
        dx, dy = fitted["x"][1], fitted["y"][1]
        speed = dx * np.cos(psi) + dy * np.sin(psi)
        if np.isfinite(speed) and abs(speed - x0["u"]) < scale["U"]:
            x0["u"], x0["v"] = float(speed), float(dy * np.cos(psi) - dx * np.sin(psi))
    if "r" not in fitted and "psi" in fitted:
        x0["r"] = fitted["psi"][1]
    # Wide on purpose: the first readings only start the search, the whole run decides.
    wide = {
        **dict.fromkeys(("x", "y", "z"), 0.5 * scale["L"] + 10.0 * max(noise.get(n, 0.0) for n in ("x", "y"))),
        **dict.fromkeys(("phi", "theta", "psi"), 0.3),
        **dict.fromkeys(("u", "v", "w"), 0.3 * scale["U"]),
        **dict.fromkeys(("p", "q", "r"), 0.3 * scale["U"] / scale["L"]),
    }
    start = np.array([x0[n] for n in model.states])
    start_sd = np.array([wide[n] for n in model.states])
    return start, start_sd


def linearise(model: Model, log: Log, point: Point, free: Array, full: bool = True) -> Path:
    """Path of one run about a point, with exact columns for the free parameters.

    Parameters
    ----------
    point : latent forces (n-1, number of force inputs) [N, N m]
    free : positions of the parameters that get a column
    """
    plan = with_forces(model, log.plan, point.force)
    result = sensitivities(model, point.par, plan, point.x0, free, initial=False, full=full, rates=True)
    obs, jac = observe_sensitivity(model, point.par, plan, result, free)
    picked = list(log.channels)
    resid = log.data - obs[:, picked]
    _wrap(model, log, resid)
    phi, gamma = interval_maps(model, point.par, plan, point.x0, latent_inputs(model), full)
    slope = reading_slopes(model, point.par, plan, result.track)[:, picked]
    return Path(log, point, result.track.states, resid, slope, phi, gamma, jac[:, picked], latent_inputs(model))


def replay(model: Model, log: Log, point: Point, full: bool = True) -> Array:
    """(n, q) readings of the model at a point, angles unwrapped towards the data."""
    plan = with_forces(model, log.plan, point.force)
    track = simulate(model, point.par, plan, point.x0, full=full)
    obs = observe(model, point.par, plan, track.states, full=full)[:, list(log.channels)]
    resid = log.data - obs
    _wrap(model, log, resid)
    return np.where(np.isfinite(resid), log.data - resid, obs)


def _wrap(model: Model, log: Log, resid: Array) -> None:
    for j, c in enumerate(log.channels):
        if model.kernel.channels[c] in ANGLES:
            resid[:, j] = (resid[:, j] + np.pi) % (2 * np.pi) - np.pi


def with_forces(model: Model, plan: Plan, force: Array) -> Plan:
    """Plan with latent forces added to its inputs; `force` is held over each sample interval."""
    if not np.any(force):
        return plan
    exo = plan.exogenous.copy()
    count = np.diff(plan.record)
    names = [n for n in model.kernel.exogenous if n.startswith("force_")]
    for j, name in enumerate(names):
        exo[:, model.kernel.exogenous.index(name)] += np.repeat(force[:, j], count)
    return replace(plan, exogenous=exo)
