"""Results as tables for a person, in Markdown, and as a list for programs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from scipy.stats import spearmanr

from driving.corrections import Course, Mode
from driving.methods import DEFAULT
from driving.results import (
    ENOUGH,
    EXPERT,
    Entry,
    Key,
    Mean,
    Result,
    compare,
    entries,
    grouped,
    growth,
    needed,
)

#: Plain trees that rule and mean of the default are measured by.
_WITH_HISTORY = ("tree+history", "depth5+history")
_UNPRUNED = "tree"
#: Corrections after which success is compared.
_CORRECTIONS = (1, 2, 4, 8)


@dataclass(frozen=True, slots=True)
class Measured:
    """All results of a run."""

    results: tuple[Result, ...]
    memory: frozenset[str]
    """Tasks that need it."""
    late: int = 0
    """Steps by which demonstrators were late."""

    @property
    def experts(self) -> dict[str, float]:
        """Success of each task's expert."""
        return {one.cell.task: one.success for one in self.results if one.cell.method == EXPERT}

    @property
    def learned(self) -> tuple[Result, ...]:
        """Results of methods."""
        return tuple(one for one in self.results if one.cell.method != EXPERT)

    @property
    def methods(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(one.cell.method for one in self.learned))

    @property
    def tasks(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(one.cell.task for one in self.learned))


def report(measured: Measured) -> str:
    """All tables of a run."""
    parts = [_overall(measured), _by_count(measured), _needed(measured), _by_task(measured)]
    if DEFAULT in measured.methods:
        parts += [_ahead_by_count(measured), _against_trees(measured), _growth(measured)]
        parts += [_forecast(measured), _lateness(measured)]
    parts += [_refusals(measured)]
    parts += [_of_task(measured, task) for task in measured.tasks]
    return "\n\n".join(filter(None, parts)) + "\n"


def _overall(measured: Measured) -> str:
    groups: list[tuple[str, Callable[[str], bool]]] = [("all tasks", lambda task: True)]
    if 0 < len(measured.memory & {*measured.tasks}) < len(measured.tasks):
        groups += [
            ("without memory", lambda task: task not in measured.memory),
            ("memory", lambda task: task in measured.memory),
        ]
    head = ["method", *(name for name, _ in groups)]
    head += [f"{DEFAULT} is ahead by", "better / equal / worse", "nodes, median"]
    lines = []
    for method in measured.methods:
        its = [one for one in measured.learned if one.cell.method == method]
        shares = [[one.success for one in its if belongs(one.cell.task)] for _, belongs in groups]
        line = [method, *(_percent(fmean(one)) if one else "" for one in shares)]
        against = compare(measured.learned, DEFAULT, method) if method != DEFAULT else None
        if against is None:
            line += ["", ""]
        else:
            line += [
                _points(against.difference),
                f"{against.better} / {against.equal} / {against.worse}",
            ]
        lines.append([*line, f"{median(one.nodes for one in its):g}"])
    title = (
        "Success in per cent, mean over tasks, numbers of demonstrations and sets; differences in "
        "points, in pairs, ± standard error over sets"
    )
    return _table(title, head, lines)


def _by_count(measured: Measured) -> str:
    counts = sorted({one.cell.n for one in measured.learned})
    lines = _means(measured.learned, counts, lambda one: one.cell.n)
    title = "Success in per cent over demonstrations, mean over tasks and sets"
    return _table(title, ["method", *(f"n = {n}" for n in counts)], lines)


def _ahead_by_count(measured: Measured) -> str:
    by_count = grouped(measured.learned, lambda one: one.cell.n)
    counts = sorted(by_count)
    lines = []
    for method in measured.methods:
        if method != DEFAULT:
            found = (compare(by_count[n], DEFAULT, method) for n in counts)
            lines.append([method, *(_points(one.difference) if one else "" for one in found)])
    title = "By how much the default is ahead over demonstrations, in points, ± standard error"
    return _table(title, ["method", *(f"n = {n}" for n in counts)], lines)


def _by_task(measured: Measured) -> str:
    lines = _means(measured.learned, measured.tasks, lambda one: one.cell.task)
    lines.append([EXPERT, *(_percent(measured.experts[task]) for task in measured.tasks)])
    title = "Success in per cent, mean over numbers of demonstrations and sets"
    return _table(title, ["method", *measured.tasks], lines)


def _means(
    results: Sequence[Result], columns: Sequence[Key], column_of: Callable[[Result], Key]
) -> list[list[str]]:
    """Mean success of each method, a line for each, in some columns."""
    lines = []
    for method, its in grouped(results, lambda one: one.cell.method).items():
        groups = grouped(its, column_of)
        shares = ([one.success for one in groups.get(column, ())] for column in columns)
        lines.append([method, *(_percent(fmean(one)) if one else "" for one in shares)])
    return lines


