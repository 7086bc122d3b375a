"""The vehicles with other equations: numbers, rates of change, size of a step, sensors' noise.

Takes: a name. Gives a frozen `OtherVehicle`. Does not simulate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from bayesid.benchmark.other_equations.mmg_ship import self_propulsion_rps, ship_numbers, ship_rates
from bayesid.benchmark.other_equations.strip_auv import auv_numbers, auv_rates, cruise_rps
from bayesid.errors import ModelError

DEG = math.pi / 180


@dataclass(frozen=True, eq=False)
class OtherVehicle:
    """One vehicle.

    Attributes
    ----------
    numbers, rates : record of its equations and their compiled right-hand side
    rho, L, U, rpm : density, length [m], speed [m/s] and the shaft speed [rpm] that gives it
    rudder_max, rudder_rate, rudder_lag, shaft_lag : [rad], [rad/s], [s], [s]; lags are the vehicle's own
    depth : at which it starts [m]
    dt, step : of the log and of the integration [s]
    zigzags, turns : rudder and switch, rudder [deg]
    run : usual seconds of a run
    noise : channel -> sd
    without : listed causes that do not fit it
    """

    name: str
    text: str
    numbers: np.void
    rates: Callable[..., None]
    rho: float
    L: float
    U: float
    rpm: float
    rudder_max: float
    rudder_rate: float
    rudder_lag: float
    shaft_lag: float
    depth: float
    dt: float
    step: float
    zigzags: tuple[tuple[float, float], ...]
    turns: tuple[float, ...]
    run: float
    noise: Mapping[str, float]
    without: tuple[str, ...] = ()

    @property
    def parts(self) -> int:
        """Steps between two samples."""
        return max(1, math.ceil(self.dt / self.step - 1e-9))

    @property
    def LU(self) -> float:
        return self.L / self.U


def _ship(
    name: str, text: str, length: float, speed: float, dt: float, run: float, **noise: float
) -> OtherVehicle:
    b = ship_numbers(length, **({"w_P0": 0.35} if length > 100 else {}))
    rate = 2.34 * DEG * math.sqrt(320.0 / length)  # of the full-size ship, by Froude's law
    rpm = round(60 * self_propulsion_rps(b, speed), 1)
    return OtherVehicle(
        name, text, b, ship_rates, float(b["rho"]), length, speed, rpm,
        35 * DEG, rate, 0.0, 0.0, 0.0, dt, 0.003 * length / speed, ((10, 10), (20, 20)), (15, 20), run, noise,
    )  # fmt: skip


@cache
def other_vehicle(name: str) -> OtherVehicle:
    """A vehicle by name.

    Raises
    ------
    ModelError                 there is none of this name
    """
    if name == "tanker_model":
        noise = dict(x=0.03, y=0.03, psi=0.0034, r=6e-4, u=0.006, v=0.006)
        return _ship(name, "Tanker model, 7 m, MMG", 7.0, 1.0, 0.5, 240.0, **noise)
    if name == "tanker":
        noise = dict(x=1.0, y=1.0, psi=0.0035, r=2e-4, u=0.01, v=0.01)
        return _ship(name, "Tanker, 320 m, MMG", 320.0, 7.0, 4.0, 1600.0, **noise)
    if name == "strip_auv":
        b = auv_numbers()
        noise = dict(x=0.15, y=0.15, psi=0.004, r=8.7e-4, u=0.006, v=0.006)
        return OtherVehicle(
            name, "AUV, 1.33 m, lift and strips, rolls", b, auv_rates, float(b["rho"]), 1.33, 1.5,
            round(60 * cruise_rps(b, 1.5), 1), 13.6 * DEG, 60 * DEG, 0.0, 0.0, float(b["depth"]), 0.4, 0.01,
            ((8, 8), (12, 15)), (6, 10), 150.0, noise, ("wind",),
        )  # fmt: skip
    raise ModelError(f"other equations: no vehicle {name!r}; there are {', '.join(VEHICLES)}")


VEHICLES = ("tanker_model", "tanker", "strip_auv")
