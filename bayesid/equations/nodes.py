"""Scalar expressions as shared nodes: build, parse, ask what they read, replace symbols.

Takes formulas as Python expressions. Does not differentiate (`derivatives`) or print code (`printing`), and
does not know what a term, an effect or a vehicle is.

Equal sub-expressions are one node, so common factors are computed once without a separate pass.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Container, Iterable, Mapping

from bayesid.errors import ModelError

Node = int

_FUNCTIONS = {
    "abs": 1,
    "sgn": 1,
    "sqrt": 1,
    "sin": 1,
    "cos": 1,
    "exp": 1,
    "tanh": 1,
    "atan": 1,
    "step": 1,
    "min": 2,
    "max": 2,
}
_NUMERIC: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "sgn": lambda x: (x > 0) - (x < 0),
    "step": lambda x: float(x > 0),
    "sqrt": math.sqrt,
    "rsqrt": lambda x: 1.0 / math.sqrt(max(x, 1e-60)),
    "sin": math.sin,
    "cos": math.cos,
    "exp": math.exp,
    "tanh": math.tanh,
    "atan": math.atan,
    "log": lambda x: math.log(max(x, 1e-300)),
}


class Nodes:
    """A growing set of interned expression nodes; children always have smaller numbers than their parents."""

    def __init__(self) -> None:
        self._nodes: list[tuple] = []
        self._index: dict[tuple, Node] = {}
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
        if name in ("sgn", "sin", "tanh", "atan") and self._nodes[a][0] == "neg":
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

        `calls` adds functions whose arguments are string literals, such as `coef('Y_dr')`, or replaces one
        of the known functions, whose arguments are nodes.
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
                return calls[name](*[ast.literal_eval(a) for a in node.args])
            if name in calls and name in _FUNCTIONS:
                return calls[name](*[rec(a) for a in node.args])
            if _FUNCTIONS.get(name) == len(node.args):
                return self.call(name, *[rec(a) for a in node.args])
        raise ModelError(f"expression {text!r}: {ast.dump(node)[:60]} is not allowed; write plain arithmetic")

    def key(self, node: Node) -> tuple:
        """What a node is: ("const", value), ("sym", name) or (operation, children...)."""
        return self._nodes[node]

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

    def closure(self, roots: Iterable[Node], known: Container[Node] = ()) -> set[Node]:
        """Every node the roots are built from, themselves included; not what `known` nodes are built from."""
        seen: set[Node] = set()
        stack = list(roots)
        while stack:
            n = stack.pop()
            if n in seen:
                continue
            seen.add(n)
            if n not in known and self._nodes[n][0] not in ("const", "sym"):
                stack.extend(self._nodes[n][1:])
        return seen
