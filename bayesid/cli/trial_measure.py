"""`bayesid trial measure`: advance, overshoots and the like of logged runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bayesid.cli.choices import Bundle, Data, Vehicle
from bayesid.cli.options import Json, Out, Verbose

if TYPE_CHECKING:
    from bayesid.model import vehicles
    from bayesid.trials import Run, Trial


def measure(
    bundle: Bundle,
    data: Data = None,
    vehicle: Vehicle = None,
    out: Out = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Measure the standard manoeuvres of a bundle (turning circle, pull-out, zig-zag, spiral).

    The named rudders of a vehicle count as one, at their mean angle.
    """
    from bayesid.cli.output import print_json, print_text
    from bayesid.cli.run_measures import print_measures
    from bayesid.files import write_json
    from bayesid.trials import load_trial

    trial = load_trial(bundle, data)
    ship, problem = _ship_of(trial, vehicle)
    results: dict[str, dict[str, Any]] = {
        run.name: {"manoeuvre": run.manoeuvre, "role": run.role, "measures": _measures(run, ship, problem)}
        for run in trial.runs
    }
    if out is not None:
        write_json(out / "trial_measures.json", results)
    if as_json:
        print_json(results)
        return
    for name, result in results.items():
        print_text(f"{name}: {result['manoeuvre'] or 'no description'}")
        print_measures(result["measures"])
        if not result["measures"]:
            print_text("  no standard manoeuvre named")
        print_text()


def _ship_of(trial: Trial, named: str | None) -> tuple[vehicles.Vehicle | None, str]:
    """The vehicle, which says which named rudders steer together, and why there is none where it matters."""
    from bayesid.errors import VehicleError
    from bayesid.model.channels import ACTUATOR_NAMES
    from bayesid.model.vehicles import load_vehicle

    if named:
        return load_vehicle(named), ""
    own = {f"delta_{name}" for name in ACTUATOR_NAMES}
    if not any(name in own for run in trial.runs for name in _angles(run)):
        return None, ""
    if not trial.vehicle_ref:
        return None, "the named rudders of which vehicle are logged? (--vehicle)"
    try:
        return load_vehicle(trial.vehicle_ref), ""
    except VehicleError as error:
        return None, f"the vehicle that says which rudders steer cannot be read: {error}"


def _angles(run: Run) -> set[str]:
    """Actuators that are logged, ordered or measured."""
    return {name.removesuffix("_cmd") for name in (*run.commands, *run.measured_inputs)}


def _measures(run: Run, vehicle: vehicles.Vehicle | None, problem: str) -> list[dict[str, Any]]:
    """Measures of one run; the ordered angle is used where it is logged, else the measured one."""
    from bayesid.cli.run_measures import measured_channels
    from bayesid.measures import named_measures as measured

    found = measured(run.manoeuvre, run.t, measured_channels(run, vehicle))
    if problem and "delta_r" not in _angles(run):
        for item in found:
            if "delta_r" in item["reasons"].get("all", ""):
                item["reasons"]["all"] += f"; {problem}"
    return found
