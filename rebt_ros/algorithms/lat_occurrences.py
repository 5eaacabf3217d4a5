"""How often paths of the LAT graph really occurred in the demonstrations.

The demonstrations are taken as runs: ``a a b b a`` is ``a b a``, as LAT sees it.  A path occurs
where its nodes follow each other without gaps inside one demonstration:

- an action, or any member of a PSA group, by one run;
- a cycle by one or more full passes of its path from its start node on, and possibly a last one
  that is left between two nodes, as a Repeater is left when a condition fails.

Places in the demonstrations are the bits of an integer, so that a path is looked for everywhere at
once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import groupby
from typing import TypeAlias

import numpy as np

from rebt_ros.algorithms.lat_graph import ActionNode, GraphNode
from rebt_ros.demonstration.table import DemonstrationTable

#: Labels of the actions of each demonstration, neighbours differ.
Runs: TypeAlias = tuple[tuple[str, ...], ...]
#: Bit n stands for the place before run n, of all demonstrations one after the other.
_Places: TypeAlias = int


def runs(table: DemonstrationTable) -> Runs:
    """The actions of each demonstration of the table, runs of equal ones as one."""
    rows = zip(table.demonstration.tolist(), table.chosen.tolist(), strict=True)
    return tuple(
        tuple(table.actions[code] for (_, code), _ in groupby(group))
        for _, group in groupby(rows, key=lambda row: row[0])
    )


class Occurrences:
    """Finds paths of graph nodes in demonstrations.

    >>> from rebt_ros.algorithms.lat_graph import CycleNode
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
        # No path contains the border, None, so that none crosses it.
        joined = [label for demonstration in self.shown for label in (*demonstration, None)]
        places: dict[str | None, list[int]] = {}
        for place, label in enumerate(joined):
            places.setdefault(label, []).append(place)
        self._of_label = {label: _as_bits(where, len(joined)) for label, where in places.items()}
        self._of_node: dict[ActionNode, _Places] = {}
        self.everywhere: _Places = (1 << (len(joined) + 1)) - 1

    def count(self, path: Sequence[GraphNode]) -> int:
        """How often the path occurs: the longest occurrences, from left to right, no overlaps."""
        starts = self._all_before(path, self.everywhere)
        if not starts:
            return 0
        occurrences, free = 0, 0
        of_one_length = all(isinstance(node, ActionNode) for node in path)
        for start in _as_list(starts):
            if start >= free:
                occurrences += 1
                free = (
                    start + len(path)
                    if of_one_length
                    else self._all_after(path, 1 << start).bit_length() - 1
                )
        return occurrences

    def first(self, path: Sequence[GraphNode]) -> int:
        """The first place at which the path occurs; -1 where it does not."""
        starts = self._all_before(path, self.everywhere)
        return (starts & -starts).bit_length() - 1

    def after(self, node: GraphNode, starts: _Places) -> _Places:
        """The places at which occurrences of the node end that begin at one of `starts`."""
        if isinstance(node, ActionNode):
            return (starts & self._places(node)) << 1
        full = _once_or_more(lambda places: self._all_after(node.path, places), starts)
        left = full
        for length in range(1, len(node.path)):
            left |= self._all_after(node.path[:length], full)
        return left

    def _before(self, node: GraphNode, ends: _Places) -> _Places:
        """The places at which occurrences of the node begin that end at one of `ends`."""
        if isinstance(node, ActionNode):
            return (ends >> 1) & self._places(node)
        full = ends
        for length in range(1, len(node.path)):
            full |= self._all_before(node.path[:length], ends)
        return _once_or_more(lambda places: self._all_before(node.path, places), full)

    def _all_after(self, path: Iterable[GraphNode], starts: _Places) -> _Places:
        for node in path:
            starts = self.after(node, starts)
        return starts

    def _all_before(self, path: Sequence[GraphNode], ends: _Places) -> _Places:
        for node in reversed(path):
            ends = self._before(node, ends)
        return ends

    def _places(self, node: ActionNode) -> _Places:
        if node not in self._of_node:
            places = 0
            for label in node.labels:
                places |= self._of_label.get(label, 0)
            self._of_node[node] = places
        return self._of_node[node]


def _once_or_more(one_pass: Callable[[_Places], _Places], places: _Places) -> _Places:
    reached = 0
    # Only from places that are new, so that a long loop is walked once.
    while places := one_pass(places) & ~reached:
        reached |= places
    return reached


def _as_bits(where: list[int], length: int) -> _Places:
    flags = np.zeros(length, dtype=np.uint8)
    flags[where] = 1
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")


def _as_list(places: _Places) -> list[int]:
    data = places.to_bytes(places.bit_length() // 8 + 1, "little")
    flags = np.unpackbits(np.frombuffer(data, dtype=np.uint8), bitorder="little")
    found: list[int] = np.flatnonzero(flags).tolist()
    return found
