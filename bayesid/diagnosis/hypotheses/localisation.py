"""Where the gap lies: a generic latent signal put into each channel, then masked to time, manoeuvre and
regime.

Takes a `DiagnosisProblem` and linearisation points. Gives evidence per channel and per mask, and the
smoothed force with its band. Names channels, never causes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.diagnosis.hypotheses.periodic_signal import periodic_signals
from bayesid.diagnosis.hypotheses.stretch import Stretch, stretch_of
from bayesid.equations.model import Model
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.linearise import Linearisation, Trajectory, linearise_runs
from bayesid.estimation.filter_error.noise_model import (
    LatentInputs,
    NoiseModel,
    force_unit,
    smoothed,
)
from bayesid.estimation.filter_error.normal_equations import each_run
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import Array

# Amplitudes relative to each channel's unit, and correlation times in L/U: fast, slow, and lasting a run.
SIGNAL_AMPLITUDES = (1e-3, 1e-2, 1e-1, 1.0)
SIGNAL_TAUS = (1.0, 8.0, 64.0)
# Places of a signal that is an error of sensors.
SENSORS = {"x,y": ("x", "y"), "psi": ("psi",), "r": ("r",), "u,v": ("u", "v"), "z": ("z",)}


@dataclass(frozen=True)
class LocatedSignal:
    """Evidence of a latent signal in one place.

    Attributes
    ----------
    amplitude, tau : of the best signal without a period, over its unit, and [s]
    average : over all amplitudes and times
    period : [s] where a periodic signal gains most, else None
    """

    channel: str
    evidence: float
    amplitude: float
    tau: float
    average: float
    period: float | None = None


@dataclass(frozen=True)
class Mask:
    """Evidence of the winning channel's latent signal when it may act only in one window or regime."""

    kind: str
    name: str
    evidence: float
    share: float


@dataclass(frozen=True, eq=False)
class Localisation:
    """Where the gap lies.

    Attributes
    ----------
    places : channels, most probable first; evidence over the environment alone
    masks : windows, manoeuvres and regimes of the winning channel, most probable first
    outside : log evidence of a latent force or input averaged over channel, amplitude, and correlation time
        or frequency
    times, force, band : per run, smoothed latent force in X, Y, N (and Z, K, M) [N, N m] and one standard
    deviation
    gains : (channel, amplitude, time [s]) -> evidence of every force or input tried that has no period
    stretch : of one run, to which the signal of the winning channel can be confined; None where it acts in
        several
    """

    places: tuple[LocatedSignal, ...]
    masks: tuple[Mask, ...]
    outside: float
    base: float
    runs: tuple[str, ...]
    times: tuple[Array, ...]
    force: tuple[Array, ...]
    band: tuple[Array, ...]
    gains: Mapping[tuple[str, float, float], float] = field(default_factory=dict)
    stretch: Stretch | None = None

    def kept(self, after: Localisation) -> float:
        """What the best force or input found here still gains in what an explanation leaves; inf if it has a
        period."""
        if not self.gains or not after.gains:
            return np.inf
        best = max(self.gains, key=lambda k: self.gains[k])
        forces = {channel for channel, *_ in self.gains}
        top = max((p.evidence for p in self.places if p.channel in forces), default=-np.inf)
        return after.gains[best] if top <= self.gains[best] else np.inf


