"""Print the discrete adjoint of the forward run, for one parameter vector and for sixteen at once.

From cotangents of the recorded states to those of initial state, parameters and actuator positions.

Takes a `Context`. Gives source lines. Reads the stages a forward run left in its `trace`.
"""

from __future__ import annotations

from collections.abc import Callable

from bayesid.equations.derivatives import Node
from bayesid.equations.print_context import (
    FUSED,
    LANES,
    STAGE_PART,
    Context,
    LaneRows,
    stage_positions,
    step_head,
)

_ARGUMENTS = "par, minv, times, steps, act, exo, record, trace, cot, gx0, gpar, gact"


def _slopes(c: Context) -> dict[Node, Node]:
    """Derivatives of g . rows by every symbol, in one reverse sweep."""
    g = c.g
    return g.gradient(g.total(g.mul(g.sym(f"g{i}"), node) for i, node in enumerate(c.rows)))


def _row_cotangents(c: Context, minv: Callable[[int], str]) -> list[str]:
    """g0..: cotangents of the balance rows (through the inverse mass matrix), then of the slow rows."""
    out = []
    for i in range(c.nv):
        terms = (f"{minv(j * c.nv + i)} * c{c.place[j]}" for j in range(c.nv))
        out.append(f"g{i} = " + " + ".join(terms))
    return out + [f"g{i} = c{c.place[i]}" for i in range(c.nv, c.nx)]


def _stage_shift() -> list[str]:
    return [
        "weight = h / 3.0 if (stage == 1 or stage == 2) else h / 6.0",
        "move = 0.0 if stage == 3 else (h if stage == 2 else 0.5 * h)",
        "t = times[s] + (0.0 if stage == 0 else (h if stage == 3 else 0.5 * h))",
        STAGE_PART,
    ]


def adjoint_lines(c: Context) -> list[str]:
    d, nx, na = c.dyn, range(c.nx), len(c.dyn.actuators)
    slopes = _slopes(c)
    outputs = [(f"y{i}", slopes.get(c.g.sym(n), c.g.zero)) for i, n in enumerate(d.states)]
    moved = [i for i, n in enumerate(d.actuators) if c.g.sym(n) in slopes]
    outputs += [(f"gpar[{i}] +", slopes[c.g.sym(n)]) for i, n in enumerate(c.index) if c.g.sym(n) in slopes]
    outputs += [(f"by{i}", slopes[c.g.sym(d.actuators[i])]) for i in moved]
    body = [
        *_stage_shift(),
        *stage_positions(c, 0),
        *[f"c{i} = weight * lam{i} + move * y{i}" for i in nx],
        *[f"z{i} = trace[s, stage, {i}]" for i in nx],
        *[f"a{i} = trace[s, stage, {c.nx + i}]" for i in range(c.nv)],
        *_row_cotangents(c, "minv[{}]".format),
    ]
    return [
        FUSED,
        f"def {c.prefix}_adjoint({_ARGUMENTS}):",
        '    """Discrete adjoint of the run that filled `trace`; gx0 and gact are set, gpar is added to."""',
        *[f"    lam{i} = 0.0" for i in nx],
        "    sample = record.size - 1",
        "    for q in range(steps.size, -1, -1):",
        "        while sample >= 0 and record[sample] == q:",
        *[f"            lam{i} += cot[sample, {i}]" for i in nx],
        "            sample -= 1",
        "        if q == 0:",
        "            break",
        "        s = q - 1",
        *step_head(c, "s"),
        *[f"        y{i} = 0.0" for i in nx],
        *[f"        back{i} = lam{i}" for i in nx],
        *[f"        ga{i} = 0.0" for i in range(2 * na)],
        "        for stage in range(3, -1, -1):",
        *[" " * 12 + line for line in body],
        *c.emit(outputs, 12, c.local_symbols(), prefix="v"),
        *[f"            ga{i} += by{i}" for i in moved],
        *[f"            ga{na + i} += part * by{i}" for i in moved],
        *[f"            back{i} += y{i}" for i in nx],
        *[f"        lam{i} = back{i}" for i in nx],
        *[f"        gact[s, {i}] = ga{i}" for i in range(2 * na)],
        *[f"    gx0[{i}] = lam{i}" for i in nx],
    ]


