"""What an oracle needs of a diagnosis, kept beside its verdict: plain arrays, nothing that runs when read.

Takes the problem of a diagnosis. Gives environment, path, its level and the readings used back.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.commitment import BlindError
from bayesid.diagnosis.data.problem import DiagnosisProblem
from bayesid.estimation.filter_error.linearise import Trajectory
from bayesid.estimation.filter_error.noise_identification import NoiseIdentification
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.files import UnreadableError, json_text, read_regular, write_atomic

Array = np.ndarray
LARGEST = 2**28  # bytes of a file, unpacked too; a bundle of a million readings needs a tenth
StoredProblem = tuple[NoiseIdentification, tuple[Trajectory, ...], float, list[Array]]


def write_problem(problem: DiagnosisProblem, path: Path) -> Path:
    """Write environment, path, its level and which readings are used, as .npz."""
    arrays: dict[str, Array] = {}
    for i, (point, log) in enumerate(zip(problem.path, problem.logs, strict=True)):
        arrays |= {f"{i}/par": point.par, f"{i}/states": point.states, f"{i}/force": point.force}
        arrays |= {f"{i}/valid": log.valid} | ({} if point.before is None else {f"{i}/before": point.before})
    about_problem = {
        "environment": problem.environment,
        "level": problem.path_level,
        "runs": len(problem.logs),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(json_text(about_problem)), **arrays)  # type: ignore[arg-type]
    return write_atomic(path, buffer.getvalue())


def read_problem(path: str | os.PathLike[str]) -> StoredProblem:
    """Read what `write_problem` wrote.

    Returns
    -------
    environment, points of the path, its level, and per run which readings are used

    Raises
    ------
    BlindError
        the file is missing, too large, or holds anything but such arrays
    """
    target = Path(path)
    try:
        raw = read_regular(target, LARGEST)
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            if sum(member.file_size for member in archive.infolist()) > LARGEST:
                raise UnreadableError(f"unpacks to more than {LARGEST} bytes")
        with np.load(io.BytesIO(raw), allow_pickle=False) as stored:
            about = json.loads(str(stored["about"]))
            runs = range(int(about["runs"]))
            points = tuple(
                Trajectory(
                    _numbers(stored, f"{i}/par"),
                    _numbers(stored, f"{i}/states"),
                    _numbers(stored, f"{i}/force"),
                    _numbers(stored, f"{i}/before") if f"{i}/before" in stored else None,
                )
                for i in runs
            )
            valid = [np.asarray(stored[f"{i}/valid"], dtype=bool) for i in runs]
        return _environment(about["environment"]), points, float(about["level"]), valid
    except UnreadableError as error:
        raise BlindError(f"{target.name}: {error}") from None
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile, EOFError) as error:
        raise BlindError(
            f"{target.name}: holds no problem of a diagnosis ({type(error).__name__}); solve the bundle again"
        ) from None


def _numbers(stored: Any, name: str) -> Array:
    found = stored[name]
    if found.dtype.kind != "f":
        raise ValueError(f"{name} holds no numbers")
    return np.asarray(found, dtype=float)


def _environment(about_problem: dict[str, Any]) -> NoiseIdentification:
    c = about_problem["noise_model"]
    depth = None if c["depth"] is None else float(c["depth"])
    force, arms = (tuple(float(v) for v in c[key]) for key in ("force", "arms"))
    noise_model = NoiseModel(
        force, float(c["force_tau"]), float(c["drift"]), float(c["drift_tau"]), arms, depth
    )
    left = tuple(float(v) for v in about_problem["left"])
    again = bool(about_problem.get("again", False))  # older files do not say
    return NoiseIdentification(
        noise_model, str(about_problem["source"]), float(about_problem["spread"]), left, again
    )
