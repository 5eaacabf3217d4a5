"""What was measured: a figure of each cell, and of several sets together."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import fmean, stdev
from typing import Any, TypeVar

Key = TypeVar("Key", bound=Hashable)
Item = TypeVar("Item")

#: In the place of a method, without demonstrations.
EXPERT = "expert"
#: Share of the expert's success that is as good as it.
ENOUGH = 0.95


@dataclass(frozen=True, slots=True, order=True)
class Cell:
    """A method that has seen some demonstrations."""

    task: str
    number: int
    """Of the set."""
    n: int
    """Demonstrations."""
    method: str


@dataclass(frozen=True, slots=True)
class Result:
    """How the driver of a cell did."""

    cell: Cell
    success: float
    """Share of the fresh episodes."""
    nodes: int = 0
    rows: int = 0
    """That were learned from."""
    seconds: float = 0.0
    """That learning took."""
    refusal: str | None = None
    """Why nothing was learned, if so."""
    about: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean over sets."""

    value: float
    error: float | None
    """Standard error; None of a single set."""

    @classmethod
    def of(cls, values: Sequence[float]) -> Mean:
        """The mean of at least one value.

        >>> Mean.of([0.5, 0.7, 0.9])
        Mean(value=0.7, error=0.115...)
        """
        error = stdev(values) / math.sqrt(len(values)) if len(values) > 1 else None
        return cls(fmean(values), error)


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of driving.json: a method on a task, over all sets."""

    task: str
    n: int
    method: str
    success: Mean
    nodes: float

    def as_json(self) -> dict[str, object]:
        """As an object; `standard_error` is null where there is one set only."""
        error = self.success.error
        return {
            "task": self.task,
            "n": self.n,
            "method": self.method,
            "success": round(self.success.value, 4),
            "standard_error": None if error is None else round(error, 4),
            "nodes": round(self.nodes, 1),
        }


def entries(results: Iterable[Result]) -> tuple[Entry, ...]:
    """The means over sets, in the order in which the results came."""
    return tuple(
        Entry(
            task,
            n,
            method,
            Mean.of([one.success for one in its]),
            fmean(one.nodes for one in its),
        )
        for (task, n, method), its in grouped(
            results, lambda one: (one.cell.task, one.cell.n, one.cell.method)
        ).items()
        if method != EXPERT
    )


@dataclass(frozen=True, slots=True)
class Comparison:
    """A method against another one, on the cells that both have."""

    difference: Mean
    """Of success, in the mean over the cells of each set."""
    better: int
    """Cells in which the first one succeeds more often."""
    equal: int
    worse: int


def compare(results: Sequence[Result], method: str, other: str) -> Comparison | None:
    """Compares two methods in pairs: on equal demonstrations and equal fresh episodes.

    Demonstrations of a set are nested and tasks differ in difficulty, so that cells of one set are
    not independent: the standard error is that of the sets' means.

    Returns:
        None where there is no cell that both have.
    """
    mine, others = (
        {_pair(one): one.success for one in results if one.cell.method == name}
        for name in (method, other)
    )
    pairs = [(key, mine[key] - others[key]) for key in mine if key in others]
    if not pairs:
        return None
    by_set = grouped(pairs, lambda pair: pair[0].number)
    return Comparison(
        Mean.of([fmean(difference for _, difference in its) for its in by_set.values()]),
        sum(difference > 0 for _, difference in pairs),
        sum(difference == 0 for _, difference in pairs),
        sum(difference < 0 for _, difference in pairs),
    )


def _pair(result: Result) -> Cell:
    cell = result.cell
    return Cell(cell.task, cell.number, cell.n, "")


@dataclass(frozen=True, slots=True)
class Growth:
    """What more demonstrations of the same sets change."""

    task: str
    fewer: int
    more: int
    change: Mean
    """Of success."""

    @property
    def falls(self) -> bool:
        """Whether success falls by more than noise: two standard errors.  One set cannot tell."""
        error = self.change.error
        return error is not None and self.change.value < -2 * error


def growth(results: Iterable[Result], method: str) -> tuple[Growth, ...]:
    """From each number of demonstrations to the next larger one, in pairs."""
    mine = [one for one in results if one.cell.method == method]
    found = []
    for task, its in grouped(mine, lambda one: one.cell.task).items():
        by_count = {
            n: {one.cell.number: one.success for one in same}
            for n, same in sorted(grouped(its, lambda one: one.cell.n).items())
        }
        counts = list(by_count)
        for fewer, more in pairwise(counts):
            before, after = by_count[fewer], by_count[more]
            changes = [after[number] - before[number] for number in before if number in after]
            if changes:
                found.append(Growth(task, fewer, more, Mean.of(changes)))
    return tuple(found)


def needed(
    entries: Iterable[Entry], experts: Mapping[str, float], method: str
) -> dict[str, int | None]:
    """The fewest demonstrations with which a method does as well as the expert, by task.

    Args:
        entries: Of all methods.
        experts: Success of each task's expert.
        method: Which one.

    Returns:
        None where no number that was tried is enough.
    """
    mine = sorted((one for one in entries if one.method == method), key=lambda one: one.n)
    enough: dict[str, int | None] = {}
    for one in mine:
        reached = one.success.value >= ENOUGH * experts[one.task]
        if enough.setdefault(one.task, None) is None and reached:
            enough[one.task] = one.n
    return enough


def grouped(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """The items by a key, in the order in which they came."""
    groups: dict[Key, list[Item]] = {}
    for one in items:
        groups.setdefault(key(one), []).append(one)
    return groups
