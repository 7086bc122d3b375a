"""Where a chain is kept: one HDF5 file per round, each whole or not there.

A killed process, a full disk or a power cut costs the round at work and nothing else: its state of the random
numbers is that of the round before, so that the chain goes on as if it had not been interrupted.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.errors import SampleError
from bayesid.estimation.sampling.moves import Reference
from bayesid.files import json_text, write_atomic

Array = np.ndarray
RandomState = tuple[str, Array, int, int, float]


@dataclass(frozen=True, eq=False)
class Block:
    """One round of all ensembles, and what the next one needs.

    Attributes
    ----------
    coords : (n, ensembles, walkers, k) whitened; the last entry is where the next round begins
    log_prob : (n, ensembles, walkers)
    accepted : (ensembles,) share of proposals accepted
    means, roots : (ensembles, k), (ensembles, k, k) reference of the Gaussian move in the next round
    random : state of the random numbers
    counts : (3,) evaluations in all, out of bounds, diverged
    seconds : processor time
    """

    coords: Array
    log_prob: Array
    accepted: Array
    means: Array
    roots: Array
    random: RandomState
    counts: Array
    seconds: float

    @property
    def references(self) -> list[Reference]:
        """Per ensemble."""
        return [Reference(m, r) for m, r in zip(self.means, self.roots, strict=True)]


class Store:
    """Blocks of a chain in a folder, or in memory where there is none."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self._kept: dict[int, Block] = {}
        self._digest = ""

    def begin(self, setup: Mapping[str, Any], resume: bool) -> None:
        """Make the folder ready.

        Raises
        ------
        SampleError
            a chain is there and `resume` is not set, or it was made with another set-up
        """
        if self.folder is None:
            return
        path = self.folder / "setup.json"
        text = json_text(setup) + "\n"
        self._digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        if path.exists():
            if not resume:
                raise SampleError(
                    f"{self.folder.name} holds a chain already; resume it, or delete or rename the folder"
                )
            try:
                before, now = json.loads(path.read_text(encoding="utf-8")), json.loads(text)
            except ValueError:
                raise SampleError(f"{self.folder}/setup.json is damaged; delete the folder") from None
            other = [k for k in now if before.get(k) != now[k]]
            if other:
                raise SampleError(
                    f"{self.folder.name} holds a chain made with another {', '.join(other)}; "
                    "sample into another folder"
                )
            return
        if self.folder.exists() and any(self.folder.glob("*.h5")):
            shutil.rmtree(self.folder)  # blocks without a set-up belong to nothing
        write_atomic(path, text)

    def _path(self, number: int) -> Path | None:
        return None if self.folder is None else self.folder / f"round{number:03d}.h5"

    def get(self, number: int) -> Block | None:
        """A round, None if it is not there.

        Raises
        ------
        SampleError
            if its file is damaged, or of a chain of another set-up
        """
        if number not in self._kept:
            path = self._path(number)
            if path is None or not path.exists():
                return None
            self._kept[number] = _read(path, self._digest)
        return self._kept[number]

    def put(self, number: int, block: Block) -> None:
        """Keep a round.

        Raises
        ------
        SampleError
            if it cannot be written; those before it are safe
        """
        path = self._path(number)
        if path is not None:
            try:
                write_atomic(path, _bytes(block, self._digest))
            except OSError as error:
                raise SampleError(
                    f"{path} cannot be written ({error.strerror or error}); the chain up to round "
                    f"{number} is safe: make room and resume"
                ) from None
        self._kept[number] = block


def _bytes(block: Block, digest: str) -> bytes:
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name in ("coords", "log_prob"):
            file.create_dataset(name, data=getattr(block, name), compression="gzip", compression_opts=1)
        for name in ("accepted", "means", "roots", "counts"):
            file[name] = getattr(block, name)
        kind, keys, at, has_gauss, cached = block.random
        file["random_keys"], file["random_rest"] = keys, np.array([at, has_gauss], dtype=np.int64)
        file["random_cached"] = cached
        file.attrs.update(kind=kind, seconds=block.seconds, setup=digest)
    return buffer.getvalue()


def _read(path: Path, digest: str) -> Block:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("setup", digest) != digest:  # those of earlier versions do not tell
                raise SampleError(f"{path} is of another chain; delete it and those with higher numbers")
            at, has_gauss = (int(i) for i in file["random_rest"][()])
            random = (
                str(file.attrs["kind"]),
                file["random_keys"][()],
                at,
                has_gauss,
                float(file["random_cached"][()]),
            )
            names = ("coords", "log_prob", "accepted", "means", "roots")
            coords, log_prob, accepted, means, roots = (file[name][()] for name in names)
            counts, seconds = file["counts"][()], float(file.attrs["seconds"])
            return Block(coords, log_prob, accepted, means, roots, random, counts, seconds)
    except (OSError, KeyError, ValueError) as error:
        raise SampleError(
            f"{path} is damaged ({type(error).__name__}); delete it and those with higher numbers"
        ) from None
