"""`bayesid trial`: looks at a trial bundle before anything is identified from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.cli.choices import Bundle, Data, Vehicle
from bayesid.cli.options import Json, Out, Verbose
from bayesid.cli.terminal import BAD_INPUT, OK, WRONG_LOG
from bayesid.words import and_list, counted

if TYPE_CHECKING:
    from bayesid.model.vehicles import Vehicle as Ship
    from bayesid.trials import Trial

RUDDER = "rudder [deg]"
RUN_COLUMNS = (
    "run",
    "role",
    "samples",
    "duration [s]",
    "step [s]",
    "gaps",
    "missing [%]",
    "speed [m/s]",
    RUDDER,
    "manoeuvre",
)


def check(
    bundle: Bundle,
    data: Data = None,
    vehicle: Vehicle = None,
    out: Out = None,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Read a bundle, list everything odd about it and what its channels hold.

    Ends with exit code 4 where the log has a mistake, 2 where its vehicle cannot be used, else 0.

    Mistakes of signs, units, axes and clock come first, each with the line of trial.toml that mends it; with
    a vehicle also those that kinematics alone does not tell.
    """
    from bayesid.api.check import check as run
    from bayesid.cli.output import print_json
    from bayesid.files import write_json
    from bayesid.model.vehicles import load_vehicle
    from bayesid.trials import load_trial, trial_summary

    trial = load_trial(bundle, data)
    problem = None if vehicle else _vehicle_problem(trial)
    found = run(trial, vehicle if problem is None else None, with_vehicle=problem is None)
    reference = vehicle or trial.vehicle_ref
    ship = load_vehicle(reference) if problem is None and reference else None
    summary = {**trial_summary(trial, ship), "vehicle_problem": problem, **found.record()}
    in_plane = ship is not None and trial.dof == 6 and ship.planar_only
    if in_plane:
        summary["dof"] = 3
    summary["warnings"] = [*found.held_out, *found.check.left_open, *summary["warnings"], *found.still]
    summary["warnings"] += filter(None, [found.wind])
    # one mend for one mistake
    summary["warnings"] = [w for w in summary["warnings"] if w.partition(".csv: ")[2] not in found.same]
    summary["warnings"] = [w for w in summary["warnings"] if w not in found.same]
    if out is not None:
        write_json(out / "trial_check.json", summary)
    if as_json:
        print_json(summary)
    else:
        _print(summary, found.mistakes, found.lacking, verbose, in_plane, ship)
    if problem is not None:
        return BAD_INPUT
    return WRONG_LOG if found.mistakes else OK


def _vehicle_problem(trial: Trial) -> str | None:
    """What is wrong with the vehicle a trial names; None if it can be read, or if none is named."""
    from bayesid.errors import VehicleError
    from bayesid.model.vehicles import load_vehicle

    if not trial.vehicle_ref:
        return None
    try:
        load_vehicle(trial.vehicle_ref)
    except VehicleError as error:
        return str(error)
    return None


def _print_list(sentences: Sequence[str]) -> None:
    from bayesid.cli.output import print_text

    for sentence in sentences:
        print_text(f"  - {sentence}")
    print_text()


