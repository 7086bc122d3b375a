"""The first screen of predictions: what will happen and how sure, errors against a log, the picture.

Takes predictions and their rows of plain numbers. Does not simulate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.diagnosis.plain_words import in_words, number
from bayesid.diagnosis.run_errors import WORSE, name_of_run
from bayesid.measures.angle_errors import turns_note
from bayesid.prediction.intervals import open_from
from bayesid.prediction.prediction import Prediction
from bayesid.report import run_picture
from bayesid.report.prediction_checks import LEVEL, MEASURED
from bayesid.report.writer import Block, Figure, Row, Table, literal
from bayesid.trials import Run, Trial
from bayesid.words import first_few

DEGREE = 180 / math.pi
MOST_ROWS, MOST_MEASURES, MOST_LEFT_OUT, MOST_PLACES = 8, 2, 4, 9
ALL = 0.995  # share of the vehicles drawn that is printed as all
FEW_INSIDE = 0.75  # share of a channel's readings in its 95 % band, below which it is told
ROUNDING = 1e-3  # of a band's width, up to which an end counts as the mean
SAME = 1e-7  # width of a band, over its ends, that is rounding
# What is told: of coefficients that are not fitted, of a fit of whose draws some diverge, of all others.
AS_GIVEN, ESTIMATE, MEAN = "coefficients as given", "estimate of the fit", "mean of the draws"
PREDICTED, DIVERGES = "predicted", "diverges"  # what the estimate of a fit does
LEAST_LEFT_OUT = 0.005  # probability from which one is told; it is printed with two decimals
Numbers = Mapping[str, Any]
# What a helmsman asks of a turn and of a zig-zag.
ASKED = ("tactical diameter", "advance", "overshoot 1", "overshoot 2", "steady yaw rate", "period")


def band_text(
    mean: float, low: float, high: float, text: Callable[[float], str] = number
) -> tuple[str, str, str]:
    """A mean and its band, with digits that tell both ends from the mean and from one another.

    Parameters
    ----------
    text : how a number is written where that tells them apart
    """
    told = (text(mean), text(low), text(high))
    least = ROUNDING * (high - low)
    gaps = [gap for gap in (high - low, abs(mean - low), abs(high - mean)) if gap > least]
    if not all(map(math.isfinite, (mean, low, high))) or not gaps:
        return told
    if high - low <= SAME * max(abs(low), abs(high)):
        return told  # all draws agree but for rounding, as on what was ordered
    alike = [a == b for a, b in ((told[1], told[2]), (told[0], told[1]), (told[0], told[2]))]
    differ = [abs(a - b) > least for a, b in ((low, high), (mean, low), (mean, high))]
    if not any(same and other for same, other in zip(alike, differ, strict=True)):
        return told
    places = min(max(math.ceil(-math.log10(min(gaps))), 0), MOST_PLACES)
    return f"{mean:.{places}f}", f"{low:.{places}f}", f"{high:.{places}f}"


def beside(value: float, texts: Sequence[str]) -> str:
    """A number to be compared with others, with no fewer decimals than they are written with."""
    if not math.isfinite(value):
        return number(value)
    return f"{value:.{max(len(text.partition('.')[2]) for text in (number(value), *texts))}f}"


def shown(predictions: Sequence[Prediction], rows: Sequence[Numbers]) -> int:
    """Position of the one to draw: the run the vehicle as given misses most, else the first."""

    def missed(k: int) -> float:
        return max((e.what[1] for e in _errors(rows[k])), default=-1.0)

    return max(range(len(rows)), key=lambda k: (missed(k), -k), default=0)


class _Error:
    """Position or heading: predicted, as given (nan where it diverges)."""

    def __init__(self, name: str, unit: str, what: tuple[float, float]) -> None:
        self.name, self.unit, self.what = name, unit, what


def _errors(row: Numbers, of: str = "rms") -> list[_Error]:
    """Errors of what is told, or of another of the vehicles that are simulated."""
    against = row["against_readings"]
    out = []
    if {"x", "y"} <= set(against):
        x, y = against["x"], against["y"]
        given = math.hypot(x.get("rms_given", math.nan), y.get("rms_given", math.nan))
        out.append(_Error("position", "m", (math.hypot(x.get(of, math.nan), y.get(of, math.nan)), given)))
    if "psi" in against:
        psi = against["psi"]
        given = DEGREE * psi.get("rms_given", math.nan)
        out.append(_Error("heading", "degrees", (DEGREE * psi.get(of, math.nan), given)))
    return out


def _rms_of_heading(row: Numbers) -> tuple[float, ...]:
    """Predicted and as given [rad]; empty where no heading is read."""
    psi = row["against_readings"].get("psi")
    return () if psi is None else (psi["rms"], psi.get("rms_given", math.nan))


def headline(trial: Trial, predictions: Sequence[Prediction], rows: Sequence[Numbers]) -> str:
    """One sentence: what the manoeuvre comes to with its band, or how far a log is missed."""
    if not rows:
        return "Nothing was predicted."
    k = shown(predictions, rows)
    row, errors = rows[k], _errors(rows[k])
    name = _name(trial, row)
    if errors:
        now = " and ".join(f"{number(e.what[0])} {e.unit}" for e in errors)
        given = " and ".join(
            f"{number(e.what[1])} {e.unit}" if math.isfinite(e.what[1]) else f"no {e.name} (it diverges)"
            for e in errors
        )
        worse = any(e.what[0] > WORSE * e.what[1] for e in errors if math.isfinite(e.what[1]))
        no_gain = "which is no gain: " if worse else ""
        return (
            f"The {name} is predicted within {now} of the log (rms), {no_gain}as given within {given}; "
            f"{_inside_words(trial, row, rows)}."
        )
    told = [
        "{quantity} of {0} {unit} (95 %: {1} to {2}".format(*texts, **m)
        + (f"; as given {beside(m['given'], texts)})" if m.get("given") is not None else ")")
        for m in _telling(row)[:MOST_MEASURES]
        for texts in [band_text(m["told"], m["low"], m["high"])]
    ]
    if told:
        return f"Predicted for {name}: {', '.join(told)}."
    if row["heading_open_from"] is not None:
        return f"What comes of {name} is not known: the 95 % band of its heading is wider than a full turn."
    width = row["widest_band"]
    if {"x", "y"} <= set(width):
        reach = 0.5 * math.hypot(width["x"], width["y"])
        return f"Predicted for {name}: the position is known to {number(reach)} m (95 %) at worst."
    return f"{name} is predicted with a 95 % band."


def _inside_words(trial: Trial, row: Numbers, rows: Sequence[Numbers]) -> str:
    """Share of the readings of a run inside the band, and the channel, of this run or another, that has few.

    Errors of a run go together, so that a right band holds far less than 95 % of some channel now and then.
    """
    said = f"{_inside(row)[0]:.0%} of its readings lie in the 95 % band"
    worst, elsewhere, channel, k = min(
        (share, other is not row, channel, k)
        for k, other in enumerate(rows)
        if other["against_readings"]
        for _, share, channel in [_inside(other)]
    )
    if worst >= FEW_INSIDE:
        return said
    where = f" in the {_name(trial, rows[k])}" if elsewhere else ""
    return f"{said}, of {channel}{where} only {worst:.0%}"


def _inside(row: Numbers) -> tuple[float, float, str]:
    """Share of a run's readings inside the band, the least of a channel, and that channel."""
    shares = {channel: float(each["inside"]) for channel, each in row["against_readings"].items()}
    worst = min(shares, key=lambda channel: shares[channel])
    return sum(shares.values()) / len(shares), shares[worst], worst


