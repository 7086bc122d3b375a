"""Filter-error fits kept on disk while a diagnosis is under way, so that one that is killed loses none.

Takes a folder. Gives back the numbers of a fit asked for before with the very same data, prior, start and
program. One file per fit, arrays only (nothing in it is run on reading), written as a whole; one that cannot
be read is as good as none. Does not keep linearisations: they are made anew from the same points.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from bayesid.code import loaded_code
from bayesid.equations.model import Model
from bayesid.errors import BayesidError
from bayesid.estimation.filter_error.evidence import GaussianPosterior, NormalEquations
from bayesid.estimation.filter_error.fit_result import FilterErrorFit
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.estimation.parameters import GaussianPrior
from bayesid.estimation.run_data import RunData
from bayesid.files import write_atomic

SUFFIX = ".fit.npz"
# numpy reads the header of an array as Python's own tokens
_UNREADABLE = (
    OSError, ValueError, KeyError, TypeError, IndexError, EOFError, ArithmeticError, SyntaxError, MemoryError,
    NotImplementedError, RuntimeError, TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


class FitJournal:
    """Fits of one folder.

    Attributes
    ----------
    used : how many fits that were there at its opening were read back
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.used, self._broken = folder, 0, False
        self._before = {path.name for path in folder.glob("*" + SUFFIX)}

    def key(self, model: Model, logs: Sequence[RunData], *rest: Any) -> str:
        """Fingerprint of all that a fit depends on."""
        out = hashlib.blake2b(digest_size=20)
        libraries = f"{loaded_code()}|{np.__version__}"
        _add(out, (libraries, model.digest, tuple(model.effects), model.nominal, tuple(logs), *rest))
        return out.hexdigest()

    def read(
        self,
        key: str,
        model: Model,
        logs: Sequence[RunData],
        free: GaussianPrior,
        noise_model: NoiseModel,
    ) -> FilterErrorFit | None:
        """The fit of a key; None where there is none that can be read."""
        path = self.folder / (key + SUFFIX)
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as kept:
                found = _from_arrays({n: kept[n] for n in kept.files}, model, logs, free, noise_model)
        except _UNREADABLE:
            return None
        if path.name in self._before:
            self.used += 1
        return found

    def write(self, key: str, fitted: FilterErrorFit) -> None:
        """Keep a fit; where that fails once the rest is not kept, and a warning says so."""
        if self._broken:
            return
        stream = io.BytesIO()
        np.savez(stream, allow_pickle=False, **_arrays(fitted))
        try:
            write_atomic(self.folder / (key + SUFFIX), stream.getvalue())
        except OSError as error:
            self._broken = True
            warnings.warn(
                f"{self.folder}: refits cannot be kept there ({error.strerror}); a diagnosis stopped "
                "before its end would begin anew",
                stacklevel=2,
            )

    def clear(self) -> None:
        """Remove the fits, and the folder if nothing else is in it."""
        with suppress(OSError):
            for path in self.folder.glob("*" + SUFFIX):
                path.unlink()
            self.folder.rmdir()


_current: ContextVar[FitJournal | None] = ContextVar("fit_journal", default=None)


def current_journal() -> FitJournal | None:
    """The journal of the work under way."""
    return _current.get()


@contextmanager
def fits_kept(folder: Path | None) -> Iterator[FitJournal | None]:
    """Keep every filter-error fit of the block in a folder; None keeps none.

    Raises
    ------
    BayesidError
        the folder cannot be made
    """
    journal = None
    if folder is not None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            words = f"{folder}: cannot be written ({error.strerror}); choose another --out"
            raise BayesidError(words) from None
        journal = FitJournal(folder)
    token = _current.set(journal)
    try:
        yield journal
    finally:
        _current.reset(token)


def _add(out: Any, value: Any) -> None:
    """Feed a value with its type and shape."""
    if isinstance(value, np.ndarray):
        out.update(f"{value.dtype}{value.shape}".encode())
        out.update(np.ascontiguousarray(value).tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        out.update(type(value).__name__.encode())
        for field in dataclasses.fields(value):
            if field.init:  # the others hold what was worked out from these
                _add(out, getattr(value, field.name))
    elif isinstance(value, Mapping):
        _add(out, tuple(value.items()))
    elif isinstance(value, tuple | list):
        out.update(f"({len(value)}".encode())
        for item in value:
            _add(out, item)
    elif value is None or isinstance(value, str | int | float | bool | np.number):
        out.update(f"{value!r};".encode())
    else:
        raise TypeError(f"{type(value).__name__} has no fingerprint")


def _arrays(fitted: FilterErrorFit) -> dict[str, np.ndarray]:
    """Everything but model, data and prior, as arrays."""
    post = fitted.posterior
    numbers = {
        "iterations": fitted.iterations, "converged": fitted.converged, "runs": len(fitted.logs),
        "log_evidence": post.log_evidence, "level": fitted.path_force_level, "evidence": fitted.path_evidence,
        "noise": dataclasses.asdict(fitted.noise_model),
    }  # fmt: skip
    out = {"numbers": np.array(json.dumps(numbers)), "values": fitted.values, "par": fitted.par}
    out |= {"mean": post.mean, "covariance": post.covariance}
    for k, standard in enumerate(fitted.standard):
        out[f"standard{k}"] = standard
    for k, g in enumerate(fitted.equations):
        out |= {f"ss{k}": g.ss, f"se{k}": g.se, f"rest{k}": np.array([g.ee, g.logdet, g.used])}
    kinds = {"points": fitted.points, "about": fitted.about, "path": fitted.path_points}
    for kind, points in kinds.items():
        for k, p in enumerate(points):
            out |= {f"{kind}{k}.par": p.par, f"{kind}{k}.states": p.states, f"{kind}{k}.force": p.force}
            if p.before is not None:
                out[f"{kind}{k}.before"] = p.before
    return out


def _from_arrays(
    kept: dict[str, np.ndarray],
    model: Model,
    logs: Sequence[RunData],
    free: GaussianPrior,
    noise_model: NoiseModel,
) -> FilterErrorFit:
    numbers = json.loads(str(kept["numbers"]))
    count = len(logs)
    if numbers["runs"] != count or kept["values"].shape != (len(free.names),):
        raise ValueError("another fit")
    noise = numbers["noise"] | {n: tuple(numbers["noise"][n]) for n in ("force", "arms")}
    used = NoiseModel(**noise)

    def trajectories(kind: str) -> tuple[Trajectory, ...]:
        parts = ("par", "states", "force")
        return tuple(
            Trajectory(par, states, force, kept.get(f"{kind}{k}.before"))
            for k in range(count)
            for par, states, force in [[kept[f"{kind}{k}.{part}"] for part in parts]]
        )

    rest = [kept[f"rest{k}"] for k in range(count)]
    return FilterErrorFit(
        free=free,
        values=kept["values"],
        posterior=GaussianPosterior(kept["mean"], kept["covariance"], numbers["log_evidence"]),
        par=kept["par"],
        noise_model=noise_model if used == noise_model else used,
        points=trajectories("points"),
        model=model,
        logs=tuple(logs),
        about=trajectories("about"),
        held=(),
        equations=tuple(
            NormalEquations(kept[f"ss{k}"], kept[f"se{k}"], float(r[0]), float(r[1]), int(r[2]))
            for k, r in enumerate(rest)
        ),
        standard=tuple(kept[f"standard{k}"] for k in range(count)),
        iterations=numbers["iterations"],
        converged=numbers["converged"],
        path_points=trajectories("path"),
        path_force_level=numbers["level"],
        path_evidence=numbers["evidence"],
    )
