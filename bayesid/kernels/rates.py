"""Print mass matrix, initial values of own states, the rate of the state, and the run of many lanes.

Takes a `Context`. Gives source lines.
"""

from __future__ import annotations

from bayesid.kernels.context import FUSED, LANES, PLAIN, Context


def mass_lines(c: Context) -> list[str]:
    outputs = []
    for i, node in enumerate(c.balance):
        for j, slope in c.slopes(node, c.accel):
            outputs.append((f"mass[{i}, {j}]", c.g.neg(slope)))
    return [
        PLAIN,
        f"def {c.prefix}_mass(par):",
        '    """Mass matrix, added mass included."""',
        f"    mass = np.zeros(({c.nv}, {c.nv}))",
        *c.emit(outputs, 4),
        "    return mass",
    ]


def start_lines(c: Context) -> list[str]:
    base = c.nx - len(c.dyn.initial)
    outputs = []
    for i, node in enumerate(c.dyn.initial.values()):
        outputs.append((f"x[{base + i}]", node))
        outputs += [(f"slope_x[{i}, {j}]", s) for j, s in c.slopes(node, c.dyn.states[:base])]
        outputs += [(f"slope_par[{i}, {k}]", s) for k, s in c.slopes(node, c.index)]
    return [
        PLAIN,
        f"def {c.prefix}_start(x, exo, t, par, slope_x, slope_par):",
        '    """Fill the effects\' own states of x with their initial values, and the slopes of those."""',
        *c.emit(outputs, 4),
        f"    return {base}",
    ]


def rhs_lines(c: Context) -> list[str]:
    return [
        FUSED,
        f"def {c.prefix}_rhs(x, act, exo, t, par, minv, k):",
        '    """Rate of the state."""',
        *c.emit(c.rate_outputs(), 4),
        *c.accelerations(4),
        *c.store_rates(),
    ]


def lanes_lines(c: Context) -> list[str]:
    """RK4 with the stage loop outside the lane loop, so that numba vectorises the inner one (16 constant
    lanes).

    `work` holds state at the start of the step, at the stage, and the weighted sum of the rates.
    """
    nx, na, d = c.nx, len(c.dyn.actuators), c.dyn
    symbols = c.symbols()
    symbols |= {n: f"par[{i * LANES} + l]" for n, i in c.index.items()}
    symbols |= {n: f"work[{(nx + i) * LANES} + l]" for i, n in enumerate(d.states)}
    symbols |= {n: f"act[base + {i * LANES} + l]" for i, n in enumerate(d.actuators)}
    symbols |= {n: f"e{i}" for i, n in enumerate(d.exogenous)}
    body = c.emit(c.rate_outputs(), 16, symbols, lanes=True)
    body += c.accelerations(16, f"minv[{{}} * {LANES} + l]")
    for i, name in enumerate(d.states):
        rate = f"a{d.velocities.index(name)}" if name in d.velocities else f"k{i}"
        total = f"work[{(2 * nx + i) * LANES} + l]"
        body += [
            " " * 16 + f"q{i} = {total} + weight * {rate}",
            " " * 16 + f"{total} = q{i} * keep",
            " " * 16 + f"w{i} = work[{i * LANES} + l] + (q{i} * sixth if last else half * {rate})",
            " " * 16 + f"work[{(nx + i) * LANES} + l] = w{i}",
        ]
    size = nx * LANES
    return [
        FUSED,
        f"def {c.prefix}_lanes(par, minv, x0, times, steps, act, exo, record, out):",
        f'    """RK4 over {LANES} parameter vectors; arrays are flat with {LANES} values per entry."""',
        f"    work = np.zeros({3 * size})",
        f"    for i in range({size}):",
        "        work[i] = x0[i]",
        f"        work[{size} + i] = x0[i]",
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
        "            weight = 2.0 if (stage == 1 or stage == 2) else 1.0",
        "            half = h if stage == 2 else 0.5 * h",
        "            last = stage == 3",
        "            keep = 0.0 if last else 1.0",
        "            t = times[s] + (0.0 if stage == 0 else (h if last else 0.5 * h))",
        f"            for l in range({LANES}):",
        *body,
        f"        for i in range({size}):",
        f"            work[i] = work[{size} + i]",
        "        while sample < record.size and record[sample] == s + 1:",
        f"            for i in range({size}):",
        f"                out[sample * {size} + i] = work[i]",
        "            sample += 1",
    ]
