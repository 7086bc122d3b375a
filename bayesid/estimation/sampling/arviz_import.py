"""ArviZ without what it announces of its own next version when it is first imported on a day.

Takes nothing. Does not: silence what ArviZ warns of in use.
"""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

ANNOUNCEMENT = r"\s*ArviZ is undergoing a major refactor"  # 0.23; both generations are supported here


@cache
def arviz() -> Any:
    """The module `arviz`, imported when it is first needed: it takes a second."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ANNOUNCEMENT, FutureWarning)
        import arviz as module
    return module
