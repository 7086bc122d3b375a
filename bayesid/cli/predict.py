"""`bayesid predict`: what the diagnosed model says a run or a manoeuvre will do, with a 95 % band."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesid.cli.diagnose import Effects, Vehicle
from bayesid.cli.guard import OK
from bayesid.cli.options import Json, Out, Seed, Verbose
from bayesid.cli.simulate import Shaft, Step
from bayesid.cli.trial import Bundle, Data

if TYPE_CHECKING:
    from bayesid.diagnose.found import Found
    from bayesid.diagnose.predict import Prediction
    from bayesid.trials import Run, Trial

What = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="RUN|MANOEUVRE...",
        help="Names of runs of the bundle, or manoeuvres such as turn:20 or table:commands.csv; all runs if "
        "left out.",
        show_default=False,
    ),
]
ModelFolder = Annotated[
    Path | None,
    typer.Option("--model", help="Folder that `bayesid diagnose --out` wrote; without it, diagnose first."),
]
Draws = Annotated[int, typer.Option("--draws", min=20, help="Vehicles drawn from the posterior.")]
Approach = Annotated[
    float | None, typer.Option("--speed", min=0.0, help="Approach speed of a manoeuvre [m/s].")
]
Lead = Annotated[
    float | None,
    typer.Option("--lead", min=1e-3, help="First seconds of a run that may be read, to begin on its track."),
]
Noisy = Annotated[bool, typer.Option("--sensor-noise", help="Widen the bands by the sensors' white noise.")]


def predict(
    bundle: Bundle,
    what: What = None,
    model: ModelFolder = None,
    data: Data = None,
    out: Out = None,
    vehicle: Vehicle = None,
    effects: Effects = None,
    draws: Draws = 300,
    speed: Approach = None,
    rpm: Shaft = None,
    dt: Step = None,
    lead: Lead = None,
    sensor_noise: Noisy = False,
    seed: Seed = 0,
    as_json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Predict runs and manoeuvres with the diagnosed model.

    --out gets one CSV per prediction: mean and 95 % band of every channel. Of a run in the bundle only the
    orders and the first readings are used.
    """
    from bayesid.cli.output import say_json
    from bayesid.diagnose.bands import beside_readings, measure_bands, prediction_csv
    from bayesid.diagnose.predict import predict_manoeuvre, predict_run
    from bayesid.files import write_atomic, write_json
    from bayesid.manoeuvres import parse
    from bayesid.measures import named_measures as measure
    from bayesid.progress import Progress
    from bayesid.trials import load_trial

    trial = load_trial(bundle, data=data)
    progress = Progress(quiet=as_json)
    found = _found(trial, model, out, vehicle, effects, seed, progress)
    wanted = list(what or [run.name for run in trial.runs])
    scale = _scale_of(found, rpm, dt)
    orders = {text: parse(text, scale) for text in wanted if _run(trial, text) is None}
    record: dict[str, Any] = {
        "trial": trial.name, "digest": trial.digest, "model": found.model.digest, "verdict": found.verdict,
        "hypotheses": [{"effects": h.effects, "weight": h.weight} for h in found.hypotheses],
        "seed": seed, "draws": draws, "band": 0.95, "sensor_noise": sensor_noise, "predictions": [],
    }  # fmt: skip
    for text in progress.track(wanted, "predictions"):
        run = _run(trial, text)
        if run is not None:
            p = predict_run(found, run, draws, seed, lead)
            against = beside_readings(p, run, seed)
        else:
            p, against = predict_manoeuvre(found, text, orders[text], draws, seed, speed), {}
        row = _row(p, against, measure_bands(p, measure))
        if out is not None:
            row["file"] = f"{_file_name(text)}.csv"
            write_atomic(out / row["file"], prediction_csv(p, seed if sensor_noise else None))
        record["predictions"].append(row)
    if out is not None:
        write_json(out / "predictions.json", record)
    if as_json:
        say_json(record)
    else:
        _tell(record, out)
    return OK


def _found(
    trial: Trial,
    folder: Path | None,
    out: Path | None,
    vehicle: str | None,
    effects: Path | None,
    seed: int,
    progress: Any,
) -> Found:
    """The diagnosed model, read or made."""
    from bayesid.cli.diagnose import declared
    from bayesid.diagnose.found import found_in, read_found, write_found

    extra = declared(effects)
    if folder is not None:
        return read_found(folder, extra)
    from bayesid.diagnose.diagnosis import diagnose
    from bayesid.model import build_model
    from bayesid.vehicles import load_vehicle

    progress.note("no --model given: diagnosing first")
    model = build_model(load_vehicle(vehicle or trial.vehicle_ref), trial.dof, declared=extra)
    found = found_in(diagnose(trial, model, seed=seed, say=progress.note, plan_next=False))
    if out is not None:
        write_found(found, out)
    return found


def _scale_of(found: Found, rpm: float | None, dt: float | None) -> Any:
    from bayesid.cli.simulate import scale_of

    s = found.model.scales
    return scale_of(found.model, rpm, dt if dt is not None else s["L"] / s["U"] / 40)


def _run(trial: Trial, name: str) -> Run | None:
    return next((run for run in trial.runs if run.name == name), None)


def _file_name(text: str) -> str:
    import re

    return re.sub(r"[^A-Za-z0-9.-]+", "_", text).strip("_.")[:80] or "prediction"


def _row(p: Prediction, against: dict[str, Any], measures: list[dict[str, Any]]) -> dict[str, Any]:
    late = p.t - p.t[0] > p.lead
    low, high = p.band()
    width = {c: float((high - low)[late, j].max()) for j, c in enumerate(p.channels)} if late.any() else {}
    return {
        "name": p.name, "manoeuvre": p.manoeuvre, "seconds": float(p.t[-1] - p.t[0]), "lead": p.lead,
        "diverged": p.lost, "widest_band": width, "against_readings": against, "measures": measures,
    }  # fmt: skip


def _tell(record: dict[str, Any], out: Path | None) -> None:
    from bayesid.cli.output import say, say_table

    words = [f"{' + '.join(h['effects']) or 'no effect'} ({h['weight']:.0%})" for h in record["hypotheses"]]
    say(f"model: {', '.join(words)}")
    for row in record["predictions"]:
        say()
        begun = f", begun on the first {row['lead']:.3g} s of its log" if row["lead"] else ""
        say(f"{row['name']}: {row['seconds']:.0f} s{begun}")
        if row["diverged"]:
            say(f"  {row['diverged']} draws diverged and are left out")
        if row["against_readings"]:
            cells = [
                [name, v["rms"], v["largest"], 100 * v["inside"]]
                for name, v in row["against_readings"].items()
            ]
            say_table(["channel", "rms error (SI)", "largest", "inside the band [%]"], cells, 3)
        if row["measures"]:
            shown = [
                [m["quantity"], m["mean"], m["low"], m["high"], m["unit"]]
                for m in row["measures"]
                if m["share"] > 0.5
            ]
            say_table(["measure", "mean", "95 % from", "to", "unit"], shown, 4)
    if out is not None:
        say(f"\npredictions: {out / 'predictions.json'}")
