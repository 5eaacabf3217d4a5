"""Repeaters of single loops, beside the LAT trees of the paper.

Algorithm 2 replaces one cycle after the other, which leaves one Repeater of each bundle of cycles,
in which the simple ones are nested where nobody finds them.
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
    """Loops beyond the number that was asked for."""


def loop_trees(
    rules: Iterable[Rule],
    trees: Iterable[LatTree],
    occurrences: Occurrences,
    *,
    inv_set: frozenset[Literal] = frozenset(),
    most: int,
) -> LoopTrees:
    """Makes a Repeater of each loop that is none of the LAT trees.

    Args:
        rules: Minimized and float-reduced, but unfactored.
        trees: What Algorithm 2 made of them.
        occurrences: In the demonstrations, given by their rows: loops of one action need all.
        inv_set: Literals to be shown as Inverters (Algorithm 1, line 3).
        most: How many Repeaters to build at most.
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
    """Loops that were shown and how often, the most frequent first, of equals the shortest.

    - The simple cycles of the LAT graph: how often the demonstrations closed them.
    - An action or PSA group that was done twice or more in a row: how often it was.  LAT is the
      last *different* action, so that the graph has no edge for it, or at most, between the members
      of a group, one from the group to itself.
    - A path of actions that was done twice or more in a row: how often it was.  A rule that tells
      by ``LAT != a`` when its action begins the path again has no edge for it either.
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
