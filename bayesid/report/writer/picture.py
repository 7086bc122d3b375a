"""A figure as PNG, in 256 colours wherever the eye cannot tell, as SVG where that is small, and as PDF.

Takes a Figure. Gives bytes. Drawings of lines, texts and areas have a few colours and their blends at
edges: a palette makes them a third of the size, which is what a report with twenty embedded figures weighs.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bayesid.report.writer.blocks import Figure

COLOURS = 256
VISIBLE = 1.5  # rms change of a channel of 255; smooth areas of many colours begin to show bands above it
MAX_PNG = 200_000  # bytes; above it the palette is taken even so
MAX_SVG = 95_000  # bytes; a drawing of more points is embedded as PNG
STAMPS = re.compile(rb"<metadata>.*?</metadata>", re.DOTALL)


def png_and_svg(figure: Figure) -> tuple[bytes, bytes | None]:
    """`png_bytes` and `svg_bytes` of one layout, whose making costs as much as a drawing."""
    if not hasattr(figure.image, "savefig"):
        return png_bytes(figure), svg_bytes(figure)
    with laid_out(figure.image) as box:
        return png_bytes(figure, box), svg_bytes(figure, box=box)


@contextmanager
def laid_out(image: Any) -> Iterator[Any]:
    """The layout of a matplotlib figure made and kept; gives the box [inches] around what is drawn."""
    import matplotlib

    engine = image.get_layout_engine()
    image.draw_without_rendering()
    box = image.get_tightbbox().padded(matplotlib.rcParams["savefig.pad_inches"])
    with matplotlib.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
        image.set_layout_engine(None)  # "none" would leave a placeholder, for which matplotlib draws twice
    try:
        yield box
    finally:
        if engine is not None:
            image.set_layout_engine(engine)


def png_bytes(figure: Figure, box: Any = "tight") -> bytes:
    """The picture as PNG without date or tool name: an unchanged figure gives unchanged bytes.

    Bytes that came as they are stay as they are. `box` [inches] is what is kept of the paper.
    """
    if not hasattr(figure.image, "savefig"):
        return bytes(figure.image)
    buffer = io.BytesIO()
    figure.image.savefig(buffer, format="png", bbox_inches=box, metadata={"Software": None})
    return reduced(buffer.getvalue())


def svg_bytes(figure: Figure, most: float = MAX_SVG, box: Any = "tight") -> bytes | None:
    """The picture as SVG, the same bytes for the same figure; None for ready bytes and those above `most`."""
    if not hasattr(figure.image, "savefig"):
        return None
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": figure.name, "svg.fonttype": "path"}):
        figure.image.savefig(buffer, format="svg", bbox_inches=box, metadata={"Date": None})
    data = STAMPS.sub(b"", buffer.getvalue())
    return data if len(data) <= most else None


def pdf_bytes(figure: Figure) -> bytes | None:
    """The picture as PDF, text as text, the same bytes for the same figure; None for ready bytes."""
    if not hasattr(figure.image, "savefig"):
        return None
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context({"pdf.fonttype": 42}):
        figure.image.savefig(buffer, format="pdf", bbox_inches="tight", metadata={"CreationDate": None})
    return buffer.getvalue()


def png_width(data: bytes) -> int:
    """Width [pixels] of a PNG."""
    return int.from_bytes(data[16:20], "big")


def reduced(data: bytes) -> bytes:
    """The smaller of a PNG and its form with a palette, if that looks the same or the PNG is too large.

    Transparent parts are laid on white, the paper of a report.
    """
    import numpy as np
    from PIL import Image  # comes with matplotlib

    out = io.BytesIO()
    with Image.open(io.BytesIO(data)) as picture:
        whole = picture.convert("RGBA")
    whole = Image.alpha_composite(Image.new("RGBA", whole.size, "white"), whole).convert("RGB")
    few = whole.quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(out, format="PNG", optimize=True)
    change = np.asarray(few.convert("RGB"), dtype=float) - np.asarray(whole, dtype=float)
    if np.sqrt(np.mean(change**2)) > VISIBLE and len(data) <= MAX_PNG:
        return data
    return min(data, out.getvalue(), key=len)
