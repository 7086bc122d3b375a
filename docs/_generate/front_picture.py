"""The picture of README and first page: the held-out turn of the ten-minute start.

Run by hand: `python docs/_generate/front_picture.py` writes docs/_static/pond.png (below 200 kB).
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import bayesid
from bayesid.report.figure_style import COLOURS

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "u": 0.02, "v": 0.02, "r": 0.0005}
RUNS = ("zigzag:20/20", "zigzag:10/10", "turn:25")
FREE = "N_v,N_r,N_dr,Y_v,Y_r,Y_dr"


def main() -> None:
    trial = bayesid.simulate("generic_sub", *RUNS, dt=1.0, change={"N_dr": -0.0045}, noise=NOISE, seed=1)
    fitted = ",".join(run.name for run in trial.runs[:2])
    found = bayesid.fit(trial, free=FREE, runs=fitted).found
    run = next(r for r in found.runs if r.role == "holdout")
    x, y, psi = (run.channels.index(c) for c in ("x", "y", "psi"))
    lines = (
        ("log", run.readings, {"color": "0.72", "lw": 5}),
        ("simulator as given", run.nominal, {"color": COLOURS["orange"], "lw": 1.6, "ls": (0, (5, 2))}),
        ("coefficients found", run.fitted, {"color": COLOURS["blue"], "lw": 1.4}),
    )
    figure, (track, heading) = plt.subplots(1, 2, figsize=(7.6, 3.3), layout="constrained")
    for label, values, style in lines:
        track.plot(values[:, y], values[:, x], label=label, **style)
        heading.plot(run.t, np.degrees(values[:, psi]), **style)
    track.set(xlabel="east [m]", ylabel="north [m]", title="track", aspect="equal")
    heading.set(xlabel="time [s]", ylabel="heading [deg]", title="heading")
    track.set_aspect("equal", adjustable="datalim")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    for axes in (track, heading):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(Path(__file__).parents[1] / "_static" / "pond.png", dpi=130)


if __name__ == "__main__":
    main()
