"""The report as one page that needs nothing else, in the colors of the reader's screen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rebt_ros.drawing.html import page, paragraph, table
from rebt_ros.study.bars import BarChart, bar_chart_svg, histogram
from rebt_ros.study.figures import Difference, Loss, differences, reductions
from rebt_ros.study.mode import Mode
from rebt_ros.study.provenance import provenance
from rebt_ros.study.report import ExperimentReport, rows_of_table

#: Width of a group in the plot of reductions, in per cent.
_REDUCTION_STEP = 5


def report_page(report: ExperimentReport) -> str:
    """The page as HTML; everything that was read is escaped."""
    body = "\n".join(
        [*_summary(report), *_plots(report), *_losses(report), *_lost(report), *_method(report)]
    )
    return page("RE:BT-Espresso: experiment", body)


def _summary(report: ExperimentReport) -> Iterator[str]:
    rows = sum(result.rows for result in report.results)
    levels = sum(result.levels for result in report.results)
    yield "<h1>RE:BT-Espresso: simulated trees, learned back</h1>"
    yield paragraph(
        f"{len(report.results)} of {len(report.results) + len(report.lost)} configurations, "
        f"{report.settings.ticks} ticks each, seed {report.settings.seed}: {rows} rows, "
        f"{levels} pruning levels, {report.measured.compared} pairs of subtrees compared."
    )
    yield table(rows_of_table(report))
    yield paragraph(
        "Distances are graph edit distances: an upper bound, the same measure for all modes. A win "
        "is a simulated subtree to which the mode comes nearer than BT-Espresso (baseline). A "
        "minimum over many subtrees flatters, so compare figures with what was offered per level.",
        faded=True,
    )


def _plots(report: ExperimentReport) -> Iterator[str]:
    ours = (Mode.PAPER, Mode.DEFAULT)
    yield "<h2>Distance saved against BT-Espresso (as Fig. 4 of the paper)</h2>"
    for mode in ours:
        apart = differences(report.results, mode)
        yield bar_chart_svg(_difference_chart(mode, apart))
        zeros = [sum(not value for value in values) for _, values in _statistics(apart)]
        yield paragraph(
            f"Right of 0 {mode.value} mode is nearer. Differences of zero are left out: "
            f"{zeros[0]} of the minimum, {zeros[1]} of the median.",
            faded=True,
        )
    yield "<h2>Nodes saved against BT-Espresso (as Fig. 5 of the paper)</h2>"
    saved = [(mode, reductions(report.results, mode)) for mode in ours]
    yield bar_chart_svg(
        histogram(
            [(f"{mode.value} mode", [one for one in values if one]) for mode, values in saved],
            lambda value: math.floor(value / _REDUCTION_STEP),
            lambda group: f"{group * _REDUCTION_STEP}..{(group + 1) * _REDUCTION_STEP}",
            title="Relative reduction of nodes, without SAES",
            x_label="per cent of the nodes of BT-Espresso's tree that are gone",
            y_label="trees",
        )
    )
    unchanged = " and ".join(
        f"{sum(not value for value in values)} in {mode.value} mode" for mode, values in saved
    )
    yield paragraph(f"Trees without a difference are left out: {unchanged}.", faded=True)


def _difference_chart(mode: Mode, apart: Sequence[Difference]) -> BarChart:
    return histogram(
        [(name, [value for value in values if value]) for name, values in _statistics(apart)],
        # Halves, which medians have, go to the next whole number away from zero.
        lambda value: math.ceil(value) if value > 0 else math.floor(value),
        lambda group: f"{group:+d}" if group else "0",
        title=f"{mode.value} mode",
        x_label="distance of BT-Espresso minus distance of the mode",
        y_label="simulated subtrees",
    )


def _statistics(apart: Sequence[Difference]) -> list[tuple[str, list[float]]]:
    return [
        ("minimum", [one.minimum for one in apart]),
        ("median", [one.median for one in apart]),
    ]


def _losses(report: ExperimentReport) -> Iterator[str]:
    yield "<h2>Losses</h2>"
    listed = [(mode, loss) for mode, figures in report.figures.items() for loss in figures.losses]
    if not listed:
        yield paragraph("There are none: nowhere does BT-Espresso come nearer.")
        return
    heading = ("mode", "configuration", "subtree", "of", "distance", "BT-Espresso's", *_WORDS)
    yield table([heading, *(_loss_row(mode, loss) for mode, loss in listed)], words=3)


_WORDS = ("simulated", "found", "found by BT-Espresso")


def _loss_row(mode: Mode, loss: Loss) -> tuple[str, ...]:
    return (
        mode.value,
        loss.configuration,
        str(loss.subtree),
        loss.statistic,
        f"{loss.distance:g}",
        f"{loss.baseline:g}",
        loss.shown,
        loss.found,
        loss.baseline_found,
    )


def _lost(report: ExperimentReport) -> Iterator[str]:
    yield "<h2>Lost configurations</h2>"
    if not report.lost:
        yield paragraph("There are none.")
        return
    yield table(
        [("configuration", "reason"), *((one.configuration, one.reason) for one in report.lost)],
        words=1,
    )


def _method(report: ExperimentReport) -> Iterator[str]:
    found = report.measured
    yield "<h2>Measure, settings, versions</h2>"
    yield paragraph(
        f"{found.measured} different pairs were measured; {found.excluded} of the "
        f"{found.compared} pairs compared were excluded by their labels alone. "
        f"{found.exact_minima.count} of {found.exact_minima.total} minima, and "
        f"{found.exact_levels.count} of {found.exact_levels.total} scores of single levels, are "
        "known to be the exact graph edit distance."
    )
    if found.networkx_tried:
        finished = found.at_most_networkx
        yield paragraph(
            f"networkx's heuristic, the paper's measure, was tried on {found.networkx_tried} pairs "
            f"drawn at random and took longer than {report.settings.pair_seconds:g} s for "
            f"{found.networkx_missed}. Of the other {finished.total}, {finished.count} are at most "
            "as far apart by the measure of record."
        )
    known = provenance(report.settings)
    rows = [(name, str(value)) for part in known.values() for name, value in part.items()]
    yield table([("setting or package", "value"), *rows])
