"""Whether a pack is whole and silent: every bundle that was announced, and no answer anybody could read.

Takes the folder of a pack. Raises one error that lists everything wrong. Does not diagnose.
"""

from __future__ import annotations

import csv
import re
import tomllib
from pathlib import Path
from typing import Any

from bayesid.benchmark.protocol.cause_families import CATALOGUE_NAMES
from bayesid.benchmark.protocol.commitment import (
    FORMAT,
    FORMATS,
    PACK_COMMITMENTS_FILE,
    BlindError,
    digest_of_file,
    digest_of_folder,
    read_json,
    unprintable,
)
from bayesid.errors import raise_all
from bayesid.model.channels import is_channel
from bayesid.model.vehicles import schema as vehicle_schema
from bayesid.trials import schema as trial_schema
from bayesid.trials.stated import KEYS, RUN_KEYS

READABLE_SUFFIXES = {".toml", ".csv"}
SCHEMAS = {trial_schema.FILE: trial_schema.text, vehicle_schema.FILE: vehicle_schema.text}
# Keys by which makers of packs write down what they planted, and names no log or vehicle file has use for.
TELLING_KEYS = ("coefficient_draw", "coefficients_off", '"label"', '"effects"', '"planted"', "evidence_class")
TELLING_WORDS = tuple(n for n in CATALOGUE_NAMES if "_" in n) + (
    "bank_suction",
    "vortex_shedding",
    "hull_moment",
)


def check_pack(pack: Path) -> dict[str, Any] | None:
    """Check a pack before anything is solved.

    Returns
    -------
    the commitments, or None for a folder of bundles without

    Raises
    ------
    BlindError                 no bundles, a bundle missing or changed, or something that may be an answer
    """
    if not pack.is_dir():
        raise BlindError(f"{pack}: is no folder; a pack is a folder of trial bundles")
    bundles = {p.parent.name: p.parent for p in pack.glob("*/trial.toml")}
    if not bundles:
        raise BlindError(f"{pack}: no bundle (a folder with trial.toml) in this pack")
    content = (
        read_json(pack / PACK_COMMITMENTS_FILE, "the commitments")
        if (pack / PACK_COMMITMENTS_FILE).exists()
        else None
    )
    problems = _leaks(pack, content) + _hidden(pack)
    if isinstance(content, dict) and content.get("format") == FORMAT:
        named = {problem.split(": ")[0] for problem in problems}
        problems += [p for p in _needless(pack, bundles) if p.split(": ")[0] not in named]
    if content is not None:
        problems += _missing(bundles, content)
    if problems:
        raise_all(BlindError, str(pack), problems)
    return content


def _missing(bundles: dict[str, Path], content: Any) -> list[str]:
    announced = content.get("bundles") if isinstance(content, dict) else None
    if not isinstance(announced, dict) or content.get("format") not in FORMATS:
        return [f"{PACK_COMMITMENTS_FILE}: is of none of the formats {FORMATS}; ask for the pack again"]
    out = [f"incomplete: bundle {n} is announced but missing" for n in sorted(set(announced) - set(bundles))]
    out += [f"bundle {n} was not announced" for n in sorted(set(bundles) - set(announced))]
    out += [
        f"bundle {n} was changed after the pack was committed"
        for n in sorted(set(bundles) & set(announced))
        if digest_of_folder(bundles[n]) != announced[n].get("bundle")
    ]
    return out


def _leaks(pack: Path, content: Any) -> list[str]:
    committed = set()
    if isinstance(content, dict) and isinstance(content.get("bundles"), dict):
        committed = {entry.get("answer") for entry in content["bundles"].values() if isinstance(entry, dict)}
    out = []
    for path in sorted(pack.rglob("*")):
        if path.is_dir() and not path.is_symlink():
            continue
        name = path.relative_to(pack).as_posix()
        if name == PACK_COMMITMENTS_FILE:
            continue
        if path.is_symlink():
            out.append(f"{name}: is a link out of the pack; put the file itself there")
        elif digest_of_file(path) in committed:
            out.append(f"{name}: is a committed answer; take it out of the pack unread")
        elif _schema(path):
            continue
        elif path.suffix.lower() not in READABLE_SUFFIXES:
            out.append(f"{name}: may hold an answer; a pack holds .toml and .csv files only")
        else:
            found = _telling(path)
            if found:
                out.append(f"{name}: holds {found!r}, which belongs into an answer; take it out of the pack")
    return out


