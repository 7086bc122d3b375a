"""`bayesid trial measure`: advance, overshoots and the like of logged runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bayesid.cli.choices import Bundle, Data
from bayesid.cli.options import Json, Out, Verbose

if TYPE_CHECKING:
    from bayesid.trials import Run


def measure(
    bundle: Bundle, data: Data = None, out: Out = None, as_json: Json = False, verbose: Verbose = False
) -> None:
    """Measure the standard manoeuvres of a bundle (turning circle, pull-out, zig-zag, spiral)."""
    from bayesid.cli.output import print_json, print_text
    from bayesid.cli.run_measures import print_measures
    from bayesid.files import write_json
    from bayesid.trials import load_trial

    trial = load_trial(bundle, data)
    results: dict[str, dict[str, Any]] = {
        run.name: {"manoeuvre": run.manoeuvre, "role": run.role, "measures": _measures(run)}
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


def _measures(run: Run) -> list[dict[str, Any]]:
    """Measures of one run; the ordered angle is used where it is logged, else the measured one."""
    from bayesid.measures import named_measures as measured

    channels = dict(run.data)
    for fin in ("delta_r", "delta_s"):
        angle = run.commands.get(f"{fin}_cmd", run.measured_inputs.get(fin))
        if angle is not None:
            channels[fin] = angle
    return measured(run.manoeuvre, run.t, channels)
