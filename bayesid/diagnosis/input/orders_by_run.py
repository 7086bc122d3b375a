"""Orders that some runs of a trial lack and others log, told once for all these runs, as an import tells it.

Takes a trial, and its vehicle where it is known: without one the inputs are told by their names alone.
Does not: judge an input that no run logs.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from bayesid.diagnosis.input.missing_orders import lost_orders, missing_orders
from bayesid.model.vehicles import Vehicle
from bayesid.trials import Run, Trial
from bayesid.words import and_list, counted, first_few

SHOWN = 4  # runs that are named


def orders_by_run(trial: Trial, vehicle: Vehicle | None = None) -> tuple[str, ...]:
    """One sentence for all runs that lack the same orders, and one per run whose orders begin late.

    Parameters
    ----------
    trial : as logged, held-out runs too
    vehicle : whose forces depend on the inputs; None where it is not known
    """
    lost = _by_name(trial) if vehicle is None else lost_orders(trial, vehicle)
    alike: dict[tuple[str, ...], list[str]] = {}
    for run, columns in lost.items():
        alike.setdefault(tuple(columns), []).append(run)
    late = {} if vehicle is None else missing_orders(trial, vehicle)
    return (
        *(_sentence(trial, columns, runs) for columns, runs in alike.items()),
        *(text for run, text in late.items() if run not in lost),
    )


def _read(run: Run) -> dict[str, str]:
    """Input -> the column it is read from, of those with a reading."""
    ordered = {n.removesuffix("_cmd"): n for n, v in run.commands.items() if np.isfinite(v).any()}
    return ordered | {n: n for n, v in run.measured_inputs.items() if np.isfinite(v).any()}


def _by_name(trial: Trial) -> dict[str, list[str]]:
    """Run -> columns it lacks while another run, that has all of its inputs, has them and they are not 0."""
    read = {run.name: _read(run) for run in trial.runs}
    moved = {
        name
        for run in trial.runs
        for name, column in read[run.name].items()
        if np.any(np.nan_to_num({**run.commands, **run.measured_inputs}[column]) != 0.0)
    }
    out: dict[str, list[str]] = {}
    for name, own in read.items():
        # a run that has inputs of its own instead may be steered by these: two rudders in place of one
        more = [its for its in read.values() if its.keys() > own.keys()]
        lost = dict.fromkeys(c for its in more for n, c in its.items() if n not in own and n in moved)
        if lost:
            out[name] = list(lost)
    return out


def _has(run: Run, columns: Collection[str]) -> bool:
    return any(column in columns for column in _read(run).values())


def _sentence(trial: Trial, columns: tuple[str, ...], runs: list[str]) -> str:
    others = [run.name for run in trial.runs if run.name not in runs and _has(run, columns)]
    who = and_list(others) if len(others) <= SHOWN else counted(len(others), "other run")
    one, single = len(runs) == 1, len(columns) == 1
    which = and_list(runs) if len(runs) <= SHOWN else first_few(runs, SHOWN)
    return (
        f"{'run' if one else 'runs'} {which} {'has' if one else 'have'} no {and_list(columns)}, which {who} "
        f"{'has' if len(others) == 1 else 'have'}: simulated, {'it' if single else 'these'} would be 0. Log "
        f"{'it' if single else 'them'} there too, also where constant, and import again, or leave "
        f"{'that run' if one else 'these runs'} out: delete "
        f"{'its [[runs]] table' if one else 'their [[runs]] tables'} in trial.toml"
    )
