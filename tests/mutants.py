"""Small changes of a module, one at a time, and whether the tests notice.

A mutant turns a comparison, drops a `not`, swaps and/or, plus/minus, times/divided by, min/max, or moves a
number. It is put into the imported package of a forked process, which then runs the tests: what still passes
survived. Command line: `python tests/mutants.py MODULE TEST...` prints the survivors.
"""

from __future__ import annotations

import ast
import copy
import importlib
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

TURNED = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or,
    ast.Or: ast.And, ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
LONGEST = 120  # seconds the tests may take on one mutant
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    """One change: where, what, and the module's source with it."""

    line: int
    change: str
    source: str


def mutants(source: str) -> Iterator[Mutant]:
    """Every mutant of a module; docstrings, annotations, imports and texts stay."""
    count = len(list(_places(ast.parse(source))))
    for k in range(count):
        tree = ast.parse(source)
        node, change, act = list(_places(tree))[k]
        act()
        yield Mutant(getattr(node, "lineno", 0), change, ast.unparse(ast.fix_missing_locations(tree)))


def _places(tree: ast.Module) -> Iterator[tuple[ast.AST, str, object]]:
    waiting: list[ast.AST] = [tree]
    while waiting:
        parent = waiting.pop()
        for name, value in ast.iter_fields(parent):
            if name in ("annotation", "returns", "decorator_list") or getattr(parent, "arg", "") == "strict":
                continue
            for at, node in enumerate(value if isinstance(value, list) else [value]):
                if isinstance(node, ast.AST):
                    yield from _of(parent, name, at if isinstance(value, list) else None, node)
                    waiting.append(node)


def _of(parent, field, at, node):
    def put(new):
        if at is None:
            setattr(parent, field, new)
        else:
            getattr(parent, field)[at] = new

    if type(node) in TURNED and field in ("op", "ops"):
        turned = TURNED[type(node)]
        yield parent, f"{type(node).__name__} -> {turned.__name__}", lambda: put(turned())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield node, "not dropped", lambda: put(node.operand)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node, "minus dropped", lambda: put(node.operand)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in NAMES:
        yield node, f"{node.id} -> {NAMES[node.id]}", lambda: setattr(node, "id", NAMES[node.id])
    elif isinstance(node, ast.Constant) and field != "slice":
        value = node.value
        if isinstance(value, bool):
            yield node, f"{value} -> {not value}", lambda: setattr(node, "value", not value)
        elif isinstance(value, int | float):
            moved = copy.copy(value) * 2 + 1
            yield node, f"{value} -> {moved}", lambda: setattr(node, "value", moved)


def survivors(module: str, tests: list[str], every: int = 1) -> tuple[list[Mutant], int]:
    """Mutants of a module that the tests do not notice, and how many were tried.

    Parameters
    ----------
    tests : files, run by pytest in a forked process each time
    every : try each `every`-th mutant only
    """
    target = importlib.import_module(module)
    # whatever imports from the module must be there before, and pytest once for all children
    import pytest  # noqa: F401

    import bayesid.diagnosis.run  # noqa: F401

    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"

    source = Path(str(target.__file__)).read_text(encoding="utf-8")
    tried = list(mutants(source))[::every]
    left = []
    for m in tried:
        if not _noticed(target, m, tests):
            left.append(m)
            print(f"not noticed: {module}:{m.line}: {m.change}", file=sys.stderr, flush=True)
    return left, len(tried)


def _noticed(target, mutant: Mutant, tests: list[str]) -> bool:
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) != 0
    code = 1
    signal.alarm(LONGEST)  # a loop that never ends is noticed
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        before = dict(vars(target))
        exec(compile(mutant.source, str(target.__file__), "exec"), vars(target))
        for name, module in list(sys.modules.items()):
            if name.startswith("bayesid") and module is not target:
                for key, value in list(vars(module).items()):
                    if key in before and value is before[key] and not key.startswith("__"):
                        setattr(module, key, vars(target)[key])
        import pytest

        code = int(pytest.main(["-x", "-q", "-m", "not slow", "-p", "no:cacheprovider", *tests]))
    finally:
        os._exit(code)


if __name__ == "__main__":
    every = int(os.environ.get("EVERY", "1"))
    found, total = survivors(sys.argv[1], sys.argv[2:], every)
    print(f"{total - len(found)} of {total} mutants noticed ({1 - len(found) / max(total, 1):.1%})")
