"""Which method finds causes best, on bundles that everybody has? The benchmark set and its table.

Usage: bayesid study benchmark_set [--edition 1] [--out FOLDER] [--data FOLDER] [--secret FILE]
[--enter NAME=VERDICTS]... [--remember] [--executor NAME] [--workers N]. Makes the edition in FOLDER/set, or
keeps what is there, packs it, and compares every digest with those tracked beside this file. --data adds the
part of real logs, which stay where they are. --enter scores verdicts of `bayesid blind solve FOLDER/set/pack`
and enters them into the tracked table.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.beside import method_of, method_row
from bayesid.benchmark.protocol.commitment import PACK_COMMITMENTS_FILE, VERDICT_COMMITMENT_FILE, read_json
from bayesid.benchmark.protocol.scorecard import score_pack
from bayesid.benchmark.protocol.solve_pack import NOTE
from bayesid.errors import BayesidError
from bayesid.executor import HERE, Executor, add_executor, executor_from
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.benchmark_set.editions import EDITIONS
from studies.benchmark_set.make import archive, make_set
from studies.benchmark_set.report import PARTS, set_report

TRACKED = Path(__file__).parent


def main(
    edition: str,
    out: Path,
    data: Path | None = None,
    secret: Path | None = None,
    enter: Sequence[str] = (),
    remember: bool = False,
    executor: Executor = HERE,
) -> dict[str, Any]:
    """Make, compare, enter, report."""
    if edition not in EDITIONS:
        raise BayesidError(f"no edition {edition!r}; there are {', '.join(EDITIONS)}")
    asked = EDITIONS[edition]
    if not asked.phrase and secret is None:
        raise BayesidError(f"edition {edition} has no phrase; give the file of its secret with --secret")
    progress, folder = Progress(), out / "set"
    made = make_set(asked, folder, data, secret, executor, progress)
    name = f"bayesid-benchmark-{edition}"
    digests = {f"{name}.tar.gz": archive(folder / "pack", out / f"{name}.tar.gz", name)}
    if asked.phrase:
        packed = f"{name}-answers.tar.gz"
        digests[packed] = archive(folder / "answers", out / packed, f"{name}-answers")
    differ = compared(TRACKED / "commitments" / f"{edition}.json", made, remember)
    for sentence in differ:
        progress.note(sentence)
    kept = TRACKED / "entries" / f"{edition}.json"
    entries = read_json(kept, "the entries") if kept.exists() else []
    for text in enter:
        entry, _, verdicts = text.partition("=")
        entries = [e for e in entries if e["entry"] != entry] + [entered(entry, Path(verdicts), folder)]
        write_json(kept, entries)
    kinds = {p: dict(Counter(a.kind for a in load_answers(folder / "answers").values() if a.name[0] == p))
             for p in PARTS if p != "all"}  # fmt: skip
    results = {
        "inputs": {"edition": edition, "bundles": len(made["pack"])}, "seeds": [], "archives": digests,
        "differ": differ, "entries": entries, "kinds": kinds,
    }  # fmt: skip
    writer.write(set_report(edition, kinds, digests, entries), out, results)
    return results


def compared(tracked: Path, made: dict[str, Any], remember: bool) -> list[str]:
    """What differs from the tracked digests; `remember` tracks those of a part that has none."""
    known = read_json(tracked, "the commitments of the edition") if tracked.exists() else {}
    out = []
    for part, digests in made.items():
        if part not in known:
            if remember:
                known[part] = digests
                write_json(tracked, known)
            else:
                out.append(f"{part}: no digests are tracked for this part")
            continue
        for what in ("bundle", "answer"):
            other = [n for n in known[part] if digests.get(n, {}).get(what) != known[part][n][what]]
            if other:
                out.append(
                    f"{part}: {len(other)} of {len(known[part])} differ in the {what} from the edition ("
                    f"{', '.join(other[:3])}...): made with other libraries or processor; take the archive"
                )
        out += [f"{part}: {n} is not in the edition" for n in sorted(set(digests) - set(known[part]))]
    return out


def entered(entry: str, verdicts: Path, folder: Path) -> dict[str, Any]:
    """Scores of verdicts, all bundles and part by part; those without a commitment are entered as such."""
    kept = folder / "answers" / PACK_COMMITMENTS_FILE
    sealed = (verdicts / VERDICT_COMMITMENT_FILE).exists()
    if sealed:
        sheet = score_pack(folder / "answers", verdicts, commitments=kept)
        commitment = read_json(verdicts / VERDICT_COMMITMENT_FILE, "the commitment")
    else:
        sheet = score_pack(folder / "answers", verdicts, uncommitted=True)
        note = read_json(verdicts / sheet.cases[0].name / NOTE, "a note of `blind solve`")
        commitment = {"seal": "", "versions": note["versions"]}
    method = method_of(verdicts)
    scores = {}
    for part in PARTS:
        cases = [c for c in sheet.cases if part == "all" or c.name.startswith(part)]
        if cases:
            notes = [read_json(verdicts / c.name / NOTE, "a note of `blind solve`") for c in cases
                     if (verdicts / c.name / NOTE).exists()]  # fmt: skip
            spent = [note["cpu_seconds"] for note in notes if "cpu_seconds" in note]
            scores[part] = {
                **method_row(method, cases), "median CPU [s]": float(np.median(spent)) if spent else None,
            }  # fmt: skip
    return {
        "entry": entry,
        "method": method,
        "verdicts": commitment["seal"],
        "code": commitment["versions"]["code"],
        "entered": datetime.now(UTC).date().isoformat(),
        "unsolved": list(sheet.missing),
        "scores": scores,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="bayesid study benchmark_set", description=__doc__.splitlines()[0])
    parser.add_argument("--edition", default="1")
    parser.add_argument("--out", type=Path, default=Path("out/benchmark_set"))
    parser.add_argument("--data", type=Path, help="folder of the logs, for their part")
    parser.add_argument("--secret", type=Path, help="file of the secret of an edition without a phrase")
    parser.add_argument("--enter", action="append", default=[], metavar="NAME=VERDICTS")
    parser.add_argument("--remember", action="store_true", help="track the digests of a new edition")
    add_executor(parser)
    given = parser.parse_args()
    lock_or_exit(given.out, "studies/benchmark_set/run.py")
    main(
        given.edition, given.out, given.data, given.secret, given.enter, given.remember, executor_from(given)
    )
