"""Print the forward run with its exact sensitivities (the stage form of the variational equations).

Takes a `Context`. Gives source lines. With W(x, a, p) = 0 and mass = -dW/da, the acceleration's slope by
anything is inverse mass times dW at the current acceleration: mass parameters need no case of their own.

Columns are carried in blocks of sixteen: only a loop of constant length over one array vectorises.
"""

from __future__ import annotations

from bayesid.equations.derivatives import Node
from bayesid.equations.print_context import FUSED, LANES, Context, stage_head, stage_positions, step_head

Outputs = list[tuple[str, Node]]


def layout_lines(c: Context) -> list[str]:
    """Sparse slopes by parameter: (balance row, parameter)."""
    entries = [(row, k) for row, node in enumerate(c.rows) for k, _ in c.slopes(node, c.index)]
    return [f"{c.upper}_ENTRIES = np.array({entries!r}, dtype=np.int64).reshape(-1, 2)"]


def variational_lines(c: Context) -> list[str]:
    d, nx, nv, na = c.dyn, c.nx, c.nv, len(c.dyn.actuators)
    ni = na + len(d.exogenous)
    parameters: Outputs = []
    inputs: Outputs = []
    forced: list[int] = []
    for row, node in enumerate(c.rows):
        before = len(parameters) + len(inputs)
        parameters += [
            (f"dpar[{len(parameters) + j}]", slope) for j, (_, slope) in enumerate(c.slopes(node, c.index))
        ]
        inputs += [(f"dinp[{row}, {k}]", s) for k, s in c.slopes(node, [*d.actuators, *d.exogenous])]
        if row < nv or len(parameters) + len(inputs) > before:
            forced.append(row)
    jacobian, pattern = _state_slopes(c)
    known: dict[Node, str] = {}
    symbols = c.local_symbols()
    forcing = 3 * nx
    rows = forcing + len(forced)
    block = rows * LANES
    return [
        FUSED,
        f"def {c.prefix}_variational(par, minv, x0, s0, times, steps, act, dact, exo, record, entries,",
        "        columns, act_columns, input_columns, path, out, sens, rate, srate):",
        '    """States and sensitivities at the recorded steps; `rate`, `srate`, if there, get their rates.',
        "",
        "    `columns[e]` is the output column of sparse parameter entry e (-1: not wanted); `act_columns`",
        "    maps actuator slopes, `input_columns` raw inputs (actuators, then exogenous) to output columns.",
        "    `path` (records, states), if not empty: after every record the run starts again there, from s0.",
        '    """',
        "    n = s0.shape[1]",
        f"    blocks = (n + {LANES - 1}) // {LANES}",
        f"    work = np.zeros(blocks * {block})",
        f"    slot = np.full({nx}, -1, dtype=np.int64)",
        *[f"    slot[{row}] = {forcing + j}" for j, row in enumerate(forced)],
        "    source = np.empty(columns.size, dtype=np.int64)",
        "    target = np.empty(columns.size, dtype=np.int64)",
        "    wanted = 0",
        "    for e in range(columns.size):",
        "        c = columns[e]",
        "        if c >= 0:",
        "            source[wanted] = e",
        f"            target[wanted] = (c // {LANES} * {rows} + slot[entries[e, 0]]) * {LANES} + c % {LANES}",
        "            wanted += 1",
        "    want_inputs = False",
        "    for a in range(act_columns.size):",
        "        want_inputs = want_inputs or act_columns[a] >= 0",
        "    for a in range(input_columns.size):",
        "        want_inputs = want_inputs or input_columns[a] >= 0",
        "    want_rate = rate.size > 0",
        "    restart = path.size > 0",
        "    dpar = np.empty(columns.size)",
        f"    dinp = np.zeros(({nx}, {ni}))",
        *[f"    b{i} = x0[{i}]" for i in range(nx)],
        *_copy_columns(c, rows, 4, "work[{at}] = s0[{i}, c]"),
        "    last = steps.size - 1",
        "    sample = 0",
        "    for q in range(steps.size + 1):",
        "        first = sample",
        "        while sample < record.size and record[sample] == q:",
        *[f"            out[sample, {i}] = b{i}" for i in range(nx)],
        *_copy_columns(c, rows, 12, "sens[sample, {i}, c] = work[{at}]"),
        "            sample += 1",
        "        if restart and sample > first:",
        *[f"            b{i} = path[sample - 1, {i}]" for i in range(nx)],
        *_copy_columns(c, rows, 12, "work[{at}] = s0[{i}, c]"),
        "        if q > last and not (want_rate and sample > first):",
        "            break",
        "        s = min(q, last)",
        *step_head(c, "s"),
        "        begin = times[s] + (h if q > last else 0.0)",
        *[f"        z{i} = b{i}" for i in range(nx)],
        *[f"        q{i} = 0.0" for i in range(nx)],
        "        for o in range(blocks):",
        f"            base = o * {block}",
        f"            for l in range({nx * LANES}):",
        f"                work[base + {nx * LANES} + l] = work[base + l]",
        f"                work[base + {2 * nx * LANES} + l] = 0.0",
        "        for stage in range(1 if q > last else 4):",
        *stage_head("begin", plain=True),
        "            part += 1.0 if q > last else 0.0",
        *stage_positions(c, 12),
        *c.emit(c.rate_outputs(), 12, symbols, known=known),
        *c.accelerations(12),
        *c.emit(jacobian, 12, symbols, prefix="v", known=known),
        "            if wanted:",
        *c.emit(parameters, 16, symbols, prefix="p", known=dict(known)),
        "                pass",
        "            for o in range(blocks):",
        f"                base = o * {block} + {forcing * LANES}",
        f"                for l in range({len(forced) * LANES}):",
        "                    work[base + l] = 0.0",
        "            for w in range(wanted):",
        "                work[target[w]] += dpar[source[w]]",
        "            if want_inputs:",
        *c.emit(inputs, 16, symbols, prefix="w", known=known),
        *_input_forcing(c, rows, na, ni),
        "            for o in range(blocks):",
        f"                base = o * {block}",
        f"                for l in range({LANES}):",
        *_propagate(c, pattern, forced, forcing),
        *[f"            q{i} += weight * {c.rate_name(i)}" for i in range(nx)],
        *[f"            z{i} = b{i} + half * {c.rate_name(i)}" for i in range(nx)],
        "            if want_rate and stage == 0:",
        "                for j in range(first, sample):",
        *[f"                    rate[j, {i}] = q{i}" for i in range(nx)],
        *_copy_columns(c, rows, 20, "srate[j, {i}, c] = work[{at}]", shift=2 * nx),
        "        if q <= last:",
        *[f"            b{i} += h / 6.0 * q{i}" for i in range(nx)],
        "            for o in range(blocks):",
        f"                base = o * {block}",
        f"                for l in range({nx * LANES}):",
        f"                    work[base + l] += h / 6.0 * work[base + {2 * nx * LANES} + l]",
    ]


