"""`bayesid.simulate`: run manoeuvres with a vehicle and log them, with noise and with effects switched
on."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from bayesid.api.inputs import VehicleLike, change_notes, ordered, parameter_values, scale_of, vehicle_of
from bayesid.equations.model import Model, build_model
from bayesid.errors import ManoeuvreError
from bayesid.manoeuvres.registry import degrees_of_freedom
from bayesid.model.vehicles import Vehicle
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import Trial
from bayesid.words import did_you_mean


def simulate(
    vehicle: VehicleLike,
    *manoeuvres: str,
    dof: int | None = None,
    dt: float | None = None,
    rpm: float | None = None,
    change: Mapping[str, float | str] | None = None,
    noise: Mapping[str, float] | None = None,
    seed: int = 0,
    holdout: Iterable[str] = (),
) -> Trial:
    """Run manoeuvres from a straight run and log every channel over ground.

    Parameters
    ----------
    vehicle : built-in name, vehicle file or `Vehicle`
    manoeuvres : texts such as "zigzag:10/10", "turn:20,side=starboard", "prbs:seed=3", "table:commands.csv"
    dof : 3 (horizontal plane) or 6; by default 6 where a manoeuvre leaves that plane
    dt : step of commands and log [s]; by default the manoeuvre's own. A table's commands are held between
        its rows, which stay in the log
    rpm : shaft speed; by default the vehicle's usual one
    change : coefficient (units of the vehicle file) or effect parameter (SI, or text with a unit) -> value
    noise : channel -> one sigma of white noise [SI]
    seed : of the noise
    holdout : manoeuvres that are kept for judging, as they are given, or names of their runs

    Returns
    -------
    Trial                      SI, rudder port-positive, one run per manoeuvre

    Raises
    ------
    VehicleError, ManoeuvreError, ModelError
        what cannot be read or executed
    """
    ship = vehicle_of(vehicle)
    model = build_model(ship, dof or needed_dof(ship, manoeuvres))
    return simulate_model(model, vehicle, manoeuvres, dt, rpm, change, noise, seed, holdout)


def needed_dof(vehicle: Vehicle, manoeuvres: Iterable[str]) -> int:
    """6 where a manoeuvre leaves the horizontal plane and the vehicle can, else 3."""
    return 3 if vehicle.planar_only else degrees_of_freedom(manoeuvres)


def simulate_model(
    model: Model,
    vehicle: VehicleLike,
    manoeuvres: tuple[str, ...],
    dt: float | None,
    rpm: float | None,
    change: Mapping[str, float | str] | None,
    noise: Mapping[str, float] | None,
    seed: int,
    holdout: Iterable[str] = (),
) -> Trial:
    """`simulate` with a model that is built already."""
    par = model.with_values(parameter_values(model, change), units="file")
    for note in change_notes(model, change):
        warnings.warn(note, UserWarning, stacklevel=3)
    scale = scale_of(model, rpm, dt)
    parsed = ordered(model, manoeuvres, scale, dt)
    orders = {_run_name(text, k): parsed[text] for k, text in enumerate(manoeuvres, 1)}
    texts = dict(zip(orders, map(_words, manoeuvres), strict=True))
    named = model.vehicle.name if not isinstance(vehicle, str | os.PathLike) else os.fspath(vehicle)
    return virtual_trial(
        model,
        par,
        orders,
        title=f"simulated {model.vehicle.name}",
        vehicle_ref=named,
        descriptions=texts,
        noise=dict(noise or {}),
        rng=np.random.default_rng(seed),
        holdout=_held_out(dict(zip(orders, manoeuvres, strict=True)), holdout),
    )


def _held_out(orders: Mapping[str, str], holdout: Iterable[str]) -> tuple[str, ...]:
    """Names of the runs that are kept for judging.

    Parameters
    ----------
    orders : name of a run -> its manoeuvre as it was given
    """
    asked = [holdout] if isinstance(holdout, str) else list(holdout)
    every = {*orders, *orders.values()}
    if unknown := [text for text in asked if text not in every]:
        raise ManoeuvreError(
            f"no run {', '.join(unknown)} to hold out"
            + (did_you_mean(unknown, every) or f"; there are {', '.join(dict.fromkeys(orders.values()))}")
        )
    held = tuple(name for name, text in orders.items() if name in asked or text in asked)
    if held and len(held) == len(orders):
        raise ManoeuvreError("every run is held out: leave one at least to identify from")
    return held


def _table(text: str) -> Path | None:
    """File of a table of orders; None for another manoeuvre."""
    kind, _, file = text.partition(":")
    return Path(file.partition(",")[0].strip()) if kind.strip().lower() == "table" else None


def _words(text: str) -> str:
    """What a run does, for a reader: a table by its file without folder."""
    file = _table(text)
    return text.replace(":", " ", 1) if file is None else f"orders of {file.name}"


def _run_name(text: str, number: int) -> str:
    file = _table(text)
    stem = re.sub(r"[^A-Za-z0-9]+", "_", text if file is None else file.stem).strip("_")[:40]
    return f"{number:02d}_{stem or 'orders'}"
