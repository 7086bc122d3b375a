"""Were the committed verdicts on withheld bundles right? Scored as they stand, every miss explained.

Usage: bayesid study withheld_score --labels FILE [--verdicts FOLDER] [--data FOLDER] [--out FOLDER].
--labels is the maker's list, --data the folder of the real logs (holds `esso_osaka` with `wind_opened`; left
out, the wind is not scored). Verdicts are checked against their commitment first and never written to.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.commitment import BlindError, digest_of_file, digest_of_folder, read_json
from bayesid.benchmark.protocol.report import results as plain_sheet
from bayesid.benchmark.protocol.scorecard import score_pack
from bayesid.benchmark.protocol.verdicts import load_verdicts
from bayesid.report import writer
from studies.sim_to_real_gap.esso_osaka import pond_logs
from studies.withheld_score.effects import RIGHT, expected, parameters, row_of
from studies.withheld_score.misses import MISSES, OUTSIDE_INTERVAL
from studies.withheld_score.report import check_report
from studies.withheld_score.wind import checked, measured, scored, summed

VERDICTS = Path(__file__).resolve().parents[1] / "reports" / "withheld"
WIND = Path("esso_osaka_wind") / "verdicts.json"


def main(labels: Path, verdicts: Path, data: Path | None, out: Path) -> dict[str, Any]:
    """Score, report."""
    sheet = score_pack(labels, verdicts)
    assert sheet.committed is not None  # score_pack raises without a commitment
    answers, found = load_answers(labels), load_verdicts(verdicts)
    rows = [row_of(c, answers[c.name], found[c.name]) for c in sheet.cases]
    sizes = parameters({c.name: answers[c.name] for c in sheet.cases}, found)
    explained(
        {r["bundle"] for r in rows if r["fate"] != RIGHT}, {p["bundle"] for p in sizes if not p["inside"]}
    )
    nulls = [c for c in sheet.cases if c.kind == "none"]
    naming = [c for c in sheet.cases if c.named]
    results = {
        "inputs": {"verdicts": sheet.committed["seal"], "bundles": len(rows)},
        "seeds": [],
        "seal": {k: sheet.committed[k] for k in ("seal", "sealed", "versions")},
        "labels": digest_of_file(labels),
        "same_bundles": same_bundles(labels.parent, sheet.committed["pack"]["bundles"]),
        "bundles": rows,
        "parameters": sizes,
        "promised": sum(r["stated"] for r in rows),
        "named": {"verdicts": len(naming), "wrong": sum(bool(c.named - c.right) for c in naming)},
        "none": {"bundles": len(nulls), "alarms": sum(c.word != "none" for c in nulls)},
        "expected": expected(sheet.cases, found),
        "wind": None if data is None else wind(verdicts / WIND, data / "esso_osaka"),
        "sheet": plain_sheet(sheet),
    }
    writer.write(check_report(results, found, sheet), out, results)
    return results


def same_bundles(folder: Path, committed: dict[str, str]) -> int | None:
    """How many bundles beside the labels have the digest that was committed; None where there are none."""
    there = [n for n in committed if (folder / n / "trial.toml").exists()]
    return sum(digest_of_folder(folder / n) == committed[n] for n in there) if there else None


def explained(missed: set[str], outside: set[str]) -> None:
    """Every miss and every parameter outside its interval has a reason written down, and nothing else has.

    Raises
    ------
    BlindError                 naming the bundles, when verdicts or labels are not those the reasons were
    written for
    """
    for what, have, want in (("miss", set(MISSES), missed), ("parameter", set(OUTSIDE_INTERVAL), outside)):
        if have != want:
            raise BlindError(
                f"no reason for the {what} of {', '.join(sorted(want - have)) or 'none'}; a reason without "
                f"one for {', '.join(sorted(have - want)) or 'none'}: bring "
                f"studies/withheld_score/misses.py up "
                "to date"
            )


def wind(file: Path, data: Path) -> dict[str, Any]:
    """Sealed statements about the runs without a wind log, beside the opened anemometer."""
    on_wind = read_json(file, "the committed verdicts on wind")
    committed = on_wind["withheld"]
    trial, _ = pond_logs(data)
    rows = []
    for row in committed["runs"]:
        t = trial.run(row["run"]).t
        known = measured(data / "wind_opened" / f"{row['run']}.csv", float(t[0]), float(t[-1]))
        rows.append({"run": row["run"], **scored(row["found"], known, committed["area"])})
    october = checked(on_wind["hidden"]["runs"], committed["area"])
    return {
        "digest": digest_of_file(file), "area": committed["area"], "runs": rows, "sum": summed(rows),
        "october": october,
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study withheld_score", description=__doc__.splitlines()[0])
    parser.add_argument("--labels", type=Path, required=True, help="the maker's list of labels")
    parser.add_argument("--verdicts", type=Path, default=VERDICTS, help="folder of the committed verdicts")
    parser.add_argument("--data", type=Path, help="folder that holds esso_osaka with wind_opened")
    parser.add_argument("--out", type=Path, default=Path("out/withheld"))
    given = parser.parse_args()
    main(given.labels, given.verdicts, given.data, given.out)
