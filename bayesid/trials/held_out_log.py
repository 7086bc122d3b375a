"""The warning that held-out runs of a trial do not say what their header says.

Takes the mistakes in words. Gives the warning, and finds it among others. A fit does not read these runs, so
that it stands; what is predicted for them is set against a log that is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

SAID = "The log of held-out runs does not say what its header says: "


def held_out_warning(told: Sequence[str]) -> str:
    """The warning of some mistakes."""
    return f"{SAID}{'; '.join(told)}. How well they are predicted means nothing until that is mended."


def held_out_note(warnings: Sequence[str]) -> str | None:
    """The sentence of `held_out_warning` among some warnings."""
    return next((text for text in warnings if text.startswith(SAID)), None)
