"""Logs with something in them that is no mistake to name: nobody can see it, the reader repairs it, or an
effect of the catalogue is that.

Takes the time to travel a length and the rate of the fin; gives rows to plant of which the check stays
silent, or remarks on. Imports no judgement, only the correction and the reader's repair of stamps.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.trials import Run
from bayesid.trials.assemble import unwrap
from bayesid.trials.correction import Correction
from bayesid.trials.equal_times import spread_equal_times
from studies.log_mistakes.plant import FAST_FIN, Change, Planted, measured, with_correction

# vehicle -> others of its kind, or size, whose file somebody might give for its log
OTHERS = {
    "remus100": ("delphin2", "lauv"),
    "generic_sub": ("nps_auv2", "suboff_full"),
    "nps_auv2": ("remus100", "lauv"),
}
STATED = (0.01, 0.1, 1 / 3, 0.5, 2.0, 3.0, 10.0, 100.0)  # noise as stated over noise of the log
COARSE_STAMP = 5  # samples that share a rounded stamp
LATE_STAMP = 0.9  # of a step, by which stamps of writing are late at most
LEFT_OUT = 0.2  # share of rows that are not there


def harmless(fin_rate: float = math.inf) -> tuple[Planted, ...]:
    """Rows that are no mistake of the log to name.

    Parameters
    ----------
    fin_rate : of the rudder [rad/s]; at most `FAST_FIN` is taken
    """
    silent = {"right": (), "kind": "effect"}
    rate = min(fin_rate, FAST_FIN)
    return (
        Planted("u, v late by a sample", _by_a_sample("u", "v"), needs=("u", "v"), **silent),  # type: ignore[arg-type]
        Planted("r late by a sample", _by_a_sample("r"), ("r late",), ("r", "psi")),
        Planted("psi late by a sample", _by_a_sample("psi"), ("psi late",), ("psi", "r")),
        Planted("x, y late by a sample", _by_a_sample("x", "y"), needs=("x", "y"), **silent),  # type: ignore[arg-type]
        Planted("rudder late by a sample", _by_a_sample("delta_r_cmd"), **silent),  # type: ignore[arg-type]
        Planted("heading wrapped", _wrapped, needs=("psi",), **silent),  # type: ignore[arg-type]
        Planted("measured angle as order", _angle_as_order(rate), **silent),  # type: ignore[arg-type]
        Planted(
            "over ground as through the water, no current",
            with_correction(Correction(rename={k: f"{k}_water" for k in "uvw"})),
            (),
            ("x", "y", "u", "v"),
            kind="note",
            says="with no current",
        ),
        Planted("a fifth of the rows left out", _left_out, **silent),  # type: ignore[arg-type]
        Planted("stamps rounded down", _rounded, **silent),  # type: ignore[arg-type]
        Planted("stamps of writing", _stamps_of_writing, (), kind="note", says="time between samples varies"),
        *(
            Planted(f"noise stated {_times(f)}", _same, (), kind="note", says="noise stated", noise=f)
            for f in STATED
        ),
    )


def unlisted_effects(vehicle: str) -> tuple[Planted, ...]:
    """A right log with the file of another vehicle."""
    return tuple(
        Planted(f"file of another vehicle ({k + 1})", _same, ("wrong vehicle",), of=other)
        for k, other in enumerate(OTHERS[vehicle])
    )


def _times(factor: float) -> str:
    return f"{factor:g} times" if factor > 1 else f"1/{1 / factor:g}"


def _same(run: Run, rng: np.random.Generator) -> Run:
    return run


def _by_a_sample(*names: str) -> Change:
    """Columns that hold the reading before."""

    def change(run: Run, rng: np.random.Generator) -> Run:
        def later(group: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
            return {k: np.concatenate((v[:1], v[:-1])) if k in names else v for k, v in group.items()}

        return replace(run, data=later(dict(run.data)), commands=later(dict(run.commands)))

    return change


def _wrapped(run: Run, rng: np.random.Generator) -> Run:
    """A heading from 0 to 360 degrees as the reader of a file gives it on."""
    return replace(run, data={**run.data, "psi": unwrap(np.mod(run.data["psi"], 2 * np.pi))})


def _angle_as_order(rate: float) -> Change:
    """The angle that follows its order at a rate [rad/s], in the column of the order."""

    def change(run: Run, rng: np.random.Generator) -> Run:
        moved = measured(rate)(run, rng)
        inputs = dict(moved.measured_inputs)
        return replace(
            moved,
            commands={**moved.commands, "delta_r_cmd": inputs.pop("delta_r")},
            measured_inputs=inputs,
        )

    return change


def _left_out(run: Run, rng: np.random.Generator) -> Run:
    """Rows of a log that lost some, with right stamps."""
    keep = rng.random(run.n_samples) >= LEFT_OUT
    keep[[0, -1]] = True
    return _rows(run, keep)


def _rows(run: Run, keep: np.ndarray) -> Run:
    groups: dict[str, Any] = {g: {k: v[keep] for k, v in getattr(run, g).items()} for g in run.GROUPS}
    return replace(run, t=run.t[keep], **groups)


def _rounded(run: Run, rng: np.random.Generator) -> Run:
    """Stamps of a few samples' resolution, spread as time_repair = "spread" does."""
    tick = COARSE_STAMP * float(np.median(np.diff(run.t)))
    return replace(run, t=spread_equal_times(tick * np.floor(run.t / tick + 1e-9)))


def _stamps_of_writing(run: Run, rng: np.random.Generator) -> Run:
    """Stamps that are late by chance, each by less than a step."""
    late = LATE_STAMP * float(np.median(np.diff(run.t))) * rng.random(run.n_samples)
    return replace(run, t=run.t + late)