def _hidden(pack: Path) -> list[str]:
    """Names of files, trials and manoeuvres with characters that are not seen."""
    out = [
        f"{path.relative_to(pack).as_posix()!r}: holds a control character in its name"
        for path in sorted(pack.rglob("*"))
        if unprintable(path.name)
    ]
    for file in sorted(pack.glob("*/trial.toml")):
        content = _toml(file)
        runs = [run for run in content.get("runs", ()) if isinstance(run, dict)]
        texts = [
            content.get("name", ""),
            *(run.get(key, "") for run in runs for key in ("file", "manoeuvre")),
        ]
        bad = [text for text in texts if isinstance(text, str) and unprintable(text)]
        out += [f"{file.parent.name}/trial.toml: {text!r} holds a control character" for text in bad]
    return out


def _toml(file: Path) -> dict[str, Any]:
    """Content of a TOML file, nothing where it is none: the diagnosis will say so."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return {}


def _needless(pack: Path, bundles: dict[str, Path]) -> list[str]:
    """Files and columns no diagnosis reads; only what a bundle names is needed."""
    needed = {pack / PACK_COMMITMENTS_FILE}
    out: list[str] = []
    for folder in bundles.values():
        content = _toml(folder / "trial.toml")
        strange = ", ".join(map(repr, _keys(content)))
        if strange:
            out.append(f"{folder.name}/trial.toml: holds {strange}; a diagnosis reads no such key")
        runs = [r.get("file") for r in content.get("runs", ()) if isinstance(r, dict)]
        files = [folder / name for name in runs if isinstance(name, str)]
        needed |= {folder / "trial.toml", folder / "vehicle.toml", *files}
        renamed = content.get("columns")
        named = {str(v) for v in renamed.values()} if isinstance(renamed, dict) else set()
        for file in files:
            extra = _columns(file, named)
            if extra:
                out.append(f"{file.relative_to(pack).as_posix()}: {extra}; a diagnosis reads no such column")
    for path in sorted(pack.rglob("*")):
        name = path.relative_to(pack).as_posix()
        if path.is_file() and path not in needed and not _schema(path):
            out.append(f"{name}: belongs to no bundle; take it out of the pack")
        elif path.suffix == ".toml" and _has_comment(path):
            out.append(f"{name}: holds comments")
    return out


def _keys(content: dict[str, Any]) -> list[str]:
    """Keys of trial.toml that a diagnosis does not read."""
    runs = [run for run in content.get("runs", ()) if isinstance(run, dict)]
    return [k for k in content if k not in KEYS] + [k for run in runs for k in run if k not in RUN_KEYS]


def _has_comment(file: Path) -> bool:
    """Whether a line of a TOML file is a comment, or ends in one outside quotes; a line naming this version's
    schema is none."""
    named = {f"#:schema ./{name}" for name in SCHEMAS}
    for line in file.read_text(encoding="utf-8-sig", errors="replace").splitlines():
        if line.strip() not in named and "#" in re.sub(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'', "", line):
            return True
    return False


def _columns(file: Path, named: set[str]) -> str:
    """Words about a comment or columns a trial has no name for, "" where there are none."""
    try:
        with file.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            header = next(csv.reader(stream), [])
            comment = bool(header) and header[0].lstrip().startswith("#")
            if comment or any(line.lstrip().startswith("#") for line in stream):
                return "holds comments"
    except (OSError, csv.Error):
        return ""
    names = [text.split("[")[0].strip() for text in header if text.strip() not in named]
    strange = [n for n in names if n != "t" and not is_channel(n)]
    return f"holds {', '.join(map(repr, strange))}" if strange else ""


def _schema(path: Path) -> bool:
    """Whether it is the JSON Schema of this version, word for word; commands write it beside their files."""
    text = SCHEMAS.get(path.name)
    try:
        return text is not None and path.read_text(encoding="utf-8") == text()
    except (OSError, ValueError):
        return False


def _telling(path: Path) -> str:
    text = path.read_text(encoding="utf-8", errors="replace")
    if path.suffix.lower() == ".csv":
        # numbers tell nothing; letters stand in the header and in comments
        text = "\n".join(
            line for line in text.splitlines() if any(c.isalpha() and c not in "eEnNaA" for c in line)
        )
    return next((word for word in (*TELLING_KEYS, *TELLING_WORDS) if word in text), "")
