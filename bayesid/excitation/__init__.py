"""Which force terms a set of runs excites, told from the logs alone: sparse regression on the force table.

Takes runs and a vehicle's mass properties. Gives inclusion frequencies, spreads and groups of columns that
cannot be told apart. A witness, never a verdict.
"""

from bayesid.excitation.columns import EXTRA, Column, library
from bayesid.excitation.motion import Motion, exact_motion
from bayesid.excitation.select import STATUSES, AxisFit, Witness
from bayesid.excitation.witness import Excitation, excite

__all__ = [
    "EXTRA",
    "STATUSES",
    "AxisFit",
    "Column",
    "Excitation",
    "Motion",
    "Witness",
    "excite",
    "exact_motion",
    "library",
]
