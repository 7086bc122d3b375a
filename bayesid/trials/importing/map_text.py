"""A map as TOML with its doubts as comments, to be edited.

Takes a `LogMap`. Does not: write files.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

from bayesid.trials.correction import WIND
from bayesid.trials.importing.log_map import ChannelMap, LogMap
from bayesid.trials.importing.roles import BODY_WORDS, ROLES, WORLD_WORDS
from bayesid.trials.true_wind import TRUE
from bayesid.trials.write import toml_text


def map_text(found: LogMap, remarks: Sequence[str] = (), unused: Sequence[str] = ()) -> str:
    """TOML text; `log_map.read_map` reads it back to the same map."""
    lines = [
        "# What the series of these logs are. Edit it, then: bayesid trial import SOURCE... --map THIS "
        "--out BUNDLE"
    ]
    lines.append("format = 1")
    if found.name:
        lines.append(f"name = {toml_text(found.name)}")
    lines.append(
        f"vehicle = {toml_text(found.vehicle)}"
        + ("" if found.vehicle else '  # a built-in name, or "vehicle.toml" beside this file')
    )
    if found.attribution:
        lines.append(f"attribution = {toml_text(found.attribution)}")
    if found.dof:
        lines.append(f"dof = {found.dof}")
    if found.questions:
        lines += [
            "",
            "# Answer each by editing the map, then delete its line; nothing is imported while one is left.",
        ]
        lines += ["questions = [", *(f"  {toml_text(q)}," for q in found.questions), "]"]
    if remarks:
        lines += ["", "# Taken for granted:", *(f"#  - {r}" for r in remarks)]
    lines += [
        "",
        "# Axes of x, y, z, psi and of u, v, w, p, q, r, theta in the log; heading, north, latitude, ... "
        "mean the same in all.",
    ]
    world, body = found.world or "ned", found.body or "frd"
    lines.append(f'world = "{world}"  # {WORLD_WORDS[world]}; ned, enu or nwu')
    lines.append(f'body = "{body}"  # {BODY_WORDS[body]}; frd or flu')
    lines.append(f'rudder_positive = "{found.rudder_positive}"  # side to which a positive rudder turns')
    if found.origin:
        lines.append(f"origin = {list(found.origin)}  # deg, deg, m")
    elif "latitude" in found.channels:
        lines.append("# origin = [59.0, 10.0, 0.0]  # deg, deg, m; default: the first fix")
    lines.append(
        f"step = {found.step!r}  # s; one sample per channel and step"
        if found.step
        else "# step = 0.1  # s; one sample per channel and step"
    )
    for label, source in found.sources.items():
        lines += ["", f"[sources.{_key(label)}]", f"files = [{', '.join(map(toml_text, source.files))}]"]
        options = source.options
        if options.columns:
            lines.append(f"columns = [{', '.join(map(toml_text, options.columns))}]")
        if options.time:
            times = [toml_text(n) for n in options.time]
            lines.append(f"time = {times[0] if len(times) == 1 else '[' + ', '.join(times) + ']'}")
        for key, value in (
            ("clock", options.clock),
            ("time_unit", options.time_unit),
            ("world", source.world),
            ("body", source.body),
        ):
            if value:
                lines.append(f'{key} = "{value}"')
        if options.start is not None:
            lines.append(f'start = "{datetime.fromtimestamp(options.start, UTC).isoformat()}"')
        if options.spread:
            lines.append("spread = true  # rows of one stamp are spread evenly until the next")
        lines.append(f"clock_offset = {options.offset!r}  # s, added to its time")
    lines += ["", "[channels]  # what = { from = series, unit = its unit, scale and offset if any }"]
    width = max((len(_entry(role, entry)) for role, entry in found.channels.items()), default=0)
    for role, entry in found.channels.items():
        lines.append(f"{_entry(role, entry).ljust(min(width, 70))}  # {_meaning(found, role)}")
    if unused:
        lines += [f"# not used: {', '.join(map(repr, unused[:40]))}" + (" ..." if len(unused) > 40 else "")]
    if found.corrections is not None:
        lines += ["", "[corrections]  # of trial.toml, applied to what is read by the lines above"]
        lines += found.corrections.lines(digits=15)
    for key, table in (("noise", found.noise), ("environment", found.environment)):
        if table:
            lines += ["", f"[{key}]", *(f"{toml_text(k)} = {v!r}" for k, v in table.items())]
    for run in found.runs:
        lines += [
            "",
            "[[runs]]",
            f"name = {toml_text(run.name)}",
            f"files = [{', '.join(map(toml_text, run.files))}]",
        ]
        if run.window:
            lines.append(f"window = [{run.window[0]!r}, {run.window[1]!r}]  # s from the first sample")
        lines.append(f"manoeuvre = {toml_text(run.manoeuvre)}")
        lines.append(f'role = "{run.role}"')
        if run.notes:
            lines.append(f"notes = {toml_text(run.notes)}")
    return "\n".join(lines) + "\n"


def _meaning(found: LogMap, role: str) -> str:
    if role in WIND and found.corrections is not None and found.corrections.wind != TRUE:
        return f"wind read on board ({found.corrections.wind}); [corrections] makes it the true one"
    return ROLES[role].meaning


def _key(label: str) -> str:
    """A label as a key of TOML: letters that are not ASCII want quotes."""
    return label if re.fullmatch(r"[A-Za-z0-9_-]+", label) else toml_text(label)


def _entry(role: str, entry: ChannelMap) -> str:
    parts = [f"from = {toml_text(entry.source)}"]
    if entry.unit:
        parts.append(f"unit = {toml_text(entry.unit)}")
    if entry.scale != 1.0:
        parts.append(f"scale = {entry.scale!r}")
    if entry.offset != 0.0:
        parts.append(f"offset = {entry.offset!r}")
    if entry.missing:
        parts.append(f"missing = {list(entry.missing)}")
    return f"{role} = {{ {', '.join(parts)} }}"
