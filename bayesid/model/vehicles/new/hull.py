"""What a hull of stated length, breadth, height and volume does in water, by published formulas.

Takes: a `Hull`. Gives added mass, body lift, cross-flow drag and resistance as `Parts` about the origin.
Does not: know fins, a sail or a propeller.

Profile: half an ellipsoid as nose, a parallel body and a tail of revolution r = R (1 - s^2); the tail is as
long as the volume wants it to be. Sections are ellipses of the stated breadth and height.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bayesid.model.vehicles.new.parts import Parts

STATIONS = 2001
LAMB = "spheroid (Lamb 1932)"
STRIP = "strips (Newman 1977, Lamb 1932)"
HOPKINS = "hull (Hopkins 1951)"
CROSSFLOW = "cross-flow (Hoerner 1965)"
FRICTION = "friction (ITTC 1957), form (Hoerner 1965)"
CROSSFLOW_CD = 1.1  # Hoerner 1965: circular cylinder, subcritical
CENTRE = 0.03  # of the length: how well the centre of added mass is known
VISCOSITY = 1.19e-6  # m^2/s, sea water of 15 C


@dataclass(frozen=True)
class Hull:
    """length, breadth, height [m]; volume [m^3]; nose length [m] or None; origin: distance of the body origin
    from the nose [m] or None for the centre of buoyancy of the profile; rho [kg/m^3]."""

    length: float
    breadth: float
    height: float
    volume: float
    rho: float
    nose: float | None = None
    tail: float | None = None
    origin: float | None = None

    @property
    def section(self) -> float:
        """Area of the largest section, m^2."""
        return math.pi / 4.0 * self.breadth * self.height

    @property
    def diameter(self) -> float:
        return math.sqrt(self.breadth * self.height)

    @property
    def prismatic(self) -> float:
        return self.volume / (self.section * self.length)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """(nose, tail) lengths [m] that give the volume: A0 (l - nose/3 - 7/15 tail)."""
        if self.nose is not None and self.tail is not None:
            return self.nose, self.tail
        nose = min(self.diameter if self.nose is None else self.nose, 0.4 * self.length)
        if self.tail is not None:
            return nose, self.tail
        tail = (self.length - nose / 3.0 - self.volume / self.section) * 15.0 / 7.0
        return nose, float(np.clip(tail, 0.05 * self.length, self.length - nose))

    @cached_property
    def from_nose(self) -> np.ndarray:
        return np.linspace(0.0, self.length, STATIONS)

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) width of each station over the largest; the area goes with its square."""
        nose, tail = self.ends
        s = self.from_nose
        ahead = np.clip(1.0 - s / nose, 0.0, 1.0)
        behind = np.clip((s - (self.length - tail)) / tail, 0.0, 1.0)
        return np.sqrt(1.0 - ahead**2) * (1.0 - behind**2)

    @cached_property
    def fit(self) -> float:
        """Volume asked for over that of the profile; 1 unless no tail gives it."""
        return self.volume / (self.section * float(np.trapezoid(self.share**2, self.from_nose)))

    @cached_property
    def x(self) -> np.ndarray:
        """(n,) stations ahead of the origin [m]."""
        return self.centre - self.from_nose

    @cached_property
    def centre(self) -> float:
        """Distance of the origin from the nose [m]."""
        if self.origin is not None:
            return self.origin
        area = self.share**2
        return float(np.trapezoid(area * self.from_nose, self.from_nose) / np.trapezoid(area, self.from_nose))

    def integral(self, values: np.ndarray) -> float:
        return float(np.trapezoid(values, self.from_nose))

    def radius_at(self, from_nose: float) -> float:
        return 0.5 * self.diameter * float(np.interp(from_nose, self.from_nose, self.share))

    @cached_property
    def wetted(self) -> float:
        perimeter = math.pi * math.sqrt(0.5 * (self.breadth**2 + self.height**2))
        return perimeter * self.integral(self.share)


def lamb(length: float, diameter: float) -> tuple[float, float, float]:
    """(k1, k2, k') of a prolate spheroid: added mass ahead and across over displaced mass, added inertia over
    that of the displaced water; a slender one has 0, 1, 1 and a sphere 1/2, 1/2, 0."""
    ratio = diameter / length
    if ratio > 0.999:
        return 0.5, 0.5, 0.0
    e = math.sqrt(1.0 - ratio**2)
    log = math.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * log - e)
    beta = 1.0 / e**2 - (1.0 - e**2) / (2.0 * e**3) * log
    k_r = e**4 * (beta - alpha) / ((2.0 - e**2) * (2.0 * e**2 - (2.0 - e**2) * (beta - alpha)))
    return alpha / (2.0 - alpha), beta / (2.0 - beta), k_r


