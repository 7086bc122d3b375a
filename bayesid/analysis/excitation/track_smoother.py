"""Body velocities and accelerations from a logged track: a Kalman smoother that knows kinematics, no forces.

Takes `trials.Run`s and their sensor noise. Gives a `Motion` each, with standard deviations. No mass or
coefficient of the vehicle enters. Accelerations are a mean that is linear in a few features of motion and
inputs, fitted to these runs, plus Ornstein-Uhlenbeck processes whose size and correlation time also come from
the readings. Without the mean a smoother rounds the corners that rudder steps make, and the error looks like
forces of the rudder: a planted N_|r|dr of a tenth of its size was found where there was none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.excitation.motion import Motion
from bayesid.equations.formulas import KINEMATICS_3, KINEMATICS_6
from bayesid.equations.model import Model
from bayesid.errors import TrialError
from bayesid.estimation.filter_error.kalman import whiten
from bayesid.estimation.filter_error.read_run import ANGLES, filter_error_run
from bayesid.estimation.filter_error.smoother import smooth
from bayesid.estimation.run_data import RunData
from bayesid.simulation import mean_positions
from bayesid.trials import Run
from bayesid.trials.noise import rough_noise

Array = np.ndarray

# Correlation times of the accelerations that are tried, in L/U.
TIMES = (0.5, 1.5, 5.0)
PASSES = 5
# Misfit of a reading given all others, over its deviation, from which it is set aside.
OUTLIER = 6.0
# Least noise of a channel that states none, over its standard deviation.
SMOOTH = 1e-4
# What must be logged for a velocity to be seen: any one of these sets.
_SEEN = {
    "u": (("u",), ("u_water",), ("x", "y")),
    "v": (("v",), ("v_water",), ("x", "y")),
    "w": (("w",), ("w_water",), ("z",)),
    "p": (("p",), ("phi",)),
    "q": (("q",), ("theta",)),
    "r": (("r",), ("psi",)),
}


@dataclass(frozen=True, eq=False)
class Smoothing:
    """Settings of the smoother.

    Attributes
    ----------
    sd : (nv,) stationary sd of what the mean leaves of every acceleration [SI]
    tau : correlation time of that [s]
    mean : (nv, k) accelerations over `_features`
    """

    sd: Array
    tau: float
    mean: Array


@dataclass(frozen=True, eq=False)
class _Work:
    """One run while it is smoothed: log, actuators over the intervals, states and remaining accelerations."""

    log: RunData
    act: Array
    states: Array
    rest: Array
    variance: Array
    value: float = 0.0


def smooth_tracks(
    model: Model, runs: Sequence[Run], noise: Mapping[str, float], drift: float = 0.0
) -> tuple[list[Motion], Smoothing]:
    """Motion of every run at the middles of its sample intervals.

    Parameters
    ----------
    noise : channel -> one sigma of white sensor noise [SI]; estimated for channels without it
    drift : one sigma of a slow position error [m]

    Raises
    ------
    TrialError
        if neither a speed nor positions, or neither heading nor yaw rate, are logged
    """
    whole = stated_or_rough(runs, noise)
    works = [_begin(model, _log(model, run, whole)) for run in runs]
    time = model.scales["L"] / model.scales["U"]
    tried = [_settle(model, works, tau * time, drift) for tau in TIMES]
    best = max(tried, key=lambda found: sum(work.value for work in found[0]))
    return [_motion(model, work, best[1]) for work in best[0]], best[1]


def stated_or_rough(runs: Sequence[Run], noise: Mapping[str, float]) -> dict[str, float]:
    """Noise of every channel logged: as stated, else from its own fast changes.

    A filtered or simulated log looks almost free of noise; a floor of `SMOOTH` of its spread keeps it usable.
    """
    out = {name: sigma for name, sigma in noise.items() if sigma > 0}
    for name in {c for run in runs for c in run.data} - out.keys():
        rough = [rough_noise(run.t, run.data[name]) for run in runs if name in run.data]
        spread = [float(np.nanstd(run.data[name])) for run in runs if name in run.data]
        found = [max(r, SMOOTH * s) for r, s in zip(rough, spread, strict=True) if np.isfinite(r)]
        if found and max(found) > 0:
            out[name] = float(np.median(found))
    return out


def _log(model: Model, run: Run, noise: Mapping[str, float]) -> RunData:
    channels = [c for c in model.kernel.channels if c in run.data and noise.get(c, 0.0) > 0]
    missing = [
        v
        for v in model.kernel.velocities
        if v in "uvr" and not any(all(c in channels for c in need) for need in _SEEN[v])
    ]
    if missing:
        raise TrialError(
            f"{run.name}: {', '.join(missing)} cannot be had from {', '.join(channels) or 'nothing'}; log x, "
            "y and psi, or u, v and r"
        )
    return filter_error_run(model, run, noise, channels)


def _held(model: Model, log: RunData) -> Array:
    """(nv,) velocities no reading tells of; they stay at zero."""
    names = list(log.channels)
    return np.array(
        [not any(all(c in names for c in need) for need in _SEEN[v]) for v in model.kernel.velocities]
    )


def _begin(model: Model, log: RunData) -> _Work:
    nx, nv = len(model.states), len(model.kernel.velocities)
    plan = log.plan
    act = mean_positions(model, model.nominal, plan, full=False)
    states = log.path[:, :nx].copy()
    states[:, nx - nv :][:, _held(model, log)] = 0.0
    nothing = np.zeros((log.n - 1, nv))
    return _Work(log, act, states, nothing, np.zeros((log.n, nx + nv)))


def _features(model: Model, states: Array, act: Array) -> Array:
    """(n, k) what an acceleration is mostly made of, over U, L and the reference revolutions."""
    length, speed = model.scales["L"], model.scales["U"]
    known = {n: states[:, i] for i, n in enumerate(model.states)}
    inputs = {n: act[:, i] for i, n in enumerate(model.kernel.actuators)}
    u, v, r = known["u"] / speed, known["v"] / speed, known["r"] * length / speed
    n = inputs["n"] / (model.vehicle.rpm_ref or 1.0)
    out = [u * u, u * n, n * np.abs(n), u * v, u * r, v * r, u * u * inputs["delta_r"]]
    if model.dof == 6:
        w, p, q = known["w"] / speed, known["p"] * length / speed, known["q"] * length / speed
        out += [u * w, u * p, u * q, w * q, u * u * inputs["delta_s"], u * u * inputs["delta_b"]]
        out += [np.sin(known["theta"]), np.sin(known["phi"])]
    return np.column_stack(out)


def _step(model: Model, mean: Array, work: _Work, states: Array, rest: Array) -> Array:
    """States one interval on under accelerations that hold over it, by the midpoint rule."""
    names, nv = model.states, rest.shape[1]
    formulas = KINEMATICS_3 if model.dof == 3 else KINEMATICS_6
    pose, h = len(names) - nv, np.diff(work.log.plan.t)[:, None]

    def change(at: Array) -> Array:
        known = {n: at[:, i] for i, n in enumerate(names)}
        scope = {"__builtins__": {}, "sin": np.sin, "cos": np.cos}
        turn = np.column_stack([eval(formulas[n], scope, known) for n in names[:pose]])  # our own formulas
        return np.hstack([turn, rest + _features(model, at, work.act) @ mean.T])

    return states + h * change(states + 0.5 * h * change(states))


def _slopes(model: Model, mean: Array, work: _Work) -> tuple[Array, Array]:
    """(n, nx, nx) and (n, nx, nv) derivatives of `_step`, by central differences."""
    states, rest = work.states[:-1], work.rest
    (n, nx), nv = states.shape, rest.shape[1]
    phi, gamma = np.empty((n, nx, nx)), np.empty((n, nx, nv))
    for i in range(nx + nv):
        move, push = np.zeros(nx), np.zeros(nv)
        (move if i < nx else push)[i if i < nx else i - nx] = 1e-5
        ahead = _step(model, mean, work, states + move, rest + push)
        slope = (ahead - _step(model, mean, work, states - move, rest - push)) / 2e-5
        if i < nx:
            phi[:, :, i] = slope
        else:
            gamma[:, :, i - nx] = slope
    return phi, gamma


def _settle(model: Model, works: list[_Work], tau: float, drift: float) -> tuple[list[_Work], Smoothing]:
    """Smoothed runs with mean and sizes of the accelerations that reproduce themselves."""
    nv = len(model.kernel.velocities)
    length, speed = model.scales["L"], model.scales["U"]
    turning = np.array([v in "pqr" for v in model.kernel.velocities])
    sd = 0.1 * speed**2 / length * np.where(turning, 4.0 / length, 1.0)
    sd[_held(model, works[0].log)] = 0.0
    first = _features(model, works[0].states[:1], works[0].act[:1])
    settings = Smoothing(sd, tau, np.zeros((nv, first.shape[1])))
    for k in range(PASSES):
        works = [_pass(model, work, settings, drift, strict=0 < k < PASSES - 1) for work in works]
        if k == PASSES - 1:
            break
        middle = [0.5 * (w.states[1:] + w.states[:-1]) for w in works]
        features = [_features(model, m, w.act) for m, w in zip(middle, works, strict=True)]
        whole = [w.rest + f @ settings.mean.T for w, f in zip(works, features, strict=True)]
        x, y = np.concatenate(features), np.concatenate(whole)
        size = np.sqrt(np.mean(x**2, axis=0)) + 1e-12
        mean = (np.linalg.lstsq(x / size, y, rcond=1e-4)[0] / size[:, None]).T
        left = y - x @ mean.T
        spread = np.concatenate([w.variance[:-1, -nv:] for w in works])
        works = [replace(w, rest=a - f @ mean.T) for w, a, f in zip(works, whole, features, strict=True)]
        settings = Smoothing(np.sqrt(np.mean(left**2 + spread, axis=0)), tau, mean)
    return works, settings


def _pass(model: Model, work: _Work, settings: Smoothing, drift: float, strict: bool) -> _Work:
    """One linearised smoothing pass; with `strict`, readings the others contradict are set aside after it."""
    log, h = work.log, np.diff(work.log.plan.t)
    nx, nv = work.states.shape[1], work.rest.shape[1]
    names = list(log.channels)
    phi, gamma = _slopes(model, settings.mean, work)
    slope = np.zeros((log.n, len(names), nx))
    for j, name in enumerate(names):
        slope[:, j, model.states.index(name.removesuffix("_water"))] = 1.0
    resid = log.readings - np.einsum("iqx,ix->iq", slope, work.states)
    for j, name in enumerate(names):
        if name in ANGLES:
            resid[:, j] = (resid[:, j] + np.pi) % (2 * np.pi) - np.pi
    resid = np.where(log.valid, resid, 0.0)
    drive = _step(model, settings.mean, work, work.states[:-1], work.rest) - work.states[1:]
    drive -= np.einsum("ixf,if->ix", gamma, work.rest)
    position = [j for j, name in enumerate(names) if name in ("x", "y", "z") and drift > 0]
    loading = np.zeros((len(names), len(position)))
    for k, j in enumerate(position):
        loading[j, k] = 1.0
    slow = 25.0 * model.scales["L"] / model.scales["U"]
    start = log.initial_sd[:nx] ** 2
    start[nx - nv :] *= ~_held(model, log)
    settled = (
        log.valid, slope, log.sigma**2, phi, gamma,
        np.repeat(np.exp(-h / settings.tau)[:, None], nv, axis=1), settings.sd**2,
        loading, np.repeat(np.exp(-h / slow)[:, None], len(position), axis=1),
        np.full(len(position), drift**2), start,
    )  # fmt: skip
    first = log.path[0, :nx] - work.states[0]
    first[nx - nv :] *= ~_held(model, log)
    m, q = nx + nv + len(position), len(names)
    white = np.empty((log.n * q, 1))
    logdet, used = whiten(
        np.ascontiguousarray(resid[:, :, None]), np.ascontiguousarray(drive[:, :, None]),
        np.ascontiguousarray(first[:, None]), *settled, white,
    )  # fmt: skip
    value = -0.5 * (float((white**2).sum()) + logdet + used * np.log(2 * np.pi))
    mean, variance = np.empty((log.n, m)), np.empty((log.n, m))
    standard, alone = np.empty((log.n, q)), np.empty((log.n, q))
    smooth(resid, drive, first, *settled, mean, variance, standard, alone)
    if strict and log.valid.any():
        # where motion between samples is rougher than assumed, all readings contradict each other a little
        usual = max(1.0, float(np.median(np.abs(alone[log.valid]))) / 0.6745)
        log = log.without(np.abs(alone) > OUTLIER * usual)
    return _Work(
        log,
        work.act,
        work.states + mean[:, :nx],
        np.ascontiguousarray(mean[:-1, nx : nx + nv]),
        np.maximum(variance[:, : nx + nv], 0.0),
        value,
    )


def _motion(model: Model, work: _Work, settings: Smoothing) -> Motion:
    nv, edges = work.rest.shape[1], work.log.plan.t
    middle = 0.5 * (work.states[1:] + work.states[:-1])
    sd = work.variance[:, :-nv]
    return Motion(
        work.log.name,
        0.5 * (edges[1:] + edges[:-1]),
        np.diff(edges),
        middle,
        work.rest + _features(model, middle, work.act) @ settings.mean.T,
        work.act,
        np.sqrt(0.5 * (sd[1:] + sd[:-1])),
        np.sqrt(work.variance[:-1, -nv:]),
        edges,
    )
