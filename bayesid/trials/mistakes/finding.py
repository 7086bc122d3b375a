"""What a check of the input found: a mistake, where, how sure, and the mend. Numbers and texts only."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bayesid.trials.correction import Correction

BY_VEHICLE = "vehicle's "  # begins what is told by the behaviour of the vehicle
SIMULATOR = "simulator: "  # begins a mistake of the simulator among those not told from one of the log


@dataclass(frozen=True)
class InputFinding:
    """One mistake in a log.

    Attributes
    ----------
    name : as in the table
    says : end of the sentence "in this log ..."
    channels : concerned
    runs : names of the runs concerned
    all_runs : whether these are all that are not silent on it
    probability : of the mistake against a right log and every other of the table
    told_by : relations that tell it: "track", "yaw", ..., or "vehicle"
    before, after : residual of the relation that tells most, over the size of what it explains
    correction : what mends it; None where there is no mend but to log it anew
    also : names of mistakes these runs cannot tell from it
    together : probability that it is this or one of `also`; 0 where there is none
    kinematic : log odds [nats] against a right log without what the vehicle says, the prior among them
    instead : mistakes of the simulator that explain it better than this one of the log
    """

    name: str
    says: str
    channels: tuple[str, ...]
    runs: tuple[str, ...]
    all_runs: bool
    probability: float
    told_by: tuple[str, ...]
    before: float
    after: float
    correction: Correction | None
    also: tuple[str, ...] = ()
    together: float = 0.0
    kinematic: float = math.inf
    instead: tuple[str, ...] = ()

    @property
    def mend(self) -> tuple[str, ...]:
        """Lines of trial.toml."""
        return () if self.correction is None else ("[corrections]", *self.correction.lines())

    @property
    def by_vehicle(self) -> bool:
        """Whether what the vehicle says is among what tells it."""
        return any(key.startswith(BY_VEHICLE) for key in self.told_by)


@dataclass(frozen=True)
class InputCheck:
    """What was checked, found, and could not be checked.

    Attributes
    ----------
    findings : mistakes, the surest first
    in_order : checks that were made and passed, in words
    unseen : what could not be checked and why, in words
    remarks : what is stated of the log and its readings contradict, a sentence each; not a verdict
    noisy : relations that leave too much unexplained to tell anything, in words
    left_open : mistakes that would explain the log as well as that it is right, a sentence each
    """

    findings: tuple[InputFinding, ...] = ()
    in_order: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    left_open: tuple[str, ...] = ()
    noisy: tuple[str, ...] = ()

    @property
    def of_log(self) -> InputCheck:
        """Without what a mistake of the simulator explains better."""
        return replace(self, findings=tuple(f for f in self.findings if not f.instead))

    @property
    def insisted(self) -> InputCheck:
        """The mistakes of the simulator taken back."""
        return replace(self, findings=tuple(replace(f, instead=()) for f in self.findings))
