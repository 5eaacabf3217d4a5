"""The behavior tree as a standalone SVG picture.

Boxes are coloured by kind, every text has a contrast of at least 4.5 (WCAG 2 AA) to its box, and a
tooltip explains each node with every digit of its threshold.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.layout import Box, Layout, outline, top_down
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.wording import Kind, Wording, heading, offered, summary


@dataclass(frozen=True, slots=True)
class Colors:
    """Colours of a kind of node, as #rrggbb."""

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

_FONT = "system-ui,'Segoe UI',Roboto,Helvetica,Arial,'DejaVu Sans',sans-serif"
_INK, _FADED, _LINE, _FRAME = "#16283a", "#51606f", "#9aa8b6", "#8aa2bb"
_SIZE, _TITLE_SIZE = 13.0, 19.0
_HEIGHT, _PADDING, _MARGIN = 30.0, 10.0, 24.0
_FRAME_PADDING, _FRAME_GAP = 16.0, 18.0
#: Larger trees are drawn as an outline.
_TOP_DOWN_LEAVES, _TOP_DOWN_WIDTH = 25, 1500.0
_PAGE_WIDTH = 1120.0

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

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True)
class _Cell:
    """A node as it is drawn."""

    text: str
    kind: Kind
    tooltip: str

    @property
    def width(self) -> float:
        bold = 1 if self.kind is Kind.CONDITION else _BOLD_WIDTH
        return _text_width(self.text, _SIZE) * bold + 2 * _PADDING


@dataclass(frozen=True, slots=True)
class _Figure:
    """A box of the drawing: one node, or an Inverter with the condition that it inverts."""

    cells: tuple[_Cell, ...]
    parent: int | None

    @property
    def box(self) -> Box:
        return Box(sum(cell.width for cell in self.cells), _HEIGHT, self.parent)


@dataclass(frozen=True, slots=True)
class _Drawing:
    """A piece of SVG and the room that it takes."""

    svg: str
    width: float
    height: float


def render_svg(learned: LearnedTree) -> str:
    """The main tree and each suggestion that is not attached, with a title and a legend.

    Trees that are neither large nor wide are drawn from the top down; others as an outline, in
    which leaves follow their parent to the right and other children stand indented below it.
    """
    wording = Wording(learned)
    main = _tree(learned.tree, wording)
    suggestions = [
        _framed(_tree(suggestion.subtree, wording), heading(suggestion))
        for suggestion in offered(learned)
    ]
    shown = [learned.tree, *(suggestion.subtree for suggestion in offered(learned))]
    kinds = {wording.kind(node) for tree in shown for node in nodes.walk(tree)}
    width = max(main.width, _PAGE_WIDTH)
    parts = [
        _title("Behavior tree", summary(learned)),
        _shelves([_chip(kind) for kind in Kind if kind in kinds], width, gap=16.0),
        main,
    ]
    if suggestions:
        parts.append(_shelves(suggestions, width, gap=_FRAME_GAP))
    return _page(parts, title=f"Behavior tree: {summary(learned)}")


def _tree(tree: nodes.Node, wording: Wording) -> _Drawing:
    figures = _figures(tree, wording)
    boxes = [figure.box for figure in figures]
    layout = _layout(boxes)
    pieces = [_link(link) for link in layout.links]
    for corner, figure in zip(layout.corners, figures, strict=True):
        pieces += _figure(figure, corner)
    return _Drawing("".join(pieces), layout.width, layout.height)


def _layout(boxes: Sequence[Box]) -> Layout:
    leaves = len(boxes) - len({box.parent for box in boxes} - {None})
    if leaves <= _TOP_DOWN_LEAVES:
        layout = top_down(boxes)
        if layout.width <= _TOP_DOWN_WIDTH:
            return layout
    return outline(boxes, width=_PAGE_WIDTH)


def _figures(tree: nodes.Node, wording: Wording) -> list[_Figure]:
    figures: list[_Figure] = []
    waiting: list[tuple[nodes.Node, int | None]] = [(tree, None)]
    while waiting:
        node, parent = waiting.pop()
        drawn: list[nodes.Node] = [node]
        children = nodes.children(node)
        match node:
            case nodes.Inverter(child=nodes.Condition() as condition):
                drawn.append(condition)
                children = ()
        waiting.extend((child, len(figures)) for child in reversed(children))
        cells = (
            _Cell(_label(one, wording), wording.kind(one), wording.explanation(one))
            for one in drawn
        )
        figures.append(_Figure(tuple(cells), parent))
    return figures


def _label(node: nodes.Node, wording: Wording) -> str:
    """The words, and for control nodes the usual symbol before them; * means with memory."""
    match node:
        case nodes.Sequence(memory=memory):
            symbol = "→* " if memory else "→ "
        case nodes.Selector(memory=memory):
            symbol = "?* " if memory else "? "
        case nodes.Parallel():
            symbol = "⇉ "
        case nodes.Repeater():
            symbol = "↻ "
        case _:
            symbol = ""
    return symbol + wording.node(node)


def _page(parts: Iterable[_Drawing], title: str) -> str:
    pieces, width, y = [], 0.0, _MARGIN
    for part in parts:
        pieces.append(f'<g transform="translate({_MARGIN:g} {y:.1f})">{part.svg}</g>\n')
        width = max(width, part.width)
        y += part.height + _FRAME_GAP
    width, height = width + 2 * _MARGIN, y - _FRAME_GAP + _MARGIN
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}"'
        f' viewBox="0 0 {width:.0f} {height:.0f}" role="img" font-family="{_FONT}"'
        f' font-size="{_SIZE:g}">\n'
        f"<title>{_xml(title)}</title>\n"
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{"".join(pieces)}</svg>\n'
    )


