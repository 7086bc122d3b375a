"""A scorecard: answers and verdicts read, checked, judged and summed up.

Takes two folders. Gives a frozen `Scorecard`; its prose is `bayesid.benchmark.protocol.report`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.answers import Answer, load_answers, with_shown
from bayesid.benchmark.protocol.commitment import PACK_COMMITMENTS_FILE, BlindError, digest_of
from bayesid.benchmark.protocol.detectability import from_json
from bayesid.benchmark.protocol.judgement import ScoredCase, judge
from bayesid.benchmark.protocol.make_pack import redraw
from bayesid.benchmark.protocol.scores import Bin, Quantity, calibration, score_quantities, shuffled, table
from bayesid.benchmark.protocol.verdicts import caveats, check_commitments, load_verdicts
from bayesid.executor import HERE, Executor
from bayesid.files import write_json
from bayesid.progress import Progress

STRATA: Mapping[str, Callable[[ScoredCase], str]] = {
    "Nature and detectability": lambda c: c.kind if c.kind == c.stratum else f"{c.kind}, {c.stratum}",
    "Sea": lambda c: c.factors.get("sea", ""),
    "Sensors": lambda c: c.factors.get("sensors", ""),
    "Campaign": lambda c: c.factors.get("campaign", ""),
    "Vehicle": lambda c: f"{c.factors.get('vehicle', '')}, {c.dof}-DOF",
    "Prior of the coefficients": lambda c: c.factors.get("prior", ""),
}


@dataclass(frozen=True, eq=False)
class Scorecard:
    """Scores of one pack.

    Attributes
    ----------
    cases : one per answered bundle
    quantities : dof -> lines with their bars
    calibration : bins over all cases
    control : the line that must fail
    strata : table per factor, see `scores.table`
    committed : what the commitment says, None for uncommitted verdicts
    missing : bundles without a verdict, left out: not solved in the time given, or uncommitted and not there
    caveats : what these commitments do not prove
    """

    cases: tuple[ScoredCase, ...]
    quantities: Mapping[int, tuple[Quantity, ...]]
    calibration: tuple[Bin, ...]
    control: Quantity
    strata: Mapping[str, list[list[object]]]
    committed: Mapping[str, Any] | None
    missing: tuple[str, ...]
    caveats: tuple[str, ...] = ()


def score_pack(
    answers: Path,
    verdicts: Path,
    uncommitted: bool = False,
    cache: Path | None = None,
    executor: Executor = HERE,
    oracle: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    promised: str = "",
    commitments: Path | None = None,
) -> Scorecard:
    """Score verdicts.

    Parameters
    ----------
    answers : folder of answers, or a file with a list of labels
    uncommitted : take verdicts without a commitment, whichever there are, and say so
    cache : file that keeps detectabilities which answers do not state, so that they are computed once
    oracle : bundle -> shrink of a refit with the true effects
    promised, commitments : see `check_commitments`; commitments kept with the answers are taken where none
        are given

    Raises
    ------
    BlindError                 a commitment broken or not the one made known, a verdict or an answer missing
    """
    known = load_answers(answers)
    if uncommitted and (promised or commitments):
        raise BlindError(
            "verdicts without a commitment cannot be checked against one; leave --uncommitted out"
        )
    kept = answers / PACK_COMMITMENTS_FILE
    if commitments is None and kept.is_file():
        commitments = kept
    committed = None if uncommitted else check_commitments(verdicts, known, promised, commitments)
    found = load_verdicts(verdicts)
    unsolved = set(committed.get("unsolved", ())) if committed else set()
    asked = (
        sorted(set(committed["pack"]["bundles"]) - unsolved) if committed else sorted(set(found) & set(known))
    )
    if not asked:
        raise BlindError(f"no bundle has both an answer in {answers} and a verdict in {verdicts}")
    known = reweighted({n: known[n] for n in asked}, cache, executor, progress or Progress())
    cost = (committed or {}).get("cost", {})
    cases = []
    for name in asked:
        verdict = found.get(name)
        seconds = cost.get(name, {}).get("cpu_seconds", (verdict or {}).get("cpu", math.nan))
        cases.append(judge(known[name], verdict, float(seconds)))
    quantities = {
        dof: tuple(score_quantities([c for c in cases if c.dof == dof], oracle, dof))
        for dof in sorted({c.dof for c in cases})
    }
    missing = tuple(sorted(unsolved if committed else set(load_answers(answers)) - set(found)))
    strata = {name: table(cases, key) for name, key in STRATA.items()}
    control = shuffled(known, found)
    doubts = caveats(committed) if committed else ()
    return Scorecard(
        tuple(cases), quantities, tuple(calibration(cases)), control, strata, committed, missing, doubts
    )


def reweighted(
    answers: Mapping[str, Answer], cache: Path | None, executor: Executor, progress: Progress
) -> dict[str, Answer]:
    """Answers with how plainly their causes show, computed from their seeds where they do not say it."""
    kept: dict[str, Any] = json.loads(cache.read_text("utf-8")) if cache and cache.exists() else {}
    todo = {n: a for n, a in answers.items() if any(c.shown is None for c in a.causes)}
    keys = {n: digest_of(json.dumps(a.source, sort_keys=True).encode())[:16] for n, a in todo.items()}
    fresh = [n for n in todo if keys[n] not in kept and "seed" in todo[n].source]
    if fresh:
        sources = [dict(todo[n].source) for n in fresh]
        with progress.stage("detectability", len(fresh)) as stage:
            for name, shown in zip(fresh, executor.in_order(redraw, sources), strict=True):
                kept[keys[name]] = [asdict(s) for s in shown] if shown is not None else None
                stage.step(info=name)
                if cache is not None:
                    write_json(cache, kept)
    out = dict(answers)
    for name, answer in todo.items():
        shown = kept.get(keys[name])
        if shown:
            out[name] = with_shown(answer, tuple(from_json(s) for s in shown))
    return out
