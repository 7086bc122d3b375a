"""Writes a report folder: report.html (self-contained), report.md, results.json, figures/*.png.

Takes a Report and the results behind it. Every file is replaced as a whole; nothing is read back.
"""

from __future__ import annotations

import json
import math
import os
import platform
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from html import escape
from importlib import metadata, resources
from pathlib import Path
from typing import Any, NamedTuple

from bayesid import __version__
from bayesid.files import write_atomic, write_json
from bayesid.lock import holder
from bayesid.report.writer.blocks import (
    Block,
    Figure,
    Replay,
    Report,
    Row,
    Section,
    Table,
    Text,
    cell_text,
    figures_of,
)
from bayesid.report.writer.markup import (
    inline_html,
    inline_markdown,
    plain_markdown,
    to_html,
    to_markdown,
    visible,
)
from bayesid.report.writer.picture import pdf_bytes, png_and_svg, png_bytes, png_width, svg_bytes

PACKAGES = ("numpy", "scipy", "numba", "matplotlib", "emcee", "pysindy", "arviz", "pint", "h5py", "jinja2")


class Picture(NamedTuple):
    """A figure as it is embedded (SVG, unless that is large) and as it lies beside the report."""

    svg: bytes | None
    png: bytes


def write(report: Report, folder: str | os.PathLike[str], results: Mapping[str, Any]) -> Path:
    """Write the report folder and return the path of its HTML file.

    Parameters
    ----------
    report : what to show
    folder : made if missing; files of the same names are replaced, others left alone
    results : numbers behind the report, usually `inputs`, `seeds`, `targets`; the writer adds `title`,
        `created` (UTC), `versions`, and `command` where one holds the folder. Keys of its own win over those
        of the writer.

    Raises
    ------
    TypeError
        if `results` holds something without a JSON form
    OSError
        if the folder cannot be written
    """
    base = Path(folder)
    created = datetime.now(UTC).replace(microsecond=0).isoformat().replace("+00:00", "Z")
    command = holder(base)
    by = {} if command is None else {"command": command}
    record = {"title": report.title, "created": created, "versions": versions(), **by, **results}
    write_json(base / "results.json", record)  # first: the numbers are safe even if drawing fails
    images = {}
    for figure in figures_of((*report.first, *report.sections)):
        png, svg = png_and_svg(figure)
        write_atomic(base / "figures" / f"{figure.name}.png", png)
        images[figure.name] = Picture(svg, png)
    write_atomic(base / "report.md", visible(_markdown(report, record)))
    return write_atomic(base / "report.html", visible(_html(report, images, record)))


FORMATS: Mapping[str, Callable[[Figure], bytes | None]] = {
    "png": png_bytes,
    "pdf": pdf_bytes,
    "svg": partial(svg_bytes, most=math.inf),
}


def write_figures(report: Report, folder: str | os.PathLike[str], formats: Sequence[str]) -> list[Path]:
    """Write every figure of a report below `figures/` in each of the formats (`FORMATS`).

    Pictures that came as ready PNG bytes have no other format and are left out there.
    """
    paths = []
    for figure in figures_of((*report.first, *report.sections)):
        for name in formats:
            data = FORMATS[name](figure)
            if data is not None:
                paths.append(write_atomic(Path(folder) / "figures" / f"{figure.name}.{name}", data))
    return paths


