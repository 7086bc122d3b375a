"""Print the slopes of the equations of motion: state Jacobian, slopes by parameter and input, and the
adjoint.

Takes a `Context`. Gives source lines. With W(x, a, p) = 0 and mass = -dW/da, the acceleration's slope by
anything is inverse mass times dW at the current acceleration, so that mass parameters need no case of their
own.
"""

from __future__ import annotations

from bayesid.kernels.context import FUSED, Context
from bayesid.kernels.expr import Node

Outputs = list[tuple[str, Node]]


def linearise_lines(c: Context) -> list[str]:
    """Values, state Jacobian and sparse slopes of the balance by parameter and input; then the Jacobian's
    product."""
    d, n = c.dyn, c.nv
    jacobian, columns, pattern = _state_slopes(c)
    parameters: Outputs = []
    inputs: Outputs = []
    entries: list[tuple[int, int]] = []
    for row, node in enumerate(c.rows):
        for k, slope in c.slopes(node, c.index):
            parameters.append((f"dpar[{len(entries)}]", slope))
            entries.append((row, k))
        for k, slope in c.slopes(node, [*d.actuators, *d.exogenous]):
            inputs.append((f"dinp[{row}, {k}]", slope))
    out = [
        f"{c.upper}_ENTRIES = np.array({entries!r}, dtype=np.int64).reshape(-1, 2)",
        f"{c.upper}_ROWS = np.array({c.place!r}, dtype=np.int64)",
        "",
        "",
        FUSED,
        f"def {c.prefix}_linearise(x, act, exo, t, par, minv, k, jac, dpar, dinp):",
        '    """Rate, its Jacobian, and slopes of the balance rows by parameter (sparse) and input."""',
        *c.emit(c.rate_outputs(), 4),
        *c.accelerations(4),
        *c.store_rates(),
        *c.emit(jacobian + parameters + inputs, 4, prefix="v"),
    ]
    for k, rows in columns:
        for i in range(n):
            text = " + ".join(f"minv[{i * n + j}] * d{j}_{k}" for j in rows)
            out.append(f"    jac[{c.place[i]}, {k}] = {text}")
    return out + ["", "", *_propagate(c, pattern)]


def _state_slopes(c: Context) -> tuple[Outputs, list[tuple[int, list[int]]], list[tuple[int, int]]]:
    """Outputs d<row>_<column> and jac[...]; balance rows of every column; non-zero pattern of the
    Jacobian."""
    outputs: Outputs = []
    columns: dict[int, list[int]] = {}
    pattern: set[tuple[int, int]] = set()
    for row, node in enumerate(c.rows):
        for k, slope in c.slopes(node, c.dyn.states):
            if row < c.nv:
                outputs.append((f"d{row}_{k}", slope))
                columns.setdefault(k, []).append(row)
                pattern |= {(place, k) for place in c.place[: c.nv]}
            else:
                outputs.append((f"jac[{c.place[row]}, {k}]", slope))
                pattern.add((c.place[row], k))
    return outputs, sorted(columns.items()), sorted(pattern)


def _propagate(c: Context, pattern: list[tuple[int, int]]) -> list[str]:
    by_row: dict[int, list[int]] = {}
    for i, k in pattern:
        by_row.setdefault(i, []).append(k)
    body = [f"        c{i} = s_in[{i} * n + c]" for i in range(c.nx)]
    for i in range(c.nx):
        terms = "".join(f" + j{i}_{k} * c{k}" for k in by_row.get(i, []))
        body.append(f"        s_out[{i} * n + c] = b[{i} * n + c]{terms}")
    return [
        FUSED,
        f"def {c.prefix}_propagate(jac, s_in, b, s_out, n):",
        '    """s_out = jac s_in + b for n columns, written for the non-zero pattern of the Jacobian."""',
        *[f"    j{i}_{k} = jac[{i}, {k}]" for i, k in pattern],
        "    for c in range(n):",
        *body,
    ]


def adjoint_lines(c: Context) -> list[str]:
    """Reverse slopes of lam . rate by state, parameters and actuators, in one sweep over the balance."""
    g, d, nv = c.g, c.dyn, c.nv
    slopes = g.gradient(g.total(g.mul(g.sym(f"g{i}"), node) for i, node in enumerate(c.rows)))
    head = []
    for i in range(nv):
        weights = " + ".join(f"minv[{j * nv + i}] * lam[{c.place[j]}]" for j in range(nv))
        head.append(f"    g{i} = {weights}")
    head += [f"    g{i} = lam[{c.place[i]}]" for i in range(nv, c.nx)]

    def wanted(names: list[str], target: str) -> Outputs:
        found = ((target.format(i), slopes.get(g.sym(name))) for i, name in enumerate(names))
        return [(text, node) for text, node in found if node is not None]

    outputs = wanted(d.states, "gx[{}]") + wanted(list(c.index), "gp[{}] +") + wanted(d.actuators, "ga[{}]")
    return [
        FUSED,
        f"def {c.prefix}_vjp(x, act, exo, t, par, minv, lam, gx, gp, ga):",
        '    """Cotangents of one rate evaluation: gx and ga set where read, gp accumulated."""',
        *c.emit([(f"f{i}", node) for i, node in enumerate(c.force)], 4),
        *c.accelerations(4),
        *head,
        *c.emit(outputs, 4, prefix="v"),
    ]
