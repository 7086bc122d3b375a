"""What the water does to the hull: its velocity and acceleration in body axes, cross-flow speeds, strip drag.

Takes the graph under construction and its symbols. Gives nodes that `dynamics` puts together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bayesid.equations.derivatives import Graph, Node
from bayesid.equations.formulas import CURRENT, ROUNDED_SIGN, SWING
from bayesid.equations.layout import KernelSpec
from bayesid.errors import ModelError
from bayesid.model.effects import Effect
from bayesid.model.terms.mmg import CROSS_FLOW

Nodes = Mapping[str, Node]

# Share of the cross-flow speed within which sgn(v) and sgn(w) are rounded: a step has to find the band of v,
# and the small heave of a steady turn has to stay outside that of w. 20/20 zig-zags of 40 L/U with planes at
# +-6 deg move by 0.06 m (generic_sub, 3.4 km) and 0.4 m (suboff_full, unstable, 2.7 km) against the jump;
# half a unit of the last printed digit of Y_v|r| and Z_w|q| moves them by 2.8 and 56 m. Default steps then
# leave 0.08 and 0.33 m where they left 1.6 and 1.0 m. With 0.1 for w a turn ended 0.06 deg off in trim, with
# 0.01 for v zig-zags stayed 1.2 m off.
SIDE = {"v": 0.1, "w": 0.01}


def parse_effect(
    g: Graph, effect: Effect, formula: str, names: Nodes, calls: Mapping[str, Any] | None = None
) -> Node:
    """Node of one formula of an effect; an error names the effect. The effect's parameters come on top of
    `names`."""
    own = {p.name: g.sym(effect.key(p.name)) for p in effect.parameters}
    try:
        return g.parse(formula, {**names, **own}, calls)
    except ModelError as exc:
        raise ModelError(f"effect {effect.name!r}: {exc}") from None


def current(
    g: Graph, effects: tuple[Effect, ...], inputs: Nodes, ground: Nodes, time: Node
) -> tuple[dict[str, Node], dict[str, Node], dict[str, Node]]:
    """Water in body axes: velocity c = R' V, its rate dc/dt = R' dV/dt - omega x c, acceleration R' dV/dt.

    Currents an effect declares change with time and are differentiated; an input held over a step
    (`flow_north`, `wind_north` ...) has no rate.
    """
    earth = {k: inputs.get(f"flow_{k}", g.zero) for k in ("north", "east", "down")}
    names = {"t": time} | {k: inputs[k] for k in ("wind_north", "wind_east") if k in inputs}
    for effect in effects:
        for direction, formula in effect.flow.items():
            earth[direction] = g.add(earth[direction], parse_effect(g, effect, formula, names))
    rate = {k: g.diff(node, time) for k, node in earth.items()}
    body = {k: g.parse(text, {**ground, **earth}) for k, text in CURRENT.items()}
    turned = {k: g.parse(text, {**ground, **rate}) for k, text in CURRENT.items()}
    names = {**ground, "uc": body["u"], "vc": body["v"], "wc": body["w"]}
    return body, {k: g.add(turned[k], g.parse(SWING[k], names)) for k in body}, turned


def cross_flow_speeds(g: Graph, spec: KernelSpec, const: Nodes, water: Nodes) -> dict[str, Node]:
    """Rv and Rw: sqrt(v^2 + w^2) where `cross` is 1, |v| and |w| where it is 0 and in the plane."""
    if spec.dof == 3:
        return {"Rv": g.call("abs", water["v"]), "Rw": g.call("abs", water["w"])}
    vv, ww = (g.mul(water[k], water[k]) for k in "vw")
    return {
        "Rv": g.call("sqrt", g.add(vv, g.mul(const["cross"], ww))),
        "Rw": g.call("sqrt", g.add(ww, g.mul(const["cross"], vv))),
    }


def cross_flow_side(
    g: Graph, spec: KernelSpec, water: Nodes, speeds: Nodes
) -> dict[str, Callable[[Node], Node]]:
    """The sgn() of the rows: in six degrees of freedom without its jump.

    sgn(v) Rv |r| jumps by 2 |w r| at v = 0. Where |v| is less than a share `SIDE` of Rv a polynomial replaces
    the sign, odd and with two continuous derivatives; elsewhere, and wherever Rv is |v|, the sign is exact.
    """
    if spec.dof == 3:
        return {}
    of = {water[k]: (speeds[f"R{k}"], g.const(1.0 / SIDE[k])) for k in "vw"}

    def side(velocity: Node) -> Node:
        speed, steep = of[velocity]
        share = g.mul(g.mul(velocity, steep), g.call("rsqrt", g.mul(speed, speed)))
        return g.parse(ROUNDED_SIGN, {"x": g.call("min", g.call("max", share, g.const(-1.0)), g.one)})

    return {"sgn": side}


def strip_drag(g: Graph, spec: KernelSpec, const: Nodes, water: Nodes) -> dict[str, Node]:
    """Strip drag by a trapezoid of stations over the length (Healey & Lienard 1993 form)."""
    n = spec.sections
    out = dict.fromkeys(("Y", "Z", "M", "N"), g.zero)
    if spec.propulsion == "mmg":
        return _ship_cross_flow(g, n, const, water)
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


def _ship_cross_flow(g: Graph, n: int, const: Nodes, water: Nodes) -> dict[str, Node]:
    """Cross-flow drag of a ship, whose turning counts differently in force and moment."""
    out = {"Y": g.zero, "N": g.zero}
    names = {**const, **water}
    pressure = g.add(const["strip_Y"], g.parse(CROSS_FLOW["pressure"], names))
    for i in range(n):
        xi = -0.5 + i / (n - 1)
        step = g.mul(g.const((0.5 if i in (0, n - 1) else 1.0) / (n - 1)), g.mul(const["L"], pressure))
        place = g.mul(g.const(xi), const["L"])
        for axis, arm in (("Y", g.one), ("N", place)):
            across = g.parse(CROSS_FLOW[axis], {**names, "x": place})
            push = g.mul(g.mul(step, arm), g.mul(across, g.call("abs", across)))
            out[axis] = g.sub(out[axis], push)
    return out
