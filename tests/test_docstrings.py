"""What a docstring lists under Parameters or Attributes is there under that name."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1] / "bayesid"
MODULES = sorted(ROOT.rglob("*.py"))


def listed(doc):
    """Names under Parameters and Attributes: `a, b : what they are` at the left margin."""
    section, names = "", []
    lines = doc.split("\n")
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch(r"-+", below.strip()):
            section = line.strip()
        elif section in ("Parameters", "Attributes") and " : " in line and not line.startswith(" "):
            names += [name.strip().lstrip("*") for name in line.split(" : ")[0].split(",")]
    return names


def present(node):
    """Arguments of a function; fields, methods and attributes set in a class."""
    if isinstance(node, ast.FunctionDef):
        a = node.args
        some = [*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg]
        return {arg.arg for arg in some if arg is not None}
    names = set()
    for part in ast.walk(node):
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
            names.add(part.target.id)
        elif isinstance(part, ast.FunctionDef):
            names.add(part.name)
        elif isinstance(part, ast.arg):
            names.add(part.arg)
        elif isinstance(part, ast.Attribute):
            names.add(part.attr)
    return names


def test_documented_names_are_those_of_the_code():
    missing = []
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                some = set(listed(ast.get_docstring(node) or "")) - present(node)
                missing += [f"{path.relative_to(ROOT)}: {node.name} has no {name}" for name in sorted(some)]
    assert not missing
