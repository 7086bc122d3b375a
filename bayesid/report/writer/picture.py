"""A figure as PNG, in 256 colours wherever the eye cannot tell, as SVG where that is small, and as PDF.

Takes a Figure. Gives bytes. Drawings of lines, texts and areas have a few colours and their blends at
edges: a palette makes them a third of the size, which is what a report with twenty embedded figures weighs.
"""

from __future__ import annotations

import io
import re

from bayesid.report.writer.blocks import Figure

COLOURS = 256
VISIBLE = 1.5  # rms change of a channel of 255; smooth areas of many colours begin to show bands above it
MAX_PNG = 200_000  # bytes; above it the palette is taken even so
MAX_SVG = 95_000  # bytes; a drawing of more points is embedded as PNG
STAMPS = re.compile(rb"<metadata>.*?</metadata>", re.DOTALL)


def png_bytes(figure: Figure) -> bytes:
    """The picture as PNG without date or tool name: an unchanged figure gives unchanged bytes.

    Bytes that came as they are stay as they are.
    """
    if not hasattr(figure.image, "savefig"):
        return bytes(figure.image)
    buffer = io.BytesIO()
    figure.image.savefig(buffer, format="png", bbox_inches="tight", metadata={"Software": None})
    return reduced(buffer.getvalue())


def svg_bytes(figure: Figure, most: float = MAX_SVG) -> bytes | None:
    """The picture as SVG, the same bytes for the same figure; None for ready bytes and those above `most`."""
    if not hasattr(figure.image, "savefig"):
        return None
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": figure.name, "svg.fonttype": "path"}):
        figure.image.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
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
