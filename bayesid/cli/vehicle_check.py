"""`bayesid vehicle check`: does a coefficient set make sense?"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from bayesid.cli.options import Json, Out, Verbose
from bayesid.cli.vehicle import Name

if TYPE_CHECKING:
    from bayesid.vehicles import Vehicle
    from bayesid.vehicles.stability import Stability

T = TypeVar("T")


def check(vehicle: Name, out: Out = None, as_json: Json = False, verbose: Verbose = False) -> None:
    """Check a vehicle: stability indices, and what no real vehicle does."""
    from bayesid.cli.output import say, say_json, say_table
    from bayesid.files import write_json
    from bayesid.vehicles import load_vehicle
    from bayesid.vehicles.check import check_vehicle
    from bayesid.vehicles.stability import stability

    found = load_vehicle(vehicle)
    findings = check_vehicle(found)
    result: dict[str, Any] = {"vehicle": found.name, "digest": found.digest, "findings": findings}
    straight = _or_none(stability, found)
    if straight is not None:
        result["stability"] = {
            "speed [m/s]": straight.U, "G_H": straight.G_H, "G_V": straight.G_V,
            "eigenvalues, horizontal [U/L]": [[value.real, value.imag] for value in straight.horizontal],
            "eigenvalues, vertical [U/L]": [[value.real, value.imag] for value in straight.vertical],
        }
    if out is not None:
        write_json(out / "vehicle_check.json", result)
    if as_json:
        say_json(result)
        return
    say(f"{found.name}\n")
    if straight is not None:
        say_table(["straight run", "value", "meaning"], _stability_rows(straight))
    say()
    warnings = [finding for finding in findings if finding.level == "warning"]
    notes = [finding for finding in findings if finding.level != "warning"]
    for title, group in (("Unphysical or contradictory", warnings), ("Worth knowing", notes)):
        if group:
            say(f"{title}:")
            for finding in group:
                say(f"  - {finding.text}")
    if not warnings:
        say("Nothing unphysical found.")


def _or_none(function: Callable[[Vehicle], T], vehicle: Vehicle) -> T | None:
    """The answer, or None where the set does not allow one (the findings say why)."""
    from bayesid.errors import VehicleError

    try:
        return function(vehicle)
    except (VehicleError, ArithmeticError, ValueError):
        return None


def _stability_rows(result: Stability) -> list[list[Any]]:
    def word(index: float | None) -> str:
        if index is None:
            return "the set lacks this plane"
        return "stable with fixed rudder" if index > 0 else "unstable with fixed rudder"

    rows: list[list[Any]] = [
        ["speed [m/s]", result.U, "at which the set is judged"],
        ["G_H", result.G_H, word(result.G_H)],
        ["G_V", result.G_V, word(result.G_V).replace("rudder", "planes")],
    ]
    for plane, values in (("horizontal", result.horizontal), ("vertical", result.vertical)):
        if values:
            text = ", ".join(f"{v.real:.3g}" + (f"{v.imag:+.3g}i" if v.imag else "") for v in values)
            rows.append([f"slowest eigenvalue, {plane} [U/L]", max(v.real for v in values), f"all: {text}"])
    return rows
