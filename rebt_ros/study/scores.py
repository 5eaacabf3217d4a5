"""How near generated subtrees come to simulated ones, by graph edit distance (paper, IV-B).

distance
    The upper bound of the graph edit distance, which is the measure of record.
level's score
    The least distance between a simulated subtree and the generated subtrees of a pruning level.

A simulated subtree has one score per mode and pruning level; their minimum and median are compared.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from rebt_ros.behavior_tree import nodes
from rebt_ros.study.edit_distance.bounds import Bounds, distance_bounds
from rebt_ros.study.edit_distance.canonical import canonical
from rebt_ros.study.edit_distance.labelled_tree import LabelledTree, labelled
from rebt_ros.study.results import Score
from rebt_ros.study.subtree_text import one_line


@dataclass(frozen=True, slots=True)
class ComparedTree:
    """A subtree in the form in which it is compared."""

    tree: LabelledTree
    node: nodes.Node
    """As it was simulated or generated."""

    @property
    def repeaters(self) -> int:
        """Number of Repeaters."""
        return self.tree.labels.count(nodes.Repeater.__name__)

    @property
    def psa(self) -> int:
        """Number of Parallel/Selector nodes."""
        return self.tree.labels.count(nodes.ParallelSelector.__name__)


@dataclass(frozen=True, slots=True)
class LevelScore:
    """The score of one pruning level."""

    distance: float
    at_least: float
    best: ComparedTree


class Distances:
    """Measures each pair of different trees once, however often it comes up."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Bounds] = {}
        self.compared = 0
        """Pairs that were compared, repeated ones counted again and again."""
        self.excluded = 0
        """Of these, pairs that need no measuring: their labels differ too much to be nearest."""

    @property
    def measured(self) -> int:
        """Pairs of different trees that were measured."""
        return len(self._known)

    def between(self, one: LabelledTree, other: LabelledTree) -> Bounds:
        """The bounds of the distance of a pair."""
        key = (canonical(one).code, canonical(other).code)
        if key not in self._known:
            self._known[key] = distance_bounds(one, other)
        return self._known[key]

    def level_score(
        self, simulated: LabelledTree, generated: Sequence[ComparedTree]
    ) -> LevelScore | None:
        """The score of one level; None where it offers nothing that can be compared."""
        self.compared += len(generated)
        near = sorted(
            (_labels_apart(simulated, one.tree), place) for place, one in enumerate(generated)
        )
        at_least = float("inf")
        # Distance, nodes and place of the nearest one.
        best: tuple[float, int, int] | None = None
        for number, (apart, place) in enumerate(near):
            if best is not None and apart > best[0]:
                self.excluded += len(near) - number
                break
            tree = generated[place].tree
            bounds = self.between(simulated, tree)
            at_least = min(at_least, bounds.lower)
            found = (bounds.upper, len(tree), place)
            best = found if best is None else min(best, found)
        return None if best is None else LevelScore(best[0], at_least, generated[best[2]])


def score(
    simulated: LabelledTree, levels: Sequence[Sequence[ComparedTree]], distances: Distances
) -> Score:
    """What the generated subtrees of all pruning levels reach together.

    Args:
        simulated: The subtree that was simulated.
        levels: The generated subtrees of each level, at least one in all.
        distances: Measures.
    """
    scored = [
        (number, one)
        for number, generated in enumerate(levels)
        if (one := distances.level_score(simulated, generated)) is not None
    ]
    level, best = min(scored, key=lambda pair: (pair[1].distance, len(pair[1].best.tree)))
    return Score(
        minimum=float(best.distance),
        minimum_at_least=float(min(one.at_least for _, one in scored)),
        median=float(median(one.distance for _, one in scored)),
        levels=len(scored),
        exact_levels=sum(one.distance == one.at_least for _, one in scored),
        nodes=len(best.best.tree),
        repeaters=best.best.repeaters,
        psa=best.best.psa,
        level=level,
        found=one_line(best.best.node),
    )


def comparable(subtrees: Sequence[nodes.Node]) -> tuple[ComparedTree, ...]:
    """The subtrees of which something is compared, those that are equal in it once."""
    found: dict[str, ComparedTree] = {}
    for node in subtrees:
        tree = labelled(node)
        if tree is not None:
            found.setdefault(canonical(tree).code, ComparedTree(tree, node))
    return tuple(found.values())


def _labels_apart(one: LabelledTree, other: LabelledTree) -> int:
    """A lower bound of the distance: what labels ask for, and the difference of edges."""
    common = (Counter(one.labels) & Counter(other.labels)).total()
    return max(len(one), len(other)) - common + abs(len(one) - len(other))
