"""One campaign read at several rates: what is diagnosed of each.

Takes a seed and a cause. Executes a campaign of the independent plant at 10 Hz and diagnoses the same noisy
readings thinned. Gives plain records. Does not write reports.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bayesid.benchmark.plant import draw_campaign, write_bundle
from bayesid.benchmark.protocol.cause_families import families_of
from bayesid.benchmark.protocol.judgement import NAMING_VERDICTS
from bayesid.diagnosis.input import as_read
from bayesid.diagnosis.run import diagnose
from bayesid.equations.model import build_model
from bayesid.errors import BayesidError
from bayesid.model.vehicles import load_vehicle
from bayesid.trials import load_trial

FINEST = 0.1
INTERVALS = (FINEST, 0.2, 0.5, 1.0)  # between readings [s]
# Small vehicles, for which a second is about the time to travel a length. No cause comes first and last.
CASES = (
    (), ("ocean_current",), ("rudder_offset",), ("actuator_lag",), ("gyro_scale",), ("thrust_loss",),
    ("actuator_rate_limit",), ("heading_bias",), ("rudder_effectiveness",), (),
)  # fmt: skip
VEHICLES = ("lauv", "remus100", "delphin2")
SIZES = (0.5, 1.5)


@dataclass(frozen=True)
class Thinned:
    """One campaign to make."""

    seed: int
    causes: tuple[str, ...]
    vehicle: str

    @property
    def name(self) -> str:
        return f"{self.seed}-{'+'.join(self.causes) or 'none'}-{self.vehicle}"


def thinned_tasks(count: int, seed: int) -> list[Thinned]:
    """Causes and vehicles in turn."""
    return [Thinned(seed + k, CASES[k % len(CASES)], VEHICLES[k % len(VEHICLES)]) for k in range(count)]


def thinned_case(task: Thinned, intervals: Sequence[float] = INTERVALS) -> dict[str, Any]:
    """Execute the campaign at 10 Hz and diagnose it at every rate."""
    campaign = draw_campaign(
        task.seed, effects=task.causes, vehicle=task.vehicle, dof=3, sensors="full", sea="calm", rich=True,
        sizes=SIZES,
    )  # fmt: skip
    fine = tuple(replace(run, dt=FINEST) for run in campaign.runs if run.role == "identify")
    with TemporaryDirectory() as place:
        write_bundle(replace(campaign, runs=fine), Path(place) / "bundle", "campaign")
        trial = load_trial(Path(place) / "bundle")
        model = build_model(load_vehicle(trial.vehicle_ref), trial.dof)
        rates = []
        for interval in intervals:
            begun = time.process_time()
            given = as_read(trial, model, None if interval == FINEST else interval)
            try:
                record, failure = diagnose(given, model, plan_next=False).result.record(), ""
            except BayesidError as error:
                record, failure = {}, str(error)
            rates.append(_plain(interval, record, failure, time.process_time() - begun))
    sizes = {p.name: p.parameters for p in campaign.planted}
    return asdict(task) | {"planted": sizes, "length_time": _length_time(model), "rates": rates}


def disjoint(rates: Sequence[Mapping[str, Any]]) -> bool:
    """Whether two rates name, and no family is in both names."""
    named = [families_of(r["named"]) for r in rates if r["named"]]
    return any(not (a & b) for i, a in enumerate(named) for b in named[i + 1 :])


def wrong(record: Mapping[str, Any]) -> list[tuple[float, str]]:
    """(interval [s], name) of names that were not planted."""
    true = families_of(record["causes"])
    return [(r["interval"], n) for r in record["rates"] for n in r["named"] if not families_of([n]) & true]


def _plain(interval: float, record: Mapping[str, Any], failure: str, spent: float) -> dict[str, Any]:
    word = record.get("verdict", "failed")
    acting = record.get("acting", {})
    effects = [e["name"] for e in record.get("effects", ())] if word in NAMING_VERDICTS else []
    return {
        "interval": interval,
        "word": word,
        "named": effects,
        "acting": {n: acting.get(n) for n in effects},
        "set95": list(record.get("set95", ())),
        "coarse": [w for w in record.get("warnings", ()) if "apart" in w and "rudder" in w],
        "failure": failure,
        "cpu_seconds": spent,
    }


def _length_time(model: Any) -> float:
    return float(model.scales["L"] / model.scales["U"])
