"""Solve a blind pack: diagnose every bundle, write verdicts, commit to them.

Takes a pack (a folder of bundles, with commitments or without). Writes <bundle>/diagnosis.json with its
report, and seal.json. Refuses a pack in which an answer may be read. Does not know answers.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.commitment import (
    FORMAT,
    VERDICT_COMMITMENT_FILE,
    BlindError,
    digest_of_file,
    digest_of_folder,
    digest_of_record,
    read_json,
    versions,
)
from bayesid.benchmark.protocol.leak_check import check_pack
from bayesid.errors import BayesidError, raise_all
from bayesid.executor import HERE, Executor
from bayesid.files import write_json
from bayesid.progress import Progress

NOTE = "solved.json"
SPATIAL_COST = 13.0  # a 6-DOF bundle takes about this many times a planar one: for the time left only
DIAGNOSIS = "diagnosis"
Keep = Callable[[Any, Path], None]


@dataclass(frozen=True)
class SolveSettings:
    """How bundles are solved.

    Attributes
    ----------
    seed : of the bootstrap of the shrink
    plan_next : also rank manoeuvres to run next
    report : write report.html and figures beside each verdict
    keep : called with each diagnosis and its folder, to keep more of it; must not change the verdict
    accept_faults : commit although the program itself failed on some bundles or reports
    minutes : begin no bundle after this time and commit to what there is; the others are listed as not solved
    method : "diagnosis", or one of `general_methods.METHODS`, which writes no report and ranks no manoeuvre
    """

    seed: int = 0
    plan_next: bool = True
    report: bool = True
    keep: Keep | None = None
    accept_faults: bool = False
    minutes: float | None = None
    method: str = DIAGNOSIS

    @property
    def mode(self) -> str:
        """How a verdict is made, in words."""
        if self.method != DIAGNOSIS:
            from bayesid.benchmark.general_methods import methods_code

            return f"method {self.method}, {methods_code()}"
        return "with next manoeuvre" if self.plan_next else "without next manoeuvre"


def solve_pack(
    pack: Path,
    out: Path,
    executor: Executor = HERE,
    settings: SolveSettings | None = None,
    progress: Progress | None = None,
    names: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Diagnose every bundle of a pack and commit to the verdicts.

    Bundles already solved in `out` are kept. A bundle that cannot be read or diagnosed is listed in the
    commitment with its message and counts as unanswered; faults of the program are not committed unless
    accepted.

    Parameters
    ----------
    executor : where bundles are solved
    names : only these bundles; the verdicts are then not committed

    Returns
    -------
    dict                       what seal.json holds (no commitment where only some bundles were asked for)

    Raises
    ------
    BlindError                 an answer is readable in the pack, a bundle is missing or was changed, the
                               folder of verdicts lies within the pack, holds those of another pack or such as
                               were made with other code, seed or mode, or the program failed on a bundle
    """
    pack, out = pack.resolve(), out.resolve()
    if out == pack or pack in out.parents:
        raise BlindError(f"{out}: verdicts must not be written into the pack; choose another folder")
    settings, progress = settings or SolveSettings(), progress or Progress()
    check_method(settings.method)
    commitments = check_pack(pack)
    bundles = sorted(p.parent for p in pack.glob("*/trial.toml"))
    unknown = sorted(set(names) - {b.name for b in bundles})
    if unknown:
        raise BlindError(f"{pack}: no bundle {', '.join(unknown)}; there are {len(bundles)}")
    if names:
        bundles = [b for b in bundles if b.name in names]
    digests = {b.name: digest_of_folder(b) for b in bundles}
    _check_out(out, digests)
    now = versions()
    _check_same(bundles, out, settings, now)
    todo = [b for b in bundles if not _done(out / b.name, digests[b.name])]
    kept = len(bundles) - len(todo)
    if kept:
        progress.note(f"{kept} bundles are solved already and kept")
    started = datetime.now(UTC).isoformat(timespec="seconds")
    for bundle in todo:  # of a failed attempt: what is not tried again today counts as not solved
        (out / bundle.name / NOTE).unlink(missing_ok=True)
    _run(todo, out, digests, executor, settings, now, progress)
    _check_faults(bundles, out, settings.accept_faults)
    if versions() != now:
        raise BlindError("the program was changed while it solved; not committed; solve into another folder")
    if names:
        return {"verdicts": {b.name: digest_of_file(out / b.name / "diagnosis.json") for b in bundles
                             if (out / b.name / "diagnosis.json").exists()}}  # fmt: skip
    commitment = _commit(out, digests, commitments, now, started, settings)
    if settings.report and commitment["verdicts"]:
        _overview(out, commitment)
    return commitment


