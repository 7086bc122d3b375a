"""`bayesid diagnose`: where the gap between simulator and trial lies, what causes it, how far it shrinks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bayesid.cli.guard import OK
from bayesid.cli.options import Json, Out, Quick, Seed, Verbose
from bayesid.cli.trial import Bundle, Data

Vehicle = Annotated[
    str | None, typer.Option("--vehicle", help="Built-in name or vehicle file instead of the trial's.")
]
AsBuilt = Annotated[
    float | None,
    typer.Option(
        "--as-built",
        metavar="SD",
        help="Coefficients known to this share from an earlier clean trial, e.g. 0.02.",
    ),
]
Effects = Annotated[
    Path | None,
    typer.Option("--effects", help="Python file whose EFFECTS are added to the catalogue; it is run."),
]

Exclude = Annotated[
    str | None,
    typer.Option(
        "--exclude",
        metavar="NAMES",
        help="Effects that cannot be here, e.g. wind,ocean_current in a towing tank.",
    ),
]

LARGEST_EFFECTS = 2**20  # bytes of a Python file


def diagnose(
    bundle: Bundle,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    as_built: AsBuilt = None,
    effects: Effects = None,
    exclude: Exclude = None,
    seed: Seed = 0,
    quick: Quick = False,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Diagnose the gap between a simulator and a trial.

    --out gets diagnosis.json, a report, posterior.nc where an effect is named (without --quick), and
    model.json for `bayesid predict`. Held-out runs are read only
    after the verdict stands.
    """
    from bayesid.diagnose.diagnosis import as_json as plain
    from bayesid.diagnose.diagnosis import diagnose as run
    from bayesid.diagnose.found import write_found
    from bayesid.files import json_text, write_json
    from bayesid.model import build_model, without_effects
    from bayesid.progress import Progress
    from bayesid.trials import load_trial
    from bayesid.vehicles import load_vehicle

    trial = load_trial(bundle, data=data)
    progress = Progress(quiet=as_json)
    model = build_model(load_vehicle(vehicle or trial.vehicle_ref), trial.dof, declared=declared(effects))
    model = without_effects(model, [n.strip() for n in (exclude or "").split(",") if n.strip()])
    found = run(
        trial,
        model,
        seed=seed,
        say=progress.note,
        as_built=as_built,
        plan_next=not quick,
        draw=out is not None and not quick,
        keep_model=out is not None,
    )
    record = plain(found)
    if out is not None:
        Path(out).mkdir(parents=True, exist_ok=True)
        write_json(Path(out) / "diagnosis.json", record)
    # told before the report: should drawing fail, the verdict is on the screen and in diagnosis.json
    if as_json:
        print(json_text(record))
    else:
        print(found.summary())
    if out is not None:
        if found.diagnosed is not None:
            write_found(found.diagnosed, out)
        if found.posterior is not None:
            found.posterior.posterior.to_netcdf(Path(out) / "posterior.nc")
        from bayesid.sections.diagnosis import write_diagnosis_report

        report = write_diagnosis_report(found, Path(out), record)
        progress.note(f"report: {report}")
    return OK


def declared(path: Path | None) -> tuple:
    """Effects of a user's Python file."""
    if path is None:
        return ()
    import runpy

    from bayesid.effects import Effect
    from bayesid.errors import ModelError
    from bayesid.files import UnreadableError, read_regular

    try:
        read_regular(path, LARGEST_EFFECTS)  # a pipe or a device would be waited for without end
        found = runpy.run_path(str(path)).get("EFFECTS", ())
    except UnreadableError as exc:
        raise ModelError(f"{path.name}: {exc}; give a Python file of effects") from None
    except (Exception, SystemExit) as exc:
        raise ModelError(f"{path.name}: cannot be run as a Python file of effects: {exc}") from None
    if not found or not all(isinstance(e, Effect) for e in found):
        raise ModelError(f"{path.name}: define EFFECTS, a tuple of bayesid.effects.Effect")
    return tuple(found)