def adjoint_lanes_lines(c: Context) -> list[str]:
    """As `adjoint_lines`, for sixteen vectors."""
    g, d, nx, nv, na = c.g, c.dyn, c.nx, c.nv, len(c.dyn.actuators)
    slopes, names = _slopes(c), list(c.index)
    used = [i for i, n in enumerate(names) if g.sym(n) in slopes]
    rows = LaneRows(
        cotangent=nx, back=nx, slope=nx, stage=nx, acceleration=nv, act=2 * na, by_act=2 * na, minv=nv * nv,
        par=len(names), by_par=len(used),
    )  # fmt: skip
    outputs = [(f"y{i}", slopes.get(g.sym(n), g.zero)) for i, n in enumerate(d.states)]
    outputs += [(rows.at("by_par", j) + " +", slopes[g.sym(names[i])]) for j, i in enumerate(used)]
    moved = [i for i, n in enumerate(d.actuators) if g.sym(n) in slopes]
    outputs += [(f"by{i}", slopes[g.sym(d.actuators[i])]) for i in moved]
    body = [
        *[f"c{i} = weight * {rows.at('cotangent', i)} + move * {rows.at('slope', i)}" for i in range(nx)],
        *_row_cotangents(c, lambda i: rows.at("minv", i)),
    ]
    size, traced = nx * LANES, (nx + nv) * LANES
    return [
        f"{c.upper}_ADJOINT_PARAMETERS = np.array({used!r}, dtype=np.int64)",
        "",
        "",
        FUSED,
        f"def {c.prefix}_adjoint_lanes({_ARGUMENTS}):",
        f'    """Discrete adjoint over {LANES} vectors; arrays are flat with {LANES} values per entry."""',
        f"    work = np.zeros({rows.count * LANES})",
        *rows.fill(4, "par", "par[i]"),
        *rows.fill(4, "minv", "minv[i]"),
        "    sample = record.size - 1",
        "    for q in range(steps.size, -1, -1):",
        "        while sample >= 0 and record[sample] == q:",
        f"            for i in range({size}):",
        f"                work[{rows.first['cotangent'] * LANES} + i] += cot[sample * {size} + i]",
        "            sample -= 1",
        "        if q == 0:",
        "            break",
        "        s = q - 1",
        "        h = steps[s]",
        *[f"        e{i} = exo[s, {i}]" for i in range(len(d.exogenous))],
        *rows.copy(8, "back", "cotangent"),
        *rows.fill(8, "slope", "0.0"),
        *rows.fill(8, "by_act", "0.0"),
        *rows.fill(8, "act", f"act[s * {2 * na * LANES} + i]"),
        "        for stage in range(3, -1, -1):",
        *[" " * 12 + line for line in _stage_shift()],
        f"            of = (s * 4 + stage) * {traced}",
        *rows.fill(12, "stage", "trace[of + i]"),
        *rows.fill(12, "acceleration", f"trace[of + {size} + i]"),
        f"            for l in range({LANES}):",
        *[" " * 16 + line for line in body],
        *c.emit(outputs, 16, c.lane_symbols(rows), prefix="v", lanes=True),
        *[f"                {rows.at('by_act', i)} += by{i}" for i in moved],
        *[f"                {rows.at('by_act', na + i)} += part * by{i}" for i in moved],
        *[f"                {rows.at('slope', i)} = y{i}" for i in range(nx)],
        *[f"                {rows.at('back', i)} += y{i}" for i in range(nx)],
        *rows.copy(8, "cotangent", "back"),
        *rows.store(8, "by_act", f"gact[s * {2 * na * LANES} + i]"),
        *rows.store(4, "cotangent", "gx0[i]"),
        *rows.store(4, "by_par", "gpar[i]"),
    ]
