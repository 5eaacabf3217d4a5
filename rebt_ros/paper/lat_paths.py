"""The paths of the LAT graph from its sources to its sinks (Algorithm 2, line 4: G.paths).

A graph without cycles can still have more paths than anyone can list, so only the number asked for
is searched for, best first.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, takewhile

import networkx as nx

from rebt_ros.paper.lat_nodes import ActionNode, GraphNode, LatGraph
from rebt_ros.paper.lat_occurrences import Occurrences


@dataclass(frozen=True, slots=True)
class LatPath:
    """A path from a source to a sink."""

    nodes: tuple[GraphNode, ...]
    support: int
    """How often it occurred in the demonstrations."""


@dataclass(frozen=True, slots=True)
class LatPaths:
    """The requested paths."""

    paths: tuple[LatPath, ...]
    """The best supported first; of equals, the longest."""
    left_out: int
    """How many more there are."""


def source_to_sink_paths(
    graph: LatGraph, occurrences: Occurrences, *, most: int, least_support: int = 0
) -> LatPaths:
    """The best supported paths of an acyclic graph.

    An action without edges is no path; a cycle node without edges is one.

    Args:
        graph: Acyclic.
        occurrences: The demonstrations.
        most: How many paths to return at most.
        least_support: How often a path must have occurred.
    """
    key = (source_to_sink_paths, graph, most, least_support)
    return occurrences.remembered(key, lambda: _paths(graph, occurrences, most, least_support))


def _paths(graph: LatGraph, occurrences: Occurrences, most: int, least_support: int) -> LatPaths:
    engine = nx.DiGraph()
    engine.add_nodes_from(range(len(graph.nodes)))
    engine.add_edges_from(graph.edges)
    engine.remove_nodes_from(
        [
            number
            for number in nx.isolates(engine.copy())
            if isinstance(graph.nodes[number], ActionNode)
        ]
    )
    found = takewhile(
        lambda path: path.support >= least_support, _best_first(engine, graph, occurrences)
    )
    paths = tuple(islice(found, most))
    return LatPaths(paths, _number_of_paths(engine) - len(paths))


def _best_first(engine: nx.DiGraph, graph: LatGraph, occurrences: Occurrences) -> Iterator[LatPath]:
    """All paths in the order of their support.

    The beginning of a path occurs at least as often as the whole.  So the number of places at which
    it ends bounds the support of all paths that continue it, and the path with the highest bound is
    extended next.  A complete path waits for its turn with its support.
    """
    # Entries: bound (negative), length (negative, so that among equals the search goes deep), the
    # path, its ends, and whether the bound is the support.  Paths are distinct, so entries
    # are never compared beyond them.
    waiting: list[tuple[int, int, tuple[int, ...], int, bool]] = []

    def push(path: tuple[int, ...], bound: int, starts: int) -> None:
        ends = occurrences.after(graph.nodes[path[-1]], starts)
        heapq.heappush(waiting, (-min(bound, ends.bit_count()), -len(path), path, ends, False))

    unbounded = occurrences.everywhere.bit_length()
    for number in engine:
        if engine.in_degree(number) == 0:
            push((number,), unbounded, occurrences.everywhere)
    while waiting:
        negative, _, path, ends, is_support = heapq.heappop(waiting)
        nodes = tuple(graph.nodes[number] for number in path)
        if is_support:
            yield LatPath(nodes, -negative)
        elif engine.out_degree(path[-1]) == 0:
            support = occurrences.count(nodes) if ends else 0
            heapq.heappush(waiting, (-support, -len(path), path, ends, True))
        else:
            for successor in engine.successors(path[-1]):
                push((*path, successor), -negative, ends)


def _number_of_paths(engine: nx.DiGraph) -> int:
    onwards: dict[int, int] = {}
    for number in reversed(list(nx.topological_sort(engine))):
        onwards[number] = sum(onwards[successor] for successor in engine.successors(number)) or 1
    return sum(onwards[number] for number in engine if engine.in_degree(number) == 0)
