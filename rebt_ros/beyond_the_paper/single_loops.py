"""Repeaters of single loops, beside the LAT trees of the paper.

Algorithm 2 replaces one cycle after another.  Each bundle of cycles becomes one Repeater, in which
the simple cycles are nested where nobody finds them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from rebt_ros.logic.conditions import Literal
from rebt_ros.paper.lat_cycles import Acyclic, CycleStart, remove_cycles
from rebt_ros.paper.lat_graph import generate_graph
from rebt_ros.paper.lat_nodes import ActionNode, CycleNode, LatGraph
from rebt_ros.paper.lat_occurrences import Occurrences
from rebt_ros.paper.lat_trees import LatTree, repeater
from rebt_ros.paper.rules import Rule


@dataclass(frozen=True, slots=True)
class LoopTrees:
    """Repeaters of single loops."""

    trees: tuple[LatTree, ...]
    """The best supported first."""
    left_out: int
    """Number of loops beyond the requested number."""


def loop_trees(
    rules: Iterable[Rule],
    trees: Iterable[LatTree],
    occurrences: Occurrences,
    *,
    inv_set: frozenset[Literal] = frozenset(),
    most: int,
) -> LoopTrees:
    """Makes a Repeater of each loop that is not a LAT tree.

    Args:
        rules: Minimized and float-reduced, but unfactored.
        trees: The result of Algorithm 2 for these rules.
        occurrences: The demonstrations, given by rows: loops of a single action need all rows.
        inv_set: Literals to show as Inverters (Algorithm 1, line 3).
        most: Maximum number of Repeaters.
    """
    rules, trees = tuple(rules), tuple(trees)
    if not most:
        return LoopTrees((), 0)
    graph = generate_graph(rules)
    acyclic = remove_cycles(graph, occurrences, CycleStart.MOST_FREQUENT)
    there = {tree.path for tree in trees}
    found = [
        loop for loop in single_loops(graph, acyclic, trees, occurrences) if (loop[0],) not in there
    ]
    dnfs = {ActionNode(rule.actions): rule.dnf for rule in rules}
    repeaters = tuple(
        LatTree((cycle,), support, repeater(cycle, dnfs, inv_set))
        for cycle, support in found[:most]
    )
    return LoopTrees(repeaters, len(found) - len(repeaters))


def single_loops(
    graph: LatGraph, acyclic: Acyclic, trees: Iterable[LatTree], occurrences: Occurrences
) -> list[tuple[CycleNode, int]]:
    """Loops that were shown, and how often; the most frequent first, of equals the shortest.

    - The simple cycles of the LAT graph: how often the demonstrations closed them.
    - An action or PSA group that was done twice or more in a row: how often.  LAT is the last
      *different* action, so the graph has no edge for this, except from a group to itself between
      members of the group.
    - A path of actions that was done twice or more in a row: how often.  A rule that begins the
      path again by ``LAT != a`` has no edge for this either.
    """
    loops = {one.cycle: one.times for one in acyclic.closed}
    for node in graph.nodes:
        if isinstance(node, ActionNode) and (times := occurrences.repetitions(node)):
            loops.setdefault(CycleNode((node,)), times)
    for tree in trees:
        of_actions = all(isinstance(node, ActionNode) for node in tree.path)
        if of_actions and (times := occurrences.count((*tree.path, *tree.path))):
            loops.setdefault(CycleNode(tree.path), times)
    return sorted(loops.items(), key=lambda loop: (-loop[1], len(loop[0].path)))
