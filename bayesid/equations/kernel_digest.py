"""What tells two kernels apart: the equations (`equations_digest`) and the printed text (`cache_key`).

Takes a `KernelSpec`, rows of the term table and declarations of effects. The digest of the equations goes
into every stored result: it changes with an equation, not with wording, layout of a file or the printer. The
key names a printed module in the cache: it changes with anything the text or its compiled part depends on.
Reads no vehicle.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from bayesid.equations.derivatives import Graph, Node
from bayesid.equations.layout import Dynamics, KernelSpec, rows_of
from bayesid.equations.print_actuators import servo_formulas
from bayesid.model.effects import Effect

# wording and priors; a field that is new counts until it is named here
_NOT_EQUATIONS = frozenset(
    (
        "source",
        "magnitude",
        "about",
        "aliases",
        "unit",
        "sd",
        "scale",
        "mean",
        "low",
        "high",
        "as_form",
        "at_surface",
        "planar",
        "roll_from",
        "leeway",
        "dated",
        "shape",
    )
)
_COMMUTE = ("add", "mul")


def equation_data(value: Any) -> Any:
    """Rows, effects and specifications as plain JSON types, without wording and priors."""
    if is_dataclass(value) and not isinstance(value, type):
        kept = (f.name for f in fields(value) if f.name not in _NOT_EQUATIONS)
        return {name: equation_data(getattr(value, name)) for name in kept}
    if isinstance(value, Mapping):
        return {str(key): equation_data(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [equation_data(item) for item in value]
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"{type(value).__name__} has no place in an equation")


def equations_digest(dyn: Dynamics, effects: Iterable[Effect]) -> str:
    """Hash of the equations of a kernel with all its effects.

    Parameters
    ----------
    dyn : equations of the full model
    effects : declarations it was built with; those of more degrees of freedom are not in it

    Returns
    -------
    16 hexadecimal digits; the same for the same expressions, in whatever order the nodes were made
    """
    outputs = (dyn.wrench, dyn.rates, dyn.readings, dyn.initial)
    node = _hashes(dyn.graph, [n for group in outputs for n in group.values()])
    layout = (dyn.states, dyn.velocities, dyn.actuators, dyn.exogenous, dyn.parameters, dyn.channels)
    text = json.dumps(
        {
            "spec": {k: v for k, v in equation_data(dyn.spec).items() if k != "named" or v},
            "layout": layout,
            "outputs": [{name: node[n] for name, n in group.items()} for group in outputs],
            "delays": dyn.delays,
            "effects": equation_data([e for e in effects if e.acts_in(dyn.spec.dof)]),
            "servo": servo_formulas(),
        },
        sort_keys=True,
    )
    return _short(text)


def cache_key(spec: KernelSpec, effects: tuple[Effect, ...]) -> str:
    """Name of the text of one kernel: the data it is printed from, the printer, and what compiles it."""
    import llvmlite
    import numba

    from bayesid import __version__

    used = tuple(e for e in effects if e.acts_in(spec.dof))
    tools = [__version__, platform.python_implementation(), *platform.python_version_tuple()[:2]]
    tools += [numba.__version__, llvmlite.__version__]
    data = [equation_data(part) for part in (spec, rows_of(spec), used)]
    return _short(json.dumps([*data, printer_digest(), tools], sort_keys=True))


@lru_cache
def printer_digest(folder: Path = Path(__file__).parent) -> str:
    """Hash of the source of this package, which prints the kernels."""
    hashed = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        text = path.read_bytes()
        hashed.update(f"{path.name} {len(text)}\n".encode() + text)
    return hashed.hexdigest()


def _hashes(g: Graph, outputs: list[Node]) -> dict[Node, str]:
    """Hash of every expression from those of its operands; the order of sum and product does not count."""
    out: dict[Node, str] = {}
    for n in sorted(g.closure(outputs)):
        name, *parts = g.key(n)
        words = [repr(p) for p in parts] if name in ("const", "sym") else [out[p] for p in parts]
        out[n] = _short(" ".join([name, *(sorted(words) if name in _COMMUTE else words)]))
    return out


def _short(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
