"""Mistakes of the simulator that explain what only the behaviour of the vehicle tells of a log.

Takes a trial, a model and what was found in the log. Gives the findings with the mistakes of the simulator
that explain them better (`instead`) or as well (`also`): where the channels say nothing of one another, a
wrong sign of a plane may stand in the log or in the vehicle file. Does not name a mistake: a diagnosis does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.input.single_fins import SINGLE, single_fins
from bayesid.diagnosis.input.steering import RUDDER, steering
from bayesid.diagnosis.input.vehicle_behaviour import NEEDS, VehicleBehaviour, turn_after
from bayesid.diagnosis.input.wrong_vehicle import wrong_vehicle
from bayesid.diagnosis.simulator.mending import mended_model, numbers_of
from bayesid.diagnosis.simulator.table import MISTAKES
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.trials import Run, Trial
from bayesid.trials.mistakes import SIMULATOR, InputFinding
from bayesid.trials.mistakes.judge import ALSO
from bayesid.trials.mistakes.signs import SIGNS
from bayesid.trials.mistakes.table import USUAL

MOST_LISTED = 3  # mistakes not told from one another, that of the log among them
RUNS_COUNT_AS = 2.0  # independent observations, however many runs: they share one simulator's errors


def behaviour_of(model: Model, runs: Sequence[Run], seen: bool = False) -> VehicleBehaviour:
    """The behaviour of a vehicle, as evidence in so many runs; `seen` as there."""
    named, needs = steering(model), dict(NEEDS)
    if named != RUDDER:
        fins = {name for fin in named for name in (fin, f"{fin}_cmd")}
        needs |= {
            "turn": needs["turn"] | fins,
            "drift": needs["drift"] | fins,
            "steering": SIGNS["rudder"] | fins,
            "thrust": frozenset({"x", "y", "psi", "u", "u_water"}) | fins,
            **{turn_after(fin): SIGNS["rudder"] | {fin, f"{fin}_cmd"} for fin in named},
        }
    single = single_fins(model)
    if single:  # of no other channel: a simulator's turn and pitch are no measure of these
        needs[SINGLE] = frozenset(name for fin in single for name in (fin, f"{fin}_cmd"))
    return VehicleBehaviour(model, min(1.0, RUNS_COUNT_AS / len(runs)), seen, needs, named, single)


def mended_simulators(model: Model) -> Iterator[tuple[str, Model]]:
    """Name of a mistake, and the model with it mended at its middle size; none that leaves numbers free."""
    numbers = numbers_of(model)
    for mistake in MISTAKES:
        change = mistake.mend(numbers, mistake.sizes[len(mistake.sizes) // 2])
        if change is None or not change.within(model.index).values or change.sd:
            continue
        try:
            yield mistake.name, mended_model(model, change)
        except BayesidError:
            continue


def mistakes_that_clear(runs: Sequence[Run], model: Model) -> tuple[str, ...]:
    """Mistakes with whose mend the log is no longer another vehicle's."""
    out = []
    for name, mended in mended_simulators(model):
        try:
            if wrong_vehicle(mended, runs) is None:
                out.append(name)
        except BayesidError:
            continue
    return tuple(out)


def open_to_the_simulator(finding: InputFinding) -> bool:
    """Whether a mistake of the simulator can explain it as well.

    No behaviour is likelier than as expected, so that the channels alone must have left it open.
    """
    return finding.correction is not None and finding.by_vehicle and finding.kinematic <= USUAL + ALSO


def weighed_against_simulator(
    found: tuple[InputFinding, ...], rest: Trial, mended: Trial, model: Model
) -> tuple[InputFinding, ...]:
    """The findings, those told by the vehicle alone with what of the simulator explains them as well.

    Both sides are weighed by the whole behaviour of the vehicle, with equal priors of a mistake.

    Parameters
    ----------
    rest : the trial without the mends of those findings
    mended : with them
    """
    asked = [f for f in found if open_to_the_simulator(f)]
    if not asked:
        return found
    log = behaviour_of(model, mended.identify, seen=True)
    said = [log(run) for run in mended.identify]
    of_log = sum(f.kinematic for f in asked) + sum(sum(one.values()) for one in said)
    # what a run tells goes with the fins that move in it
    exchanged = any(f.correction is not None and f.correction.exchange for f in asked)
    lead: dict[str, float] = {}
    for name, simulator in mended_simulators(model):
        behaviour = behaviour_of(simulator, rest.identify, seen=True)
        total = USUAL + _told(behaviour, rest.identify, [set(one) for one in said], exchanged)
        if total > of_log - ALSO:
            lead[name] = total - of_log
    if not lead:
        return found
    top = max(lead.values())
    ranked = sorted(lead, key=lambda n: -lead[n])
    names = tuple(n for n in ranked[:MOST_LISTED] if lead[n] > top - ALSO)
    if top > ALSO:
        return tuple(replace(f, instead=names) if f in asked else f for f in found)
    return tuple(_beside(f, names, lead) if f in asked else f for f in found)


def _told(
    behaviour: VehicleBehaviour, runs: Sequence[Run], wanted: Sequence[set[str]], exchanged: bool
) -> float:
    """Log likelihood [nats] of what is told with the log mended; -inf where the simulator is lost.

    Parameters
    ----------
    exchanged : whether the mend exchanges fins: then of as much as is told so
    """
    total = 0.0
    for run, keys in zip(runs, wanted, strict=True):
        try:
            said = behaviour(run)
        except BayesidError:
            return -math.inf
        if exchanged and len(said) >= len(keys):
            keys = set(said)
        if not keys <= set(said):
            return -math.inf
        total += sum(said[k] for k in keys)
    return total


def _beside(finding: InputFinding, names: tuple[str, ...], lead: Mapping[str, float]) -> InputFinding:
    """A finding with mistakes of the simulator that are not told from it, and their common probability."""
    names = names[: max(1, MOST_LISTED - 1 - len(finding.also))]
    more = finding.probability * float(np.exp([lead[n] for n in names]).sum())
    return replace(
        finding,
        also=(*finding.also, *(SIMULATOR + n for n in names)),
        probability=finding.probability / (1.0 + more),
        together=((finding.together or finding.probability) + more) / (1.0 + more),
    )
