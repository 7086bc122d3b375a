"""Many bundles in one call: a diagnosis and a report for each, and one page over all."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.api.diagnose import diagnose
from bayesid.api.input_result import InputResult
from bayesid.api.inputs import LARGEST_EFFECTS, declared_effects, vehicle_of
from bayesid.api.result import Result, table
from bayesid.api.shared_vehicles import sharing_record, write_shared_vehicles
from bayesid.code import loaded_code
from bayesid.diagnosis.diagnosed_file import MODEL_FILE, read_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel
from bayesid.diagnosis.fleet import (
    SharedEffect,
    SharedParameter,
    shared_effects,
    shared_parameters,
    verdict_words,
)
from bayesid.diagnosis.shared_coefficients import CoefficientSharing, share_coefficients
from bayesid.errors import BayesidError, TrialError
from bayesid.executor import HERE, Executor
from bayesid.files import UnreadableError, read_regular, write_json
from bayesid.progress import Progress
from bayesid.report import writer
from bayesid.report.fleet import NO_SHARING, fleet_lead, fleet_report
from bayesid.report.fleet_coefficients import COEFFICIENT_COLUMNS, coefficient_rows
from bayesid.report.writer import Report, plain
from bayesid.trials import Trial, load_trial

if TYPE_CHECKING:
    import pandas

NOTE = "done.json"
# Folder below --out of a vehicle file per vehicle, with the coefficients its bundles share.
SHARED = "shared_coefficients"


def bundles_of(folder: str | os.PathLike[str]) -> list[Path]:
    """Bundles in a folder that is none itself, by name."""
    place = Path(folder)
    if (place / "trial.toml").exists() or not place.is_dir():
        return []
    return sorted(p.parent for p in place.glob("*/trial.toml"))


def diagnose_fleet(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    executor: Executor = HERE,
    progress: Progress | None = None,
    **options: Any,
) -> FleetResult:
    """Diagnose every bundle of a folder.

    Parameters
    ----------
    out : gets a folder per bundle, as `bayesid.diagnose` writes it; bundles done before with the same log,
        vehicle, effects, options and program are kept
    options : of `bayesid.diagnose`

    Raises
    ------
    TrialError
        no bundle in the folder
    """
    bundles = bundles_of(folder)
    if not bundles:
        raise TrialError(f"{folder}: no folder in it holds a trial.toml")
    target, shown = Path(out), progress or Progress()
    work = partial(_one, target, options)
    with shown.stage("bundles", len(bundles)) as stage:
        for name, word in executor.in_order(work, bundles):
            stage.step(info=f"{name} {word}")
    records, failures = {}, {}
    for bundle in bundles:
        note = json.loads((target / bundle.name / NOTE).read_text("utf-8"))
        if note["failure"]:
            failures[bundle.name] = note["failure"]
        else:
            records[bundle.name] = json.loads((target / bundle.name / "diagnosis.json").read_text("utf-8"))
    sharing = share_coefficients(records, _models(target, records, options.get("effects")))
    return FleetResult(
        records, failures, tuple(shared_effects(records)), tuple(shared_parameters(records)), sharing
    )


def _models(
    target: Path, names: Iterable[str], effects: str | os.PathLike[str] | None
) -> dict[str, DiagnosedModel | str]:
    """Diagnosed models that are there, or why one is not."""
    out: dict[str, DiagnosedModel | str] = {}
    for name in names:
        if not (target / name / MODEL_FILE).exists():
            out[name] = "it keeps no model"
            continue
        try:
            out[name] = read_diagnosed(target / name, declared_effects(effects))
        except BayesidError as error:
            out[name] = str(error)
    return out


def _one(target: Path, options: Mapping[str, Any], bundle: Path) -> tuple[str, str]:
    """One bundle, unless it is there; name and verdict."""
    out, failure, word = target / bundle.name, "", "failed"
    try:
        trial = load_trial(bundle)
        key = _key(trial, options)
        if (kept := _kept(out, key)) is not None:
            return bundle.name, f"{kept} (kept)"
        found = diagnose(trial, journal=out, threads=1, **options)
        word = found.verdict
        if isinstance(found, InputResult):
            reasons = [f.says for f in found.checked.findings] or list(found.reasons)
            failure = f"{word}: {'; '.join(reasons)}"
        found.save(out)
    except BayesidError as error:
        key, failure = "", str(error)
    write_json(out / NOTE, {"key": key, "verdict": word, "failure": failure})
    return bundle.name, word


def _key(trial: Trial, options: Mapping[str, Any]) -> str:
    """All that a diagnosis depends on, vehicle and effects by content: a file may change under its name."""
    rest = {n: v for n, v in options.items() if n not in ("vehicle", "effects")}
    vehicle = vehicle_of(options.get("vehicle"), trial).digest
    effects = options.get("effects")
    try:
        source = hashlib.sha256(read_regular(effects, LARGEST_EFFECTS)).hexdigest() if effects else ""
    except UnreadableError:
        source = ""  # `diagnose` says what is wrong with it
    return f"{trial.digest}|{vehicle}|{source}|{loaded_code()}|{sorted(rest.items())!r}"


def _kept(out: Path, key: str) -> str | None:
    """Verdict that is there for a key."""
    try:
        note = json.loads((out / NOTE).read_text("utf-8"))
        there = (out / "diagnosis.json").exists() and note["key"] == key
        return str(note["verdict"]) if there else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


@dataclass(frozen=True, eq=False, repr=False)
class FleetResult(Result):
    """Diagnoses of many bundles.

    Attributes
    ----------
    records : name -> what its diagnosis.json holds
    failures : name -> why it has no verdict
    effects, parameters : what the bundles share
    sharing : coefficients of each vehicle over its bundles, and which bundles do not count for them
    """

    records: Mapping[str, Mapping[str, Any]]
    failures: Mapping[str, str]
    effects: tuple[SharedEffect, ...]
    parameters: tuple[SharedParameter, ...]
    sharing: CoefficientSharing = NO_SHARING

    def record(self) -> Mapping[str, Any]:
        return {
            "format": 1,
            "verdicts": {n: r["verdict"] for n, r in self.records.items()},
            "failures": dict(self.failures),
            "effects": [asdict(e) for e in self.effects],
            "parameters": [asdict(p) | {"changed": p.changed} for p in self.parameters],
            "coefficients": sharing_record(self.sharing),
        }

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per bundle."""
        rows: list[list[Any]] = []
        for name, r in self.records.items():
            named = ", ".join(e["name"] for e in r["effects"])
            rows.append([name, r["trial"]["vehicle"], r["verdict"], named])
        return table(("bundle", "vehicle", "verdict", "effects"), rows)

    def coefficients(self) -> pandas.DataFrame:
        """One row per vehicle, coefficient and bundle, in the units of the vehicle file."""
        return table(COEFFICIENT_COLUMNS, coefficient_rows(self.sharing))

    def report(self) -> Report:
        return fleet_report(self.records, self.failures, self.effects, self.parameters, self.sharing)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        target = Path(folder)
        write_json(target / "fleet.json", dict(self.record()))
        page = writer.write(self.report(), target, dict(self.record()))
        write_shared_vehicles(self.sharing, target / SHARED)
        return page

    def summary(self, verbose: bool = False) -> str:
        lines = [f"{n}: {verdict_words(r)}" for n, r in self.records.items()]
        lines += [f"{n}: no verdict: {why}" for n, why in self.failures.items()]
        lead = fleet_lead(self.records, self.failures, self.effects, self.parameters, self.sharing)
        return "\n".join([plain(lead), "", *lines])
