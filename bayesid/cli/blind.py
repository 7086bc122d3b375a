"""`bayesid blind`: make committed packs, solve them, score the verdicts; take a known effect away from a
log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.options import ExecutorName, Json, OutFolder, Quick, Quiet, Seed, Verbose, Workers, claimed
from bayesid.cli.terminal import NOT_CONVERGED, OK

Answers = Annotated[
    Path,
    typer.Option("--answers", help="Folder of the answers, apart from the pack.", callback=claimed),
]


def make(
    out: OutFolder,
    answers: Answers,
    count: Annotated[int, typer.Option("--count", "-n", min=1, help="How many bundles.")] = 10,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="For development: who knows it can rebuild the pack, and scores say so."),
    ] = None,
    kind: Annotated[str | None, typer.Option(help="none, effect, two, variant or outside.")] = None,
    effect: Annotated[list[str] | None, typer.Option(help="Effect to plant; may be given twice.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Vehicle of the plant.")] = None,
    dof: Annotated[int | None, typer.Option(help="3 or 6.")] = None,
    sensors: Annotated[str | None, typer.Option(help="full, 'no velocity log' or 'pose only'.")] = None,
    sea: Annotated[str | None, typer.Option(help="still, calm, mid or rough.")] = None,
    executor: ExecutorName = None,
    workers: Workers = None,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Make a pack of trial bundles with committed answers.

    The fingerprint of every answer is published in the pack; give away --out and keep --answers, which holds
    the secret that campaigns and names are drawn from.
    """
    from bayesid.benchmark.protocol.make_pack import make_pack
    from bayesid.executor import executor_of

    given = {"kind": kind, "effects": effect or None, "vehicle": vehicle, "dof": dof}
    given |= {"sensors": sensors, "sea": sea}
    factors = {key: value for key, value in given.items() if value is not None}
    seeds = None if seed is None else range(seed, seed + count)
    path = make_pack(count, out, answers, factors, executor=executor_of(executor, workers), seeds=seeds)
    if seeds is not None:
        print("drawn from seeds: for development, no blind check")
    print(f"{count} bundles in {out}, commitments in {path.name}; answers in {answers}: keep them apart")
    return OK


