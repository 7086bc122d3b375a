"""Inputs of the vehicle that a run lacks, wholly or at its beginning for long, while it would be simulated.

Takes a trial and a vehicle. Gives sentences by run; empty where every run has what it is steered by.
Does not: judge an input that no run logs (`unmoved_inputs` tells it), or one that rests at 0 in all others,
as which it is simulated.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.input.enough import inputs_of
from bayesid.model.vehicles import Vehicle
from bayesid.model.vehicles.orders import has_rudder, spread, together
from bayesid.trials import Run, Trial
from bayesid.words import and_list, counted

# Of a run, from which on an input unknown at its beginning is no longer what a logger that starts a moment
# late leaves: held back from its first value, an order given at a third of a run turns the vehicle before it.
LONG = 0.1
SHOWN = 3  # runs that are named
DIGITS = 12  # of a time: a log may count seconds from 1970 on


def missing_orders(trial: Trial, vehicle: Vehicle) -> dict[str, str]:
    """Run -> what it lacks and what to do, of runs that cannot be simulated as they were sailed.

    Parameters
    ----------
    trial : as logged, held-out runs too
    vehicle : whose forces depend on the inputs

    Notes
    -----
    Without an order an actuator is simulated at rest, and before its first order with that one: a cause would
    be named for what the log does not hold.
    """
    read, lost = _columns_by_run(trial, vehicle), lost_orders(trial, vehicle)
    out = {}
    for run in trial.runs:
        if run.name in lost:
            out[run.name] = _whole(run, lost[run.name], read)
        elif late := _late(run, _there(read[run.name])):
            out[run.name] = _beginning(run, late)
    return out


def lost_orders(trial: Trial, vehicle: Vehicle) -> dict[str, list[str]]:
    """Run -> columns it has no reading of while it needs them, as other runs log them."""
    read = _columns_by_run(trial, vehicle)
    wanted = {run.name: _wanted(trial, vehicle, run, read) for run in trial.runs}
    lost = {run: [c for c in columns if c not in _there(read[run])] for run, columns in wanted.items()}
    return {run: columns for run, columns in lost.items() if columns}


def _columns_by_run(trial: Trial, vehicle: Vehicle) -> dict[str, dict[str, tuple[str, ...]]]:
    names = _asked(trial, vehicle)
    return {run.name: {n: _columns(trial, vehicle, run, n) for n in names} for run in trial.runs}


def _there(columns: Mapping[str, tuple[str, ...]]) -> dict[str, None]:
    return dict.fromkeys(column for its in columns.values() for column in its)


def without_missing(trial: Trial, vehicle: Vehicle) -> Trial:
    """The trial without the runs that lack an order."""
    lost = missing_orders(trial, vehicle)
    return replace(trial, runs=tuple(run for run in trial.runs if run.name not in lost)) if lost else trial


def _asked(trial: Trial, vehicle: Vehicle) -> list[str]:
    names = inputs_of(vehicle)
    if "delta_r" not in names and vehicle.propulsion.model == "mmg" and has_rudder(vehicle):
        names.append("delta_r")
    return [n for n in names if trial.dof == 6 or n not in ("delta_s", "delta_b")]


def _columns(trial: Trial, vehicle: Vehicle, run: Run, name: str) -> tuple[str, ...]:
    """The columns an input of a run is read from, several common orders where they add up, as of an X."""
    if name in run.measured_inputs:
        return (name,)
    if _known(run, f"{name}_cmd"):
        return (f"{name}_cmd",)
    commons = [f"{common}_cmd" for common, moved in together(vehicle).items() if name in moved]
    flat = ("delta_s_cmd", "delta_b_cmd") if trial.dof == 3 else ()
    return tuple(c for c in commons if c not in flat and _known(run, c))


def _known(run: Run, column: str) -> bool:
    return column in run.commands and bool(np.isfinite(run.commands[column]).any())


def _wanted(
    trial: Trial, vehicle: Vehicle, run: Run, read: dict[str, dict[str, tuple[str, ...]]]
) -> list[str]:
    """Columns a run needs since other runs log them: of an input it has no other of, the first one's; of one
    that obeys common orders, all of these."""
    out = []
    for name, own in read[run.name].items():
        others = [columns[name] for r, columns in read.items() if r != run.name and columns[name]]
        if not own and others and _moved(trial, vehicle, name):
            out += [others[0][0]]
        commons = {f"{common}_cmd" for common in together(vehicle)}
        if own and commons.issuperset(own):
            beside = dict.fromkeys(c for columns in others for c in columns if c in commons)
            out += [
                c for c in beside if any(np.any(np.nan_to_num(r.commands.get(c, 0.0))) for r in trial.runs)
            ]
    return list(dict.fromkeys(out))


def _moved(trial: Trial, vehicle: Vehicle, name: str) -> bool:
    """Whether an input is other than 0 in any run."""
    for run in trial.runs:
        commands = spread(vehicle, run.commands, run.measured_inputs)
        values = run.measured_inputs.get(name, commands.get(f"{name}_cmd"))
        if values is not None and bool(np.any(np.nan_to_num(values) != 0.0)):
            return True
    return False


def _late(run: Run, columns: Iterable[str]) -> dict[str, float]:
    """Column -> time of its first value [s], of those that have none for long."""
    out = {}
    for column in dict.fromkeys(columns):
        values = {**run.commands, **run.measured_inputs}[column]
        first = float(run.t[np.argmax(np.isfinite(values))])
        first = max(first, run.known_from.get(column, -math.inf))
        if first - run.t[0] > LONG * run.duration:
            out[column] = first
    return out


def _whole(run: Run, lost: list[str], read: dict[str, dict[str, tuple[str, ...]]]) -> str:
    runs = [r for r, of in read.items() if any(c in columns for columns in of.values() for c in lost)]
    others = and_list(runs) if len(runs) <= SHOWN else counted(len(runs), "other run")
    many, verb = len(lost) > 1, "logs" if len(runs) == 1 else "log"
    return (
        f"run {run.name} has no {and_list(lost)} (100 % missing), which {others} {verb}: "
        f"simulated, {'these' if many else 'it'} would be 0. Log {'them' if many else 'it'}, also where "
        f"constant, or leave the run out: delete the [[runs]] table of {run.name} in trial.toml"
    )


def _beginning(run: Run, late: dict[str, float]) -> str:
    begin = max(late.values())
    share = 100.0 * (begin - float(run.t[0])) / run.duration
    window = f"[{begin:.{DIGITS}g}, {float(run.t[-1]):.{DIGITS}g}]"
    measured = [c for c in late if c in run.measured_inputs and _known(run, f"{c}_cmd")]
    if len(measured) == len(late):
        left = json.dumps(measured)
        mend = f"The order is logged: leave the measurement out, drop = {left} in [corrections], or read"
    else:
        mend = "Log what was ordered before, or read"
    return (
        f"run {run.name} has no {and_list(list(late))} before t = {begin:.{DIGITS}g} s ({share:.0f} % of it):"
        f" simulated, the first value would be held from the beginning. {mend} the run from there: window = "
        f"{window} in the [[runs]] table of {run.name} in trial.toml"
    )
