"""What does the composite likelihood cost beside white noise, per command?

Takes no input; simulates the trial of README ("pond") and reads the built-in one. Prints Markdown rows:
processor seconds of whole commands (start, reports and figures included), white noise and default, least of
REPEATS alternating runs (one of `sample`), caches warm. Usage: [--example] for the built-in trial.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from setting import machine

REPEATS = 3
SIMULATE = (
    "simulate generic_sub zigzag:20/20 zigzag:10/10 turn:25 --dt 1 --set N_dr=-0.0045 --seed 1 --out pond "
    "--noise x=1 --noise y=1 --noise psi=0.005 --noise u=0.02 --noise v=0.02 --noise r=0.0005"
)
POND = ("pond", "--runs 01_zigzag_20_20,02_zigzag_10_10 --free N_v,N_r,N_dr,Y_v,Y_r,Y_dr", "turn:20")
EXAMPLE = ("example", "--free N_v,N_r,N_dr,Y_v,Y_r,Y_dr", "turn:10")


def seconds(folder: Path, command: str) -> float:
    """Processor time of a command and its children."""
    arguments = [sys.executable, "-m", "bayesid", *command.split()]
    child = subprocess.Popen(
        arguments, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    told = child.stderr.read() if child.stderr else ""
    _, status, usage = os.wait4(child.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 3):
        raise SystemExit(f"bayesid {command}: exit code {code}\n{told}")
    return usage.ru_utime + usage.ru_stime


def main(trial: str, choice: str, manoeuvre: str) -> None:
    """Table of one trial."""
    pairs = {
        "fit": (f"fit {trial} {choice} --residuals white", f"fit {trial} {choice}"),
        "identify --fit": (f"identify {trial} {choice} --fit white", f"identify {trial} {choice} --fit full"),
        "predict": (
            f"predict {trial} {manoeuvre} --model white",
            f"predict {trial} {manoeuvre} --model full",
        ),
        "sample": (
            f"sample {trial} {choice} --memory ignore",
            f"sample {trial} {choice}",
        ),
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if trial == "pond":
            seconds(folder, SIMULATE)
        print(f"{machine()}\n\n| {trial} | white noise [s] | default [s] | ratio |\n|---|---|---|---|")
        for name, commands in pairs.items():
            found: tuple[list[float], list[float]] = ([], [])
            for number in range(1 if name == "sample" else REPEATS):
                for kept, command, kind in zip(found, commands, ("white", "full"), strict=True):
                    first = {"fit": kind, "sample": f"{kind}_sample"}.get(name)
                    out = first if first and not number else f"{kind}_{name.split()[0]}_{number}"
                    kept.append(seconds(folder, f"{command} --out {out}"))
            white, full = min(found[0]), min(found[1])
            print(f"| `{name}` | {white:.1f} | {full:.1f} | {full / white:.2f} |", flush=True)


if __name__ == "__main__":
    main(*(EXAMPLE if "--example" in sys.argv else POND))
