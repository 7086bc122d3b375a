"""How long is the first call of a kernel in a new process, printed and compiled anew, and from the cache?

Each row is two processes with their own empty cache folder: the first prints and compiles, the second loads.
Wall time includes starting Python and importing numba. Prints Markdown rows. Usage: [--all] (6-DOF too,
minutes).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from setting import machine, row

WHAT = {
    "one run": "simulate(m, p, plan, x0, full=F)",
    "lanes": "simulate_batch(m, np.repeat(p[None], 16, 0), plan, x0, full=F)",
    "Jacobian": "sensitivities(m, p, plan, x0, m.positions(m.coefficients), full=F)",
    "gradient": "gradient(m, p, plan, x0, lambda s: s, full=F)",
}
CODE = """
import numpy as np
from bayesid.equations.model import build_model
from bayesid.simulation import gradient, plan_run, sensitivities, simulate, simulate_batch, steady_start
from bayesid.model.vehicles import load_vehicle
F = {full}
m = build_model(load_vehicle("generic_sub"), {dof})
plan, p, x0 = plan_run(m, np.arange(5.0), {{}}), np.array(m.nominal), steady_start(m, 90.0)
{call}
"""


def process(code: str, cache: str) -> tuple[float, float]:
    """Wall and processor time of one Python process [s]."""
    here = str(Path(__file__).resolve().parents[1])
    environment = {**os.environ, "BAYESID_CACHE": cache, "PYTHONPATH": here}
    before, begin = os.times(), time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    wall, after = time.perf_counter() - begin, os.times()
    spent = after.children_user - before.children_user + after.children_system - before.children_system
    return wall, spent


def main(everything: bool) -> None:
    print(machine())
    row("model", "call", "cold: wall, CPU [s]", "warm: wall, CPU [s]", "target")
    row("---", "---", "---", "---", "---")
    for dof in (3, 6) if everything else (3,):
        for full in (False, True):
            for name, call in WHAT.items():
                code = CODE.format(full=full, dof=dof, call=call)
                with tempfile.TemporaryDirectory() as cache:
                    cold, warm = process(code, cache), process(code, cache)
                target = "<= 5 cold, <= 1.5 warm" if (dof, full, name) == (3, False, "lanes") else ""
                row(f"{dof}-DOF {'all effects' if full else 'bare'}", name,
                    *(f"{wall:.1f}, {cpu:.1f}" for wall, cpu in (cold, warm)), target)  # fmt: skip


if __name__ == "__main__":
    main("--all" in sys.argv[1:])
