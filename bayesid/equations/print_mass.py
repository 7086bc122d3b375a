"""Print mass matrices and the initial values of the effects' own states.

Takes a `Context`. Gives source lines.
"""

from __future__ import annotations

from bayesid.equations.print_context import PLAIN, Context


def mass_lines(c: Context) -> list[str]:
    symbols = c.symbols() | {n: f"pars[b, {i}]" for n, i in c.index.items()}
    outputs = []
    for i, node in enumerate(c.balance):
        for j, slope in c.slopes(node, c.accel):
            outputs.append((f"out[b, {i}, {j}]", c.g.neg(slope)))
    return [
        PLAIN,
        f"def {c.prefix}_masses(pars, out):",
        '    """Mass matrices, added mass included, of every parameter vector; `out` comes with zeros."""',
        "    for b in range(pars.shape[0]):",
        *c.emit(outputs, 8, symbols),
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