def check_method(method: str) -> None:
    """Refuse a method that is not there.

    Raises
    ------
    BlindError
        naming those that are
    """
    from bayesid.benchmark.general_methods import METHODS

    if method not in (DIAGNOSIS, *METHODS):
        raise BlindError(f"no method {method!r}; there are {', '.join((DIAGNOSIS, *METHODS))}")


def _check_out(out: Path, digests: dict[str, str]) -> None:
    if (out / VERDICT_COMMITMENT_FILE).exists():
        raise BlindError(f"{out}: holds committed verdicts; a committed folder is not written to again")
    for note in out.glob(f"*/{NOTE}"):
        name = note.parent.name
        if name in digests and read_json(note, "a note of `blind solve`").get("bundle") != digests[name]:
            raise BlindError(
                f"{name}: the verdict in {out} is of another bundle of this name; choose another folder"
            )


def _check_same(bundles: list[Path], out: Path, settings: SolveSettings, now: dict[str, str]) -> None:
    """Verdicts under one commitment are made by one program in one way; others are not taken over."""
    asked = {"versions": now, "seed": settings.seed, "mode": settings.mode}
    problems = []
    for name in sorted(b.name for b in bundles):
        if not (out / name / NOTE).exists():
            continue
        solved = read_json(out / name / NOTE, "a note of `blind solve`")
        if "verdict" in solved:
            problems += [f"{name}: solved with {key} {_short(solved.get(key))}, now {_short(value)}"
                         for key, value in asked.items() if solved.get(key) != value]  # fmt: skip
    if problems:
        problems.append("choose another folder, or delete these bundles from it to have them solved again")
        raise_all(BlindError, str(out), problems)


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in value.items())
    return "not told" if value is None else str(value)


def _done(folder: Path, digest: str) -> bool:
    note = folder / NOTE
    if not note.exists():
        return False
    solved = read_json(note, "a note of `blind solve`")
    if "verdict" not in solved:
        return False
    verdict = folder / "diagnosis.json"
    return solved["bundle"] == digest and verdict.exists() and digest_of_file(verdict) == solved["verdict"]


def _run(todo: list[Path], out: Path, digests: dict[str, str], executor: Executor, settings: SolveSettings,
         now: dict[str, str], progress: Progress) -> None:  # fmt: skip
    weight = {b.name: SPATIAL_COST if _spatial(b) else 1.0 for b in todo}
    # the long ones first, so that the last worker does not sit on one alone
    todo = sorted(todo, key=lambda b: (-weight[b.name], b.name))
    tasks = [(b, out / b.name, digests[b.name], settings, now) for b in todo]
    left, begun = sum(weight.values()), time.monotonic()
    with progress.stage("bundles", len(tasks)) as stage:
        for name, outcome in _results(tasks, executor, settings.minutes):
            left -= weight[name]
            share = sum(weight.values()) - left
            minutes = left * (time.monotonic() - begun) / share / 60.0
            stage.step(info=f"{name} {outcome}, about {minutes:.0f} min left")


def _check_faults(bundles: list[Path], out: Path, accepted: bool) -> None:
    solved = [b for b in bundles if (out / b.name / NOTE).exists()]
    notes = {b.name: read_json(out / b.name / NOTE, "a note of `blind solve`") for b in solved}
    faults = [f"{n}: {t.get('failure') or t.get('beside')}" for n, t in notes.items() if "trace" in t]
    if faults and not accepted:
        faults.append(
            "nothing is committed; run again when mended (what is solved is kept), or accept the faults"
        )
        raise_all(BlindError, f"the program failed on {len(faults) - 1} bundles", faults)


def _results(tasks: list[Any], executor: Executor, minutes: float | None) -> Iterator[tuple[str, str]]:
    """Names and words of verdicts as they come; none is begun after `minutes`."""
    last = None if minutes is None else time.monotonic() + 60.0 * minutes
    for _, result in executor.as_they_come(_solve_one, tasks, last):
        yield result


