"""Are the columns of a measured wind found where they are read wrongly on purpose, on a real ship?

Usage: python -m studies.log_mistakes.measured_wind --data FOLDER [--out FILE] [--selections N] [--seed N].
FOLDER holds `esso_osaka`. Runs ahead of one day, two to five at a time, are read rightly and with every
mistake of the table. One line per reading is written as it is judged; the totals are printed at the end.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.input.measured_wind import check_wind
from bayesid.equations.model import build_model
from bayesid.trials import Run, Trial, thin
from bayesid.trials.measured_wind import in_measured_wind
from bayesid.trials.mistakes.wind import WIND_MISTAKES
from bayesid.trials.true_wind import as_read
from studies.blind_predictions.sets import REGIMES, SETS, kind, known_runs
from studies.real_logs.run import SETTINGS, begun
from studies.ship_models.ships import SHIPS

SHIP, STEP, NOTHING = "esso_osaka", 2.0, "nothing"


def selections(runs: Sequence[Run], count: int, seed: int) -> Iterator[tuple[Run, ...]]:
    """Runs of one day and kind, drawn."""
    rng = np.random.default_rng(seed)
    days: dict[str, list[Run]] = {}
    for run in runs:
        days.setdefault("_".join(run.name.split("_")[:2]), []).append(run)
    able = [days[day] for day in sorted(days) if len(days[day]) > 1]
    for k in range(count):
        day = able[k % len(able)]
        many = int(rng.integers(2, min(5, len(day)) + 1))
        yield tuple(day[i] for i in sorted(rng.permutation(len(day))[:many]))


def misread(run: Run, name: str) -> Run:
    """The run as it is logged with a mistake of the table."""
    mistake = next(m for m in WIND_MISTAKES if m.name == name)
    mend = mistake.correction
    assert mend is not None
    series = {**run.data, **run.exogenous}
    wind = dict(zip(("wind_speed", "wind_from"), as_read(mend.wind, run.t, series), strict=True))
    wind = {k: (x - mend.offset.get(k, 0.0)) / mend.scale.get(k, 1.0) for k, x in wind.items()}
    return replace(run, exogenous={**run.exogenous, **wind})


def judged(trial: Trial, runs: Sequence[Run], name: str, data: Path) -> dict[str, Any]:
    """What is said of some runs read with a mistake."""
    read = [replace(r if name == NOTHING else misread(r, name), role="identify") for r in runs]
    some = replace(trial, runs=tuple(read))
    found = check_wind(some, build_model(in_measured_wind(SHIPS[SHIP](data / SHIP), some), 3))
    finding = found.finding
    return {
        "runs": [r.name for r in runs], "mistake": name, "named": finding.name if finding else None,
        "also": list(finding.also) if finding else [], "left_open": found.remark, "in_order": found.in_order,
    }  # fmt: skip


def study(data: Path, out: Path, count: int, seed: int) -> None:
    """Judge every row that `out` does not hold yet, then print the totals."""
    done = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    known = {(tuple(row["runs"]), row["mistake"]) for row in done}
    trial = known_runs(SETS[SHIP], data)
    ahead = [r for r in trial.runs if kind(r.name) in REGIMES["ahead"] and "wind_speed" in r.exogenous]
    runs = [thin(begun(r, SETTINGS[SHIP].way), STEP) for r in ahead]
    for some in selections(runs, count, seed):
        for name in (NOTHING, *(m.name for m in WIND_MISTAKES)):
            if (tuple(r.name for r in some), name) in known:
                continue
            done.append(judged(trial, some, name, data))
            known.add((tuple(done[-1]["runs"]), name))
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(done[-1]) + "\n")
            print(f"{len(some)} runs, {name}: {done[-1]['named'] or done[-1]['left_open']}", flush=True)
    for name in (NOTHING, *(m.name for m in WIND_MISTAKES)):
        rows = [row for row in done if row["mistake"] == name]
        counted = Counter(verdict(row) for row in rows)
        print(f"{name}: {', '.join(f'{n} {what}' for what, n in counted.most_common())}")


def verdict(row: Mapping[str, Any]) -> str:
    """What is said of one reading, held against what was done to it."""
    name = row["mistake"]
    if row["named"] is not None:
        if name == row["named"]:
            return "named alone" if not row["also"] else "named first of several"
        return "in a set" if name in row["also"] else "named wrongly"
    if row["left_open"] is not None:
        says = {m.name: m.says for m in WIND_MISTAKES}
        return "left open" if name in says and says[name] in row["left_open"] else "another left open"
    return "in order" if row["in_order"] else "nothing said"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=Path("out/log_mistakes_wind.jsonl"))
    parser.add_argument("--selections", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    study(given.data, given.out, given.selections, given.seed)
