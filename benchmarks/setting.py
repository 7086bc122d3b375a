"""What every benchmark shares: the vehicle, the manoeuvre, the clock and the line that names the machine.

The generic submarine turns with stepped rudder for 600 s at dt = 0.5 s: 1200 steps, 4800 evaluations. Times
are processor time of alternating runs in one process; a ratio is the median of paired ratios, since absolute
times move by a factor of two when other work shares the machine.
"""

from __future__ import annotations

import os
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayesid.equations.model import Model, build_model
from bayesid.model.vehicles import load_vehicle
from bayesid.simulation import TimePlan, plan_run, steady_start
from bayesid.simulation.prepare import actuate, inverse_mass, start

STEPS, DT, RPM = 1200, 0.5, 90.0
LANES = 16


@dataclass(frozen=True, eq=False)
class Setting:
    """One model on the manoeuvre, with everything the kernels want ready, so that only kernels are timed."""

    model: Model
    plan: TimePlan
    x0: np.ndarray
    par: np.ndarray
    act: np.ndarray
    dact: np.ndarray
    full: bool

    @property
    def fun(self):
        return self.model.kernel.full if self.full else self.model.kernel.bare

    def begin(self, par=None):
        return start(self.fun, self.par if par is None else par, self.plan.exogenous[0], self.x0)[0]

    def minv(self, pars=None):
        return inverse_mass(self.model, self.fun, self.par[None] if pars is None else pars)

    def vectors(self, count: int) -> np.ndarray:
        """Parameter vectors with every coefficient moved by about 1 %."""
        out = np.repeat(self.par[None], count, axis=0)
        where = self.model.positions(self.model.coefficients)
        out[:, where] *= 1 + 0.01 * np.random.default_rng(0).standard_normal((count, where.size))
        return out


def setting(dof: int, full: bool = False) -> Setting:
    model = build_model(load_vehicle("generic_sub"), dof)
    t = np.arange(STEPS + 1) * DT
    rudder = np.deg2rad(15.0) * np.sign(np.sin(2 * np.pi * t / 120.0 + 1e-9)) * (t >= 10.0)
    inputs = {"delta_r_cmd": rudder, "n_cmd": np.full(t.size, RPM)}
    if dof == 6:
        inputs["delta_s_cmd"] = 0.2 * rudder
    plan = plan_run(model, t, inputs, max_step=DT)
    par = np.array(model.nominal)
    act, dact = actuate(model, par, plan, slopes=True, full=full)
    return Setting(model, plan, steady_start(model, RPM), par, act, dact, full)


def paired(
    base: Callable[[], object],
    other: Callable[[], object],
    repeats: int = 15,
    span: float = 0.02,
    clock: Callable[[], float] = time.process_time,
) -> tuple[float, float, float]:
    """Median seconds of both, and the median of the paired ratios other/base."""
    calls = []
    for run in (base, other):
        run()
        begin = clock()
        run()
        calls.append(max(1, int(span / max(clock() - begin, 1e-7))))
    seconds = np.empty((repeats, 2))
    for row in seconds:
        for k, run in enumerate((base, other)):
            begin = clock()
            for _ in range(calls[k]):
                run()
            row[k] = (clock() - begin) / calls[k]
    return (*np.median(seconds, axis=0), float(np.median(seconds[:, 1] / seconds[:, 0])))


def machine() -> str:
    """Processor, versions, load and commit in one line."""
    import numba

    try:
        text = Path("/proc/cpuinfo").read_text()
        processor = next(
            line.split(":")[1].strip() for line in text.splitlines() if line.startswith("model name")
        )
    except (OSError, StopIteration):
        processor = platform.processor()
    here = Path(__file__).parent
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=here, capture_output=True, text=True, check=False
    ).stdout.strip()
    load = os.getloadavg()[0]
    return (
        f"{processor}, {os.cpu_count()} cores, load {load:.1f}; Python {platform.python_version()}, "
        f"numba {numba.__version__}; commit {commit or 'unknown'}"
    )


def row(*cells: object) -> None:
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)
