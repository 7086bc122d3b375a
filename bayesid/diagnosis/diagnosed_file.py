"""The file of a diagnosed model: `model.json` beside `diagnosis.json`, and the vehicle as given.

Takes a `DiagnosedModel` and a folder. Gives the file, and the model back from it. Refuses what no model has.
"""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.diagnosis.coefficient_estimate import read_estimate
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.equations.model import Model, build_model
from bayesid.errors import ModelError
from bayesid.estimation.filter_error.noise_model import NoiseModel
from bayesid.files import UnreadableError, read_regular, write_atomic, write_json
from bayesid.model.effects import Effect
from bayesid.model.vehicles import load_vehicle, write_vehicle

Array = np.ndarray
FORMAT, FORMAT_WITH_RUNS = 1, 2  # 2: coefficients deviate from run to run, which readers of 1 would leave out
MODEL_FILE, VEHICLE_FILE = "model.json", "vehicle_nominal.toml"
NO_MODEL, LARGEST_REASON = "no_model.txt", 2**16  # why a fit left no model; bytes of it
LARGEST_MODEL = 2**28  # bytes of model.json; 70 coefficients with covariance take 0.1 MB a hypothesis
SYMMETRIC = 1e-8


def write_diagnosed(found: DiagnosedModel, folder: str | os.PathLike[str]) -> Path:
    """Write `model.json` and the nominal vehicle beside it; returns the path of the former."""
    target = Path(folder)
    write_vehicle(found.model.vehicle, target / VEHICLE_FILE)
    hypotheses = [
        {
            "effects": list(h.effects),
            "weight": h.weight,
            "names": list(h.names),
            "mean": h.mean.tolist(),
            "covariance": h.covariance.tolist(),
            **({"run_sd": h.run_sd.tolist()} if h.run_sd.any() else {}),
            "one_sided": np.isfinite(h.low).tolist(),
            "low": np.where(np.isfinite(h.low), h.low, 0.0).tolist(),
            "high": [float(x) if np.isfinite(x) else None for x in h.high],
            "force": list(h.noise_model.force),
            "force_tau": h.noise_model.force_tau,
            "drift": h.noise_model.drift,
            "drift_tau": h.noise_model.drift_tau,
            "depth": h.noise_model.depth,
            "arms": list(h.noise_model.arms),
        }
        for h in found.hypotheses
    ]
    record = {
        "format": FORMAT_WITH_RUNS if any(h.run_sd.any() for h in found.hypotheses) else FORMAT,
        "vehicle": VEHICLE_FILE,
        "dof": found.model.dof,
        "digest": found.model.digest,
        "equations": found.model.kernel.digest,
        "verdict": found.verdict,
        "trial": found.trial,
        "failed_checks": list(found.failed_checks),
        "noise": dict(found.noise),
        "hypotheses": hypotheses,
        "estimates": [e.record() for e in found.estimates],
    }
    if found.left_out is not None:
        record["left_out"] = [{"effects": list(n), "probability": p} for n, p in found.left_out.items()]
    return write_json(target / MODEL_FILE, record)


def read_diagnosed(folder: str | os.PathLike[str], declared: Iterable[Effect] = ()) -> DiagnosedModel:
    """Read what `write_diagnosed` wrote.

    Parameters
    ----------
    declared : effects beyond the catalogue, the same as in the diagnosis

    Raises
    ------
    ModelError
        if there is no such file, it is not one of these, or the equations have changed since
    """
    path = Path(folder) / MODEL_FILE
    if Path(folder).is_file():
        raise ModelError(
            f"{folder} is a file; a model is a folder that `bayesid fit`, `sample` or `diagnose` wrote"
        )
    try:
        record = json.loads(read_regular(path, LARGEST_MODEL).decode("utf-8"))
        if record["format"] not in (FORMAT, FORMAT_WITH_RUNS):
            raise ModelError(
                f"{path}: format {record['format']!r}; this version reads {FORMAT} and {FORMAT_WITH_RUNS}"
            )
        hypotheses = tuple(_read(h) for h in record["hypotheses"])
        weights = [h.weight for h in hypotheses]
        if not hypotheses or min(weights) < 0 or not abs(sum(weights) - 1.0) < 1e-6:
            raise ValueError(f"the weights of its hypotheses add up to {sum(weights):.6g}, not to 1")
        vehicle, dof, digest = path.with_name(record["vehicle"]), int(record["dof"]), record["digest"]
        failed = tuple(str(text) for text in record.get("failed_checks", []))
        left_out = _read_left_out(record.get("left_out"))
        estimates = tuple(read_estimate(e) for e in record.get("estimates", []))
        rest = (
            dict(record["noise"]),
            str(record["verdict"]),
            str(record["trial"]),
            failed,
            left_out,
            estimates,
        )
    except UnreadableError as error:
        raise ModelError(f"{path}: {error}; {_why_missing(path.parent)}") from None
    except KeyError as error:
        raise ModelError(f"{path}: is not a diagnosed model (it has no {error})") from None
    except (ValueError, TypeError, AttributeError) as error:
        raise ModelError(f"{path}: is not a diagnosed model ({error})") from None
    model = build_model(load_vehicle(vehicle), dof, declared=declared)
    if model.digest != digest:
        raise ModelError(f"{path}: {_why_other(record.get('equations'), model)}")
    return DiagnosedModel(model, hypotheses, *rest)