def _title(title: str, subtitle: str) -> _Drawing:
    upper = _line(title, _TITLE_SIZE, _INK, bold=True)
    lower = _line(subtitle, _SIZE, _FADED)
    top = upper.height + 4
    svg = f'{upper.svg}<g transform="translate(0 {top:g})">{lower.svg}</g>'
    return _Drawing(svg, max(upper.width, lower.width), top + lower.height)


def _line(text: str, size: float, color: str, *, bold: bool = False) -> _Drawing:
    """A line of text."""
    weight = ' font-weight="bold"' if bold else ""
    svg = (
        f'<text y="{size:g}" font-size="{size:g}" fill="{color}"{weight}'
        f' xml:space="preserve">{_xml(text)}</text>'
    )
    width = _text_width(text, size) * (_BOLD_WIDTH if bold else 1)
    return _Drawing(svg, width, size + 4)


def _chip(kind: Kind) -> _Drawing:
    """An entry of the legend."""
    colors, side = PALETTE[kind], 14.0
    svg = (
        f'<rect width="{side:g}" height="{side:g}" rx="3" fill="{colors.fill}"'
        f' stroke="{colors.line}"/>'
        f'<text x="{side + 6:g}" y="11.5" fill="{_INK}">{_xml(kind.value)}</text>'
    )
    return _Drawing(svg, side + 6 + _text_width(kind.value, _SIZE), side)


def _framed(drawing: _Drawing, text: str) -> _Drawing:
    """The drawing in a dashed frame, under a heading."""
    caption = _line(text, _SIZE, _INK, bold=True)
    width = max(drawing.width, caption.width) + 2 * _FRAME_PADDING
    top = _FRAME_PADDING + caption.height + 8
    height = top + drawing.height + _FRAME_PADDING
    svg = (
        f'<rect width="{width:.1f}" height="{height:.1f}" rx="10" fill="#fbfcfd"'
        f' stroke="{_FRAME}" stroke-dasharray="6 4"/>'
        f'<g transform="translate({_FRAME_PADDING:g} {_FRAME_PADDING:g})">{caption.svg}</g>'
        f'<g transform="translate({_FRAME_PADDING:g} {top:g})">{drawing.svg}</g>'
    )
    return _Drawing(svg, width, height)


def _shelves(drawings: Sequence[_Drawing], width: float, gap: float) -> _Drawing:
    """Drawings side by side, on as many shelves as they need."""
    pieces, x, y, shelf, widest = [], 0.0, 0.0, 0.0, 0.0
    for drawing in drawings:
        if x and x + drawing.width > width:
            x, y, shelf = 0.0, y + shelf + gap, 0.0
        pieces.append(f'<g transform="translate({x:.1f} {y:.1f})">{drawing.svg}</g>')
        widest = max(widest, x + drawing.width)
        x, shelf = x + drawing.width + gap, max(shelf, drawing.height)
    return _Drawing("".join(pieces), widest, y + shelf)


def _link(points: Sequence[tuple[float, float]]) -> str:
    """A line, on whole pixels so that lines on top of each other look like one."""
    path = " ".join(f"{x:.0f},{y:.0f}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{_LINE}" stroke-width="2"/>\n'


def _figure(figure: _Figure, corner: tuple[float, float]) -> Iterator[str]:
    """Its cells side by side, rounded where they do not touch."""
    x, y = corner
    for cell in figure.cells:
        # Conditions and what inverts them are pills, all others are boxes with round corners.
        radius = _HEIGHT / 2 if cell.kind in (Kind.CONDITION, Kind.INVERTER) else 6.0
        left = radius if cell is figure.cells[0] else 0.0
        right = radius if cell is figure.cells[-1] else 0.0
        yield _cell(cell, x, y, _outline_path(x, y, cell.width, left, right))
        x += cell.width


def _cell(cell: _Cell, x: float, y: float, path: str) -> str:
    colors = PALETTE[cell.kind]
    weight = ' font-weight="600"' if cell.kind is not Kind.CONDITION else ""
    return (
        f'<g class="node {cell.kind.name.lower()}"><title>{_xml(cell.tooltip)}</title>'
        f'<path d="{path}" fill="{colors.fill}" stroke="{colors.line}"/>'
        f'<text x="{x + cell.width / 2:.1f}" y="{y + _HEIGHT / 2 + 0.35 * _SIZE:.1f}"'
        f' text-anchor="middle" fill="{colors.text}"{weight} xml:space="preserve">'
        f"{_xml(cell.text)}</text></g>\n"
    )


def _outline_path(x: float, y: float, width: float, left: float, right: float) -> str:
    """A rectangle with the given corner radii on its left and right side."""
    return (
        f"M{x + left:.1f} {y:.1f}h{width - left - right:.1f}"
        f"a{right:g} {right:g} 0 0 1 {right:g} {right:g}v{_HEIGHT - 2 * right:g}"
        f"a{right:g} {right:g} 0 0 1 {-right:g} {right:g}h{left + right - width:.1f}"
        f"a{left:g} {left:g} 0 0 1 {-left:g} {-left:g}v{2 * left - _HEIGHT:g}"
        f"a{left:g} {left:g} 0 0 1 {left:g} {-left:g}z"
    )


def _text_width(text: str, size: float) -> float:
    """Estimated width of a line in pixels."""
    return size * sum(map(_character_width, text))


def _character_width(character: str) -> float:
    if unicodedata.combining(character):
        return 0.0
    if unicodedata.east_asian_width(character) in "WF":
        return _DOUBLE_WIDTH
    return _WIDTHS.get(character, _USUAL_WIDTH)


def _xml(text: str) -> str:
    """Text as it stands between tags; what XML cannot hold is left out."""
    return escape(_NOT_XML.sub("", text))
