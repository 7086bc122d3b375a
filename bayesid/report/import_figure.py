"""Pictures of the runs a map cuts out of a log, proposed or imported: track and commands of each.

Takes a `Proposal` or a `Trial`; writes PNG files. Does not: choose runs.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bayesid.report.shown_orders import shown_orders
from bayesid.trials.importing import Proposal
from bayesid.trials.trial import Run, Trial

ROWS = 8  # runs per picture
MOST = 40  # runs drawn; a list longer than this is looked through in the map


def draw_runs(proposal: Proposal, folder: Path) -> list[Path]:
    """One row per run of a proposal: its track on that of the log, and its orders with the heading."""
    shaft = bool({"n", "n_cmd"} & set(proposal.map.channels))
    rows = []
    for run in proposal.map.runs:
        look = proposal.looks.get(run.files)
        if look is not None:
            zero = float(look.t[0])
            low, high = run.window or (0.0, np.inf)
            own = (look.t - zero >= low) & (look.t - zero <= high)
            rows.append(_Row(_title(run), look if shaft else _without_shaft(look), own))
    return _draw(rows, proposal.map.rudder_positive, folder)


def draw_imported(trial: Trial, folder: Path) -> list[Path]:
    """The same of a bundle, in place of the pictures of an import before it."""
    rows = [_Row(_title(run), run, np.ones(run.t.size, bool)) for run in trial.runs]
    paths = _draw(rows, "port", folder)
    for old in {folder / "runs.png", *folder.glob("runs_[0-9].png")} - set(paths):
        old.unlink(missing_ok=True)
    return paths


class _Row(NamedTuple):
    """A run to draw: what is over it, its log, and which of its samples are its own."""

    title: str
    look: Run
    own: np.ndarray


def _title(run: Any) -> str:
    what = f": {run.manoeuvre}" if run.manoeuvre else ""
    return f"{run.name}{what} ({run.role})"


def _draw(rows: list[_Row], side: str, folder: Path) -> list[Path]:
    from matplotlib.figure import Figure

    rows = rows[:MOST]
    paths: list[Path] = []
    for first in range(0, len(rows), ROWS):
        part = rows[first : first + ROWS]
        figure = Figure(figsize=(9, 2.3 * len(part)), layout="constrained")
        axes = figure.subplots(len(part), 2, squeeze=False, width_ratios=(1, 2))
        for (track, command), (title, look, own) in zip(axes, part, strict=True):
            t = look.t - look.t[0]
            if {"x", "y"} <= set(look.data):
                track.plot(look.data["y"], look.data["x"], color="0.8", lw=0.8)
                track.plot(look.data["y"][own], look.data["x"][own], color="C0", lw=1.5)
                track.set_aspect("equal", "datalim")
                track.set_xlabel("east [m]")
                track.set_ylabel("north [m]")
            _draw_orders(command, look, own, side)
            if "psi" in look.data and own.any():
                psi = np.degrees(look.data["psi"][own])
                command.plot(t[own], psi - psi[0], color="C0", lw=1.0, label="heading - first [deg]")
            command.set_title(title, fontsize=9)
            command.set_xlabel("t [s]")
            if command.lines:
                command.legend(fontsize=7, loc="upper right")
        path = folder / (f"runs_{len(paths) + 1}.png" if len(rows) > ROWS else "runs.png")
        figure.savefig(path, dpi=90)
        paths.append(path)
    return paths


def _draw_orders(axes: Any, look: Run, own: np.ndarray, side: str) -> None:
    """Angles on the axes of the heading; where none moves, speeds of shafts and thrusters on a second one.

    Parameters
    ----------
    side : to which a positive rudder of the log, as it is drawn, turns
    """
    measured = {f"{name}_cmd": values for name, values in look.measured_inputs.items()}
    orders = [o for o in shown_orders({**measured, **look.commands}) if o.moves]
    angles = [o for o in orders if o.unit == "deg"]
    if not angles and orders:
        axes = axes.twinx()
    for i, order in enumerate(angles or orders):
        label = f"{order.label.replace(' order', '').replace('port +', f'{side} +')} [{order.unit}]"
        axes.plot(look.t[own] - look.t[0], order.values[own], color=f"C{i + 1}", lw=1.0, label=label)
    if not angles and orders:
        axes.legend(fontsize=7, loc="lower right")


def _without_shaft(look: Run) -> Run:
    """A run whose `n` is no shaft, but the mean of thrusters that have curves of their own."""
    commands, measured = (
        {name: values for name, values in group.items() if name not in ("n", "n_cmd")}
        for group in (look.commands, look.measured_inputs)
    )
    return replace(look, commands=commands, measured_inputs=measured)
