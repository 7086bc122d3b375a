"""Print shared expressions as straight-line source: one statement per node that is used more than once.

Takes nodes of a graph and the source text of every symbol. Does not choose what is computed.
"""

from __future__ import annotations

from collections.abc import Mapping

from bayesid.equations.nodes import Node, Nodes

LONG = 90


def statements(
    graph: Nodes,
    outputs: list[tuple[str, Node]],
    symbols: Mapping[str, str],
    prefix: str = "t",
    lanes: bool = False,
    known: dict[Node, str] | None = None,
) -> list[str]:
    """Statements `target = expression` that compute all outputs, in order.

    Parameters
    ----------
    outputs : (target, node); a target ending in "+" is added to
    symbols : source text of every symbol by name
    prefix : temporaries are named `prefix<number>`
    lanes : print no library call that would stop the loop around the statements from vectorising
    known : temporaries of earlier statements in scope, not computed again; those made here are added
    """
    known = {} if known is None else known
    need = sorted(graph.closure((node for _, node in outputs), known))
    uses = dict.fromkeys(need, 0)
    for n in need:
        if n not in known and graph.key(n)[0] not in ("const", "sym"):
            for child in graph.key(n)[1:]:
                uses[child] += 1
    for _, node in outputs:
        uses[node] += 1
    text: dict[Node, str] = {}
    lines: list[str] = []
    done_angles: set[Node] = set()
    for n in need:
        key = graph.key(n)
        if n in known:
            text[n] = known[n]
        elif key[0] == "const":
            text[n] = repr(key[1]) if key[1] >= 0 else f"({key[1]!r})"
        elif key[0] == "sym":
            text[n] = symbols[key[1]]
        elif lanes and key[0] in ("sin", "cos"):
            angle = key[1]
            if angle not in done_angles:
                done_angles.add(angle)
                lines += _sincos_lines(f"{prefix}{angle}", text[angle])
            text[n] = known[n] = f"{prefix}{angle}_{key[0]}"
        else:
            expression = _render(key, text)
            if uses[n] > 1 or len(expression) > LONG:
                lines.append(f"{prefix}{n} = {expression}")
                text[n] = known[n] = f"{prefix}{n}"
            else:
                text[n] = f"({expression})"
    for target, node in outputs:
        value = text[node]
        if value.startswith("(") and value.endswith(")") and _encloses(value):
            value = value[1:-1]
        lines.append(f"{target}= {value}" if target.endswith("+") else f"{target} = {value}")
    return lines


def _encloses(text: str) -> bool:
    depth = 0
    for i, ch in enumerate(text):
        depth += ch == "("
        depth -= ch == ")"
        if depth == 0 and i < len(text) - 1:
            return False
    return True


def _render(key: tuple, text: Mapping[Node, str]) -> str:
    name, a = key[0], text[key[1]]
    b = text[key[2]] if len(key) > 2 else ""
    if name in ("add", "sub", "mul", "div"):
        return f"{a} {dict(add='+', sub='-', mul='*', div='/')[name]} {b}"
    if name == "neg":
        return f"-{a}"
    if name == "pow":
        return f"max({a}, 0.0) ** {b}"
    if name == "sgn":
        return f"(1.0 if {a} > 0.0 else 0.0) - (1.0 if {a} < 0.0 else 0.0)"
    if name == "step":
        return f"1.0 if {a} > 0.0 else 0.0"
    if name == "rsqrt":
        # its slope is its cube, which must stay a number where there is no cross-flow at all
        return f"1.0 / math.sqrt(max({a}, 1e-60))"
    if name == "log":
        return f"math.log(max({a}, 1e-300))"
    if name in ("min", "max"):
        return f"({a} if {a} {'<' if name == 'min' else '>'} {b} else {b})"
    if name == "abs":
        return f"abs({a})"
    return f"math.{name}({a})"


_SIN = (
    *(1.58962301576546568060e-10, -2.50507477628578072866e-8, 2.75573136213857245213e-6),
    *(-1.98412698295895385996e-4, 8.33333333332211858878e-3, -1.66666666666666307295e-1),
)
_COS = (
    *(-1.13585365213876817300e-11, 2.08757008419747316778e-9, -2.75573141792967388112e-7),
    *(2.48015872888517045348e-5, -1.38888888888730564116e-3, 4.16666666666665929218e-2),
)


def _horner(coefficients: tuple[float, ...], z: str) -> str:
    text = repr(coefficients[0])
    for value in coefficients[1:]:
        text = f"({text}) * {z} + {value!r}"
    return text


def _sincos_lines(stem: str, angle: str) -> list[str]:
    """Sine and cosine without a branch or a call (Cody-Waite reduction, minimax polynomials of the Cephes
    library)."""
    t = stem
    return [
        f"{t}_k = math.floor({angle} * 0.6366197723675814 + 0.5)",
        f"{t}_y = (({angle} - {t}_k * 1.57079625129699707031) - {t}_k * 7.54978941586159635335e-08)"
        f" - {t}_k * 5.39030285815811905290e-15",
        f"{t}_z = {t}_y * {t}_y",
        f"{t}_ps = {t}_y + {t}_y * {t}_z * ({_horner(_SIN, f'{t}_z')})",
        f"{t}_pc = 1.0 - 0.5 * {t}_z + {t}_z * {t}_z * ({_horner(_COS, f'{t}_z')})",
        f"{t}_h = {t}_k - 2.0 * math.floor(0.5 * {t}_k)",
        f"{t}_q = {t}_k - 4.0 * math.floor(0.25 * {t}_k)",
        f"{t}_s0 = {t}_pc if {t}_h > 0.5 else {t}_ps",
        f"{t}_c0 = {t}_ps if {t}_h > 0.5 else {t}_pc",
        f"{t}_sin = -{t}_s0 if {t}_q > 1.5 else {t}_s0",
        f"{t}_cos = -{t}_c0 if ({t}_q > 0.5 and {t}_q < 2.5) else {t}_c0",
    ]
