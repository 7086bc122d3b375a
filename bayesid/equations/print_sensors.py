"""Print the sensors: the reading of every channel from the state at every sample, with slopes.

Takes a `Context`. Gives source lines. Delays are listed, not printed: `simulate` looks the state up earlier.
"""

from __future__ import annotations

from bayesid.equations.derivatives import Node
from bayesid.equations.print_context import PLAIN, Context


def sense_lines(c: Context) -> list[str]:
    d = c.dyn
    symbols = c.symbols()
    symbols |= {n: f"xs[i, {k}]" for k, n in enumerate(d.states)}
    symbols |= {n: f"exo[i, {k}]" for k, n in enumerate(d.exogenous)}
    readings = [(f"obs[i, {k}]", d.readings[name]) for k, name in enumerate(d.channels)]
    slopes: list[tuple[str, Node]] = []
    entries: list[tuple[int, int]] = []
    for channel, name in enumerate(d.channels):
        node = d.readings[name]
        slopes += [(f"dx[i, {channel}, {k}]", s) for k, s in c.slopes(node, d.states)]
        for k, slope in c.slopes(node, c.index):
            slopes.append((f"dpar[i, {len(entries)}]", slope))
            entries.append((channel, k))
    delays = {channel: [c.index[p] for p in names] for channel, names in d.delays.items()}
    return [
        f"{c.upper}_SENSOR_ENTRIES = np.array({entries!r}, dtype=np.int64).reshape(-1, 2)",
        f"{c.upper}_DELAYS = {delays!r}",
        "",
        "",
        PLAIN,
        f"def {c.prefix}_sense(xs, exo, times, par, slopes, obs, dx, dpar):",
        '    """Readings of every channel at every sample, with slopes by state and parameter if asked."""',
        "    for i in range(times.size):",
        "        t = times[i]",
        *c.emit(readings, 8, symbols),
        "        if slopes:",
        *c.emit(slopes, 12, symbols, prefix="v"),
    ]
