"""Memory and time of fit and diagnose over length, rate, runs and coefficients, to the odd ends of each.

Takes nothing. Gives one row per command and size: seconds of processor time, peak memory, and the last words
where it was refused.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.equations.model import build_model
from bayesid.manoeuvres.standard import zigzag
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation.virtual_trial import virtual_trial
from bayesid.trials.write import write_trial

VEHICLE = "generic_sub"
NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "u": 0.02, "v": 0.02, "r": 0.0005}  # SI
LONGEST = 1800.0  # s, of one command
ANGLES = (20.0, 10.0, 15.0)
KEPT_LENGTH = 600.0  # s of the run held out
MEASURED = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print("MEASURED", code, used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


@dataclass(frozen=True)
class Size:
    """A bundle of zig-zags, and what is done with it.

    Attributes
    ----------
    hours : of all runs together, but for one that is held out
    free : coefficients of a fit; all of them unless given
    noise : channels that are read
    samples : a run; the length decides unless given
    """

    command: str
    hours: float
    rate: float = 1.0
    runs: int = 3
    free: tuple[str, ...] = ()
    noise: tuple[str, ...] = tuple(NOISE)
    samples: int | None = None


FEW = ("N_dr", "N_r", "N_v", "Y_dr", "Y_r", "Y_v", "X_vr", "N_rdot", "Y_vdot", "N_vdot", "Y_rdot", "X_udot")
_hour = Size("diagnose", 1.0)
SIZES = {
    **{f"length {h:g} h, {c}": replace(_hour, command=c, hours=h)
       for h in (0.25, 1.0, 3.0) for c in ("diagnose", "fit")},
    "length 10 h, diagnose": replace(_hour, hours=10.0),
    "two samples a run, diagnose": Size("diagnose", 2.0 / 3600.0, runs=1, samples=2),
    "two samples a run, fit": Size("fit", 2.0 / 3600.0, runs=1, samples=2),
    "heading only": replace(_hour, hours=0.3, noise=("psi",)),
    **{f"rate {r:g} Hz": replace(_hour, hours=0.5, rate=r) for r in (0.05, 0.2, 1.0, 5.0)},
    **{f"{n} runs": replace(_hour, hours=0.5, runs=n) for n in (1, 3, 10, 50)},
    **{f"{n} free": Size("fit", 0.5, free=FEW[:n]) for n in (3, 6, 12)},
    "1000 Hz": Size("diagnose", 120.0 / 3600.0, 1000.0, 2),
    "5 million rows": Size("diagnose", 5e6 / 36e4, 100.0, 50),
    "10 h at 10 Hz, diagnose": replace(_hour, hours=10.0, rate=10.0),
    "length 10 h, fit": Size("fit", 10.0),
    "10 h at 10 Hz, fit": Size("fit", 10.0, 10.0),
}  # fmt: skip


def long_bundle(folder: Path, size: Size, seed: int = 0) -> Path:
    """The bundle of a size, with a short run held out."""
    model = build_model(load_vehicle(VEHICLE), 3)
    par = model.with_values({"N_dr": 1.17 * model.nominal[model.index["N_dr"]]})
    rpm, dt = float(model.vehicle.rpm_ref or 0.0), 1.0 / size.rate
    each = size.hours * 3600.0 / size.runs if size.samples is None else (size.samples - 1) * dt

    def run(angle: float, length: float) -> Any:
        angle *= np.pi / 180
        return zigzag(angle, angle, rpm, approach=min(30.0, length / 4), duration=length, dt=dt)

    runs = {
        f"run{k}": run(ANGLES[k % len(ANGLES)] + 0.1 * (k // len(ANGLES)), each) for k in range(size.runs)
    }
    runs["kept"] = run(12.0, min(KEPT_LENGTH, each))
    trial = virtual_trial(
        model, par, runs, title="long", vehicle_ref=VEHICLE, noise={c: NOISE[c] for c in size.noise},
        rng=np.random.default_rng(seed), holdout=("kept",),
    )  # fmt: skip
    read = [replace(run, data={c: v for c, v in run.data.items() if c in size.noise}) for run in trial.runs]
    trial = replace(trial, runs=tuple(read))
    return write_trial(trial, folder).parent


def measured(command: str, bundle: Path, out: Path, options: tuple[str, ...] = ()) -> dict[str, Any]:
    """One command on one bundle."""
    line = [sys.executable, "-m", "bayesid", command, str(bundle), "--out", str(out), "--quiet", *options]
    begun = time.monotonic()
    try:
        found = subprocess.run(
            [sys.executable, "-c", MEASURED, *line], capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        return {"code": None, "cpu": None, "mb": None, "wall": LONGEST, "words": "no end in time"}
    (mark,) = [x for x in found.stdout.splitlines() if x.startswith("MEASURED")]
    code, cpu, kb = mark.split()[1:]
    words = found.stderr.strip().splitlines()[-1:] if int(code) not in (0, 3) else []
    return {
        "code": int(code), "cpu": float(cpu), "mb": int(kb) / 1024.0, "wall": time.monotonic() - begun,
        "words": words[0] if words else "",
    }  # fmt: skip


def size_row(name: str, size: Size, work: Path) -> dict[str, Any]:
    """One command on one bundle, measured."""
    bundle = long_bundle(work / "bundle", size)
    options = ("--quick",) if size.command == "diagnose" else ()
    if size.free:
        options = (*options, "--free", ",".join(size.free))
    row = measured(size.command, bundle, work / "out", options)
    for folder in (bundle, work / "out"):
        shutil.rmtree(folder, ignore_errors=True)
    rows = round(size.hours * 3600.0 * size.rate)
    kept = ("command", "hours", "rate", "runs")
    return {"size": name, "rows": rows, **{k: getattr(size, k) for k in kept}, "free": len(size.free), **row}
