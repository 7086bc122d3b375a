"""Are effects named that nobody here knows? Committed campaigns of the plant, solved blind, scored, compared.

Usage: bayesid study withheld_effects [--out FOLDER] [--work FOLDER] [--count N] [--spatial N]
[--seed S] [--workers J] [--executor NAME]
[--kinds two=48,none=24] [--quick]. `--kinds` fixes the classes and their order, else
they are drawn. Packs, answers and verdicts go to the work folder; what is finished there is kept, so the
same line goes on after a stop. Campaigns are drawn from a secret beside the answers; with --seed they are
drawn from seeds that count up from there, which is for development, and the report says so.
"""

from __future__ import annotations

import argparse
import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.plant import KINDS
from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.cause_families import family_of
from bayesid.benchmark.protocol.commitment import PACK_COMMITMENTS_FILE, VERDICT_COMMITMENT_FILE
from bayesid.benchmark.protocol.judgement import DETECTABLE_NONCENTRALITY
from bayesid.benchmark.protocol.make_pack import make_pack
from bayesid.benchmark.protocol.report import blind_report, results
from bayesid.benchmark.protocol.scorecard import Scorecard, score_pack
from bayesid.benchmark.protocol.solve_pack import SolveSettings, solve_pack
from bayesid.benchmark.protocol.verdicts import load_verdicts
from bayesid.executor import Executor, add_executor, executor_from
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from bayesid.report import writer
from studies.withheld_effects.baselines import CHOICES, keep_baselines, needs_oracle, oracle
from studies.withheld_effects.baselines_section import baselines_section

COUNT, SPATIAL = 300, 40
QUICK = (3, 1)
AIM = (5.0, 500.0)  # noncentrality of single effects, log-uniform
PAIRS = (0.3, 0.8)  # sizes of two effects at once
SHARE_ROUGH = 0.5  # of the campaigns without an effect
APART = 100000  # between planar and 6-DOF seeds of development


def mixture(number: int, seed: int, planar: int = COUNT, kinds: tuple[str, ...] = ()) -> dict[str, Any]:
    """Factors of one campaign: classes as in the plant, faint and plain effects, half the nulls rough.

    The first `planar` campaigns are planar, the others in 6-DOF; `kinds` lists the classes of either instead.
    """
    rng = np.random.default_rng([seed, 9])
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    if kinds:
        kind = kinds[(number if number < planar else number - planar) % len(kinds)]
    out: dict[str, Any] = {"kind": kind, "dof": 6 if number >= planar else 3}
    aim = float(np.exp(rng.uniform(*np.log(AIM))))
    if kind == "none" and rng.random() < SHARE_ROUGH:
        out["sea"] = "rough"
    if kind == "effect":
        out["aim"] = aim
    if kind == "two":
        out["sizes"] = PAIRS
    return out


def counted(text: str) -> tuple[str, ...]:
    """Classes of campaigns from "two=48,none=24"."""
    out: list[str] = []
    for part in text.split(","):
        kind, _, number = part.partition("=")
        if kind not in KINDS or not number.isdigit():
            raise argparse.ArgumentTypeError(f"{part!r}: write KIND=NUMBER, KIND one of {', '.join(KINDS)}")
        out += [kind] * int(number)
    return tuple(out)


def main(
    out: Path,
    work: Path,
    count: int,
    spatial: int,
    seed: int | None,
    executor: Executor,
    accept: bool,
    minutes: float | None,
    kinds: tuple[str, ...] = (),
) -> Scorecard:
    """Make, solve, open, score, report."""
    progress = Progress()
    packs, answers, verdicts = (work / name for name in ("packs", "answers", "verdicts"))
    seeds = None
    if seed is not None:
        seeds = [*range(seed, seed + count), *range(seed + APART, seed + APART + spatial)]
    if not (packs / PACK_COMMITMENTS_FILE).exists():
        notify = partial(mixture, planar=count, kinds=kinds)
        make_pack(count + spatial, packs, answers, notify, "w", executor, progress, seeds)
    if not (verdicts / VERDICT_COMMITMENT_FILE).exists():
        keep = SolveSettings(0, False, False, keep_baselines, accept_faults=accept, minutes=minutes)
        solve_pack(packs, verdicts, executor, keep, progress)
    reached = oracles(packs, answers, verdicts, work / "oracle.json", executor, progress)
    sheet = score_pack(answers, verdicts, executor=executor, oracle=reached, progress=progress)
    chosen = {n: json.loads((verdicts / n / CHOICES).read_text("utf-8")) for n in load_verdicts(verdicts)}
    title = "Withheld effects: committed campaigns, solved blind"
    document = blind_report(sheet, [baselines_section(sheet.cases, chosen, reached, family_of)], title)
    inputs = {"planar": count, "spatial": spatial, "aim": AIM, "pairs": PAIRS, "share_rough": SHARE_ROUGH}
    drawn = [] if seed is None else [seed]
    writer.write(document, out, {"inputs": inputs, "seeds": drawn, **results(sheet)})
    return sheet


def oracles(
    packs: Path, answers: Path, verdicts: Path, kept: Path, executor: Executor, progress: Progress
) -> dict:
    """Shrink of refits with the true effects, for every gap that is worth it."""
    found: dict[str, float | None] = json.loads(kept.read_text("utf-8")) if kept.exists() else {}
    known, verdicts_read = load_answers(answers), load_verdicts(verdicts)
    for name in verdicts_read.keys() - found.keys():  # this very fit is its own oracle
        if not needs_oracle(known[name], verdicts_read[name]):
            found[name] = verdicts_read[name]["gap"]["shrink"]
    shown = {n: [c.shown.noncentrality for c in known[n].causes if c.shown] for n in verdicts_read}
    left = [
        n
        for n in sorted(verdicts_read.keys() - found.keys())
        if max(shown[n], default=0.0) >= DETECTABLE_NONCENTRALITY
    ]
    tasks = [(known[n], packs / n, verdicts / n, verdicts_read[n]) for n in left]
    with progress.stage("oracles", len(tasks)) as stage:
        for name, shrink in executor.in_order(oracle, tasks):
            found[name] = shrink if math.isfinite(shrink) else None
            write_json(kept, found)
            stage.step(info=name)
    return {n: s for n, s in found.items() if s is not None}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        prog="bayesid study withheld_effects", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/withheld_effects"))
    parser.add_argument("--work", type=Path, help="default: out/withheld_effects, or beside a quick report")
    parser.add_argument("--count", type=int, default=COUNT, help="planar campaigns")
    parser.add_argument("--spatial", type=int, default=SPATIAL, help="campaigns in 6-DOF")
    parser.add_argument("--seed", type=int, help="for development: draw from seeds instead of a secret")
    add_executor(parser, workers=2)
    parser.add_argument(
        "--kinds", type=counted, default=(), help="classes in this order, e.g. two=48,none=24"
    )
    parser.add_argument(
        "--accept-faults", action="store_true", help="score bundles the program failed on as misses"
    )
    parser.add_argument(
        "--minutes", type=float, help="begin no diagnosis after this time; score what there is"
    )
    parser.add_argument("--quick", action="store_true", help="three planar campaigns and one in 6-DOF")
    given = parser.parse_args()
    planar, spatial = QUICK if given.quick else (given.count, given.spatial)
    place = given.work or (given.out / "work" if given.quick else Path("out/withheld_effects"))
    lock_or_exit(given.out, "studies/withheld_effects/run.py")
    lock_or_exit(place, "studies/withheld_effects/run.py")
    main(given.out, place, planar, spatial, given.seed, executor_from(given), given.accept_faults,
         given.minutes, given.kinds)  # fmt: skip
