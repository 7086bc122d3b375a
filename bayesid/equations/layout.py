"""What one kernel module holds: states, inputs, channels and the order of its parameter vector.

Takes a `KernelSpec` and the effects. Does not know an equation (see `dynamics`) or a number of a vehicle.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field

from bayesid.equations.derivatives import Graph, Node
from bayesid.model.actuators import Shape, kind_of
from bayesid.model.effects import Effect
from bayesid.model.terms import TERMS, Term
from bayesid.model.terms.mmg import AIR, GEOMETRY


@dataclass(frozen=True)
class KernelSpec:
    """What is compiled into one kernel module.

    dof : 3 or 6
    propulsion : "quadratic" (the four X_prop rows), "kt" (open-water thrust curve) or "mmg" (propeller and
        rudder behind a ship, and rows over its speed)
    sections : stations of the strip drag, 0 for none
    eta : whether the propeller-loading rows (group "eta") are present
    air : whether the areas the air pushes on are stated; those of a ship always are, or assumed
    named : actuators beside rudder, planes and propeller
    """

    dof: int = 3
    propulsion: str = "quadratic"
    sections: int = 0
    eta: bool = False
    air: bool = False
    named: tuple[Shape, ...] = ()

    @property
    def name(self) -> str:
        parts = ["planar" if self.dof == 3 else "sixdof"]
        if self.propulsion != "quadratic":
            parts.append(self.propulsion)
        if self.sections:
            parts.append(f"strips{self.sections}")
        if self.eta:
            parts.append("eta")
        if self.air:
            parts.append("air")
        parts += [shape.title for shape in self.named]
        return "_".join(parts)

    @property
    def servos(self) -> dict[str, str]:
        """Actuators behind a servo, and the end of the names of its constants."""
        turned = (signal for shape in self.named for signal in kind_of(shape).turned_by(shape))
        return {**FIN, **{signal: signal for signal in turned}}


PLANAR_STATES = ("x", "y", "psi", "u", "v", "r")
SIXDOF_STATES = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")
RATE = {"u": "udot", "v": "vdot", "w": "wdot", "p": "pdot", "q": "qdot", "r": "rdot"}
AXIS = {"u": "X", "v": "Y", "w": "Z", "p": "K", "q": "M", "r": "N"}

SHARED = (
    *("m", "Izz", "x_G", "y_G", "L", "rho", "height", "rpm_ref", "U_ref", "point_x", "point_y"),
    *("W", "B", "x_B", "y_B"),  # in the plane: what water that accelerates displaces
)
VERTICAL = (
    "Ixx",
    "Iyy",
    "Ixy",
    "Ixz",
    "Iyz",
    "z_G",
    "z_B",
    "cross",
    "point_z",
    "torque_ref",
)
KT = ("Kt0", "kt_a", "kt_b", "w_p", "t_p", "D")
KT_TURNS = ("Kq0", "kq_a", "kq_b")
FIN = {"delta_r": "r", "delta_s": "s", "delta_b": "b"}


@dataclass
class Dynamics:
    """Nodes and layouts of one kernel; see `build`."""

    spec: KernelSpec
    graph: Graph
    states: list[str]
    velocities: list[str]
    axes: list[str]
    actuators: list[str]
    exogenous: list[str]
    parameters: list[str]
    channels: list[str]
    rates: dict[str, Node] = field(default_factory=dict)
    wrench: dict[str, Node] = field(default_factory=dict)
    readings: dict[str, Node] = field(default_factory=dict)
    delays: dict[str, list[str]] = field(default_factory=dict)
    initial: dict[str, Node] = field(default_factory=dict)
    constants: dict[str, Node] = field(default_factory=dict)


def names_read(expression: str) -> frozenset[str]:
    """Names of variables in an expression."""
    return frozenset(n.id for n in ast.walk(ast.parse(expression, mode="eval")) if isinstance(n, ast.Name))


def rows_of(spec: KernelSpec) -> list[Term]:
    """Rows of the term table that a kernel carries (planar: those that do not vanish in the plane)."""
    out = []
    for row in TERMS:
        if row.group == "eta" and not spec.eta:
            continue
        if row.group in ("mmg", "number") and spec.propulsion != "mmg":
            continue
        if spec.dof == 3 and (row.axis not in "XYN" or not row.planar):
            continue
        out.append(row)
    return out


def parameter_names(spec: KernelSpec, effects: tuple[Effect, ...]) -> list[str]:
    """Layout of the parameter vector: mass and shape properties, coefficients (SI), effect parameters."""
    fins = ("delta_r",) if spec.dof == 3 else tuple(FIN)
    names = list(SHARED)
    if spec.dof == 6:
        names += VERTICAL
    for fin in fins:
        names += [f"inverse_rate_{FIN[fin]}", f"servo_lag_{FIN[fin]}", f"limit_{FIN[fin]}"]
    if spec.propulsion == "kt":
        names += KT if spec.dof == 3 else (*KT, *KT_TURNS)
    if spec.propulsion == "mmg":
        names += GEOMETRY
    if spec.propulsion == "mmg" or spec.air:
        names += AIR
    if spec.eta:
        names.append("uc_per_rpm")
    for shape in spec.named:
        names += kind_of(shape).constants_of(shape)
    if spec.sections:
        names += ["strip_Y", "strip_Z"]
    names += [row.name for row in rows_of(spec)]
    names += [effect.key(p.name) for effect in effects if effect.acts_in(spec.dof) for p in effect.parameters]
    return names
