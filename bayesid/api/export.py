"""`bayesid.export`: draws of a fitted or diagnosed vehicle as files other simulators can read."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bayesid.api.inputs import declared_effects
from bayesid.api.result import Result
from bayesid.diagnosis.diagnosed_file import read_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, WeightedHypothesis
from bayesid.errors import ModelError
from bayesid.files import write_json
from bayesid.model.terms import TERMS
from bayesid.model.vehicles import identified, write_vehicle
from bayesid.progress import Progress
from bayesid.report.writer import Report
from bayesid.words import counted

if TYPE_CHECKING:
    import pandas

MOST_DRAWS = 10_000
ENSEMBLE, ESTIMATE = "ensemble.json", "vehicle_estimate.toml"
_ROWS = frozenset(t.name for t in TERMS)


def export(
    model: str | os.PathLike[str],
    out: str | os.PathLike[str],
    draws: int = 100,
    *,
    effects: str | os.PathLike[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> ExportResult:
    """Write the estimate, an ensemble of vehicles about it, and what goes with each in ensemble.json.

    Parameters
    ----------
    model : folder of `bayesid.fit` or `bayesid.diagnose`
    out : folder for vehicle_estimate.toml, the estimate of the most probable explanation, vehicle_0001.toml,
        vehicle_0002.toml, ... and ensemble.json
    draws : vehicles drawn from the posterior, every one of the same weight
    effects : declarations of effects beyond the catalogue, as in the diagnosis
    seed : of the draws; the disturbance of draw k is to be generated with the seed that stands beside it

    Returns
    -------
    ExportResult    effects, disturbance and seed per vehicle; SI units

    Raises
    ------
    ModelError
        what cannot be read, or a number of draws outside 1 to 10 000
    """
    if not 1 <= draws <= MOST_DRAWS:
        raise ModelError(f"draws = {draws}: give 1 to {MOST_DRAWS}")
    found = read_diagnosed(model, declared_effects(effects))
    rng = np.random.default_rng(seed)
    drawn = [(h, par) for h, pars in found.draw(rng, draws) for par in pars]
    shown = progress or Progress(quiet=True)
    estimate = _estimate(found, Path(out), seed)
    members = []
    for number, (hypothesis, par) in enumerate(shown.track(drawn, "vehicles"), 1):
        file = f"vehicle_{number:0{len(str(draws))}d}.toml"
        _write(found, hypothesis, par, Path(out) / file, f"draw {number} of {draws}, seed {seed}", number)
        members.append(_member(found, hypothesis, par, file, 1.0 / draws, seed + number))
    record = {
        "model": found.model.digest, "verdict": found.verdict, "trial": found.trial, "seed": seed,
        "units": "SI; the disturbance is stationary Ornstein-Uhlenbeck noise, one per axis",
        "sensor_noise": dict(found.noise), "failed_checks": list(found.failed_checks),
        "estimate": estimate, "members": members,
    }  # fmt: skip
    write_json(Path(out) / ENSEMBLE, record)
    return ExportResult(record, Path(out))


def _estimate(found: DiagnosedModel, out: Path, seed: int) -> dict[str, Any]:
    """The most probable explanation at its estimate, written as vehicle_estimate.toml."""
    best = max(found.hypotheses, key=lambda h: h.weight)
    par = np.array(found.model.nominal)
    par[[found.model.index[n] for n in best.names]] = best.mean
    _write(found, best, par, out / ESTIMATE, "estimate of the most probable explanation")
    return _member(found, best, par, ESTIMATE, float(best.weight), seed)


def _write(
    found: DiagnosedModel,
    hypothesis: WeightedHypothesis,
    par: np.ndarray,
    file: Path,
    source: str,
    number: int | None = None,
) -> None:
    values = {n: float(par[found.model.index[n]]) for n in hypothesis.names if n in _ROWS}
    own = found.model.vehicle.name
    name = f"{own}, estimate" if number is None else f"{own}, draw {number}"
    write_vehicle(identified(found.model.vehicle, values, source=source, name=name), file)


def _member(
    found: DiagnosedModel,
    hypothesis: WeightedHypothesis,
    par: np.ndarray,
    file: str,
    weight: float,
    seed: int,
) -> dict[str, Any]:
    """One draw: its file, and all that a vehicle file cannot hold."""
    model, noise = found.model, hypothesis.noise_model
    axes = [n[-1] for n in model.kernel.exogenous if n.startswith("force_")]
    acting = {
        name: float(par[at]) for name, at in model.index.items() if at in model.effect_off
        and float(par[at]) != model.effect_off[at]
    }  # fmt: skip
    return {
        "vehicle": file,
        "weight": weight,
        "effects": acting,
        "disturbance": {
            "force_sd": dict(zip(axes, map(float, noise.force), strict=True)),
            "time_s": float(noise.force_tau),
            "position_error_sd_m": float(noise.drift),
            "position_error_time_s": float(noise.drift_tau),
            "seed": seed,
        },
    }


@dataclass(frozen=True, eq=False, repr=False)
class ExportResult(Result):
    """An ensemble that was written.

    Attributes
    ----------
    numbers : what ensemble.json holds
    out : its folder
    """

    numbers: Mapping[str, Any]
    out: Path

    @property
    def failures(self) -> Sequence[str]:
        """Checks that failed, one sentence or two each."""
        checks: Sequence[str] = self.numbers["failed_checks"]
        return checks

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per vehicle: file, weight, effects."""
        import pandas

        return pandas.DataFrame([{**m, **m["effects"]} for m in self.numbers["members"]]).drop(
            columns=["effects", "disturbance"]
        )

    def report(self) -> Report:
        return Report("Ensemble", self.summary(), [])

    def record(self) -> Mapping[str, Any]:
        return self.numbers

    def summary(self, verbose: bool = False) -> str:
        members = self.numbers["members"]
        acting = sorted({name.split(".")[0] for m in members for name in m["effects"]})
        with_effects = f", effects {', '.join(acting)}" if acting else ", no effects"
        vehicles = counted(len(members), "vehicle")
        lines = [
            f"{vehicles} of equal weight{with_effects}; {ENSEMBLE} says what goes with each, {ESTIMATE} is "
            "the estimate"
        ]
        lines += [f"CHECK FAILED: {text}" for text in self.failures]
        return "\n".join(lines)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        return self.out / ENSEMBLE