def versions() -> dict[str, str]:
    """Versions of bayesid, Python and the installed packages results depend on."""
    found = {"bayesid": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _html(report: Report, images: Mapping[str, Picture], record: Mapping[str, Any]) -> str:
    from jinja2 import Environment
    from markupsafe import Markup

    anchors = _Anchors()
    contents: list[tuple[str, str]] = []
    body: list[str] = []
    for section in report.sections:
        anchor = anchors.new(section.title)
        contents.append((anchor, section.title))
        body.append(_section_html(section, 2, anchor, images))
    source = resources.files("bayesid.report.writer").joinpath("templates/report.html.j2").read_text("utf-8")
    folder = resources.files("bayesid.report.writer").joinpath("templates")
    moves = _holds_replay((*report.first, *report.sections))
    script = "\n" + folder.joinpath("replay.js").read_text("utf-8") if moves else ""
    template = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(source)
    return template.render(
        title=report.title,
        script=Markup(script),
        script_hash=b64encode(sha256(script.encode()).digest()).decode("ascii"),
        lead=Markup(to_html(report.lead)),
        failures=[Markup(inline_html(text)) for text in report.failures],
        first=Markup("\n".join(_block_html(block, 2, images) for block in report.first)),
        contents=contents,
        body=Markup("\n".join(body)),
        created=record["created"],
        versions=record["versions"],
    )


def _section_html(section: Section, level: int, anchor: str, images: Mapping[str, Picture]) -> str:
    identity = f' id="{anchor}"' if anchor else ""
    parts = [f"<section{identity}>", f"<h{level}>{escape(section.title)}</h{level}>"]
    parts += [_block_html(block, level, images) for block in section.blocks]
    return "\n".join([*parts, "</section>"])


def _block_html(block: Block, level: int, images: Mapping[str, Picture]) -> str:
    if isinstance(block, Text):
        return to_html(block.body)
    if isinstance(block, Section):
        return _section_html(block, min(level + 1, 6), "", images)
    if isinstance(block, Replay):
        return _replay_html(block)
    if isinstance(block, Row):
        caption = f"<figcaption>{inline_html(block.caption)}</figcaption>" if block.caption else ""
        return "".join(
            ['<figure class="row">', *(_image_html(f, images) for f in block.figures), caption, "</figure>"]
        )
    if isinstance(block, Figure):
        caption = f"<figcaption>{inline_html(block.caption)}</figcaption>" if block.caption else ""
        return f"<figure>{_image_html(block, images)}{caption}</figure>"
    return _table_html(block)


def _replay_html(block: Replay) -> str:
    # "<" as an escape, so that no text of the data can end the element
    data = json.dumps(block.data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    caption = f"<figcaption>{inline_html(block.caption)}</figcaption>" if block.caption else ""
    return (
        f'<figure class="replay"><script type="application/json">{data}</script>'
        '<canvas class="track"></canvas><canvas class="traces"></canvas>'
        '<div><button type="button">Play</button><input type="range" min="0" value="0" aria-label="time">'
        f"</div><output></output>{caption}</figure>"
    )


def _holds_replay(blocks: Sequence[Block]) -> bool:
    return any(isinstance(b, Replay) or (isinstance(b, Section) and _holds_replay(b.blocks)) for b in blocks)


def _image_html(figure: Figure, images: Mapping[str, Picture]) -> str:
    picture = images[figure.name]
    kind, data = ("png", picture.png) if picture.svg is None else ("svg+xml", picture.svg)
    source = f"data:image/{kind};base64,{b64encode(data).decode('ascii')}"
    words = escape(figure.alt or figure.caption or figure.name)
    return f'<img src="{source}" width="{png_width(picture.png)}" alt="{words}">'


def _table_html(table: Table) -> str:
    classes = [' class="num"' if _is_numeric(table, k) else "" for k in range(len(table.columns))]
    head = "".join(f"<th{c}>{escape(name)}</th>" for c, name in zip(classes, table.columns, strict=True))
    rows = []
    for row in table.rows:
        texts = (escape(cell_text(value, table.digits)) for value in row)
        cells = "".join(f"<td{c}>{text}</td>" for c, text in zip(classes, texts, strict=True))
        rows.append(f"<tr>{cells}</tr>")
    caption = f"<caption><span>{inline_html(table.caption)}</span></caption>" if table.caption else ""
    return (
        f'<div class="table"><table>{caption}<thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _markdown(report: Report, record: Mapping[str, Any]) -> str:
    parts = [f"# {plain_markdown(report.title)}", to_markdown(report.lead)]
    parts += [f"**Check failed:** {inline_markdown(text)}" for text in report.failures]
    parts += _blocks_markdown(report.first, 2)
    for section in report.sections:
        parts += _section_markdown(section, 2)
    stated = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    parts += ["---", f"Written {record['created']} with {plain_markdown(stated)}. Numbers: `results.json`."]
    return "\n\n".join(part for part in parts if part) + "\n"


def _section_markdown(section: Section, level: int) -> list[str]:
    return [f"{'#' * level} {plain_markdown(section.title)}", *_blocks_markdown(section.blocks, level)]


def _blocks_markdown(blocks: Sequence[Block], level: int) -> list[str]:
    parts: list[str] = []
    for block in blocks:
        if isinstance(block, Text):
            parts.append(to_markdown(block.body))
        elif isinstance(block, Replay):
            continue
        elif isinstance(block, Section):
            parts += _section_markdown(block, min(level + 1, 6))
        elif isinstance(block, Figure | Row):
            for figure in (block,) if isinstance(block, Figure) else block.figures:
                alt = plain_markdown(figure.alt or figure.caption or figure.name).replace("\n", " ")
                parts.append(f"![{alt}](figures/{figure.name}.png)")
            if block.caption:
                parts.append(inline_markdown(block.caption))
        else:
            parts.append(_table_markdown(block))
    return parts


def _table_markdown(table: Table) -> str:
    def line(cells: Any) -> str:
        return "| " + " | ".join(plain_markdown(" ".join(str(cell).split())) for cell in cells) + " |"

    numeric = [_is_numeric(table, k) for k in range(len(table.columns))]
    rule = "|" + "|".join(" ---: " if right else " --- " for right in numeric) + "|"
    rows = [line(cell_text(value, table.digits) for value in row) for row in table.rows]
    text = "\n".join([line(table.columns), rule, *rows])
    return f"{inline_markdown(table.caption)}\n\n{text}" if table.caption else text


def _is_numeric(table: Table, column: int) -> bool:
    values = [row[column] for row in table.rows if row[column] is not None]
    return bool(values) and all(
        not isinstance(value, bool | str) and hasattr(value, "__float__") for value in values
    )


class _Anchors:
    """Unique ids made of a title's plain letters."""

    def __init__(self) -> None:
        self.used: set[str] = set()

    def new(self, title: str) -> str:
        stem = "-".join("".join(c if c.isascii() and c.isalnum() else " " for c in title.lower()).split())
        stem = stem or "section"
        anchor, count = stem, 1
        while anchor in self.used:
            count += 1
            anchor = f"{stem}-{count}"
        self.used.add(anchor)
        return anchor
