"""Words and units of a diagnosis that several of its sections share.

Takes plain values. Gives text.
"""

from __future__ import annotations

import math

from bayesid.diagnosis.plain_words import in_words

__all__ = ["IN_DEGREES", "arrival_words", "in_words"]

IN_DEGREES = {"rad": ("deg", 180 / math.pi), "rad/s": ("deg/s", 180 / math.pi)}


def arrival_words(converged: bool) -> str:
    return "converged" if converged else "stopped"
