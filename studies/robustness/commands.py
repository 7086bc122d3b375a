"""The commands that are killed, each on a bundle so short that it ends within seconds.

Takes a folder for the bundles. Gives `Command`s.
"""

from __future__ import annotations

from pathlib import Path

from studies.robustness.kills import WORKER, Command
from studies.robustness.small import small_bundle, small_pack

FREE = ("--free", "N_dr,N_r,N_v")
EMCEE = ("--max-steps", "100", "--memory", "ignore")
NUTS = ("--sampler", "nuts", "--quick", "--memory", "ignore")
DIAGNOSES = ("*/diagnosis.json",)


def commands(folder: Path) -> list[Command]:
    """Fit, diagnose, both samplers, a blind pack and a study."""
    bundle, pack = str(small_bundle(folder / "bundle")), str(small_pack(folder / "pack"))
    more = str(small_pack(folder / "more", 6))
    out = ("--out", "OUT", "--quiet")
    two = ("--quick", "--workers", "2", *out)
    return [
        Command("fit", "bayesid", ("fit", bundle, *FREE, *out), ("fit.json", "model.json"), times=15),
        Command("diagnose", "bayesid", ("diagnose", bundle, "--quick", *out),
                ("diagnosis.json", "model.json"), times=12),
        Command("blind solve", "bayesid", ("blind", "solve", pack, "--quick", *out), DIAGNOSES, times=32),
        Command("blind solve of six, two workers killed", "bayesid", ("blind", "solve", more, *two),
                DIAGNOSES, faults=(WORKER,), times=25, strikes=2),
        Command("blind solve of six, four workers killed", "bayesid", ("blind", "solve", more, *two),
                DIAGNOSES, faults=(WORKER,), times=13, strikes=4),
        Command("blind solve, two workers", "bayesid", ("blind", "solve", pack, *two), DIAGNOSES, times=3),
        Command("sample, emcee", "bayesid", ("sample", bundle, *FREE, *EMCEE, *out), ("posterior.nc",),
                ("--resume",), times=2),
        Command("study calibration", "studies.robustness.short_study", ("--out", "OUT"),
                ("results.json", "report.md", "seeds/*.json"), times=3),
        Command("sample, NUTS", "bayesid", ("sample", bundle, *FREE, *NUTS, *out), ("posterior.nc",),
                times=1),
    ]  # fmt: skip