def remove(
    bundle: Annotated[Path, typer.Argument(help="Folder of the trial bundle.")],
    what: Annotated[str, typer.Argument(help="wind, rudder, current or rate_limit.")],
    out: OutFolder,
    answers: Answers,
    data: Annotated[Path | None, typer.Option("--data", help="Folder of the logs, if apart.")] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the reduced bundle.")] = "",
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Take a measured channel or a known limit away from a real log, to have it found again.

    wind: wind columns. rudder: measured angles. current: velocities through the water. rate_limit: that of
    the rudder in the vehicle file. What the instrument said goes into the committed answer.
    """
    from bayesid.benchmark.protocol.withheld_effect import withhold as take

    found = take(bundle, what, out, answers, data, name)
    for effect, values in found.effects.items():
        listed = ", ".join(f"{n} = {v:.4g}" for n, v in values.items())
        print(f"{effect}: {listed} is the committed answer")
    print(f"reduced bundle in {out}; keep {answers} apart")
    return OK


def solve(
    pack: Annotated[Path, typer.Argument(help="Folder of trial bundles.")],
    out: OutFolder,
    only: Annotated[
        list[str] | None, typer.Option("--only", help="This bundle only; may be given twice. Not committed.")
    ] = None,
    accept_faults: Annotated[
        bool, typer.Option("--accept-faults", help="Seal although the program failed on some bundles.")
    ] = False,
    minutes: Annotated[
        float | None,
        typer.Option("--minutes", min=0.0, help="Begin no bundle after this time; commit to the rest."),
    ] = None,
    method: Annotated[
        str, typer.Option("--method", help="diagnosis, distortions or reproducibility: who answers.")
    ] = "diagnosis",
    executor: ExecutorName = None,
    workers: Workers = None,
    seed: Seed = 0,
    quick: Quick = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Diagnose every bundle of a pack and commit to the verdicts.

    Refuses a pack in which an answer may be read. Run it again after a stop: what is solved is kept.
    --quick leaves out the next manoeuvre and the reports. --method has one of two published general methods
    answer in place of the diagnosis, to be scored beside it.
    """
    from bayesid.benchmark.protocol.solve_pack import SolveSettings, solve_pack
    from bayesid.executor import executor_of

    settings = SolveSettings(
        seed, plan_next=not quick, report=not quick, accept_faults=accept_faults, minutes=minutes,
        method=method,
    )  # fmt: skip
    commitment = solve_pack(pack, out, executor_of(executor, workers), settings, names=tuple(only or ()))
    if "seal" not in commitment:
        print(f"{len(commitment['verdicts'])} verdicts in {out}, not committed: only some were asked for")
        return OK
    print(f"{len(commitment['verdicts'])} verdicts in {out}, committed as {commitment['seal'][:16]}")
    if commitment["unsolved"]:
        print(f"{len(commitment['unsolved'])} bundles were not solved in time; the commitment lists them")
    for name, message in commitment["failures"].items():
        print(f"{name}: no verdict: {message}")
    return NOT_CONVERGED if commitment["failures"] else OK


def score(
    answers: Annotated[Path, typer.Argument(help="Folder of the answers, or a file of labels.")],
    verdicts: Annotated[Path, typer.Argument(help="Folder of the verdicts.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", file_okay=False, help="Folder for the report.", callback=claimed),
    ] = None,
    uncommitted: Annotated[
        bool, typer.Option("--uncommitted", help="Score verdicts without a commitment, whichever are there.")
    ] = False,
    digest: Annotated[
        str, typer.Option("--digest", help="Digest of the verdicts as made known; 16 digits or more.")
    ] = "",
    commitments: Annotated[
        Path | None, typer.Option("--commitments", help="commitments.json as whoever made the pack kept it.")
    ] = None,
    beside: Annotated[
        list[Path] | None,
        typer.Option("--beside", help="Verdicts of another method on the same pack; may be given again."),
    ] = None,
    executor: ExecutorName = None,
    workers: Workers = None,
    as_json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> int:
    """Score verdicts against answers; both commitments are checked first.

    A commitment proves something to whom it was made known: --digest and --commitments compare with what was
    kept apart from these folders. Detectability is computed from the seed of an answer that does not state
    it, and kept in --out. --beside lays other verdicts on the same bundles beside these in one table.
    """
    from bayesid.benchmark.protocol.beside import (
        COLUMNS,
        beside_section,
        method_cells,
        method_rows,
        scored_beside,
    )
    from bayesid.benchmark.protocol.report import blind_report, quantity_row, results
    from bayesid.benchmark.protocol.scorecard import score_pack
    from bayesid.cli.output import print_json, print_table, print_text
    from bayesid.executor import executor_of
    from bayesid.report import writer

    cache = None if out is None else out / "detectability.json"
    sheet = score_pack(
        answers, verdicts, uncommitted, cache, executor_of(executor, workers), promised=digest,
        commitments=commitments,
    )  # fmt: skip
    compared = scored_beside(sheet, verdicts, answers, beside or [], uncommitted, cache, commitments)
    plain = results(sheet)
    if len(compared) > 1:
        plain["beside"] = method_rows(compared)
    if out is not None:
        extra = [beside_section(compared)] if len(compared) > 1 else []
        writer.write(
            blind_report(sheet, extra), out, {"inputs": {"bundles": len(sheet.cases)}, "seeds": [], **plain}
        )
    if as_json:
        print_json(plain)
        return OK
    for dof, rows in sheet.quantities.items():
        print_text(f"{dof} degrees of freedom")
        print_table(
            ["quantity", "over", "score", "cases", "95 % interval", "bar", ""],
            [quantity_row(q) for q in rows],
            3,
        )
        print_text()
    if len(compared) > 1:
        print_table(COLUMNS, method_cells(compared), 3)
        print_text()
    control = f"{sheet.control.hits}/{sheet.control.count}"
    print_text(f"control that must fail: {control} right with verdicts of other bundles")
    if sheet.committed is None:
        print_text("not committed: a development score, no blind check")
    for sentence in sheet.caveats:
        print_text(sentence)
    for c in sheet.cases:
        if c.outcome not in ("right", "rejected"):
            answer = ", ".join(sorted(c.named)) or c.word
            print_text(f"{c.name}: {' + '.join(c.planted) or 'none'} -> {answer}: {c.outcome}; {c.reason}")
    return OK