def _needed(measured: Measured) -> str:
    found = entries(measured.learned)
    counts = sorted({one.n for one in found})
    by_method = {method: needed(found, measured.experts, method) for method in measured.methods}
    lines = [
        [
            method,
            *(_count(its.get(task), counts) for task in measured.tasks),
            _median_count(list(its.values()), counts),
        ]
        for method, its in by_method.items()
    ]
    title = (
        f"Demonstrations needed for {ENOUGH:.0%} of the expert's success, in the mean of the sets"
    )
    return _table(title, ["method", *measured.tasks, "median"], lines)


def _count(n: int | None, counts: Sequence[int]) -> str:
    return f"> {counts[-1]}" if n is None else str(n)


def _median_count(needed: Sequence[int | None], counts: Sequence[int]) -> str:
    middle = median(math.inf if one is None else one for one in needed)
    return f"> {counts[-1]}" if middle == math.inf else f"{middle:g}"


def _against_trees(measured: Measured) -> str:
    """The default against the better plain tree with a history, task by task."""
    if not set(_WITH_HISTORY) <= set(measured.methods):
        return ""
    by_cell = grouped(measured.learned, lambda one: (one.cell.task, one.cell.method))
    lines = []
    for task in measured.tasks:
        means = {
            method: fmean(one.success for one in by_cell[task, method])
            for method in (*_WITH_HISTORY, DEFAULT)
            if (task, method) in by_cell
        }
        if len(means) < len(_WITH_HISTORY) + 1:
            continue
        better = max(_WITH_HISTORY, key=lambda method: means[method])
        its = [one for one in measured.learned if one.cell.task == task]
        against = compare(its, DEFAULT, better)
        assert against is not None
        lines.append([task, better, _points(against.difference), _share_of_nodes(its)])
    lines.append(["all", "", "", _share_of_nodes(measured.learned)])
    title = (
        "The default against the better of the plain trees with a history, in points; its nodes, "
        "as a share of the unpruned tree's without a history (all trees together)"
    )
    return _table(title, ["task", "the better one", "ahead by", "nodes"], lines)


def _share_of_nodes(results: Sequence[Result]) -> str:
    nodes = {
        method: {
            (one.cell.task, one.cell.number, one.cell.n): one.nodes
            for one in results
            if one.cell.method == method
        }
        for method in (DEFAULT, _UNPRUNED)
    }
    both = nodes[DEFAULT].keys() & nodes[_UNPRUNED].keys()
    mine, others = (sum(its[key] for key in both) for its in nodes.values())
    return f"{mine / others:.2f}" if others else ""


def _growth(measured: Measured) -> str:
    steps = growth(measured.learned, DEFAULT)
    falls = [one for one in steps if one.falls]
    head = f"Of {len(steps)} steps to more demonstrations, the default falls by more than noise in "
    if not falls:
        return f"{head}none."
    listed = (f"{one.task} {one.fewer} → {one.more} ({_points(one.change)})" for one in falls)
    return f"{head}{len(falls)}: {', '.join(listed)}."


def _forecast(measured: Measured) -> str:
    """How well cross-validated figures of the default forecast its success, within tasks."""
    mine = [one for one in measured.learned if one.cell.method == DEFAULT]
    sentences = []
    for name, words in (("agreement", "agreement"), ("mean_recall", "mean recall")):
        found = [
            correlation
            for its in grouped(mine, lambda one: one.cell.task).values()
            if (correlation := _correlation(its, name)) is not None
        ]
        if found:
            sentences.append(f"{words} {fmean(found):.2f} ({len(found)} tasks)")
    if not sentences:
        return ""
    return f"Rank correlation with success within a task, in the mean: {', '.join(sentences)}."


def _correlation(results: Sequence[Result], name: str) -> float | None:
    pairs = [(one.about[name], one.success) for one in results if one.about.get(name) is not None]
    if any(len(set(column)) < 2 for column in zip(*pairs, strict=True)) or len(pairs) < 3:
        return None
    return float(spearmanr(*zip(*pairs, strict=True)).statistic)


def _lateness(measured: Measured) -> str:
    """How often the default knows how late demonstrators were."""
    told = [one for one in measured.learned if one.cell.method == DEFAULT and "late" in one.about]
    if not told:
        return ""
    shares = (
        f"{task} {_percent(fmean(one.about['late'] == measured.late for one in its))}"
        for task, its in grouped(told, lambda one: one.cell.task).items()
    )
    every = _percent(fmean(one.about["late"] == measured.late for one in told))
    return (
        f"Demonstrators were late by {measured.late} steps. Per cent of the cells in which the "
        f"default finds just that: {every} ({', '.join(shares)})."
    )


