"""Standard measures of a manoeuvre, from the arrays of a simulated or logged run.

Takes: t, position, heading, rudder [SI, rad]; tolerates noise, NaN and uneven sampling. Returns frozen
results in which NaN comes with a reason. Does not: simulate or read files.
"""

from bayesid.measures.named import named_measures
from bayesid.measures.pullout import PullOut, pull_out
from bayesid.measures.turning import TurningCircle, turning_circle
from bayesid.measures.zigzag import Spiral, Zigzag, spiral, zigzag

__all__ = [
    "PullOut",
    "Spiral",
    "TurningCircle",
    "Zigzag",
    "named_measures",
    "pull_out",
    "spiral",
    "turning_circle",
    "zigzag",
]
