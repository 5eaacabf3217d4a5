"""How often paths of the LAT graph occurred in the demonstrations.

Demonstrations are sequences of runs: ``a a b b a`` is ``a b a``, as LAT sees it.  A path occurs
where its nodes follow each other without gaps in one demonstration:

- an action, or any member of a PSA group, as one run;
- a cycle as one or more full passes of its path from the start node on.  A last pass may end
  between two nodes, as a Repeater does when a condition fails.

Only repetitions of a single node are counted in rows, since LAT never shows them.

Places in the demonstrations are bits of an integer, so a path is searched for everywhere at once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import reduce
from itertools import groupby
from operator import or_
from typing import Any, TypeAlias, TypeVar

import numpy as np

from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.paper.lat_nodes import ActionNode, GraphNode

_Found = TypeVar("_Found")

#: Labels of the actions of each demonstration: runs, whose neighbors differ, or rows.
Runs: TypeAlias = tuple[tuple[str, ...], ...]
#: Bit n stands for the place before run n, of all demonstrations one after the other.
_Places: TypeAlias = int
#: Where runs of an action node are, or what a cycle node goes through.
_Compiled: TypeAlias = "_Places | tuple[_Compiled, ...]"

#: How many places are searched for the end of an occurrence before more are.
_PART = 256


def runs(table: DemonstrationTable) -> Runs:
    """The actions of each demonstration of the table, one per run of equal actions."""
    return tuple(
        tuple(label for label, _ in groupby(demonstration)) for demonstration in rows(table)
    )


def rows(table: DemonstrationTable) -> Runs:
    """The actions of each demonstration of the table, one per row."""
    if not len(table):
        return ()
    labels = np.array(table.actions, dtype=object)[table.chosen]
    borders = np.flatnonzero(np.diff(table.demonstration)) + 1
    return tuple(tuple(part.tolist()) for part in np.split(labels, borders))


class Occurrences:
    """Finds paths of graph nodes in demonstrations.

    >>> from rebt_ros.paper.lat_nodes import CycleNode
    >>> from rebt_ros.behavior_tree.nodes import Action
    >>> go, turn = (ActionNode((Action(label, "action"),)) for label in ("go", "turn"))
    >>> shown = Occurrences((("turn", "go", "turn", "go", "stop"), ("go", "turn")))
    >>> shown.count([turn, go]), shown.count([go, turn]), shown.count([CycleNode((turn, go))])
    (2, 2, 1)
    """

    def __init__(self, shown: Runs) -> None:
        self.shown = tuple(
            tuple(label for label, _ in groupby(demonstration)) for demonstration in shown
        )
        """The runs of each demonstration."""
        self._of_label, length = _places_of_labels(self.shown)
        self._rows_of_label, _ = _places_of_labels(shown)
        self._compiled: dict[GraphNode, _Compiled] = {}
        self._counted: dict[tuple[GraphNode, ...], tuple[int, int]] = {}
        self.everywhere: _Places = (1 << (length + 1)) - 1
        self._found: dict[Hashable, Any] = {}

    def remembered(self, key: Hashable, find: Callable[[], _Found]) -> _Found:
        """The result for this key, searched for once: many pruning levels share a LAT graph."""
        if key not in self._found:
            self._found[key] = find()
        found: _Found = self._found[key]
        return found

    def count(self, path: Sequence[GraphNode]) -> int:
        """How often the path occurs: longest occurrences, from left to right, without overlaps."""
        return self._count_and_first(tuple(path))[0]

    def first(self, path: Sequence[GraphNode]) -> int:
        """The first place at which the path occurs; -1 if it does not."""
        return self._count_and_first(tuple(path))[1]

    def repetitions(self, node: ActionNode) -> int:
        """How often actions of the node were done twice or more in a row."""
        rows = _joined(self._rows_of_label, node.labels)
        twice = rows & (rows >> 1)
        return (twice & ~(twice << 1)).bit_count()

    def _count_and_first(self, path: tuple[GraphNode, ...]) -> tuple[int, int]:
        if path not in self._counted:
            compiled = tuple(map(self._as_compiled, path))
            starts = _all_before(compiled, self.everywhere)
            first = (starts & -starts).bit_length() - 1
            self._counted[path] = (_count(compiled, starts), first)
        return self._counted[path]

    def after(self, node: GraphNode, starts: _Places) -> _Places:
        """The places at which occurrences of the node end that begin at one of `starts`."""
        return _after(self._as_compiled(node), starts, self.everywhere)

    def _as_compiled(self, node: GraphNode) -> _Compiled:
        if node not in self._compiled:
            self._compiled[node] = (
                _joined(self._of_label, node.labels)
                if isinstance(node, ActionNode)
                else tuple(map(self._as_compiled, node.path))
            )
        return self._compiled[node]


def _after(node: _Compiled, starts: _Places, limit: _Places) -> _Places:
    """The places at which occurrences of the node end that begin at one of `starts`.

    Raises:
        _FartherError: One of them, or a part of one, ends beyond the limit.
    """
    if isinstance(node, int):
        ends = (starts & node) << 1
        if ends > limit:
            raise _FartherError
        return ends
    full = _once_or_more(lambda places: _all_after(node, places, limit), starts)
    left, ends = full, full
    for step in node[:-1]:
        if not ends:
            break
        ends = _after(step, ends, limit)
        left |= ends
    return left


def _before(node: _Compiled, ends: _Places) -> _Places:
    """The places at which occurrences of the node begin that end at one of `ends`."""
    if isinstance(node, int):
        return (ends >> 1) & node
    full = ends
    for length in range(1, len(node)):
        full |= _all_before(node[:length], ends)
    return _once_or_more(lambda places: _all_before(node, places), full)


def _all_after(path: Iterable[_Compiled], starts: _Places, limit: _Places) -> _Places:
    for node in path:
        if not starts:
            break
        starts = _after(node, starts, limit)
    return starts


def _all_before(path: Sequence[_Compiled], ends: _Places) -> _Places:
    for node in reversed(path):
        if not ends:
            break
        ends = _before(node, ends)
    return ends


def _count(path: tuple[_Compiled, ...], starts: _Places) -> int:
    """The longest occurrences from left to right, without overlaps."""
    occurrences, free = 0, 0
    of_one_length = all(isinstance(node, int) for node in path)
    walk = _LongestWalk(path)
    for start in _as_list(starts):
        if start >= free:
            occurrences += 1
            free = start + len(path) if of_one_length else walk.end(start)
    return occurrences


class _FartherError(Exception):
    """A search leaves the part of the demonstrations that it looks at."""


class _LongestWalk:
    """Finds the end of the longest occurrence of a path that begins at a given place.

    Occurrences are short and demonstrations are long, so only a part of them is searched, and a
    longer part if an occurrence may continue beyond it.
    """

    def __init__(self, path: tuple[_Compiled, ...]) -> None:
        self._path = path
        self._begin = self._length = 0
        self._part: tuple[_Compiled, ...] = ()

    def end(self, start: int) -> int:
        """The place at which it ends; an occurrence must begin at `start`."""
        if not self._begin <= start < self._begin + self._length // 2:
            self._look_at(start, _PART)
        while True:
            limit = (1 << self._length) - 1
            try:
                ends = _all_after(self._part, 1 << (start - self._begin), limit)
            except _FartherError:
                self._look_at(start, 4 * self._length)
            else:
                return self._begin + ends.bit_length() - 1

    def _look_at(self, begin: int, length: int) -> None:
        self._begin, self._length = begin, length
        self._part = tuple(_cut(node, begin, (1 << length) - 1) for node in self._path)


def _cut(node: _Compiled, begin: int, mask: _Places) -> _Compiled:
    if isinstance(node, int):
        return (node >> begin) & mask
    return tuple(_cut(step, begin, mask) for step in node)


def _once_or_more(one_pass: Callable[[_Places], _Places], places: _Places) -> _Places:
    reached = 0
    # Only from new places: a long loop is walked once.
    while places := one_pass(places) & ~reached:
        reached |= places
    return reached


def _places_of_labels(shown: Runs) -> tuple[dict[str, _Places], int]:
    """Where each label occurs in all demonstrations, one after another, and their length."""
    # No path contains the border, None, so none crosses it.
    joined = [label for demonstration in shown for label in (*demonstration, None)]
    places: dict[str, list[int]] = {}
    for place, label in enumerate(joined):
        if label is not None:
            places.setdefault(label, []).append(place)
    return {label: _as_bits(where, len(joined)) for label, where in places.items()}, len(joined)


def _joined(of_label: Mapping[str, _Places], labels: Iterable[str]) -> _Places:
    return reduce(or_, (of_label.get(label, 0) for label in labels), 0)


def _as_bits(where: list[int], length: int) -> _Places:
    flags = np.zeros(length, dtype=np.uint8)
    flags[where] = 1
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")


def _as_list(places: _Places) -> list[int]:
    data = places.to_bytes(places.bit_length() // 8 + 1, "little")
    flags = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
    found: list[int] = np.flatnonzero(flags).tolist()
    return found
