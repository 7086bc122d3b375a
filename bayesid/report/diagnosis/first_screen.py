"""The first screen of a diagnosis: errors three ways, the picture, how sure and what else, what next.

Takes a `Result` and its `Answer`. Does not compute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bayesid.diagnosis.answer import Answer, counted_after
from bayesid.diagnosis.data.event import Event
from bayesid.diagnosis.evidence import replay as evidence
from bayesid.diagnosis.evidence.replay import EXPLAINED, GIVEN, RETUNED
from bayesid.diagnosis.moved_words import moved_title
from bayesid.diagnosis.plain_words import Z95, number
from bayesid.diagnosis.result import Result
from bayesid.report import run_picture
from bayesid.report.diagnosis import figures
from bayesid.report.shown_orders import shown_orders
from bayesid.report.writer import Block, Figure, Replay, Row, Section, Table, Text, literal

MOST_FRAMES = 400
DASHES: list[list[int]] = [[6, 3], [2, 3], []]
HELD_OUT = (
    " Held out: no fit and no choice of a cause has read this run; it shows what they predict, and a cause "
    "with which held-out runs are predicted worse, by more than chance, is withdrawn."
)


def first_blocks(result: Result, a: Answer) -> list[Block]:
    """Errors, picture, certainty and steps."""
    blocks: list[Block] = []
    if a.errors:
        blocks.append(
            Table(
                ["rms error", *a.labels],
                [[f"{r.what} [{r.unit}]", *(_cell(x) for x in r.values)] for r in a.errors],
                f"{literal(a.where)[:1].upper()}{literal(a.where)[1:]}, replayed from its orders; errors "
                f"{counted_after(result)}. "
                f"{literal(a.explained)}{HELD_OUT if 'held-out' in a.where else ''}",
            )
        )
    blocks += picture_blocks(result, a)
    blocks += place_blocks(result)
    blocks += replay_blocks(result, a)
    sure = [f"- {literal(s)}" for s in a.certainty]
    if a.moved:
        title = moved_title(result)
        sure.append(f"- {title[:1].upper()}{title[1:]}: {literal('; '.join(a.moved[:3]))}.")
    blocks.append(Section("How sure, and what else it could be", [Text("\n".join(sure))]))
    blocks.append(Section("What to do next", [Text("\n".join(f"- {s}" for s in a.steps))]))
    return blocks


def picture_blocks(result: Result, a: Answer) -> list[Block]:
    """The run the simulator as given misses most; nothing where none could be replayed."""
    if result.drawings is None or not result.drawings.replays:
        return []
    shown = picture_of(result.drawings.replays[0], a, result.events)
    lost = ""
    for s in shown.series:
        if not s.ends:
            lost += f"The simulation {literal(s.label)} diverges: its line ends early or is missing. "
    drawn = literal(run_picture.caption(shown, "Blue: where 95 % of the small dots should lie."))
    caption = (
        f"{drawn} {lost}A line that leaves its panel misses by more. Grey: first seconds, read to begin on "
        f"the track.{EVENT_SHADED if shown.events else ''}"
    )
    where = literal(a.where)
    return [
        Row(
            (
                Figure("picture_track", run_picture.track(shown), alt=f"Track of the {where}"),
                Figure(
                    "picture_time", run_picture.over_time(shown), alt=f"Heading and errors of the {where}"
                ),
            ),
            caption,
        )
    ]


def place_blocks(result: Result) -> list[Block]:
    """Where a force with the place acts; nothing of a period, and of results that did not keep it."""
    found = result.dependence
    if found is None or not found.map:
        return []
    shown = np.array(found.map)
    hull = found.acts == "hull"
    return [
        Figure(
            "place",
            figures.place_map(shown[:, 0], shown[:, 1], shown[:, 2:], hull),
            "Where the force with the place acts, all runs: "
            + (
                "by how much the hull's forces differ from those of the explanation. "
                if hull
                else "the force over ground that is left. "
            )
            + "Further apart than the distance told places say nothing of each other, and where the "
            "vehicle goes straight ahead little is felt.",
            alt="Map of a force that depends on the place",
        )
    ]


def replay_blocks(result: Result, a: Answer) -> list[Block]:
    """The run of the picture, to be played; nothing without a track."""
    if result.drawings is None or not result.drawings.replays:
        return []
    return played_blocks(result.drawings.replays[0], a, f"The {literal(a.where)}")


def played_blocks(r: evidence.Replay, a: Answer, what: str) -> list[Block]:
    """A run to be played; nothing without a track."""
    if not {"x", "y"} <= set(r.channels):
        return []
    caption = f"{what}, to be played; click below the track to go to a time."
    if r.force:
        caption += (
            " Arrows on the log are the force that would lead a simulation along it, arcs the turning "
            "moment: an explanation that holds leaves them short."
        )
    return [Replay(played(r, picture_of(r, a)), caption)]


def played(r: evidence.Replay, drawn: run_picture.RunPicture) -> dict[str, Any]:
    """Series of a replay as plain data, at most `MOST_FRAMES` of them."""
    keep = np.unique(np.linspace(0, r.t.size - 1, min(r.t.size, MOST_FRAMES)).astype(int))

    def values(v: np.ndarray, digits: int = 2) -> list[float | None]:
        return [round(float(x), digits) if np.isfinite(x) else None for x in v[keep]]

    def series(label: str, colour: str, dash: list[int], table: np.ndarray) -> dict[str, Any]:
        columns = {c: values(table[:, r.channels.index(c)]) for c in ("x", "y")}
        psi = values(table[:, r.channels.index("psi")], 3) if "psi" in r.channels else None
        return {"label": label, "colour": colour, "dash": dash, **columns, "psi": psi}

    shown = [series("log", "#000000", [], r.readings)]
    for s, dash in zip(drawn.series, DASHES[-len(drawn.series) :], strict=True):
        first = [6, 3] if s.label == "as given" else dash
        shown.append(series(s.label, s.style["color"], first, s.values))
    orders = [
        {"label": o.label, "unit": o.unit, "values": values(o.values, 1)} for o in shown_orders(r.commands)
    ]
    styles = {GIVEN: drawn.series[0], EXPLAINED: drawn.series[-1]}
    forces = [
        {
            "label": styles[m].label, "colour": styles[m].style["color"],
            "dash": [6, 3] if m == GIVEN else [],
            **{axis: [_significant(float(x)) for x in f[keep, k]] for k, axis in enumerate("XYN")},
        }
        for m, f in r.force.items()
    ]  # fmt: skip
    return {"t": values(r.t - r.t[0], 1), "series": shown, "orders": orders, "forces": forces}


def _significant(x: float) -> float | None:
    return float(f"{x:.3g}") if math.isfinite(x) else None


EVENT_SHADED = " Orange: nothing known explains the motion then."


def picture_of(r: evidence.Replay, a: Answer, events: Sequence[Event] = ()) -> run_picture.RunPicture:
    """A replay as a picture; two simulations where the explained model is the re-tuned one.

    Parameters
    ----------
    events : of all runs; those of this one in which the vehicle moves as nothing explains are shaded
    """
    styles = ((GIVEN, run_picture.GIVEN), (RETUNED, run_picture.BETWEEN), (EXPLAINED, run_picture.BEST))
    series = [
        run_picture.Series(label, style, r.models[m])
        for (m, style), label in zip(styles, a.labels, strict=True)
    ]
    if np.array_equal(series[1].values, series[2].values, equal_nan=True):
        series = [series[0], replace(series[2], label=series[1].label)]
    half = None if r.sd is None else Z95 * r.sd
    shaded = tuple((e.start, e.end) for e in events if e.run == r.run and e.unexplained)
    return run_picture.RunPicture(r.t, r.channels, r.readings, tuple(series), r.lead, half, events=shaded)


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
