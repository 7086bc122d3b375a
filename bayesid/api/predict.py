"""`bayesid.predict`: what a diagnosed model says a run or a manoeuvre will do, with a 95 % band."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayesid.api.diagnose import diagnosis_route
from bayesid.api.inputs import (
    TrialLike,
    VehicleLike,
    declared_effects,
    model_of,
    ordered,
    scale_of,
    trial_of,
    vehicle_of,
)
from bayesid.api.mistaken_log import mistaken_log, with_held_out_checked
from bayesid.api.result import Result
from bayesid.diagnosis.diagnosed_file import read_diagnosed, write_diagnosed
from bayesid.diagnosis.diagnosed_model import DiagnosedModel, diagnosed_model_of
from bayesid.diagnosis.input import as_read, check_trial, missing_orders
from bayesid.diagnosis.run import diagnose
from bayesid.errors import BayesidError, ManoeuvreError, ModelError, TrialError
from bayesid.files import write_atomic, write_json
from bayesid.manoeuvres import REGISTRY
from bayesid.measures import named_measures
from bayesid.model.channels import channel
from bayesid.prediction.draws import DivergingDraws
from bayesid.prediction.intervals import (
    as_given,
    band_checks,
    beside_readings,
    measure_bands,
    of_estimate,
    of_mean,
    open_from,
    prediction_csv,
    shares_of_draws,
    stated_spread,
    told_measures,
)
from bayesid.prediction.manoeuvre_prediction import predict_manoeuvre
from bayesid.prediction.prediction import Prediction
from bayesid.prediction.run_prediction import predict_run
from bayesid.prediction.surroundings import surroundings
from bayesid.progress import Progress
from bayesid.report import predict_first_screen as first_screen
from bayesid.report.prediction_checks import LEVEL, MEASURED, failed_checks, of_source
from bayesid.report.prediction_figures import bands
from bayesid.report.writer import Figure, Report, Section, Table, Text, literal
from bayesid.report.writer.blocks import format_number
from bayesid.report.writer.text import table_text
from bayesid.simulation import with_shaft_speed
from bayesid.threads import one_blas_thread
from bayesid.trials import Run, Trial
from bayesid.trials.measured_wind import wind_words
from bayesid.trials.write import file_stem
from bayesid.words import did_you_mean, first_few

if TYPE_CHECKING:
    import pandas

SAME_LENGTH = 0.01  # by which two files of one vehicle may differ in length
AGAINST_COLUMNS = ("channel", "rms as given", "predicted", "largest", "inside the band [%]")
MEASURE_COLUMNS = ("measure", "as given", "predicted", "95 % from", "to", "unit")


@one_blas_thread
def predict(
    trial: TrialLike,
    what: str | Iterable[str] | None = None,
    *,
    model: str | os.PathLike[str] | None = None,
    data: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    vehicle: VehicleLike | None = None,
    effects: str | os.PathLike[str] | None = None,
    draws: int = 300,
    speed: float | None = None,
    rpm: float | None = None,
    dt: float | None = None,
    lead: float | None = None,
    sensor_noise: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
) -> PredictResult:
    """Predict runs of a trial and manoeuvres with a diagnosed model.

    Parameters
    ----------
    trial, data : as in `bayesid.fit`; of a run only the orders, the logged wind
        and the first readings are used
    what : names of runs, or manoeuvres such as "turn:20"; all runs if left out
    model : folder of `bayesid.fit` or `bayesid.diagnose`; without it the trial is diagnosed first
    out : folder for a CSV per prediction as it is made, and for a model diagnosed on the way
    vehicle, effects : for a diagnosis on the way, as in `bayesid.diagnose`
    draws : vehicles drawn from the posterior
    speed, rpm, dt : approach speed [m/s], shaft speed and step [s] of a manoeuvre
    lead : first seconds of a run that may be read, to begin on its track
    sensor_noise : widen the bands by the sensors' white noise

    Raises
    ------
    TrialError, VehicleError, ManoeuvreError, ModelError
        what cannot be read or predicted
    """
    logged = trial_of(trial, data)
    shown = progress or Progress(quiet=True)
    wanted = [what] if isinstance(what, str) else list(what or [run.name for run in logged.runs])
    _refuse_unknown(logged, wanted)  # before a diagnosis of minutes
    found = _model(logged, model, out, vehicle, effects, seed, shown)
    logged = with_shaft_speed(logged, found.model.vehicle)
    for name, text in missing_orders(logged, found.model.vehicle).items():
        if name in wanted:
            shown.note(text)
    if blown := wind_words(found.model.vehicle, logged):
        shown.note(blown)
    s = found.model.scales
    scale = scale_of(found.model, rpm, dt if dt is not None else s["L"] / s["U"] / 40)
    orders = ordered(found.model, (text for text in wanted if _run(logged, text) is None), scale, dt)
    predictions, rows, judged, drawn = [], [], [], []
    stage = f"predict {wanted[0] if len(wanted) == 1 else 'runs and manoeuvres'}"
    for text in shown.track(wanted, stage):
        run = _run(logged, text)
        try:
            if run is not None:
                p = predict_run(found, run, draws, seed, lead, logged.runs.index(run))
            else:
                p = predict_manoeuvre(found, text, orders[text], draws, seed, speed)
        except DivergingDraws as error:
            raise DivergingDraws(
                " ".join([f"{error}.", *of_source(found.verdict, found.failed_checks)])
            ) from error
        against = {}
        if run is not None:
            against = beside_readings(p, run, seed)
            judged.append(against)
            drawn.append(shares_of_draws(p, run, seed))
        measures = told_measures(p, named_measures)
        others = {"given": as_given(p), "estimate": of_estimate(p), "mean": of_mean(p)}
        for key, other in ((key, other) for key, other in others.items() if other is not None):
            errors = beside_readings(other, run, seed) if run is not None else {}
            against = {c: v | {f"rms_{key}": errors[c]["rms"]} for c, v in against.items()}
            if key != "mean":  # a measure has its own
                nominal = {m["quantity"]: m["mean"] for m in measure_bands(other, named_measures)}
                measures = [m | {key: nominal.get(m["quantity"])} for m in measures]
        row = _row(p, against, measures, found.verdict == "fit")
        if out is not None:
            row["file"] = f"{_file_name(text)}.csv"
            write_atomic(Path(out) / row["file"], prediction_csv(p, seed if sensor_noise else None))
        predictions.append(p)
        rows.append(row)
    record = {
        "trial": logged.name, "digest": logged.digest, "model": found.model.digest, "verdict": found.verdict,
        "hypotheses": [{"effects": h.effects, "weight": h.weight} for h in found.hypotheses],
        "left_out": None if found.left_out is None else [
            {"effects": list(names), "probability": p} for names, p in found.left_out.items()
        ],
        "surroundings": [asdict(s) for s in surroundings(found)],
        "coefficients_as_given": stated_spread(found), "seed": seed, "draws": draws, "band": LEVEL,
        "sensor_noise": sensor_noise, "model_failed_checks": list(found.failed_checks),
        "band_checks": band_checks(judged, drawn), "predictions": rows,
    }  # fmt: skip
    record["failed_checks"] = failed_checks(logged, record)
    if out is not None:
        write_json(Path(out) / "predictions.json", record)
    return PredictResult(logged, tuple(predictions), record)


def _model(
    trial: Trial,
    folder: str | os.PathLike[str] | None,
    out: str | os.PathLike[str] | None,
    vehicle: VehicleLike | None,
    effects: str | os.PathLike[str] | None,
    seed: int,
    progress: Progress,
) -> DiagnosedModel:
    """The diagnosed model, read or made."""
    extra = declared_effects(effects)
    if folder is not None:
        found = read_diagnosed(folder, extra)
        _check_vehicle(found, trial)
        return found
    progress.note("no model given: diagnosing first")
    model = model_of(trial, vehicle, extra)
    if lost := missing_orders(trial, model.vehicle):
        raise TrialError(f"{trial.name}: {'; '.join(lost.values())}")
    checked = check_trial(trial, model)
    for text in checked.left_open:
        progress.note(f"but {text}")
    if checked.findings:
        raise mistaken_log(trial.name, checked, "See `bayesid diagnose`; with --model the log is not checked")
    diagnosis = diagnose(
        as_read(trial, model), model, seed=seed, plan_next=False, keep_model=True,
        notify=progress.route(diagnosis_route(False, False, True, model.dof == 6)),
    )  # fmt: skip
    found = diagnosed_model_of(with_held_out_checked(diagnosis, trial, model.vehicle))
    if out is not None:
        write_diagnosed(found, out)
    return found


def _check_vehicle(found: DiagnosedModel, trial: Trial) -> None:
    """Refuse the model of a vehicle of another size than that of the trial, where the trial's can be read."""
    try:
        ours, other = found.model.vehicle, vehicle_of(None, trial)
    except BayesidError:
        return
    if abs(ours.L / other.L - 1.0) > SAME_LENGTH:
        raise ModelError(
            f"the model is of {ours.name}, {ours.L:.4g} m long, and the trial {trial.name} of {other.name}, "
            f"{other.L:.4g} m; give --model the folder of a diagnosis of this vehicle"
        )


