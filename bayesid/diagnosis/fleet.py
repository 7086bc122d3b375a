"""Many diagnoses beside one another: what all bundles share, what belongs to one vehicle, what changed when.

Takes the records of single diagnoses, as diagnosis.json holds them, in the order in which the bundles were
logged. Gives frozen rows. Nothing is fitted again: every bundle keeps its own verdict. Coefficients are
shared by `shared_coefficients`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from bayesid.diagnosis.hypotheses.rules import NAMING

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


def shared_effects(records: Mapping[str, Mapping[str, Any]]) -> list[SharedEffect]:
    """Effects that act in at least one bundle, per vehicle and over all, most often first."""
    vehicles = sorted({_vehicle(r) for r in records.values()})
    out = []
    for vehicle in ["", *vehicles] if len(vehicles) > 1 else vehicles:
        some = {n: r["acting"] for n, r in records.items() if vehicle in ("", _vehicle(r))}
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


def _vehicle(record: Mapping[str, Any]) -> str:
    return str(record["trial"]["vehicle"])
