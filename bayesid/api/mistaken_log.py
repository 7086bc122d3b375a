"""A log that does not say what its header says is not fitted: an error that tells the mistake and its mend.

Takes a trial and its vehicle. What the channels alone tell counts here, not what the vehicle does: its
coefficients are what a fit looks for. Held-out runs, which a fit does not read, get a warning.
"""

from __future__ import annotations

from collections.abc import Sequence

from bayesid.equations.model import build_model
from bayesid.errors import MistakenLogError
from bayesid.model.vehicles import Vehicle
from bayesid.report.input import finding_sentence, joint_mend
from bayesid.trials import Run, Trial
from bayesid.trials.handedness import handedness
from bayesid.trials.held_out_log import held_out_warning
from bayesid.trials.mistakes import InputCheck, check_input


def refuse_mistaken_log(trial: Trial, ship: Vehicle) -> None:
    """Refuse a trial whose fitted runs contradict their header.

    Parameters
    ----------
    trial : as logged, with the roles of its runs

    Raises
    ------
    MistakenLogError
        a mistake of signs, units, axes or clocks, each with the line of trial.toml that mends it
    """
    found = _checked(trial, trial.identify, ship)
    if found.findings:
        raise mistaken_log(
            trial.name, found, "Nothing is fitted; --trust-input (`trust_input`) takes the log as it is"
        )


def held_out_mistakes(trial: Trial, ship: Vehicle) -> tuple[str, ...]:
    """A warning where held-out runs, beside fitted ones that are right, contradict their header."""
    if not trial.holdout or not trial.identify:
        return ()
    found = _checked(trial, (*trial.identify, *trial.holdout), ship)
    fitted = {run.name for run in trial.identify}
    # a mistake in fitted runs alone would have been told of them
    told = [finding_sentence(f) for f in found.findings if not set(f.runs) <= fitted]
    return (held_out_warning(told),) if told else ()


def _checked(trial: Trial, runs: Sequence[Run], ship: Vehicle) -> InputCheck:
    scales = build_model(ship, 3 if ship.planar_only else trial.dof).scales
    return check_input(runs, scales["L"] / scales["U"], None, ship.rates, handedness(trial.folder))


def mistaken_log(name: str, found: InputCheck, then: str) -> MistakenLogError:
    """The error that tells every mistake found in a trial with its mend, and what to do next."""
    told = [finding_sentence(finding) for finding in found.findings]
    every = joint_mend(found)
    told += [f"{every[0].upper()}{every[1:]}"] if every else []
    return MistakenLogError(
        f"{name}: the log does not say what its header says: {'. '.join(told)}. A mend "
        f"belongs into trial.toml, each entry of [corrections] on a line of its own. {then}"
    )
