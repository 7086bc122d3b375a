"""The report of the benchmark set: what is in an edition, how it is known again, and the table of entries.

Takes plain data. Does not make, solve or score.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.benchmark.protocol.beside import ABOUT, COLUMNS, cells
from bayesid.report.writer import Report, Section, Table, Text
from bayesid.words import counted as counted_words

PARTS = {"all": "All bundles", "p": "Own equations", "o": "Other equations"}


def set_report(
    edition: str, kinds: Mapping[str, Mapping[str, int]], archives: Mapping[str, str], entries: Sequence[Any]
) -> Report:
    """Report of an edition.

    Parameters
    ----------
    kinds : part -> kind of answer -> number of bundles
    archives : name of an archive -> SHA-256
    entries : what was entered, one mapping per method
    """
    count = sum(sum(row.values()) for row in kinds.values())
    lead = (
        f"{_answer(entries)}Edition {edition} of the benchmark set: {count} bundles that everybody has, "
        f"{counted_words(len(entries), 'entry', 'entries')}."
    )
    words = sorted({kind for row in kinds.values() for kind in row})
    counted = [[PARTS[part], *(row.get(w, 0) for w in words)] for part, row in kinds.items()]
    sections = [
        Section("What is in it", [
            Table(["part", *words], counted, "Bundles by the kind of their answer."),
            Table(["archive", "SHA-256"], [list(row) for row in archives.items()],
                  "Digests of the archives. Those of every bundle and answer are in "
                  "`studies/benchmark_set/commitments`."),
        ]),
        Section("Entries", [Text(ABOUT), *(
            _entries(part, words, entries) for part, words in PARTS.items()
            if any(part in e["scores"] for e in entries)
        )]),
        Section("How it was done", [Text(
            "An entry on fewer bundles, not committed, is a trial on what time allowed: rows are comparable "
            "where their bundles are the same ones."
        ), Text(
            "The edition is drawn from a public phrase: whoever likes can draw its answers. It compares "
            "methods whose makers do not look, and is no blind check. A pack of `bayesid blind make` is. The "
            "reproducibility method's spread c was set on other bundles (practice); the level of the "
            "distortions' test, 0.02, is the bar for false alarms of every score sheet. `docs/developer/"
            "benchmark_set.md` says how to enter."
        )]),
    ]  # fmt: skip
    return Report("Benchmark set", lead, sections)


def _answer(entries: Sequence[Mapping[str, Any]]) -> str:
    """What each method finds and gets wrong, the best first."""
    whole = [(e["entry"], e["scores"]["all"]) for e in entries if "all" in e["scores"]]
    whole.sort(key=lambda row: -row[1]["named right, D >= 25"][0])
    said = [
        "{} {} of {} and {} of {}".format(
            name, *row["named right, D >= 25"], *row["wrong names of all named"]
        )
        for name, row in whole
    ]
    return f"**Plain causes named right, and wrong names of all: {'; '.join(said)}.** " if said else ""


def _entries(part: str, words: str, entries: Sequence[Mapping[str, Any]]) -> Table:
    rows = [
        [e["entry"], *cells(e["scores"][part])[1:], e["verdicts"][:12] or "not committed"]
        for e in entries
        if part in e["scores"]
    ]
    return Table(["entry", *COLUMNS[1:], "digest"], rows, f"{words}.", digits=3)