def added_mass(hull: Hull, parts: Parts) -> None:
    k1, k2, k_r = lamb(hull.length, hull.diameter)
    parts.add("X_udot", -hull.rho * hull.volume * k1, 0.4, LAMB)
    for axis, moment, velocity, rate, across, sign in (
        ("Y", "N", "v", "r", hull.height, 1.0),
        ("Z", "M", "w", "q", hull.breadth, -1.0),
    ):
        per_length = hull.rho * math.pi / 4.0 * across**2 * hull.share**2 * min(hull.fit, 1.5)
        parts.add(f"{axis}_{velocity}dot", -k2 * hull.integral(per_length), 0.2, STRIP)
        lever = -sign * k2 * hull.integral(per_length * hull.x)
        parts.add(f"{axis}_{rate}dot", lever, 0.0, STRIP)
        parts.widen(
            f"{axis}_{rate}dot", CENTRE * hull.length * abs(parts.value(f"{axis}_{velocity}dot")), "centre"
        )
        parts.add(f"{moment}_{rate}dot", -k_r * hull.integral(per_length * hull.x**2), 0.35, STRIP)


def body_lift(hull: Hull, parts: Parts) -> None:
    """Linear rows of the bare hull. Momentum of the slender body is kept to the station x0 at which the flow
    separates, 0.378 l + 0.527 of the station where the area shrinks fastest; the Munk moment is within."""
    k1, k2, _ = lamb(hull.length, hull.diameter)
    area = hull.section * hull.share**2
    aft = hull.from_nose > 0.5 * hull.length
    shrinks = np.where(aft, np.gradient(area, hull.from_nose), np.inf)
    separation = 0.378 * hull.length + 0.527 * float(hull.from_nose[int(np.argmin(shrinks))])
    kept = hull.from_nose <= separation
    s0, x0 = float(np.interp(separation, hull.from_nose, area)), hull.centre - separation
    volume, first = (
        hull.integral(np.where(kept, area, 0.0)),
        hull.integral(np.where(kept, area * hull.x, 0.0)),
    )
    factor = hull.rho * (k2 - k1)
    for axis, moment, velocity, rate, across, sign in (
        ("Y", "N", "v", "r", hull.height / hull.breadth, 1.0),
        ("Z", "M", "w", "q", hull.breadth / hull.height, -1.0),
    ):
        scale = factor * across  # momentum of an elliptic section goes with the square of its height
        parts.add(f"{axis}_{velocity}", -scale * s0, 0.5, HOPKINS)
        parts.add(f"{moment}_{velocity}", -sign * scale * volume, 0.2, HOPKINS)
        parts.add(f"{moment}_{velocity}", -sign * scale * x0 * s0, 0.5, HOPKINS)
        parts.add(f"{axis}_{rate}", -sign * scale * x0 * s0, 0.6, HOPKINS)
        parts.add(f"{moment}_{rate}", -scale * (x0**2 * s0 + first), 0.6, HOPKINS)


def crossflow(hull: Hull, parts: Parts) -> None:
    """Rows that stand for the strip integral of |v + x r|(v + x r): the pure ones are its values, the mixed
    ones fit what is left of it over -1 < v/U, r L/2U < 1 by least squares."""
    nodes = np.linspace(-1.0, 1.0, 21)
    side, turn = (g.ravel() for g in np.meshgrid(nodes, nodes * 2.0 / hull.length))
    for axis, moment, velocity, rate, across, sign in (
        ("Y", "N", "v", "r", hull.height, 1.0),
        ("Z", "M", "w", "q", hull.breadth, -1.0),
    ):
        width = across * hull.share * (0.5 * hull.rho * CROSSFLOW_CD)
        arm = sign * hull.x
        local = side[:, None] + turn[:, None] * arm
        pressure = -np.abs(local) * local * width
        for out, lever in ((axis, np.ones_like(arm)), (moment, arm)):
            wanted = np.trapezoid(pressure * lever, hull.from_nose, axis=1)
            pure_side = -hull.integral(width * lever)
            pure_turn = -hull.integral(width * np.abs(arm) * arm * lever)
            rest = wanted - pure_side * np.abs(side) * side - pure_turn * np.abs(turn) * turn
            even = out == axis
            columns = np.sign(side) * np.abs(side * turn) if even else np.abs(side) * turn
            mixed = float(columns @ rest / (columns @ columns))
            small = 0.02 * abs(hull.integral(width))
            if abs(pure_side) > small * (1.0 if even else hull.length):
                parts.add(f"{out}_{velocity}|{velocity}|", pure_side, 0.6, CROSSFLOW)
            if abs(pure_turn) > small * hull.length ** (2 if even else 3):
                parts.add(f"{out}_{rate}|{rate}|", pure_turn, 1.0, CROSSFLOW)
            parts.add(
                f"{out}_{velocity}|{rate}|" if even else f"{out}_|{velocity}|{rate}", mixed, 0.7, CROSSFLOW
            )


def resistance(hull: Hull, speed: float, wet_fins: float, allowance: float, parts: Parts) -> None:
    """X_u|u| of hull and fins at a speed [m/s]; `allowance` for what sticks out of the hull."""
    reynolds = max(speed * hull.length / VISCOSITY, 1e4)
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    slender = hull.diameter / hull.length
    form = 1.0 + 1.5 * slender**1.5 + 7.0 * slender**3
    area = friction * (form * hull.wetted + 1.2 * wet_fins)
    parts.add("X_u|u|", -0.5 * hull.rho * area * allowance, 0.3,
              f"{FRICTION}, times {allowance:g} for roughness, openings")  # fmt: skip
