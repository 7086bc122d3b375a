"""The small markup of report texts, turned into HTML or Markdown.

Takes text that may hold names out of files. Knows paragraphs, lists, fences, bold, code and links only:
a lone `*` or `_` stays as it is, because coefficient names (`Y_*`, `X_u|u|`) are full of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape

_INLINE = re.compile(
    r"\\(?P<escaped>[\\`*\[\]])"
    r"|`(?P<code>[^`\n]+)`"
    r"|(?<![\w*])\*\*(?P<bold>[^\s*](?:[^*\n]*[^\s*])?)\*\*(?![\w*])"
    r"|\[(?P<label>[^\]\n]+)\]\((?P<url>(?:https?://|#)[^\s()<>\"']+)\)"
)
_INVISIBLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
_BULLET = re.compile(r"\s{0,3}[-•]\s+(.*)")
_NUMBERED = re.compile(r"\s{0,3}\d{1,3}[.)]\s+(.*)")


def visible(text: str) -> str:
    """Text in which a name out of a file cannot steer a terminal or turn the direction of reading.

    Control characters but line end and tab (C0, DEL, C1) and marks of direction become U+FFFD.
    """
    return _INVISIBLE.sub("\N{REPLACEMENT CHARACTER}", text)


def literal(name: object) -> str:
    """A foreign text (trial name, column) on one line, to stand inside a Text without acting as markup."""
    return re.sub(r"([\\`*\[\]])", r"\\\1", " ".join(str(name).split()))


def plain(text: str) -> str:
    """Bold, code and links of one line as words alone, for a terminal."""
    return _inline(text, plain=str, code=str, bold=str, link=lambda label, _: label)


def to_html(body: str) -> str:
    """Report text as HTML; everything that is not this markup is escaped."""
    parts: list[str] = []
    for kind, lines in _chunks(body):
        if kind == "code":
            parts.append(f"<pre><code>{escape(chr(10).join(lines))}</code></pre>")
        elif kind in ("ul", "ol"):
            items = "".join(f"<li>{inline_html(line)}</li>" for line in lines)
            parts.append(f"<{kind}>{items}</{kind}>")
        else:
            parts.append(f"<p>{inline_html(' '.join(lines))}</p>")
    return "\n".join(parts)


def inline_html(text: str) -> str:
    """Bold, code and links of one line as HTML."""
    return _inline(
        text,
        plain=escape,
        code=lambda s: f"<code>{escape(s)}</code>",
        bold=lambda s: f"<strong>{s}</strong>",
        link=lambda label, url: f'<a href="{escape(url)}">{escape(label)}</a>',
    )


def to_markdown(body: str) -> str:
    """Report text as Markdown in which foreign HTML and emphasis marks stay text."""
    parts: list[str] = []
    for kind, lines in _chunks(body):
        if kind == "code":
            parts.append("\n".join(["```", *(line.replace("```", "'''") for line in lines), "```"]))
        elif kind == "ul":
            parts.append("\n".join(f"- {inline_markdown(line)}" for line in lines))
        elif kind == "ol":
            parts.append("\n".join(f"{i}. {inline_markdown(line)}" for i, line in enumerate(lines, 1)))
        else:
            parts.append(inline_markdown("\n".join(lines)))
    return "\n\n".join(parts)


def inline_markdown(text: str) -> str:
    """Bold, code and links of one line as Markdown."""
    return _inline(
        text,
        plain=plain_markdown,
        code=lambda s: f"`{s}`",
        bold=lambda s: f"**{s}**",
        link=lambda label, url: f"[{plain_markdown(label)}]({url})",
    )


def plain_markdown(text: str) -> str:
    """Plain text that Markdown shows as it is, also inside a table cell."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\`*\[\]|]|^\s{0,3}#)", r"\\\1", text)


def _inline(
    text: str,
    *,
    plain: Callable[[str], str],
    code: Callable[[str], str],
    bold: Callable[[str], str],
    link: Callable[[str, str], str],
) -> str:
    out: list[str] = []
    position = 0
    for match in _INLINE.finditer(text):
        out.append(plain(text[position : match.start()]))
        position = match.end()
        if match["escaped"] is not None:
            out.append(plain(match["escaped"]))
        elif match["code"] is not None:
            out.append(code(match["code"]))
        elif match["bold"] is not None:
            out.append(bold(_inline(match["bold"], plain=plain, code=code, bold=bold, link=link)))
        else:
            out.append(link(match["label"], match["url"]))
    out.append(plain(text[position:]))
    return "".join(out)


def _chunks(body: str) -> list[tuple[str, list[str]]]:
    """The text cut into paragraphs ("p"), lists ("ul", "ol") and fences ("code")."""
    chunks: list[tuple[str, list[str]]] = []
    fenced = False
    fresh = True
    for line in body.replace("\r\n", "\n").split("\n"):
        if line.strip().startswith("```"):
            fenced = not fenced
            fresh = True
            if fenced:
                chunks.append(("code", []))
            continue
        if fenced:
            chunks[-1][1].append(line)
            continue
        if not line.strip():
            fresh = True
            continue
        kind, content = _kind(line)
        if kind == "p" and not fresh and chunks:
            chunk = chunks[-1]
            if chunk[0] == "p":
                chunk[1].append(content)
            else:
                chunk[1][-1] += " " + content  # a list item that runs over several lines
        elif kind != "p" and chunks and chunks[-1][0] == kind:
            chunks[-1][1].append(content)
        else:
            chunks.append((kind, [content]))
        fresh = False
    return chunks


def _kind(line: str) -> tuple[str, str]:
    for kind, pattern in (("ul", _BULLET), ("ol", _NUMBERED)):
        match = pattern.match(line)
        if match:
            return kind, match[1].strip()
    return "p", line.strip()
