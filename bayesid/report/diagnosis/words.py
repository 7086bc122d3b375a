"""Words and units of a diagnosis that several of its sections share.

Takes plain values. Gives text.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.result import Value

IN_DEGREES = {"rad": ("deg", 180 / math.pi), "rad/s": ("deg/s", 180 / math.pi)}


def in_words(name: str) -> str:
    """Name of an effect, or of a coefficient that may be wrong (`coefficient_error:N_r`), as prose has it."""
    kind, _, coefficient = name.partition(":")
    return kind.replace("_", " ") + (f" of {coefficient}" if coefficient else "")


def value_words(name: str, p: Value) -> str:
    unit, scale = IN_DEGREES.get(p.unit, (p.unit, 1.0))
    text = f"{in_words(name)} {p.value * scale:.4g} ± {p.sd * scale:.2g}"
    return text if unit == "-" else f"{text} {unit}"


def arrival_words(converged: bool) -> str:
    return "converged" if converged else "stopped"
