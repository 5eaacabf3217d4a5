"""Drawn trees: colored boxes with words in them, laid out and linked, and a legend of colors.

Every text has a contrast of at least 4.5 (WCAG 2 AA) to its box.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from rebt_ros.behavior_tree.wording import Kind
from rebt_ros.drawing.layout import Box, Layout, Point, outline, top_down
from rebt_ros.drawing.shapes import (
    FADED,
    PAGE_WIDTH,
    SIZE,
    SMALL_SIZE,
    Drawing,
    Line,
    Mark,
    Node,
    Panel,
    Text,
    line_of_text,
    shelves,
    text_width,
)


@dataclass(frozen=True, slots=True)
class Colors:
    """Colors of a kind of node, as #rrggbb."""

    fill: str
    line: str
    text: str


PALETTE = {
    Kind.CONTROL: Colors("#33475f", "#33475f", "#ffffff"),
    Kind.CONDITION: Colors("#eaf1f8", "#8aa2bb", "#16283a"),
    Kind.INVERTER: Colors("#fbdcd7", "#c4574a", "#7c1d12"),
    Kind.ACTION: Colors("#1d7350", "#1d7350", "#ffffff"),
    Kind.PSA: Colors("#7647a2", "#7647a2", "#ffffff"),
    Kind.LAT_SEQUENCE: Colors("#a14a12", "#a14a12", "#ffffff"),
    Kind.REPEATER: Colors("#a02c5f", "#a02c5f", "#ffffff"),
}

#: Conditions and what inverts them are pills, all others are boxes with round corners.
_PILLS = frozenset({Kind.CONDITION, Kind.INVERTER})
_HEIGHT, _DETAIL_HEIGHT, _PADDING, _RADIUS = 30.0, 16.0, 10.0, 6.0
#: From the baseline to the middle of a line of text, in ems.
_MIDDLE = 0.35
_CHIP = 14.0
#: Larger trees are drawn as an outline.
_TOP_DOWN_LEAVES, _TOP_DOWN_WIDTH = 25, 1500.0


@dataclass(frozen=True, slots=True)
class Cell:
    """A box with its words."""

    text: str
    kind: Kind
    tooltip: str
    detail: str = ""
    """A second line in smaller letters."""

    @property
    def bold(self) -> bool:
        """Whether the words are."""
        return self.kind is not Kind.CONDITION

    @property
    def width(self) -> float:
        """Of the box."""
        words = text_width(self.text, bold=self.bold)
        return max(words, text_width(self.detail, SMALL_SIZE)) + 2 * _PADDING


@dataclass(frozen=True, slots=True)
class Figure:
    """One box of the layout: a cell, or cells that belong together side by side."""

    cells: tuple[Cell, ...]
    parent: int | None
    """Position of its parent among the figures; None for the root."""
    answer: str = ""
    """A word on the link from its parent."""

    @property
    def height(self) -> float:
        """Of all its cells."""
        return _HEIGHT + (_DETAIL_HEIGHT if any(cell.detail for cell in self.cells) else 0)

    @property
    def box(self) -> Box:
        """The room that it takes."""
        return Box(sum(cell.width for cell in self.cells), self.height, self.parent)


def drawn(figures: Sequence[Figure]) -> Drawing:
    """The tree, given in preorder.

    Trees that are neither large nor wide are drawn from the top down; others as an outline, in
    which leaves follow their parent to the right and other children stand indented below it.
    """
    layout = _layout(figures)
    marks: list[Mark] = [Line(_whole(link)) for link in layout.links]
    # The root has no link.
    for link, figure in zip(layout.links, figures[1:], strict=True):
        if figure.answer:
            marks += _answer(figure.answer, link)
    for corner, figure in zip(layout.corners, figures, strict=True):
        marks += _nodes(figure, corner)
    return Drawing(tuple(marks), layout.width, layout.height)


def legend(kinds: Iterable[Kind], width: float = PAGE_WIDTH) -> Drawing:
    """The colors of the kinds that occur."""
    occurring = frozenset(kinds)
    return shelves([_chip(kind) for kind in Kind if kind in occurring], width, gap=16.0)


def _layout(figures: Sequence[Figure]) -> Layout:
    boxes = [figure.box for figure in figures]
    leaves = len(boxes) - len({box.parent for box in boxes} - {None})
    if any(figure.answer for figure in figures):
        # Links are long enough for the words on them.
        levels, lines = {"level_gap": 48.0}, {"indent": 72.0, "gap": 44.0}
    else:
        levels, lines = {}, {}
    if leaves <= _TOP_DOWN_LEAVES:
        layout = top_down(boxes, **levels)
        if layout.width <= _TOP_DOWN_WIDTH:
            return layout
    return outline(boxes, width=PAGE_WIDTH, **lines)


def _answer(word: str, link: tuple[Point, ...]) -> tuple[Panel, Text]:
    """The word, on white, at the last bend of a link from above or halfway from the left."""
    (x, y), (end_x, end_y) = link[-2:]
    if end_y == y:
        x = (x + end_x) / 2
    width, height = text_width(word, SMALL_SIZE) + 6, SMALL_SIZE + 4
    white = Panel(x - width / 2, y - height / 2, width, height, 0, 0, "#ffffff", "#ffffff")
    return white, Text(x, y + _MIDDLE * SMALL_SIZE, word, FADED, SMALL_SIZE, centered=True)


def _whole(points: Iterable[Point]) -> tuple[Point, ...]:
    """The points on whole pixels, so that lines on top of each other look like one."""
    return tuple((float(round(x)), float(round(y))) for x, y in points)


def _nodes(figure: Figure, corner: Point) -> Iterator[Node]:
    """Its cells side by side, rounded where they do not touch."""
    x, y = corner
    for cell in figure.cells:
        colors = PALETTE[cell.kind]
        radius = _HEIGHT / 2 if cell.kind in _PILLS else _RADIUS
        left = radius if cell is figure.cells[0] else 0.0
        right = radius if cell is figure.cells[-1] else 0.0
        panel = Panel(x, y, cell.width, figure.height, left, right, colors.fill, colors.line)
        yield Node(panel, tuple(_texts(cell, panel)), cell.kind.name.lower(), cell.tooltip)
        x += cell.width


def _texts(cell: Cell, panel: Panel) -> Iterator[Text]:
    color, middle = PALETTE[cell.kind].text, panel.x + panel.width / 2
    y = panel.y + (panel.height - (_DETAIL_HEIGHT if cell.detail else 0)) / 2 + _MIDDLE * SIZE
    yield Text(middle, y, cell.text, color, bold=cell.bold, centered=True)
    if cell.detail:
        yield Text(middle, y + _DETAIL_HEIGHT, cell.detail, color, SMALL_SIZE, centered=True)


def _chip(kind: Kind) -> Drawing:
    """An entry of the legend."""
    colors = PALETTE[kind]
    words = line_of_text(kind.value)
    panel = Panel(0, 0, _CHIP, _CHIP, 3, 3, colors.fill, colors.line)
    return Drawing((panel, *words.moved(_CHIP + 6, -1.5)), _CHIP + 6 + words.width, _CHIP)
