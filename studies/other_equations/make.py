"""Labelled campaigns of vehicles whose equations are not bayesid's, as the study of them scores.

Usage: python -m studies.other_equations.make --out FOLDER --seed N --count K [--only CAUSE]. Of 16 campaigns
3 have no cause, 9 one listed, 2 two listed, 2 one that is not listed, or all the one that is asked for;
vehicles, sizes, sensors and sea are drawn. A bundle that is there already is kept. labels.json has the
fields of `practice_foreign`; `form_gap_pieces` and `effect_over_form_gap` are of the nominal simulator in
the bundle.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bayesid.benchmark.other_equations import (
    LISTED,
    UNLISTED,
    VEHICLES,
    Campaign,
    draw_campaign,
    executed,
    other_vehicle,
)
from bayesid.benchmark.other_equations.bundles import write_bundle
from bayesid.benchmark.other_equations.causes import ANY_LARGEST, LARGEST
from bayesid.benchmark.other_equations.evidence import evidence
from bayesid.benchmark.protocol.commitment import read_json
from bayesid.files import write_json
from bayesid.lock import lock_or_exit
from bayesid.progress import Progress
from studies.other_equations.form_gap import form_gap
from studies.other_equations.tune import PRIOR, TUNED

KINDS = ("none",) * 3 + ("effect",) * 9 + ("two",) * 2 + ("outside",) * 2
CLASSES = ((12.0, "undetectable"), (150.0, "faint"), (3000.0, "moderate"), (float("inf"), "clear"))
NEED_FULL = ("gyro_scale", "velocity_latency")
SENSORS = (*NEED_FULL, "heading_bias", "heading_drift", "position_lever_arm")
TRACK_ONLY = 0.25  # share of campaigns that log position and heading only
SEAS = ("none", "calm", "mid")
SEA_ODDS = (0.5, 0.25, 0.25)
AIM = (2.5, 100.0)  # effect over form gap of causes of the motion, drawn on a log scale
SENSOR_SIZES = (0.6, 1.6)
LEAST_SIZE = 0.3


def plan(seed: int, count: int, only: str | None = None) -> list[dict[str, Any]]:
    """Vehicle, causes, suite, sea and seed of every campaign; listed causes come round before any repeats.

    Parameters
    ----------
    only : the one cause of every campaign, in place of what would be drawn
    """
    rng = np.random.default_rng([seed, 16])
    kinds = [KINDS[k % len(KINDS)] for k in range(count)]
    bodies = [VEHICLES[k % len(VEHICLES)] for k in range(count)]
    bag: list[str] = []
    made = []
    for k, (kind, body) in enumerate(zip(rng.permutation(kinds), rng.permutation(bodies), strict=True)):
        causes: list[str] = []
        for _ in range({"none": 0, "effect": 1, "two": 2, "outside": 0}[str(kind)]):
            bag = bag or [str(n) for n in rng.permutation(list(LISTED))]
            fits = [n for n in bag if n not in other_vehicle(str(body)).without and n not in causes]
            causes.append(fits[0] if fits else str(rng.choice(["ocean_current", "rudder_offset"])))
            if causes[-1] in bag:
                bag.remove(causes[-1])
        if kind == "outside":
            causes = [str(rng.choice(list(UNLISTED)))]
        if only is not None:
            causes = [only]
        track = rng.random() < TRACK_ONLY and not set(causes) & set(NEED_FULL)
        made.append({
            "seed": 1000 * seed + k, "vehicle": str(body), "causes": causes,
            "suite": "track" if track else "full", "sea": str(rng.choice(SEAS, p=SEA_ODDS)),
            "aims": [AIM[0] * (AIM[1] / AIM[0]) ** float(rng.uniform()) for _ in causes],
            "sizes": [float(rng.uniform(*SENSOR_SIZES)) for _ in causes],
        })  # fmt: skip
    return made


def drawn(row: Mapping[str, Any], sizes: Sequence[float]) -> Campaign:
    """Campaign of a row of `plan`."""
    return draw_campaign(row["seed"], row["vehicle"], row["causes"], sizes, row["suite"], row["sea"])


def sizes(row: Mapping[str, Any], vehicle: str) -> list[float]:
    """Sizes of the causes of a row; those of the motion have about the effect over form gap aimed at.

    Evidence goes with the square of a small size: one step from the usual one, within what the name allows.
    """
    out = []
    for name, aim, given in zip(row["causes"], row["aims"], row["sizes"], strict=True):
        if name in SENSORS:
            out.append(given)
            continue
        campaign = drawn({**row, "causes": [name]}, [1.0])
        runs = executed(campaign)
        usual = evidence(campaign, runs)["D_pieces"] / form_gap(campaign, runs, vehicle)["chi2"]
        top = LARGEST.get(name, ANY_LARGEST)
        out.append(min(max(math.sqrt(aim / usual), LEAST_SIZE), top) if usual > 0 else top)
    return out


def label(name: str, campaign: Campaign, runs: Any, vehicle: str) -> dict[str, Any]:
    """What is true of a campaign, with how plainly it shows."""
    c = campaign
    gap, shown = form_gap(c, runs, vehicle), evidence(c, runs)
    names = [p.name for p in c.planted]
    each = None
    if len(names) > 1:
        each = [{"name": n, **evidence(c, runs, [m for m in names if m != n])} for n in names]
    text = "outside" if set(names) & set(UNLISTED) else "+".join(names) or "none"
    return {
        "name": name,
        "vehicle": c.vehicle.text,
        "label": text,
        "effects": [{"name": p.name, "params": dict(p.parameters), "more": dict(p.more)} for p in c.planted]
        or [{"name": "none", "params": {}}],
        "channels": c.suite,
        "prior_relative_sd": PRIOR,
        "noise_sigma_SI": c.sigma,
        "sea": None if c.sea_name == "none" else {"name": c.sea_name, "force_rms": c.sea, "tau": c.sea_tau},
        "runs": [{"file": f"{r.name}.csv", "manoeuvre": r.manoeuvre, "role": r.role, "seconds": r.duration}
                 for r in c.runs],
        **shown,
        "D_each": each,
        "evidence_class_pieces": _class(shown["D_pieces"]) if names else "none",
        "form_gap_pieces": gap,
        "effect_over_form_gap": shown["D_pieces"] / gap["chi2"],
        "seed": c.seed,
    }  # fmt: skip


def _class(value: float) -> str:
    return next(word for top, word in CLASSES if value < top)


def write_campaign(row: Mapping[str, Any], name: str, folder: Path) -> dict[str, Any]:
    """Write the bundle of one row of a plan, over what is there; gives its label."""
    text = (TUNED / f"{row['vehicle']}.toml").read_text("utf-8")
    campaign = drawn(row, sizes(row, text))
    runs = executed(campaign)
    for stale in folder.glob("*"):  # of a run that was stopped within this bundle
        stale.unlink()
    write_bundle(campaign, runs, text, folder)
    return label(name, campaign, runs, text)


def main(out: Path, seed: int, count: int, only: str | None = None) -> list[dict[str, Any]]:
    """Write bundles and labels.json."""
    progress, labels = Progress(), []
    with progress.stage("campaigns", count) as stage:
        for k, row in enumerate(plan(seed, count, only)):
            name, kept = f"o{k + 1:03d}", out / ".labels" / f"o{k + 1:03d}.json"
            if not kept.exists():
                write_json(kept, write_campaign(row, name, out / name))
            labels.append(read_json(kept, "a label"))
            stage.step(info=name)
    write_json(out / "labels.json", labels)
    return labels


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of bundles and labels")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=len(KINDS))
    parser.add_argument("--only", choices=[*LISTED, *UNLISTED], help="the one cause of every campaign")
    asked = parser.parse_args()
    lock_or_exit(asked.out, "studies/other_equations/make.py")
    main(asked.out, asked.seed, asked.count, asked.only)
