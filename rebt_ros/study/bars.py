"""Bar charts as SVG to stand in a page, which gives them their colors.

The page defines the CSS variables ``--ink``, ``--faded``, ``--grid`` and ``--series-1``,
``--series-2``, so that a chart can be read on a light and on a dark ground.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import escape

_WIDTH, _HEIGHT = 760.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 12.0, 46.0, 50.0
#: Of a group of bars, this share is left free between groups.
_GAP = 0.25
_MOST_TICKS, _MOST_LABELS = 6, 14


@dataclass(frozen=True, slots=True)
class Series:
    """Bars of one color."""

    name: str
    counts: tuple[int, ...]
    """For each group."""


@dataclass(frozen=True, slots=True)
class BarChart:
    """Groups of bars side by side."""

    title: str
    groups: tuple[str, ...]
    """A label for each group."""
    series: tuple[Series, ...]
    """One or two, each with a count for each group."""
    x_label: str
    y_label: str

    def __post_init__(self) -> None:
        if any(len(series.counts) != len(self.groups) for series in self.series):
            raise ValueError("each series needs a count for each group")


def histogram(
    values: Sequence[tuple[str, Sequence[float]]],
    group_of: Callable[[float], int],
    label_of: Callable[[int], str],
    *,
    title: str,
    x_label: str,
    y_label: str,
) -> BarChart:
    """Counts values by groups; between the first and the last group none is left out.

    Args:
        values: The values of each series, with its name.
        group_of: The group of a value.
        label_of: The label of a group.
        title: Of the chart.
        x_label: What the groups are.
        y_label: What is counted.
    """
    counted = [(name, Counter(map(group_of, each))) for name, each in values]
    found = [group for _, counts in counted for group in counts]
    groups = range(min(found), max(found) + 1) if found else range(0)
    return BarChart(
        title,
        tuple(map(label_of, groups)),
        tuple(Series(name, tuple(counts[group] for group in groups)) for name, counts in counted),
        x_label,
        y_label,
    )


def bar_chart_svg(chart: BarChart) -> str:
    """The chart; each bar says in a tooltip what it stands for."""
    most = max((count for series in chart.series for count in series.counts), default=0)
    step = _step(most)
    top = max(step, math.ceil(most / step) * step)
    body = "\n".join([*_axes(chart, step, top), *_bars(chart, top), *_legend(chart)])
    return (
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" '
        f'aria-label="{escape(chart.title)}" font-size="12">\n{body}\n</svg>'
    )


def _step(most: int) -> int:
    """Distance of the ticks: 1, 2 or 5 times a power of ten."""
    power = 1
    while True:
        for factor in (1, 2, 5):
            if most <= factor * power * _MOST_TICKS:
                return factor * power
        power *= 10


def _y(count: float, top: int) -> float:
    return _HEIGHT - _BOTTOM - count / top * (_HEIGHT - _TOP - _BOTTOM)


def _x(chart: BarChart, group: float) -> float:
    return _LEFT + group / max(len(chart.groups), 1) * (_WIDTH - _LEFT - _RIGHT)


def _axes(chart: BarChart, step: int, top: int) -> Iterator[str]:
    yield _text(_LEFT, 16, chart.title, "ink", extra='font-weight="600" font-size="14"')
    yield _text(_LEFT, 34, chart.y_label, "faded")
    for count in range(0, top + 1, step):
        y = _y(count, top)
        yield (
            f'<line x1="{_LEFT:g}" x2="{_WIDTH - _RIGHT:g}" y1="{y:.1f}" y2="{y:.1f}" '
            'style="stroke:var(--grid)"/>'
        )
        yield _text(_LEFT - 8, y + 4, str(count), "faded", extra='text-anchor="end"')
    every = math.ceil(len(chart.groups) / _MOST_LABELS)
    for place in range(0, len(chart.groups), max(every, 1)):
        x = _x(chart, place + 0.5)
        label = chart.groups[place]
        yield _text(x, _HEIGHT - _BOTTOM + 17, label, "faded", extra='text-anchor="middle"')
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    yield _text(middle, _HEIGHT - 10, chart.x_label, "ink", extra='text-anchor="middle"')


def _bars(chart: BarChart, top: int) -> Iterator[str]:
    width = (_x(chart, 1) - _x(chart, 0)) * (1 - _GAP) / len(chart.series)
    for number, series in enumerate(chart.series):
        for place, count in enumerate(series.counts):
            if not count:
                continue
            x = _x(chart, place + _GAP / 2) + number * width
            y = _y(count, top)
            tooltip = f"{chart.groups[place]}, {series.name}: {count}"
            yield (
                f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" '
                f'height="{_y(0, top) - y:.1f}" style="fill:var(--series-{number + 1})">'
                f"<title>{escape(tooltip)}</title></rect>"
            )


def _legend(chart: BarChart) -> Iterator[str]:
    x = _WIDTH - _RIGHT - 130.0 * len(chart.series)
    for number, series in enumerate(chart.series):
        yield (
            f'<rect x="{x:g}" y="24" width="11" height="11" '
            f'style="fill:var(--series-{number + 1})"/>'
        )
        yield _text(x + 16, 34, series.name, "ink")
        x += 130.0


def _text(x: float, y: float, text: str, color: str, extra: str = "") -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" style="fill:var(--{color})" {extra}>{escape(text)}</text>'
    )
