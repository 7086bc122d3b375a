"""Print the forward run: RK4 of one parameter vector, and of sixteen at once.

Takes a `Context`. Gives source lines. Inputs are held over each step. The equations are printed into the
stage loop, not called: a call costs numba one more optimisation of its body per level.
"""

from __future__ import annotations

from bayesid.kernels.context import FUSED, LANES, Context, stage_head, step_head


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
    """RK4 with the stage loop outside the lane loop, so that the inner one vectorises (16 constant lanes).

    All that is written lies in one array, `work`: state at the start of the step, at the stage, weighted sum
    of the rates, accelerations. More arrays would need more run-time overlap checks than numba's LLVM grants.
    """
    nx, na, d = c.nx, len(c.dyn.actuators), c.dyn
    symbols = c.symbols()
    symbols |= {n: f"par[{i * LANES} + l]" for n, i in c.index.items()}
    symbols |= {n: f"work[{(nx + i) * LANES} + l]" for i, n in enumerate(d.states)}
    symbols |= {n: f"act[base + {i * LANES} + l]" for i, n in enumerate(d.actuators)}
    symbols |= {n: f"e{i}" for i, n in enumerate(d.exogenous)}
    body = c.emit(c.rate_outputs(), 16, symbols, lanes=True)
    body += c.accelerations(16, f"minv[{{}} * {LANES} + l]")
    body += [f"                work[{(3 * nx + i) * LANES} + l] = a{i}" for i in range(c.nv)]
    for i in range(nx):
        rate, total = c.rate_name(i), f"work[{(2 * nx + i) * LANES} + l]"
        body += [
            " " * 16 + f"q{i} = {total} + weight * {rate}",
            " " * 16 + f"{total} = q{i} * keep",
            " " * 16 + f"w{i} = work[{i * LANES} + l] + (q{i} * sixth if last else half * {rate})",
            " " * 16 + f"work[{(nx + i) * LANES} + l] = w{i}",
        ]
    size = nx * LANES
    traced = (nx + c.nv) * LANES
    return [
        FUSED,
        f"def {c.prefix}_lanes(par, minv, x0, times, steps, act, exo, record, out, trace):",
        f'    """RK4 over {LANES} vectors at once; every array is flat with {LANES} values per entry.',
        "",
        "    `trace`, if not empty, gets state and acceleration of every stage.",
        '    """',
        f"    work = np.zeros({(3 * nx + c.nv) * LANES})",
        f"    for i in range({size}):",
        "        work[i] = x0[i]",
        f"        work[{size} + i] = x0[i]",
        "    store = trace.size > 0",
        "    sample = 0",
        "    while sample < record.size and record[sample] == 0:",
        f"        for i in range({size}):",
        f"            out[sample * {size} + i] = work[i]",
        "        sample += 1",
        "    for s in range(steps.size):",
        "        h = steps[s]",
        "        sixth = h / 6.0",
        f"        base = s * {na * LANES}",
        *[f"        e{i} = exo[s, {i}]" for i in range(len(d.exogenous))],
        "        for stage in range(4):",
        *stage_head("s"),
        "            last = stage == 3",
        "            keep = 0.0 if last else 1.0",
        f"            at = (s * 4 + stage) * {traced}",
        "            if store:",
        f"                for i in range({size}):",
        f"                    trace[at + i] = work[{size} + i]",
        f"            for l in range({LANES}):",
        *body,
        "            if store:",
        f"                for i in range({c.nv * LANES}):",
        f"                    trace[at + {size} + i] = work[{3 * size} + i]",
        f"        for i in range({size}):",
        f"            work[i] = work[{size} + i]",
        "        while sample < record.size and record[sample] == s + 1:",
        f"            for i in range({size}):",
        f"                out[sample * {size} + i] = work[i]",
        "            sample += 1",
    ]
