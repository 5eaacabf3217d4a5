"""Agreement over ``ccp_alpha``: what pruning costs, and why a level was chosen."""

from __future__ import annotations

import io
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from rebt_ros.arrays import FloatArray, IntArray
from rebt_ros.behavior_tree.wording import Kind
from rebt_ros.drawing.node_figures import PALETTE
from rebt_ros.drawing.png import matplotlib_defaults
from rebt_ros.drawing.shapes import FADED, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = (8.6, 5.0)
"""Width and height in inches."""
_DOTS_PER_INCH = 160
_AGREEMENT, _LEAVES = PALETTE[Kind.ACTION].fill, "#b9c4cf"
_CHOSEN, _BEST = PALETTE[Kind.LAT_SEQUENCE].fill, PALETTE[Kind.CONTROL].fill
#: Of more levels the points would hide the line.
_MOST_POINTS = 60
#: Where leaves differ more than so many times, their axis is logarithmic.
_WIDE_RANGE = 50


class PlotFormat(Enum):
    """What the plot is written as."""

    PNG = "png"
    SVG = "svg"


@dataclass(frozen=True, eq=False, slots=True)
class AccuracyCurve:
    """Pruning levels in cross-validation; all arrays have shape (levels,)."""

    ccp_alphas: FloatArray
    """Ascending, at least one."""
    means: FloatArray
    """Mean agreement of the folds, from 0 to 1."""
    standard_errors: FloatArray
    """Of each mean."""
    leaves: IntArray
    """Leaves of the decision tree."""
    chosen: float
    """The ``ccp_alpha`` that was chosen, which need not be one of the levels'."""

    @property
    def best(self) -> int:
        """The level with the highest mean."""
        return int(np.argmax(self.means))


def render_accuracy_plot(curve: AccuracyCurve, form: PlotFormat) -> bytes:
    """Mean agreement, plus and minus a standard error, with the leaves on a second axis.

    Raises:
        MatplotlibMissingError: There is no matplotlib.
    """
    with matplotlib_defaults():
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        # With a salt and without a date, equal curves make equal files.
        with matplotlib.rc_context({"svg.hashsalt": "rebt_ros", "font.size": 10.0}):
            figure = Figure(_SIZE, dpi=_DOTS_PER_INCH, facecolor="#ffffff", layout="constrained")
            FigureCanvasAgg(figure)
            axes = figure.add_subplot()
            _draw_leaves(axes.twinx(), curve)
            _draw_agreement(axes, curve)
            _draw_choice(axes, curve)
            _label(axes, curve)
            file = io.BytesIO()
            metadata = {"Date": None} if form is PlotFormat.SVG else {}
            figure.savefig(file, format=form.value, metadata=metadata)
    return file.getvalue()


def _draw_leaves(axes: Axes, curve: AccuracyCurve) -> None:
    x, leaves = _steps(curve, curve.leaves.astype(float))
    axes.fill_between(x, leaves, color=_LEAVES, alpha=0.3, linewidth=0, step="post")
    axes.plot(x, leaves, color=_LEAVES, linewidth=1.2, drawstyle="steps-post")
    axes.set_ylabel("leaves of the decision tree", color=FADED)
    if curve.leaves.max() > _WIDE_RANGE * curve.leaves.min():
        axes.set_yscale("log")
        axes.set_ylim(0.8, curve.leaves.max() * 1.6)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    else:
        axes.set_ylim(0, curve.leaves.max() * 1.15 + 1)
    axes.tick_params(axis="y", colors=FADED, length=0)
    _bare(axes)


def _draw_agreement(axes: Axes, curve: AccuracyCurve) -> None:
    # Above the leaves, which a twin would otherwise hide it under.
    axes.set_zorder(2)
    axes.patch.set_visible(False)
    x, means = _steps(curve, curve.means)
    _, errors = _steps(curve, curve.standard_errors)
    axes.fill_between(
        x, means - errors, means + errors, color=_AGREEMENT, alpha=0.18, linewidth=0, step="post"
    )
    label = "agreement, mean ± standard error of the folds"
    axes.plot(x, means, color=_AGREEMENT, linewidth=2, drawstyle="steps-post", label=label)
    if len(curve.means) <= _MOST_POINTS:
        axes.plot(curve.ccp_alphas, curve.means, "o", color=_AGREEMENT, markersize=3.5)


def _draw_choice(axes: Axes, curve: AccuracyCurve) -> None:
    best = curve.best
    enough = float(curve.means[best] - curve.standard_errors[best])
    axes.axhline(
        enough, color=_BEST, linewidth=1, linestyle=(0, (2, 3)), label="best - 1 standard error"
    )
    axes.plot(
        curve.ccp_alphas[best],
        curve.means[best],
        "o",
        markersize=10,
        markerfacecolor="#ffffff",
        markeredgecolor=_BEST,
        markeredgewidth=2,
        linestyle="none",
        clip_on=False,
        zorder=5,
        label=f"best: {_of(curve, best)}",
    )
    # A level stands for all alphas up to the next one.
    level = max(0, int(np.searchsorted(curve.ccp_alphas, curve.chosen, side="right")) - 1)
    axes.axvline(curve.chosen, color=_CHOSEN, linewidth=1.2, linestyle=(0, (5, 3)))
    axes.plot(
        curve.chosen,
        curve.means[level],
        "D",
        markersize=6.5,
        color=_CHOSEN,
        linestyle="none",
        clip_on=False,
        zorder=6,
        label=f"chosen: {_of(curve, level)}",
    )


def _label(axes: Axes, curve: AccuracyCurve) -> None:
    axes.set_xlabel("ccp_alpha: larger values prune more", color=INK)
    axes.set_ylabel("agreement in cross-validation", color=INK)
    axes.set_title("Agreement over ccp_alpha", loc="left", color=INK, fontweight="bold", pad=14)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value * 100:.4g}%")
    positive = curve.ccp_alphas[curve.ccp_alphas > 0]
    if len(positive):
        # Linear from 0 to the first level, logarithmic from there on.
        axes.set_xscale("symlog", linthresh=float(positive[0]), linscale=0.4)
        axes.set_xlim(0, _end(curve))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        _thin_ticks(axes)
    axes.grid(visible=True, axis="y", color="#e3e8ed", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=3)
    axes.minorticks_off()
    _bare(axes)
    axes.legend(
        loc="lower left", frameon=True, facecolor="#ffffff", edgecolor="none", framealpha=0.9
    )


def _thin_ticks(axes: Axes) -> None:
    """Leaves out ticks too close to 0 to be told apart from it."""
    low, high = axes.get_xlim()
    place = axes.transData.transform
    width = place((high, 0))[0] - place((low, 0))[0]
    ticks = [xtick for xtick in axes.get_xticks() if low <= xtick <= high]
    apart = [
        tick for tick in ticks if tick == 0 or place((tick, 0))[0] - place((low, 0))[0] > width / 20
    ]
    axes.set_xticks(apart)


def _of(curve: AccuracyCurve, level: int) -> str:
    leaves = int(curve.leaves[level])
    return f"{curve.means[level]:.1%} with {leaves} {'leaf' if leaves == 1 else 'leaves'}"


def _steps(curve: AccuracyCurve, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points of a stairway whose last step can be seen."""
    return np.append(curve.ccp_alphas, _end(curve)), np.append(values, values[-1])


def _end(curve: AccuracyCurve) -> float:
    return max(float(curve.ccp_alphas[-1]), curve.chosen) * 1.6 or 1.0


def _bare(axes: Axes) -> None:
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color("#9aa8b6")
