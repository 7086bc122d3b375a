"""Blind packs: bundles for whoever is to find out, committed answers for whoever is to judge.

Takes a count and factors of the plant. Writes bundles and their commitments into one folder, answers and the
secret they are drawn from into another. Does not diagnose.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bayesid.benchmark.plant import draw_campaign, truth, write_bundle
from bayesid.benchmark.protocol.commitment import (
    FORMAT,
    PACK_COMMITMENTS_FILE,
    SECRET_BITS,
    BlindError,
    derived,
    derived_salt,
    digest_of_file,
    digest_of_folder,
    read_json,
    salt,
    secret_of,
)
from bayesid.benchmark.protocol.detectability import Detectability, detectability
from bayesid.errors import BayesidError
from bayesid.executor import HERE, Executor
from bayesid.files import write_json
from bayesid.progress import Progress

# Sizes, in reference magnitudes, a cause may be brought to: a fiftieth is of no consequence, 1.5 is a lot.
SIZE_RANGE, SIZE_TO_START = (0.02, 1.5), 0.2
NAME_DIGITS = 13  # of a bundle's name, prefix included: 48 bits do not meet twice in a pack


def make_pack(
    count: int,
    out: Path,
    answers: Path,
    factors: Mapping[str, Any] | Callable[[int, int], Mapping[str, Any]] | None = None,
    prefix: str = "p",
    executor: Executor = HERE,
    progress: Progress | None = None,
    seeds: Sequence[int] | None = None,
) -> Path:
    """Write `count` bundles into `out` and one answer each into `answers`, then the commitments.

    Campaigns and names come from the secret in `answers`. Bundles that are there with their answer are kept,
    so that a broken run can be resumed.

    Parameters
    ----------
    factors : what is fixed in `plant.draw_campaign`, or a function of a campaign's number and seed; the
        rest is drawn. "aim" is the noncentrality to which the size of the planted causes is brought
    seeds : of the campaigns, for development: whoever knows them can rebuild the pack, and its commitments
        say so

    Returns
    -------
    path of the commitments

    Raises
    ------
    BlindError                 one folder lies within the other, or the pack is committed already
    """
    out, answers = out.resolve(), answers.resolve()
    if out == answers or out in answers.parents or answers in out.parents:
        raise BlindError("answers must be in a folder of their own, not within the pack or around it")
    if (out / PACK_COMMITMENTS_FILE).exists():
        raise BlindError(f"{out}: is a finished pack already; choose another folder")
    if seeds is not None and len(seeds) != count:
        raise BlindError(f"{len(seeds)} seeds for {count} bundles")
    secret = secret_of(answers)
    drawn = list(seeds) if seeds is not None else [derived(secret, "campaign", k) for k in range(count)]
    names = [f"{prefix}{derived(secret, 'name', k):032x}"[:NAME_DIGITS] for k in range(count)]
    given: Mapping[str, Any] = {} if callable(factors) else factors or {}
    given_factors = [factors(k, seed) if callable(factors) else given for k, seed in enumerate(drawn)]
    tasks = [
        (seed, name, out, answers, dict(some), derived_salt(secret, name))
        for seed, name, some in zip(drawn, names, given_factors, strict=True)
    ]
    progress = progress or Progress()
    with progress.stage("bundles", len(tasks)) as stage:
        for name in executor.in_order(_make_one, tasks):
            stage.step(info=name)
    return commit_pack(out, answers, names, SECRET_BITS if seeds is None else 0)


def commit_pack(out: Path, answers: Path, names: Iterable[str], secret_bits: int | None = None,
                made: str = "") -> Path:  # fmt: skip
    """Publish the fingerprints of answers and bundles in the pack.

    Parameters
    ----------
    secret_bits : what somebody would have to guess to draw the campaigns again; None where they are no
        drawings but logs, or where the pack said it before
    made : when, by default now
    """
    path = out / PACK_COMMITMENTS_FILE
    if secret_bits is None and path.exists():
        secret_bits = read_json(path, "the commitments").get("secret_bits")
    secrets_given = {} if secret_bits is None else {"secret_bits": secret_bits}
    bundles = {
        name: {"answer": digest_of_file(answers / f"{name}.json"), "bundle": digest_of_folder(out / name)}
        for name in sorted(names)
    }
    made = made or datetime.now(UTC).isoformat(timespec="seconds")
    commitments = {"format": FORMAT, "made": made, **secrets_given, "bundles": bundles}
    write_json(answers / PACK_COMMITMENTS_FILE, commitments)  # for whoever scores
    write_json(path, commitments)
    _one_time(out)
    return path


def _one_time(pack: Path) -> None:
    """All files of a pack as old as each other: making a bundle with a cause takes longer."""
    now = time.time_ns() // 10**9 * 10**9
    for place in (*pack.rglob("*"), pack):
        os.utime(place, ns=(now, now))


def _make_one(task: tuple[int, str, Path, Path, dict[str, Any], str]) -> str:
    seed, name, out, answers, factors, salted = task
    if (answers / f"{name}.json").exists() and (out / name / "trial.toml").exists():
        return name
    for stale in (out / name).glob("*"):  # of a run that was stopped within this bundle
        stale.unlink()
    given = {key: value for key, value in factors.items() if key != "aim"}
    if "aim" in factors:
        given["sizes"] = aimed_sizes(seed, given, float(factors["aim"]))
    campaign = draw_campaign(seed, **given)
    shown = [asdict(d) for d in detectability(campaign)]
    answer = write_bundle(campaign, out / name)
    write_answer(answers / f"{name}.json", answer | {"factors": given, "detectability": shown}, salted)
    return name


def aimed_sizes(seed: int, factors: Mapping[str, Any], aim: float) -> tuple[float, float]:
    """Size, as a range of one value, at which the plainest cause has about the noncentrality asked for.

    Noncentrality goes with the square of a small size: one step from a middling one, kept within SIZES.
    """
    campaign = draw_campaign(seed, **{**factors, "sizes": (SIZE_TO_START, SIZE_TO_START)})
    found = max((d.noncentrality for d in detectability(campaign, rivals=False)), default=0.0)
    size = SIZE_TO_START * math.sqrt(aim / found) if found > 0.0 else SIZE_RANGE[1]
    size = min(max(size, SIZE_RANGE[0]), SIZE_RANGE[1])
    return size, size


def write_answer(path: Path, answer: Mapping[str, Any], salted: str = "") -> Path:
    """Write an answer with a salt, by default a fresh one."""
    return write_json(path, {"salt": salted or salt(), **answer})


def redraw(answer: Mapping[str, Any]) -> tuple[Detectability, ...] | None:
    """Detectability of an answer that does not state it, from its seed; None if the plant has changed since.

    The campaign is drawn again and must be true to the answer in everything.
    """
    keys = ("seed", "attempt", "effects", "coefficient_draw_relative", "environment", "noise", "runs")
    if any(key not in answer for key in keys):
        return None
    try:
        campaign = draw_campaign(int(answer["seed"]), **answer.get("factors", {}))
        again = json.loads(json.dumps(truth(campaign, str(answer["name"]))))
        if any(again[key] != answer[key] for key in keys):
            return None
        return detectability(campaign)
    except (BayesidError, TypeError, ValueError):
        return None
