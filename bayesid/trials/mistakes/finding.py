"""What a check of the input found: a mistake, where, how sure, and the mend. Numbers and texts only."""

from __future__ import annotations

from dataclasses import dataclass

from bayesid.trials.correction import Correction


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

    @property
    def mend(self) -> tuple[str, ...]:
        """Lines of trial.toml."""
        return () if self.correction is None else ("[corrections]", *self.correction.lines())


@dataclass(frozen=True)
class InputCheck:
    """What was checked, found, and could not be checked.

    Attributes
    ----------
    findings : mistakes, the surest first
    in_order : checks that were made and passed, in words
    unseen : what could not be checked and why, in words
    remarks : what is stated of the log and its readings contradict, a sentence each; not a verdict
    """

    findings: tuple[InputFinding, ...] = ()
    in_order: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
