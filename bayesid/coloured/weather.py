"""The environment of straight runs, without what acts there and is not weather.

Takes straight runs. Gives an `Environment` and the names of what was set apart. Weather is a force without
memory beyond some lengths travelled, other in every run. Three things are not: a force that comes back at the
same time in every run (`repeats`), one that keeps time over many periods (`lines`), and one that lasts far
longer than the vehicle's answer to it. Counted as weather each would hide the gap it makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayesid.coloured.colours import Colours, Latent
from bayesid.coloured.evidence import posterior
from bayesid.coloured.fit import Free, stack
from bayesid.coloured.levels import SLOWEST, Environment, Grams, linear_paths, measure, settled_paths
from bayesid.coloured.lines import lines, stack_without
from bayesid.coloured.log import Log
from bayesid.coloured.path import Path, forces
from bayesid.coloured.repeats import slow, without_repeats
from bayesid.model import Model

# Correlation time of a force that lasts, in L/U, and nats it must gain beside the environment: odds of 20.
LASTING, GAIN = 64.0, 3.0


@dataclass(frozen=True)
class Apart:
    """What straight runs have that is not weather.

    Attributes
    ----------
    repeated : axes whose force comes back at the same time in every run
    frequencies : of periodic forces [rad/s]
    lasting : forces that last; None where there are none
    """

    repeated: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()
    lasting: Latent | None = None

    @property
    def any(self) -> bool:
        return bool(self.repeated or self.frequencies or self.lasting)

    @property
    def grams(self) -> Grams:
        """Gram matrices with periodic and lasting forces integrated out."""
        if not self.frequencies and self.lasting is None:
            return stack
        return partial(stack_without, frequencies=self.frequencies, latent=self.lasting)


def measure_straight(model: Model, logs: Sequence[Log], free: Free) -> tuple[Environment, Apart]:
    """Environment of straight runs and what was set apart.

    A disturbance that would be slower still if it might (`levels.SLOWEST`) is none: then forces that last are
    set apart even where the runs alone cannot tell.
    """
    found = measure(model, logs, free)
    paths = settled_paths(model, logs, found.colours)
    apart = Apart(frequencies=lines(model, paths.paths, paths.standard)[0])
    if apart.frequencies:
        found = measure(model, logs, free, grams=apart.grams)
        paths = settled_paths(model, logs, found.colours)
    if not slow(model, found.colours):
        return found, apart
    common = without_repeats(model, linear_paths(model, logs, paths, free), free, found.colours)
    if common is not None:
        bare, axes = common
        again = measure(model, bare, free, grams=apart.grams)
        # what one common force takes from each of n runs
        lost = np.where(axes, np.sqrt(len(logs) / (len(logs) - 1.0)), 1.0)
        force = tuple(float(f) for f in np.array(again.colours.force) * lost)
        repeated = tuple(n[-1] for n, a in zip(forces(model), axes, strict=True) if a)
        return replace(again, colours=replace(again.colours, force=force)), replace(apart, repeated=repeated)
    time = model.scales["L"] / model.scales["U"]
    more = replace(apart, lasting=Latent(forces(model), (), found.colours.force, LASTING * time))
    again = measure(model, logs, free, grams=more.grams)
    settled = linear_paths(model, logs, settled_paths(model, logs, again.colours), free)
    gain = _evidence(more.grams, model, settled, free, again.colours) - max(
        _evidence(apart.grams, model, settled, free, c) for c in (found.colours, again.colours)
    )
    slowest = found.colours.force_tau > 0.99 * SLOWEST * time
    return (again, more) if gain > GAIN or slowest else (found, apart)


def _evidence(grams: Grams, model: Model, paths: Sequence[Path], free: Free, colours: Colours) -> float:
    parts = grams(model, paths, free, colours)
    return posterior(sum(parts[1:], parts[0])).log_evidence
