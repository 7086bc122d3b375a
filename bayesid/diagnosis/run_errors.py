"""Errors of a run three ways (as given, re-tuned, explained) in metres and degrees, and as ends of sentences.

Takes a `RunError`. Gives `ErrorRow`s and phrases. Does not compute or judge.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from bayesid.diagnosis.evidence.replay import EXPLAINED, GIVEN, RETUNED
from bayesid.diagnosis.plain_words import number
from bayesid.diagnosis.result_parts import RunError
from bayesid.measures.angle_errors import turns_note
from bayesid.model.channels import channel
from bayesid.words import and_list, counted, first_few

MODELS = (GIVEN, RETUNED, EXPLAINED)
# An explanation that misses a held-out run by so much more than the model as given has failed.
WORSE = 1.1
# Up to this factor two errors count as the same.
SAME = 1.25
# Rows in which an explanation misses by more than the model as given that a caption lists.
MOST_LARGER = 4
DEG = 180 / math.pi
# Times the best replay's error, from which one is far off.
FAR = 5.0
# Times its expected rms error that one replay misses by chance: errors persist along it, so its rms scatters
# like the size of one normal number (2.5 of 1000 are above 3).
BY_CHANCE = 3.0
# Degrees that no error brought within half a turn reaches.
HALF_TURN = 180.0


@dataclass(frozen=True)
class ErrorRow:
    """One kind of error of one run, a number per model; nan where there is none."""

    what: str
    unit: str
    values: tuple[float, ...]


def run_words(run: RunError) -> str:
    """A run as people call it."""
    return name_of_run(run.run, run.manoeuvre, run.role)


def name_of_run(name: str, manoeuvre: str, role: str) -> str:
    """Manoeuvre and name of a run, and whether it was held out."""
    kind = manoeuvre.split(",")[0].strip() or f"run {name}"
    held = "held-out " if role == "holdout" else ""
    return f"{held}{kind} ({name})" if name not in kind else f"{held}{kind}"


def kind_of_run(run: RunError) -> str:
    """Manoeuvre of a run, else its name."""
    return run.manoeuvre.split(",")[0].strip() or f"run {run.run}"


def error_rows(run: RunError) -> tuple[ErrorRow, ...]:
    """Position and heading of a run, depth where it was logged; what was not logged is left out."""

    def of(table: Mapping[str, Mapping[str, float | None]], channel: str, scale: float) -> tuple[float, ...]:
        return tuple(_scaled(table[m].get(channel), scale) for m in MODELS)

    logged = {c for m in MODELS for c in run.rms[m]}
    rows = []
    if {"x", "y"} <= logged:
        rows.append(("position", "m", tuple(_scaled(run.position.get(m), 1.0) for m in MODELS)))
    if "psi" in logged:
        rows.append(("heading", "degrees", of(run.rms, "psi", 180 / math.pi)))
    if "z" in logged:
        rows.append(("depth", "m", of(run.rms, "z", 1.0)))
    if not rows:
        for channel, unit, scale in (("r", "degrees a second", 180 / math.pi), ("u", "m/s", 1.0)):
            if channel in logged:
                rows.append((channel, unit, of(run.rms, channel, scale)))
    return tuple(ErrorRow(what, unit, v) for what, unit, v in rows)


def miss(rows: tuple[ErrorRow, ...], model: int) -> str:
    """Errors of one model in a phrase: "76 m and 29 degrees"."""
    said = [
        f"{number(r.values[model])} {r.unit}"
        + (f" of {r.what}" if r.what not in ("position", "heading") else _turns(r, r.values[model]))
        for r in rows
        if math.isfinite(r.values[model])
    ]
    return " and ".join(said)


def _turns(row: ErrorRow, value: float) -> str:
    return " with whole turns" if row.unit == "degrees" and value > HALF_TURN else ""


def whole_turns(rows: Iterable[ErrorRow]) -> str:
    """How headings are counted, as `turns_note`, where a row of a table asks for it."""
    return turns_note(value / DEG for row in rows if row.unit == "degrees" for value in row.values)


def missed(rows: tuple[ErrorRow, ...], model: int, kind: str = "") -> str:
    """Errors of one model as the end of a sentence on its simulation; one that leaves the run says so."""
    return f"misses the log by {said}{kind}" if (said := miss(rows, model)) else "diverges"


def missed_too(rows: tuple[ErrorRow, ...], model: int, first: int) -> str:
    """The same after the sentence on the model `first`."""
    if not miss(rows, model):
        return "it diverges" + ("" if miss(rows, first) else " too")
    return f"by {miss(rows, model)}" if miss(rows, first) else f"it {missed(rows, model)}"


def closes(errors: tuple[ErrorRow, ...], before: int, after: int) -> bool:
    """Whether any error falls by more than what counts as the same, or becomes a number at all."""
    return any(
        math.isfinite(r.values[after]) and not r.values[before] <= SAME * r.values[after] for r in errors
    )


def no_nearer(rows: tuple[ErrorRow, ...], before: int, after: int) -> str:
    """What a model predicts no better than another, and what by no more than counts as the same: "no gain in
    heading", "hardly a gain in position and heading"."""
    left = [r for r in rows if r.values[before] <= SAME * r.values[after]]
    none = [r.what for r in left if r.values[before] <= r.values[after]]
    little = [r.what for r in left if r.what not in none]
    told = [(of, and_list(what)) for of, what in (("no gain", none), ("hardly a gain", little)) if what]
    return "; ".join(f"{of} in {what}" for of, what in told)


