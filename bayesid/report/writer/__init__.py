"""The report writer: a report as plain data, written as one HTML file, Markdown and JSON.

Takes sections of text, tables and finished figures. Does not compute, draw or choose words.
"""

from __future__ import annotations

from bayesid.report.writer.blocks import Block, Figure, Replay, Report, Row, Section, Table, Text
from bayesid.report.writer.markup import literal, plain
from bayesid.report.writer.write import FORMATS, write, write_figures

__all__ = [
    "FORMATS", "Block", "Figure", "Replay", "Report", "Row", "Section", "Table", "Text", "literal", "plain",
    "write", "write_figures",
]  # fmt: skip
