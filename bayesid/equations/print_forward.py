"""Print the forward run: RK4 of one parameter vector, and of sixteen at once.

Takes a `Context`. Gives source lines. Over each step the exogenous inputs are held and the actuators lie on a
straight line: `act` has their means, then their changes. The equations are printed into the
stage loop, not called: a call costs numba one more optimisation of its body per level.
"""

from __future__ import annotations

from bayesid.equations.print_context import (
    FUSED,
    LANES,
    Context,
    LaneRows,
    stage_head,
    stage_positions,
    step_head,
)


def simulate_lines(c: Context) -> list[str]:
    """One vector; the state lives in local variables."""
    nx = range(c.nx)
    symbols = c.local_symbols()
    return [
        FUSED,
        f"def {c.prefix}_simulate(par, minv, x0, times, steps, act, exo, record, out, trace):",
        '    """States at the recorded steps.',
        "",
        "    `trace` (steps, 4, states + velocities), if not empty, gets state, acceleration of every stage.",
        '    """',
        *[f"    b{i} = x0[{i}]" for i in nx],
        "    keep = trace.size > 0",
        "    sample = 0",
        "    for s in range(steps.size + 1):",
        "        while sample < record.size and record[sample] == s:",
        *[f"            out[sample, {i}] = b{i}" for i in nx],
        "            sample += 1",
        "        if s == steps.size:",
        "            break",
        *step_head(c, "s"),
        *[f"        z{i} = b{i}" for i in nx],
        *[f"        q{i} = 0.0" for i in nx],
        "        for stage in range(4):",
        *stage_head("s"),
        *stage_positions(c, 12),
        *c.emit(c.rate_outputs(), 12, symbols),
        *c.accelerations(12),
        "            if keep:",
        *[f"                trace[s, stage, {i}] = z{i}" for i in nx],
        *[f"                trace[s, stage, {c.nx + i}] = a{i}" for i in range(c.nv)],
        *[f"            q{i} += weight * {c.rate_name(i)}" for i in nx],
        *[f"            z{i} = b{i} + half * {c.rate_name(i)}" for i in nx],
        *[f"        b{i} += h / 6.0 * q{i}" for i in nx],
    ]


def lanes_lines(c: Context) -> list[str]:
    """RK4 with the stage loop outside the lane loop, so that the inner one vectorises (16 constant lanes)."""
    nx, nv, na, d = c.nx, c.nv, len(c.dyn.actuators), c.dyn
    rows = LaneRows(
        start=nx, stage=nx, total=nx, acceleration=nv, act=2 * na, minv=nv * nv, par=len(d.parameters)
    )
    body = c.emit(c.rate_outputs(), 16, c.lane_symbols(rows), lanes=True)
    body += c.accelerations(16, lambda i: rows.at("minv", i))
    body += [f"                {rows.at('acceleration', i)} = a{i}" for i in range(nv)]
    for i in range(nx):
        rate, total = c.rate_name(i), rows.at("total", i)
        body += [
            " " * 16 + f"q{i} = {total} + weight * {rate}",
            " " * 16 + f"{total} = q{i} * keep",
            " " * 16 + f"w{i} = {rows.at('start', i)} + (q{i} * sixth if last else half * {rate})",
            " " * 16 + f"{rows.at('stage', i)} = w{i}",
        ]
    size, traced = nx * LANES, (nx + nv) * LANES
    return [
        FUSED,
        f"def {c.prefix}_lanes(par, minv, x0, times, steps, act, exo, record, out, trace):",
        f'    """RK4 over {LANES} vectors at once; every array is flat with {LANES} values per entry.',
        "",
        "    `trace`, if not empty, gets state and acceleration of every stage.",
        '    """',
        f"    work = np.zeros({rows.count * LANES})",
        *rows.fill(4, "par", "par[i]"),
        *rows.fill(4, "minv", "minv[i]"),
        *rows.fill(4, "start", "x0[i]"),
        *rows.fill(4, "stage", "x0[i]"),
        "    store = trace.size > 0",
        "    sample = 0",
        "    for s in range(steps.size + 1):",
        "        while sample < record.size and record[sample] == s:",
        *rows.store(12, "start", f"out[sample * {size} + i]"),
        "            sample += 1",
        "        if s == steps.size:",
        "            break",
        "        h = steps[s]",
        "        sixth = h / 6.0",
        *[f"        e{i} = exo[s, {i}]" for i in range(len(d.exogenous))],
        *rows.fill(8, "act", f"act[s * {2 * na * LANES} + i]"),
        "        for stage in range(4):",
        *stage_head("s"),
        "            last = stage == 3",
        "            keep = 0.0 if last else 1.0",
        f"            to = (s * 4 + stage) * {traced}",
        "            if store:",
        *rows.store(16, "stage", "trace[to + i]"),
        f"            for l in range({LANES}):",
        *body,
        "            if store:",
        *rows.store(16, "acceleration", f"trace[to + {size} + i]"),
        *rows.copy(8, "start", "stage"),
    ]
