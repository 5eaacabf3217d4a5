"""Any page as a PNG file, drawn by matplotlib with the font that comes with it.

This needs no display, browser or system package.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rebt_ros.drawing.errors import MatplotlibMissingError, PictureTooLargeError
from rebt_ros.drawing.shapes import LINE, Drawing, Line, Mark, Node, Page, Panel, Text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path as Curve

#: Pixels of the file per pixel of the page: twice as many look sharp on today's screens.
_SCALE = 2.0
#: Scaled down further, letters could not be read.
_LEAST_SCALE = 0.75
#: Of one file, and of one side of it.
_MOST_PIXELS, _LONGEST_SIDE = 20e6, 16_000
_FONT = "DejaVu Sans"
_POINTS_PER_INCH = 72.0
#: How far the control points of a quarter circle lie from its ends, in radii.
_ARC = 0.5523
_CONTROL = re.compile("[\x00-\x1f\x7f\ud800-\udfff\ufffe\uffff]")


def render_page_png(page: Page) -> bytes:
    """The page as a PNG file.

    Raises:
        MatplotlibMissingError: There is no matplotlib.
        PictureTooLargeError: The file would be huge or could not be read.
    """
    scale = _scale(page.drawing)
    with matplotlib_defaults():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # A page's pixel is a point, so that sizes of texts are the page's.
        figure = Figure(
            (page.drawing.width / _POINTS_PER_INCH, page.drawing.height / _POINTS_PER_INCH),
            dpi=_POINTS_PER_INCH * scale,
            facecolor="#ffffff",
        )
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0, page.drawing.width)
        axes.set_ylim(page.drawing.height, 0)
        for depth, mark in enumerate(page.drawing.marks):
            _draw(axes, mark, depth)
        file = io.BytesIO()
        # Drawings are compressed well without much effort.
        quick = {"compress_level": 2}
        figure.savefig(file, format="png", dpi="figure", pil_kwargs=quick)
    return file.getvalue()


@contextmanager
def matplotlib_defaults() -> Iterator[None]:
    """Matplotlib as it is without settings of the user, and without a word about missing letters.

    Raises:
        MatplotlibMissingError: There is no matplotlib.
    """
    try:
        # Not only where it is missing: one that was compiled for another numpy fails as well.
        import matplotlib.backends.backend_agg
        import matplotlib.style
    except (ImportError, AttributeError) as err:
        raise MatplotlibMissingError(
            "matplotlib is not installed or does not work, so no PNG files were made: "
            "'pip install matplotlib' or 'apt install python3-matplotlib' gets it."
        ) from err
    with warnings.catch_warnings(), matplotlib.style.context("default", after_reset=True):
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from")
        warnings.filterwarnings("ignore", message=r"Matplotlib currently does not support")
        yield


def _scale(drawing: Drawing) -> float:
    scale = min(
        _SCALE,
        math.sqrt(_MOST_PIXELS / (drawing.width * drawing.height)),
        _LONGEST_SIDE / max(drawing.width, drawing.height),
    )
    if scale < _LEAST_SCALE:
        raise PictureTooLargeError(
            "a picture too large for a PNG file was not made as one: look at the SVG file."
        )
    return scale


def _draw(axes: Axes, mark: Mark, depth: int) -> None:
    match mark:
        case Text():
            _draw_text(axes, mark, depth)
        case Line(points=points):
            from matplotlib.lines import Line2D

            xs, ys = zip(*points, strict=True)
            line = Line2D(xs, ys, linewidth=2.0, color=LINE, solid_capstyle="butt", zorder=depth)
            axes.add_artist(line)
        case Panel():
            _draw_panel(axes, mark, depth)
        case Node(panel=panel, texts=texts):
            _draw_panel(axes, panel, depth)
            for text in texts:
                _draw_text(axes, text, depth)


def _draw_text(axes: Axes, text: Text, depth: int) -> None:
    axes.text(
        text.x,
        text.y,
        _CONTROL.sub("", text.text),
        color=text.color,
        fontsize=text.size,
        fontweight="bold" if text.bold else "normal",
        fontfamily=_FONT,
        horizontalalignment="center" if text.centered else "left",
        verticalalignment="baseline",
        parse_math=False,
        # After the panel that it stands on, before the next mark.
        zorder=depth + 0.5,
    )


def _draw_panel(axes: Axes, panel: Panel, depth: int) -> None:
    from matplotlib.patches import PathPatch

    axes.add_artist(
        PathPatch(
            _outline(panel),
            facecolor=panel.fill,
            edgecolor=panel.line,
            linewidth=1.0,
            linestyle=(0, (6, 4)) if panel.dashed else "solid",
            zorder=depth,
        )
    )


def _outline(panel: Panel) -> Curve:
    """Its edge: clockwise from the upper left corner's right end."""
    from matplotlib.path import Path as Curve

    left, top, right, bottom = panel.x, panel.y, panel.x + panel.width, panel.y + panel.height
    corners = (
        ((right, top), panel.right_radius, (-1, 0), (0, 1)),
        ((right, bottom), panel.right_radius, (0, -1), (-1, 0)),
        ((left, bottom), panel.left_radius, (1, 0), (0, -1)),
        ((left, top), panel.left_radius, (0, 1), (1, 0)),
    )
    points = [(left + panel.left_radius, top)]
    codes = [int(Curve.MOVETO)]
    for (x, y), radius, (from_x, from_y), (to_x, to_y) in corners:
        near = radius * (1 - _ARC)
        points += [
            (x + radius * from_x, y + radius * from_y),
            (x + near * from_x, y + near * from_y),
            (x + near * to_x, y + near * to_y),
            (x + radius * to_x, y + radius * to_y),
        ]
        codes += [int(Curve.LINETO), *[int(Curve.CURVE4)] * 3]
    return Curve([*points, points[0]], [*codes, int(Curve.CLOSEPOLY)])
