"""The graph edit distance of two trees, between bounds that nearly always meet.

graph edit distance
    Least number of insertions and deletions of nodes and of edges, and of substitutions of nodes by
    ones with another label, that make one directed graph of the other, as networkx counts them.

The order of children does not count, and neither does that of the two trees.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rebt_ros.study.edit_distance.canonical import (
    CanonicalTree,
    Integers,
    canonical,
)
from rebt_ros.study.edit_distance.integer_program import TOLERANCE, solve
from rebt_ros.study.edit_distance.labelled_tree import LabelledTree
from rebt_ros.study.edit_distance.pair import Pair, Swaps
from rebt_ros.study.edit_distance.relaxation import ROUNDING, Relaxation

#: Assignment problems per pair.
_MOST_STEPS = 30
#: Mappings per pair that are improved by swaps though they score no more than others.
_MOST_STARTS = 4
#: Pairs of nodes up to which bounds that have not met by then go to the linear program, which takes
#: some milliseconds, and after it to the integer one: the largest take less than 1 s or so.
_LARGEST_LINEAR, _LARGEST_INTEGER = 2_500, 500
#: Pairs of nodes beyond which labels only are looked at: no behavior tree to be read is so large.
_LARGEST_RELAXATION = 250_000


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a graph edit distance lies between.

    >>> Bounds(3, 3).exact
    True
    """

    lower: int
    upper: int
    """The cost of an edit path that was found."""

    @property
    def exact(self) -> bool:
        """Whether it is known."""
        return self.lower == self.upper


def distance_bounds(first: LabelledTree, second: LabelledTree) -> Bounds:
    """Bounds of the graph edit distance of two trees, in bounded time.

    >>> sequence = LabelledTree(("Sequence", "Action go", "Action grasp"), (-1, 0, 0))
    >>> selector = LabelledTree(("Selector", "Action grasp"), (-1, 0))
    >>> distance_bounds(sequence, selector)
    Bounds(lower=3, upper=3)
    """
    return _compared(*_ordered(canonical(first), canonical(second)))[0]


def _ordered(one: CanonicalTree, other: CanonicalTree) -> tuple[CanonicalTree, CanonicalTree]:
    """The smaller tree first; so that results do not depend on who is first."""
    return (one, other) if (len(one), one.code) <= (len(other), other.code) else (other, one)


def _least_distance(one: CanonicalTree, other: CanonicalTree) -> int:
    """What the labels and the numbers of children alone say."""
    small, large = _ordered(one, other)
    same = (Counter(small.labels) & Counter(large.labels)).total()
    # A node keeps as many edges to children as its image has at most; no pairing of the numbers
    # has more in common than that of both in descending order.
    edges = sum(map(min, small.families, large.families))
    return len(small) + 2 * len(large) - 2 - same - 2 * edges


@lru_cache(maxsize=1 << 16)
def _compared(small: CanonicalTree, large: CanonicalTree) -> tuple[Bounds, tuple[int, ...]]:
    """The bounds, and the images of the small tree's nodes that cost the upper one."""
    if small == large:
        return Bounds(0, 0), tuple(range(len(small)))
    if len(small) * len(large) > _LARGEST_RELAXATION:
        return _by_labels(small, large)
    search = _Search(Pair.of(small, large))
    search.run()
    return search.bounds, tuple(search.mapping.tolist())


def _by_labels(small: CanonicalTree, large: CanonicalTree) -> tuple[Bounds, tuple[int, ...]]:
    """As `_compared`, for trees of any size."""
    free: dict[str, list[int]] = {}
    for image in reversed(range(len(large))):
        free.setdefault(large.labels[image], []).append(image)
    kept = [below.pop() if (below := free.get(label)) else -1 for label in small.labels]
    others = iter(sorted(image for images in free.values() for image in images))
    images = np.array([next(others) if image < 0 else image for image in kept])
    edges = np.count_nonzero(images[small.parents[1:]] == large.parents[images[1:]])
    same = len(kept) - kept.count(-1)
    upper = len(small) + 2 * len(large) - 2 - same - 2 * int(edges)
    return Bounds(_least_distance(small, large), upper), tuple(images.tolist())


class _Search:
    """The best mapping so far, and what no mapping can score."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair
        self._most = pair.same_label.max(axis=1).sum() + 2.0 * (len(pair.small) - 1)
        self._swaps = Swaps(pair)
        self._seen: set[bytes] = set()
        self._score = -math.inf
        self.mapping: Integers = np.empty(0, dtype=np.intp)

    @property
    def bounds(self) -> Bounds:
        """Of the distance."""
        return Bounds(
            round(self._pair.distance(self._most)), round(self._pair.distance(self._score))
        )

    def run(self) -> None:
        """Brings the bounds together, the cheapest means first."""
        if len(self._pair.small) == 1:
            self._try(np.array([self._pair.same_label[0].argmax()]))
            return
        relaxation = Relaxation(self._pair)
        for _ in range(_MOST_STEPS):
            self._limit(relaxation.bound)
            self._try(relaxation.mapping)
            if self._done:
                return
            if not relaxation.step(self._score):
                break
            relaxation.assign()
        for whole, largest in ((False, _LARGEST_LINEAR), (True, _LARGEST_INTEGER)):
            if self._pair.same_label.size > largest:
                return
            solution = solve(self._pair, whole=whole)
            self._limit(solution.bound, TOLERANCE)
            if solution.mapping is not None:
                self._try(solution.mapping)
            if self._done:
                return

    @property
    def _done(self) -> bool:
        return bool(self._score >= self._most)

    def _limit(self, bound: float, tolerance: float = ROUNDING) -> None:
        """Scores are whole numbers."""
        if math.isfinite(bound):
            self._most = min(self._most, math.floor(bound + tolerance))

    def _try(self, mapping: Integers) -> None:
        key = mapping.tobytes()
        if key in self._seen:
            return
        self._seen.add(key)
        if len(self._seen) > _MOST_STARTS and self._pair.score(mapping) <= self._score:
            return
        improved = self._swaps.improved(mapping)
        score = self._pair.score(improved)
        if score > self._score:
            self._score, self.mapping = score, improved
