"""A report is self-contained, keeps foreign names as text, and stores its numbers even if drawing fails."""

from __future__ import annotations

import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure as MplFigure

from bayesid.report.figure_style import COLOURS, styled, subplots
from bayesid.report.writer import Figure, Report, Section, Table, Text, literal, write
from bayesid.report.writer.blocks import cell_text
from bayesid.report.writer.markup import to_html, to_markdown
from bayesid.report.writer.picture import png_bytes, png_width, reduced, svg_bytes

NASTY = "<script>alert(1)</script> **bold** [link](https://example.org) `code` | # & \"x\" 'y'"
ALLOWED_TAGS = {"p", "ul", "ol", "li", "pre", "code", "strong", "a"}


class _Page(HTMLParser):
    """Collects tags, attributes and visible text of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.text = ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def handle_data(self, data):
        self.text += data


@styled
def _figure():
    figure, axes = subplots(1, 2)
    time = np.linspace(0, 60, 600)
    for k, name in enumerate(COLOURS):
        axes[0].plot(time, np.sin(time / 5 + k), label=name)
    axes[0].legend()
    return figure


def _report(name: str = NASTY) -> Report:
    table = Table([name, "n"], [[name, 1.5], [None, np.nan]], literal(name))
    return Report(
        name,
        f"Lead about {literal(name)}.",
        [
            Section(name, [Text(literal(name)), table]),
            Section(name, [Figure("tracks", _figure(), literal(name), alt=name)]),
        ],
    )


def test_a_name_from_a_file_never_becomes_markup_or_html(tmp_path):
    page = _Page(write(_report(), tmp_path, {}).read_text())
    assert "script" not in page.tags
    assert page.tags.count("a") == 2, "only the two entries of the contents"
    assert all(value.startswith("#") for tag, name, value in page.attributes if tag == "a")
    # title, h1, lead; two entries of the contents, two headings; text, two captions, two cells
    assert page.text.count(NASTY) == 12


def test_no_control_character_of_a_name_reaches_a_report(tmp_path):
    name = "run\x1b[2J\x9b31m\x07\x00\x7f\u202egnp"
    parts = [Text(f"{name}: `{name}`"), Table((name,), ((name,), (1.0,)), caption=name)]
    write(Report(name, name, [Section(name, parts)]), tmp_path, {"inputs": name})
    for page in ("report.md", "report.html"):
        text = (tmp_path / page).read_text(encoding="utf-8")
        assert "[2J" in text and not set(text) & set("\x1b\x9b\x07\x00\x7f\u202e")
    assert json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))["inputs"] == name


def test_html_asks_no_other_file_or_server(tmp_path):
    html = write(_report("Trial"), tmp_path, {}).read_text()
    sources = [value for _, name, value in _Page(html).attributes if name in ("src", "href")]
    embedded = ("data:image/png;base64,", "data:image/svg+xml;base64,", "#")
    assert sources and all(value.startswith(embedded) for value in sources)
    assert "url(" not in html and "@import" not in html


def test_drawings_are_embedded_as_svg_that_asks_for_nothing_and_never_changes(tmp_path):
    one, two = (svg_bytes(Figure("tracks", _figure(), "")) for _ in "ab")
    assert one == two and one is not None
    text = one.decode("utf-8")
    assert "<script" not in text and "<metadata" not in text
    asked = re.findall(r'(?:href|src)="([^"]*)"', text)
    assert all(a.startswith("#") for a in asked)
    write(_report("Trial"), tmp_path, {})
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "data:image/svg+xml;base64," in html


@pytest.mark.thorough
def test_a_drawing_of_many_points_and_ready_bytes_stay_png(tmp_path):
    figure, axes = subplots()
    rng = np.random.default_rng(0)
    axes.scatter(*rng.standard_normal((2, 20_000)))
    assert svg_bytes(Figure("cloud", figure, "")) is None
    assert svg_bytes(Figure("bytes", b"\x89PNG", "")) is None
    html = write(Report("t", "l", [Section("s", [Figure("cloud", figure, "c")])]), tmp_path, {}).read_text()
    assert "image/png" in html and "svg+xml" not in html
    size = png_width((tmp_path / "figures" / "cloud.png").read_bytes())
    assert f'width="{size}"' in html


def test_a_long_heading_of_numbers_may_wrap(tmp_path):
    """On one line it pushed the last columns of a table off the page."""
    html = write(_report("Trial"), tmp_path, {}).read_text()
    unbroken = [rule for rule in html.split("<style>")[1].split("}") if "nowrap" in rule]
    assert unbroken and not any("th" in rule.split("{")[0] for rule in unbroken)


@given(st.text())
def test_any_text_gives_only_the_tags_of_the_markup(text):
    assert set(_Page(to_html(text)).tags) <= ALLOWED_TAGS


@given(st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), min_size=1))
def test_literal_text_reads_back_unchanged(text):
    expected = " ".join(text.split())
    assert _Page(f"<p>{to_html('x ' + literal(text))}</p>").text == f"x {expected}".rstrip()


def test_markup_gives_lists_fences_bold_code_and_links():
    link = "[more](https://example.org/?a=1&b=2)"
    html = to_html(f"One **bold `X_u|u|`** line\nand {link}.\n\n- a\n- b\n  c\n\n```\n<x>\n```")
    assert html == (
        "<p>One <strong>bold <code>X_u|u|</code></strong> line and "
        '<a href="https://example.org/?a=1&amp;b=2">more</a>.</p>\n'
        "<ul><li>a</li><li>b c</li></ul>\n<pre><code>&lt;x&gt;</code></pre>"
    )


def test_coefficient_names_keep_their_stars_and_underscores():
    assert to_html("Y_* and N_* and x**2") == "<p>Y_* and N_* and x**2</p>"


def test_a_link_to_a_script_stays_text():
    assert "<a" not in to_html("[x](javascript:alert(1))")


def test_markdown_escapes_foreign_html_and_table_bars():
    assert to_markdown("<img src=x> a|b") == "&lt;img src=x&gt; a\\|b"


def test_results_hold_title_versions_and_a_time_in_utc(tmp_path):
    write(_report("Cases"), tmp_path, {"inputs": {"duration": 700.0}, "seeds": [1, 2], "targets": {}})
    record = json.loads((tmp_path / "results.json").read_text())
    assert (record["title"], record["seeds"], record["inputs"]) == ("Cases", [1, 2], {"duration": 700.0})
    assert {"bayesid", "python", "numpy", "scipy", "numba"} <= set(record["versions"])
    assert record["created"].endswith("Z")


def test_numbers_are_stored_even_if_a_figure_cannot_be_drawn(tmp_path):
    class Broken(MplFigure):
        def savefig(self, *args, **kwargs):
            raise RuntimeError("font missing")

    report = Report("Broken", "", [Section("A", [Figure("a", Broken())])])
    with pytest.raises(RuntimeError, match="font missing"):
        write(report, tmp_path, {"seeds": [3]})
    assert json.loads((tmp_path / "results.json").read_text())["seeds"] == [3]


@pytest.mark.thorough
def test_a_dense_figure_stays_below_200_kb(tmp_path):
    rng = np.random.default_rng(1)

    @styled
    def dense():
        figure, axes = subplots(2, 2, height=7)
        for ax in axes.flat:
            ax.scatter(*rng.standard_normal((2, 4000)), c=rng.random(4000), s=4)
        return figure

    write(Report("Dense", "", [Section("A", [Figure("dense", dense())])]), tmp_path, {})
    assert (tmp_path / "figures" / "dense.png").stat().st_size < 200_000


def _pixels(data: bytes):
    from PIL import Image

    with Image.open(io.BytesIO(data)) as picture:
        return np.asarray(picture.convert("RGB"), dtype=float)


def test_a_drawing_is_stored_with_a_palette_a_third_as_large_and_looks_the_same():
    whole = io.BytesIO()
    figure = _figure()
    figure.savefig(whole, format="png", bbox_inches="tight", metadata={"Software": None})
    stored = png_bytes(Figure("tracks", figure))
    assert stored[25] == 3, "PNG of palette type"
    assert len(stored) < 0.45 * len(whole.getvalue())
    change = np.abs(_pixels(stored) - _pixels(whole.getvalue()))
    assert np.sqrt(np.mean(change**2)) < 1.5 and np.mean(change > 16) < 0.005


def test_a_picture_that_a_palette_would_spoil_stays_as_it_is():
    from PIL import Image

    rng = np.random.default_rng(0)
    noise = io.BytesIO()
    Image.fromarray(rng.integers(0, 256, (120, 120, 3), dtype=np.uint8)).save(noise, "PNG")
    assert reduced(noise.getvalue()) == noise.getvalue()
    large = io.BytesIO()
    Image.fromarray(rng.integers(0, 256, (400, 400, 3), dtype=np.uint8)).save(large, "PNG")
    assert len(reduced(large.getvalue())) < 200_000 < len(large.getvalue())


@pytest.mark.thorough
def test_an_unchanged_figure_gives_unchanged_bytes(tmp_path):
    drawn = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        write(_report("Same"), folder, {})
        drawn.append((folder / "figures" / "tracks.png").read_bytes())
    assert drawn[0] == drawn[1]


def test_the_house_style_leaves_the_callers_settings_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    _figure().savefig(io.BytesIO())
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("name", ["../evil", "a/b", "", "x.png", "-a"])
def test_a_figure_name_cannot_leave_its_folder(name):
    with pytest.raises(ValueError, match="figure name"):
        Figure(name, b"\x89PNG")


def test_two_figures_of_one_name_are_refused():
    recovery = Section("A", [Figure("a", b"\x89PNG"), Section("B", [Figure("a", b"\x89PNG")])])
    with pytest.raises(ValueError, match="two figures"):
        Report("T", "", [recovery])


def test_a_short_row_is_refused_when_the_table_is_made():
    with pytest.raises(ValueError, match="row 1 has 1 cells for 2 columns"):
        Table(["a", "b"], [[1, 2], [1]])


@pytest.mark.parametrize(
    "value, text",
    [
        (1234.5678, "1235"),
        (123456.7, "123457"),
        (1e-9, "1.000e-09"),
        (0.0, "0"),
        (np.float64(-0.25), "-0.25"),
        (2_000_000.0, "2.000e+06"),
        (None, "–"),
        (float("nan"), "–"),
        (True, "yes"),
        (np.int64(12), "12"),
    ],
)
def test_cells_show_four_significant_digits(value, text):
    assert cell_text(value) == text