def _run(trial: Trial, name: str) -> Run | None:
    return next((run for run in trial.runs if run.name == name), None)


def _refuse_unknown(trial: Trial, wanted: Iterable[str]) -> None:
    runs = [run.name for run in trial.runs]
    for text in wanted:
        head = text.partition(":")[0].partition(",")[0].strip()
        if text not in runs and head.lower() not in REGISTRY:
            raise ManoeuvreError(
                f"{text[:80]!r} is neither a run of the trial nor a manoeuvre"
                f"{did_you_mean([head], [*runs, *REGISTRY])}; runs: {first_few(runs, 12)}; manoeuvres: "
                f"{', '.join(REGISTRY)}"
            )


def _file_name(text: str) -> str:
    return re.sub("_+", "_", file_stem(text)).strip("_.")[:80] or "prediction"


def _row(
    p: Prediction, against: dict[str, Any], measures: list[dict[str, Any]], fitted: bool
) -> dict[str, Any]:
    late = p.t - p.t[0] > p.lead
    low, high = p.band()
    alone = first_screen.PREDICTED if p.estimate else first_screen.DIVERGES
    width = {c: float((high - low)[late, j].max()) for j, c in enumerate(p.channels)} if late.any() else {}
    return {
        "name": p.name, "manoeuvre": p.manoeuvre, "seconds": float(p.t[-1] - p.t[0]), "lead": p.lead,
        "told": first_screen.told_by(p), "estimate": alone if fitted else None,
        "diverged": p.lost, "widest_band": width, "heading_open_from": open_from(p),
        "against_readings": against, "measures": measures,
    }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class PredictResult(Result):
    """Predicted runs and manoeuvres.

    Attributes
    ----------
    predictions : draws, mean and band of every channel, in the order asked
    """

    trial: Trial
    predictions: tuple[Prediction, ...]
    numbers: Mapping[str, Any]

    @property
    def failures(self) -> Sequence[str]:
        """Checks that failed, one sentence or two each."""
        checks: Sequence[str] = self.numbers["failed_checks"]
        return checks

    def __getitem__(self, name: str) -> Prediction:
        """The prediction of that run or manoeuvre."""
        for p in self.predictions:
            if p.name == name:
                return p
        raise ModelError(
            f"nothing named {name!r} was predicted; there are {', '.join(p.name for p in self.predictions)}"
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per prediction and instant: t, and what is told, low, high of every channel [SI]."""
        import pandas

        frames = []
        for p in self.predictions:
            low, high = p.band(LEVEL)
            columns: dict[str, Any] = {"name": p.name, "t": p.t}
            for j, name in enumerate(p.channels):
                columns |= {name: p.told[:, j], f"{name}_low": low[:, j], f"{name}_high": high[:, j]}
            frames.append(pandas.DataFrame(columns))
        return pandas.concat(frames, ignore_index=True)

    def report(self) -> Report:
        rows = self.numbers["predictions"]
        sections = []
        for k, (p, row) in enumerate(zip(self.predictions, rows, strict=True), 1):
            run = _run(self.trial, p.name)
            noise = None if run is None else p.sensor_noise(self.numbers["seed"])
            band = p.band(LEVEL, noise)
            read, until = None if run is None else run.data, first_screen.mean_until(p)
            drawn = bands(p.t, p.channels, p.told, *band, read, p.lead, until)
            line = first_screen.told_by(p)
            caption = (
                f"Left: predicted track ({line}). Right: the same (line) and 95 % band of every other "
                "channel."
            )
            if run is not None:
                caption = (
                    f"Left: track as predicted (line: {line}) and as logged (dots). Right: every other "
                    f"channel, with the band in which {LEVEL:.0%} of the dots should lie. The model has read "
                    "the dots of the shaded part only."
                )
            blocks: list[Any] = [Figure(f"prediction{k:02d}", drawn, caption)]
            if row["against_readings"]:
                blocks.append(Table(AGAINST_COLUMNS, _against(row), digits=3))
            if row["measures"]:
                blocks.append(Table(MEASURE_COLUMNS, _measures(row)))
            if words := first_screen.estimate_words(row, self.numbers["draws"]):
                blocks.insert(1, Text(words))
            sections.append(Section(literal(p.name), blocks))
        lead = (
            f"**{literal(first_screen.headline(self.trial, self.predictions, rows))}**\n\n"
            + "".join(f"{literal(words)}\n\n" for words in first_screen.surroundings_words(self.numbers))
            + f"{literal(first_screen.drawn_words(self.numbers))}."
        )
        return Report(
            f"{self.trial.name}: predictions",
            lead,
            sections,
            [literal(words) for words in self.failures],
            first_screen.first_blocks(self.trial, self.predictions, rows),
        )

    def save(self, folder: str | os.PathLike[str]) -> Path:
        from bayesid.report import writer

        return writer.write(
            self.report(), folder, {"seeds": [self.numbers["seed"]], "predictions": self.numbers}
        )

    def record(self) -> Mapping[str, Any]:
        return self.numbers

    def summary(self, verbose: bool = False) -> str:
        lines = [first_screen.headline(self.trial, self.predictions, self.numbers["predictions"])]
        lines += first_screen.surroundings_words(self.numbers)
        lines += [f"CHECK FAILED: {words}" for words in self.failures]
        lines += ["", f"{first_screen.drawn_words(self.numbers)}."]
        for row in self.numbers["predictions"]:
            begun = f", begun on the first {row['lead']:.3g} s of its log" if row["lead"] else ""
            lines.append(f"\n{row['name']}: {row['seconds']:.0f} s{begun}")
            if words := first_screen.estimate_words(row, self.numbers["draws"]):
                lines.append(f"  {words}")
            elif row["diverged"]:
                lines.append(f"  left out, as they diverge: {row['diverged']} draws")
            if row["against_readings"]:
                lines.append(table_text(AGAINST_COLUMNS, _against(row), 3))
            if row["measures"]:
                lines.append(table_text(MEASURE_COLUMNS, _measures(row), 4))
        return "\n".join(lines)


def _against(row: Mapping[str, Any]) -> list[list[Any]]:
    rows: list[list[Any]] = []
    for name, v in row["against_readings"].items():
        factor, unit = channel(name).shown
        given = v.get("rms_given")
        errors = (None if given is None else factor * given, factor * v["rms"], factor * v["largest"])
        rows.append([f"{name} [{unit}]", *errors, 100 * v["inside"]])
    return rows


def _apart(mean: float, low: float, high: float) -> tuple[Any, Any, Any]:
    """The numbers, or texts with more digits where a table would write an end like the mean."""
    told = first_screen.band_text(mean, low, high, format_number)
    return told if told != tuple(map(format_number, (mean, low, high))) else (mean, low, high)


def _measures(row: Mapping[str, Any]) -> list[list[Any]]:
    """Measures that most draws have."""
    return [
        [m["quantity"], m.get("given"), *_apart(m["told"], m["low"], m["high"]), m["unit"]]
        for m in row["measures"]
        if m["share"] > MEASURED
    ]
