"""Scalar expressions as a shared graph: parse, differentiate, print as straight-line source.

Takes the formulas of the term table and of the effects as Python expressions.
Does not know what a term, an effect or a vehicle is.

Equal sub-expressions are one node, so common factors are computed once without a separate pass, and derivatives
(forward for Jacobians, reverse for adjoints) reuse the nodes of the value.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping

from bayesid.errors import ModelError

Node = int

_UNARY = ("neg", "abs", "sgn", "sqrt", "rsqrt", "sin", "cos", "exp", "tanh", "log", "step")
_FUNCTIONS = {
    "abs": 1,
    "sgn": 1,
    "sqrt": 1,
    "sin": 1,
    "cos": 1,
    "exp": 1,
    "tanh": 1,
    "step": 1,
    "min": 2,
    "max": 2,
}


class Graph:
    """A growing set of interned expression nodes; children always have smaller numbers than their parents."""

    def __init__(self) -> None:
        self._nodes: list[tuple] = []
        self._index: dict[tuple, Node] = {}
        self._partials: dict[tuple[Node, Node], Node] = {}
        self._reads: dict[Node, frozenset[Node]] = {}
        self.zero = self.const(0.0)
        self.one = self.const(1.0)

    def _intern(self, key: tuple) -> Node:
        found = self._index.get(key)
        if found is None:
            found = len(self._nodes)
            self._nodes.append(key)
            self._index[key] = found
        return found

    # ---- construction -------------------------------------------------------------------------------------
    def const(self, value: float) -> Node:
        return self._intern(("const", float(value)))

    def sym(self, name: str) -> Node:
        return self._intern(("sym", name))

    def value(self, node: Node) -> float | None:
        """Number of a constant node, None for anything else."""
        key = self._nodes[node]
        return key[1] if key[0] == "const" else None

    def add(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va is not None and vb is not None:
            return self.const(va + vb)
        if va == 0.0:
            return b
        if vb == 0.0:
            return a
        if self._nodes[b][0] == "neg":
            return self.sub(a, self._nodes[b][1])
        if self._nodes[a][0] == "neg":
            return self.sub(b, self._nodes[a][1])
        return self._intern(("add", *sorted((a, b))))

    def sub(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va is not None and vb is not None:
            return self.const(va - vb)
        if vb == 0.0:
            return a
        if va == 0.0:
            return self.neg(b)
        if a == b:
            return self.zero
        if self._nodes[b][0] == "neg":
            return self.add(a, self._nodes[b][1])
        return self._intern(("sub", a, b))

    def neg(self, a: Node) -> Node:
        va = self.value(a)
        if va is not None:
            return self.const(-va if va != 0.0 else 0.0)
        if self._nodes[a][0] == "neg":
            return self._nodes[a][1]
        if self._nodes[a][0] == "sub":
            return self.sub(self._nodes[a][2], self._nodes[a][1])
        return self._intern(("neg", a))

    def mul(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va is not None and vb is not None:
            return self.const(va * vb)
        for v, other in ((va, b), (vb, a)):
            if v == 0.0:
                return self.zero
            if v == 1.0:
                return other
            if v == -1.0:
                return self.neg(other)
        if self._nodes[a][0] == "neg":
            return self.neg(self.mul(self._nodes[a][1], b))
        if self._nodes[b][0] == "neg":
            return self.neg(self.mul(a, self._nodes[b][1]))
        return self._intern(("mul", *sorted((a, b))))

    def div(self, a: Node, b: Node) -> Node:
        va, vb = self.value(a), self.value(b)
        if va == 0.0:
            return self.zero
        if vb is not None and vb != 0.0:
            return self.mul(a, self.const(1.0 / vb))
        return self._intern(("div", a, b))

    def power(self, a: Node, exponent: Node) -> Node:
        n = self.value(exponent)
        if n is not None and n == int(n) and 0 <= n <= 6:
            out = self.one
            for _ in range(int(n)):
                out = self.mul(out, a)
            return out
        return self._intern(("pow", a, exponent))

    def call(self, name: str, *args: Node) -> Node:
        if name in ("min", "max"):
            va, vb = self.value(args[0]), self.value(args[1])
            if va is not None and vb is not None:
                return self.const(min(va, vb) if name == "min" else max(va, vb))
            return self._intern((name, *args))
        (a,) = args
        va = self.value(a)
        if va is not None:
            return self.const(_NUMERIC[name](va))
        if name == "abs" and self._nodes[a][0] in ("abs", "sqrt"):
            return a
        if name == "abs" and self._nodes[a][0] == "neg":
            return self.call("abs", self._nodes[a][1])
        if name in ("sgn", "sin", "tanh") and self._nodes[a][0] == "neg":
            return self.neg(self.call(name, self._nodes[a][1]))
        if name == "cos" and self._nodes[a][0] == "neg":
            return self.call("cos", self._nodes[a][1])
        return self._intern((name, a))

    def total(self, nodes: Iterable[Node]) -> Node:
        out = self.zero
        for node in nodes:
            out = self.add(out, node)
        return out

    def parse(
        self, text: str, names: Mapping[str, Node], calls: Mapping[str, Callable[..., Node]] | None = None
    ) -> Node:
        """Node of a Python expression in the given names.

        `calls` adds functions whose arguments are string literals, such as `coef('Y_dr')`.
        Raises `ModelError` for syntax that is not arithmetic or for an unknown name.
        """
        try:
            tree = ast.parse(text, mode="eval").body
        except SyntaxError as exc:
            raise ModelError(f"expression {text!r}: {exc.msg}; write plain arithmetic") from None
        return self._build(tree, text, names, calls or {})

    def _build(
        self, node: ast.AST, text: str, names: Mapping[str, Node], calls: Mapping[str, Callable]
    ) -> Node:
        def rec(child: ast.AST) -> Node:
            return self._build(child, text, names, calls)

        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return self.const(node.value)
        if isinstance(node, ast.Name):
            if node.id not in names:
                raise ModelError(
                    f"expression {text!r}: unknown name {node.id!r}; known: {', '.join(sorted(names))}"
                )
            return names[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self.neg(rec(node.operand))
        if isinstance(node, ast.BinOp):
            a, b = rec(node.left), rec(node.right)
            table = {
                ast.Add: self.add,
                ast.Sub: self.sub,
                ast.Mult: self.mul,
                ast.Div: self.div,
                ast.Pow: self.power,
            }
            operation = table.get(type(node.op))
            if operation is not None:
                return operation(a, b)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            name = node.func.id
            if name in calls and all(isinstance(a, ast.Constant) for a in node.args):
                return calls[name](*[a.value for a in node.args])
            if _FUNCTIONS.get(name) == len(node.args):
                return self.call(name, *[rec(a) for a in node.args])
        raise ModelError(f"expression {text!r}: {ast.dump(node)[:60]} is not allowed; write plain arithmetic")

    # ---- questions ----------------------------------------------------------------------------------------
    def reads(self, node: Node) -> frozenset[Node]:
        """Symbol nodes an expression depends on."""
        cached = self._reads.get(node)
        if cached is None:
            key = self._nodes[node]
            if key[0] == "sym":
                cached = frozenset((node,))
            elif key[0] == "const":
                cached = frozenset()
            else:
                cached = self.reads(key[1])
                for child in key[2:]:
                    cached = cached | self.reads(child)
            self._reads[node] = cached
        return cached

    def substitute(self, node: Node, new: Mapping[Node, Node]) -> Node:
        """Expression with symbols replaced, simplified on the way."""
        memo: dict[Node, Node] = dict(new)

        def rec(n: Node) -> Node:
            if n in memo:
                return memo[n]
            key = self._nodes[n]
            if key[0] in ("const", "sym"):
                return n
            args = [rec(child) for child in key[1:]]
            memo[n] = self._apply(key[0], args)
            return memo[n]

        return rec(node)

    def _apply(self, name: str, args: list[Node]) -> Node:
        direct = {"add": self.add, "sub": self.sub, "mul": self.mul, "div": self.div, "pow": self.power}
        if name in direct:
            return direct[name](*args)
        if name == "neg":
            return self.neg(*args)
        return self.call(name, *args)

    # ---- derivatives --------------------------------------------------------------------------------------
    def _local(self, node: Node) -> list[tuple[Node, Node]]:
        """(child, d node / d child) of one node."""
        key = self._nodes[node]
        name, args = key[0], key[1:]
        if name in ("const", "sym", "sgn", "step"):
            return []
        if name == "add":
            return [(args[0], self.one), (args[1], self.one)]
        if name == "sub":
            return [(args[0], self.one), (args[1], self.const(-1.0))]
        if name == "neg":
            return [(args[0], self.const(-1.0))]
        if name == "mul":
            return [(args[0], args[1]), (args[1], args[0])]
        if name == "div":
            return [(args[0], self.div(self.one, args[1])), (args[1], self.neg(self.div(node, args[1])))]
        if name == "abs":
            return [(args[0], self.call("sgn", args[0]))]
        if name == "sqrt":
            return [(args[0], self.mul(self.const(0.5), self.call("rsqrt", args[0])))]
        if name == "rsqrt":
            return [(args[0], self.mul(self.const(-0.5), self.mul(node, self.mul(node, node))))]
        if name == "log":
            return [(args[0], self.div(self.one, args[0]))]
        if name == "sin":
            return [(args[0], self.call("cos", args[0]))]
        if name == "cos":
            return [(args[0], self.neg(self.call("sin", args[0])))]
        if name == "exp":
            return [(args[0], node)]
        if name == "tanh":
            return [(args[0], self.sub(self.one, self.mul(node, node)))]
        if name == "max":
            first = self.call("step", self.sub(args[0], args[1]))
            return [(args[0], first), (args[1], self.sub(self.one, first))]
        if name == "min":
            first = self.call("step", self.sub(args[1], args[0]))
            return [(args[0], first), (args[1], self.sub(self.one, first))]
        if name == "pow":
            slope = self.mul(args[1], self._intern(("pow", args[0], self.sub(args[1], self.one))))
            return [(args[0], slope), (args[1], self.mul(node, self.call("log", args[0])))]
        raise ModelError(f"no derivative for {name!r} in an expression; use a differentiable form")

    def diff(self, node: Node, symbol: Node) -> Node:
        """Partial derivative of an expression with respect to one symbol (forward accumulation, memoised)."""
        if node == symbol:
            return self.one
        if symbol not in self.reads(node):
            return self.zero
        found = self._partials.get((node, symbol))
        if found is None:
            found = self.zero
            for child, slope in self._local(node):
                if symbol in self.reads(child):
                    found = self.add(found, self.mul(slope, self.diff(child, symbol)))
            self._partials[node, symbol] = found
        return found

    def gradient(self, node: Node) -> dict[Node, Node]:
        """Derivatives of one expression with respect to all its symbols (reverse accumulation)."""
        need = sorted(self._closure([node]), reverse=True)
        bar: dict[Node, Node] = {node: self.one}
        out: dict[Node, Node] = {}
        for n in need:
            cotangent = bar.pop(n, None)
            if cotangent is None:
                continue
            if self._nodes[n][0] == "sym":
                out[n] = cotangent
            for child, slope in self._local(n):
                if self.reads(child):
                    bar[child] = self.add(bar.get(child, self.zero), self.mul(slope, cotangent))
        return out

    # ---- printing -----------------------------------------------------------------------------------------
    def _closure(self, roots: Iterable[Node]) -> set[Node]:
        seen: set[Node] = set()
        stack = list(roots)
        while stack:
            n = stack.pop()
            if n in seen:
                continue
            seen.add(n)
            if self._nodes[n][0] not in ("const", "sym"):
                stack.extend(self._nodes[n][1:])
        return seen

    def source(
        self, outputs: list[tuple[str, Node]], symbol: Callable[[str], str], prefix: str, lanes: bool
    ) -> list[str]:
        """Straight-line statements `target = expression` that compute all outputs.

        Nodes used more than once get a temporary named `prefix<number>`; `symbol` maps a symbol's name to source.
        With `lanes` the statements hold no library call that would stop the loop around them from vectorising.
        """
        need = self._closure(node for _, node in outputs)
        uses: dict[Node, int] = dict.fromkeys(need, 0)
        for n in need:
            if self._nodes[n][0] not in ("const", "sym"):
                for child in self._nodes[n][1:]:
                    uses[child] += 1
        for _, node in outputs:
            uses[node] += 1
        text: dict[Node, str] = {}
        lines: list[str] = []
        done_angles: set[Node] = set()
        for n in sorted(need):
            key = self._nodes[n]
            if key[0] == "const":
                text[n] = repr(key[1]) if key[1] >= 0 else f"({key[1]!r})"
                continue
            if key[0] == "sym":
                text[n] = symbol(key[1])
                continue
            if lanes and key[0] in ("sin", "cos"):
                angle = key[1]
                if angle not in done_angles:
                    done_angles.add(angle)
                    lines += _sincos_lines(f"{prefix}{angle}", text[angle])
                text[n] = f"{prefix}{angle}_{key[0]}"
                continue
            expression = _render(key, text)
            if uses[n] > 1 or len(expression) > 90:
                lines.append(f"{prefix}{n} = {expression}")
                text[n] = f"{prefix}{n}"
            else:
                text[n] = f"({expression})"
        for target, node in outputs:
            value = text[node]
            if value.startswith("(") and value.endswith(")") and _encloses(value):
                value = value[1:-1]
            lines.append(f"{target} = {value}")
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
        return f"1.0 / math.sqrt(max({a}, 1e-300))"
    if name == "log":
        return f"math.log(max({a}, 1e-300))"
    if name in ("min", "max"):
        return f"({a} if {a} {'<' if name == 'min' else '>'} {b} else {b})"
    if name == "abs":
        return f"abs({a})"
    return f"math.{name}({a})"


def _sincos_lines(stem: str, angle: str) -> list[str]:
    """Sine and cosine without a branch or a call (Cody-Waite reduction, minimax polynomials of the Cephes library)."""
    t = stem
    return [
        f"{t}_k = math.floor({angle} * 0.6366197723675814 + 0.5)",
        f"{t}_y = (({angle} - {t}_k * 1.57079625129699707031) - {t}_k * 7.54978941586159635335e-08)"
        f" - {t}_k * 5.39030285815811905290e-15",
        f"{t}_z = {t}_y * {t}_y",
        f"{t}_ps = {t}_y + {t}_y * {t}_z * (((((1.58962301576546568060e-10 * {t}_z - 2.50507477628578072866e-8) * {t}_z"
        f" + 2.75573136213857245213e-6) * {t}_z - 1.98412698295895385996e-4) * {t}_z + 8.33333333332211858878e-3) * {t}_z"
        f" - 1.66666666666666307295e-1)",
        f"{t}_pc = 1.0 - 0.5 * {t}_z + {t}_z * {t}_z * (((((-1.13585365213876817300e-11 * {t}_z + 2.08757008419747316778e-9)"
        f" * {t}_z - 2.75573141792967388112e-7) * {t}_z + 2.48015872888517045348e-5) * {t}_z"
        f" - 1.38888888888730564116e-3) * {t}_z + 4.16666666666665929218e-2)",
        f"{t}_h = {t}_k - 2.0 * math.floor(0.5 * {t}_k)",
        f"{t}_q = {t}_k - 4.0 * math.floor(0.25 * {t}_k)",
        f"{t}_s0 = {t}_pc if {t}_h > 0.5 else {t}_ps",
        f"{t}_c0 = {t}_ps if {t}_h > 0.5 else {t}_pc",
        f"{t}_sin = -{t}_s0 if {t}_q > 1.5 else {t}_s0",
        f"{t}_cos = -{t}_c0 if ({t}_q > 0.5 and {t}_q < 2.5) else {t}_c0",
    ]


_NUMERIC: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "sgn": lambda x: (x > 0) - (x < 0),
    "step": lambda x: float(x > 0),
    "sqrt": math.sqrt,
    "rsqrt": lambda x: 1.0 / math.sqrt(max(x, 1e-300)),
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "tanh": math.tanh,
    "log": lambda x: math.log(max(x, 1e-300)),
}
