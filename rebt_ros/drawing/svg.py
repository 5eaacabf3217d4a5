"""Pictures as standalone SVG, in which a tooltip explains each node."""

from __future__ import annotations

import re
from xml.sax.saxutils import escape

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.drawing.shapes import LINE, SIZE, Line, Mark, Node, Page, Panel, Text
from rebt_ros.drawing.tree_picture import behavior_tree_page

_FONT = "system-ui,'Segoe UI',Roboto,Helvetica,Arial,'DejaVu Sans',sans-serif"
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def render_svg(learned: LearnedTree) -> str:
    """The behavior tree and its suggestions, with a title and a legend."""
    return svg(behavior_tree_page(learned))


def svg(page: Page) -> str:
    """The page as an SVG document."""
    width, height = f"{page.drawing.width:.0f}", f"{page.drawing.height:.0f}"
    marks = "\n".join(map(_mark, page.drawing.marks))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}"'
        f' viewBox="0 0 {width} {height}" role="img" font-family="{_FONT}"'
        f' font-size="{SIZE:g}">\n'
        f"<title>{_xml(page.title)}</title>\n"
        f'<rect width="100%" height="100%" fill="#ffffff"/>\n{marks}\n</svg>\n'
    )


def _mark(mark: Mark) -> str:
    match mark:
        case Text():
            return _text(mark)
        case Line(points=points):
            path = " ".join(f"{_number(x)},{_number(y)}" for x, y in points)
            return f'<polyline points="{path}" fill="none" stroke="{LINE}" stroke-width="2"/>'
        case Panel():
            return _panel(mark)
        case Node(panel=panel, texts=texts, kind=kind, tooltip=tooltip):
            return (
                f'<g class="node {kind}"><title>{_xml(tooltip)}</title>'
                f"{_panel(panel)}{''.join(map(_text, texts))}</g>"
            )


def _text(text: Text) -> str:
    size = f' font-size="{text.size:g}"' if text.size != SIZE else ""
    weight = ' font-weight="600"' if text.bold else ""
    anchor = ' text-anchor="middle"' if text.centered else ""
    return (
        f'<text x="{_number(text.x)}" y="{_number(text.y)}" fill="{text.color}"'
        f'{size}{weight}{anchor} xml:space="preserve">{_xml(text.text)}</text>'
    )


def _panel(panel: Panel) -> str:
    dashes = ' stroke-dasharray="6 4"' if panel.dashed else ""
    return f'<path d="{_outline(panel)}" fill="{panel.fill}" stroke="{panel.line}"{dashes}/>'


def _outline(panel: Panel) -> str:
    """Its edge: clockwise from the upper left corner's right end."""
    left, right, height = panel.left_radius, panel.right_radius, panel.height
    across = panel.width - left - right
    pieces = [f"M{_number(panel.x + left)} {_number(panel.y)}h{_number(across)}"]
    pieces += [_arc(right, 1, 1), f"v{_number(height - 2 * right)}", _arc(right, -1, 1)]
    pieces += [f"h{_number(-across)}"]
    pieces += [_arc(left, -1, -1), f"v{_number(2 * left - height)}", _arc(left, 1, -1)]
    return "".join(pieces) + "z"


def _arc(radius: float, x: int, y: int) -> str:
    """A quarter of a circle, to the right if x is 1 and down if y is 1; nothing without radius."""
    if not radius:
        return ""
    size = _number(radius)
    return f"a{size} {size} 0 0 1 {_number(x * radius)} {_number(y * radius)}"


def _number(value: float) -> str:
    """A length to a tenth of a pixel."""
    return f"{value:.1f}".removesuffix(".0")


def _xml(text: str) -> str:
    """Text as it stands between tags; what XML cannot hold is left out."""
    return escape(_NOT_XML.sub("", text))
