"""Why does a simulator part from the vehicle, and how far does the gap close? Planted, published, real gaps.

Usage: bayesid study sim_to_real_gap [--out FOLDER] [--quick] [--seed N] [--data FOLDER].
The example bundle, planted campaigns and Delphin2 need nothing; --data is the folder of real logs.
Finished campaigns are kept in FOLDER/campaigns and not run again; delete that folder to start afresh.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.report.writer import Section
from studies.sim_to_real_gap.delphin2 import delphin2
from studies.sim_to_real_gap.esso_osaka import esso_osaka
from studies.sim_to_real_gap.example import example
from studies.sim_to_real_gap.kvlcc2 import kvlcc2
from studies.sim_to_real_gap.planted import CASES, SIZES, planted
from studies.sim_to_real_gap.real_sections import esso_section, kvlcc2_section, lost_against_given
from studies.sim_to_real_gap.report import gap_report

QUICK = (0,)  # one campaign, and no Delphin2: its kernel takes half a minute to compile
DRAWS, QUICK_DRAWS = 200, 40


def main(out: Path, quick: bool, seed: int, data: Path | None = None) -> dict[str, Any]:
    """Run all parts and write the report."""
    progress = Progress()
    chosen = QUICK if quick else tuple(range(len(CASES)))
    story = example(out, seed, progress, QUICK_DRAWS if quick else DRAWS)
    rows = planted(chosen, out / "campaigns", seed, progress)
    parts: dict[str, Any] = {"example": story, "planted": rows}
    real: dict[str, Any] = {}
    if not quick:
        parts["delphin2"] = delphin2(out / "campaigns", progress)
    if data is not None:
        parts["more"], real = real_logs(data, out / "campaigns", quick, seed, progress)
        parts["lost"] = [lost for found in real.values() for lost in lost_against_given(found)]
    results = {
        "inputs": {"cases": [CASES[i] for i in chosen], "sizes": SIZES, "quick": quick},
        "seeds": [seed, *(seed + i for i in chosen)],
        "example": {k: story[k] for k in ("found", "truth", "coefficients", "excitation")},
        "campaigns": [row | {"found": _brief(row["found"])} for row in rows],
        "delphin2": parts.get("delphin2"),
        "real": _brief(real),
    }
    writer.write(gap_report(parts), out, results)
    return results


# What the report of a single diagnosis shows and this one does not: two thirds of the file.
LEFT_OUT = ("outliers", "runs", "detectability", "screen", "moved", "thresholds")


def _brief(found: Any) -> Any:
    """Findings without what no table here is made of, at any depth."""
    if isinstance(found, dict):
        return {k: _brief(v) for k, v in found.items() if k not in LEFT_OUT or "verdict" not in found}
    return [_brief(v) for v in found] if isinstance(found, list | tuple) else found


def real_logs(
    data: Path, store: Path, quick: bool, seed: int, progress: Progress
) -> tuple[list[Section], dict[str, Any]]:
    """Sections and findings of the logs that are in the folder."""
    sections, found = [], {}
    for name, study, section in (
        ("kvlcc2_hsva", kvlcc2, kvlcc2_section),
        ("esso_osaka", esso_osaka, esso_section),
    ):
        if (data / name).is_dir():
            found[name] = study(data / name, store, quick, seed, progress)
            sections.append(section(found[name]))
        else:
            progress.note(f"{name}: no such folder in {data.name}; left out")
    return sections, found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study sim_to_real_gap", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/sim_to_real_gap"))
    parser.add_argument("--quick", action="store_true", help="the example and one campaign")
    parser.add_argument("--seed", type=int, default=301)
    parser.add_argument("--data", type=Path, help="folder with kvlcc2_hsva and esso_osaka")
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/sim_to_real_gap/run.py")
    main(given.out, given.quick, given.seed, given.data)