def told_by(p: Prediction) -> str:
    """Which vehicle, or mean of vehicles, a prediction is told by."""
    if not p.centres:
        return MEAN
    return AS_GIVEN if p.estimate is None else ESTIMATE


def estimate_words(row: Numbers, draws: int) -> str:
    """What the estimate of a fit alone predicts, what is told instead, and what it means that draws diverge;
    empty where the prediction is of a diagnosis.

    Parameters
    ----------
    draws : vehicles drawn, those that diverge among them
    """
    if row["estimate"] is None:
        return ""
    lost, drawn = row["diverged"], f"{draws - row['diverged']} vehicles drawn about it"
    if row["told"] == ESTIMATE:
        mean = _missed(row, "mean")
        off = f" ({mean} off)" if mean else ""
        return (
            f"Told is the estimate alone, as `bayesid fit` simulates it: of {draws} vehicles drawn about it "
            f"{lost} diverge{'s' if lost == 1 else ''}. The mean of the others is another track{off}, and "
            "the band, which is theirs, is less wide than the covariance of the fit makes it."
        )
    if row["estimate"] == DIVERGES:
        gone = f", as {'does' if lost == 1 else 'do'} {lost} more, left out" if lost else ""
        return f"The estimate alone diverges{gone}; told is the mean of {drawn}."
    alone = "The estimate alone, as `bayesid fit` simulates it"
    if missed := _missed(row, "estimate"):
        return f"{alone}, misses the log by {missed}; told is the mean of {drawn}."
    measures = [
        f"{m['quantity']} {number(m['estimate'])} {m['unit']}"
        for m in _telling(row)
        if m.get("estimate") is not None
    ][:MOST_MEASURES]
    return f"{alone}: {', '.join(measures)}; told is the mean of {drawn}." if measures else ""


