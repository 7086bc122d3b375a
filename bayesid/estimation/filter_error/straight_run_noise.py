"""The environment of straight runs, without what acts there and is not process noise.

Takes straight runs. Gives an `NoiseIdentification` and the names of what was set apart. Process noise is a
force
without memory beyond some lengths travelled, other in every run. Three things are not: a force that comes
back at the same time in every run (`common_forces`), one that keeps time over many periods
(`periodic_forces`), and one that lasts far longer than the vehicle's answer to it. Counted as process
noise each would hide the gap it makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayesid.equations.model import Model
from bayesid.estimation.filter_error.common_forces import slow, without_repeats
from bayesid.estimation.filter_error.evidence import posterior
from bayesid.estimation.filter_error.fit import stacked_equations
from bayesid.estimation.filter_error.linearise import Linearisation, forces
from bayesid.estimation.filter_error.noise_identification import (
    LONGEST_TAU,
    Equations,
    NoiseIdentification,
    identify_noise,
    linear_paths,
    settled_paths,
)
from bayesid.estimation.filter_error.noise_model import LatentInputs, NoiseModel
from bayesid.estimation.filter_error.periodic_disturbance import periodic_forces, stack_without
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import RunData

# Correlation time of a force that lasts, in L/U, and nats it must gain beside the environment: odds of 20.
LASTING_TAU, LEAST_EVIDENCE = 64.0, 3.0


@dataclass(frozen=True)
class RemovedForces:
    """What straight runs have that is not process noise.

    Attributes
    ----------
    repeated : axes whose force comes back at the same time in every run
    frequencies : of periodic forces [rad/s]
    lasting : forces that last; None where there are none
    """

    repeated: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()
    lasting: LatentInputs | None = None

    @property
    def any(self) -> bool:
        return bool(self.repeated or self.frequencies or self.lasting)

    @property
    def equations(self) -> Equations:
        """normal equations with periodic and lasting forces integrated out."""
        if not self.frequencies and self.lasting is None:
            return stacked_equations
        return partial(stack_without, frequencies=self.frequencies, latent=self.lasting)


def identify_straight_noise(
    model: Model, logs: Sequence[RunData], free: GaussianPrior
) -> tuple[NoiseIdentification, RemovedForces]:
    """Environment of straight runs and what was set apart.

    A disturbance that would be slower still if it might (`noise_identification.LONGEST_TAU`) is none: then
    forces that last are set apart even where the runs alone cannot tell.
    """
    found = identify_noise(model, logs, free)
    paths = settled_paths(model, logs, found.noise_model)
    apart = RemovedForces(frequencies=periodic_forces(model, paths.paths, paths.standard)[0])
    if apart.frequencies:
        found = identify_noise(model, logs, free, equations=apart.equations)
        paths = settled_paths(model, logs, found.noise_model)
    if not slow(model, found.noise_model):
        return found, apart
    common = without_repeats(model, linear_paths(model, logs, paths, free), free, found.noise_model)
    if common is not None:
        bare, axes = common
        again = identify_noise(model, bare, free, equations=apart.equations)
        # what one common force takes from each of n runs
        lost = np.where(axes, np.sqrt(len(logs) / (len(logs) - 1.0)), 1.0)
        force = tuple(float(f) for f in np.array(again.noise_model.force) * lost)
        repeated = tuple(n[-1] for n, a in zip(forces(model), axes, strict=True) if a)
        return replace(again, noise_model=replace(again.noise_model, force=force)), replace(
            apart, repeated=repeated
        )
    time = model.scales["L"] / model.scales["U"]
    more = replace(
        apart, lasting=LatentInputs(forces(model), (), found.noise_model.force, LASTING_TAU * time)
    )
    again = identify_noise(model, logs, free, equations=more.equations)
    settled = linear_paths(model, logs, settled_paths(model, logs, again.noise_model), free)
    gain = _evidence(more.equations, model, settled, free, again.noise_model) - max(
        _evidence(apart.equations, model, settled, free, c) for c in (found.noise_model, again.noise_model)
    )
    slowest = found.noise_model.force_tau > 0.99 * LONGEST_TAU * time
    return (again, more) if gain > LEAST_EVIDENCE or slowest else (found, apart)


def _evidence(
    equations: Equations,
    model: Model,
    paths: Sequence[Linearisation],
    free: GaussianPrior,
    noise_model: NoiseModel,
) -> float:
    parts = equations(model, paths, free, noise_model)
    return posterior(sum(parts[1:], parts[0])).log_evidence
