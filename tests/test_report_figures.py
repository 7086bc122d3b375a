"""Figures on request as PDF and SVG: the same bytes for the same figure, and none made up of ready PNGs."""

import pytest
import typer

from bayesid.cli.options import FIGURE_FORMATS, figure_formats
from bayesid.report import writer
from bayesid.report.figure_style import subplots
from bayesid.report.writer import Figure, Report, Section


def drawn():
    figure, axes = subplots()
    axes.plot([0.0, 1.0], [0.0, 2.0])
    return figure


@pytest.fixture
def report():
    ready = Figure("ready", b"\x89PNG\r\n" + bytes(30))
    return Report("pond", "lead", [Section("one", [Figure("line", drawn()), ready])])


def test_every_format_is_written_beside_the_others(tmp_path, report):
    paths = writer.write_figures(report, tmp_path, ("pdf", "svg", "png"))
    assert {p.name for p in paths} == {"line.pdf", "line.svg", "line.png", "ready.png"}
    start = {"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}
    assert all(p.read_bytes().startswith(start[p.suffix[1:]]) for p in paths)


def test_a_pdf_is_the_same_bytes_again_and_has_no_date(tmp_path, report):
    first, again = (
        writer.write_figures(r, tmp_path / str(k), ("pdf",))[0].read_bytes()
        for k, r in enumerate((report, Report("pond", "", [Section("one", [Figure("line", drawn())])])))
    )
    assert first == again and b"CreationDate" not in first


def test_formats_are_checked_before_any_work(tmp_path):
    assert figure_formats(None, None) == ()
    assert figure_formats("PDF, svg,pdf", tmp_path) == ("pdf", "svg")
    for text, out in (("gif", tmp_path), ("", tmp_path), ("pdf", None)):
        with pytest.raises(typer.BadParameter):
            figure_formats(text, out)
    assert set(FIGURE_FORMATS) == set(writer.FORMATS)  # the command line loads no matplotlib to say them
