"""What fins, planes and a sail do: lift, damping, added mass and control forces.

Takes: a `Fin` and the `Hull` it stands on. Gives `Parts` about the origin, and the fins of an X tail.
Does not: know stall, or the race of a propeller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bayesid.model.actuators import UNLIMITED
from bayesid.model.actuators import Fin as MovableFin
from bayesid.model.vehicles.new.hull import Hull
from bayesid.model.vehicles.new.parts import Parts

WHICKER = "fins (Whicker and Fehlner 1958)"
MUNK_FIN = "fins (Blevins 1979)"
PLATE = "fins (Hoerner 1965)"
FIN_DRAG = "induced drag (Whicker and Fehlner 1958)"
WAKE = 0.2  # of the speed, at fins on the tail; assumed, Hoerner 1965 ch. 13 has 0.1 to 0.3
CONTROLS = {"rudder": "dr", "stern_plane": "ds", "bow_plane": "db"}
VERTICAL = ("rudder", "fixed_vertical")
X_TAIL = "x_tail"  # four fins halfway between, each with an order of its own
KINDS = ("rudder", "stern_plane", "bow_plane", "fixed_vertical", "fixed_horizontal", X_TAIL)
# Fins of an X tail: name -> side (1 starboard) and height (1 below), clockwise seen from behind.
X_FINS = {"1": (1.0, -1.0), "2": (1.0, 1.0), "3": (-1.0, 1.0), "4": (-1.0, -1.0)}


@dataclass(frozen=True)
class Fin:
    """kind, one of `KINDS`; area and span of one, outside the hull [m^2, m]; from_nose: middle of its chord
    [m]; count: 2 for a pair opposite each other, 4 of an X tail; movable: share of the area that turns;
    assumed: its size is a usual one and not stated."""

    kind: str
    area: float
    span: float
    from_nose: float
    count: int = 2
    movable: float = 1.0
    assumed: bool = False

    @property
    def aspect_ratio(self) -> float:
        """Of the fin and its image in the hull."""
        return 2.0 * self.span**2 / self.area

    @property
    def lift_slope(self) -> float:
        """dC_L/d alpha [1/rad], unswept."""
        a = self.aspect_ratio
        return 0.9 * 2.0 * math.pi * a / (math.sqrt(a**2 + 4.0) + 1.8)

    @property
    def flap(self) -> float:
        """Lift of a flap over that of the whole fin: sqrt of its share, as by thin-aerofoil theory."""
        return math.sqrt(self.movable)


def add_fin(fin: Fin, hull: Hull, parts: Parts) -> None:
    """Rows of a fin, or a pair. Those of an X tail do to the side and up what two pairs at rest do: four at
    45 degrees lift as two, and their added mass is that of a cross whatever way it stands."""
    if fin.kind == X_TAIL:
        for kind in ("fixed_vertical", "fixed_horizontal"):
            add_fin(replace(fin, kind=kind, count=2), hull, parts)
        return
    x = hull.centre - fin.from_nose
    unsure = 1.7 if fin.assumed else 1.0
    sd, sd_drag, sd_mass = 0.35 * unsure, 0.5 * unsure, 0.4 * unsure
    radius = hull.radius_at(fin.from_nose)
    tip = radius + fin.span
    middle = radius + 0.5 * fin.span
    chord = fin.area / fin.span
    lift = _lift(fin, hull) * fin.count
    vertical = fin.kind in VERTICAL
    axis, moment, velocity, rate, sign = ("Y", "N", "v", "r", 1.0) if vertical else ("Z", "M", "w", "q", -1.0)
    arm = sign * x
    parts.add(f"{axis}_{velocity}", -lift, sd, WHICKER)
    parts.add(f"{moment}_{velocity}", -lift * arm, sd, WHICKER)
    parts.add(f"{axis}_{rate}", -lift * arm, sd_drag, WHICKER)
    parts.add(f"{moment}_{rate}", -lift * arm**2, sd_drag, WHICKER)
    if fin.kind in CONTROLS:
        control = CONTROLS[fin.kind]
        force = lift * fin.flap
        # positive angles: a stern rudder pushes the stern to starboard, a plane pushes upwards
        side = 1.0 if vertical else -1.0
        parts.add(f"{axis}_{control}", side * force, sd, WHICKER)
        parts.add(f"{moment}_{control}", side * force * arm, sd, WHICKER)
        parts.add(f"X_{control}{control}", -_induced(fin, force), sd_drag, FIN_DRAG)
    # added mass of the section with a pair of fins, less that of the bare circle; half for a single fin
    section = math.pi * hull.rho * (tip**2 - 2.0 * radius**2 + radius**4 / tip**2) * 0.5 * fin.count
    three_d = fin.aspect_ratio / math.sqrt(1.0 + fin.aspect_ratio**2)
    mass = section * chord * three_d
    parts.add(f"{axis}_{velocity}dot", -mass, sd_mass, MUNK_FIN)
    parts.add(f"{axis}_{rate}dot", -mass * arm, sd_mass, MUNK_FIN)
    parts.add(f"{moment}_{rate}dot", -mass * arm**2, sd_mass, MUNK_FIN)
    plate = 0.5 * hull.rho * 1.2 * fin.area * fin.count
    parts.add(f"{axis}_{velocity}|{velocity}|", -plate, sd_drag, PLATE)
    parts.add(f"{moment}_{rate}|{rate}|", -plate * abs(x) ** 3, sd_drag, PLATE)
    parts.add("K_p", -lift * middle**2, 0.8, WHICKER)
    parts.add("K_p|p|", -plate * middle**3, 1.5, PLATE)
    parts.add("K_pdot", -section / math.pi * chord * tip**2 * 0.5, 1.5, MUNK_FIN)
    if fin.count == 1 and vertical:  # a sail, or a rudder on top: its side force heels
        parts.add("K_v", -lift * middle, 0.8, WHICKER)


def movable_fins(fin: Fin, hull: Hull, max_deg: float, rate_deg_s: float | None) -> tuple[MovableFin, ...]:
    """The four of an X tail as actuators, of which a positive angle pushes the stern to starboard; none of
    any other, whose controls are rows.

    Parameters
    ----------
    max_deg, rate_deg_s : stops and rate of each; None for no limit of the rate
    """
    if fin.kind != X_TAIL:
        return ()
    force = _lift(fin, hull) * fin.flap
    x, out = hull.centre - fin.from_nose, (hull.radius_at(fin.from_nose) + 0.5 * fin.span) * math.sqrt(0.5)
    found = []
    for name, (side, below) in X_FINS.items():
        direction = (0.0, math.sqrt(0.5), -side * below * math.sqrt(0.5))  # across its span
        found.append(
            MovableFin(
                name, _rounded(x, side * out, below * out), direction, F_uu=float(f"{force:.5g}"),
                D_uu=float(f"{_induced(fin, force):.5g}"), max_deg=max_deg,
                rate_deg_s=rate_deg_s or UNLIMITED,
            )
        )  # fmt: skip
    return tuple(found)


def _rounded(*place: float) -> tuple[float, float, float]:
    x, y, z = (float(f"{value:.5g}") for value in place)
    return x, y, z


def _lift(fin: Fin, hull: Hull) -> float:
    """Lift of one fin over the speed squared and its angle of attack [N s^2/(m^2 rad)]."""
    on_tail = fin.from_nose > hull.length - hull.ends[1]
    wake = (1.0 - WAKE) ** 2 if on_tail else 1.0
    return 0.5 * hull.rho * fin.lift_slope * fin.area * wake


def _induced(fin: Fin, force: float) -> float:
    """Drag over angle squared of fins of so much force over angle."""
    return force * fin.lift_slope * fin.flap / (math.pi * fin.aspect_ratio * 0.9)
