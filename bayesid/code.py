"""Fingerprint of the program that decides a number."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

# What makes tasks, judges, draws and tells.
APART = frozenset({"benchmark", "cli", "report", "__pycache__"})


@lru_cache(maxsize=1)
def loaded_code() -> str:
    """`code_digest` as it was when first asked for in this process."""
    return code_digest()


def code_digest() -> str:
    """Fingerprint of the modules that decide a verdict: everything but making, judging, drawing, telling."""
    root = Path(__file__).resolve().parent
    lines = []
    for path in sorted(root.rglob("*.py")):
        inside = path.relative_to(root)
        if inside.parts[0] not in APART and "__pycache__" not in inside.parts:
            lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {inside.as_posix()}")
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]
