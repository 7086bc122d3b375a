"""Coefficients that the bundles of a vehicle share, as plain data and as vehicle files.

Takes `diagnosis.shared_coefficients`. Computes nothing.
"""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bayesid.diagnosis.shared_coefficients import CoefficientSharing, SharedCoefficients
from bayesid.model.vehicles import write_vehicle

VEHICLE_FILE = "vehicle.toml"
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def sharing_record(sharing: CoefficientSharing) -> dict[str, Any]:
    """Plain data of fleet.json; coefficients and covariances in the units of the vehicle file."""
    return {
        "vehicles": [
            {
                "vehicle": s.vehicle.name,
                "digest": s.vehicle.digest,
                "bundles": list(s.bundles),
                "same": s.same,
                "any_changed": s.any_changed,
                "spread": s.spread,
                "spread_high95": s.spread_high,
                "changed": [c.name for c in s.changed],
                "coefficients": [
                    asdict(c) | {"told": c in s.changed, "furthest": c.furthest.bundle}
                    for c in s.coefficients
                ],
                "covariance": s.covariance.tolist(),
                "new_covariance": s.new_covariance.tolist(),
                "widened": list(s.widened),
                "cut": dict(s.cut),
            }
            for s in sharing.vehicles
        ],
        "left_out": dict(sharing.left_out),
    }


def write_shared_vehicles(sharing: CoefficientSharing, folder: Path) -> list[Path]:
    """Write a vehicle file with its covariance per vehicle, each in a folder of its name; the files of an
    earlier call go. None where no vehicle can have the coefficients: nothing could read it.
    """
    if folder.is_dir() and not folder.is_symlink():
        stem = VEHICLE_FILE.partition(".")[0]
        for old in folder.glob(f"*/{stem}.*"):
            old.unlink()
    out = []
    for name, s in zip(_names(sharing.vehicles), sharing.vehicles, strict=True):
        if not s.impossible:
            out.append(write_vehicle(s.as_vehicle(), folder / name / VEHICLE_FILE))
    return out


def _names(vehicles: tuple[SharedCoefficients, ...]) -> list[str]:
    """Folder names; two vehicles of one name have a piece of their digest in it."""
    plain = [_UNSAFE.sub("_", s.vehicle.name).strip("._") or "vehicle" for s in vehicles]
    return [
        n if plain.count(n) == 1 else f"{n}_{s.vehicle.digest[:8]}"
        for n, s in zip(plain, vehicles, strict=True)
    ]
