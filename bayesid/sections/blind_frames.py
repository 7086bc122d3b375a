"""The report of two ways out where one campaign cannot name a cause: the vehicle as built, and one more run.

Takes records and quantities as plain data (`bayesid.blind.as_built`, `bayesid.blind.extra_run`). Does not
score.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.report import Report, Section, Table, Text
from bayesid.sections.blind import quantity_row

BARS = ["quantity", "over", "score", "cases", "95 % interval", "bar", ""]
ARMS = {"first": "one zig-zag", "repeat": "zig-zag again", "proposed": "proposed run"}


def frames_report(
    built: Sequence[Mapping[str, Any]],
    extra: Sequence[Mapping[str, Any]],
    built_rows: Sequence[Any],
    extra_rows: Sequence[Any],
    codes: Sequence[str],
) -> Report:
    """Report of both parts.

    Parameters
    ----------
    built_rows, extra_rows : `Quantity` of either part, the row of the design note first
    codes : states of the deciding code, one where nothing changed meanwhile
    """
    return Report("Hidden causes and look-alikes", _lead(built_rows, extra_rows), [
        Section("Hidden causes, vehicle known as built", _built(built, built_rows)),
        Section("Look-alikes, one more run", _extra(extra, extra_rows)),
        Section("Campaigns and versions", _versions(built, extra, codes)),
    ])  # fmt: skip


def _lead(built_rows: Sequence[Any], extra_rows: Sequence[Any]) -> str:
    parts = []
    known = {q.name: q for q in built_rows}
    first, free = built_rows[0], known["structure frame: top-1 by family"]
    if first.count:
        parts.append(
            f"**Of {first.count} causes that free coefficients hide, {first.hits} come first when the "
            f"vehicle is known as built, and {free.hits} when its coefficients are free.**"
        )
    tops = [q for q in extra_rows if q.name.endswith("top-1 by family")]
    if tops and tops[0].count:
        a, b, c = (q.hits for q in tops)
        parts.append(
            f"**Of {tops[0].count} causes with a look-alike {a} come first after one zig-zag, {b} after the "
            f"same again, {c} after the manoeuvre that the diagnosis proposed.**"
        )
    return " ".join(parts) + (
        " What was planted is known here, but not to the diagnosis; the campaigns come from the independent "
        "plant."
    )


def _bars(rows: Sequence[Any], caption: str) -> Table:
    return Table(BARS, [quantity_row(q) for q in rows], caption, digits=3)


def _built(records: Sequence[Mapping[str, Any]], rows: Sequence[Any]) -> list[Any]:
    table = []
    for r in records:
        built, free = r["frames"]["as-built"], r["frames"]["structure"]
        table.append([
            r["seed"], _words(r["effect"]), r["size"], r["vehicle"], r["sea"],
            built["shown"]["noncentrality"], built["shown"]["margin"], _said(built), built["p_right"],
            free["shown"]["noncentrality"], _absorbed(free), _said(free), free["p_right"],
        ])  # fmt: skip
    columns = ["seed", "planted", "size", "vehicle", "sea", "D as built", "margin", "as built it says", "P",
               "D free", "absorbed", "free it says", "P"]  # fmt: skip
    misses = [
        [r["seed"], _words(r["effect"]), _told(r["frames"]["as-built"]), r["frames"]["as-built"]["reason"] or
         "first, but not named"]
        for r in records if r["frames"]["as-built"]["outcome"] != "right"
    ]  # fmt: skip
    return [
        Text(
            "A loss of thrust and a fouled hull change what coefficients change too: from one campaign alone "
            "they cannot be told from a vehicle that was always like this. Somebody who identified the clean "
            "vehicle before knows better. In each campaign the true coefficients lie within one percent (sd) "
            "of the file. Structure frame: the diagnosis takes the ten percent the file states. As-built "
            "frame: it is told one percent (`diagnose(..., as_built=0.01)`). D is the noncentrality of the "
            "planted cause, margin its expected lead over the nearest other family, both from the noise-free "
            "truth in the frame concerned."
        ),
        _bars(rows, "Scores; the first row is the one with a bar in the design note."),
        Table(columns, table, "Every campaign. P is the probability of the planted family; in brackets the "
              "first answer where it is another.", digits=3),
        *([Table(["seed", "planted", "as built it says", "why"], misses,
                 "As built, not named or not rightly.", digits=3)] if misses else []),
    ]  # fmt: skip


def _absorbed(frame: Mapping[str, Any]) -> str:
    return f"{frame['shown']['absorbed']:.2%}"


def _extra(records: Sequence[Mapping[str, Any]], rows: Sequence[Any]) -> list[Any]:
    done = [r for r in records if r["arms"]]
    table, flown = [], []
    for r in done:
        arms = r["arms"]
        table.append([
            r["campaign_seed"], _words(r["effect"]), _words(arms["first"]["shown"]["rival"]), r["vehicle"],
            *(x for a in ARMS for x in (_said(arms[a]), arms[a]["p_right"], arms[a]["size"])),
        ])  # fmt: skip
        run = arms["proposed"]["flown"]
        flown.append([
            r["campaign_seed"], _words(r["effect"]), r["size"],
            r["sensors"], arms["first"]["shown"]["noncentrality"],
            *(arms[a]["shown"]["margin"] for a in ARMS),
            arms["repeat"]["flown"]["seconds"],
            f"{_words(run['manoeuvre'])}, {run['seconds']:.0f} s" if run else "none it could fly",
        ])  # fmt: skip
    heads = [x for a in ARMS.values() for x in (a, "P", "set")]
    blocks: list[Any] = [
        Text(
            "One zig-zag of 40 lengths in a still sea. The planted cause shows (D at least 25) but has a "
            "look-alike of another family: the expected margin between the two, from the noise-free truth, "
            "is below 5 nats, the diagnosis' own limit of a group; sizes are chosen for a margin of about "
            "0.5, or for D = 30 where that is more. Then one more run with the same truth and fresh noise: "
            "the same zig-zag again, or the first manoeuvre of the diagnosis' own list (`next_manoeuvre`), "
            "from the same heading and cut to the zig-zag's length where it is longer."
        ),
        _bars(rows, "Scores; the design note asks for at most 0.6 before and at least 0.9 after the "
              "proposed run."),
    ]  # fmt: skip
    if done:
        gains = [[_middle(r["arms"][a]["shown"]["margin"] for r in done) for a in ARMS]]
        blocks += [
            Table(["seed", "planted", "look-alike", "vehicle", *heads], table,
                  "What the diagnosis says. P is the probability of the planted family, set the number of "
                  "families in the 95 % set.", digits=3),
            Table(["seed", "planted", "size", "sensors", "D", *(f"margin, {a}" for a in ARMS.values()),
                   "zig-zag [s]", "proposed"], flown, "What could be expected: margins from the noise-free "
                  "truth.", digits=3),
            Table([f"median margin, {a}" for a in ARMS.values()], gains, "", digits=3),
        ]  # fmt: skip
    left = [[t["seed"], _words(r["effect"]), t["vehicle"], t.get("noncentrality"), t.get("absorbed"),
             t.get("margin"), t["left out"]] for r in records for t in r["tried"]]  # fmt: skip
    if left:
        blocks.append(Table(["seed", "planted", "vehicle", "D", "absorbed", "margin", "why"], left,
                            "Drawn and left out before any diagnosis.", digits=3))  # fmt: skip
    return blocks


def _middle(values: Any) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.median(known)) if known else None


def _told(frame: Mapping[str, Any]) -> str:
    """Verdict in words."""
    named = f": {', '.join(map(_words, frame['named']))}" if frame["named"] else ""
    return _words(frame["word"]) + named


def _said(frame: Mapping[str, Any]) -> str:
    """Verdict, and the first answer where it is not the planted family."""
    return _told(frame) + ("" if frame["right"] else f" ({_words(frame['top'])})")


def _words(name: str) -> str:
    return name.replace("_", " ")


def _versions(built: Sequence[Any], extra: Sequence[Any], codes: Sequence[str]) -> list[Any]:
    each = [(r["name"], x) for r in built for x in r["frames"].values()]
    each += [(r["name"], x) for r in extra for x in r["arms"].values()]
    failed = [[name, x["failure"]] for name, x in each if x["failure"]]
    cpu = [x["cpu_seconds"] for _, x in each if x["cpu_seconds"] is not None]
    text = f"States of the deciding code: {', '.join(codes)}."
    if cpu:
        text += f" {len(cpu)} diagnoses, median {np.median(cpu):.1f} s of CPU, longest {max(cpu):.1f} s."
    return [
        Text(text),
        *([Table(["campaign", "why not"], failed, "Not diagnosed; counted as misses.")] if failed else []),
    ]
