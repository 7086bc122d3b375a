"""Figure of the forms of effects: what the catalogue chose beside the alternatives, from the declarations.

Takes a vehicle's scales. Every curve is the declared formula, evaluated; no formula is written here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bayesid.equations.derivatives import Graph
from bayesid.model.effects import CATALOGUE, Effect
from bayesid.model.effects.alternatives import ALTERNATIVES
from bayesid.report.figure_style import styled, subplots

_BY_NAME = {e.name: e for e in (*CATALOGUE, *ALTERNATIVES)}
DEGREES = np.pi / 180.0


def value(formula: str, names: Mapping[str, float], calls: Mapping[str, float] | None = None) -> float:
    """A declared formula at numbers; calls such as thrust() or rows(...) give the number named.

    Raises
    ------
    ModelError
        for a name or function without a number
    """
    g = Graph()

    def constant(number: float) -> Callable[..., int]:
        return lambda *_: g.const(number)

    nodes = {name: g.const(number) for name, number in names.items()}
    found = g.value(g.parse(formula, nodes, {name: constant(v) for name, v in (calls or {}).items()}))
    assert found is not None  # all that goes in is a number
    return found


def _curve(effect: Effect, formula: str, along: str, at: np.ndarray, names: dict, calls: dict) -> np.ndarray:
    defaults = {p.name: p.mean for p in effect.parameters}
    return np.array([value(formula, {**defaults, **names, along: float(x)}, calls) for x in at])


def _forces(name: str, axis: str, along: str, at: np.ndarray, names: dict, calls: dict) -> np.ndarray:
    effect = _BY_NAME[name]
    return _curve(effect, effect.force[axis], along, at, names, calls)


@styled
def forms(L: float = 5.0, U: float = 2.0, rho: float = 1000.0) -> Any:
    """Six panels: stall, thrust decay, race, cross-flow, ballast and fouling, catalogue form and other form.

    Parameters
    ----------
    L, U, rho : length [m], usual speed [m/s], density [kg/m3] of the vehicle the curves are drawn for
    """
    figure, panels = subplots(3, 2, height=7.2)
    (stall, decay), (race, cross), (mass, drag) = panels
    usual = {"L": L, "U_ref": U, "rho": rho, "rpm_ref": 1.0, "n": 1.0, "u": U, "v": 0.0, "r": 0.0}

    angle = np.linspace(0.0, 35.0, 71)
    size = {"inverse_stall_angle": 1.0 / (25.0 * DEGREES)}
    turning = {**usual, **size, "v": U * np.tan(12.0 * DEGREES)}
    for name, label in (("rudder_stall", "rudder_stall"), ("rudder_stall_inflow", "by inflow, 12° of drift")):
        kept = 1.0 + _forces(name, "Y", "delta_r", angle * DEGREES, turning, {"rows": 1.0})
        stall.plot(angle, 100 * kept, label=label)
    stall.set(xlabel="rudder [deg]", ylabel="lift kept [%]", title="Stall at 25°")

    t = np.linspace(0.0, 600.0, 61)
    for name, label in (("thrust_decay", "thrust_decay"), ("thrust_decay_late", "late")):
        left = 1.0 + _forces(name, "X", "t", t, {"loss_per_600s": 0.2}, {"thrust": 1.0})
        decay.plot(t, 100 * left, label=label)
    decay.set(xlabel="time into the run [s]", ylabel="thrust [%]", title="Decay of 20 % in 600 s")

    u = np.linspace(0.0, 1.2 * U, 61)
    for name, label in (
        ("rudder_propeller_interaction", "rudder_propeller_interaction"),
        ("rudder_propeller_interaction_loading", "by loading"),
    ):
        extra = _forces(name, "Y", "u", u, {**usual, "k": 1.0, "delta_r": 1.0}, {"coef": 1.0})
        race.plot(u / U, extra / U**2, label=label)
    race.set(xlabel="speed / usual speed", ylabel="race $w^2 / U^2$", title="Race at usual revolutions")

    rate = np.linspace(0.0, 0.8 * U / L, 41)
    hull = {**usual, "height": 0.1 * L, "Cd": 1.0}
    for name, label, more in (
        ("crossflow_drag", "crossflow_drag", {"tilt": 0.0}),
        ("crossflow_drag", "tilt 0.3", {"tilt": 0.3}),
        ("crossflow_drag_midships", "midships", {}),
    ):
        moment = _forces(name, "N", "r", rate, {**hull, **more, "v": -0.1 * U}, {})
        cross.plot(rate * L / U, moment / (0.5e-3 * rho * L**3 * U**2), label=label)
    cross.set(xlabel="yaw rate $r L / U$", ylabel="$N' \\cdot 10^3$", title="Cross-flow, $v/U = -0.1$")

    place = np.linspace(-0.5, 0.5, 61)
    body = {"value": 0.06 * L**2, "m": 1.0, "x_G": 0.0, "y_G": 0.0, "z_G": 0.0, "mass_fraction": 0.06}
    for name, label in (("ballast_mass", "ballast_mass"), ("ballast_mass_point", "point")):
        effect = _BY_NAME[name]
        about = _curve(effect, effect.adjust["Izz"], "x", place * L, body, {})
        mass.plot(place, 100 * (about / body["value"] - 1.0), label=label)
    mass.set(xlabel="x / L", ylabel="gain of $I_{zz}$ [%]", title="Ballast of 6 % of the mass")

    fouled = {"drag_increase": 0.25}
    speed = np.linspace(0.0, U, 41)
    for name, label in (("hull_fouling", "hull_fouling"), ("hull_fouling_all", "every row")):
        gain = [
            value(_BY_NAME[name].force["X"], fouled, {"quadratic_drag": x * x, "drag": x * x + x * U})
            for x in speed
        ]
        drag.plot(speed / U, np.array(gain) / (2 * U**2) * 100, label=label)
    drag.set(xlabel="speed / usual speed", ylabel="gain [% of drag at U]", title="Fouling, half of it linear")
    for panel in panels.flat:
        panel.legend()
    return figure
