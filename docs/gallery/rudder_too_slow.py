"""The log turns later than the simulator: the diagnosis says why, and how far the gap shrinks.

Usage: python rudder_too_slow.py PICTURE.png
"""

import sys
from dataclasses import replace

import matplotlib

matplotlib.use("Agg")

import bayesid

NOISE = {"x": 0.05, "y": 0.05, "psi": 0.003, "u": 0.01, "v": 0.01, "r": 0.0005}
RUNS = ("straight:duration=30", "zigzag:10/10", "zigzag:5/5", "turn:13", "zigzag:12/12")
trial = bayesid.simulate("remus100", *RUNS, dt=0.2, noise=NOISE, change={"actuator_lag.tau": 0.6}, seed=2)
last = trial.runs[-1]
trial = replace(trial, runs=(*trial.runs[:-1], replace(last, role="holdout")))
found = bayesid.diagnose(trial, next_manoeuvre=False, keep_model=False)
print(found.summary().splitlines()[1])
found.plot("picture_time").savefig(sys.argv[1], dpi=110)
