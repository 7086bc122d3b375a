"""Which force terms a set of runs excites, told from the logs alone: sparse regression on the force table.

Takes runs and a vehicle's mass properties. Gives inclusion frequencies, spreads and groups of columns that
cannot be told apart. A sparse regression, never a verdict.
"""

from bayesid.analysis.excitation.columns import EXTRA, LibraryColumn, library
from bayesid.analysis.excitation.motion import Motion, exact_motion
from bayesid.analysis.excitation.regression import Excitation, excite
from bayesid.analysis.excitation.row_selection import STATUSES, AxisFit, RowSelection

__all__ = [
    "EXTRA",
    "STATUSES",
    "AxisFit",
    "LibraryColumn",
    "Excitation",
    "Motion",
    "RowSelection",
    "excite",
    "exact_motion",
    "library",
]