def _why_other(equations: Any, model: Model) -> str:
    """What is not as it was when a model was made: the vehicle file beside it, or the equations, if that is
    known."""
    same = "give the same --effects file if there was one"
    if equations is None:
        return f"was made with other equations or another vehicle file; diagnose again, and {same}"
    if equations == model.kernel.digest:
        return f"{VEHICLE_FILE} beside it is not the one it was made with; put that back, or diagnose again"
    return (
        "was made with other equations than this version of bayesid has for the vehicle file beside it, or "
        f"with effects of a file: {same}, else diagnose again"
    )


def _why_missing(folder: Path) -> str:
    """Why a folder may hold no model, by what else is in it, and what writes one."""
    if (folder / "fit.json").exists():
        try:
            why = read_regular(folder / NO_MODEL, LARGEST_REASON).decode("utf-8").strip()
        except (UnreadableError, ValueError):
            why = "it was made with --quick, or stopped before; run it again without --quick"
        return f"the fit in this folder wrote none: {why}"
    if (folder / "diagnosis.json").exists():
        return "the diagnosis in this folder could not make one; the notes of its report say why"
    out = shlex.quote(os.fspath(folder))
    return f"`bayesid diagnose BUNDLE --out {out}` and `bayesid fit BUNDLE --out {out}` write it"


def write_why_not(folder: str | os.PathLike[str], why: str) -> None:
    """Say in a folder why a fit has left no model there; `read_diagnosed` repeats it."""
    write_atomic(Path(folder) / NO_MODEL, f"{why}\n")


def remove_fitted(folder: str | os.PathLike[str]) -> None:
    """Take away the model an earlier fit left in a folder, or why it left none; that of a diagnosis, or of
    nobody known, stays."""
    path = Path(folder) / MODEL_FILE
    (Path(folder) / NO_MODEL).unlink(missing_ok=True)
    try:
        fitted = json.loads(read_regular(path, LARGEST_MODEL).decode("utf-8"))["verdict"] == "fit"
    except (UnreadableError, ValueError, KeyError, TypeError):
        return
    if fitted:
        path.unlink()


def _check_gaussian(names: Sequence[str], mean: Array, covariance: Array) -> None:
    """Refuse what no Gaussian has, so that no draw of it looks like an answer.

    Positive up to what rounding does to a singular matrix: 1e-8 of the unit diagonal of its correlations.
    """
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        raise ValueError("mean or covariance hold numbers that are not finite")
    variance = np.diag(covariance)
    if not np.all(variance > 0):
        raise ValueError(f"the variance of {names[int(np.argmin(variance))]} is {variance.min():.3g}")
    root = np.sqrt(variance)
    correlation = covariance / np.outer(root, root)
    if np.abs(correlation - correlation.T).max() > SYMMETRIC:
        raise ValueError("the covariance is not symmetric")
    lowest = float(np.linalg.eigvalsh(correlation)[0])
    if lowest < -SYMMETRIC:
        raise ValueError(f"the covariance is not positive: eigenvalue {lowest:.3g} of the correlations")


def _check_size(name: str, values: Sequence[float]) -> None:
    if not all(np.isfinite(float(v)) and float(v) >= 0 for v in values):
        raise ValueError(f"{name} holds a size that is negative or not finite")


def _read_left_out(rows: Sequence[Mapping[str, Any]] | None) -> dict[tuple[str, ...], float] | None:
    if rows is None:  # written before it was kept
        return None
    out = {tuple(map(str, row["effects"])): float(row["probability"]) for row in rows}
    if not all(0.0 <= p <= 1.0 for p in out.values()):
        raise ValueError("left_out holds a probability that is none")
    return out


def _read(h: Mapping[str, Any]) -> WeightedHypothesis:
    def array(values: Sequence[Any]) -> Array:
        return np.array(values, dtype=float)

    low = np.where(np.array(h["one_sided"], dtype=bool), array(h["low"]), -np.inf)
    high = np.array([np.inf if x is None else float(x) for x in h.get("high", [None] * low.size)])
    noise_model = NoiseModel(
        tuple(h["force"]),
        h["force_tau"],
        h["drift"],
        h["drift_tau"],
        tuple(h.get("arms", ())),
        h.get("depth"),
    )
    names = tuple(h["names"])
    mean, covariance = array(h["mean"]), array(h["covariance"])
    if mean.shape != (len(names),) or covariance.shape != (len(names),) * 2:
        raise ValueError("mean and covariance do not fit the names")
    run_sd = array(h.get("run_sd", [0.0] * len(names)))
    if run_sd.shape != mean.shape:
        raise ValueError("run_sd does not fit the names")
    _check_size("run_sd", run_sd.tolist())
    if low.shape != mean.shape or high.shape != mean.shape or not (low < high).all():
        raise ValueError("the bounds do not fit the names, or leave no room")
    _check_gaussian(names, mean, covariance)
    _check_size("force", noise_model.force)
    _check_size(
        "drift", (noise_model.drift, noise_model.drift_tau, noise_model.force_tau, noise_model.depth or 0.0)
    )
    return WeightedHypothesis(
        tuple(h["effects"]), float(h["weight"]), names, mean, covariance, low, high, noise_model, run_sd
    )
