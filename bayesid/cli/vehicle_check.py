"""`bayesid vehicle check`: does a coefficient set make sense?"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from bayesid.cli.choices import Effects, VehicleName
from bayesid.cli.options import Json, Out, Verbose
from bayesid.cli.terminal import NOT_CONVERGED, OK

if TYPE_CHECKING:
    from bayesid.model.effects import Effect
    from bayesid.model.vehicles import Vehicle
    from bayesid.model.vehicles.stability import Stability

T = TypeVar("T")
DEG = math.pi / 180
REPETITIVE = {"switch", "reach", *(f"overshoot {k}" for k in range(4, 1000))}
LARGEST = 35 * DEG  # where a vehicle states no limit


def check(
    vehicle: VehicleName,
    effects: Effects = None,
    out: Out = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Check a vehicle: stability, how it turns and zig-zags, what no real vehicle does, and what it lacks for
    which command.

    Ends with exit code 3 where something is unphysical or contradictory, whatever else is worth knowing or
    missing. Effects of the file that nobody declares are refused, as any other command does.
    """
    from bayesid.api.inputs import declared_effects
    from bayesid.cli.output import print_json, print_table, print_text
    from bayesid.cli.run_measures import print_measures
    from bayesid.files import write_json
    from bayesid.model.vehicles import load_vehicle
    from bayesid.model.vehicles.check import check_vehicle
    from bayesid.model.vehicles.stability import stability
    from bayesid.model.vehicles.sufficient import lacking

    found = load_vehicle(vehicle)
    declared = declared_effects(effects)
    _refuse_unknown_effects(found, declared)
    findings = check_vehicle(found)
    result: dict[str, Any] = {"vehicle": found.name, "digest": found.digest, "findings": findings}
    straight = _or_none(stability, found)
    if straight is not None:
        result["stability"] = {
            "speed [m/s]": straight.U,
            "G_H": straight.G_H,
            "G_V": straight.G_V,
            "eigenvalues, horizontal [U/L]": [[value.real, value.imag] for value in straight.horizontal],
            "eigenvalues, vertical [U/L]": [[value.real, value.imag] for value in straight.vertical],
        }
    result["behaviour"] = behaviour = _behaviour(found, declared)
    result["lacking"] = lacks = lacking(found)
    if out is not None:
        write_json(out / "vehicle_check.json", result)
    warnings = [finding for finding in findings if finding.level == "warning"]
    code = NOT_CONVERGED if warnings else OK
    if as_json:
        print_json(result)
        return code
    print_text(f"{found.name}\n")
    if straight is not None:
        print_table(["straight run", "value", "meaning"], _stability_rows(straight, found))
    print_measures([{**item, "kind": item["manoeuvre"]} for item in behaviour], found.L)
    print_text()
    notes = [finding for finding in findings if finding.level != "warning"]
    for title, group in (("Unphysical or contradictory", warnings), ("Worth knowing", notes)):
        if group:
            print_text(f"{title}:")
            for finding in group:
                print_text(f"  - {finding.text}")
    if not warnings:
        print_text("Nothing unphysical found.")
    _print_lacking(lacks)
    return code


def _refuse_unknown_effects(vehicle: Vehicle, declared: tuple[Effect, ...]) -> None:
    """Refuse [effects] that nobody declares, as every command that simulates does."""
    from bayesid.equations.model import build_model
    from bayesid.model.effects import CATALOGUE
    from bayesid.model.effects.named import named_effects

    every = (*CATALOGUE, *named_effects(vehicle.actuators, vehicle.rpm_ref), *declared)
    if not set(vehicle.effects) <= {e.key(p.name) for e in every for p in e.parameters}:
        build_model(vehicle, 3, declared)  # knows the rest, refuses with the names that come near


def _print_lacking(lacks: dict[str, list[str]]) -> None:
    from bayesid.cli.output import print_text

    enough = [command for command, texts in lacks.items() if not texts]
    if enough:
        print_text(f"Nothing missing for: {', '.join(enough)}.")
    by_text: dict[str, list[str]] = {}
    for command, texts in lacks.items():
        for text in texts:
            by_text.setdefault(text, []).append(command)
    for text, commands in by_text.items():
        print_text(f"  - {', '.join(commands)}: {text}")


def _behaviour(vehicle: Vehicle, declared: tuple[Effect, ...]) -> list[dict[str, Any]]:
    """Turning circle and zig-zags in the horizontal plane from the usual straight run, planes amidships."""
    from bayesid.equations.model import build_model
    from bayesid.errors import BayesidError
    from bayesid.manoeuvres import Scale, parse
    from bayesid.measures import named_measures as measure
    from bayesid.model.vehicles.orders import rudder_limits, steers
    from bayesid.simulation import run_manoeuvre, steady_start

    found: list[dict[str, Any]] = []
    if not steers(vehicle):
        return found
    limit = rudder_limits(vehicle)[0]
    for text, angle in (("turn:20,side=starboard", 20), ("zigzag:10/10", 10), ("zigzag:20/20", 20)):
        if text.startswith("zigzag") and limit < angle * DEG * (1 - 1e-9):
            continue
        text = text if limit >= angle * DEG else "turn:" + f"{limit / DEG:.6g},side=starboard"
        try:
            model = build_model(vehicle, 3, declared)
            start = steady_start(model)
            speed = float(start[model.states.index("u")])
            rudder = min(limit, LARGEST)
            order = parse(text, Scale(vehicle.L, speed, vehicle.rpm_ref or 0.0, rudder, dof=3))
            track, commands = run_manoeuvre(model, model.nominal, order, start)
        except BayesidError as error:
            found.append({"manoeuvre": text, "rows": [], "reasons": {"not possible": str(error)}})
            continue
        channels = {name: track[name] for name in ("x", "y", "psi", "u", "v")}
        found += [
            {**item, "manoeuvre": text, "rows": [row for row in item["rows"] if row[0] not in REPETITIVE]}
            for item in measure(text, track.t, {**channels, "delta_r": commands["delta_r_cmd"]})
        ]
    return found


def _or_none(function: Callable[[Vehicle], T], vehicle: Vehicle) -> T | None:
    """The answer, or None where the set does not allow one (the findings say why)."""
    from bayesid.errors import VehicleError

    try:
        return function(vehicle)
    except (VehicleError, ArithmeticError, ValueError):
        return None


def _stability_rows(result: Stability, vehicle: Vehicle) -> list[list[Any]]:
    """Without the index of a plane in which thrusters hold the vehicle."""
    from bayesid.model.vehicles.orders import has_fins, left_to_itself

    def word(index: float | None, fins: str, there: bool) -> str:
        if index is None:
            return "the set lacks this plane"
        how = f"with fixed {fins}" if there else "with equal thrusts"
        return f"{'stable' if index > 0 else 'unstable'} {how}"

    rows: list[list[Any]] = [["speed [m/s]", result.U, "at which the set is judged"]]
    for name, index, fins in (("G_H", result.G_H, "rudder"), ("G_V", result.G_V, "planes")):
        upright = fins == "planes"
        seen = result.vertical if upright else result.horizontal
        if left_to_itself(vehicle, upright) or (index is None and not seen):
            rows.append([name, index, word(index, fins, has_fins(vehicle, upright))])
    for plane, values in (("horizontal", result.horizontal), ("vertical", result.vertical)):
        if values:
            text = ", ".join(f"{v.real:.3g}" + (f"{v.imag:+.3g}i" if v.imag else "") for v in values)
            rows.append([f"slowest eigenvalue, {plane} [U/L]", max(v.real for v in values), f"all: {text}"])
    return rows
