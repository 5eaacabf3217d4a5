"""Pages that need nothing else, in the colors of the reader's screen; all texts are escaped."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

#: What no text of a page may contain.
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff\ufffe\uffff]")

_STYLE = """
:root { color-scheme: light dark; --ground: #ffffff; --ink: #16283a; --faded: #51606f;
  --grid: #dfe5eb; --series-1: #1f6fb4; --series-2: #e08a2c; }
@media (prefers-color-scheme: dark) { :root { --ground: #12181f; --ink: #e6edf3; --faded: #9fb0c0;
  --grid: #2b3743; --series-1: #5aa9e6; --series-2: #f0a958; } }
body { font: 15px/1.5 system-ui, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif;
  background: var(--ground); color: var(--ink); max-width: 72rem; margin: 0 auto;
  padding: 1.5rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
p, li { max-width: 46rem; } .faded { color: var(--faded); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.3rem 0.8rem; border-bottom: 1px solid var(--grid); text-align: right;
  vertical-align: top; }
th:first-child, td:first-child, .words { text-align: left; }
td.words { font-size: 0.85rem; min-width: 18rem; overflow-wrap: anywhere; }
svg { width: 100%; max-width: 760px; height: auto; display: block; margin: 0.8rem 0; }
"""


def page(title: str, body: str, style: str = "") -> str:
    """A page.

    Args:
        title: What the browser calls it.
        body: As HTML.
        style: CSS beside that of all pages.
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title)}</title>\n"
        f"<style>{_STYLE}{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def table(rows: Sequence[Sequence[str]], words: int = 0) -> str:
    """A table.

    Args:
        rows: The heading and the lines.
        words: How many columns at the right are running text.
    """
    heading, *lines = rows
    numbers = len(heading) - words
    head = "".join(
        f'<th scope="col" class="words">{text(cell)}</th>'
        if place >= numbers
        else f'<th scope="col">{text(cell)}</th>'
        for place, cell in enumerate(heading)
    )
    body = "\n".join(
        "<tr>"
        + "".join(
            f'<td class="words">{text(cell)}</td>' if place >= numbers else f"<td>{text(cell)}</td>"
            for place, cell in enumerate(line)
        )
        + "</tr>"
        for line in lines
    )
    return (
        f'<div class="wide"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>'
        "\n</table></div>"
    )


def paragraph(words: str, *, faded: bool = False) -> str:
    """A paragraph."""
    return f'<p class="faded">{text(words)}</p>' if faded else f"<p>{text(words)}</p>"


def text(words: str) -> str:
    """A text as HTML has it."""
    return escape(_CONTROLS.sub("", words))
