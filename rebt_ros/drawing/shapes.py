"""Pictures as data: what is drawn and where, before it becomes SVG or PNG.

mark
    A text, a line, a panel, or a node of a tree, which is a panel with its texts.
drawing
    Marks and the room that they take, with the upper left corner at the origin.
page
    A drawing with margins around it, on white, and a title.

Lengths are in pixels, y grows downwards, colors are written #rrggbb.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from rebt_ros.drawing.layout import Point

#: Size of texts, unless they are titles.
SIZE = 13.0
SMALL_SIZE = 11.0
#: Width that a page is filled to.
PAGE_WIDTH = 1120.0
INK, FADED, FRAME = "#16283a", "#51606f", "#8aa2bb"
LINE = "#9aa8b6"

_TITLE_SIZE, _MARGIN = 19.0, 24.0
_FRAME_PADDING, _FRAME_GAP = 16.0, 18.0

#: Widths of characters in ems, on the wide side so that text fits whatever font there is.
_WIDTHS = {
    **dict.fromkeys("iljI.,:;'|!`", 0.33),
    **dict.fromkeys(' frt()[]{}/\\-"', 0.41),
    **dict.fromkeys("mwMW@%", 0.97),
    **dict.fromkeys("ABCDEFGHKNOPQRUVXYZ&", 0.75),
    **dict.fromkeys("=≠<>≤≥+→⇉↻", 0.84),
}
_USUAL_WIDTH, _DOUBLE_WIDTH = 0.63, 1.2
#: How much wider bold text is.
_BOLD_WIDTH = 1.12


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text."""

    x: float
    """Its left end, or its middle if it is centered."""
    y: float
    """Its baseline."""
    text: str
    color: str = INK
    size: float = SIZE
    bold: bool = False
    centered: bool = False

    def moved(self, x: float, y: float) -> Text:
        """The same to the right and further down."""
        return replace(self, x=self.x + x, y=self.y + y)


@dataclass(frozen=True, slots=True)
class Line:
    """A line through points."""

    points: tuple[Point, ...]

    def moved(self, x: float, y: float) -> Line:
        """The same to the right and further down."""
        return Line(tuple((from_x + x, from_y + y) for from_x, from_y in self.points))


@dataclass(frozen=True, slots=True)
class Panel:
    """A rectangle with rounded corners."""

    x: float
    y: float
    width: float
    height: float
    left_radius: float
    right_radius: float
    fill: str
    line: str
    dashed: bool = False

    def moved(self, x: float, y: float) -> Panel:
        """The same to the right and further down."""
        return replace(self, x=self.x + x, y=self.y + y)


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a tree."""

    panel: Panel
    texts: tuple[Text, ...]
    kind: str
    """A word for what it is, which tells it from others."""
    tooltip: str

    def moved(self, x: float, y: float) -> Node:
        """The same to the right and further down."""
        texts = tuple(text.moved(x, y) for text in self.texts)
        return replace(self, panel=self.panel.moved(x, y), texts=texts)


Mark: TypeAlias = Text | Line | Panel | Node


@dataclass(frozen=True, slots=True)
class Drawing:
    """Marks, those below others first."""

    marks: tuple[Mark, ...]
    width: float
    height: float

    def moved(self, x: float, y: float) -> tuple[Mark, ...]:
        """Its marks to the right and further down."""
        return tuple(mark.moved(x, y) for mark in self.marks)


@dataclass(frozen=True, slots=True)
class Page:
    """A whole picture."""

    title: str
    """What it shows, for those who do not see it."""
    drawing: Drawing


def page(title: str, subtitle: str, parts: Iterable[Drawing]) -> Page:
    """Title, subtitle and parts below each other."""
    marks: list[Mark] = []
    width, y = 0.0, _MARGIN
    for part in (_heading(title, subtitle), *parts):
        marks += part.moved(_MARGIN, y)
        width = max(width, part.width)
        y += part.height + _FRAME_GAP
    size = (width + 2 * _MARGIN, y - _FRAME_GAP + _MARGIN)
    return Page(f"{title}: {subtitle}", Drawing(tuple(marks), *size))


def shelves(drawings: Sequence[Drawing], width: float, gap: float = _FRAME_GAP) -> Drawing:
    """Drawings side by side, on as many shelves as they need."""
    marks: list[Mark] = []
    x, y, shelf, widest = 0.0, 0.0, 0.0, 0.0
    for drawing in drawings:
        if x and x + drawing.width > width:
            x, y, shelf = 0.0, y + shelf + gap, 0.0
        marks += drawing.moved(x, y)
        widest = max(widest, x + drawing.width)
        x, shelf = x + drawing.width + gap, max(shelf, drawing.height)
    return Drawing(tuple(marks), widest, y + shelf)


def framed(drawing: Drawing, text: str) -> Drawing:
    """The drawing in a dashed frame, under a heading."""
    caption = line_of_text(text, bold=True)
    width = max(drawing.width, caption.width) + 2 * _FRAME_PADDING
    top = _FRAME_PADDING + caption.height + 8
    height = top + drawing.height + _FRAME_PADDING
    frame = Panel(0, 0, width, height, 10, 10, "#fbfcfd", FRAME, dashed=True)
    marks = (
        frame,
        *caption.moved(_FRAME_PADDING, _FRAME_PADDING),
        *drawing.moved(_FRAME_PADDING, top),
    )
    return Drawing(marks, width, height)


def line_of_text(text: str, size: float = SIZE, color: str = INK, *, bold: bool = False) -> Drawing:
    """A line of text alone."""
    mark = Text(0, size, text, color, size, bold)
    return Drawing((mark,), text_width(text, size, bold=bold), size + 4)


def text_width(text: str, size: float = SIZE, *, bold: bool = False) -> float:
    """Estimated width of a line in pixels."""
    return size * sum(map(_character_width, text)) * (_BOLD_WIDTH if bold else 1)


def _heading(title: str, subtitle: str) -> Drawing:
    upper = line_of_text(title, _TITLE_SIZE, bold=True)
    lower = line_of_text(subtitle, color=FADED)
    top = upper.height + 4
    marks = (*upper.marks, *lower.moved(0, top))
    return Drawing(marks, max(upper.width, lower.width), top + lower.height)


def _character_width(character: str) -> float:
    if unicodedata.combining(character):
        return 0.0
    if unicodedata.east_asian_width(character) in "WF":
        return _DOUBLE_WIDTH
    return _WIDTHS.get(character, _USUAL_WIDTH)
