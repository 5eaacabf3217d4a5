"""Nodes and edges of the LAT graph.

An action of a rule, or its PSA group, is an `ActionNode`; once cycles are removed, a cycle of such
nodes is a `CycleNode`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

from rebt_ros.behavior_tree.nodes import Action


@dataclass(frozen=True, slots=True)
class ActionNode:
    """The action of a rule, or its PSA group."""

    actions: tuple[Action, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the actions that it takes."""
        return tuple(action.label for action in self.actions)

    @property
    def nesting(self) -> int:
        """Depth of nested cycles: 0."""
        return 0


@dataclass(frozen=True, slots=True)
class CycleNode:
    """A cycle that was replaced by one node: an entry of the paper's lookup table."""

    path: tuple[GraphNode, ...]
    """Its nodes, from the start node on; the last one leads back to the first."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the actions that it takes, each once."""
        return tuple(dict.fromkeys(label for node in self.path for label in node.labels))

    @property
    def nesting(self) -> int:
        """Depth of nested cycles, including this one."""
        return 1 + max(node.nesting for node in self.path)


GraphNode: TypeAlias = ActionNode | CycleNode


@dataclass(frozen=True, slots=True)
class LatGraph:
    """A directed graph; the order of nodes and edges makes all results deterministic."""

    nodes: tuple[GraphNode, ...]
    edges: tuple[tuple[int, int], ...]
    """Positions in `nodes`, each pair once, ascending."""

    def __post_init__(self) -> None:
        if sorted(set(self.edges)) != list(self.edges):
            raise ValueError("the edges must be ascending, each pair once")
        if not all(0 <= place < len(self.nodes) for edge in self.edges for place in edge):
            raise ValueError("an edge names a node that does not exist")

    def pairs(self) -> Iterator[tuple[GraphNode, GraphNode]]:
        """The edges as pairs of nodes."""
        return ((self.nodes[before], self.nodes[after]) for before, after in self.edges)
