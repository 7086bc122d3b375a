"""What can go wrong in words a user can act on.

Takes: a place ("run07.csv", "vehicle.toml") and the problems found there.
Does not: print or exit; the command line turns these into one message and an exit code.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NoReturn


class BayesidError(Exception):
    """Base of every error a user may meet; the text says what, where, how much and the next move."""

    exit_code = 2


class TrialError(BayesidError):
    """A log or its description cannot be used as it is."""


class MistakenLogError(TrialError):
    """A log does not say what its header says: a sign, a unit, an axis or a clock is another."""

    exit_code = 4


class VehicleError(BayesidError):
    """A vehicle file is malformed, misspelt or physically impossible."""


class ManoeuvreError(BayesidError):
    """A manoeuvre cannot be carried out or measured as asked."""


class ModelError(BayesidError):
    """Vehicle, effects and channels do not fit together, or a simulated state left the finite numbers."""


class CacheError(BayesidError):
    """The folder of compiled kernels is open to other users."""


class FitError(BayesidError):
    """A fit was set up wrongly; a fit that merely fails to converge is a result, not an error."""


class SampleError(BayesidError):
    """A sampler was set up wrongly or cannot go on; one that merely has not converged is a result."""


def raise_all(cls: type[BayesidError], where: str, problems: Iterable[str]) -> NoReturn:
    """Raise one error that lists every problem of a place at once.

    Parameters
    ----------
    cls : subclass of BayesidError
    where : file or object the problems belong to
    problems : at least one sentence each

    Raises
    ------
    cls
        always; a single problem stays on one line
    """
    found = [str(problem) for problem in problems]
    if not found:
        raise ValueError("raise_all needs at least one problem")
    if len(found) == 1:
        raise cls(f"{where}: {found[0]}")
    raise cls("\n".join([f"{where}: {len(found)} problems", *(f"  - {problem}" for problem in found)]))
