"""The bundles and answers of one edition: own equations, other equations, real logs with something taken.

Takes an edition and a folder. Writes SET/pack and SET/answers, and with the user's logs SET/logs_pack and
SET/logs_answers, which stay on that machine: the logs are not the project's to hand on.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import math
import tarfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.other_equations import UNLISTED
from bayesid.benchmark.protocol.commitment import (
    PACK_COMMITMENTS_FILE,
    SECRET,
    SECRET_BITS,
    derived,
    derived_salt,
    digest_of,
    read_json,
    secret_of,
)
from bayesid.benchmark.protocol.make_pack import NAME_DIGITS, commit_pack, make_pack, write_answer
from bayesid.benchmark.protocol.withheld_effect import withhold
from bayesid.executor import HERE, Executor
from bayesid.files import write_atomic
from bayesid.progress import Progress
from studies.benchmark_set.editions import Edition
from studies.other_equations.make import plan, write_campaign
from studies.other_equations.tune import PRIOR

LOGS = Path(__file__).parents[1] / "real_logs"
SMALL_SEED = 2**31


def make_set(
    edition: Edition,
    out: Path,
    data: Path | None = None,
    secret: Path | None = None,
    executor: Executor = HERE,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write an edition; what is there already is kept.

    Parameters
    ----------
    data : folder of the logs, for their part
    secret : file of the secret of an edition without a phrase

    Returns
    -------
    "pack" and "logs" -> bundle -> digests of answer and bundle
    """
    progress = progress or Progress()
    pack, answers = out / "pack", out / "answers"
    key = secret_for(edition, answers, secret)
    commitments = pack / PACK_COMMITMENTS_FILE
    names = [f"p{derived(key, 'name', k):032x}"[:NAME_DIGITS] for k in range(edition.own)]
    if not (commitments.exists() and set(names) <= set(read_json(commitments, "commitments")["bundles"])):
        make_pack(
            edition.own, pack, answers, partial(factors_of, edition), executor=executor, progress=progress
        )
    rows = plan(derived(key, "other equations", 0) % SMALL_SEED, edition.other)
    with progress.stage("other equations", len(rows)) as stage:
        for k, row in enumerate(rows):
            name = f"o{derived(key, 'other name', k):032x}"[:NAME_DIGITS]
            if not (answers / f"{name}.json").exists():
                make_other(row, name, pack, answers, derived_salt(key, name))
            names.append(name)
            stage.step(info=name)
    bits = 0 if edition.phrase else SECRET_BITS
    made = {
        "pack": read_json(commit_pack(pack, answers, names, bits, edition.made), "commitments")["bundles"]
    }
    if data is not None and edition.logs:
        there, told = out / "logs_pack", out / "logs_answers"
        for name, part in edition.logs.items():
            if not (told / f"{name}.json").exists():
                withhold(LOGS / part.source, part.what, there, told, data / part.source, name,
                         derived_salt(key, name))  # fmt: skip
        made["logs"] = read_json(there / PACK_COMMITMENTS_FILE, "commitments")["bundles"]
    return made


def secret_for(edition: Edition, answers: Path, secret: Path | None) -> bytes:
    """The secret of an edition, laid beside its answers: of its phrase, or of a file.

    Raises
    ------
    BlindError                 the file holds no secret as `blind make` writes them
    """
    text = digest_of(edition.phrase.encode()) if secret is None else secret.read_text("utf-8").strip()
    write_atomic(answers / SECRET, f"{text}\n".encode())
    return secret_of(answers)


def factors_of(edition: Edition, number: int, seed: int) -> dict[str, Any]:
    """Factors of one own campaign."""
    kind = edition.kinds[number % len(edition.kinds)]
    out: dict[str, Any] = {"kind": kind, **edition.factors}
    if kind in ("effect", "variant", "outside"):
        rng = np.random.default_rng([seed, 22])
        out["aim"] = float(np.exp(rng.uniform(*np.log(edition.aim))))
    return out


def make_other(row: Mapping[str, Any], name: str, pack: Path, answers: Path, salted: str) -> None:
    """One campaign of a vehicle with other equations, and its answer in the form of the plant's."""
    write_answer(answers / f"{name}.json", answer_of(write_campaign(row, name, pack / name)), salted)


def answer_of(told: Mapping[str, Any]) -> dict[str, Any]:
    """A label of `other_equations` as an answer; how plainly a cause shows is its D in pieces."""
    causes = [e for e in told["effects"] if e["name"] != "none"]
    outside = bool({e["name"] for e in causes} & set(UNLISTED))
    each = {e["name"]: e["D_pieces"] for e in told["D_each"] or ()}
    kind = "outside" if outside else ("none", "effect", "two")[len(causes)]
    form = {"variant": "", "kind": "outside" if outside else "effect", "size": math.nan}
    planted = [{"name": e["name"], **form, "parameters": e["params"]} for e in causes]
    shown = [{"name": e["name"], "noncentrality": each.get(e["name"], told["D_pieces"]), "absorbed": None,
              "margin": None, "rival": ""} for e in causes]  # fmt: skip
    return {
        "format": 1, "name": told["name"], "kind": kind, "effects": planted, "vehicle": told["vehicle"],
        "dof": 3, "sensors": told["channels"], "campaign": "other equations", "prior_relative_sd": PRIOR,
        "environment": {"sea": (told["sea"] or {"name": "still"})["name"]}, "coefficient_draw_relative": {},
        "detectability": shown, "label": dict(told),
    }  # fmt: skip


def archive(folder: Path, target: Path, inside: str) -> str:
    """Write a folder as .tar.gz whose bytes depend on its files only; gives its SHA-256."""
    buffer = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=buffer, mode="wb", mtime=0, filename="") as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        for path in sorted(p for p in folder.rglob("*") if p.is_file()):
            info = tarfile.TarInfo(f"{inside}/{path.relative_to(folder).as_posix()}")
            info.size, info.mode = path.stat().st_size, 0o644
            tar.addfile(info, io.BytesIO(path.read_bytes()))
    write_atomic(target, buffer.getvalue())
    return hashlib.sha256(buffer.getvalue()).hexdigest()
