"""A step after the verdict: what fails there costs a sentence, never the verdict."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from numpy.linalg import LinAlgError

from bayesid.errors import BayesidError

Result = TypeVar("Result")


def attempt(failed: str, compute: Callable[[], Result], otherwise: Result, warnings: list[str]) -> Result:
    """What `compute` gives, or `otherwise` and a sentence in `warnings` where it fails.

    Parameters
    ----------
    failed : what could not be done, the beginning of the sentence
    """
    try:
        return compute()
    except (BayesidError, LinAlgError) as error:
        warnings.append(f"{failed}: {error}")
    except Exception as error:  # minutes of work and a verdict stand behind this step
        warnings.append(
            f"{failed}: unexpected {type(error).__name__}: {error} (a fault of bayesid, not of the data)"
        )
    return otherwise
