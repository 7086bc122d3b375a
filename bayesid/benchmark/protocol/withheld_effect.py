"""Withheld-effect checks on a real log: take away what was measured or known, and ask the diagnosis for it.

Takes a trial and what to take away. Writes the reduced bundle and its answer apart, then the commitments.
Does not diagnose. The answer is what the removed instrument said, with its own errors: no truth of a plant.

wind       : wind columns; the answer is the mean wind over ground
rudder     : measured rudder angles; the answer is offset and first-order lag of the rudder behind its order
current    : velocities through the water; the answer is the mean difference to those over ground
rate_limit : the fins' rate limit in the vehicle file; the answer is the excess of 1/rate
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.commitment import BlindError, unprintable
from bayesid.benchmark.protocol.make_pack import commit_pack, write_answer
from bayesid.model.vehicles import Vehicle, load_vehicle, write_vehicle
from bayesid.trials import Trial, load_trial, write_trial

LAGS_TRIED = 60  # first-order lags tried, up to a twentieth of a run


@dataclass(frozen=True, eq=False)
class Withheld:
    """A reduced trial, its vehicle, and what was taken: effect name -> parameters, and numbers per run."""

    trial: Trial
    vehicle: Vehicle
    effects: Mapping[str, Mapping[str, float]]
    runs: tuple[Mapping[str, Any], ...]


def withhold(
    bundle: Path,
    what: str,
    out: Path,
    answers: Path,
    data: Path | None = None,
    name: str = "",
    salted: str = "",
) -> Withheld:
    """Write the reduced bundle into `out` and its answer into `answers`, and commit to the pack again.

    Parameters
    ----------
    what : one of REMOVABLE
    data : folder of the logs where they are kept apart from the bundle
    name : of the reduced bundle; by default that of the bundle's folder, which should not tell what is gone
    salted : salt of the answer, by default a fresh one

    Raises
    ------
    BlindError                 nothing of the kind is in this bundle, or the folders are not apart
    """
    out, answers = out.resolve(), answers.resolve()
    if out == answers or out in answers.parents or answers in out.parents:
        raise BlindError("answers must be in a folder of their own, not within the pack or around it")
    if what not in REMOVABLE:
        raise BlindError(f"cannot take away {what!r}; one of {', '.join(REMOVABLE)}")
    trial = load_trial(bundle, data=data)
    found = REMOVABLE[what](trial, load_vehicle(trial.vehicle_ref))
    name = name or bundle.resolve().name
    if unprintable(name) or Path(name).name != name or name.startswith("."):
        raise BlindError(f"{name!r}: is no name of a bundle; use letters and digits, no control character")
    if (out / name).exists() or (answers / f"{name}.json").exists():
        raise BlindError(f"{name}: is in this pack already; give the reduced bundle another --name")
    # other columns, notes, history and sources may speak of what is gone, and a fit reads none of them
    runs = tuple(replace(run, extra={}, notes="", provenance=()) for run in found.trial.runs)
    vehicle = replace(found.vehicle, sources={}, confidence={}, validation={})
    write_vehicle(vehicle, out / name / "vehicle.toml", inside=True, schema=False)
    bare = replace(found.trial, runs=runs, vehicle_ref=str(out / name / "vehicle.toml"))
    write_trial(bare, out / name, schema=False)  # a pack holds what a diagnosis reads and no more
    write_answer(answers / f"{name}.json", _answer(found, name, what), salted)
    commit_pack(out, answers, [p.parent.name for p in out.glob("*/trial.toml")])
    return found


def _answer(found: Withheld, name: str, what: str) -> dict[str, Any]:
    effects = [
        {"name": n, "variant": "", "kind": "effect", "size": 1.0, "parameters": dict(p)}
        for n, p in found.effects.items()
    ]
    return {
        "format": 1,
        "name": name,
        "kind": "effect" if len(effects) == 1 else "two",
        "removed": what,
        "effects": effects,
        "vehicle": found.vehicle.name,
        "dof": found.trial.dof,
        "sensors": "log",
        "campaign": "log",
        "prior_relative_sd": float("inf"),
        "environment": {"sea": "log"},
        "coefficient_draw_relative": {},
        "runs": list(found.runs),
    }


def _wind(trial: Trial, vehicle: Vehicle) -> Withheld:
    logged = [r for r in trial.runs if {"wind_speed", "wind_from"} <= set(r.exogenous)]
    if not logged:
        raise BlindError(
            f"{trial.name}: no run has wind_speed and wind_from, so there is no wind to take away"
        )
    rows, total, seconds = [], np.zeros(2), 0.0
    for run in logged:
        speed, come = run.exogenous["wind_speed"], run.exogenous["wind_from"]
        mean = np.array([np.mean(speed * np.cos(come)), np.mean(speed * np.sin(come))])
        total += mean * run.duration
        seconds += run.duration
        rows.append({"run": run.name, **_polar(mean), "speed_sd": float(np.std(speed))})
    strength = _polar(total / seconds)
    runs = tuple(
        replace(r, exogenous={n: v for n, v in r.exogenous.items() if not n.startswith("wind_")})
        for r in trial.runs
    )
    return Withheld(replace(trial, runs=runs), vehicle, {"wind": strength}, tuple(rows))


def _polar(mean: np.ndarray) -> dict[str, float]:
    come = math.atan2(mean[1], mean[0]) % (2 * math.pi)
    return {"V_wind": float(np.hypot(*mean)), "from": come}


def _rudder(trial: Trial, vehicle: Vehicle) -> Withheld:
    logged = [r for r in trial.runs if "delta_r" in r.measured_inputs and "delta_r_cmd" in r.commands]
    if not logged:
        raise BlindError(
            f"{trial.name}: no run has both delta_r and delta_r_cmd; without an order nothing would steer"
        )
    lag, offset, rows = 0.0, 0.0, []
    for run in logged:
        tau, zero, left = lag_behind(run.t, run.commands["delta_r_cmd"], run.measured_inputs["delta_r"])
        lag, offset = lag + tau / len(logged), offset + zero / len(logged)
        rows.append({"run": run.name, "tau": tau, "offset": zero, "rms_left": left})
    runs = tuple(
        replace(r, measured_inputs={n: v for n, v in r.measured_inputs.items() if n != "delta_r"})
        if "delta_r_cmd" in r.commands
        else r
        for r in trial.runs
    )
    effects = {"actuator_lag": {"tau": lag}}
    if abs(offset) > math.radians(0.3):
        effects["rudder_offset"] = {"offset": offset}
    return Withheld(replace(trial, runs=runs), vehicle, effects, tuple(rows))


def lag_behind(t: np.ndarray, order: np.ndarray, measured: np.ndarray) -> tuple[float, float, float]:
    """First-order lag [s], offset [rad] and what is left [rad rms] of an angle behind its held order.

    Least squares over the lag on a grid, the offset in closed form.
    """
    best = (0.0, 0.0, math.inf)
    step = np.diff(t)
    for tau in np.linspace(0.0, (t[-1] - t[0]) / 20.0, LAGS_TRIED + 1):
        keep = np.exp(-step / tau) if tau > 0 else np.zeros(step.size)
        follow = np.empty_like(order)
        follow[0] = measured[0]
        for k in range(step.size):
            follow[k + 1] = keep[k] * follow[k] + (1.0 - keep[k]) * order[k]
        zero = float(np.mean(measured - follow))
        left = float(np.sqrt(np.mean((measured - follow - zero) ** 2)))
        if left < best[2]:
            best = (float(tau), zero, left)
    return best


def _current(trial: Trial, vehicle: Vehicle) -> Withheld:
    need = {"u", "v", "psi", "u_water", "v_water"}
    logged = [r for r in trial.runs if need <= set(r.data)]
    if not logged:
        raise BlindError(f"{trial.name}: no run has u, v, psi, u_water and v_water, so no current is known")
    rows, total, seconds = [], np.zeros(2), 0.0
    for run in logged:
        ahead, aside = run.data["u"] - run.data["u_water"], run.data["v"] - run.data["v_water"]
        c, s = np.cos(run.data["psi"]), np.sin(run.data["psi"])
        mean = np.array([np.nanmean(ahead * c - aside * s), np.nanmean(ahead * s + aside * c)])
        total += mean * run.duration
        seconds += run.duration
        rows.append({"run": run.name, "V_north": float(mean[0]), "V_east": float(mean[1])})
    north, east = (float(v) for v in total / seconds)
    runs = tuple(
        replace(r, data={n: v for n, v in r.data.items() if not n.endswith("_water")}) for r in trial.runs
    )
    noise = {n: s for n, s in trial.noise.items() if not n.endswith("_water")}
    reduced = replace(trial, runs=runs, noise=noise)
    return Withheld(reduced, vehicle, {"ocean_current": {"V_north": north, "V_east": east}}, tuple(rows))


def _rate_limit(trial: Trial, vehicle: Vehicle) -> Withheld:
    rate = vehicle.rates.get("delta_r", math.inf)
    if not math.isfinite(rate):
        raise BlindError(f"{vehicle.name}: states no rudder rate, so there is none to take away")
    if any("delta_r" in r.measured_inputs for r in trial.runs):
        raise BlindError(f"{trial.name}: measured rudder angles show its rate; take away rudder first")
    free = replace(vehicle, rates=vehicle.rates | {"delta_r": math.inf})
    effects = {"actuator_rate_limit": {"inverse_rate_excess": 1.0 / rate}}
    return Withheld(trial, free, effects, ({"rate": rate},))


REMOVABLE: Mapping[str, Callable[[Trial, Vehicle], Withheld]] = {
    "wind": _wind,
    "rudder": _rudder,
    "current": _current,
    "rate_limit": _rate_limit,
}
