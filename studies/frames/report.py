"""The report of two ways out where one campaign cannot name a cause: the vehicle as built, and one more run.

Takes records and quantities as plain data (`studies.frames.as_built`, `studies.frames.extra_run`). Does not
score.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bayesid.benchmark.protocol.report import quantity_row
from bayesid.report.writer import Report, Section, Table, Text

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
    built_rows, extra_rows : `Quantity` of either part, the row with a bar first
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
    first, free = built_rows[0], known["free: top-1 by family"]
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
    table, misses = [], []
    for r in records:
        built, free = r["frames"]["as-built"], r["frames"]["structure"]
        shown = built["shown"]
        table.append([
            r["seed"], _words(r["effect"]), r["vehicle"], shown["noncentrality"], shown["margin"],
            _said(built), built["p_right"], free["shown"]["noncentrality"], _absorbed(free), _said(free),
            free["p_right"],
        ])  # fmt: skip
        if not built["names_it"]:
            misses.append([r["seed"], _words(r["effect"]), _said(built), _words(shown["rival"]),
                           shown["margin"], _absorbed(built), _set(built)])  # fmt: skip
    meant = sum(
        r["frames"]["as-built"]["word"] == "coefficients" and r["frames"]["as-built"]["p_right"] > 0.95
        for r in records
    )
    unnamed = (
        f"{meant} verdicts as built say `coefficients` although the planted family has a probability above "
        "0.95: the verdict names no effect whose signature coefficients can absorb by more than 0.98, and "
        "to a precise log even one percent of freedom is that much. The probabilities and the 95 % set tell."
    ) if meant else ""  # fmt: skip
    columns = ["seed", "planted", "vehicle", "D as built", "margin", "as built", "P", "D free", "absorbed",
               "free", "P"]  # fmt: skip
    return [
        Text(
            "A loss of thrust and a fouled hull change what coefficients change too: from one campaign alone "
            "they cannot be told from a vehicle that was always like this. Somebody who identified the clean "
            "vehicle before knows better. In each campaign the true coefficients lie within one percent (sd) "
            "of the file. Structure frame (free): the diagnosis takes the ten percent the file states. "
            "As-built frame: it is told one percent (`diagnose(..., as_built=0.01)`). D is the noncentrality "
            "of the planted cause, margin its expected lead over the nearest other family, absorbed the "
            "share of its signature that coefficients hide; all from the noise-free truth in the frame "
            "concerned."
        ),
        _bars(rows, "Scores; the first row is the one with a bar. Hidden: absorbed above "
              "0.98 when coefficients are free."),
        Table(columns, table, "Every campaign: verdict and probability of the planted family; in brackets "
              "the most probable answer where it is another.", digits=3),
        *([Text(unnamed)] if unnamed else []),
        *([Table(["seed", "planted", "as built", "nearest other", "margin", "absorbed", "95 % set"], misses,
                 "As built, not named rightly.", digits=3)] if misses else []),
    ]  # fmt: skip


def _set(frame: Mapping[str, Any]) -> str:
    return ", ".join(map(_words, frame["set"]))


def _absorbed(frame: Mapping[str, Any]) -> str:
    return f"{frame['shown']['absorbed']:.2%}"


def _extra(records: Sequence[Mapping[str, Any]], rows: Sequence[Any]) -> list[Any]:
    done = sorted((r for r in records if r["arms"]), key=lambda r: (r["effect"], r["campaign_seed"]))
    table, executed = [], []
    for r in done:
        arms = r["arms"]
        table.append([
            r["campaign_seed"], _words(r["effect"]), _words(arms["first"]["shown"]["rival"]), r["vehicle"],
            *(x for a in ARMS for x in (_said(arms[a]), arms[a]["p_right"])),
        ])  # fmt: skip
        run = arms["proposed"]["flown"]
        executed.append([
            r["campaign_seed"], _words(r["effect"]), r["size"],
            r["sensors"], arms["first"]["shown"]["noncentrality"],
            *(arms[a]["shown"]["margin"] for a in ARMS),
            arms["repeat"]["flown"]["seconds"],
            f"{_words(run['manoeuvre'])}, {run['seconds']:.0f} s" if run else "none it could fly",
        ])  # fmt: skip
    heads = [x for a in ARMS.values() for x in (a, "P")]
    blocks: list[Any] = [
        Text(
            "One zig-zag of 40 lengths in a still sea. The planted cause shows (D at least 25) but has a "
            "look-alike of another family: the expected margin between the two, from the noise-free truth, "
            "is below 5 nats, the diagnosis' own limit of a group; sizes are chosen for a margin of about "
            "0.5, or for D = 30 where that is more. Then one more run with the same truth and fresh noise: "
            "the same zig-zag again, or the first manoeuvre of the diagnosis' own list (`next_manoeuvre`), "
            "from the same heading and cut to the zig-zag's length where it is longer."
        ),
        _bars([q for q in rows if "top-1" in q.name], "Top-1; the bar is at most 0.6 before "
              "and at least 0.9 after the proposed run."),
        _arms(rows),
    ]  # fmt: skip
    if done:
        gains = [[_middle(r["arms"][a]["shown"]["margin"] for r in done) for a in ARMS]]
        blocks += [
            Table(["seed", "planted", "look-alike", "vehicle", *heads], table,
                  "Verdict and probability of the planted family; in brackets the most probable answer "
                  "where it is another.", digits=3),
            Table(["seed", "planted", "size", "sensors", "D", *(f"margin, {a}" for a in ARMS.values()),
                   "zig-zag [s]", "proposed"], executed, "What could be expected: margins from the noise-free "  # noqa: E501
                  "truth.", digits=3),
            Table([f"median margin, {a}" for a in ARMS.values()], gains, "", digits=3),
        ]  # fmt: skip
    left = [[t["seed"], _words(r["effect"]), t["vehicle"], t.get("noncentrality"), t.get("absorbed"),
             t.get("margin"), _why(t)] for r in records for t in r["tried"]]  # fmt: skip
    if left:
        blocks.append(Table(["seed", "planted", "vehicle", "D", "absorbed", "margin", "why"], left,
                            "Drawn and left out before any diagnosis.", digits=3))  # fmt: skip
    return blocks


def _why(tried: Mapping[str, Any]) -> str:
    if tried.get("absorbed") is not None and tried["absorbed"] > 0.98:
        return "hidden by coefficients"
    return str(tried["left out"])


def _arms(rows: Sequence[Any]) -> Table:
    """One row per arm, one column per quantity."""
    known = {tuple(q.name.split(": ", 1)): q for q in rows}
    wanted = [q for arm, q in known if arm == ARMS["first"]]
    cells = [[arm, *(_cell(known[arm, q]) for q in wanted)] for arm in ARMS.values()]
    return Table(["", *wanted], cells, "The same campaigns after either run.", digits=3)


def _cell(q: Any) -> Any:
    return f"{q.hits}/{q.count}" if q.hits >= 0 else (q.value if q.count else None)


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
