"""Before the next day at sea: which standard manoeuvre adds most to a turn that has been run?

Usage: python next_manoeuvre.py PICTURE.png
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import bayesid

found = bayesid.compare("remus100", executed=["turn:13"], quick=True, seed=1)
table = found.to_dataframe().sort_values("adds [nats]")
figure, axes = plt.subplots(figsize=(5.6, 3.8), layout="constrained")
axes.barh(table.index, table["adds [nats]"], color="#0072B2")
axes.set(xlabel="information added to the turn [nats]")
axes.spines[["top", "right"]].set_visible(False)
figure.savefig(sys.argv[1], dpi=110)
best = found.found.sets[1]
print(f"most by one run: {table.index[-1]}; best pair: {' and '.join(best.names)}")
