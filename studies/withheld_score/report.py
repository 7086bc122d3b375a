"""The report of the committed verdicts once their answers were opened: the result first, every miss
explained.

Takes the records of `withheld.effects` and `withheld.wind` as plain data. Does not score.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from bayesid.benchmark.protocol.report import bars_blocks
from bayesid.benchmark.protocol.verdict_table import table as committed_table
from bayesid.report.writer import Block, Report, Section, Table, Text, literal
from studies.withheld_score.effects import FATES, HALF, RIGHT
from studies.withheld_score.misses import MISSES, OUTSIDE_INTERVAL

DEG = 180.0 / math.pi
OPEN = ("left open, cause first", "left open, another first")


def check_report(results: Mapping[str, Any], verdicts: Mapping[str, Mapping[str, Any]], sheet: Any) -> Report:
    """Report of `results`; verdicts and scorecard for the tables further down."""
    rows = results["bundles"]
    sections = [
        Section("Every miss, one by one", _misses(rows)),
        Section("Parameters", _parameters(results["parameters"])),
        Section("What was expected and what came true", _expected(results)),
        Section("Every bundle", [_every(rows)]),
        Section("Bars", bars_blocks(sheet)),
    ]
    if results["wind"] is not None:
        sections.insert(3, Section("The wind on the Esso Osaka", wind_blocks(results["wind"])))
    sections += [
        Section("The verdicts as they were committed", [committed_table(verdicts)]),
        Section("How it was scored", [Text(_how(results))]),
    ]
    return Report("Withheld effects: the committed verdicts and their answers", lead(results), sections)


def lead(results: Mapping[str, Any]) -> str:
    """The result in a paragraph, and the wind in another."""
    rows = results["bundles"]
    count = Counter(r["fate"] for r in rows)
    named = results["named"]
    parts = [f"{count[f]} {f}" for f in FATES if count[f] and f != RIGHT]
    inside = sum(p["inside"] for p in results["parameters"])
    mine = [p for p in results["parameters"] if p["named"]]
    left = Counter(r["verdict"] for r in rows if r["fate"] == OPEN[0])
    text = (
        f"**Of {len(rows)} bundles {count[RIGHT]} verdicts are right**, counted by families of causes as "
        f"our scorer does ({sum(r['exactly'] for r in rows)} where the verdict must say the label word for "
        "word): "
        + ", ".join(parts)
        + f". The most probable answer is of a labelled family in {sum(r['first_right'] for r in rows)} of "
        f"{len(rows)}, where {results['promised']:.1f} were promised; the 95 % set holds every labelled "
        f"family in {sum(r['set_holds_all'] for r in rows)}. Of {named['verdicts']} verdicts that name "
        f"effects {named['wrong']} names one that is not there; of {results['none']['bundles']} bundles "
        f"without an effect {results['none']['alarms']} raised an alarm. {inside} of "
        f"{len(results['parameters'])} parameters lie in their 95 % interval "
        f"({sum(p['inside'] for p in mine)} of {len(mine)} where the effect was named). What falls short is "
        f"naming, not finding: {count[OPEN[0]]} causes came first and were not named, "
        f"{left['coefficients']} under the verdict `coefficients` (what coefficients could imitate is not "
        f"named, however far they would have to move) and {left['ambiguous']} as `ambiguous`."
    )
    if results["wind"] is None:
        return text
    s = results["wind"]["sum"]
    return text + (
        f"\n\n**Wind on {s['runs']} runs of the Esso Osaka**, measured and withheld: {s['said']} statements "
        f"of direction and speed, directions {DEG * s['direction_error']:.0f} degrees off on average "
        f"({s['direction_inside']} of {s['said']} in their interval), speeds {s['speed_error']:.2f} m/s off "
        f"({s['speed_inside']} of {s['said']}). The scaling by what fitted October made the speeds worse: "
        f"{s['scaled_error']:.2f} m/s off, {s['scaled_inside']} of {s['said']} in their interval. In "
        f"{s['silent']} runs nothing was said while {min(s['silent_speeds']):.1f} to "
        f"{max(s['silent_speeds']):.1f} m/s blew."
    )


def _words(name: str) -> str:
    return name.replace("_", " ")


def _names(names: Sequence[str]) -> str:
    return ", ".join(map(_words, names)) or "–"


def _misses(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    missed = [r for r in rows if r["fate"] != RIGHT]
    tally = Counter(MISSES[r["bundle"]][0] for r in missed)
    order = {f: k for k, f in enumerate(reversed(FATES))}
    table = [
        [r["bundle"], _names(r["labelled"]), r["noncentrality"],
         _words(r["verdict"]) + (f": {_names(r['effects'])}" if r["effects"] else ""), r["p_right"],
         r["fate"], MISSES[r["bundle"]][0], MISSES[r["bundle"]][1]]
        for r in sorted(missed, key=lambda r: (order[r["fate"]], r["bundle"]))
    ]  # fmt: skip
    return [
        Text("What stood in the way: " + ", ".join(f"{w} ({n})" for w, n in tally.most_common()) + "."),
        Table(["bundle", "labelled", "D", "verdict", "P(true)", "outcome", "reason", "in detail"], table,
              "D is the label's fall of chi-square from a refit of the coefficients alone to one with the "
              "true effects; P(true) the share the verdict gave to the labelled families.", digits=3),
    ]  # fmt: skip


def _parameters(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    table = [
        [p["bundle"], _words(p["effect"]), _words(p["parameter"]), p["true"], p["said"], p["sd"], p["unit"],
         p["error_in_sd"], "yes" if p["inside"] else "no", "yes" if p["named"] else "no",
         "" if p["inside"] else OUTSIDE_INTERVAL[p["bundle"]]]
        for p in rows
    ]  # fmt: skip
    columns = [
        "bundle",
        "effect",
        "parameter",
        "true",
        "said",
        "sd",
        "unit",
        "error in sd",
        "in 95 %",
        "named",
        "why",
    ]
    about = (
        "Every parameter that label and verdict both state, also of effects that came first without being "
        "named. Left out: drag of a line, compass deviation and causes outside the list, which the labels "
        "state in units of their own, and one wrong coefficient, which a verdict states among the "
        "coefficients."
    )
    return [Table(columns, table, about, digits=3)]


def _expected(results: Mapping[str, Any]) -> list[Block]:
    return [
        Text(
            "The fifth expectation of EXPECTATION.md, written before the verdicts were made. Expectations "
            "speak of causes that are isolable and not hidden; a label does not tell which are, so the "
            "rows here take all single causes with D of at least 25 and are harder."
        ),
        Table(["quantity", "expected", "came true"], results["expected"], ""),
    ]


def _every(rows: Sequence[Mapping[str, Any]]) -> Table:
    table = [
        [r["bundle"], r["dof"], _names(r["labelled"]), r["class"], r["noncentrality"], _words(r["verdict"]),
         _names(r["effects"]), r["p_right"], _names(r["set"]), r["fate"], "yes" if r["exactly"] else "no"]
        for r in rows
    ]  # fmt: skip
    columns = ["bundle", "dof", "labelled", "the maker's class", "D", "verdict", "effects", "P(true)",
               "95 % set", "outcome", "word for word"]  # fmt: skip
    about = "Two counts: outcome by family of causes, and whether the verdict says the label word for word."
    return Table(columns, table, about, digits=3)  # fmt: skip


def wind_blocks(wind: Mapping[str, Any]) -> list[Block]:
    """Section about the committed statements of wind."""
    s = wind["sum"]
    rows = []
    for r in wind["runs"]:
        m = r["measured"]
        cells: list[Any] = [
            r["run"],
            _words(r["verdict"]),
            "yes" if r["in_set"] else "no",
            DEG * m["from"],
            m["speed"],
        ]
        if "speed" in r:
            cells += [
                f"{DEG * r['from']:.0f} ± "
                f"{DEG * 1.96 * r['from_sd']:.0f}", f"{DEG * r['direction_error']:+.0f}",
                _yes(r["direction_inside"]), f"{r['speed']:.2f} ± {1.96 * r['speed_sd']:.2f}",
                f"{r['speed_error']:+.2f}", _yes(r["speed_inside"]),
                f"{r['scaled']:.2f} ± {1.96 * r['scaled_sd']:.2f}", f"{r['scaled_error']:+.2f}",
                _yes(r["scaled_inside"]),
            ]  # fmt: skip
        else:
            off = r.get("force_direction_error")
            cells += [
                "" if off is None else "a steady force",
                "" if off is None else f"{DEG * off:+.0f}",
                *[""] * 7,
            ]
        rows.append(cells)
    columns = [
        "run", "verdict", "wind or steady force in the set", "measured from [deg]", "measured [m/s]",
        "said from", "off", "in 95 %", "said [m/s]", "off", "in 95 %", "scaled as in October [m/s]", "off",
        "in 95 %",
    ]  # fmt: skip
    text = (
        "The committed report gave speeds as the catalogue's areas have them and, beside them, divided "
        "by the "
        f"root of the area that fitted the measured wind of October ({wind['area']['area']:.2f} ± "
        f"{wind['area']['sd']:.2f} of the catalogue's). **The scaling made the statements worse**: mean "
        f"error {s['speed_error']:.2f} m/s before and {s['scaled_error']:.2f} m/s after. The committed "
        f"report "
        f"could have known: scaled, its own check on October said {_range(wind['october'], 'scaled')} m/s "
        f"where the anemometer had {_range(wind['october'], 'measured')}, unscaled "
        f"{_range(wind['october'], 'said')}. Directions are good to {DEG * s['direction_error']:.0f} "
        "degrees where one was said. All zig-zags of July were executed in wind that the verdicts do not "
        "name; likely because they last 80 to 130 s and turn both ways, so that the coefficients, free "
        "within their prior, take the place of 1 to 2 m/s of wind. 'none' was the wrong word for those "
        f"runs: the 95 % set holds wind or a steady force in {s['in_set']} of {s['runs']} runs."
    )
    return [
        Text(text),
        Table(columns, rows, "Measured: mean vector of the anemometer over the seconds diagnosed.", digits=3),
    ]


def _range(rows: Sequence[Mapping[str, Any]], key: str) -> str:
    values = [r[key] for r in rows]
    return f"{min(values):.1f} to {max(values):.1f}" if values else "nothing"


def _yes(x: bool) -> str:
    return "yes" if x else "no"


def _how(results: Mapping[str, Any]) -> str:
    commitment = results["seal"]
    bundles = results["same_bundles"]
    same = (
        "The labelled bundles were not at hand."
        if bundles is None
        else f"{bundles} of {len(results['bundles'])} bundles beside the labels are the committed ones."
    )
    return (
        f"Verdicts committed {commitment['sealed']} as `{commitment['seal'][:16]}`, unchanged since; this "
        "report was made by `studies/withheld_score/run.py` from them and the labels (sha256 "
        f"`{results['labels'][:16]}`), which came after the commitment. {same} The commitment of "
        "that time covers the list of verdicts only, "
        "and the answers were not committed to beforehand: that they are those of the bundles rests on "
        "the maker's word. `bayesid.benchmark.protocol.labels` converts a label: names through the aliases "
        "of the contract, "
        "parameters where both mean the same quantity. A verdict is right when it names every labelled "
        "family and no other, says none where nothing is, says `coefficients` for wrong coefficients, or "
        f"rejects what is outside the list; `{literal(HALF)}` counts as a miss here. The expectations "
        "written before each solving, and the history of the verdicts, are in EXPECTATION.md and in git."
    )
