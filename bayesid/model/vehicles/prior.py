"""Read the [prior] of a vehicle file: one relative sd, one per coefficient, and a covariance beside the file.

Takes: the parsed table, the coefficients of the file and the folder it lies in.
Does not: convert conventions (`reading` does) or sample.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Collection
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from bayesid.errors import VehicleError
from bayesid.model.vehicles.fields import TomlTable, as_number, shown
from bayesid.model.vehicles.vehicle import CoefficientPrior

LARGEST_COVARIANCE = 16_000_000  # bytes, unpacked


def read_prior(
    data: Any, coefs: Collection[str], resolve: Callable[[str], str], folder: Path | None, problems: list[str]
) -> CoefficientPrior:
    """Prior of the file in the file's own convention; problems are appended.

    Parameters
    ----------
    coefs : canonical names present in [coef]
    resolve : spelling -> canonical name, raising VehicleError
    folder : where `covariance = "file.npz"` is looked for; None forbids it
    """
    table = TomlTable(data, "prior", problems)
    table.only(("relative_sd", "covariance"))
    relative = _relative(table, coefs, resolve)
    names, covariance = _covariance(table, coefs, resolve, folder)
    return CoefficientPrior(
        {name: sd for name, sd in relative.items() if name not in names}, names, covariance
    )


def _relative(table: TomlTable, coefs: Collection[str], resolve: Callable[[str], str]) -> dict[str, float]:
    value = table.data.get("relative_sd")
    if not isinstance(value, dict):
        sd = table.number("relative_sd", None, low=0.0, high=100.0)
        return {} if sd is None else dict.fromkeys(coefs, sd)
    found: dict[str, float] = {}
    for spelling, entry in value.items():
        number = as_number(entry)
        if number is None or not 0.0 <= number <= 100.0:
            table.problem(f"relative_sd of {shown(spelling)} must be a number in 0..100, not {shown(entry)}")
        elif (name := _known(table, spelling, coefs, resolve)) is not None:
            found[name] = number
    return found


def _known(
    table: TomlTable, spelling: object, coefs: Collection[str], resolve: Callable[[str], str]
) -> str | None:
    try:
        name = resolve(str(spelling))
    except VehicleError as error:
        table.problem(str(error))
        return None
    if name not in coefs:
        table.problem(f"{name} has a prior but no value in [coef]")
        return None
    return name


def _covariance(
    table: TomlTable, coefs: Collection[str], resolve: Callable[[str], str], folder: Path | None
) -> tuple[tuple[str, ...], np.ndarray | None]:
    entry = table.data.get("covariance")
    if entry is None:
        return (), None
    try:
        if isinstance(entry, str):
            spellings, matrix = _from_npz(entry, folder)
        elif isinstance(entry, dict) and isinstance(entry.get("names"), list):
            unknown = [key for key in entry if key not in ("names", "matrix")]
            if unknown:
                raise ValueError(f"unknown key {shown(unknown[0])}; a table has names and matrix")
            spellings, matrix = entry["names"], _from_rows(entry.get("matrix"))
        else:
            raise ValueError('must be "file.npz" or a table with names and matrix')
        names = [_known(table, spelling, coefs, resolve) for spelling in spellings]
        if None in names:
            return (), None
        return _checked([name for name in names if name], matrix)
    except ValueError as error:
        table.problem(f"covariance: {error}")
        return (), None


def _from_rows(rows: Any) -> np.ndarray:
    numbers = [[as_number(item) for item in row] for row in rows] if _is_rows(rows) else [[None]]
    if any(item is None for row in numbers for item in row) or len({len(row) for row in numbers}) != 1:
        raise ValueError("matrix must be rows of finite numbers of equal length")
    return np.array(numbers, dtype=float)


def _is_rows(rows: Any) -> bool:
    return isinstance(rows, list) and bool(rows) and all(isinstance(row, list) and row for row in rows)


def _from_npz(entry: str, folder: Path | None) -> tuple[list[str], np.ndarray]:
    """Names and matrix of an .npz; only a file in the vehicle's own folder or below is opened."""
    parts = Path(entry).parts
    if folder is None:
        raise ValueError("a file cannot be named here; give a table with names and matrix")
    if (
        not parts
        or Path(entry).is_absolute()
        or ".." in parts
        or "\\" in entry
        or "\0" in entry
        or ":" in entry
    ):
        raise ValueError(f"{shown(entry)} must be a file beside the vehicle file, without .. or a drive")
    path = folder / entry
    try:
        if not path.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{shown(entry)} points outside the folder of the vehicle file")
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise ValueError(f"{shown(entry)} is not a regular file")
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > LARGEST_COVARIANCE:
            raise ValueError(f"{shown(entry)} unpacks to {size} bytes, more than {LARGEST_COVARIANCE}")
        names, matrix = _arrays(path)
    except KeyError:
        raise ValueError(f"{shown(entry)} must hold the arrays names and covariance") from None
    except FileNotFoundError:
        raise ValueError(f"{shown(entry)} is not there") from None
    except (OSError, EOFError, zipfile.BadZipFile, NotImplementedError, RuntimeError, zlib.error) as error:
        raise ValueError(f"{shown(entry)} cannot be read as .npz ({type(error).__name__})") from None
    if names.dtype.kind != "U" or names.ndim != 1 or matrix.dtype.kind not in "fiu":
        raise ValueError(f"{shown(entry)} must hold names (text) and covariance (numbers)")
    return [str(name) for name in names], np.asarray(matrix, dtype=float)


def _arrays(path: Path) -> tuple[np.ndarray, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as stored:
            return stored["names"], stored["covariance"]
    except (ValueError, SyntaxError, TokenError):  # objects, or a damaged array header, read as tokens
        raise OSError("not plain arrays") from None


def _checked(names: list[str], matrix: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    if len(set(names)) != len(names):
        raise ValueError("a coefficient is named twice")
    if matrix.shape != (len(names), len(names)) or not names:
        raise ValueError(f"matrix has shape {matrix.shape} for {len(names)} names")
    if not np.all(np.abs(matrix) < 1e60):
        raise ValueError("matrix must be finite")
    sd = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    if np.any(np.diag(matrix) < 0.0):
        raise ValueError(f"variance of {names[int(np.argmin(np.diag(matrix)))]} is negative")
    scale = np.where(sd > 0.0, sd, 1.0)
    with np.errstate(all="ignore"):  # a tiny variance beside a large covariance overflows, and is refused
        correlation = matrix / scale[:, None] / scale[None, :]
        lopsided = np.max(np.abs(correlation - correlation.T))
    if not lopsided <= 1e-9:
        raise ValueError("matrix is not symmetric")
    if np.max(np.abs(correlation)) > 1.0 + 1e-9 or np.linalg.eigvalsh(correlation)[0] < -1e-9 * len(names):
        raise ValueError("matrix is not positive semi-definite")
    matrix = 0.5 * (matrix + matrix.T)
    matrix.setflags(write=False)
    return tuple(names), matrix
