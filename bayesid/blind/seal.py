"""Seals: fingerprints by which answers and verdicts prove that nobody changed them afterwards.

Takes files and folders. Gives SHA-256 digests and lists of what does not fit. Does not read their content.

An answer holds a random salt, so that its published fingerprint cannot be found by trying likely answers.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.errors import BayesidError

COMMITMENTS = "commitments.json"  # in a pack: fingerprints of the answers and of the bundles
SEAL = "seal.json"  # beside verdicts: their fingerprints, versions and the commitments they answer
FORMAT = 1


class BlindError(BayesidError):
    """A blind check cannot go on: a seal is broken, an answer leaked, a pack or a verdict is missing."""


def salt() -> str:
    """32 hexadecimal digits nobody can guess."""
    return secrets.token_hex(16)


def digest_of(content: bytes) -> str:
    """SHA-256 of bytes."""
    return hashlib.sha256(content).hexdigest()


def digest_of_file(path: Path) -> str:
    """SHA-256 of a file."""
    return digest_of(path.read_bytes())


def digest_of_folder(folder: Path) -> str:
    """SHA-256 over names and contents of all files below a folder."""
    lines = [
        f"{digest_of_file(path)}  {path.relative_to(folder).as_posix()}"
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    ]
    return digest_of("\n".join(lines).encode())


def digest_of_list(fingerprints: Mapping[str, str]) -> str:
    """One digest for a whole list of name -> fingerprint."""
    return digest_of("\n".join(f"{fingerprints[n]}  {n}" for n in sorted(fingerprints)).encode())


def read_json(path: Path, what: str) -> Any:
    """JSON of a file.

    Raises
    ------
    BlindError                 it is missing or no JSON; `what` says what it should be
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BlindError(f"{path.name}: {what} cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise BlindError(f"{path.name}: {what} is no JSON: {error}") from None


def code_digest() -> str:
    """Fingerprint of the modules that decide a verdict: everything but making, judging, drawing, telling."""
    root = Path(__file__).resolve().parents[1]
    apart = {"blind", "plant", "sections", "figures", "cli", "report", "__pycache__"}
    lines = []
    for path in sorted(root.rglob("*.py")):
        inside = path.relative_to(root)
        if inside.parts[0] not in apart and "__pycache__" not in inside.parts:
            lines.append(f"{digest_of_file(path)}  {inside.as_posix()}")
    return digest_of("\n".join(lines).encode())[:16]


def versions() -> dict[str, str]:
    """Versions of the program and of the libraries a verdict depends on, and the digest of its code."""
    import platform
    from importlib.metadata import version

    from bayesid import __version__

    found = {"bayesid": __version__, "code": code_digest(), "python": platform.python_version()}
    return found | {name: version(name) for name in ("numpy", "scipy", "numba")}
