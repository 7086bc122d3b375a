"""Committed verdicts read back and checked against their commitment and those of the answers.

Takes the folder of verdicts and the answers. Gives plain verdicts. Raises one error with everything broken.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.answers import Answer
from bayesid.benchmark.protocol.commitment import (
    ENOUGH_BITS,
    FORMAT,
    FORMATS,
    VERDICT_COMMITMENT_FILE,
    BlindError,
    digest_of_file,
    digest_of_list,
    digest_of_record,
    read_json,
)
from bayesid.errors import raise_all


def load_verdicts(folder: Path) -> dict[str, dict[str, Any]]:
    """Every <bundle>/diagnosis.json of a folder, committed or not.

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


SHORTEST = 16  # digits of a commitment somebody may quote


def check_commitments(
    folder: Path, answers: Mapping[str, Answer], promised: str = "", commitments: Path | None = None
) -> dict[str, Any]:
    """Check that no verdict and no answer was changed after it was committed.

    Parameters
    ----------
    promised : digest of the commitment as it was made known, or its first 16 digits or more
    commitments : the file as whoever made the pack kept it

    Returns
    -------
    what the commitment says

    Raises
    ------
    BlindError                 listing everything that does not fit
    """
    if not (folder / VERDICT_COMMITMENT_FILE).exists():
        raise BlindError(
            f"{folder}: holds no {VERDICT_COMMITMENT_FILE}, so these verdicts may have been written with "
            f"the answers at hand; "
            "solve with `bayesid blind solve`, or score uncommitted verdicts with --uncommitted"
        )
    commitment = read_json(folder / VERDICT_COMMITMENT_FILE, "a commitment")
    if not isinstance(commitment, dict) or commitment.get("format") not in FORMATS:
        raise BlindError(
            f"{folder / VERDICT_COMMITMENT_FILE}: is a commitment of none of the formats {FORMATS}"
        )
    problems = [
        *_made_known(commitment, promised, commitments),
        *_verdicts(folder, commitment),
        *_answers(commitment, answers),
    ]
    if problems:
        raise_all(BlindError, str(folder), problems)
    return commitment


def caveats(commitment: Mapping[str, Any]) -> tuple[str, ...]:
    """What a committed score does not prove, in sentences; empty where pack and commitment are of the present
    kind."""
    out = []
    committed = commitment["pack"].get("commitments")
    if committed is None:
        out.append("The pack had no commitments: that the answers are those of its bundles rests on a word.")
    elif committed.get("format") != FORMAT:
        out.append(
            "The pack is of the old kind: the names of its bundles carry the seed, and whoever has the "
            "program "
            "could have rebuilt bundles and answers from it."
        )
    elif committed.get("secret_bits", ENOUGH_BITS) < ENOUGH_BITS:
        out.append("The pack was drawn from seeds, not from a secret: whoever knows them can rebuild it.")
    if commitment.get("format") != FORMAT:
        out.append(
            "The commitment is of the old kind: it covers the list of verdicts, not failures or versions."
        )
    return tuple(out)


def _made_known(commitment: Mapping[str, Any], promised: str, commitments: Path | None) -> list[str]:
    """What differs from the commitment and the commitments that were kept apart from these folders."""
    out = []
    wanted = promised.strip().lower()
    if wanted and (len(wanted) < SHORTEST or not str(commitment["seal"]).startswith(wanted)):
        short = f"; give at least {SHORTEST} digits of it" if len(wanted) < SHORTEST else ""
        out.append(f"the commitment is {commitment['seal'][:SHORTEST]}, not {wanted} as made known{short}")
    if commitments is not None:
        kept = read_json(commitments, "the commitments")
        if kept != commitment["pack"].get("commitments"):
            out.append(f"the verdicts answer other commitments than those of {commitments.name}")
    return out


def _verdicts(folder: Path, commitment: Mapping[str, Any]) -> list[str]:
    listed: Mapping[str, str] = commitment["verdicts"]
    out = []
    if commitment["format"] == FORMAT:
        whole = digest_of_record({k: v for k, v in commitment.items() if k != "seal"}) == commitment["seal"]
    else:
        whole = digest_of_list(listed) == commitment["seal"]
    if not whole:
        out.append("the commitment is broken: what it lists was changed")
    lists = {
        "solved": listed,
        "failed": commitment.get("failures", {}),
        "not solved": commitment.get("unsolved", ()),
    }
    every = [(name, word) for word, some in lists.items() for name in some]
    for name in sorted({n for n, _ in every}):
        words = [word for n, word in every if n == name]
        if len(words) > 1:
            out.append(f"{name}: is listed as {' and as '.join(words)}")
        if name not in commitment["pack"]["bundles"]:
            out.append(f"{name}: is listed as {words[0]} and is no bundle of the pack")
    present = {p.parent.name for p in folder.glob("*/diagnosis.json")}
    for name in sorted(set(listed) - present):
        out.append(f"{name}: the committed verdict is missing")
    for name in sorted(present - set(listed)):
        out.append(f"{name}: a verdict was added after the commitment")
    for name in sorted(present & set(listed)):
        if digest_of_file(folder / name / "diagnosis.json") != listed[name]:
            out.append(f"{name}: the verdict was changed after the commitment")
    answered = {*listed, *commitment.get("failures", {}), *commitment.get("unsolved", ())}
    unanswered = set(commitment["pack"]["bundles"]) - answered
    out += [f"{name}: no verdict, the pack is not solved completely" for name in sorted(unanswered)]
    return out


def _answers(commitment: Mapping[str, Any], answers: Mapping[str, Answer]) -> list[str]:
    bundles = set(commitment["pack"]["bundles"])
    out = [f"{name}: no answer for this bundle" for name in sorted(bundles - set(answers))]
    commitments = commitment["pack"].get("commitments")
    if commitments is None:
        return out
    for name in sorted(bundles & set(answers)):
        promised = commitments["bundles"].get(name, {}).get("answer")
        if answers[name].digest != promised:
            out.append(f"{name}: the answer is not the one that was committed with the pack")
    return out
