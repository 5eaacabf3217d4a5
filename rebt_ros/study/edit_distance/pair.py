"""Mappings between the nodes of two trees, what they score, and how swaps improve them.

mapping
    For each node of the smaller tree another node of the larger one.
score
    Of a mapping: 1 for each node with the label of its image, 2 for each edge whose image is an
    edge.

Of the edit paths between two trees of m <= n nodes, one of the cheapest deletes no node of the
smaller tree: deleting one and inserting another costs 2, substituting it at most 1, and edges can
only gain.  So its edit path is a mapping, and it costs n - m insertions of nodes, a substitution
for each of the m nodes but those that keep their label, and each of the (m - 1) + (n - 1) edges but
those that are kept, which are missing on both sides: m + 2n - 2 less the score.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rebt_ros.study.edit_distance.canonical import CanonicalTree, Integers

Numbers: TypeAlias = NDArray[np.float64]

#: Pairs of nodes that the search for swaps may look at.
_MOST_WORK = 20_000_000


@dataclass(frozen=True, slots=True)
class Pair:
    """Two trees, the smaller one first."""

    small: CanonicalTree
    large: CanonicalTree
    same_label: Numbers
    """1 where a node of the small tree and one of the large one have the same label, 0 elsewhere;
    shape (small, large)."""

    @classmethod
    def of(cls, small: CanonicalTree, large: CanonicalTree) -> Pair:
        """The pair of a tree and one that is not smaller."""
        numbers = {label: number for number, label in enumerate(dict.fromkeys(small.labels))}
        rows = np.array([numbers[label] for label in small.labels])
        columns = np.array([numbers.get(label, -1) for label in large.labels])
        return cls(small, large, (rows[:, None] == columns).astype(np.float64))

    def distance(self, score: float) -> float:
        """The cost of a mapping with that score."""
        return len(self.small) + 2 * len(self.large) - 2 - score

    def score(self, mapping: Integers) -> float:
        """The score of a mapping."""
        labels = self.same_label[np.arange(len(mapping)), mapping].sum()
        kept = mapping[self.small.parents[1:]] == self.large.parents[mapping[1:]]
        return float(labels + 2 * np.count_nonzero(kept))


class Swaps:
    """Local search: swaps the images of two nodes while that scores more.

    The small tree is filled up with nodes without label and edges, so that a swap with one of them
    is a move to a free node.
    """

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        # So many that no two trees take longer than a second or so.
        self._left = max(_MOST_WORK // len(pair.large) ** 2, 1)

    def improved(self, mapping: Integers) -> Integers:
        """The mapping after the best swaps, until none scores more."""
        large = len(self._pair.large)
        free = np.ones(large, dtype=np.bool_)
        free[mapping] = False
        images = np.concatenate([mapping, np.flatnonzero(free)])
        while self._left:
            self._left -= 1
            gains = self._gains(images)
            one, other = divmod(int(gains.argmax()), large)
            if gains[one, other] <= 0:
                break
            images[[one, other]] = images[[other, one]]
        return images[: len(mapping)]

    def _gains(self, images: Integers) -> Numbers:
        """How much more each swap scores, shape (small, large)."""
        pair = self._pair
        small, large = len(pair.small), len(pair.large)
        parents = pair.small.parents[1:]
        # Of every image, the parent; of every node but the root, that of its image.
        above = pair.large.parents[images]
        above_below = above[1:small]
        whose = np.empty(large, dtype=np.intp)
        whose[images] = np.arange(large)
        # Score of a node's label and edges, all others staying, at the image of each other one.
        there = np.zeros((large, large))
        there[:small] = pair.same_label[:, images]
        there[1:small] += 2.0 * (images[parents][:, None] == above)
        has_parent = above_below >= 0
        np.add.at(there, (parents[has_parent], whose[above_below[has_parent]]), 2.0)
        here = there.diagonal()
        gains: Numbers = there[:small] + there[:, :small].T - here[:small, None] - here
        # An edge between the two is counted twice above, before the swap, and not after it.
        children = np.arange(1, small)
        between = 2.0 * (above_below == images[parents]) + 2.0 * (
            above[parents] == images[children]
        )
        gains[parents, children] += between
        gains[children, parents] += between
        return gains
