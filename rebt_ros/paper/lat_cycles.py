"""Replacing the cycles of the LAT graph by cycle nodes (Algorithm 2, line 3: REMOVE_CYCLES).

A graph can have more simple cycles than anyone can list, so they are never enumerated.  One cycle
is replaced at a time: the one that the demonstrations closed most often or, if they closed none of
the remaining ones, the first that a depth-first search finds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import islice
from typing import Any, TypeAlias, TypeVar

import networkx as nx
import numpy as np
import numpy.typing as npt

from rebt_ros.paper.lat_nodes import CycleNode, GraphNode, LatGraph
from rebt_ros.paper.lat_occurrences import Occurrences

#: Deepest nesting of cycles in a cycle node; deeper nesting helps no reader.
DEEPEST_NESTING = 8
#: How many loops of the demonstrations, the most frequent first, one pass considers.
MOST_LOOPS = 256

#: Numbers of nodes of the current graph.
_Cycle: TypeAlias = tuple[int, ...]
#: The nodes that a run may belong to: several if its action is in several PSA groups.
_Owners: TypeAlias = tuple[int, ...]
#: Positions of owners, one for each run of a demonstration.
_Runs: TypeAlias = "npt.NDArray[np.unsignedinteger[Any]]"
_T = TypeVar("_T")


class CycleStart(Enum):
    """Which node of a cycle its Repeater starts with (paper, III-B)."""

    MOST_FREQUENT = "most_frequent"
    """The first node of the rotation that occurs most often in the demonstrations."""
    ARBITRARY = "arbitrary"
    """The first node in the order of the rules."""


@dataclass(frozen=True, slots=True)
class ClosedCycle:
    """A simple cycle of action nodes that the demonstrations closed."""

    cycle: CycleNode
    times: int
    """How often they returned to one of its nodes after passing through the others."""


@dataclass(frozen=True, slots=True)
class Acyclic:
    """A graph without cycles, and what was left out to get it."""

    graph: LatGraph
    self_loops: int = 0
    """Edges from a PSA group to itself: choosing among its actions again is not a new step."""
    edges: int = 0
    """Edges of cycles that would have been nested deeper than `DEEPEST_NESTING`."""
    closed: tuple[ClosedCycle, ...] = ()
    """Cycles of the original graph, without self-loops, that the demonstrations closed; the most
    frequent first (see `MOST_LOOPS`)."""


def remove_cycles(
    graph: LatGraph, occurrences: Occurrences, start: CycleStart = CycleStart.MOST_FREQUENT
) -> Acyclic:
    """REMOVE_CYCLES: collapses one cycle after another until the graph has none.

    A cycle node takes over all edges into and out of its nodes, and can so be part of later cycles.
    Of equally frequent cycles the shortest is collapsed first; of equally short ones, the first in
    the order of the nodes, in which cycle nodes come last.

    Args:
        graph: A graph of action nodes only.
        occurrences: The demonstrations.
        start: Which node a cycle starts with.
    """
    key = (remove_cycles, graph, start)
    return occurrences.remembered(key, lambda: _without_cycles(graph, occurrences, start))


def _without_cycles(graph: LatGraph, occurrences: Occurrences, start: CycleStart) -> Acyclic:
    work = _Work(graph, occurrences)
    closed = tuple(ClosedCycle(work.cycle_node(one, start), n) for one, n in work.closed_cycles())
    while (cycle := work.next_cycle()) is not None:
        work.collapse(cycle, start)
    edges = work.drop_back_edges()
    return Acyclic(work.result(), work.self_loops, edges, closed)


class _Work:
    """A changing graph, its nodes numbered in the order in which they were added."""

    def __init__(self, graph: LatGraph, occurrences: Occurrences) -> None:
        self._nodes: dict[int, GraphNode] = dict(enumerate(graph.nodes))
        self._rank: dict[int, int] = {number: number for number in self._nodes}
        self._deepest: set[int] = set()
        self._occurrences = occurrences
        self._engine = nx.DiGraph()
        self._engine.add_nodes_from(self._nodes)
        self._engine.add_edges_from(edge for edge in graph.edges if edge[0] != edge[1])
        self.self_loops = sum(1 for before, after in graph.edges if before == after)
        owners: dict[str, list[int]] = {}
        for number, node in self._nodes.items():
            for label in node.labels:
                owners.setdefault(label, []).append(number)
        self._closed: list[tuple[_Cycle, int]] | None = None
        self._shown = _Steps(
            [tuple(owners.get(label, ())) for label in demonstration]
            for demonstration in occurrences.shown
        )

    def closed_cycles(self) -> list[tuple[_Cycle, int]]:
        """Cycles that the demonstrations closed, and how often; the most frequent first."""
        if self._closed is None:
            self._closed = self._find_closed()
        return self._closed

    def _find_closed(self) -> list[tuple[_Cycle, int]]:
        cycles = (
            (cycle, times)
            for loop, times in _most_frequent(self._shown.loops())
            if (cycle := self._as_cycle(loop)) is not None
        )
        closed: Counter[_Cycle] = Counter()
        for cycle, times in islice(cycles, MOST_LOOPS):
            closed[cycle] += times
        return _most_frequent(closed)

    def next_cycle(self) -> _Cycle | None:
        """The next cycle to collapse; None if none may be nested any deeper."""
        if nx.is_directed_acyclic_graph(self._engine):
            return None
        if closed := self.closed_cycles():
            return closed[0][0]
        try:
            return tuple(edge[0] for edge in nx.find_cycle(self._of_shallow_nodes()))
        except nx.NetworkXNoCycle:
            return None

    def cycle_node(self, cycle: _Cycle, start: CycleStart) -> CycleNode:
        """The cycle node that a cycle becomes."""
        return CycleNode(tuple(self._nodes[number] for number in self._from_start(cycle, start)))

    def collapse(self, cycle: _Cycle, start: CycleStart) -> None:
        """Replaces the nodes of the cycle by a cycle node, which takes over their edges."""
        node = self.cycle_node(cycle, start)
        number = max(self._nodes) + 1
        before = [
            predecessor for member in cycle for predecessor in self._engine.predecessors(member)
        ]
        after = [successor for member in cycle for successor in self._engine.successors(member)]
        self._nodes[number] = node
        if node.nesting >= DEEPEST_NESTING:
            self._deepest.add(number)
        self._rank[number] = min(self._rank[member] for member in cycle)
        self._engine.add_node(number)
        self._engine.add_edges_from((one, number) for one in before if one not in cycle)
        self._engine.add_edges_from((number, one) for one in after if one not in cycle)
        self._engine.remove_nodes_from(cycle)
        self._shown.collapse(cycle, number)
        self._closed = None

    def drop_back_edges(self) -> int:
        """Removes the edges that close cycles in a depth-first search; returns how many."""
        finished = {
            number: place for place, number in enumerate(nx.dfs_postorder_nodes(self._engine))
        }
        back = [edge for edge in self._engine.edges if finished[edge[0]] <= finished[edge[1]]]
        self._engine.remove_edges_from(back)
        return len(back)

    def result(self) -> LatGraph:
        """The graph, with each cycle node in the place of the first of its actions."""
        numbers = sorted(self._engine, key=self._rank.__getitem__)
        place = {number: place for place, number in enumerate(numbers)}
        edges = sorted((place[before], place[after]) for before, after in self._engine.edges)
        return LatGraph(tuple(self._nodes[number] for number in numbers), tuple(edges))

    def _of_shallow_nodes(self) -> nx.DiGraph:
        """The part of the graph whose cycles may be collapsed."""
        if not self._deepest:
            return self._engine
        # Not a subgraph view: those iterate over sets.
        shallow = nx.DiGraph()
        shallow.add_nodes_from(one for one in self._engine if one not in self._deepest)
        shallow.add_edges_from(
            edge for edge in self._engine.edges if self._deepest.isdisjoint(edge)
        )
        return shallow

    def _as_cycle(self, loop: tuple[_Owners, ...]) -> _Cycle | None:
        """A cycle of the graph that the loop went through, its smallest number first.

        If a run may belong to several nodes, one way to each is enough: few nodes of a loop are
        ambiguous.
        """
        for first in loop[0]:
            ways: list[_Cycle] = [] if first in self._deepest else [(first,)]
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
                and owner not in self._deepest
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
        """Smallest for the most frequent rotation; of equals, for the one that was shown first."""
        path = [self._nodes[number] for number in rotation]
        return -self._occurrences.count(path), self._occurrences.first(path)


class _Steps:
    """The demonstrations as sequences of nodes; neighbors differ.

    No loop begins inside a cycle node.  The nodes that a run may belong to are encoded as a number,
    which makes loops slices of arrays that are counted as bytes.
    """

    def __init__(self, shown: Iterable[list[_Owners]]) -> None:
        demonstrations = list(shown)
        distinct = {owners for demonstration in demonstrations for owners in demonstration}
        self._owners = sorted(distinct)
        places = _places(self._owners)
        kind = np.uint16 if len(places) <= np.iinfo(np.uint16).max else np.uint32
        self._runs = [
            _contracted(np.array([places[owners] for owners in demonstration], dtype=kind))
            for demonstration in demonstrations
        ]

    def loops(self) -> Counter[tuple[_Owners, ...]]:
        """Each way back to the nodes of a run through distinct others, and how often it was taken.

        The smallest nodes come first.
        """
        nobody = _places(self._owners).get((), len(self._owners))
        taken: Counter[bytes] = Counter()
        for runs in self._runs:
            taken.update(_ways_back(runs, nobody))
        loops: Counter[tuple[_Owners, ...]] = Counter()
        for way, times in taken.items():
            places = np.frombuffer(way, dtype=self._runs[0].dtype).tolist()
            smallest = places.index(min(places))
            turned = places[smallest:] + places[:smallest]
            loops[tuple(self._owners[place] for place in turned)] += times
        return loops

    def collapse(self, cycle: _Cycle, number: int) -> None:
        """Replaces the nodes of the cycle by the node with this number."""
        renamed = [_renamed(owners, cycle, number) for owners in self._owners]
        self._owners = sorted(set(renamed))
        places = _places(self._owners)
        place = np.array([places[owners] for owners in renamed])
        self._runs = [_contracted(place[runs].astype(runs.dtype)) for runs in self._runs]


def _places(owners: list[_Owners]) -> dict[_Owners, int]:
    return {owner: place for place, owner in enumerate(owners)}


def _contracted(runs: _Runs) -> _Runs:
    differs = np.ones(len(runs), dtype=bool)
    differs[1:] = runs[1:] != runs[:-1]
    return runs[differs]


def _renamed(owners: _Owners, cycle: _Cycle, number: int) -> _Owners:
    kept = tuple(owner for owner in owners if owner not in cycle)
    return owners if len(kept) == len(owners) else (*kept, number)


def _ways_back(runs: _Runs, nobody: int) -> Iterator[bytes]:
    """Stretches of runs from one to its next occurrence, in which no run repeats, as bytes.

    A run that belongs to no node ends every stretch.
    """
    count = len(runs)
    before = np.full(count, -1)
    order = np.argsort(runs, kind="stable")
    again = runs[order[1:]] == runs[order[:-1]]
    before[order[1:][again]] = order[:-1][again]
    free = runs == nobody
    before[free] = -1
    # The place from which on no run repeats before the current place.
    since = np.maximum.accumulate(np.where(free, np.arange(count), before) + 1)
    distinct_since = np.append(0, since[:-1])[:count]
    ends = np.flatnonzero((before >= distinct_since) & ~free)
    size, data = runs.itemsize, runs.tobytes()
    for start, end in zip((before[ends] * size).tolist(), (ends * size).tolist(), strict=True):
        yield data[start:end]


def _most_frequent(counted: Counter[tuple[_T, ...]]) -> list[tuple[tuple[_T, ...], int]]:
    """Counted items, the most frequent first; of equals, the shortest."""
    return sorted(counted.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
