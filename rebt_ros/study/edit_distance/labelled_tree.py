"""Behavior trees as the experiments compare them: rooted trees of labels (paper, IV-B).

label
    The kind of a node; for an action with its label, for a condition with its feature.  Thresholds,
    categories, negations and the names that pictures show are no part of it.

As in the paper's tools, Inverters and LAT conditions are no part of what is compared, and a group
with a single child stays.  The order of children is part of a `LabelledTree`, but of no distance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import LastActionIs, PreviousActionIs, features_of


@dataclass(frozen=True, slots=True)
class LabelledTree:
    """A rooted tree whose nodes have labels.

    >>> LabelledTree(("Sequence", "Condition battery", "Action dock"), (-1, 0, 0)).edges
    ((0, 1), (0, 2))
    """

    labels: tuple[str, ...]
    """In preorder."""
    parents: tuple[int, ...]
    """Position of each node's parent; -1 for the root."""

    def __post_init__(self) -> None:
        if not self.labels or len(self.labels) != len(self.parents):
            raise ValueError(f"{len(self.labels)} labels and {len(self.parents)} parents")
        if self.parents[0] != -1 or not all(
            0 <= parent < place for place, parent in enumerate(self.parents[1:], start=1)
        ):
            raise ValueError("the root must come first, and each node after its parent")

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def edges(self) -> tuple[tuple[int, int], ...]:
        """From parent to child."""
        return tuple((parent, child) for child, parent in enumerate(self.parents) if child)


def labelled(node: nodes.Node) -> LabelledTree | None:
    """The tree as it is compared.

    A child takes its Inverter's place.  LAT conditions are left out, and so is a group of which
    they leave nothing.

    Returns:
        The tree; None where nothing is left.
    """
    found = tuple(_preorder(node, -1, 0))
    if not found:
        return None
    return LabelledTree(tuple(label for label, _ in found), tuple(parent for _, parent in found))


def _preorder(node: nodes.Node, parent: int, place: int) -> Iterator[tuple[str, int]]:
    """Label and parent of each node that is compared, the first of which gets the place."""
    match node:
        case nodes.Inverter(child=child):
            yield from _preorder(child, parent, place)
        case nodes.Action(label=label):
            yield f"Action {label}", parent
        case nodes.Condition(literal=literal):
            if not isinstance(literal.condition, PreviousActionIs | LastActionIs):
                yield f"Condition {' - '.join(features_of(literal.condition))}", parent
        case _:
            below: list[tuple[str, int]] = []
            for child in node.children:
                below.extend(_preorder(child, place, place + 1 + len(below)))
            if below:
                yield type(node).__name__, parent
                yield from below
