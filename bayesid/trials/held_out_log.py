"""Warnings that runs do not say what their header says, told once the held-out ones are read as well.

Takes the mistakes in words. Gives warnings, and finds them among others. A fit does not read held-out runs,
so that it stands where they alone are wrong; what is predicted for them is set against a log that is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

SAID = "The log of held-out runs does not say what its header says: "
FITTED = "Beside the held-out runs, the log of fitted runs does not say what its header says: "


def held_out_warning(told: Sequence[str]) -> str:
    """The warning of some mistakes."""
    return f"{SAID}{'; '.join(told)}. How well they are predicted means nothing until that is mended."


def fitted_warning(told: Sequence[str]) -> str:
    """The warning of mistakes that fitted runs have, or are a part of, which only the held-out ones tell."""
    return f"{FITTED}{'; '.join(told)}. What was found from these runs does not stand until that is mended."


def held_out_notes(warnings: Sequence[str]) -> list[str]:
    """The sentences of both among some warnings."""
    return [text for text in warnings if text.startswith((SAID, FITTED))]
