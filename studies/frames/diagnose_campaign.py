"""A campaign of the plant diagnosed and judged on the spot: for studies that compare ways of asking.

Takes a `plant.Campaign`, whose truth is known. Gives judged verdicts as plain data, one file per task. Does
not commit: packs (`make_pack`, `solve_pack`) are for checks in which nobody may know the answer; here the
diagnosis alone does not.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from bayesid.benchmark.plant import Campaign, write_bundle
from bayesid.benchmark.protocol.answers import load_answers
from bayesid.benchmark.protocol.detectability import Detectability, detectability
from bayesid.benchmark.protocol.judgement import ScoredCase, judge
from bayesid.benchmark.protocol.make_pack import SIZE_RANGE, SIZE_TO_START, write_answer
from bayesid.code import code_digest
from bayesid.diagnosis.input import as_read
from bayesid.diagnosis.run import Diagnosis, diagnose
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.executor import Executor
from bayesid.files import write_json
from bayesid.model.vehicles import load_vehicle
from bayesid.progress import Progress
from bayesid.trials import load_trial

LEAST_SIZE = 0.1 * SIZE_RANGE[0]  # sizes below this are of no consequence anywhere


@dataclass(frozen=True, eq=False)
class DiagnosedCampaign:
    """A judged verdict with the diagnosis behind it (None: it failed, and `failure` says how)."""

    case: ScoredCase
    verdict: Mapping[str, Any] | None
    diagnosis: Diagnosis | None
    failure: str = ""


def aimed(make: Callable[[float], Campaign], aim: float) -> Campaign:
    """Campaign of the size at which its plainest cause has about the noncentrality asked for.

    Noncentrality goes with the square of a small size: one step from a middling size, kept within limits.

    Parameters
    ----------
    make : campaign of a size, in reference magnitudes
    """
    found = max((d.noncentrality for d in detectability(make(SIZE_TO_START), rivals=False)), default=0.0)
    size = SIZE_TO_START * math.sqrt(aim / found) if found > 0.0 else SIZE_RANGE[1]
    return make(min(max(size, LEAST_SIZE), SIZE_RANGE[1]))


def identify_only(campaign: Campaign) -> Campaign:
    """Without its held-out runs, which no verdict reads and which are executed last."""
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.role == "identify"))


def diagnose_campaign(
    campaign: Campaign, shown: Sequence[Detectability], as_built: float | None = None, plan_next: bool = False
) -> DiagnosedCampaign:
    """Write the bundle, read it back, diagnose, judge.

    Parameters
    ----------
    shown : how plainly each cause shows in the frame it is judged in
    as_built, plan_next : see `diagnose`
    """
    failure, verdict, found = "", None, None
    with TemporaryDirectory() as place:
        bundle, answers = Path(place) / "bundle", Path(place) / "answers"
        truth = write_bundle(campaign, bundle, "campaign")
        write_answer(answers / "campaign.json", truth | {"detectability": [asdict(s) for s in shown]})
        answer = load_answers(answers)["campaign"]
        begun = time.process_time()
        try:
            trial = load_trial(bundle)
            model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
            found = diagnose(as_read(trial, model), model, as_built=as_built, plan_next=plan_next)
            verdict = found.result.record()
        except BayesidError as error:
            failure = str(error)
        except (
            Exception
        ) as error:  # counts as unanswered, as in a committed pack; one campaign must not end all
            failure = f"{type(error).__name__}: {error}"
        spent = time.process_time() - begun
    return DiagnosedCampaign(judge(answer, verdict, spent), verdict, found, failure)


def plain(asked: DiagnosedCampaign) -> dict[str, Any]:
    """What a report needs of a judged verdict."""
    c, record = asked.case, asked.verdict or {}
    own = {n: record.get("detectability", {}).get(n, {}).get("absorbed") for n in c.planted}
    best = dict(sorted(record.get("probabilities", {}).items(), key=lambda kv: -kv[1])[:4])
    return {
        "word": c.word,
        "named": sorted(c.named),
        "top": c.top,
        "stated": c.stated,
        "right": c.top in c.right,
        "p_right": c.p_right,
        "set": list(record.get("set95", ())),
        "size": c.size,
        "covered": c.covered,
        "names_it": bool(c.named & c.right),
        "outcome": c.outcome,
        "reason": c.reason,
        "alone": asked.case.worst_absorbed,
        "absorbed_by_own_account": own,
        "probabilities": best,
        "hidden": list(record.get("hidden_by_coefficients", ())),
        "cpu_seconds": c.cost,
        "failure": asked.failure,
    }


class Task(Protocol):
    """A piece of work with a name of its own."""

    @property
    def name(self) -> str: ...


def kept(
    work: Callable[[Any], dict[str, Any]],
    tasks: Sequence[Any],
    folder: Path,
    executor: Executor,
    progress: Progress,
    title: str,
) -> list[dict[str, Any]]:
    """Results of all tasks in their order; those that are in the folder already are not computed again."""
    todo = [task for task in tasks if not _file(folder, task).exists()]
    with progress.stage(title, len(todo)) as stage:
        for name in executor.in_order(partial(_keep, work, folder), todo):
            stage.step(info=name)
    return [json.loads(_file(folder, task).read_text("utf-8")) for task in tasks]


def _keep(work: Callable[[Any], dict[str, Any]], folder: Path, task: Task) -> str:
    write_json(_file(folder, task), {"name": task.name, "code": code_digest()} | work(task))
    return task.name


def _file(folder: Path, task: Task) -> Path:
    return folder / f"{task.name}.json"
