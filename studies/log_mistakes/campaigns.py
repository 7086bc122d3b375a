"""Clean campaigns into which mistakes are planted: vehicles of the catalogue, true coefficients off by 5 %.

Takes a vehicle and a seed; gives a `Trial` with three or four runs to identify from and a held-out one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.equations.model import build_model
from bayesid.estimation.parameters import coefficient_prior
from bayesid.manoeuvres import Scale, parse
from bayesid.model.effects import CATALOGUE, Effect
from bayesid.model.vehicles import load_vehicle, self_propulsion_speed, with_relative_prior
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import Run, Trial

VEHICLES = {"remus100": 3, "generic_sub": 3, "nps_auv2": 6}
PRIOR_SD = 0.05
HELD_OUT = "zigzag15"
FULL = ("x", "y", "z", "psi", "phi", "theta", "u", "v", "w", "p", "q", "r")
POSE = ("x", "y", "z", "psi", "phi", "theta")


def campaign(
    name: str, seed: int, rate: float = 10.0, step: float = 0.05, acts: Effect | None = None
) -> Trial:
    """A clean trial with white noise, `rate` readings per second of a vehicle of 2 m.

    Parameters
    ----------
    step : time between samples and orders [L/U], before they are thinned to `rate`
    acts : an effect, of the catalogue or a further one, its sizes at their prior standard deviations
    """
    dof = VEHICLES[name]
    vehicle = with_relative_prior(load_vehicle(name), PRIOR_SD)
    model = build_model(vehicle, dof, () if acts is None or acts in CATALOGUE else (acts,))
    rng = np.random.default_rng(seed)
    rpm = vehicle.rpm_ref or 0.0
    speed = self_propulsion_speed(vehicle, rpm)
    period = vehicle.L / speed
    dt = round(max(0.1, step * period), 2)
    prior = coefficient_prior(model)
    par = model.nominal.copy()
    par[prior.where] = np.maximum(
        prior.mean + prior.sd * rng.standard_normal(prior.mean.size) * 0.5, prior.low
    )
    if acts is not None:
        for parameter in acts.parameters:
            par[model.index[acts.key(parameter.name)]] = parameter.sd
    scale = Scale(vehicle.L, speed, rpm, 0.35, 0.2, dof, dt)
    texts = {
        "zigzag10": "zigzag:10/10", "zigzag20": "zigzag:20/20", "turn15": "turn:15,side=starboard",
        "prbs": f"prbs:seed={seed + 1}", HELD_OUT: "zigzag:15/15",
    }  # fmt: skip
    if dof == 6:
        texts = {
            "vzigzag": "vzigzag:10/5",
            "combined": "combined:10/8",
            "zigzag20": "zigzag:20/20",
            HELD_OUT: texts[HELD_OUT],
        }
    noise = {
        "x": 0.02 * vehicle.L, "y": 0.02 * vehicle.L, "psi": 0.005, "r": 0.003 / period, "u": 0.005 * speed,
        "v": 0.005 * speed,
    }  # fmt: skip
    if dof == 6:
        noise |= {
            "z": 0.01 * vehicle.L, "phi": 0.005, "theta": 0.005, "p": 0.003 / period, "q": 0.003 / period,
            "w": 0.005 * speed,
        }  # fmt: skip
    trial = virtual_trial(
        model,
        par,
        {k: parse(v, scale) for k, v in texts.items()},
        title=f"{name} {seed}",
        vehicle_ref=name,
        noise=noise,
        rng=rng,
        descriptions=texts,
        holdout=(HELD_OUT,),
    )
    stride = max(1, round(10.0 / rate))
    return replace(trial, runs=tuple(thinned(run, stride) for run in trial.runs))


def thinned(run: Run, stride: int) -> Run:
    """Every so many samples."""
    groups: dict[str, Any] = {g: {k: v[::stride] for k, v in getattr(run, g).items()} for g in run.GROUPS}
    return replace(run, t=run.t[::stride], **groups)


def with_channels(trial: Trial, names: tuple[str, ...]) -> Trial:
    """The trial with some channels only."""
    keep = tuple(replace(run, data={k: v for k, v in run.data.items() if k in names}) for run in trial.runs)
    noise = {k: v for k, v in trial.noise.items() if k in names}
    return replace(trial, runs=keep, noise=noise)
