"""A steady turn knows two yaw coefficients by their ratio; a zig-zag beside it tells them apart.

Usage: python ridge_of_a_turn.py PICTURE.png
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import bayesid

NOISE = {"x": 1.0, "y": 1.0, "psi": 0.005, "r": 0.0005}
CAMPAIGNS = {"one turn": ("turn:25",), "turn and zig-zag": ("turn:25", "zigzag:20/20")}

figure, axes = plt.subplots(figsize=(5.2, 4.2), layout="constrained")
for (name, runs), colour in zip(CAMPAIGNS.items(), ("#D55E00", "#0072B2"), strict=True):
    trial = bayesid.simulate("generic_sub", *runs, dt=2.0, noise=NOISE, seed=1)
    found = bayesid.identify(trial, free="N_v,N_r,N_dr", prior=0.2, profile=False)
    known = found.found.information
    draws = known.draws(800, np.random.default_rng(0), False)
    relative = 100 * (draws / draws.mean(axis=0) - 1)
    i, j = known.names.index("N_v"), known.names.index("N_r")
    axes.plot(relative[:, i], relative[:, j], ".", color=colour, ms=3, alpha=0.5, label=name)
    sd, together = relative.std(axis=0), np.corrcoef(relative[:, [i, j]].T)[0, 1]
    print(f"{name}: N_v to {sd[i]:.2g} %, N_r to {sd[j]:.2g} %, correlation {together:.2f}")
axes.set(xlabel="N_v, change from the mean [%]", ylabel="N_r, change from the mean [%]")
axes.legend(frameon=False)
figure.savefig(sys.argv[1], dpi=110)