def _copy_columns(c: Context, rows: int, indent: int, text: str, shift: int = 0) -> list[str]:
    """Loop over states and columns around one copy between the blocks and a plain array."""
    at = f"(c // {LANES} * {rows} + {shift} + i) * {LANES} + c % {LANES}"
    pad = " " * indent
    return [
        f"{pad}for i in range({c.nx}):",
        f"{pad}    for c in range(n):",
        f"{pad}        " + text.format(at=at, i="i"),
    ]


def _state_slopes(c: Context) -> tuple[Outputs, list[list[int]]]:
    """Outputs d<row>_<column>: slopes of the balance and of the slow rows by state; columns of every row."""
    outputs: Outputs = []
    pattern: list[list[int]] = []
    for row, node in enumerate(c.rows):
        slopes = list(c.slopes(node, c.dyn.states))
        outputs += [(f"d{row}_{k}", slope) for k, slope in slopes]
        pattern.append([k for k, _ in slopes])
    return outputs, pattern


def _propagate(c: Context, pattern: list[list[int]], forced: list[int], forcing: int) -> list[str]:
    """Rate of sixteen columns and their share of the RK4 step; the inverse mass comes last."""
    nx, nv = c.nx, c.nv
    at = "work[base + {} + l]"
    body = [f"c{i} = " + at.format((nx + i) * LANES) for i in range(nx)]
    for row in range(nx):
        terms = [at.format((forcing + forced.index(row)) * LANES)] if row in forced else []
        terms += [f"d{row}_{k} * c{k}" for k in pattern[row]]
        body.append(f"g{row} = " + (" + ".join(terms) or "0.0"))
    for i in range(nx):
        row = c.place.index(i)
        rate = " + ".join(f"minv[{row * nv + j}] * g{j}" for j in range(nv)) if row < nv else f"g{row}"
        body += [
            f"r{i} = {rate}",
            at.format((2 * nx + i) * LANES) + f" += weight * r{i}",
            at.format((nx + i) * LANES) + " = " + at.format(i * LANES) + f" + half * r{i}",
        ]
    return [" " * 20 + line for line in body]


def _input_forcing(c: Context, rows: int, na: int, ni: int) -> list[str]:
    return [
        f"                for row in range({c.nx}):",
        "                    if slot[row] < 0:",
        "                        continue",
        "                    for a in range(act_columns.size):",
        "                        c = act_columns[a]",
        "                        if c >= 0:",
        f"                            spot = (c // {LANES} * {rows} + slot[row]) * {LANES} + c % {LANES}",
        f"                            for j in range({na}):",
        f"                                along = dact[s, j, a] + part * dact[s, {na} + j, a]",
        "                                work[spot] += dinp[row, j] * along",
        f"                    for j in range({ni}):",
        "                        c = input_columns[j]",
        "                        if c >= 0:",
        f"                            spot = (c // {LANES} * {rows} + slot[row]) * {LANES} + c % {LANES}",
        "                            work[spot] += dinp[row, j]",
    ]
