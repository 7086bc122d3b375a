"""Mistakes of the log, before any cause of a gap is weighed.

Takes a trial and a model. Gives what is wrong with the input, the mend, and the trial mended; what a mistake
of the simulator would explain as well is said so.
Does not: weigh effects, or change a file.
"""

from bayesid.diagnosis.input.check import check_trial, mended
from bayesid.diagnosis.input.enough import not_enough, unmoved_inputs
from bayesid.diagnosis.input.missing_orders import missing_orders, without_missing
from bayesid.diagnosis.input.orders_by_run import orders_by_run
from bayesid.diagnosis.input.reading import MOST_SAMPLES, as_read, checked_and_mended, checked_and_read
from bayesid.diagnosis.input.wrong_vehicle import WRONG_VEHICLE

__all__ = [
    "MOST_SAMPLES",
    "WRONG_VEHICLE",
    "as_read",
    "check_trial",
    "checked_and_mended",
    "checked_and_read",
    "mended",
    "missing_orders",
    "not_enough",
    "orders_by_run",
    "unmoved_inputs",
    "without_missing",
]
