"""Many diagnoses beside one another: what all bundles share, what belongs to one vehicle, what changed when.

Takes the records of single diagnoses, as diagnosis.json holds them, in the order in which the bundles were
logged. Gives frozen rows. Nothing is fitted again: every bundle keeps its own verdict. Coefficients are
shared by `shared_coefficients`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy.stats import chi2

from bayesid.diagnosis.hypotheses.rules import LEFT_OUT_WORSE, NAMING
from bayesid.diagnosis.result_parts import LEAST_MOVED, RunError
from bayesid.diagnosis.run_errors import closes, error_rows

# Probability below which estimates of several bundles are not of one value.
CHANGED = 0.01
# An effect is common where it acts, more probably than not, in more than this share of the bundles.
COMMON = 0.5


@dataclass(frozen=True)
class SharedEffect:
    """One effect over the bundles of one vehicle, or of all.

    Attributes
    ----------
    vehicle : "" for all
    effect : name
    acting, bundles : bundles in which it acts more probably than not, and all there are
    mean : mean probability that it acts
    names : the bundles in which it acts, in their order
    """

    vehicle: str
    effect: str
    acting: int
    bundles: int
    mean: float
    names: tuple[str, ...]


@dataclass(frozen=True)
class SharedParameter:
    """One effect parameter of one vehicle in the bundles whose verdict names the effect.

    Attributes
    ----------
    value, sd : mean weighted by 1/sd^2 (one value assumed)
    p : probability of differences as large as found if it had one value (Cochran's Q)
    each : (bundle, value, sd) in the order of the bundles
    """

    vehicle: str
    effect: str
    parameter: str
    unit: str
    value: float
    sd: float
    p: float
    each: tuple[tuple[str, float, float], ...]

    @property
    def changed(self) -> bool:
        """Whether it was not one value throughout."""
        return self.p < CHANGED


def verdict_words(record: Mapping[str, Any]) -> str:
    """A verdict for a table: "none" says where other coefficients are needed, and which moves most.

    They are where re-tuning alone brings the run of the headline nearer to its log, as in `answer`.
    """
    word = str(record["verdict"]).replace("_", " ")
    runs = record.get("runs") or ()
    if word != "none" or not runs or not closes(error_rows(_run_error(runs[0])), 0, 1):
        return word
    moved = {
        name: (m["retuned"] - m["given"]) / m["prior_sd"]
        for name, m in (record.get("moved") or {}).items()
        if m.get("prior_sd")
    }
    most = max(moved, key=lambda n: abs(moved[n]), default="")
    far = abs(moved[most]) if most else 0.0
    told = f" ({most} by {far:.1f} stated sd)" if far >= LEAST_MOVED else ""
    return f"none, but coefficients are off{told}"


def _run_error(record: Mapping[str, Any]) -> RunError:
    known = {f.name for f in fields(RunError)}
    return RunError(**{k: v for k, v in record.items() if k in known})


def shared_effects(records: Mapping[str, Mapping[str, Any]]) -> list[SharedEffect]:
    """Effects that act in at least one bundle, per vehicle and over all, most often first."""
    vehicles = sorted({_vehicle(r) for r in records.values()})
    out = []
    for vehicle in ["", *vehicles] if len(vehicles) > 1 else vehicles:
        some = {n: _acting(r) for n, r in records.items() if vehicle in ("", _vehicle(r))}
        effects = {e for acting in some.values() for e in acting} - {"none", "outside"}
        for effect in sorted(effects):
            p = {n: float(acting.get(effect, 0.0)) for n, acting in some.items()}
            names = tuple(n for n in p if p[n] > 0.5)
            if names:
                out.append(
                    SharedEffect(vehicle, effect, len(names), len(p), float(np.mean(list(p.values()))), names)
                )
    return sorted(out, key=lambda s: (s.vehicle, -s.acting, -s.mean))


def shared_parameters(records: Mapping[str, Mapping[str, Any]]) -> list[SharedParameter]:
    """Parameters of effects named in two bundles of one vehicle or more."""
    found: dict[tuple[str, str, str, str], list[tuple[str, float, float]]] = {}
    for name, record in records.items():
        if record["verdict"] not in NAMING:
            continue
        for effect in record["effects"]:
            for key, p in effect["parameters"].items():
                if p["sd"] and p["sd"] > 0:
                    place = (_vehicle(record), effect["name"], key, p["unit"])
                    found.setdefault(place, []).append((name, float(p["value"]), float(p["sd"])))
    return [_pooled(place, each) for place, each in sorted(found.items()) if len(each) > 1]


def _pooled(place: tuple[str, str, str, str], each: Sequence[tuple[str, float, float]]) -> SharedParameter:
    values, sd = (np.array([e[k] for e in each]) for k in (1, 2))
    weight = 1.0 / sd**2
    mean = float(weight @ values / weight.sum())
    q = float(weight @ (values - mean) ** 2)
    return SharedParameter(
        *place, mean, float(weight.sum() ** -0.5), float(chi2.sf(q, len(each) - 1)), tuple(each)
    )


def _acting(record: Mapping[str, Any]) -> Mapping[str, float]:
    """Probability that each effect acts; of none where runs left out took the names away."""
    return {} if record.get("rule") == LEFT_OUT_WORSE else record["acting"]


def _vehicle(record: Mapping[str, Any]) -> str:
    return str(record["trial"]["vehicle"])
