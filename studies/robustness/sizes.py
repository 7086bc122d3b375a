"""Memory and time of fit and diagnose over the length of a trial.

Takes lengths in hours and a rate. Gives one row per command and size: seconds of processor time, peak memory,
and the last words where it was refused.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
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
MEASURED = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print("MEASURED", code, used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


def long_bundle(folder: Path, hours: float, rate: float, seed: int = 0) -> Path:
    """A bundle of three zig-zags of together `hours` at `rate` [Hz], and a short one held out."""
    model = build_model(load_vehicle(VEHICLE), 3)
    par = model.with_values({"N_dr": 1.17 * model.nominal[model.index["N_dr"]]})
    rpm, rad = float(model.vehicle.rpm_ref or 0.0), np.pi / 180
    each = hours * 3600.0 / len(ANGLES)
    runs = {
        f"zigzag{a:g}": zigzag(a * rad, a * rad, rpm, approach=30.0, duration=each, dt=1.0 / rate)
        for a in ANGLES
    }
    runs["kept"] = zigzag(12 * rad, 12 * rad, rpm, approach=30.0, duration=600.0, dt=1.0 / rate)
    trial = virtual_trial(
        model, par, runs, title="long", vehicle_ref=VEHICLE, noise=NOISE,
        rng=np.random.default_rng(seed), holdout=("kept",),
    )  # fmt: skip
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


def size_rows(
    sizes: list[tuple[float, float]], commands: tuple[str, ...] = ("fit", "diagnose")
) -> list[dict]:
    """Rows for lengths [h] and rates [Hz]."""
    out = []
    for hours, rate in sizes:
        with tempfile.TemporaryDirectory() as place:
            bundle = long_bundle(Path(place) / "bundle", hours, rate)
            for command in commands:
                options = ("--quick",) if command == "diagnose" else ()
                row = measured(command, bundle, Path(place) / command, options)
                out.append({"command": command, "hours": hours, "rate": rate, **row})
                print(out[-1], flush=True)
    return out


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    size_rows([(float(h), float(sys.argv[2])) for h in sys.argv[1].split(",")], tuple(sys.argv[3].split(",")))
