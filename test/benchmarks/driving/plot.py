"""Success over demonstrations, a panel for each task, as SVG."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from driving.results import Entry, entries, grouped
from rebt_ros.drawing.png import matplotlib_defaults

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from driving.report import Measured

_COLUMNS = 4
#: Of a panel, in inches.
_WIDTH, _HEIGHT = 2.9, 2.2
_INK, _GRID = "#33414e", "#e3e8ed"
#: Colour, dashes and width of each line, the one on top last; other methods are left out.
_LINES = {
    "bt-espresso": ("#9aa8b6", "-", 1.4),
    "paper": ("#9aa8b6", ":", 1.6),
    "forest": ("#7a5195", (0, (1, 1)), 1.2),
    "forest+history": ("#7a5195", "-", 1.2),
    "depth5": ("#2a8f8a", (0, (4, 2)), 1.4),
    "depth5+history": ("#2a8f8a", "-", 1.4),
    "tree": ("#3b6fb6", (0, (4, 2)), 1.4),
    "tree+history": ("#3b6fb6", "-", 1.4),
    "default": ("#d1495b", "-", 2.6),
}


def render(measured: Measured) -> bytes:
    """The plot as an SVG file.

    Raises:
        MatplotlibMissingError: There is no matplotlib.
    """
    with matplotlib_defaults():
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # Text stays text; with a salt and without a date, equal results make equal files.
        with matplotlib.rc_context(
            {"svg.hashsalt": "rebt_ros", "svg.fonttype": "none", "font.size": 9.0}
        ):
            tasks = measured.tasks
            columns = min(_COLUMNS, len(tasks))
            rows = math.ceil(len(tasks) / columns)
            size = _WIDTH * columns, _HEIGHT * rows + 0.9
            figure = Figure(size, facecolor="#ffffff", layout="constrained")
            FigureCanvasAgg(figure)
            panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
            by_task = grouped(entries(measured.learned), lambda one: one.task)
            for axes, task in zip(panels, tasks, strict=False):
                title = f"{task} (memory)" if task in measured.memory else task
                _draw(axes, title, by_task[task], measured.experts[task])
            for axes in panels[len(tasks) :]:
                axes.set_axis_off()
            figure.supxlabel("demonstrations", color=_INK)
            figure.supylabel("success in fresh episodes (%)", color=_INK)
            lines, names = panels[0].get_legend_handles_labels()
            figure.legend(
                lines[::-1], names[::-1], loc="outside upper center", ncols=5, frameon=False
            )
            file = io.BytesIO()
            figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


def _draw(axes: Axes, title: str, its: Sequence[Entry], expert: float) -> None:
    by_method = grouped(its, lambda one: one.method)
    for method, (color, dashes, width) in _LINES.items():
        line = sorted(by_method.get(method, ()), key=lambda one: one.n)
        if not line:
            continue
        counts = [one.n for one in line]
        means = [100 * one.success.value for one in line]
        axes.plot(counts, means, color=color, linestyle=dashes, linewidth=width, label=method)
        if method == "default":
            errors = [100 * (one.success.error or 0.0) for one in line]
            low = [mean - error for mean, error in zip(means, errors, strict=True)]
            high = [mean + error for mean, error in zip(means, errors, strict=True)]
            axes.fill_between(counts, low, high, color=color, alpha=0.15, linewidth=0)
    axes.axhline(100 * expert, color=_INK, linewidth=0.8, linestyle=(0, (1, 3)))
    counts = sorted({one.n for one in its})
    axes.set_xscale("log", base=2)
    axes.set_xticks(counts, [str(n) for n in counts])
    axes.minorticks_off()
    axes.set_ylim(-4, 104)
    axes.set_title(title, loc="left", color=_INK, fontweight="bold", fontsize=9.5)
    axes.grid(visible=True, color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_INK, length=2)
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)
