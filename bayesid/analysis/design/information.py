"""What a run would tell about the coefficients: Fisher information, its initial state marginalised.

Takes a `Model`, `Knowledge`, parameter vectors and runs, logged or only planned. Gives `RunInformation`: one
matrix per drawn vehicle, in units of what is known. Noise is white as stated, or that of a campaign
(`CampaignNoise`); no reading is needed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayesid.analysis.design.campaign_noise import CampaignNoise
from bayesid.analysis.design.prior_knowledge import Knowledge
from bayesid.equations.model import Model
from bayesid.errors import FitError
from bayesid.estimation.output_error.read_run import initial_spread
from bayesid.estimation.run_data import RunData
from bayesid.manoeuvres import Manoeuvre, OpenLoop
from bayesid.simulation import (
    TimePlan,
    Track,
    observe_sensitivity,
    plan_run,
    run_manoeuvre,
    sensitivities,
    steady_start,
)

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Logging:
    """What will be logged.

    Attributes
    ----------
    sigma : channel -> standard deviation of its white noise [SI]
    dt : time between readings [s]
    """

    sigma: Mapping[str, float]
    dt: float

    def __post_init__(self) -> None:
        bad = [f"{c} = {s:g}" for c, s in self.sigma.items() if not 0 < s < np.inf]
        if bad or not self.sigma or not 0 < self.dt < np.inf:
            raise FitError(
                f"logging every {self.dt:g} s with noise {', '.join(bad) or 'on no channel'}: "
                "give positive numbers"
            )


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """One planned run of one vehicle: what it is ordered, where it goes.

    track is at the manoeuvre's own steps, run at the logger's.
    """

    name: str
    track: Track
    commands: Mapping[str, Array]
    run: RunData


@dataclass(frozen=True, eq=False)
class RunInformation:
    """Fisher information of one run or a set, per vehicle drawn.

    Attributes
    ----------
    name : of the run, or of the runs
    duration : [s]
    matrices : (d, k, k) information about xi, where coefficients = mean + root xi: 1 is as much as is known
    """

    name: str
    duration: float
    matrices: Array

    def __add__(self, other: RunInformation) -> RunInformation:
        return RunInformation(
            f"{self.name} + {other.name}", self.duration + other.duration, self.matrices + other.matrices
        )


def nothing(knowledge: Knowledge, draws: int) -> RunInformation:
    """No run at all."""
    k = len(knowledge.names)
    return RunInformation("nothing", 0.0, np.zeros((draws, k, k)))


def usual_logging(model: Model, sigma: Mapping[str, float] | None = None, dt: float | None = None) -> Logging:
    """A plain logger: positions to a hundredth of a length, at best 0.2 m (depth a tenth of it), angles to
    0.5 degrees, speeds to 1 %, rates to 0.01 U/L, four readings per length travelled; what is given replaces
    it.

    Raises
    ------
    FitError
        a channel the model does not give
    """
    length, speed = model.scales["L"], model.scales["U"]
    position = max(0.01 * length, 0.2)
    plain: dict[str, float] = {"x": position, "y": position, "z": 0.1 * position}
    plain |= dict.fromkeys(("phi", "theta", "psi"), math.radians(0.5))
    plain |= dict.fromkeys("uvw", 0.01 * speed) | dict.fromkeys("pqr", 0.01 * speed / length)
    wrong = [c for c in sigma or {} if c not in model.kernel.channels]
    if wrong:
        there = ", ".join(model.kernel.channels)
        raise FitError(f"no channel {', '.join(wrong)}; a {model.dof}-DOF model gives {there}")
    return Logging(dict(sigma or {c: plain[c] for c in model.states}), dt or 0.25 * length / speed)


def planned(model: Model, par: Array, manoeuvre: Manoeuvre, logging: Logging, name: str = "") -> PlannedRun:
    """Run a manoeuvre with one vehicle from a straight run and lay out what would be logged.

    Raises
    ------
    ModelError
        if the vehicle diverges
    """
    manoeuvre, x0 = _begun(model, manoeuvre)
    track, commands = run_manoeuvre(model, par, manoeuvre, x0)
    run = laid_out(model, track.t, commands, x0, logging, name)
    return PlannedRun(name or manoeuvre.name, track, commands, run)


def _begun(model: Model, manoeuvre: Manoeuvre) -> tuple[Manoeuvre, Array]:
    """The manoeuvre with a shaft speed, and the straight run it starts from."""
    usual = model.vehicle.rpm_ref or 0.0
    if not isinstance(manoeuvre, OpenLoop):
        return manoeuvre, steady_start(model, manoeuvre.start.get("n_cmd", usual))
    if "n_cmd" not in manoeuvre.commands:
        commands = {**manoeuvre.commands, "n_cmd": np.full(manoeuvre.t.shape, usual)}
        manoeuvre = replace(manoeuvre, commands=commands)
    return manoeuvre, steady_start(model, float(manoeuvre.commands["n_cmd"][0]))


def laid_out(
    model: Model, t: Array, commands: Mapping[str, Array], x0: Array, logging: Logging, name: str
) -> RunData:
    """Samples, channels and noise of a planned run; the readings are not known yet."""
    plan = plan_run(model, t, commands)
    plan = _every(plan, max(1, round(logging.dt / float(np.median(np.diff(t))))))
    channels = tuple(logging.sigma)
    return RunData(
        name,
        plan,
        channels,
        np.zeros((plan.t.size, len(channels))),
        np.array([logging.sigma[c] for c in channels]),
        x0,
        model.states,
        initial_spread(model, x0, model.states),
    )


def _every(plan: TimePlan, count: int) -> TimePlan:
    """The plan with every `count`-th sample only; steps and commands as they are."""
    # numba compiles every kernel once more for an array with gaps
    return replace(plan, t=plan.t[::count].copy(), record=plan.record[::count].copy())


def columns(model: Model, knowledge: Knowledge, par: Array, run: RunData) -> tuple[Array, Array]:
    """Whitened sensitivities of the readings of a run.

    Returns
    -------
    (n, c, k) by xi and (n, c, i) by the unknown initial states over their prior sd; 0 where nothing is read

    Raises
    ------
    ModelError
        if the vehicle diverges
    """
    result = sensitivities(model, par, run.plan, run.x0, knowledge.where, initial=bool(run.initial))
    points = [i for n, i in model.index.items() if n.startswith("point_")]
    if not result.track.full and all(c in model.states for c in run.channels) and not np.any(par[points]):
        jac = result.jacobian[:, [model.states.index(c) for c in run.channels]]
    else:
        _, jac = observe_sensitivity(model, par, run.plan, result, knowledge.where)
        jac = jac[:, [model.kernel.channels.index(c) for c in run.channels]]
    jac = jac / np.asarray(run.sigma)[:, None]
    jac[~np.isfinite(run.readings)] = 0.0
    k = len(knowledge.names)
    first = [k + model.states.index(s) for s in run.initial]
    return jac[:, :, :k] @ knowledge.root, jac[:, :, first] * run.initial_sd


def run_information(model: Model, knowledge: Knowledge, par: Array, run: RunData) -> Array:
    """(k, k) Fisher information of a run about xi at one vehicle, its start marginalised over the prior.

    Readings err independently, as stated.
    """
    _, a, b, q = _start_apart(model, knowledge, par, run)
    seen = q[: len(b)].T @ a
    matrix = a.T @ a - seen.T @ seen
    return 0.5 * (matrix + matrix.T)


def runs_information(
    model: Model, knowledge: Knowledge, par: Array, runs: Sequence[RunData], noise: CampaignNoise | None
) -> Array:
    """(k, k) information of several runs or pieces at one vehicle, under the noise of a campaign."""
    if noise is None:
        return np.sum([run_information(model, knowledge, par, run) for run in runs], axis=0)
    scores = []
    for run in runs:
        by_xi, a, b, q = _start_apart(model, knowledge, par, run)
        seen = q[: len(b)].T @ a
        free = (a - q[: len(b)] @ seen).reshape(by_xi.shape)
        scores.append(noise.score(run.name, free, -q[len(b) :] @ seen, run.valid, run.channels, _step(run)))
    matrix = noise.information(scores)
    return 0.5 * (matrix + matrix.T)


def _start_apart(
    model: Model, knowledge: Knowledge, par: Array, run: RunData
) -> tuple[Array, Array, Array, Array]:
    """Slopes by xi, whole (n, c, k) and flat, by the start, flat, and a basis of what the start moves."""
    by_xi, by_start = columns(model, knowledge, par, run)
    a = by_xi.reshape(-1, by_xi.shape[2])
    b = by_start.reshape(-1, by_start.shape[2])
    # by QR, not by B'B: in an unstable vehicle the start is felt e^20 times and B'B has no inverse left
    size = np.maximum(np.linalg.norm(b, axis=0), 1.0)
    return by_xi, a, b, np.linalg.qr(np.vstack([b / size, np.diag(1.0 / size)]))[0]


def _step(run: RunData) -> float:
    """Time between its samples [s]."""
    return float(np.median(np.diff(run.plan.t)))


def information(
    model: Model,
    knowledge: Knowledge,
    draws: Array,
    manoeuvre: Manoeuvre,
    logging: Logging,
    name: str = "",
    noise: CampaignNoise | None = None,
) -> RunInformation:
    """Information of a planned manoeuvre, executed by every vehicle drawn.

    Raises
    ------
    ModelError
        if one of them diverges
    """
    if isinstance(manoeuvre, OpenLoop):
        begun, x0 = _begun(model, manoeuvre)
        assert isinstance(begun, OpenLoop)
        run = laid_out(model, begun.t, begun.commands, x0, logging, name)
        runs = [run] * len(draws)
    else:
        runs = [planned(model, par, manoeuvre, logging, name).run for par in draws]
    if noise is not None:
        runs = [noise.as_logged(run, _step(run)) for run in runs]
    each = zip(draws, runs, strict=True)
    matrices = [runs_information(model, knowledge, par, [run], noise) for par, run in each]
    return RunInformation(name or manoeuvre.name, float(manoeuvre.duration), np.array(matrices))


def executed_information(
    model: Model,
    knowledge: Knowledge,
    draws: Array,
    runs: Sequence[RunData],
    name: str = "flown",
    noise: CampaignNoise | None = None,
) -> RunInformation:
    """Information of logged runs, with their own samples and inputs."""
    matrices = [runs_information(model, knowledge, par, runs, noise) for par in draws]
    seconds = sum(float(run.plan.t[-1] - run.plan.t[0]) for run in runs)
    return RunInformation(name, seconds, np.array(matrices))
