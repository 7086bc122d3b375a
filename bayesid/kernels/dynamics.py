"""The equations of motion as one graph: rows of the term table, rigid body, statics, propulsion, effects.

Takes a `KernelSpec` and the declarations. Gives the wrench balance W(state, acceleration, inputs, parameters) = 0, the
kinematics and the sensor equations as nodes of a `Graph`. Does not print code (see `generate`) or hold any number of a
vehicle: every mass property, coefficient and effect parameter stays a symbol.

Axes, signs and rigid-body side follow Gertler & Hagen (1967), NSRDC 2510; hydrodynamic rows read velocity through the
water and its rate, the rigid body reads velocity over ground.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass, field

from bayesid.effects import Effect
from bayesid.errors import ModelError
from bayesid.kernels.expr import Graph, Node
from bayesid.terms import TERMS, Term


@dataclass(frozen=True)
class KernelSpec:
    """What is compiled into one kernel module.

    dof : 3 or 6
    propulsion : "quadratic" (the four X_prop rows) or "kt" (open-water thrust curve)
    sections : stations of the strip drag, 0 for none
    eta : whether the propeller-loading rows (group "eta") are present
    """

    dof: int = 3
    propulsion: str = "quadratic"
    sections: int = 0
    eta: bool = False

    @property
    def name(self) -> str:
        parts = ["planar" if self.dof == 3 else "sixdof"]
        if self.propulsion == "kt":
            parts.append("kt")
        if self.sections:
            parts.append(f"strips{self.sections}")
        if self.eta:
            parts.append("eta")
        return "_".join(parts)


PLANAR_STATES = ("x", "y", "psi", "u", "v", "r")
SIXDOF_STATES = ("x", "y", "z", "phi", "theta", "psi", "u", "v", "w", "p", "q", "r")
_RATE = {"u": "udot", "v": "vdot", "w": "wdot", "p": "pdot", "q": "qdot", "r": "rdot"}
_AXIS = {"u": "X", "v": "Y", "w": "Z", "p": "K", "q": "M", "r": "N"}

# Newton-Euler about the body origin, products of inertia I_xy = +integral of xy dm (Gertler & Hagen 1967).
RIGID_BODY = {
    "X": "m*(udot - v*r + w*q - x_G*(q*q + r*r) + y_G*(p*q - rdot) + z_G*(p*r + qdot))",
    "Y": "m*(vdot - w*p + u*r - y_G*(r*r + p*p) + z_G*(q*r - pdot) + x_G*(q*p + rdot))",
    "Z": "m*(wdot - u*q + v*p - z_G*(p*p + q*q) + x_G*(r*p - qdot) + y_G*(r*q + pdot))",
    "K": "Ixx*pdot + (Izz - Iyy)*q*r - (rdot + p*q)*Ixz + (r*r - q*q)*Iyz + (p*r - qdot)*Ixy"
    " + m*(y_G*(wdot - u*q + v*p) - z_G*(vdot - w*p + u*r))",
    "M": "Iyy*qdot + (Ixx - Izz)*r*p - (pdot + q*r)*Ixy + (p*p - r*r)*Ixz + (q*p - rdot)*Iyz"
    " + m*(z_G*(udot - v*r + w*q) - x_G*(wdot - u*q + v*p))",
    "N": "Izz*rdot + (Iyy - Ixx)*p*q - (qdot + r*p)*Iyz + (q*q - p*p)*Ixy + (r*q - pdot)*Ixz"
    " + m*(x_G*(vdot - w*p + u*r) - y_G*(udot - v*r + w*q))",
}
STATICS = {
    "X": "-(W - B)*sin(theta)",
    "Y": "(W - B)*cos(theta)*sin(phi)",
    "Z": "(W - B)*cos(theta)*cos(phi)",
    "K": "(y_G*W - y_B*B)*cos(theta)*cos(phi) - (z_G*W - z_B*B)*cos(theta)*sin(phi)",
    "M": "-(x_G*W - x_B*B)*cos(theta)*cos(phi) - (z_G*W - z_B*B)*sin(theta)",
    "N": "(x_G*W - x_B*B)*cos(theta)*sin(phi) + (y_G*W - y_B*B)*sin(theta)",
}
KINEMATICS_6 = {
    "x": "u*cos(theta)*cos(psi) + v*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
    " + w*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))",
    "y": "u*cos(theta)*sin(psi) + v*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi))"
    " + w*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi))",
    "z": "-u*sin(theta) + v*cos(theta)*sin(phi) + w*cos(theta)*cos(phi)",
    "phi": "p + sin(theta)/cos(theta)*(q*sin(phi) + r*cos(phi))",
    "theta": "q*cos(phi) - r*sin(phi)",
    "psi": "(q*sin(phi) + r*cos(phi))/cos(theta)",
}
# Open-water curve K_T = Kt0 (1 - (J/a)^b), J = u (1 - w)/(n D) clipped at 0, thrust odd in n, n in rev/s.
KT_THRUST = (
    "(1 - t_p)*rho*D**4*Kt0*n*abs(n)/3600"
    "*(1 - (max(u*(1 - w_p)*60/(D*kt_a*(sgn(n)*max(abs(n), 1e-6) + (1 - abs(sgn(n)))*1e-6)), 0))**kt_b)"
)

SHARED = ("m", "Izz", "x_G", "y_G", "L", "rho", "height", "rpm_ref", "U_ref", "point_x", "point_y")
VERTICAL = ("Ixx", "Iyy", "Ixy", "Ixz", "Iyz", "z_G", "W", "B", "x_B", "y_B", "z_B", "cross", "point_z")
KT = ("Kt0", "kt_a", "kt_b", "w_p", "t_p", "D")
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


_VERTICAL_NAMES = frozenset({"w", "p", "q", "wdot", "pdot", "qdot", "delta_s", "delta_b", "phi", "theta"})


def rows_of(spec: KernelSpec) -> list[Term]:
    """Rows of the term table that a kernel carries (planar: those that do not vanish in the plane)."""
    out = []
    for row in TERMS:
        if row.group == "eta" and not spec.eta:
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
        names += [f"inverse_rate_{FIN[fin]}", f"limit_{FIN[fin]}"]
    if spec.propulsion == "kt":
        names += KT
    if spec.eta:
        names.append("uc_per_rpm")
    if spec.sections:
        names += ["strip_Y", "strip_Z"]
    names += [row.name for row in rows_of(spec)]
    names += [effect.key(p.name) for effect in effects if effect.dof <= spec.dof for p in effect.parameters]
    return names


def build(spec: KernelSpec, effects: tuple[Effect, ...], active: bool) -> Dynamics:
    """Equations of one kernel as a graph.

    Parameters
    ----------
    spec : KernelSpec
    effects : declarations whose parameters are in the layout
    active : False leaves their equations out (the bare model); the layout is the same

    Raises
    ------
    ModelError
        if an effect's equation cannot be read; names the effect
    """
    planar = spec.dof == 3
    effects = tuple(e for e in effects if e.dof <= spec.dof)
    g = Graph()
    base = PLANAR_STATES if planar else SIXDOF_STATES
    velocities = [s for s in base if s in _RATE]
    dyn = Dynamics(
        spec=spec,
        graph=g,
        states=[*base, *(s.name for e in effects for s in e.states if active)],
        velocities=velocities,
        axes=[_AXIS[s] for s in velocities],
        actuators=["delta_r", "n"] if planar else ["delta_r", "delta_s", "delta_b", "n"],
        exogenous=["wind_north", "wind_east", "flow_north", "flow_east"]
        + ([] if planar else ["flow_down"])
        + [f"force_{_AXIS[s]}" for s in velocities],
        parameters=parameter_names(spec, effects),
        channels=[*base, "u_water", "v_water", *([] if planar else ["w_water"])],
    )
    if len(set(dyn.parameters)) != len(dyn.parameters):
        raise ModelError("two parameters share a name; rename the effect")
    const = {name: g.sym(name) for name in dyn.parameters}
    if planar:
        const |= dict.fromkeys((*VERTICAL, *[row.name for row in TERMS if row.name not in const]), g.zero)
    ground = {name: g.sym(name) if name in dyn.states else g.zero for name in SIXDOF_STATES}
    extra = {s.name: g.sym(s.name) for e in effects for s in e.states if active}
    accel = {_RATE[s]: (g.sym(_RATE[s]) if s in velocities else g.zero) for s in _RATE}
    inputs = {name: g.sym(name) for name in (*dyn.actuators, *dyn.exogenous)}
    inputs.setdefault("delta_s", g.zero)
    inputs.setdefault("delta_b", g.zero)
    time = g.sym("t")

    if active:
        for effect in effects:
            for target, formula in effect.adjust.items():
                if target in const and g.value(const[target]) is None:
                    own = {p.name: g.sym(effect.key(p.name)) for p in effect.parameters}
                    const[target] = _parse(g, effect, formula, {**const, **own, "value": const[target]}, {})
    dyn.constants = const

    current, current_rate = _current(g, effects if active else (), inputs, ground, time)
    water = {k: g.sub(ground[k], current[k]) if k in current else ground[k] for k in SIXDOF_STATES}
    water_rate = {
        _RATE[k]: g.sub(accel[_RATE[k]], current_rate[k]) if k in current else accel[_RATE[k]] for k in _RATE
    }
    cross = {"Rv": g.call("abs", water["v"]), "Rw": g.call("abs", water["w"])}
    if not planar:
        vv, ww = (g.mul(water[k], water[k]) for k in "vw")
        cross = {
            "Rv": g.call("sqrt", g.add(vv, g.mul(const["cross"], ww))),
            "Rw": g.call("sqrt", g.add(ww, g.mul(const["cross"], vv))),
        }
    through = {
        **{k: water[k] for k in _RATE},
        **water_rate,
        **cross,
        **{k: inputs[k] for k in ("delta_r", "delta_s", "delta_b", "n")},
    }
    if spec.eta:
        names = {**const, **through}
        through["eta1"] = g.parse("uc_per_rpm*n/sqrt(max(u*u + v*v + w*w, 1e-6)) - 1", names)

    rows = rows_of(spec)
    parts = {row.name: g.mul(const[row.name], g.parse(row.regressor, through)) for row in rows}
    wrench = dict.fromkeys(_AXIS.values(), g.zero)
    for row in rows:
        wrench[row.axis] = g.add(wrench[row.axis], parts[row.name])
    thrust = g.total(
        parts[r.name] for r in rows if r.axis == "X" and "n" in names_read(r.regressor) and r.group != "eta"
    )
    if spec.propulsion == "kt":
        thrust_kt = g.parse(KT_THRUST, {**const, **through})
        thrust = g.add(thrust, thrust_kt)
        wrench["X"] = g.add(wrench["X"], thrust_kt)
    if spec.sections:
        for axis, node in _strips(g, spec, const, water).items():
            wrench[axis] = g.add(wrench[axis], node)
    over_ground = {**const, **ground, **accel}
    for axis, formula in RIGID_BODY.items():
        wrench[axis] = g.sub(wrench[axis], g.parse(formula, over_ground))
    for axis, formula in STATICS.items():
        wrench[axis] = g.add(wrench[axis], g.parse(formula, over_ground))

    if active:
        calls = {
            "coef": lambda name: const.get(name, g.zero),
            "rows": lambda axis, symbol: g.total(
                parts[r.name] for r in rows if r.axis == axis and symbol in names_read(r.regressor)
            ),
            "thrust": lambda: thrust,
            "drag": lambda: g.total(
                parts[r.name] for r in rows if r.axis == "X" and names_read(r.regressor) - {"abs"} == {"u"}
            ),
        }
        scope = {
            **const,
            **{k: ground[k] for k in ("x", "y", "z", "phi", "theta", "psi")},
            **{k: water[k] for k in _RATE},
            **{f"{k}g": ground[k] for k in "uvw"},
            **accel,
            **inputs,
            **extra,
            "t": time,
        }
        for effect in effects:
            names = {**scope, **{p.name: g.sym(effect.key(p.name)) for p in effect.parameters}}
            for axis, formula in effect.force.items():
                wrench[axis] = g.add(wrench[axis], _parse(g, effect, formula, names, calls))
            for state in effect.states:
                dyn.rates[state.name] = _parse(g, effect, state.rate, names, calls)
                dyn.initial[state.name] = _parse(g, effect, state.initial, names, calls)
    for axis in dyn.axes:
        dyn.wrench[axis] = g.add(wrench[axis], inputs[f"force_{axis}"])
    if planar:
        formulas = {"x": "u*cos(psi) - v*sin(psi)", "y": "u*sin(psi) + v*cos(psi)", "psi": "r"}
    else:
        formulas = KINEMATICS_6
    for name, formula in formulas.items():
        dyn.rates[name] = g.parse(formula, ground)
    _sensors(dyn, effects if active else (), const, ground, water, time)
    return dyn


def _parse(g: Graph, effect: Effect, formula: str, names: dict, calls: dict) -> Node:
    try:
        return g.parse(formula, names, calls)
    except ModelError as exc:
        raise ModelError(f"effect {effect.name!r}: {exc}") from None


def _current(
    g: Graph, effects: tuple[Effect, ...], inputs: dict, ground: dict, time: Node
) -> tuple[dict, dict]:
    """Velocity of the water and its rate in body axes: c = R' V, dc/dt = R' dV/dt - omega x c."""
    earth = {
        "north": inputs["flow_north"],
        "east": inputs["flow_east"],
        "down": inputs.get("flow_down", g.zero),
    }
    for effect in effects:
        own = {p.name: g.sym(effect.key(p.name)) for p in effect.parameters}
        for direction, formula in effect.flow.items():
            earth[direction] = g.add(earth[direction], _parse(g, effect, formula, {**own, "t": time}, {}))
    rate = {k: g.diff(node, time) for k, node in earth.items()}
    to_body = {
        "u": "north*cos(theta)*cos(psi) + east*cos(theta)*sin(psi) - down*sin(theta)",
        "v": "north*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
        " + east*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi)) + down*cos(theta)*sin(phi)",
        "w": "north*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))"
        " + east*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi)) + down*cos(theta)*cos(phi)",
    }
    body = {k: g.parse(text, {**ground, **earth}) for k, text in to_body.items()}
    turned = {k: g.parse(text, {**ground, **rate}) for k, text in to_body.items()}
    names = {**ground, "uc": body["u"], "vc": body["v"], "wc": body["w"]}
    swing = {"u": "r*vc - q*wc", "v": "p*wc - r*uc", "w": "q*uc - p*vc"}
    return body, {k: g.add(turned[k], g.parse(swing[k], names)) for k in body}


def _strips(g: Graph, spec: KernelSpec, const: dict, water: dict) -> dict[str, Node]:
    """Strip drag by a trapezoid of stations over the length (Healey & Lienard 1993 form)."""
    n = spec.sections
    out = dict.fromkeys(("Y", "Z", "M", "N"), g.zero)
    for i in range(n):
        xi = -0.5 + i / (n - 1)
        weight = (0.5 if i in (0, n - 1) else 1.0) / (n - 1)
        x = g.mul(g.const(xi), const["L"])
        a = g.add(water["v"], g.mul(x, water["r"]))
        if spec.dof == 3:
            side, heave = g.mul(const["strip_Y"], g.mul(a, g.call("abs", a))), g.zero
        else:
            b = g.sub(water["w"], g.mul(x, water["q"]))
            aa, bb = g.mul(a, a), g.mul(b, b)
            pressure = g.mul(
                g.add(g.mul(const["strip_Y"], aa), g.mul(const["strip_Z"], bb)),
                g.call("rsqrt", g.add(aa, bb)),
            )
            side, heave = g.mul(pressure, a), g.mul(pressure, b)
        step = g.mul(g.const(weight), const["L"])
        out["Y"] = g.sub(out["Y"], g.mul(step, side))
        out["N"] = g.sub(out["N"], g.mul(g.mul(step, x), side))
        out["Z"] = g.sub(out["Z"], g.mul(step, heave))
        out["M"] = g.add(out["M"], g.mul(g.mul(step, x), heave))
    return out


def _sensors(
    dyn: Dynamics, effects: tuple[Effect, ...], const: dict, ground: dict, water: dict, time: Node
) -> None:
    g = dyn.graph
    reading = dict(ground)
    lever = {
        "x": "x + point_x*cos(theta)*cos(psi) + point_y*(sin(phi)*sin(theta)*cos(psi) - cos(phi)*sin(psi))"
        " + point_z*(sin(phi)*sin(psi) + cos(phi)*cos(psi)*sin(theta))",
        "y": "y + point_x*cos(theta)*sin(psi) + point_y*(cos(phi)*cos(psi) + sin(phi)*sin(theta)*sin(psi))"
        " + point_z*(cos(phi)*sin(theta)*sin(psi) - sin(phi)*cos(psi))",
        "z": "z - point_x*sin(theta) + point_y*cos(theta)*sin(phi) + point_z*cos(theta)*cos(phi)",
    }
    for name, text in lever.items():
        reading[name] = g.parse(text, {**const, **ground})
    reading |= {f"{k}_water": water[k] for k in "uvw"}
    for effect in effects:
        names = {
            **const,
            **reading,
            **{p.name: g.sym(effect.key(p.name)) for p in effect.parameters},
            "t": time,
        }
        changed = {c: _parse(g, effect, text, names, {}) for c, text in effect.sensor.items()}
        reading |= changed
        for parameter, channels in effect.sensor_delay.items():
            for channel in channels:
                dyn.delays.setdefault(channel, []).append(effect.key(parameter))
    dyn.readings = {c: reading[c] for c in dyn.channels}
    dyn.delays = {c: v for c, v in dyn.delays.items() if c in dyn.channels}