def _refusals(measured: Measured) -> str:
    refused = [one for one in measured.learned if one.refusal]
    if not refused:
        return ""
    which = grouped(refused, lambda one: (one.cell.task, one.cell.method))
    listed = (
        f"{task}, {method}: {len(its)} ({its[0].refusal})" for (task, method), its in which.items()
    )
    return "Refusals, which count as no success: " + "; ".join(listed)


def _of_task(measured: Measured, task: str) -> str:
    its = [one for one in entries(measured.learned) if one.task == task]
    counts = sorted({one.n for one in its})
    by_cell = {(one.method, one.n): one for one in its}
    lines = [
        [method, *(_entry(by_cell.get((method, n))) for n in counts)] for method in measured.methods
    ]
    memory = ", needs memory" if task in measured.memory else ""
    title = f"{task}{memory}: success in per cent ± standard error (nodes); expert "
    title += _percent(measured.experts[task])
    return _table(title, ["method", *(f"n = {n}" for n in counts)], lines)


def _entry(entry: Entry | None) -> str:
    if entry is None:
        return ""
    error = "" if entry.success.error is None else f" ± {100 * entry.success.error:.0f}"
    return f"{_percent(entry.success.value)}{error} ({entry.nodes:.0f})"


def corrections_report(courses: Sequence[Course]) -> str:
    """How many demonstrations each mode took, in the mean over sets."""
    parts = [_corrections(courses), _after_corrections(courses)]
    return "\n\n".join(parts) + "\n"


def _corrections(courses: Sequence[Course]) -> str:
    lines = []
    for (task, mode), its in grouped(courses, lambda one: (one.task, one.mode)).items():
        last = [one.last for one in its]
        lines.append(
            [
                task,
                mode.value,
                f"{sum(one.reached for one in its)} of {len(its)}",
                _plain(Mean.of([one.demonstrations for one in last])),
                _plain(Mean.of([one.rows for one in last])),
                _plain(Mean.of([one.episodes for one in last])),
                _percent(fmean(one.success for one in last)),
            ]
        )
    title = (
        f"Until {ENOUGH:.0%} of the expert's success, from two demonstrations on; mean ± standard "
        "error over sets, where those that do not get there count up to their last correction"
    )
    head = ["task", "shown", "reached", "demonstrations", "rows", "episodes", "success"]
    return _table(title, head, lines)


def _after_corrections(courses: Sequence[Course]) -> str:
    whole = {(one.task, one.number): one for one in courses if one.mode is Mode.WHOLE}
    lines = []
    for mode, its in grouped(courses, lambda one: one.mode).items():
        for count in _CORRECTIONS:
            line = [
                mode.value,
                str(count),
                _percent(fmean(one.after(count).success for one in its)),
            ]
            pairs = [
                (one, whole[one.task, one.number]) for one in its if (one.task, one.number) in whole
            ]
            if mode is Mode.WHOLE or not pairs:
                line += ["", ""]
            else:
                ahead = grouped(
                    [
                        (one.number, one.after(count).success - other.after(count).success)
                        for one, other in pairs
                    ],
                    lambda pair: pair[0],
                )
                difference = Mean.of([fmean(one for _, one in its) for its in ahead.values()])
                rows = [
                    _added(one, count) / _added(other, count)
                    for one, other in pairs
                    if _added(other, count)
                ]
                line += [_points(difference), f"{median(rows):.2f}" if rows else ""]
            lines.append(line)
    title = "After so many corrections, mean over tasks and sets; against whole demonstrations"
    head = ["shown", "corrections", "success", "ahead by", "rows added, share of theirs"]
    return _table(title, head, lines)


def _added(course: Course, corrections: int) -> int:
    return course.after(corrections).rows - course.stages[0].rows


def _plain(mean: Mean) -> str:
    error = "" if mean.error is None else f" ± {mean.error:.1f}"
    return f"{mean.value:.1f}{error}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f}"


def _points(mean: Mean) -> str:
    error = "" if mean.error is None else f" ± {100 * mean.error:.1f}"
    return f"{100 * mean.value:+.1f}{error}"


def _table(title: str, head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A Markdown table whose columns line up as text, too."""
    rows = [list(head), *map(list, lines)]
    widths = [max(3, *map(len, column)) for column in zip(*rows, strict=True)]
    rule = ["-" * width for width in widths]
    body = "\n".join(_row(one, widths) for one in (rows[0], rule, *rows[1:]))
    return f"{title}:\n\n{body}"


def _row(cells: Sequence[str], widths: Sequence[int]) -> str:
    padded = (f"{cell:<{width}}" for cell, width in zip(cells, widths, strict=True))
    return f"| {' | '.join(padded)} |"
