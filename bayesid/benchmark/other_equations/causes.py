"""What can be wrong with the other vehicles, by the names and parameters of the effect contract, and three
causes without a name there.

Takes: a generator, a size (1 is usual) and the scales of a vehicle. Gives `Planted`: parameters for the
label, settings for the plant. A lag or dead time comes on top of the vehicle's own; the label of a lag states
both together, as the simulator of the bundle has neither. Does not apply them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesid.errors import ModelError

DEG = math.pi / 180
FORCES = (
    "current_n", "current_e", "wind_n", "wind_e", "thrust_loss", "fouling", "side_force",
    "bottom", "bottom_n", "bottom_e", "bottom_k", "swell", "swell_w", "swell_p", "swell_n", "swell_e",
)  # fmt: skip
INPUTS = ("offset", "lag", "slow", "dead", "jam_from", "jam_for")
SENSORS = ("psi_bias", "psi_drift", "r_scale", "v_late", "arm_x", "arm_y")
KIND = np.dtype([(name, "f8") for name in FORCES + INPUTS + SENSORS])


@dataclass(frozen=True)
class Scales:
    """Length [m], speed [m/s], 1/2 rho L^2 U^2 [N], rudder rate [rad/s]; seconds of a run and of a step; the
    rudder's own lag [s]."""

    L: float
    U: float
    force: float
    rate: float
    run: float
    step: float
    lag: float = 0.0

    @property
    def LU(self) -> float:
        return self.L / self.U


@dataclass(frozen=True)
class Planted:
    """One cause: its name, what a label says of it, what the plant is told, further numbers nobody scores."""

    name: str
    parameters: Mapping[str, float]
    settings: Mapping[str, float]
    more: Mapping[str, float]


Numbers = dict[str, float]
Draw = Callable[[np.random.Generator, float, Scales], tuple[Numbers, Numbers, Numbers]]


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _one(parameter: str, setting: str, usual: float, scale: str = "", sided: bool = True) -> Draw:
    def draw(rng: np.random.Generator, size: float, s: Scales) -> tuple[Numbers, Numbers, Numbers]:
        value = usual * size * (s.LU if scale else 1.0) * (_sign(rng) if sided else 1.0)
        return {parameter: value}, {setting: value}, {}

    return draw


def _two(parameters: Sequence[str], settings: Sequence[str], usual: float, scale: str) -> Draw:
    def draw(rng: np.random.Generator, size: float, s: Scales) -> tuple[Numbers, Numbers, Numbers]:
        way = rng.uniform(0.0, 2.0 * math.pi)
        pair = [usual * size * getattr(s, scale) * part for part in (math.cos(way), math.sin(way))]
        return dict(zip(parameters, pair, strict=True)), dict(zip(settings, pair, strict=True)), {}

    return draw


def _wind(rng, size, s):
    # the speed is not scored: it means something only with exposed areas, which the contract leaves open
    speed, way = 2.5 * size * s.U, float(rng.uniform(0.0, 2.0 * math.pi))
    blowing = {"wind_n": -speed * math.cos(way), "wind_e": -speed * math.sin(way)}
    return {"from": way}, blowing, {"speed": speed}


def _rate_limit(rng, size, s):
    excess = 2.0 * size * s.LU
    return {"inverse_rate_excess": excess}, {"slow": excess}, {"rate": 1.0 / (1.0 / s.rate + excess)}


def _jam(rng, size, s):
    held, first = 6.0 * size * s.LU, float(rng.uniform(0.3, 0.5)) * s.run
    return {"seconds_each": held}, {"jam_from": first, "jam_for": held}, {"from": first}


def _bottom(rng, size, s):
    way, wave = rng.uniform(0.0, 2.0 * math.pi), 2.0 * math.pi / (20.0 * s.L)
    told = {"share": 0.5 * size, "wave_length": 20.0 * s.L}
    where = {"bottom_n": math.cos(way), "bottom_e": math.sin(way), "bottom_k": wave}
    return told, {"bottom": 0.5 * size} | where, {}


def _swell(rng, size, s):
    way, w = rng.uniform(0.0, 2.0 * math.pi), float(rng.uniform(1.0, 2.0)) / s.LU
    told = {"force": 4e-4 * s.force * size, "frequency": w}
    fields = {"swell": told["force"], "swell_w": w, "swell_p": float(rng.uniform(0.0, 2.0 * math.pi))}
    return told, fields | {"swell_n": math.cos(way), "swell_e": math.sin(way)}, {}


def _lag(rng, size, s):
    # a simulator that steers without a lag lacks the servo's own too; lags in a row delay by their sum
    added = 0.5 * size * s.LU
    return {"tau": added + s.lag}, {"lag": added}, {"own": s.lag} if s.lag else {}


def _dead_time(rng, size, s):
    delay = round(0.5 * size * s.LU / s.step) * s.step  # the plant delays by whole steps
    return {"delay": delay}, {"dead": delay}, {}


def _drift(rng, size, s):
    rate = 4.0 * DEG * size * _sign(rng) / s.run
    return {"drift_per_600s": 600.0 * rate}, {"psi_drift": rate}, {}


LISTED: Mapping[str, Draw] = {
    "ocean_current": _two(("V_north", "V_east"), ("current_n", "current_e"), 0.12, "U"),
    "wind": _wind,
    "rudder_offset": _one("offset", "offset", 2.0 * DEG),
    "actuator_lag": _lag,
    "actuator_rate_limit": _rate_limit,
    "actuator_dead_time": _dead_time,
    "thrust_loss": _one("loss", "thrust_loss", 0.2, sided=False),
    "hull_fouling": _one("drag_increase", "fouling", 0.3, sided=False),
    "propeller_side_force": _one("side_force", "side_force", 0.1),
    "gyro_scale": _one("scale", "r_scale", 0.03),
    "heading_bias": _one("bias", "psi_bias", 2.5 * DEG),
    "heading_drift": _drift,
    "velocity_latency": _one("delay", "v_late", 0.5, "L/U", False),
    "position_lever_arm": _two(("l_x", "l_y"), ("arm_x", "arm_y"), 0.3, "L"),
}
# Largest sizes that are still what the name says: a gale, half of the thrust, five degrees of compass.
LARGEST = {"wind": 1.5, "thrust_loss": 2.0, "hull_fouling": 2.5, "heading_bias": 2.0, "gyro_scale": 2.0}
ANY_LARGEST = 3.0
UNLISTED: Mapping[str, Draw] = {"rudder_jam": _jam, "uneven_bottom": _bottom, "swell": _swell}


def plant_causes(
    names: Sequence[str], sizes: Sequence[float], rng: np.random.Generator, scales: Scales
) -> tuple[Planted, ...]:
    """Causes by name, each of a size (1 is usual).

    Raises
    ------
    ModelError                 for a name that is neither listed nor unlisted here
    """
    drawn = {**LISTED, **UNLISTED}
    unknown = [n for n in names if n not in drawn]
    if unknown:
        raise ModelError(f"other equations: no cause {', '.join(unknown)}; there are {', '.join(drawn)}")
    return tuple(
        Planted(n, *drawn[n](rng, size, scales)) for n, size in zip(names, sizes, strict=True)
    )  # fmt: skip


def settings_of(planted: Sequence[Planted]) -> np.void:
    """Record the plant reads; all zero is the plain vehicle."""
    out = np.zeros(1, KIND)[0]
    for cause in planted:
        for name, value in cause.settings.items():
            out[name] += value
    return out
