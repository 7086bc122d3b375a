"""Formulas as MathML, which browsers draw by themselves: no script and nothing to load.

Takes the LaTeX of a math node. Does not number equations.
"""

from __future__ import annotations

from docutils import nodes
from latex2mathml.converter import convert


def register(app):
    """Make "mathml" a renderer of HTML pages."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))


def _inline(writer, node):
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(writer, node):
    lines = [part.strip() for part in node.astext().split("\n\n") if part.strip()]
    text = "".join(convert(line, display="block") for line in lines)
    writer.body.append(f'<div class="math">{text}</div>\n')
    raise nodes.SkipNode