def worse(rows: tuple[ErrorRow, ...], model: int = 2) -> bool:
    """Whether one model misses position (else the first error there is) by more than as given."""
    if not rows:
        return False
    given, now = rows[0].values[0], rows[0].values[model]
    return math.isfinite(given) and not now <= WORSE * given


def worse_in(rows: tuple[ErrorRow, ...], model: int = 2) -> str:
    """What one model misses by more than as given: "heading", "position and heading"; empty for nothing."""
    off = [r.what for r in rows if math.isfinite(r.values[0]) and not r.values[model] <= WORSE * r.values[0]]
    return and_list(off) if off else ""


def against_given(runs: Sequence[RunError], labels: Sequence[str]) -> str:
    """In how many rows of a table of runs the last model misses by no more than the first, and where it
    does not; numbers count as printed. Empty without a row.
    """
    rows = [(run, row) for run in runs for row in error_rows(run)]
    if not rows:
        return ""
    larger = [(run, row) for run, row in rows if _printed(row.values[-1]) > _printed(row.values[0])]
    held = [row for run, row in rows if run.role == "holdout"]
    fewer = len(held) - sum(run.role == "holdout" for run, _ in larger)
    said = (
        f"errors {labels[-1]} are no larger than {labels[0]} in {len(rows) - len(larger)} of "
        f"{counted(len(rows), 'row')}" + (f" (held-out runs: {fewer} of {len(held)})" if held else "")
    )
    if not larger:
        return f"{said}."
    places = [
        f"{run_words(run)}, {row.what} {_diverges(row.values[-1], row.unit)} instead of "
        f"{number(row.values[0])}"
        for run, row in larger
    ]
    return f"{said}. They are larger on: {first_few(places, MOST_LARGER, '; ')}."


def still_missed(runs: Sequence[RunError], labels: Sequence[str]) -> str:
    """Why runs stay missed with the last model, in sentences: by no more than it expects of itself, or more.

    Told of are runs that it misses about as far as the first model, and far against its best run of the same
    kind of error. A run of which nothing is known of what is to be expected is left out.
    """
    table = [(run, rows[0]) for run in runs if (rows := error_rows(run)) and run.expected]
    least: dict[str, float] = {}
    for _, row in table:
        if row.values[-1] > 0:
            least[row.what] = min(row.values[-1], least.get(row.what, math.inf))
    lost: list[str] = []
    within: list[str] = []
    beyond: list[str] = []
    for run, row in table:
        given, now = row.values[0], row.values[-1]
        hoped, said = _expected_error(run, row), f"{kind_of_run(run)} ({run.run})"
        if hoped is None or not (now > FAR * least.get(row.what, math.nan) and given <= SAME * now):
            continue
        if math.isinf(hoped):
            lost.append(said)
        else:
            (within if now <= BY_CHANCE * hoped else beyond).append(
                f"{said}, by {number(now)} {row.unit} where {number(hoped)} are expected"
            )
    nearer = f"brought hardly nearer to the log than {labels[0]}"
    told = []
    if lost:
        told.append(
            f"Some runs are {nearer}: {first_few(lost, MOST_LARGER, '; ')}. Replayed without a helmsman, the "
            "vehicle amplifies the smallest error of its start there until nothing can be expected of any "
            "model; such a run speaks neither for nor against the explanation."
        )
    if within:
        told.append(
            f"Some runs are {nearer}, but are missed by no more than the explanation expects of itself (rms; "
            "environment, start and coefficients grow along a run that nobody steers back): "
            f"{first_few(within, MOST_LARGER, '; ')}."
        )
    if beyond:
        told.append(
            f"Some runs are {nearer}, and are missed by more than the explanation expects of itself (rms): "
            f"{first_few(beyond, MOST_LARGER, '; ')}. Something in them is not explained."
        )
    return " ".join(told)


def _expected_error(run: RunError, row: ErrorRow) -> float | None:
    """What the explanation expects to miss a kind of error by, in its unit; inf where that is unbounded, None
    where it is not known.
    """
    names, scale = {
        "position": (("x", "y"), 1.0), "heading": (("psi",), DEG), "depth": (("z",), 1.0), "r": (("r",), DEG),
        "u": (("u",), 1.0),
    }[row.what]  # fmt: skip
    if not run.expected.keys() >= set(names):
        return None
    values = [run.expected[c] for c in names]
    return math.inf if None in values else scale * math.hypot(*(v for v in values if v is not None))


def _printed(value: float) -> float:
    return float(number(value)) if math.isfinite(value) else math.inf


def _diverges(value: float, unit: str) -> str:
    return f"{number(value)} {unit}" if math.isfinite(value) else "diverges"


READ = ("u", "v", "w", "p", "q", "r", "phi", "theta")
SHOWN = {"rad": ("degrees", DEG), "rad/s": ("degrees a second", DEG)}


def mended_reading(run: RunError) -> str:
    """The readings whose error falls most by the explanation, in a phrase; empty where none falls by more
    than what counts as the same. A sensor that errs moves neither track nor heading.
    """
    falls = {}
    for name in READ:
        before, after = (run.rms.get(m, {}).get(name) for m in (GIVEN, EXPLAINED))
        if before is not None and after is not None and before > SAME * after > 0:
            falls[name] = before / after
    if not falls:
        return ""
    most = channel(max(falls, key=lambda c: falls[c]))
    unit, scale = SHOWN.get(most.unit, (most.unit, 1.0))
    before, after = (float(run.rms[m][most.name] or 0.0) * scale for m in (GIVEN, EXPLAINED))
    return f"readings of the {most.meaning} are missed by {number(after)} {unit} instead of {number(before)}"


def _scaled(value: float | None, scale: float) -> float:
    return math.nan if value is None else value * scale
