"""The equations of motion as one graph: rows of the term table, rigid body, statics, propulsion, effects.

Takes a `KernelSpec` and the declarations. Gives the wrench balance W(state, acceleration, inputs, parameters)
= 0, the kinematics and the sensor equations as nodes of a `Graph`. Does not print code (see `generate`) or
hold any number of a vehicle: every mass property, coefficient and effect parameter stays a symbol.

Axes, signs and rigid-body side follow Gertler & Hagen (1967), NSRDC 2510; hydrodynamic rows read velocity
through the water and its rate, the rigid body reads velocity over ground, and water that accelerates pushes
the hull by its pressure gradient.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bayesid.equations.derivatives import Graph, Node
from bayesid.equations.flow import cross_flow_side, cross_flow_speeds, current, parse_effect, strip_drag
from bayesid.equations.formulas import (
    ETA,
    KINEMATICS_3,
    KINEMATICS_6,
    KT_THRUST,
    KT_TORQUE,
    PRESSURE_GRADIENT,
    RIGID_BODY,
    STATICS,
    TORQUE,
)
from bayesid.equations.layout import (
    AXIS,
    PLANAR_STATES,
    RATE,
    SIXDOF_STATES,
    VERTICAL,
    Dynamics,
    KernelSpec,
    names_read,
    parameter_names,
    rows_of,
)
from bayesid.equations.readings import add_readings
from bayesid.errors import ModelError
from bayesid.model.actuators import kind_of
from bayesid.model.effects import Effect
from bayesid.model.terms import TERMS, Term
from bayesid.model.terms.mmg import DEFINITIONS, FORCES, PARTS, SENSE, SPEED

__all__ = ["Dynamics", "KernelSpec", "build"]

_POSE = ("x", "y", "z", "phi", "theta", "psi")


@dataclass(frozen=True)
class _Symbols:
    """Names an equation may use, as nodes; absent ones are zero. `pull` is the acceleration of the water."""

    const: dict[str, Node]
    ground: dict[str, Node]
    water: dict[str, Node]
    accel: dict[str, Node]
    water_rate: dict[str, Node]
    pull: dict[str, Node]
    inputs: dict[str, Node]
    time: Node


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
    effects = tuple(e for e in effects if e.acts_in(spec.dof))
    dyn = _layout(spec, effects, effects if active else ())
    effects = effects if active else ()
    at = _symbols(dyn, effects)
    dyn.constants = at.const
    parts = _row_forces(dyn, at)
    thrust = _total(dyn.graph, parts, lambda r: r.axis == "X" and r.group != "eta" and "n" in _reads(r))
    wrench = _hull_wrench(dyn, at, parts)
    if spec.propulsion == "kt":
        kt = dyn.graph.parse(KT_THRUST, {**at.const, **at.water, **at.inputs})
        thrust, wrench["X"] = dyn.graph.add(thrust, kt), dyn.graph.add(wrench["X"], kt)
    if spec.dof == 6:
        torque = dyn.graph.parse(TORQUE, {**at.const, **at.inputs})
        wrench["K"] = dyn.graph.add(wrench["K"], torque)
        if spec.propulsion == "kt":
            torque = dyn.graph.parse(KT_TORQUE, {**at.const, **at.water, **at.inputs})
            wrench["K"] = dyn.graph.add(wrench["K"], torque)
    for shape in spec.named:
        for force, arms in kind_of(shape).parts(shape):
            push = dyn.graph.parse(force, {**at.const, **at.water, **at.inputs})
            for axis in (a for a in arms if a in dyn.axes):
                part = dyn.graph.mul(push, dyn.graph.parse(arms[axis], {**at.const, **at.inputs}))
                wrench[axis] = dyn.graph.add(wrench[axis], part)
    _add_effects(dyn, effects, at, parts, thrust, wrench)
    for axis in dyn.axes:
        dyn.wrench[axis] = dyn.graph.add(wrench[axis], at.inputs[f"force_{axis}"])
    kinematics = KINEMATICS_3 if spec.dof == 3 else KINEMATICS_6
    dyn.rates |= {name: dyn.graph.parse(formula, at.ground) for name, formula in kinematics.items()}
    add_readings(dyn, effects, at.const, at.ground, at.water, at.time)
    return dyn


def _layout(spec: KernelSpec, effects: tuple[Effect, ...], active: tuple[Effect, ...]) -> Dynamics:
    planar = spec.dof == 3
    base = PLANAR_STATES if planar else SIXDOF_STATES
    velocities = [s for s in base if s in RATE]
    earth = ("flow_north", "flow_east") if planar else ("flow_north", "flow_east", "flow_down")
    dyn = Dynamics(
        spec=spec,
        graph=Graph(),
        states=[*base, *(s.name for e in active for s in e.states)],
        velocities=velocities,
        axes=[AXIS[s] for s in velocities],
        actuators=[
            *(["delta_r", "n"] if planar else ["delta_r", "delta_s", "delta_b", "n"]),
            *(signal for shape in spec.named for signal in kind_of(shape).signals_of(shape)),
        ],
        exogenous=["wind_north", "wind_east", *earth, *(f"force_{AXIS[s]}" for s in velocities)],
        parameters=parameter_names(spec, effects),
        channels=[*base, "u_water", "v_water", *([] if planar else ["w_water"])],
    )
    if len(set(dyn.parameters)) != len(dyn.parameters) or len(set(dyn.states)) != len(dyn.states):
        raise ModelError("two parameters or states share a name; rename the effect or its state")
    return dyn


def _symbols(dyn: Dynamics, effects: tuple[Effect, ...]) -> _Symbols:
    g, planar = dyn.graph, dyn.spec.dof == 3
    const = {name: g.sym(name) for name in dyn.parameters}
    if planar:
        const |= dict.fromkeys((*VERTICAL, *[row.name for row in TERMS if row.name not in const]), g.zero)
    for effect in effects:
        before = dict(const)  # the formulas of one effect all read the constants as they were before it
        for target, formula in effect.adjust.items():
            if target in const and g.value(const[target]) is None:
                const[target] = parse_effect(g, effect, formula, {**before, "value": before[target]})
    ground = {name: g.sym(name) if name in dyn.states else g.zero for name in SIXDOF_STATES}
    accel = {RATE[s]: (g.sym(RATE[s]) if s in dyn.velocities else g.zero) for s in RATE}
    inputs = {name: g.sym(name) for name in (*dyn.actuators, *dyn.exogenous)}
    inputs = {"delta_s": g.zero, "delta_b": g.zero, **inputs}
    time = g.sym("t")
    flow, flow_rate, acceleration = current(g, effects, inputs, ground, time)
    water = {k: g.sub(ground[k], flow[k]) if k in flow else ground[k] for k in RATE}
    water_rate = {a: g.sub(accel[a], flow_rate[k]) if k in flow_rate else accel[a] for k, a in RATE.items()}
    pull = {f"a{axis}": acceleration[k] for axis, k in zip("xyz", "uvw", strict=True)}
    return _Symbols(const, ground, water, accel, water_rate, pull, inputs, time)


def _reads(row: Term) -> frozenset[str]:
    return names_read(row.regressor)


def _slows(row: Term) -> bool:
    """Whether a row is drag straight ahead: X by surge alone."""
    return row.axis == "X" and _reads(row) - {"abs"} in ({"u"}, {"S", "U"})


def _total(g: Graph, parts: Mapping[Term, Node], chosen: Callable[[Term], bool]) -> Node:
    """Sum of the rows a condition picks."""
    return g.total(node for row, node in parts.items() if chosen(row))


def _row_forces(dyn: Dynamics, at: _Symbols) -> dict[Term, Node]:
    """Coefficient times regressor of every row, in the flow through the water."""
    g = dyn.graph
    names = {**at.inputs, **at.water, **at.water_rate}
    speeds = cross_flow_speeds(g, dyn.spec, at.const, at.water)
    names |= speeds
    side = cross_flow_side(g, dyn.spec, at.water, speeds)
    if dyn.spec.eta:
        names["eta1"] = g.parse(ETA, {**at.const, **names})
    ship = dyn.spec.propulsion == "mmg"
    if ship:
        names["U"] = g.parse(SPEED, {**at.const, **at.water})
        names["S"] = g.parse(SENSE, names)
    parts = {
        row: g.mul(at.const[row.name], g.parse(row.regressor, names, side))
        for row in rows_of(dyn.spec)
        if not row.is_number
    }
    return parts | (_propeller_and_rudder(g, {**at.const, **names}) if ship else {})


def _propeller_and_rudder(g: Graph, names: Mapping[str, Node]) -> dict[Term, Node]:
    """Forces of the MMG formulas, as parts that effects can ask for beside the rows."""
    known = dict(names)
    for name, formula in DEFINITIONS.items():
        known[name] = g.parse(formula, known)
    return {PARTS[key]: g.parse(formula, known) for key, (formula, _) in FORCES.items()}


def _hull_wrench(dyn: Dynamics, at: _Symbols, parts: Mapping[Term, Node]) -> dict[str, Node]:
    """Rows, strips, statics and pressure gradient less what the rigid body needs."""
    g = dyn.graph
    wrench = dict.fromkeys(AXIS.values(), g.zero)
    for row, node in parts.items():
        wrench[row.axis] = g.add(wrench[row.axis], node)
    if dyn.spec.sections:
        for axis, node in strip_drag(g, dyn.spec, at.const, at.water).items():
            wrench[axis] = g.add(wrench[axis], node)
    names = {**at.const, **at.ground, **at.accel, **at.pull}
    for axis in wrench:
        wrench[axis] = g.sub(wrench[axis], g.parse(RIGID_BODY[axis], names))
        wrench[axis] = g.add(wrench[axis], g.parse(STATICS[axis], names))
        wrench[axis] = g.add(wrench[axis], g.parse(PRESSURE_GRADIENT[axis], names))
    return wrench


def _add_effects(
    dyn: Dynamics,
    effects: tuple[Effect, ...],
    at: _Symbols,
    parts: Mapping[Term, Node],
    thrust: Node,
    wrench: dict[str, Node],
) -> None:
    """Add the effects' wrenches, and the rates and initial values of their own states."""
    g = dyn.graph
    calls: dict[str, Callable[..., Node]] = {
        "coef": lambda name: at.const.get(name, g.zero),
        "rows": lambda axis, symbol: _total(g, parts, lambda r: r.axis == axis and symbol in _reads(r)),
        "thrust": lambda: thrust,
        "drag": lambda: _total(g, parts, _slows),
        "quadratic_drag": lambda: _total(g, parts, lambda r: _slows(r) and r.velocity_power == 2),
    }
    names = {
        **at.const,
        **{k: at.ground[k] for k in _POSE},
        **at.water,
        **{f"{k}g": at.ground[k] for k in "uvw"},
        **at.accel,
        **at.inputs,
        **{s.name: g.sym(s.name) for e in effects for s in e.states},
        "t": at.time,
    }
    for effect in effects:
        for axis, formula in effect.force.items():
            wrench[axis] = g.add(wrench[axis], parse_effect(g, effect, formula, names, calls))
        for state in effect.states:
            dyn.rates[state.name] = parse_effect(g, effect, state.rate, names, calls)
            dyn.initial[state.name] = parse_effect(g, effect, state.initial, names, calls)
