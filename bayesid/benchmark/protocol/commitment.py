"""Seals: fingerprints by which answers and verdicts prove that nobody changed them afterwards.

Takes files and folders. Gives SHA-256 digests and lists of what does not fit. Does not read their content.

An answer holds a random salt, so that its published fingerprint cannot be found by trying likely answers. The
campaigns of a pack and the names of its bundles come from a secret that is kept with the answers, so that
nobody rebuilds them from what a pack shows.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bayesid.code import code_digest
from bayesid.errors import BayesidError

PACK_COMMITMENTS_FILE = "commitments.json"  # in a pack: fingerprints of the answers and of the bundles
VERDICT_COMMITMENT_FILE = (
    "seal.json"  # beside verdicts: their fingerprints, versions and the commitments they answer
)
SECRET = "secret.key"  # beside answers: hexadecimal digits from which campaigns and names are derived
# 1: names carried the seed of the campaign, and the commitment covered the list of verdicts only; still read
FORMAT, FORMATS = 2, (1, 2)
SECRET_BITS = 256
ENOUGH_BITS = 128  # below, a pack can be rebuilt by trying


class BlindError(BayesidError):
    """A blind check cannot go on: a broken commitment, an answer that leaked, a missing pack or verdict."""


def salt() -> str:
    """32 hexadecimal digits nobody can guess."""
    return secrets.token_hex(16)


def secret_of(answers: Path) -> bytes:
    """The secret kept with the answers, made if there is none.

    Raises
    ------
    BlindError                 the file holds something else
    """
    path = answers / SECRET
    if not path.exists():
        answers.mkdir(parents=True, exist_ok=True)
        path.touch(mode=0o600)
        path.write_text(secrets.token_hex(SECRET_BITS // 8) + "\n", encoding="utf-8")
    try:
        found = bytes.fromhex(path.read_text(encoding="utf-8").strip())
    except (OSError, ValueError):
        found = b""
    if 8 * len(found) < ENOUGH_BITS:
        raise BlindError(f"{SECRET}: holds no {ENOUGH_BITS} bits in hexadecimal; delete it for a new secret")
    return found


def derived(secret: bytes, what: str, k: int) -> int:
    """128 bits for one purpose and one bundle (HMAC-SHA256), of which none tells of the others or the "
    "secret."""
    return int.from_bytes(hmac.digest(secret, f"{what} {k}".encode(), "sha256")[:16], "big")


def derived_salt(secret: bytes, name: str) -> str:
    """The salt of a bundle's answer: as unguessable as the secret, and the same whenever the pack is made
    anew."""
    return f"{derived(secret, f'salt of {name}', 0):032x}"


def unprintable(name: str) -> bool:
    """Whether a name holds a character that is not seen: control, direction, line separator."""
    return any(unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in name)


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


def digest_of_record(record: Mapping[str, Any]) -> str:
    """SHA-256 of plain data, whatever the order of its keys and the layout of its file."""
    text = json.dumps(record, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return digest_of(text.encode())


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


def versions() -> dict[str, str]:
    """Versions of the program and of the libraries a verdict depends on, and the digest of its code."""
    import platform
    from importlib.metadata import version

    from bayesid import __version__

    found = {"bayesid": __version__, "code": code_digest(), "python": platform.python_version()}
    return found | {name: version(name) for name in ("numpy", "scipy", "numba")}
