"""A log that does not say what its header says is not fitted: an error that tells the mistake and its mend.

Takes a trial and its vehicle. What the channels alone tell counts here, not what the vehicle does: its
coefficients are what a fit looks for. Held-out runs, which a fit does not read, get a warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayesid.diagnosis.attempt import attempt
from bayesid.diagnosis.run import Diagnosis
from bayesid.equations.model import build_model
from bayesid.errors import MistakenLogError
from bayesid.model.vehicles import Vehicle
from bayesid.report.input import finding_sentence, joint_mend
from bayesid.trials import Run, Trial
from bayesid.trials.handedness import handedness
from bayesid.trials.held_out_log import fitted_warning, held_out_warning
from bayesid.trials.mistakes import InputCheck, InputFinding, check_input


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


def with_log_checked(chosen: Trial, as_logged: Trial, ship: Vehicle) -> Trial:
    """The trial to fit with the warnings of `held_out_mistakes`; refused as by `refuse_mistaken_log`."""
    refuse_mistaken_log(as_logged, ship)
    return replace(chosen, warnings=(*chosen.warnings, *held_out_mistakes(as_logged, ship)))


def held_out_mistakes(trial: Trial, ship: Vehicle) -> tuple[str, ...]:
    """Warnings where runs contradict their header once the held-out ones are read as well: of held-out runs,
    and of fitted ones where only the held-out ones tell it.

    What fitted runs tell by themselves is not told again (`refuse_mistaken_log`).
    """
    if not trial.holdout or not trial.identify:
        return ()
    found = _checked(trial, (*trial.identify, *trial.holdout), ship).findings
    if not found:
        return ()
    known = {f.name for f in _checked(trial, trial.identify, ship).findings}
    alone = {f.name: f for f in _checked(trial, trial.holdout, ship).findings}
    fitted = {run.name for run in trial.identify}
    held: list[str] = []
    ours: list[str] = []
    for f in (f for f in found if f.name not in known):
        if not set(f.runs) & fitted:
            held.append(finding_sentence(_of_its_runs(f)))
        elif f.name in alone:
            told = finding_sentence(_of_its_runs(alone[f.name]))
            held.append(f"{told}; the fitted runs do not tell whether they have it too")
        else:
            ours.append(finding_sentence(_of_its_runs(f)))
    out = (held_out_warning(held),) if held else ()
    return (*out, fitted_warning(ours)) if ours else out


def with_held_out_checked(diagnosis: Diagnosis, trial: Trial, ship: Vehicle) -> Diagnosis:
    """A diagnosis, whose verdict stands, with the warnings of `held_out_mistakes`."""
    told: list[str] = []
    told += attempt(
        "whether held-out runs say what their header says could not be asked",
        lambda: held_out_mistakes(trial, ship),
        (),
        told,
    )
    if not told:
        return diagnosis
    result = replace(diagnosis.result, warnings=(*diagnosis.result.warnings, *told))
    return replace(diagnosis, result=result)


def _of_its_runs(f: InputFinding) -> InputFinding:
    """The finding of its runs alone: runs that are silent on it need not have it."""
    if f.correction is None or f.correction.names_runs:
        return replace(f, all_runs=False)
    return replace(f, all_runs=False, correction=replace(f.correction, runs=f.runs))


def _checked(trial: Trial, runs: Sequence[Run], ship: Vehicle) -> InputCheck:
    scales = build_model(ship, 3 if ship.planar_only else trial.dof).scales
    return check_input(runs, scales["L"] / scales["U"], None, ship.rates, handedness(trial.folder))


def mistaken_log(name: str, found: InputCheck, then: str) -> MistakenLogError:
    """The error that tells every mistake found in a trial with its mend, and what to do next."""
    told = [finding_sentence(finding) for finding in found.findings]
    every = joint_mend(found)
    told += [f"{every[0].upper()}{every[1:]}"] if every else []
    if any(finding.mend for finding in found.findings):
        told.append("A mend belongs into trial.toml, each entry of [corrections] on a line of its own")
    return MistakenLogError(f"{name}: the log does not say what its header says: {'. '.join(told)}. {then}")
