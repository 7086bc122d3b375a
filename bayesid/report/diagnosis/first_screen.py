"""The first screen of a diagnosis: errors three ways, the picture, how sure and what else, what next.

Takes a `Result` and its `Answer`. Does not compute.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bayesid.diagnosis.answer import Answer
from bayesid.diagnosis.evidence.replay import EXPLAINED, GIVEN, RETUNED, Replay
from bayesid.diagnosis.plain_words import Z95, number
from bayesid.diagnosis.result import Result
from bayesid.report import run_picture
from bayesid.report.writer import Block, Figure, Row, Section, Table, Text, literal


def first_blocks(result: Result, a: Answer) -> list[Block]:
    """Errors, picture, certainty and steps."""
    blocks: list[Block] = []
    if a.errors:
        blocks.append(
            Table(
                ["rms error", *a.labels],
                [[f"{r.what} [{r.unit}]", *(_cell(x) for x in r.values)] for r in a.errors],
                f"{literal(a.where)[:1].upper()}{literal(a.where)[1:]}, replayed from its orders. "
                f"{literal(a.explained)}",
            )
        )
    blocks += picture_blocks(result, a)
    sure = [f"- {literal(s)}" for s in a.certainty]
    if a.moved:
        sure.append(f"- Coefficients that re-tuning moves most: {literal('; '.join(a.moved[:3]))}.")
    blocks.append(Section("How sure, and what else it could be", [Text("\n".join(sure))]))
    blocks.append(Section("What to do next", [Text("\n".join(f"- {s}" for s in a.steps))]))
    return blocks


def picture_blocks(result: Result, a: Answer) -> list[Block]:
    """The run the simulator as given misses most; nothing where none could be replayed."""
    if result.drawings is None or not result.drawings.replays:
        return []
    shown = picture_of(result.drawings.replays[0], a)
    caption = (
        "Left: track, begun at the ring. Right: heading, and below it how far each simulation is from the "
        "log (lines: running means; dots: the explained model's). Blue: where 95 % of its dots should lie; a "
        "line that leaves its panel misses by more. Grey: first seconds, read to begin on the track."
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


def picture_of(r: Replay, a: Answer) -> run_picture.RunPicture:
    """A replay as a picture; two simulations where the explained model is the re-tuned one."""
    styles = ((GIVEN, run_picture.GIVEN), (RETUNED, run_picture.BETWEEN), (EXPLAINED, run_picture.BEST))
    series = [
        run_picture.Series(label, style, r.models[m])
        for (m, style), label in zip(styles, a.labels, strict=True)
    ]
    if np.array_equal(series[1].values, series[2].values, equal_nan=True):
        series = [series[0], replace(series[2], label=series[1].label)]
    half = None if r.sd is None else Z95 * r.sd
    return run_picture.RunPicture(r.t, r.channels, r.readings, tuple(series), r.lead, half)


def _cell(x: float) -> str:
    return number(x) if math.isfinite(x) else "diverges"
