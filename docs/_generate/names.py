"""Manoeuvres, and the public names of `import bayesid`. Computes nothing."""

from __future__ import annotations

import inspect

import bayesid
from _generate.markdown import code, plain, table
from bayesid.manoeuvres.catalogue import REGISTRY


def manoeuvres() -> str:
    """Every manoeuvre by name: how it is written, what it is, its options with their units."""
    rows = []
    for name, entry in REGISTRY.items():
        pattern = name + (":" + "/".join(w.upper() for w in entry.positional) if entry.positional else "")
        options = ", ".join(f"{code(key)} {kind}" for key, (kind, _) in entry.options.items())
        summary = plain(entry.summary) + (" (6-DOF vehicles only)" if entry.dof == 6 else "")
        rows.append([code(pattern), summary, options])
    return table(("write", "what it is", "options and their kind"), rows)


def public_names() -> str:
    """Directives that let autodoc tell of each public name."""
    out = []
    for name in bayesid.__all__:
        found = getattr(bayesid, name)
        if name == "__version__":
            continue
        what = "autoclass" if inspect.isclass(found) else "autofunction"
        members = "\n   :members:" * inspect.isclass(found)
        out.append(f"## {code(name)}\n\n```{{eval-rst}}\n.. {what}:: bayesid.{name}{members}\n```")
    return "\n\n".join(out)
