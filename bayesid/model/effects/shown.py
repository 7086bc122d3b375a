"""A formula as it is shown: without factors 1 and terms 0, which fill in what an actuator leaves open.

Takes and gives text in the symbols of `declare`. Does not: reorder or expand; what has nothing to drop stays
as it was written.
"""

from __future__ import annotations

import ast
import re


def shown(formula: str) -> str:
    """The formula without factors 1 and terms 0; "0" where nothing is left of it."""
    try:
        tree = ast.parse(formula, mode="eval")
    except SyntaxError:
        return formula
    short = _Short()
    left = short.visit(tree)
    if not short.dropped:
        return formula
    return re.sub(r" (\*\*|\*|/) ", r"\1", ast.unparse(left)).replace(" + -", " - ")


class _Short(ast.NodeTransformer):
    """Drops factors 1 and terms 0, from the inside out."""

    def __init__(self) -> None:
        self.dropped = 0

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        left, right = node.left, node.right
        found: ast.expr | None = None
        if isinstance(node.op, ast.Mult):
            if _is(left, 0) or _is(right, 0):
                found = ast.Constant(0)
            else:
                found = right if _is(left, 1) else left if _is(right, 1) else None
        elif isinstance(node.op, ast.Add):
            found = right if _is(left, 0) else left if _is(right, 0) else None
        elif isinstance(node.op, ast.Sub):
            found = left if _is(right, 0) else ast.UnaryOp(ast.USub(), right) if _is(left, 0) else None
        self.dropped += found is not None
        return node if found is None else found

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        self.generic_visit(node)
        return node.operand if _is(node.operand, 0) else node


def _is(node: ast.expr, value: int) -> bool:
    return isinstance(node, ast.Constant) and node.value == value
