"""Derivatives of shared expressions: forward for Jacobians, reverse for adjoints.

Takes the nodes of `nodes`; derivatives are nodes of the same graph and reuse those of the value.
Does not print code (`printing`).
"""

from __future__ import annotations

from bayesid.equations.nodes import Node, Nodes
from bayesid.errors import ModelError

__all__ = ["Graph", "Node"]


class Graph(Nodes):
    """Nodes and their derivatives."""

    def __init__(self) -> None:
        super().__init__()
        self._partials: dict[tuple[Node, Node], Node] = {}

    def _local(self, node: Node) -> list[tuple[Node, Node]]:
        """(child, d node / d child) of one node.

        At a tie min() and max() take the slope of their first argument: a formula so chooses the slope at its
        off value (play of zero width has the slope of play, not of the signal it lets through).
        """
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
        if name == "atan":
            return [(args[0], self.div(self.one, self.add(self.one, self.mul(args[0], args[0]))))]
        if name == "max":
            second = self.call("step", self.sub(args[1], args[0]))
            return [(args[0], self.sub(self.one, second)), (args[1], second)]
        if name == "min":
            second = self.call("step", self.sub(args[0], args[1]))
            return [(args[0], self.sub(self.one, second)), (args[1], second)]
        if name == "pow":
            base = self.call("max", args[0], self.const(1e-300))  # finite at 0, whatever the exponent
            slope = self.mul(args[1], self.div(node, base))
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
        need = sorted(self.closure([node]), reverse=True)
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