def _solve_one(task: tuple[Path, Path, str, SolveSettings, dict[str, str]]) -> tuple[str, str]:
    """Verdict of one bundle, written to disk; (name, what it says)."""
    bundle, folder, digest, settings, now = task
    from bayesid.benchmark.general_methods import METHODS
    from bayesid.diagnosis.input import checked_and_read
    from bayesid.diagnosis.of_log import diagnose_log
    from bayesid.equations.model import build_model
    from bayesid.model.vehicles import load_vehicle
    from bayesid.report.diagnosis.report import write_diagnosis_report
    from bayesid.report.input import check_record
    from bayesid.trials import load_trial
    from bayesid.trials.measured_wind import in_measured_wind

    folder.mkdir(parents=True, exist_ok=True)
    cpu, wall = time.process_time(), time.monotonic()
    note: dict[str, Any] = {"bundle": digest, "code": now["code"], "versions": now}
    note |= {"seed": settings.seed, "mode": settings.mode}
    outcome = "failed"
    try:
        trial = load_trial(bundle)
        model = build_model(in_measured_wind(load_vehicle(trial.vehicle_ref), trial), trial.dof)
        found = None
        if settings.method == DIAGNOSIS:
            found, checked = diagnose_log(trial, model, seed=settings.seed, plan_next=settings.plan_next)
            record = {**found.result.record(), "input": check_record(checked)}
        else:
            trial, _ = checked_and_read(trial, model)
            record = METHODS[settings.method].verdict(trial, model, settings.seed)
        note |= {"cpu_seconds": time.process_time() - cpu, "wall_seconds": time.monotonic() - wall}
        verdict = write_json(folder / "diagnosis.json", record)
        note |= {"verdict": digest_of_file(verdict), "dof": trial.dof}
        note |= {"simulated_seconds": float(sum(r.t[-1] - r.t[0] for r in trial.runs))}
        outcome = record["verdict"]
        if settings.report and found is not None:
            write_diagnosis_report(found.result, folder)
        if settings.keep is not None and found is not None:
            settings.keep(found, folder)
    except BayesidError as error:
        note |= {_failed(note): str(error)}
    except Exception as error:  # one bundle must not cost the others theirs
        trace = traceback.format_exc(limit=-3)
        note |= {_failed(note): f"{type(error).__name__}: {error}", "trace": trace}
    write_json(folder / NOTE, note)
    return bundle.name, outcome


def _failed(note: dict[str, Any]) -> str:
    """A verdict that is written stands, whatever its report comes to."""
    return "beside" if "verdict" in note else "failure"


def _spatial(bundle: Path) -> bool:
    """Whether a bundle looks like 6-DOF, from its header only."""
    head = ""
    for first in sorted(bundle.glob("*.csv"))[:1]:
        with first.open(encoding="utf-8", errors="replace") as stream:
            head = stream.readline()
    stated = (bundle / "trial.toml").read_text("utf-8", errors="replace")
    return "dof = 6" in stated or ("z[" in head and "dof = 3" not in stated)


def _overview(out: Path, commitment: dict[str, Any]) -> None:
    """report.md and report.html of all verdicts beside the commitment."""
    from bayesid.benchmark.protocol.verdict_table import verdicts_report
    from bayesid.report import writer

    verdicts = {n: read_json(out / n / "diagnosis.json", "a verdict") for n in commitment["verdicts"]}
    writer.write(
        verdicts_report(commitment, verdicts),
        out,
        {"inputs": commitment["pack"], "seeds": [], "seal": commitment["seal"]},
    )


def _commit(out: Path, digests: dict[str, str], commitments: dict[str, Any] | None, now: dict[str, str],
          started: str, settings: SolveSettings) -> dict[str, Any]:  # fmt: skip
    unsolved = sorted(name for name in digests if not (out / name / NOTE).exists())
    for name in unsolved:  # what a stop left behind is no verdict
        (out / name / "diagnosis.json").unlink(missing_ok=True)
    notes = {n: read_json(out / n / NOTE, "a note of `blind solve`") for n in digests if n not in unsolved}
    verdicts = {n: t["verdict"] for n, t in notes.items() if "verdict" in t}
    keys = ("cpu_seconds", "wall_seconds", "simulated_seconds", "dof", "code", "beside")
    commitment = {
        "format": FORMAT,
        "versions": now,
        "seed": settings.seed,
        "mode": settings.mode,
        "started": started,
        "sealed": datetime.now(UTC).isoformat(timespec="seconds"),
        "pack": {"bundles": digests, "commitments": commitments},
        "verdicts": verdicts,
        "unsolved": unsolved,
        "failures": {n: t["failure"] for n, t in notes.items() if "verdict" not in t},
        "cost": {n: {k: t[k] for k in keys if k in t} for n, t in notes.items()},
    }
    written = read_json(
        write_json(out / VERDICT_COMMITMENT_FILE, commitment), "the commitment"
    )  # as whoever checks it will read it
    commitment = {**written, "seal": digest_of_record(written)}
    write_json(out / VERDICT_COMMITMENT_FILE, commitment)
    return commitment