def channel_sets(problem: DiagnosisProblem) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Latent inputs and sensor channels of each place."""
    planar = problem.model.dof == 3
    axes = ("X", "Y", "N") if planar else ("X", "Y", "N", "Z", "K", "M")
    out: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {a: ((f"force_{a}",), ()) for a in axes}
    out["Y+N"] = (("force_Y", "force_N"), ())
    out["X+Y+N"] = (("force_X", "force_Y", "force_N"), ())
    if not planar:
        out["Z+M"] = (("force_Z", "force_M"), ())
    out["rudder"] = (("delta_r",), ())
    out["rpm"] = (("n",), ())
    out["current"] = (("flow_north", "flow_east"), ())
    for name, channels in SENSORS.items():
        if all(c in problem.channels for c in channels):
            out[name] = ((), channels)
    return out


def tried(problem: DiagnosisProblem) -> int:
    """Number of free signals `locate` tries."""
    return len(channel_sets(problem)) * len(SIGNAL_AMPLITUDES) * (len(SIGNAL_TAUS) + 1)


def units(model: Model) -> dict[str, float]:
    """A large disturbance of each latent input and channel: amplitudes are fractions of it."""
    s = model.scales
    names = [n for n in model.kernel.exogenous if n.startswith("force_")]
    out = {n: 0.01 * float(f) for n, f in zip(names, force_unit(model), strict=True)}
    rpm = model.vehicle.rpm_ref or 100.0
    out |= {"delta_r": 0.3, "delta_s": 0.3, "delta_b": 0.3, "n": 0.3 * rpm}
    out |= dict.fromkeys(("flow_north", "flow_east", "flow_down"), 0.3 * s["U"])
    out |= dict.fromkeys(("x", "y", "z"), s["L"]) | dict.fromkeys(("psi", "phi", "theta"), 0.3)
    out |= dict.fromkeys(("u", "v", "w"), 0.3 * s["U"]) | dict.fromkeys(
        ("p", "q", "r"), 0.3 * s["U"] / s["L"]
    )
    return out


def _evidence(
    problem: DiagnosisProblem,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    latent: LatentInputs | None,
) -> float:
    equations = each_run(problem.model, paths, free, noise_model, latent)
    return posterior(sum(equations[1:], equations[0])).log_evidence


def locate(
    problem: DiagnosisProblem, points: Sequence[Trajectory], free: GaussianPrior, masks: bool = True
) -> Localisation:
    """Evidence of a generic latent signal in every place.

    Parameters
    ----------
    points : linearisation points, best a path that follows the data
    free : parameters integrated out (coefficients, and effects already in the model)
    """
    model = problem.model
    noise_model = problem.environment.noise_model
    paths = linearise_runs(model, problem.logs, points, free.where)
    base = _evidence(problem, paths, free, noise_model, None)
    size, time = units(model), model.scales["L"] / model.scales["U"]
    places, averages = [], []
    gains: dict[tuple[str, float, float], float] = {}
    sets = channel_sets(problem)
    periodic = periodic_signals(problem, paths, free, sets, size, SIGNAL_AMPLITUDES)
    for name, (inputs, channels) in sets.items():
        seen = []
        for a in SIGNAL_AMPLITUDES:
            for tau in SIGNAL_TAUS:
                latent = LatentInputs(
                    inputs, channels, tuple(a * size[n] for n in (*inputs, *channels)), tau * time
                )
                seen.append((_evidence(problem, paths, free, noise_model, latent), a, tau * time))
        best = max(seen)
        best_periodic = periodic.get(name)
        beats = list(best_periodic.evidence) if best_periodic else []
        average = _log_mean([t[0] for t in seen] + beats)
        period = best_periodic.period if best_periodic and max(beats) > best[0] else None
        top = max([best[0], *beats])
        places.append(LocatedSignal(name, top - base, best[1], best[2], average - base, period))
        # A signal on a sensor stands for drift, or for noise faster than the sampling, as well as a fault.
        if inputs:
            averages.append(average)
            gains |= {(name, a, tau): value - base for value, a, tau in seen}
    places.sort(key=lambda p: -p.evidence)
    found: tuple[Mask, ...] = ()
    stretch = None
    if masks and places[0].evidence > 5.0 and sets[places[0].channel][0]:
        found = _masks(problem, paths, free, noise_model, places[0], base)
        stretch = stretch_of(problem, paths, free, noise_model, _of_place(problem, places[0]))
    times, force, band = _force(problem, paths, free, noise_model, size, places)
    return Localisation(
        tuple(places),
        found,
        _log_mean(averages),
        base,
        tuple(log.name for log in problem.logs),
        times,
        force,
        band,
        gains,
        stretch,
    )


def _log_mean(values: Sequence[float]) -> float:
    top = max(values)
    return float(top + np.log(np.mean(np.exp(np.array(values) - top))))


def _of_place(problem: DiagnosisProblem, place: LocatedSignal) -> LatentInputs:
    """The best latent signal of a place that has inputs."""
    inputs, size = channel_sets(problem)[place.channel][0], units(problem.model)
    return LatentInputs(inputs, (), tuple(place.amplitude * size[n] for n in inputs), place.tau)


def _masks(
    problem: DiagnosisProblem,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    place: LocatedSignal,
    base: float,
) -> tuple[Mask, ...]:
    allowed = _of_place(problem, place)
    out = []
    for kind, name, where in regimes(problem):
        share = sum(int(m.sum()) for m in where) / sum(m.size for m in where)
        if not 0.02 < share < 0.98:
            continue
        latent = replace(allowed, masks=tuple(where))
        out.append(Mask(kind, name, _evidence(problem, paths, free, noise_model, latent) - base, share))
    return tuple(sorted(out, key=lambda m: -m.evidence))


def regimes(problem: DiagnosisProblem) -> list[tuple[str, str, list[Array]]]:
    """Masks per run: each manoeuvre, time windows, and regimes of motion taken from the readings' own
    path."""
    model = problem.model
    names = model.kernel.full.states
    logs = problem.logs
    out: list[tuple[str, str, list[Array]]] = []
    for k, log in enumerate(logs):
        if len(logs) > 1:
            masks = [np.full(other.n, i == k) for i, other in enumerate(logs)]
            out.append(("manoeuvre", f"{log.name}: {log.manoeuvre}", masks))
    window = 40.0 * model.scales["L"] / model.scales["U"]
    for k, log in enumerate(logs):
        t = log.plan.t - log.plan.t[0]
        for start in np.arange(0.0, t[-1], window):
            inside = (t >= start) & (t < start + window)
            masks = [inside if i == k else np.zeros(other.n, dtype=bool) for i, other in enumerate(logs)]
            out.append(("window", f"{log.name} {start:.0f}-{min(start + window, t[-1]):.0f} s", masks))

    def signal(log: object, name: str) -> Array:
        if name in names:
            return log.path[:, names.index(name)]  # type: ignore[attr-defined]
        plan = log.plan  # type: ignore[attr-defined]
        return plan.command[np.minimum(plan.record, plan.steps.size - 1), model.kernel.actuators.index(name)]

    def split(label: str, values: list[Array], high: str, low: str) -> None:
        middle = float(np.median(np.concatenate(values)))
        out.append(("regime", f"{label} {high}", [v > middle for v in values]))
        out.append(("regime", f"{label} {low}", [v <= middle for v in values]))

    split("|rudder|", [np.abs(signal(log, "delta_r")) for log in logs], "high", "low")
    split("|yaw rate|", [np.abs(signal(log, "r")) for log in logs], "high", "low")
    drift = [np.abs(signal(log, "v") / np.maximum(np.abs(signal(log, "u")), 0.05)) for log in logs]
    split("|drift angle|", drift, "high", "low")
    split("speed", [signal(log, "u") for log in logs], "high", "low")
    rate = [signal(log, "r") for log in logs]
    still = 0.05 * model.scales["U"] / model.scales["L"]
    out.append(("regime", "turning to starboard", [r > still for r in rate]))
    out.append(("regime", "turning to port", [r < -still for r in rate]))
    return out


def _force(
    problem: DiagnosisProblem,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
    size: dict[str, float],
    places: Sequence[LocatedSignal],
) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
    """Smoothed force in all axes, under the amplitude of the best force place."""
    force_places = [p for p in places if p.channel[0] in "XYZKMN"]
    best = force_places[0]
    inputs = tuple(n for n in problem.model.kernel.exogenous if n.startswith("force_"))
    latent = LatentInputs(inputs, (), tuple(best.amplitude * size[n] for n in inputs), best.tau)
    equations = each_run(problem.model, paths, free, noise_model, latent)
    values = free.mean + free.sd * posterior(sum(equations[1:], equations[0])).mean
    times, force, band = [], [], []
    for k, path in enumerate(paths):
        sm = smoothed(problem.model, path, values - path.point.par[free.where], noise_model, latent, k)
        nx, nf = path.point.states.shape[1], len(inputs)
        first = nx + len(noise_model.force)
        times.append(path.log.plan.t - path.log.plan.t[0])
        force.append(sm.mean[:, first : first + nf])
        band.append(np.sqrt(np.maximum(sm.variance[:, first : first + nf], 0.0)))
    return tuple(times), tuple(force), tuple(band)
