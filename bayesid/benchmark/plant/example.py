"""The built-in example: one campaign of the plant with a gap in it, kept in the package as a trial bundle.

Gives the `Campaign` behind `load_trial("example")`, and with `truth` its answer; a test compares the two.
Run as `python -m bayesid.benchmark.plant.example FOLDER` it writes the bundle anew. Whoever wants to be
surprised diagnoses first and reads on here later.
"""

from __future__ import annotations

import sys

from bayesid.benchmark.plant.bundles import write_bundle
from bayesid.benchmark.plant.campaign import Campaign
from bayesid.benchmark.plant.draw import draw_campaign

NAME, SEED = "example", 2101


def example_campaign() -> Campaign:
    """A small AUV in a calm sea with a full sensor suite; coefficients known to 10 %."""
    return draw_campaign(
        SEED,
        kind="effect",
        effects=("rudder_asymmetry",),
        vehicle="remus100",
        dof=3,
        sensors="full",
        sea="calm",
        sizes=(0.5, 1.0),
        rich=True,
    )


if __name__ == "__main__":
    write_bundle(example_campaign(), sys.argv[1], name=NAME)
