"""Bundles so short that a command on one takes seconds, to be killed many times.

Takes a folder. Writes bundles of a planar vehicle with one coefficient 17 % off.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bayesid.api.planning import reference_scale
from bayesid.equations.model import build_model
from bayesid.manoeuvres import parse
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials import write_trial

VEHICLE = "generic_sub"
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "u": 0.02, "v": 0.02, "r": 0.0005}  # SI
KEPT = "zigzag:15/15,duration=200"
RUNS = ("turn:25,duration=200", "zigzag:20/20,duration=200", KEPT)


def small_bundle(folder: Path, seed: int = 0) -> Path:
    """Two runs of 50 samples and one held out."""
    model = build_model(load_vehicle(VEHICLE), 3)
    par = model.with_values({"N_dr": 1.17 * model.nominal[model.index["N_dr"]]})
    coarse = replace(reference_scale(model), dt=4.0)
    trial = virtual_trial(
        model, par, {text: parse(text, coarse) for text in RUNS}, title="small", vehicle_ref=VEHICLE,
        noise=NOISE, rng=np.random.default_rng(seed), holdout=(KEPT,),
    )  # fmt: skip
    return write_trial(trial, folder).parent


def small_pack(folder: Path, count: int = 2) -> Path:
    """Several of them in one folder."""
    for k in range(count):
        small_bundle(folder / f"b{k}", k)
    return folder
