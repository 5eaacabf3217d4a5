"""Replacing the cycles of the LAT graph by cycle nodes (Algorithm 2, line 3: REMOVE_CYCLES).

A graph can have more simple cycles than anyone can list, so they are never enumerated.  One cycle
is replaced at a time: that which the demonstrations closed most often and, where they closed none
that is left, one that a depth-first search meets.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import groupby, islice
from typing import TypeAlias, TypeVar

import networkx as nx

from rebt_ros.algorithms.lat_graph import CycleNode, GraphNode, LatGraph
from rebt_ros.algorithms.lat_occurrences import Occurrences

#: Deepest nesting of cycles in a cycle node; what is nested deeper helps no reader.
DEEPEST_NESTING = 8
#: Loops of the demonstrations, the most frequent ones, that are candidates of one pass.
MOST_LOOPS = 256

#: Nodes of the graph at hand, by number.
_Cycle: TypeAlias = tuple[int, ...]
#: Which nodes a run can be of: several where an action is in several PSA groups.
_Owners: TypeAlias = tuple[int, ...]
_T = TypeVar("_T")


class CycleStart(Enum):
    """Which node of a cycle its Repeater starts with (paper, III-B)."""

    MOST_FREQUENT = "most_frequent"
    """The first of the rotation that occurs most often in the demonstrations."""
    ARBITRARY = "arbitrary"
    """The first in the order of the rules."""


@dataclass(frozen=True, slots=True)
class Acyclic:
    """A graph without cycles, and what was left out to get it."""

    graph: LatGraph
    self_loops: int = 0
    """Edges from a PSA group to itself: choosing once more among its actions is no new step."""
    edges: int = 0
    """Edges of cycles that would have been nested deeper than `DEEPEST_NESTING`."""


def remove_cycles(
    graph: LatGraph, occurrences: Occurrences, start: CycleStart = CycleStart.MOST_FREQUENT
) -> Acyclic:
    """REMOVE_CYCLES: collapses one cycle after the other until the graph has none.

    A cycle node takes over all edges into and out of its nodes, so that it can be part of later
    cycles.  Of equally frequent cycles the shortest is collapsed first, of those the first one in
    the order of the nodes, where cycle nodes come last.

    Args:
        graph: Of action nodes only.
        occurrences: The demonstrations.
        start: Which node a cycle starts with.
    """
    work = _Work(graph, occurrences)
    while (cycle := work.next_cycle()) is not None:
        work.collapse(cycle, start)
    edges = work.drop_back_edges()
    return Acyclic(work.result(), work.self_loops, edges)


class _Work:
    """A graph that changes, its nodes numbered in the order in which they came in."""

    def __init__(self, graph: LatGraph, occurrences: Occurrences) -> None:
        self._nodes: dict[int, GraphNode] = dict(enumerate(graph.nodes))
        self._rank: dict[int, int] = {number: number for number in self._nodes}
        self._occurrences = occurrences
        self._engine = nx.DiGraph()
        self._engine.add_nodes_from(self._nodes)
        self._engine.add_edges_from(edge for edge in graph.edges if edge[0] != edge[1])
        self.self_loops = sum(1 for before, after in graph.edges if before == after)
        owners: dict[str, list[int]] = {}
        for number, node in self._nodes.items():
            for label in node.labels:
                owners.setdefault(label, []).append(number)
        self._shown = [
            _contracted(tuple(owners.get(label, ())) for label in demonstration)
            for demonstration in occurrences.shown
        ]

    def next_cycle(self) -> _Cycle | None:
        """The cycle to collapse now; None where there is none that may still be nested."""
        loops = Counter(loop for shown in self._shown for loop in _loops(shown))
        cycles = (
            (cycle, times)
            for loop, times in _most_frequent(loops)
            if (cycle := self._as_cycle(loop)) is not None
        )
        closed: Counter[_Cycle] = Counter()
        for cycle, times in islice(cycles, MOST_LOOPS):
            closed[cycle] += times
        if closed:
            return _most_frequent(closed)[0][0]
        try:
            return tuple(edge[0] for edge in nx.find_cycle(self._of_shallow_nodes()))
        except nx.NetworkXNoCycle:
            return None

    def collapse(self, cycle: _Cycle, start: CycleStart) -> None:
        """Replaces the nodes of the cycle by a cycle node, to which their edges move."""
        path = tuple(self._nodes[number] for number in self._from_start(cycle, start))
        number = max(self._nodes) + 1
        before = [one for member in cycle for one in self._engine.predecessors(member)]
        after = [one for member in cycle for one in self._engine.successors(member)]
        self._nodes[number] = CycleNode(path)
        self._rank[number] = min(self._rank[member] for member in cycle)
        self._engine.add_node(number)
        self._engine.add_edges_from((one, number) for one in before if one not in cycle)
        self._engine.add_edges_from((number, one) for one in after if one not in cycle)
        self._engine.remove_nodes_from(cycle)
        distinct = {owners for shown in self._shown for owners in shown}
        renamed = {owners: _renamed(owners, cycle, number) for owners in distinct}
        self._shown = [_contracted(map(renamed.__getitem__, shown)) for shown in self._shown]

    def drop_back_edges(self) -> int:
        """Removes what closes cycles in a depth-first search, and tells how many edges that is."""
        finished = {
            number: place for place, number in enumerate(nx.dfs_postorder_nodes(self._engine))
        }
        back = [edge for edge in self._engine.edges if finished[edge[0]] <= finished[edge[1]]]
        self._engine.remove_edges_from(back)
        return len(back)

    def result(self) -> LatGraph:
        """The graph, a cycle node standing where the first of its actions stood."""
        numbers = sorted(self._engine, key=self._rank.__getitem__)
        place = {number: place for place, number in enumerate(numbers)}
        edges = sorted((place[before], place[after]) for before, after in self._engine.edges)
        return LatGraph(tuple(self._nodes[number] for number in numbers), tuple(edges))

    def _of_shallow_nodes(self) -> nx.DiGraph:
        """The part of the graph whose cycles may be collapsed."""
        if all(map(self._may_be_nested, self._engine)):
            return self._engine
        # Not a subgraph view: those iterate over sets.
        shallow = nx.DiGraph()
        shallow.add_nodes_from(filter(self._may_be_nested, self._engine))
        shallow.add_edges_from(
            edge for edge in self._engine.edges if all(map(self._may_be_nested, edge))
        )
        return shallow

    def _may_be_nested(self, number: int) -> bool:
        return self._nodes[number].nesting < DEEPEST_NESTING

    def _as_cycle(self, loop: tuple[_Owners, ...]) -> _Cycle | None:
        """A cycle of the graph that the loop went through, its smallest number first.

        Where a run can be of several nodes, one way to each of them is enough: of the nodes of a
        loop, few are ambiguous.
        """
        for first in loop[0]:
            ways: list[_Cycle] = [(first,)] if self._may_be_nested(first) else []
            for owners in loop[1:]:
                ways = [way for owner in owners for way in self._one_way_on(ways, owner)]
            for way in ways:
                if self._engine.has_edge(way[-1], first):
                    smallest = way.index(min(way))
                    return way[smallest:] + way[:smallest]
        return None

    def _one_way_on(self, ways: Iterable[_Cycle], owner: int) -> Iterator[_Cycle]:
        for way in ways:
            if (
                owner not in way
                and self._may_be_nested(owner)
                and self._engine.has_edge(way[-1], owner)
            ):
                yield (*way, owner)
                return

    def _from_start(self, cycle: _Cycle, start: CycleStart) -> _Cycle:
        by_rank = sorted(
            (cycle[place:] + cycle[:place] for place in range(len(cycle))),
            key=lambda rotation: self._rank[rotation[0]],
        )
        if start is CycleStart.ARBITRARY:
            return by_rank[0]
        return min(by_rank, key=self._rarity)

    def _rarity(self, rotation: _Cycle) -> tuple[int, int]:
        """Smallest for the most frequent rotation, of several for the one that was shown first."""
        path = [self._nodes[number] for number in rotation]
        return -self._occurrences.count(path), self._occurrences.first(path)


def _contracted(shown: Iterable[_Owners]) -> list[_Owners]:
    """Neighbouring runs of the same nodes as one: inside a cycle node nothing new begins."""
    return [owners for owners, _ in groupby(shown)]


def _renamed(owners: _Owners, cycle: _Cycle, number: int) -> _Owners:
    kept = tuple(one for one in owners if one not in cycle)
    return owners if len(kept) == len(owners) else (*kept, number)


def _loops(shown: list[_Owners]) -> Iterator[tuple[_Owners, ...]]:
    """Each way back to a run's nodes by way of distinct other ones, its smallest first."""
    last_at: dict[_Owners, int] = {}
    distinct_since = 0
    for place, owners in enumerate(shown):
        if not owners:
            distinct_since = place + 1
            continue
        before = last_at.get(owners, -1)
        if before >= distinct_since:
            loop = tuple(shown[before:place])
            smallest = loop.index(min(loop))
            yield loop[smallest:] + loop[:smallest]
        distinct_since = max(distinct_since, before + 1)
        last_at[owners] = place


def _most_frequent(counted: Counter[tuple[_T, ...]]) -> list[tuple[tuple[_T, ...], int]]:
    """What was counted, the most frequent first, of equals the shortest."""
    return sorted(counted.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
