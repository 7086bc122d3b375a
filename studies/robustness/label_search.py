"""Does a blind pack tell its labels before anything is diagnosed? A search in sizes, digits and headers.

Usage: python -m studies.robustness.label_search PACK ANSWERS. Numbers anybody can take from a bundle without
a model, less what open factors explain of them, are ranked against each kind of label; the largest of all
|z| is compared with that of labels dealt out anew. Prints the plainest, and how often chance does as well.
"""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

DEALT = 2000  # times labels are dealt out anew
SHOWN = 6
# Open factors of a campaign, drawn apart from its cause: what they explain of the other numbers is taken out.
DESIGN = ("runs", "channels", "dof", "length of the manoeuvres' names", "force_rms")


def features(bundle: Path, commitments: dict[str, dict[str, str]]) -> dict[str, float]:
    """Numbers of a bundle that no answer should be readable from."""
    trial = tomllib.loads((bundle / "trial.toml").read_text("utf-8"))
    vehicle = (bundle / "vehicle.toml").read_text("utf-8")
    files = sorted(bundle.glob("r*.csv"), key=lambda p: int(p.stem[1:]))
    lines = [path.read_text("utf-8").split("\n") for path in files]
    cells = [cell for text in lines for row in text[1:] for cell in row.split(",")[1:] if cell]
    digits = np.array([int(c[-1]) for c in cells if c[-1].isdigit() and "." in c])
    noise = trial.get("noise", {})
    own = commitments[bundle.name]
    found = {
        "runs": len(files), "rows": sum(map(len, lines)), "channels": lines[0][0].count(","),
        "bytes a cell": sum(map(len, cells)) / len(cells),
        "bytes in all": sum(p.stat().st_size for p in files),
        "cells without a point": float(np.mean(["." not in c for c in cells])),
        "last digit, mean": digits.mean(), "last digit zero": float(np.mean(digits == 0)),
        "last digit odd": float(np.mean(digits % 2)),
        "last digits, spread": np.bincount(digits).std() / digits.size,
        "bytes of trial.toml": (bundle / "trial.toml").stat().st_size, "bytes of vehicle.toml": len(vehicle),
        "digits of vehicle.toml": float(sum(map(str.isdigit, vehicle))), "dof": trial["dof"],
        "held-out runs": sum(run["role"] == "holdout" for run in trial["runs"]),
        "length of the manoeuvres' names": sum(len(run.get("manoeuvre", "")) for run in trial["runs"]),
        "force_rms": trial.get("environment", {}).get("force_rms", -1.0),
        "duration": sum(float(text[-2].split(",")[0]) for text in lines),
        "number of its name": int(bundle.name[1:], 16), "digest of the bundle": int(own["bundle"][:8], 16),
        "digest of the answer": int(own["answer"][:8], 16),
    }  # fmt: skip
    found |= {f"noise of {c}": noise.get(c, -1.0) for c in ("x", "psi", "u", "v", "r")}
    first = lines[0][1].split(",")
    return found | {f"first reading {k}": float(c or 0.0) for k, c in enumerate(first[1:4])}


def search(pack: Path, answers: Path) -> dict[str, object]:
    """The largest rank statistics, and the share of dealt labels with as large a one."""
    commitments = json.loads((pack / "commitments.json").read_text("utf-8"))["bundles"]
    bundles = sorted(p.parent for p in pack.glob("*/trial.toml"))
    rows = [features(b, commitments) for b in bundles]
    names = list(rows[0])
    kinds = np.array([json.loads((answers / f"{b.name}.json").read_text("utf-8"))["kind"] for b in bundles])
    values = np.array([[float(row[n]) for n in names] for row in rows])
    keep = (values.std(axis=0) > 0) & ~np.isin(names, DESIGN)
    ranks = np.apply_along_axis(rankdata, 0, np.round(values - _by_design(values, names), 9))
    keep &= ranks.std(axis=0) > 0
    ranks = (ranks[:, keep] - ranks[:, keep].mean(axis=0)) / ranks[:, keep].std(axis=0)
    names = [n for n, k in zip(names, keep, strict=True) if k]
    told = sorted(set(kinds))

    def z(labels: np.ndarray) -> np.ndarray:
        out = []
        for kind in told:
            has = labels == kind
            out.append(ranks[has].sum(axis=0) / np.sqrt(has.sum() * (1.0 - has.mean())))
        return np.array(out)

    found, rng = z(kinds), np.random.default_rng(0)
    largest = np.abs(found).max()
    chance = np.mean([np.abs(z(rng.permutation(kinds))).max() >= largest for _ in range(DEALT)])
    order = np.argsort(-np.abs(found), axis=None)[:SHOWN]
    plainest = [
        (str(told[k // len(names)]), names[k % len(names)], round(float(found.flat[k]), 2)) for k in order
    ]
    return {
        "bundles": len(bundles), "numbers": len(names), "kinds": list(map(str, told)), "plainest": plainest,
        "as plain by chance": float(chance),
    }  # fmt: skip


def _by_design(values: np.ndarray, names: list[str]) -> np.ndarray:
    """What every number is by the open factors of a campaign, on average (linear; vehicles apart)."""
    columns = [np.ones(len(values))] + [values[:, names.index(n)] for n in DESIGN]
    vehicle = values[:, names.index("bytes of vehicle.toml")]
    columns += [(vehicle == one).astype(float) for one in np.unique(vehicle)[1:]]
    design = np.array(columns).T
    return design @ np.linalg.lstsq(design, values, rcond=None)[0]


if __name__ == "__main__":
    print(json.dumps(search(Path(sys.argv[1]), Path(sys.argv[2])), indent=1))