def _missed(row: Numbers, by: str) -> str:
    """ "5.3 m and 22 degrees": errors of another vehicle than the one told, empty where no log is read."""
    return " and ".join(f"{number(e.what[0])} {e.unit}" for e in _errors(row, f"rms_{by}"))


def as_given_words(spread: tuple[float, float] | None, diverging: Sequence[str] = ()) -> str:
    """That no coefficient was fitted, how well they are taken to be known, and what is told; empty where they
    were.

    Parameters
    ----------
    spread : their least and largest stated standard deviation over their value
    diverging : predictions in which the vehicle with them diverges
    """
    if spread is None:
        return ""
    low, high = (f"{100 * s:.0f}" if s >= 0.1 else f"{100 * s:.2g}" for s in spread)
    instead = (
        f"; it diverges in {first_few(diverging, MOST_LEFT_OUT)}, where the mean of the draws stands"
        if diverging
        else ""
    )
    return (
        "; the coefficients are as given, not fitted: predicted is the vehicle that has them, undisturbed, "
        "and the bands come from their stated standard deviation "
        f"({low if low == high else f'{low} to {high}'} %){instead}"
    )


def drawn_words(numbers: Numbers) -> str:
    """Which explanations the vehicles are drawn from, how often each, and what probability is left out.

    Parameters
    ----------
    numbers : record of a prediction: verdict, draws, hypotheses, left_out, coefficients_as_given
    """
    if numbers["verdict"] == "fit":
        return f"{numbers['draws']} vehicles are drawn from the fit of the coefficients"
    shares: dict[str, float] = {}
    for h in numbers["hypotheses"]:
        name = _together(h["effects"])
        shares[name] = shares.get(name, 0.0) + h["weight"]
    listed = sorted(shares.items(), key=lambda item: -item[1])
    if len(listed) == 1:
        said = f"{numbers['draws']} vehicles are drawn, all with {listed[0][0]}"
    else:
        said = (
            f"{numbers['draws']} vehicles are drawn from {len(listed)} explanations: "
            f"{', '.join(f'{share:.0%} with {name}' for name, share in listed)}"
        )
    if numbers["left_out"] is not None:
        said += f"; {_left_out_words(numbers['left_out'])}"
    diverging = [row["name"] for row in numbers["predictions"] if row["told"] != AS_GIVEN]
    return said + as_given_words(numbers["coefficients_as_given"], diverging)


def surroundings_words(numbers: Numbers) -> list[str]:
    """What acts around the vehicle in the prediction, with its size, and on which heading a manoeuvre begins;
    nothing where nothing does.

    Parameters
    ----------
    numbers : record of a prediction: surroundings, predictions
    """
    told = [
        s["says"][:1].lower()
        + s["says"][1:].rstrip(".")
        + (f" (in {s['share']:.0%} of the vehicles drawn)" if s["share"] < ALL else "")
        for s in numbers["surroundings"]
    ]
    if not told:
        return []
    out = f"In this prediction {'; '.join(told)}."
    if any(not row["lead"] for row in numbers["predictions"]):
        out += (
            " Manoeuvres begin on heading 000 degrees: on another one, and in still water and air, their "
            "numbers are others."
        )
    return [out]


def _left_out_words(rows: Sequence[Numbers]) -> str:
    whole = sum(row["probability"] for row in rows)
    if whole < LEAST_LEFT_OUT:
        return "explanations left out have less than 0.01 of the probability"
    told = [
        f"{_together(row['effects'])} ({row['probability']:.2f})"
        for row in rows
        if row["probability"] >= LEAST_LEFT_OUT
    ]
    which = f": {first_few(told, MOST_LEFT_OUT)}" if told else ""
    if whole > 1.0 - LEAST_LEFT_OUT:
        return f"the explanations the diagnosis weighed are in none of them{which}"
    return f"explanations that hold {whole:.2f} of the probability are left out{which}"


def _together(names: Sequence[str]) -> str:
    if list(names) == ["outside"]:
        return "something not on the list"
    return " + ".join(in_words(n) for n in names if n != "none") or "no effect"


