"""Sealed verdicts read back and checked against their seal and against the commitments they answer.

Takes the folder of verdicts and the answers. Gives plain verdicts. Raises one error with everything broken.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.blind.answers import Answer
from bayesid.blind.seal import (
    FORMAT,
    SEAL,
    BlindError,
    digest_of_file,
    digest_of_list,
    read_json,
)
from bayesid.errors import raise_all


def load_verdicts(folder: Path) -> dict[str, dict[str, Any]]:
    """Every <bundle>/diagnosis.json of a folder, sealed or not.

    Raises
    ------
    BlindError                 one is no diagnosis
    """
    found = {}
    for file in sorted(folder.glob("*/diagnosis.json")):
        verdict = read_json(file, "a verdict")
        keys = {"verdict", "effects", "set95", "probabilities"}
        if not isinstance(verdict, dict) or not keys <= set(verdict):
            raise BlindError(f"{file.parent.name}/diagnosis.json: is no diagnosis of format 1")
        found[file.parent.name] = verdict
    return found


def check_seals(folder: Path, answers: Mapping[str, Answer]) -> dict[str, Any]:
    """Check that no verdict was changed after its seal and no answer after its commitment.

    Returns
    -------
    what the seal says

    Raises
    ------
    BlindError                 listing everything that does not fit
    """
    if not (folder / SEAL).exists():
        raise BlindError(
            f"{folder}: holds no {SEAL}, so these verdicts may have been written with the answers at hand; "
            "solve with `bayesid blind solve`, or score unsealed verdicts with --unsealed"
        )
    seal = read_json(folder / SEAL, "a seal")
    if not isinstance(seal, dict) or seal.get("format") != FORMAT:
        raise BlindError(f"{folder / SEAL}: is no seal of format {FORMAT}")
    problems = [*_verdicts(folder, seal), *_answers(seal, answers)]
    if problems:
        raise_all(BlindError, str(folder), problems)
    return seal


def _verdicts(folder: Path, seal: Mapping[str, Any]) -> list[str]:
    listed: Mapping[str, str] = seal["verdicts"]
    out = []
    if digest_of_list(listed) != seal["seal"]:
        out.append("the seal is broken: its list of verdicts was changed")
    present = {p.parent.name for p in folder.glob("*/diagnosis.json")}
    for name in sorted(set(listed) - present):
        out.append(f"{name}: the sealed verdict is missing")
    for name in sorted(present - set(listed)):
        out.append(f"{name}: a verdict was added after the seal")
    for name in sorted(present & set(listed)):
        if digest_of_file(folder / name / "diagnosis.json") != listed[name]:
            out.append(f"{name}: the verdict was changed after the seal")
    told = {*listed, *seal.get("failures", {}), *seal.get("unsolved", ())}
    unanswered = set(seal["pack"]["bundles"]) - told
    out += [f"{name}: no verdict, the pack is not solved completely" for name in sorted(unanswered)]
    return out


def _answers(seal: Mapping[str, Any], answers: Mapping[str, Answer]) -> list[str]:
    bundles = set(seal["pack"]["bundles"])
    out = [f"{name}: no answer for this bundle" for name in sorted(bundles - set(answers))]
    commitments = seal["pack"].get("commitments")
    if commitments is None:
        return out
    for name in sorted(bundles & set(answers)):
        promised = commitments["bundles"].get(name, {}).get("answer")
        if answers[name].digest != promised:
            out.append(f"{name}: the answer is not the one that was sealed with the pack")
    return out