def _print(
    summary: dict[str, Any],
    mistakes: Sequence[str],
    lacking: Sequence[str],
    verbose: bool,
    in_plane: bool = False,
    ship: Ship | None = None,
) -> None:
    from bayesid.cli.output import print_table, print_text
    from bayesid.model.vehicles.orders import has_fins
    from bayesid.words import grouped

    vehicle = Path(summary["vehicle"]).name or "not stated"
    held = f" ({len(summary['holdout'])} of them held out)" if summary["holdout"] else ""
    size = f"{counted(len(summary['runs']), 'run')}{held}, {summary['dof']} degrees of freedom"
    size += " (more are logged; the vehicle file has surge, sway and yaw only)" * in_plane
    print_text(f"{summary['name']}: {size}, vehicle {vehicle}")
    if summary["attribution"]:
        print_text(summary["attribution"])
    print_text()
    if mistakes:
        print_text(f"{counted(len(mistakes), 'mistake')} in the log:")
        _print_list(mistakes)
        if joint := summary["joint_mend"]:
            print_text(f"{joint[:1].upper()}{joint[1:]}.")
            print_text()
    if lacking:
        print_text("Not enough to say anything:")
        _print_list(lacking)
    ruddered = ship is None or has_fins(ship) or any(run["rudder_deg"] for run in summary["runs"])
    columns = [name for name in RUN_COLUMNS if ruddered or name != RUDDER]
    rows = [dict(zip(RUN_COLUMNS, _run_row(run), strict=True)) for run in summary["runs"]]
    print_table(columns, [[row[name] for name in columns] for row in rows], digits=3)
    print_text(_roles(summary))
    for line in _rudder_lines(summary["runs"], ship is not None):
        print_text(line)
    print_text()
    print_table(
        ["channel", "unit", "stated noise", "seen noise"],
        [[name, row["unit"], row["stated"], row["estimated"]] for name, row in summary["noise"].items()],
        digits=3,
    )
    if verbose:
        for run in summary["runs"]:
            print_text(
                f"\n{run['name']}: channels {', '.join(run['channels'])}; inputs {', '.join(run['inputs'])}"
                + (f"; further columns {', '.join(run['extra'])}" if run["extra"] else "")
            )
    if summary["input_in_order"]:
        print_text(f"\n{summary['input_in_order']}")
    remarks = summary["warnings"] if verbose else grouped(summary["warnings"])
    if remarks:
        print_text(f"\n{counted(len(remarks), 'remark')}:")
        for remark in remarks:
            print_text(f"  - {remark}")
    if summary["vehicle_problem"]:
        print_text(f"\nThe vehicle cannot be used:\n{summary['vehicle_problem']}")
    elif not (summary["warnings"] or mistakes or lacking):
        print_text("\nNothing odd found.")


def _roles(summary: dict[str, Any]) -> str:
    """What the roles mean, and that there is no run to judge by where none is held out."""
    if not summary["holdout"]:
        return (
            'No run is held out, so no prediction can be judged: give one `role = "holdout"` in trial.toml.'
        )
    return "A run with the role `holdout` is held out: read only to judge what was found from the others."


def _rudder_lines(runs: Sequence[dict[str, Any]], ship_known: bool) -> list[str]:
    """Whose angle `rudder [deg]` is, and to which side it counts."""
    each = {tuple(run["rudder_of"]) for run in runs}
    lines = []
    if ("delta_r",) in each:
        lines.append("Rudder angles count positive to port, whatever side the log counts.")
    for names in sorted(names for names in each if len(names) > 1):
        lines.append(
            f"rudder [deg] is the mean of {and_list(names)}, which steer together; positive to port."
        )
    alone = sorted(names[0] for names in each if len(names) == 1 and names != ("delta_r",))
    if alone and ship_known:
        lines.append(f"rudder [deg] is that of {' or '.join(alone)}, positive to port.")
    elif alone:
        lines.append(
            f"rudder [deg] is {' or '.join(alone)} alone, of those logged the one that moves most; which of "
            "them steer together a vehicle file tells (--vehicle)."
        )
    return lines


def _run_row(run: dict[str, Any]) -> list[Any]:
    missing = max(run["missing"].values(), default=0.0)
    return [
        run["name"],
        run["role"],
        run["samples"],
        run["duration"],
        run["dt"]["median"],
        run["n_gaps"],
        100.0 * missing,
        _span(run["speed"]),
        _span(run["rudder_deg"]),
        run["manoeuvre"],
    ]


def _span(limits: list[float] | None) -> str | None:
    return None if limits is None else f"{limits[0] + 0.0:.3g} to {limits[1] + 0.0:.3g}"  # no -0