def first_blocks(trial: Trial, predictions: Sequence[Prediction], rows: Sequence[Numbers]) -> list[Block]:
    """Errors of every run, or measures, and the picture of one."""
    blocks: list[Block] = []
    if not rows:
        return blocks
    table = [_run_row(row) for row in rows if _errors(row)][:MOST_ROWS]
    if table:
        blocks.append(
            Table(
                [
                    "run", "position as given [m]", "predicted [m]", "heading as given [deg]",
                    "predicted [deg]", "readings in the 95 % band",
                ],
                table,
                "Errors (rms). Begun on the first seconds of each log; the rest of it was not read."
                + turns_note(x for row in rows for x in _rms_of_heading(row)),
            )
        )  # fmt: skip
    measures = [
        [
            literal(_name(trial, row)), f"{m['quantity']} [{m['unit']}]",
            "–" if m.get("given") is None else beside(m["given"], texts), texts[0],
            f"{texts[1]} to {texts[2]}",
        ]
        for row in rows
        if not _errors(row)
        for m in _telling(row)
        for texts in [band_text(m["told"], m["low"], m["high"])]
    ][:MOST_ROWS]  # fmt: skip
    if measures:
        blocks.append(Table(["manoeuvre", "measure", "as given", "predicted", "95 %"], measures))
    k = shown(predictions, rows)
    p, name = predictions[k], literal(_name(trial, rows[k]))
    run = next((r for r in trial.runs if r.name == p.name), None)
    drawn = picture_of(p, run)
    band = (
        "Blue: where 95 % of the small dots should lie. Grey: first seconds, read to begin on the track."
        if run is not None
        else "Blue: 95 % band; the thin tracks at the left are some of those it is made of."
    )
    if p.orders is not None and not p.centres:
        band += " The line is their mean: where they swing out of step, each of them swings further."
    if math.isfinite(mean_until(p)) and {"x", "y"} <= set(p.channels):
        band += f" The predicted track ends at {mean_until(p):.0f} s, from when on the heading is open."
    blocks.append(
        Row(
            (
                Figure("picture_track", run_picture.track(drawn), alt=f"Track of {name}"),
                Figure("picture_time", run_picture.over_time(drawn), alt=f"Heading of {name}"),
            ),
            f"{name[:1].upper()}{name[1:]}. {literal(run_picture.caption(drawn, band))}",
        )
    )
    return blocks


def picture_of(p: Prediction, run: Run | None) -> run_picture.RunPicture:
    """A prediction as a picture: as given, predicted mean, half width of the band, draws."""
    half = _half_width(p, run is not None)
    readings = np.full(p.mean.shape, np.nan)
    if run is not None:
        for j, channel in enumerate(p.channels):
            if channel in run.data:
                readings[:, j] = run.data[channel]
    series = [run_picture.Series("predicted", run_picture.BEST, p.told, mean_until(p))]
    if p.given is not None:
        series.insert(0, run_picture.Series("as given", run_picture.GIVEN, p.given))
    return run_picture.RunPicture(p.t, p.channels, readings, tuple(series), p.lead, half, p.draws)


def mean_until(p: Prediction) -> float:
    """Time from the start [s] up to which a mean of the draws is a track: where headings go all ways, it is
    none that a vehicle could sail."""
    known = None if p.centres else open_from(p)
    return math.inf if known is None else known


def _half_width(p: Prediction, noisy: bool) -> np.ndarray:
    """(n, q) how far from the line 95 % of the vehicles are, or of their readings."""
    rng = np.random.default_rng(0) if noisy else None
    if not p.centres:
        low, high = p.band(rng=rng)
        return np.asarray(0.5 * (high - low))
    off = p.draws - p.told
    if rng is not None:
        off = off + np.nan_to_num(p.noise) * rng.standard_normal(off.shape)
    return np.asarray(np.quantile(np.abs(off), LEVEL, axis=0))


def _run_row(row: Numbers) -> list[str]:
    """Errors of one run: as given and predicted, and the share of its readings in the band."""
    found = {e.name: e.what for e in _errors(row)}
    cells = [_cell(found[n][k]) if n in found else "–" for n in ("position", "heading") for k in (1, 0)]
    share, worst, channel = _inside(row)
    few = f"; {channel} {worst:.0%}" if worst < FEW_INSIDE else ""
    return [literal(row["name"]), *cells, f"{share:.0%}{few}"]


def _telling(row: Numbers) -> list[Numbers]:
    """Measures a helmsman asks for, most asked first."""
    there = {m["quantity"]: m for m in row["measures"] if m["share"] > MEASURED and math.isfinite(m["mean"])}
    return [there[q] for q in ASKED if q in there]


def _name(trial: Trial, row: Numbers) -> str:
    run = next((r for r in trial.runs if r.name == row["name"]), None)
    return row["name"] if run is None else name_of_run(run.name, run.manoeuvre, run.role)


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
